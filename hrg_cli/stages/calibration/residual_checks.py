"""What the residuals of a calibration say: stray odd harmonics (a defect of the electronics),
angles too noisy for the harmonics."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...fitting.noise.increment_noise import build_covariance_bands, whiten
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import TableSolution
from ...fitting.tables.table_design import predict_turn

Array = np.ndarray
STRAY_PROBABILITY = 1e-6
LARGEST_DAMPING = 0.02
ABOVE = 4
"""Harmonics of 2mθ beyond the band limit that are looked for: of a defect that falls slowly the
next are the largest."""


def find_stray_harmonics(fitted: Fitted, solution: TableSolution) -> list[dict[str, Any]]:
    """Amplitudes of the harmonics mθ and 3mθ in what the tables leave.

    No linear time-invariant defect makes them, an additive signal does. Each run has its own cosine
    and sine (the wave's label mθ or mθ + π is free), fitted beside its even harmonics; their χ² are
    added.

    Parameters
    ----------
    fitted
        The runs.
    solution
        The tables' coefficients.

    Returns
    -------
    list of dict
        Harmonic, amplitude [rad/s], its probability by chance, and what to do; empty where no wave
        turns far enough.

    Examples
    --------
    Waves that drift as the tables say hold none:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.residual_checks import find_stray_harmonics
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> [stray["significant"] for stray in find_stray_harmonics(fitted, fitted.solution)]
    [False, False]
    """
    orders = (n * fitted.layout.mode_number for n in (1, 3))
    return [
        _table_of_stray(n, *size)
        for n in orders
        if (size := _measure_harmonic(fitted, solution, n)) is not None
    ]


def say_harmonics_above(fitted: Fitted) -> list[str]:
    """What the residual holds of harmonics of 2mθ above the tables' band limit, and the option that
    takes them in.

    Parameters
    ----------
    fitted
        The runs.

    Returns
    -------
    list of str
        One sentence, or none.

    Examples
    --------
    Waves that drift as the tables say hold none:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.residual_checks import say_harmonics_above
    >>> random = np.random.default_rng(1)
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 1, 0)
    >>> paths = [draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)]
    >>> say_harmonics_above(fit(paths, layout))
    []
    """
    m2, limit = 2 * fitted.layout.mode_number, fitted.layout.drift_harmonics
    held = {
        k: size[0]
        for k in range(limit + 1, limit + 1 + ABOVE)
        if (size := _measure_harmonic(fitted, fitted.solution, k * m2)) is not None
        and size[1] < STRAY_PROBABILITY
    }
    if not held:
        return []
    largest = max(held, key=lambda k: held[k])
    return [
        f"the residual holds the harmonic {m2 * largest}θ, of {held[largest]:.2g} rad/s, and the"
        f" tables end at {m2 * limit}θ: take it in with --harmonics {max(held)}"
    ]


def _measure_harmonic(
    fitted: Fitted, solution: TableSolution, n: int
) -> tuple[float, float] | None:
    """Amplitude [rad/s] of nθ in what the tables leave, and its probability by chance; None where
    no wave turns far enough."""
    from scipy.stats import chi2

    found = [
        one
        for r in range(len(fitted.paths))
        if (one := _harmonic_of_run(fitted, solution, r, n)) is not None
    ]
    if not found:
        return None
    total = sum(float(a @ np.linalg.solve(covariance, a)) for a, covariance in found)
    # without what noise alone puts into a square
    power = sum(float(a @ a - np.trace(covariance)) for a, covariance in found)
    probability = float(chi2.sf(total, 2 * len(found)))
    return float(np.sqrt(max(power, 0.0) / len(found))), probability


def _harmonic_of_run(
    fitted: Fitted, solution: TableSolution, r: int, n: int
) -> tuple[Array, Array] | None:
    """Cosine and sine [rad/s] of nθ in run r's residual with their covariance (2, 2); None where
    the wave turns too little to tell them from the tables' harmonics."""
    layout, path = fitted.layout, fitted.paths[r]
    angle = path.average_neighbours(path.angle_rad)
    if np.ptp(angle) < 2 * np.pi / layout.mode_number:
        return None
    travel = np.diff(path.angle_rad)
    # what the mean over an increment, and over the windows at its ends, leaves of a harmonic
    loss = np.sinc(n * travel / (2 * np.pi)) * np.sinc(
        n * travel * path.average_neighbours(path.blur_s) / path.interval_s / (2 * np.pi)
    )
    odd = np.stack([np.cos(n * angle), np.sin(n * angle)], axis=1) * loss[:, None]
    even = path.build_angle_basis(layout.drift_harmonics)
    columns = np.concatenate([even, odd], axis=1) * path.interval_s[:, None]
    residual = fitted.turns[r] - predict_turn(
        path, layout, solution.coefficients, solution.coefficients
    )
    bands = build_covariance_bands(path, fitted.noises[r])
    white, _ = whiten(bands, np.column_stack([columns, residual]))
    X = white[:, :-1]
    found, _, rank, _ = np.linalg.lstsq(X, white[:, -1], rcond=None)
    if rank < X.shape[1]:
        return None
    return found[-2:], np.linalg.inv(X.T @ X)[-2:, -2:] * fitted.chi2_per_dof


def _table_of_stray(n: int, amplitude_rad_s: float, probability: float) -> dict[str, Any]:
    return {
        "harmonic": f"{n}θ",
        "amplitude_rad_s": amplitude_rad_s,
        "p_value": probability,
        "significant": probability < STRAY_PROBABILITY,
        "sentence": (
            f"a stray harmonic {n}θ of {amplitude_rad_s:.2e} rad/s is in the residual; it is not"
            " in the tables: look in the electronics for drive feed-through, an offset at"
            " the resonance or a parasitic force"
        ),
    }


def find_noisy_angles(fitted: Fitted, drift_limit: int) -> list[str]:
    """Runs whose angle noise damps the highest harmonic by more than a fiftieth.

    A basis taken at angles of variance s² loses 1 − exp(−n²s²/2) of the harmonic nθ.

    Parameters
    ----------
    fitted
        The runs with their noise.
    drift_limit
        Highest harmonic of 2mθ in the drift.

    Returns
    -------
    list of str
        A sentence a run; empty where all are quiet.

    Examples
    --------
    Noise of 10 mrad of mθ in a block and harmonics up to 4mθ, then noise of 100 mrad:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.increment_noise import AngleNoise
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.residual_checks import find_noisy_angles
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 2, 0)
    >>> paths, noises = [Told(mode_number=2, run_id="a")], [AngleNoise(1e-4, 0.0)]
    >>> find_noisy_angles(Told(layout=layout, paths=paths, noises=noises), 2)
    []
    >>> find_noisy_angles(Told(layout=layout, paths=paths, noises=[AngleNoise(1e-2, 0.0)]), 2)
    ['run a: angle noise of 0.05 rad a block damps the harmonic 8θ by 7.7 %; ...']
    """
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
