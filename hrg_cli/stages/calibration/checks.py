"""What the residuals of a calibration say: stray odd harmonics (a defect of the electronics), angles
too noisy for the harmonics."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...fitting.tables.increment_noise import covariance_bands, whiten
from ...fitting.tables.joint import Fitted, TableSolution, predict_turn

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
