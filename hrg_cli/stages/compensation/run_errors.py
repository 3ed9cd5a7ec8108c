"""Figures of a compensated run, summed piece by piece: its errors against the rate log, and the
deviations that it states."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...fitting.tables.increments import AnglePath
from ..calibration.residual_errors import CELLS_A_PERIOD
from ..figures_of_merit import compute_allan_figures

Array = np.ndarray
LEAST_RATES, MOST_RATES = 100, 100_000
"""Rates between which an Allan deviation is made; longer runs are averaged to the most."""


class Totals:
    """Sums over the run: squares of the residuals, their means in cells of wave angle, and how the
    wave follows the rate log."""

    def __init__(self, cells: Array, together: int) -> None:
        self.cells, self.together = cells, together
        self.errors: list[Array] = []
        self.time_s = 0.0
        self.squares, self.rows = np.zeros(2), 0
        self.followed = self.turned = 0.0
        self.windows_s = 0.0
        """Sum over the increments of the mean width of the blocks at their ends."""
        self.bend_off_s = 0.0

    def add(self, path: AnglePath, before: Array, after: Array) -> None:
        """Take in the increments whose rate is known: those whose errors are finite."""
        known = np.isfinite(after)
        if not known.any():
            return
        before, after, time = before[known], after[known], path.interval_s[known]
        rotation, turn = path.rotation[known], path.turn[known]
        period = np.pi / path.mode_number
        cell = (
            np.mod(path.average_neighbours(path.angle_rad)[known], period) / period * CELLS_A_PERIOD
        ).astype(int) % CELLS_A_PERIOD
        for row, weight in enumerate((time, before * time, after * time)):
            self.cells[row] += np.bincount(cell, weight, CELLS_A_PERIOD)
        whole = len(after) // self.together * self.together
        self.errors.append(after[:whole].reshape(-1, self.together).mean(axis=1))
        self.time_s += float(time.sum())
        self.windows_s += float(path.average_neighbours(path.width_s)[known].sum())
        self.bend_off_s = path.bend_off_s
        self.squares += [before @ before, after @ after]
        self.rows += len(before)
        self.followed += float(turn @ rotation)
        self.turned += float(rotation @ rotation)

    @property
    def scale_factor_seen(self) -> float:
        """Least-squares K of m·Δθ = −K∫Ω dt; NaN without rotation."""
        return -self.followed / self.turned if self.turned > 0 else float("nan")

    def compute_figures(self) -> dict[str, Any]:
        """Rms of the errors and of their means in cells of wave angle, and the trade's."""
        seen = self.cells[0] > 0
        means = self.cells[1:, seen] / self.cells[0, seen]
        row = np.sqrt(self.squares / max(self.rows, 1))
        cell = np.sqrt((means**2).mean(axis=1)) if seen.any() else np.zeros(2)
        return {
            "residual_rms_rad_s": {"before": float(row[0]), "after": float(row[1])},
            "angle_cell_rms_rad_s": {"before": float(cell[0]), "after": float(cell[1])},
            **self.compute_trade_figures(),
        }

    def compute_trade_figures(self) -> dict[str, dict[str, Any]]:
        """Bias residual and Allan coefficients of the compensated rate's error (None: not seen),
        then these with 95 % intervals.

        Empty for a short run.
        """
        errors = np.concatenate(self.errors) if self.errors else np.zeros(0)
        if len(errors) < LEAST_RATES:
            return {"trade": {}}
        rows = max(self.rows, 1)
        found = compute_allan_figures(
            errors, self.time_s / rows * self.together, self.windows_s / rows, self.bend_off_s
        )
        trade = {
            "bias_residual_rad_s": float(errors.mean()),
            "white_angle_noise_rad": found.quantization_rad or None,
            "angle_random_walk_rad_sqrt_s": found.angle_random_walk_rad_sqrt_s or None,
            "bias_instability_rad_s": found.bias_instability_rad_s or None,
            "rate_random_walk_rad_s_sqrt_s": found.rate_random_walk_rad_s_sqrt_s or None,
        }
        return {"trade": trade, "allan": {**found.intervals, "chi2_per_dof": found.chi2_per_dof}}


class RateSpread:
    """Sums over the run of the squares of the stated deviations, and of errors over them."""

    def __init__(self) -> None:
        self.squares, self.rows = np.zeros(2), 0
        self.over, self.held = 0.0, 0

    def add(self, noise: Array, own: Array, error: Array | None) -> None:
        """Take in increments by their deviations by noise and tables, and the errors against a
        rate log (None: no log)."""
        known = np.isfinite(noise + own)
        self.squares += [noise[known] @ noise[known], own[known] @ own[known]]
        self.rows += int(known.sum())
        if error is not None:
            ratio = error / np.hypot(noise, own)
            ratio = ratio[np.isfinite(ratio)]
            self.over += float(ratio @ ratio)
            self.held += len(ratio)

    def compute_figures(self) -> dict[str, Any]:
        """Rms of the deviations by part, and of the errors over them; empty where none is
        stated."""
        if not self.rows:
            return {}
        noise, own = np.sqrt(self.squares / self.rows)
        std = {
            "rms": float(np.hypot(noise, own)),
            "by_noise": float(noise),
            "by_tables": float(own),
        }
        over = {"error_over_std_rms": float(np.sqrt(self.over / self.held))} if self.held else {}
        return {"rate_std_rad_s": std, **over}
