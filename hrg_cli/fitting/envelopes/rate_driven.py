"""The rate of a driven run from the reference model (seed A's last task): moving axes, with the
control's contribution.

Seed A (7), exact in r = a_B/a_A (PHYSICS §4): the last two give
    KΩ = D − m·dθ/dt,   f = (a_Φ/a_A)·Δφ,
    D = [νδμ sin χ (1 + r²) − 2rδω cos ζ − f_B + r f_A]/(1 − r²).
The control's forces a_ΦA, a_ΦB are those logged, else the first two: a_ΦA = ȧ_A + ν_A a_A + δω_s
a_B, a_ΦB = ȧ_B + ν_B a_B − δω_s a_A; in phase (Δφ = 0), by force or by one ring electrode, they
turn nothing. A main force that stands τ behind the wave turns it back by τ(a_ΦA/a_A)·m·dθ/dt: then
KΩ = D − (1 + τ a_ΦA/a_A)·m·dθ/dt. Ω(t) is a cubic spline through its values at even nodes, fitted
to mθ(t) − ∫D dt, which is linear in them; the noise of D's measured r and the resonator's own
covariance are in the deviations.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from ...errors import HrgError
from ...physics import drift as law
from ...physics.resonator import Mechanics
from ...records import Resonator, Wave
from ..least_squares import invert_scaled
from .rate_estimate import MOST_NODES, RateEstimate, integrate_cardinals
from .rate_from_model import ROWS_A_FINER_NODE, TOO_COARSE, count_nodes
from .resonator_spread import (
    compute_vector_covariance,
    from_vector,
    make_mechanics,
    make_vector,
    spread_points,
)

Array = np.ndarray
ROWS = 4000
"""Averaged rows that are fitted."""


@dataclasses.dataclass(frozen=True)
class _Run:
    """A driven run's good rows: t, mθ and its σ, what of it late loops took back, θ, r and its σ,
    relative forces a_ΦA/a_A and a_ΦB/a_A [1/s]."""

    time_s: Array
    turned: Array
    turned_std: Array
    taken_back: Array
    angle: Array
    ratio: Array
    ratio_std: Array
    main: Array
    quadrature: Array


def fit_driven_rate(
    wave: Wave,
    resonator: Resonator,
    nodes: int | None = None,
    main_phase_error_rad: float = 0.0,
    quadrature_phase_error_rad: float = 0.0,
    loop_delay_s: float = 0.0,
) -> RateEstimate:
    """Ω(t) of a driven run on even times, given the resonator.

    Parameters
    ----------
    wave
        A driven run, with its forces where they are logged.
    resonator
        As it was identified.
    nodes
        Of the spline; None: 20, fewer for a short run, and twice as many again and again while χ²
        asks for them.
    main_phase_error_rad, quadrature_phase_error_rad
        Of the forces, where they are known.
    loop_delay_s
        By which the main force stands behind the wave.

    Returns
    -------
    RateEstimate
        On the nodes.

    Raises
    ------
    HrgError
        The resonator has no scale factor, or too few windows for the nodes.

    Examples
    --------
    A straight wave in an even shell has no drift: turned back by 0.5 rad/s of mθ, K = 0.5, it saw
    1 rad/s.

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Resonator, Wave
    >>> from hrg_cli.fitting.envelopes.rate_driven import fit_driven_rate
    >>> name = np.array(["frequency_hz", "damping_rate_1_s", "scale_factor"])
    >>> exact = dict(std=np.zeros(3), covariance=np.zeros((3, 3)))
    >>> units, value = np.array(["Hz", "s-1", "1"]), np.array([5e3, 0.1, 0.5])
    >>> gyro = Resonator(name=name, units=units, value=value, **exact)
    >>> t = np.arange(0.0, 10.0, 0.05)
    >>> wave = Wave(**{f.name: 0 * t + 1e-5 for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=np.zeros(200, "u1"), iterations=np.zeros(200, "i2"), mode="forced",
    ...     main_amplitude=1 + 0 * t, quadrature_amplitude=0 * t, wave_angle_rad=-0.25 * t,
    ...     phase_rad=0 * t, reference_frequency_hz=5e3, window_s=0.05,
    ... ))
    >>> fit_driven_rate(wave, gyro, 4).rate_rad_s.round(4).tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    if not resonator.parameters().get("scale_factor", (0.0, 0.0, ""))[0]:
        raise HrgError(
            f"{resonator.gyro_id or 'the resonator'}: has no scale_factor, which a rate needs;"
            " identify it with rotated runs"
        )
    g = make_mechanics(resonator)
    run = _run(wave, g, loop_delay_s)
    windows = len(run.time_s)
    count, most = count_nodes(wave.run_id or "the run", windows, float(wave.window_s), nodes)
    errors = (main_phase_error_rad, quadrature_phase_error_rad)
    found = _fit_nodes(run, resonator, g, count, errors)
    while True:
        found = dataclasses.replace(
            found, most_nodes=min(most, MOST_NODES), window_s=float(wave.window_s)
        )
        finer_count = 2 * len(found.time_s) - 1
        if finer_count > min(windows // ROWS_A_FINER_NODE, MOST_NODES):
            return found
        finer = _fit_nodes(run, resonator, g, finer_count, errors)
        gained = finer.measure_loss(len(found.time_s))
        found = dataclasses.replace(found, finer=gained)
        if nodes is not None or gained.z < TOO_COARSE or finer_count > most:
            return found
        found = finer


def _run(wave: Wave, g: Mechanics, loop_delay_s: float) -> _Run:
    good = wave.good()
    t, a_A, a_B, angle = (
        np.asarray(v, float)[good]
        for v in (wave.time_s, wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad)
    )
    r = a_B / a_A
    zeta = 2 * g.mode_number * (angle - g.stiffness_axis_rad)
    # Without a log of the drive its forces follow from the wave itself: seed A (7), solved for a_ΦA
    # and a_ΦB.
    friction = g.damping_split_1_s * np.cos(2 * g.mode_number * (angle - g.damping_axis_rad))
    along = g.frequency_split_rad_s * np.sin(zeta)
    main, quadrature = wave.drive_main, wave.drive_quadrature
    few = len(t) < 3
    slope = (lambda v: np.zeros_like(v)) if few else (lambda v: np.gradient(v, t))
    f_A = (
        slope(a_A) / a_A + g.damping_rate_1_s + friction + along * r
        if main is None
        else np.asarray(main, float)[good] / a_A
    )
    f_B = (
        slope(a_B) / a_A + (g.damping_rate_1_s - friction) * r - along
        if quadrature is None
        else np.asarray(quadrature, float)[good] / a_A
    )
    m = g.mode_number
    f_A, f_B = np.nan_to_num(f_A), np.nan_to_num(f_B)
    steps = np.diff(m * angle) * (f_A[1:] + f_A[:-1]) / 2
    taken_back = loop_delay_s * np.concatenate([[0.0], np.cumsum(steps)])
    return _Run(
        t, m * angle, m * np.asarray(wave.wave_angle_rad_std, float)[good], taken_back, angle, r,
        np.asarray(wave.quadrature_amplitude_std, float)[good] / a_A, f_A, f_B,
    )  # fmt: skip


def _fit_nodes(
    run: _Run, resonator: Resonator, g: Mechanics, nodes: int, errors: tuple[float, float]
) -> RateEstimate:
    """Weighted least squares of mθ − ∫D dt + K∫Ω dt on a constant and the nodes, rows averaged
    alike in design and data."""
    t = run.time_s
    grid = np.linspace(t[0], t[-1], nodes)
    groups = np.minimum(np.arange(len(t)) * min(ROWS, len(t)) // len(t), ROWS - 1)
    size = np.bincount(groups).astype(float)

    def mean(rows: Array) -> Array:
        return (
            np.stack([np.bincount(groups, row) for row in np.atleast_2d(rows)], axis=1)
            / size[:, None]
        )

    std = np.sqrt(mean(run.turned_std**2)[:, 0] / size)
    design = (
        np.column_stack([np.ones(len(size)), -g.scale_factor * mean(integrate_cardinals(grid, t))])
        / std[:, None]
    )
    operator = invert_scaled(design)
    drift = np.atleast_2d(_drift(g, run, errors))
    data = mean(run.turned + run.taken_back - _cumulate(drift, t))[:, 0] / std
    x = operator @ data
    left = data - design @ x
    chi2 = float(left @ left)
    dof = max(1, len(size) - nodes - 1)
    covariance = (operator @ operator.T)[1:, 1:] * max(1.0, chi2 / dof)
    covariance = (
        covariance
        + _propagate_ratio_noise(run, g, operator[1:] / std, groups)
        + _propagate_resonator(run, resonator, g, operator, mean, std, errors)
    )
    plain = (operator @ (mean(run.turned)[:, 0] / std))[1:]
    return RateEstimate(grid, x[1:], covariance, plain, chi2 / dof, dof, residual=left[:, None])


def _drift(g: Mechanics, run: _Run, errors: tuple[float, float]) -> Array:
    return law.compute_drift(
        g, run.angle, run.ratio, run.quadrature * errors[1], run.main * errors[0]
    )


def _propagate_ratio_noise(run: _Run, g: Mechanics, rows: Array, groups: Array) -> Array:
    """Covariance of the nodes by the noise of r in D: −2δω cos ζ·r summed up, so a row's noise
    moves all that follow."""
    zeta = 2 * g.mode_number * (run.angle - g.stiffness_axis_rad)
    step = np.gradient(run.time_s)
    # ∂D/∂r = −2δω cos ζ to first order in r (seed A (8)).
    noise = 2 * g.frequency_split_rad_s * np.cos(zeta) * run.ratio_std * step
    later = np.cumsum(rows[:, ::-1], axis=1)[
        :, ::-1
    ]  # what all averaged rows from one on do to the nodes
    moved_by = later[:, groups] * noise
    return np.asarray(moved_by @ moved_by.T)


def _propagate_resonator(run, resonator, g, operator, mean, std, errors):  # type: ignore[no-untyped-def]
    """Covariance of the nodes by the resonator's: the fit with the resonator moved along each of
    its uncertain directions."""
    gyros = from_vector(spread_points(make_vector(g), compute_vector_covariance(resonator)), g)
    data = run.turned + run.taken_back - _cumulate(_drift(gyros, run, errors), run.time_s)
    rates = (operator @ (mean(data) / std[:, None]))[1:] * (
        g.scale_factor / np.ravel(gyros.scale_factor)
    )
    half = (rates.shape[1] - 1) // 2
    odd = (rates[:, 1 : 1 + half] - rates[:, 1 + half :]) / 2
    return odd @ odd.T


def _cumulate(values: Array, t: Array) -> Array:
    """∫ from the first row along the last axis, by the trapezium rule."""
    pieces = (values[..., 1:] + values[..., :-1]) / 2 * np.diff(t)
    return np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(pieces, axis=-1)], axis=-1)
