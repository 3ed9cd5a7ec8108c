"""What the residuals of a calibration say: stray odd harmonics (a defect of the electronics), doubt
from interpolation."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...fitting.tables.increment_noise import covariance_bands, whiten
from ...fitting.tables.joint import Fitted, TableSolution, predict_turn
from ...fourier import harmonic_basis, node_weights

Array = np.ndarray
STRAY_PROBABILITY = 1e-6
LARGEST_DAMPING = 0.02


def stray_harmonics(fitted: Fitted, solution: TableSolution) -> list[dict[str, Any]]:
    """Amplitudes of the harmonics mθ and 3mθ in the residual: no linear time-invariant defect makes
    them, an additive signal does.

    Each run has its own cosine and sine (the wave's label mθ or mθ + π is free), fitted beside its
    even harmonics; their χ² are added.
    """
    from scipy.stats import chi2

    layout, out = fitted.layout, []
    for order in (1, 3):
        n, total, runs, power = order * layout.mode_number, 0.0, 0, 0.0
        for path, turn, noise in zip(fitted.paths, fitted.turns, fitted.noises):
            angle = path.middle(path.angle_rad)
            if np.ptp(angle) < 2 * np.pi / layout.mode_number:
                continue
            travel = np.diff(path.angle_rad)
            loss = np.sinc(n * travel / (2 * np.pi)) * np.sinc(
                n * travel * path.middle(path.blur_s) / path.interval_s / (2 * np.pi)
            )
            odd = np.stack([np.cos(n * angle), np.sin(n * angle)], axis=1) * loss[:, None]
            columns = (
                np.concatenate([path.angle_basis(layout.drift_harmonics), odd], axis=1)
                * path.interval_s[:, None]
            )
            residual = turn - predict_turn(
                path, layout, solution.coefficients, solution.coefficients
            )
            white, _ = whiten(covariance_bands(path, noise), np.column_stack([columns, residual]))
            found, _, rank, _ = np.linalg.lstsq(white[:, :-1], white[:, -1], rcond=None)
            if rank < white.shape[1] - 1:
                continue
            covariance = (
                np.linalg.inv(white[:, :-1].T @ white[:, :-1])[-2:, -2:] * fitted.chi2_per_dof
            )
            total += float(found[-2:] @ np.linalg.solve(covariance, found[-2:]))
            power += float(found[-2:] @ found[-2:] - np.trace(covariance))
            runs += 1
        if not runs:
            continue
        probability = float(chi2.sf(total, 2 * runs))
        amplitude = float(np.sqrt(max(power, 0.0) / runs))
        out.append(
            {
                "harmonic": f"{n}θ",
                "amplitude_rad_s": amplitude,
                "p_value": probability,
                "significant": probability < STRAY_PROBABILITY,
                "sentence": (
                    f"a stray harmonic {n}θ of {amplitude:.2e} rad/s is in the residual; it is not"
                    " in the tables: look in the electronics for drive feed-through, an offset at"
                    " the resonance or a parasitic force"
                ),
            }
        )
    return out


def noisy_angles(fitted: Fitted, drift_limit: int) -> list[str]:
    """Runs whose angle noise s damps the highest harmonic: a basis taken at the measured angle
    loses exp(−n²s²/2) of nθ."""
    n = 2 * fitted.layout.mode_number * drift_limit
    out = []
    for path, noise in zip(fitted.paths, fitted.noises):
        lost = 1 - np.exp(-noise.white * (n / path.mode_number) ** 2 / 2)
        if lost > LARGEST_DAMPING:
            spread = np.sqrt(noise.white) / path.mode_number
            out.append(
                f"run {path.run_id or '?'}: angle noise of {spread:.2g} rad a block damps the"
                f" harmonic {n}θ by {100 * lost:.1f} %; demodulate with longer windows"
            )
    return out


def interpolation_doubt(
    fitted: Fitted, solution: TableSolution, chi2: float, drift_limit: int, scale_limit: int
) -> dict[str, float]:
    """Standard deviation that interpolation adds midway between nodes, from predicting each inner
    node from the others.

    Leaving a node out doubles the spacing; what noise explains of the misses is taken off, the rest
    counts by a quarter (cubic; the outer stretches are the worst) or a third (linear, whose error
    falls with the square of the spacing).
    """
    layout = fitted.layout
    count = len(layout.nodes)
    kind = "cubic" if layout.interpolation in ("cubic", "smooth") else "linear"
    if count < (5 if kind == "cubic" else 3):
        return {}
    shrink = 1 / 4 if kind == "cubic" else 1 / 3
    tables = layout.tables(solution.coefficients)
    out = {}
    for name, table, limit, part in (
        ("drift_rad_s", tables[0], drift_limit, layout.drift),
        ("scale_factor", tables[1], scale_limit, layout.scale),
    ):
        size = 1 + 2 * limit
        basis = harmonic_basis(
            np.linspace(0, np.pi / layout.mode_number, 24, endpoint=False),
            limit,
            layout.mode_number,
        )
        places = np.concatenate([np.arange(layout.size)[part(j)][:size] for j in range(count)])
        covariance = solution.covariance[np.ix_(places, places)] * chi2
        excess = 0.0
        for j in range(1, count - 1):
            rest = np.arange(count) != j
            miss = np.zeros(count)
            miss[j], miss[rest] = 1.0, -node_weights(layout.nodes[[j]], layout.nodes[rest], kind)[0]
            rows = (miss[None, :, None] * basis[:, None, :]).reshape(len(basis), -1)
            seen = rows @ table[:, :size].ravel()
            excess += float(np.mean(seen**2 - np.einsum("ai,ij,aj->a", rows, covariance, rows)))
        out[name] = shrink * float(np.sqrt(max(excess, 0.0) / (count - 2)))
    return out
