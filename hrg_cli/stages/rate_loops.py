"""What a driven run's loops had to give, held against the resonator its rate is taken from.

Seed A (7): a_ΦA/a_A = ȧ_A/a_A + ν + νδμ cos χ + rδω sin ζ, a_ΦB/a_A = ȧ_B/a_A + (ν − νδμ cos χ)r −
δω sin ζ. So ln a_A and r, less the integrals of what the logged commands and the resonator say of
them, are constants; what the resonator has wrong is P∫cos 2mθ dt + Q∫sin 2mθ dt, in the first the
damping split, in the second the frequency split. The drift has the same P and Q, whoever is to
blame for them: another gyro's resonator, or forcers that are unlike (PHYSICS C3, C4). The forces'
common scale, and so ν itself, turns nothing: it is fitted beside.

Increments of block means are taken, as a drive log's gaps between its rows make the integrals walk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..fitting.checks import Check, check_at_most
from ..fitting.envelopes.rate_estimate import RateEstimate
from ..fitting.envelopes.resonator_spread import (
    compute_vector_covariance,
    from_vector,
    make_mechanics,
    make_vector,
    spread_points,
)
from ..physics.resonator import Mechanics
from ..records import Resonator, Wave
from .rate_nodes import DOUBTFUL

Array = np.ndarray
BLOCKS, LEAST_BLOCKS = 60, 12
"""Means that a run is cut into, and the fewest that tell four numbers and their scatter."""
LEAST_TURN = 2.0
"""2mθ [rad] that a wave has to pass, or its splits are part of the forces' scale."""
SURE = 5.0
"""Standard deviations of both by which the splits must be apart before they are doubted."""
FORCERS_ALIKE = 0.05
"""Part of a split that another scale of its force may make: five times what forcers are usually off
by, the quadrature's own beside the main one."""
A_GAP = 3.0
"""Times the median distance of rows from which nothing is known of the forces between two."""


@dataclass(frozen=True)
class _Run:
    """A driven run's good rows: t, 2mθ, ln a_A, r, and the relative forces [1/s]."""

    time_s: Array
    phase: Array
    log_amplitude: Array
    ratio: Array
    main: Array
    quadrature: Array | None


@dataclass(frozen=True)
class _Apart:
    """P and Q (2,) [rad/s] by which a split is another, over their standard deviations, and the
    forces' scale."""

    vector: Array
    over_std: float
    scale: float
    allowed: float = 0.0
    """Size of what was taken off P and Q, as forcers may make it."""

    @property
    def size(self) -> float:
        """By which the split is another, forcers and all."""
        return float(np.hypot(*self.vector)) + self.allowed


def check_loops(wave: Wave, resonator: Resonator, found: RateEstimate) -> list[Check]:
    """Whether the forces of a driven run are those that its resonator asks for.

    Parameters
    ----------
    wave
        The run; one that is free, turns too little or logs no drive is not judged.
    resonator
        As it was identified.
    found
        The rate by it.

    Returns
    -------
    list of Check
        Of the main force, and of the quadrature's where it is logged.

    Examples
    --------
    A free run has no forces:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rate_loops import check_loops
    >>> check_loops(Told(mode="free", drive_main=None), None, None)
    []
    """
    if wave.mode != "forced" or wave.drive_main is None:
        return []
    run, g = _read(wave), make_mechanics(resonator)
    if len(run.time_s) < 2 * LEAST_BLOCKS or np.ptp(run.phase) < LEAST_TURN:
        return []
    gyros = from_vector(spread_points(make_vector(g), compute_vector_covariance(resonator)), g)
    main = _fit(run, *_balance_main(run, gyros))
    if main is None or not main.scale > 0:
        return []
    sine, cosine = np.sin(run.phase), np.cos(run.phase)
    # a scale that is not 1 is the forcers', and all is greater by it, or ν's, and nothing is
    main = _allow(main, _find_damping(g), min(abs(main.scale - 1), FORCERS_ALIKE))
    drift = main.vector[0] * sine - main.vector[1] * cosine
    out = [_check("damping", main, drift, g, found)]
    if run.quadrature is not None:
        other = _fit(run, *_balance_quadrature(run, gyros, main.scale))
        if other is not None:
            other = _allow(other, _find_frequency(g), FORCERS_ALIKE)
            # D = −2rδω cos ζ, the slope of δω sin ζ = P cos + Q sin
            slope = -other.vector[0] * sine + other.vector[1] * cosine
            out.append(_check("frequency", other, 2 * run.ratio * slope, g, found))
    return out


def _read(wave: Wave) -> _Run:
    a_A, main = np.asarray(wave.main_amplitude, float), np.asarray(wave.drive_main, float)
    logged = None if wave.drive_quadrature is None else np.asarray(wave.drive_quadrature, float)
    good = wave.good() & np.isfinite(main) & (a_A > 0)
    if logged is not None:
        good &= np.isfinite(logged)
    a = a_A[good]
    return _Run(
        np.asarray(wave.time_s, float)[good],
        2 * wave.mode_number * np.asarray(wave.wave_angle_rad, float)[good],
        np.log(a),
        np.asarray(wave.quadrature_amplitude, float)[good] / a,
        main[good] / a,
        None if logged is None else logged[good] / a,
    )


def _balance_main(run: _Run, gyros: Mechanics) -> tuple[Array, Array]:
    """ln a_A and what the resonators (k, 1) take of it, (k, n), and the design of what may be
    other: the forces' scale, whether the quadrature's is a spring's, P and Q."""
    friction, along = _splits(run, gyros)
    lost = gyros.damping_rate_1_s + friction + along * run.ratio
    # a spring acts on the quadrature's own motion too, and gives r a_ΦB back to the main wave
    spring = np.zeros_like(run.ratio) if run.quadrature is None else run.ratio * run.quadrature
    # a greater split takes more of the amplitude
    columns = np.stack([run.main, spring, -np.cos(run.phase), -np.sin(run.phase)])
    return run.log_amplitude + _integrate(lost, run.time_s), _integrate(columns, run.time_s)


def _balance_quadrature(run: _Run, gyros: Mechanics, scale: float) -> tuple[Array, Array]:
    """r and what the forces and the resonators make of it; beside the split what follows r, by
    which a ring electrode's drive and the loop's own scale differ."""
    assert run.quadrature is not None
    friction, along = _splits(run, gyros)
    gained = scale * run.quadrature + along - (gyros.damping_rate_1_s - friction) * run.ratio
    growth = scale * run.main - gyros.damping_rate_1_s - friction - along * run.ratio
    columns = np.stack([run.ratio, np.cos(run.phase), np.sin(run.phase)])
    rest = run.ratio - _integrate(gained - run.ratio * growth, run.time_s)
    return rest, _integrate(columns, run.time_s)


def _splits(run: _Run, gyros: Mechanics) -> tuple[Array, Array]:
    """νδμ cos χ and δω sin ζ along the run."""
    m2 = 2 * gyros.mode_number
    friction = gyros.damping_split_1_s * np.cos(run.phase - m2 * gyros.damping_axis_rad)
    along = gyros.frequency_split_rad_s * np.sin(run.phase - m2 * gyros.stiffness_axis_rad)
    return np.atleast_2d(friction), np.atleast_2d(along)


def _find_damping(g: Mechanics) -> Array:
    """P and Q of νδμ cos χ."""
    axis = 2 * g.mode_number * g.damping_axis_rad
    return g.damping_split_1_s * np.array([np.cos(axis), np.sin(axis)])


def _find_frequency(g: Mechanics) -> Array:
    """P and Q of δω sin ζ."""
    axis = 2 * g.mode_number * g.stiffness_axis_rad
    return g.frequency_split_rad_s * np.array([-np.sin(axis), np.cos(axis)])


def _integrate(values: Array, t: Array) -> Array:
    steps = (values[..., 1:] + values[..., :-1]) / 2 * np.diff(t)
    return np.concatenate([np.zeros((*values.shape[:-1], 1)), np.cumsum(steps, axis=-1)], axis=-1)


def _fit(run: _Run, rests: Array, columns: Array) -> _Apart | None:
    """P and Q by least squares of the increments of block means; None where too few are whole."""
    steps = np.diff(run.time_s)
    blocks = min(BLOCKS, len(run.time_s) // 2)
    number = np.arange(len(run.time_s)) * blocks // len(run.time_s)
    broken = number[1:][steps > A_GAP * np.median(steps)]
    # a gap spoils its block, and so both increments of it, or the one that it lies in
    whole = ~(np.isin(np.arange(1, blocks), broken) | np.isin(np.arange(blocks - 1), broken))
    if whole.sum() < LEAST_BLOCKS:
        return None
    size = np.bincount(number, minlength=blocks)

    def take(rows: Array) -> Array:
        means = np.stack([np.bincount(number, row, blocks) / size for row in rows])
        return np.asarray(np.diff(means, axis=1)[:, whole])

    design, data = take(columns).T, take(np.atleast_2d(rests))
    operator = np.linalg.pinv(design)
    fitted = operator @ data.T
    left = data[0] - design @ fitted[:, 0]
    covariance = (operator @ operator.T) * (left @ left) / (len(left) - len(operator))
    half = (fitted.shape[1] - 1) // 2
    odd = (fitted[:, 1 : 1 + half] - fitted[:, 1 + half :]) / 2
    covariance = (covariance + odd @ odd.T)[-2:, -2:]
    vector = fitted[-2:, 0]
    over = float(np.sqrt(max(vector @ np.linalg.pinv(covariance) @ vector, 0.0)))
    return _Apart(vector, over, float(fitted[0, 0]))


def _allow(apart: _Apart, own: Array, part: float) -> _Apart:
    """Less what a scale that is `part` of the split's `own` vector (2,) off makes of it."""
    size = float(np.hypot(*own))
    if not size > 0:
        return apart
    along = own / size
    allowed = float(np.clip(apart.vector @ along, -part * size, part * size))
    return replace(apart, vector=apart.vector - allowed * along, allowed=abs(allowed))


def _check(split: str, apart: _Apart, drift: Array, g: Mechanics, found: RateEstimate) -> Check:
    """Whether the rate holds what the `drift` (n,) by a split that is another would add to it; one
    that is not surely another adds nothing."""
    off = float(np.sqrt(np.mean(drift**2))) / abs(g.scale_factor)
    std = float(np.median(found.rate_rad_s_std))
    own = g.damping_split_1_s if split == "damping" else g.frequency_split_rad_s
    unit = "1/s" if split == "damping" else "rad/s"
    force = "main" if split == "damping" else "quadrature"
    return check_at_most(
        f"{force}_force_is_the_resonators",
        (off / std) ** 2 if apart.over_std > SURE and std > 0 else 0.0,
        DOUBTFUL,
        f"the logged {force} force asks for a {split} split that differs from the resonator's"
        f" {abs(own):.4g} {unit} by {apart.size:.2g} {unit}, {apart.over_std:.3g} of the errors of"
        f" both: the rate is off by {off:.2g} rad/s or more, {off / std:.2g} of its standard"
        " deviations; the resonator is of another gyro or another day, or the forcers are unlike:"
        " identify the resonator again, from runs of the same day",
    )
