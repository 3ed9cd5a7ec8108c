"""Diagnosis, where the fit of the base model starts: the propagator of the free runs, or, of driven
runs alone, a linear regression on what the loops commanded.

u̇ = (L + jδ)u + F with the logged force F = e^{jφ}(f_A e_A − j f_B e_B) is linear in the
coordinates of L and in every run's δ: with c_k = ∫ B_k u dt from the run's first row,
    u(t) − ∫ F dt = u₀ + Σ p_k c_k(t) + jδ ∫ u dt.
A loop that nulls the quadrature hides the splits from the wave and shows them in its command. A
start without them lets that command build up a quadrature that nothing cancels, and a fit finds no
way back from a wave that has become a circle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....effects.effect import find_frame
from ....fitting.causes.slow_equation import apply_generators
from ....fitting.causes.wave_frame import to_reals
from ....fitting.envelopes import coordinates, propagator, rows
from ....fitting.envelopes.base_fit import start_from_propagator
from ....fitting.envelopes.base_freedom import Known, make_freedom
from ....fitting.envelopes.coordinates import COUNT, DAMPING, SCALE_FACTOR, SECOND_ORDER
from ....fitting.envelopes.envelope_runs import EnvelopeRun
from ....fitting.envelopes.phase_course import find_bends, straighten_phases
from ....fitting.least_squares import solve
from ....records import Wave

Array = np.ndarray
MOST_A_WINDOW = 2.0
"""Motion, rad, by which a wave may change from one window to the next."""
MOST_GROWTH = 10.0
"""Exponent by which a free wave may grow in the first guess: noise about a small damping makes far
less."""


def guess(
    runs: list[EnvelopeRun],
    free: list[EnvelopeRun],
    waves: Sequence[Wave],
    scale_factor: float | None,
    straight: bool = False,
) -> tuple[Array, Array]:
    """Coordinates and every run's frequency offset, before any fit.

    Parameters
    ----------
    runs
        Their envelopes.
    free
        Those of them that are not driven; the propagator starts from them.
    waves
        Of the runs.
    scale_factor
        That is held; None: it is not known.
    straight
        Without what moving frequencies bend the phases by.

    Returns
    -------
    tuple
        (7,), and (R,) in rad/s.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.data import prepare
    >>> from hrg_cli.stages.diagnosis.base.first_guess import guess
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> _, _, runs = prepare(draw_waves(), None, 100)
    >>> p, offsets = guess(runs, runs, draw_waves(), None)
    >>> round(float(p[0]), 2), round(float(p[5]), 2), offsets.shape
    (0.5, 0.55, (3,))
    """
    known = Known(scale_factor=scale_factor)
    p, rough_offsets = propagator.guess_roughly(runs)
    if scale_factor is not None:
        p[SCALE_FACTOR] = scale_factor
    offsets = rough_offsets
    if free:
        seen = _straighten(free, p[SCALE_FACTOR]) if straight else free
        from_free, found, _, _ = start_from_propagator(seen, known)
        if np.all(np.isfinite(from_free)) and not _is_of_noise(from_free, free):
            p = from_free
            offsets = rough_offsets.copy()
            offsets[[i for i, w in enumerate(waves) if w.mode != "forced"]] = found
        else:
            # priors are sized by the damping, and steps follow the phase as it was unwrapped
            p[DAMPING] = p[DAMPING] or 1 / max(run.duration_s for run in free)
            offsets = np.array([_mean_turn(wave) for wave in waves])
    else:
        p = np.zeros(COUNT)
        p[SCALE_FACTOR] = (
            propagator.estimate_scale_factor(runs) if scale_factor is None else scale_factor
        )
        regressed = regress_driven(runs, waves, rough_offsets, scale_factor)
        if regressed is not None:
            p, offsets = regressed
        p[DAMPING] = max(p[DAMPING], 0.0)
        # of runs that do not turn, the nominal one: prior_mean is (…, K, second order)
        p[SCALE_FACTOR] = (
            p[SCALE_FACTOR] or make_freedom(known, p, runs[0].mode_number, 1.0).prior_mean[-2]
        )
    p[SECOND_ORDER] = 1.0
    return p, offsets


def _straighten(runs: Sequence[EnvelopeRun], scale_factor: float) -> Sequence[EnvelopeRun]:
    """The runs without what a moving frequency bends their phases by, where a fit could lose a turn
    of it."""
    bends = find_bends(runs, scale_factor)
    return runs if bends is None else straighten_phases(runs, bends)


def _mean_turn(wave: Wave) -> float:
    """Mean rate of a wave's own phase, rad/s."""
    time, phase = np.asarray(wave.time_s, float), np.asarray(wave.phase_rad, float)
    ends = np.flatnonzero(np.isfinite(phase))[[0, -1]]
    return float(np.diff(phase[ends])[0] / np.diff(time[ends])[0])


def _is_of_noise(p: Array, free: Sequence[EnvelopeRun]) -> bool:
    """Whether coordinates p move free waves by more than a window could show, or let them grow
    beyond all measure, as what was made of noise alone does."""
    splitting = float(np.hypot(*p[DAMPING + 1 : DAMPING + 3]))
    growth_1_s = splitting - float(p[DAMPING])
    return any(
        growth_1_s * run.duration_s > MOST_GROWTH
        or rows.estimate_speed(run, p) * float(np.median(np.diff(run.time_s))) > MOST_A_WINDOW
        for run in free
    )


def regress_driven(
    runs: Sequence[EnvelopeRun],
    waves: Sequence[Wave],
    offsets: Array,
    scale_factor: float | None,
) -> tuple[Array, Array] | None:
    """Coordinates and frequency offsets of the driven runs with a log, by a regression of their
    integrated equation.

    Parameters
    ----------
    runs
        Their envelopes.
    waves
        Of the runs.
    offsets
        Roughly, so that the envelopes turn little from row to row, (R,) [rad/s].
    scale_factor
        Where it is known, or cannot be told.

    Returns
    -------
    tuple or None
        (7,), and (R,) in rad/s; None where no run is driven with a log.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.base.data import prepare
    >>> from hrg_cli.stages.diagnosis.base.first_guess import regress_driven
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> _, _, runs = prepare(draw_waves(), None, 100)
    >>> regress_driven(runs, draw_waves(), np.zeros(3), None) is None
    True
    """
    logged = [k for k, wave in enumerate(waves) if _is_logged(wave)]
    if not logged:
        return None
    free = [k for k in range(SCALE_FACTOR + 1) if k != SCALE_FACTOR or scale_factor is None]
    columns_of, targets = [], []
    for place, k in enumerate(logged):
        shared, own, target = _integrated(runs[k], waves[k], float(offsets[k]))
        if scale_factor is not None:
            target = target - scale_factor * shared[:, SCALE_FACTOR]
        columns = np.zeros((len(target), len(free) + len(logged)))
        columns[:, : len(free)] = shared[:, free]
        columns[:, len(free) + place] = own
        columns_of.append(_without_start(columns))
        targets.append(_without_start(target))
    found, _ = solve(np.concatenate(columns_of), np.concatenate(targets))
    p = np.zeros(COUNT)
    p[SCALE_FACTOR] = 0.0 if scale_factor is None else scale_factor
    p[free] = found[: len(free)]
    moved = np.array(offsets, float)
    moved[logged] += found[len(free) :]
    return (p, moved) if np.all(np.isfinite(found)) else None


def _is_logged(wave: Wave) -> bool:
    """Whether a run is driven by a command that is logged."""
    return wave.mode == "forced" and bool(np.isfinite(_logged(wave, "drive_main")).any())


def _logged(wave: Wave, name: str) -> Array:
    """A logged command (n,), NaN where it is not."""
    values = getattr(wave, name)
    return np.full(len(wave.time_s), np.nan) if values is None else np.asarray(values, float)


def _interpolate_column(t: Array, wave: Wave, values: Array) -> Array:
    """A column of the wave at other times; 0 where there is none."""
    known = np.isfinite(values)
    if not known.any():
        return np.zeros(len(t))
    return np.interp(t, np.asarray(wave.time_s, float)[known], values[known])


def _integrated(run: EnvelopeRun, wave: Wave, offset: float) -> tuple[Array, Array, Array]:
    """Over σ, as reals: ∫ of what every shared coordinate makes of the wave (4n, 6), of what the
    frequency makes of it (4n,), and what the wave did beside its drive (4n,)."""
    t = run.time_s
    back = np.exp(-1j * offset * t)[:, None]
    u = run.envelope * back
    main, quadrature, phase = (
        _interpolate_column(t, wave, _logged(wave, name))
        for name in ("drive_main", "drive_quadrature", "phase_rad")
    )
    turn, e_A, e_B, _ = find_frame(run.envelope, phase)
    force = back * turn[:, None] * (main[:, None] * e_A - 1j * quadrature[:, None] * e_B)
    rate = np.gradient(run.turn_rad, t)[:, None]
    turning = rate * np.stack([u[:, 1], -u[:, 0]], axis=-1)
    made = [*(apply_generators(B, u) for B in coordinates.BASIS), turning, 1j * u]
    weight = 1 / run.std[:, None]
    columns = [(to_reals(_integral(t, one)) * weight).ravel() for one in made]
    target = (to_reals(u - _integral(t, force)) * weight).ravel()
    return np.stack(columns[:-1], axis=-1), columns[-1], target


def _integral(t: Array, values: Array) -> Array:
    """∫ from the first row to each, by lines between rows, (n, 2)."""
    area = np.diff(t)[:, None] * (values[1:] + values[:-1]) / 2
    return np.concatenate([np.zeros((1, 2)), np.cumsum(area, axis=0)])


def _without_start(rows: Array) -> Array:
    """Rows (4n, …) of a run less their mean of each of the four components, which the start state
    takes up."""
    by_component = rows.reshape(-1, 4, *rows.shape[1:])
    return np.asarray(by_component - by_component.mean(axis=0)).reshape(rows.shape)
