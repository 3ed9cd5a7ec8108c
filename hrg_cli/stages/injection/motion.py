"""What effects of the motion do to a run: the slow model of its resonator integrated with and
without them from the same start, u₁ = T u₀, T (2, 2) complex as a function of time.

e_A, e_B of the plain wave with their companion, [u, ū] = e^{jφ}[e_A, e_B][[a, −jb], [−jb, a]], make
T of two envelopes one division, which no ellipse makes singular. What jumps, jumps from the wave as
it was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ...effects.effect import Effect, find_frame
from ...errors import HrgError
from ...fitting.causes import extended_fit, fit_point, slow_equation, slow_prediction
from ...fitting.causes.coordinate_priors import CoordinatePriors
from ...fitting.causes.fit_point import Point
from ...fitting.causes.measured_runs import MeasuredRuns
from ...fitting.envelopes.base_freedom import choose_scale_factor
from ...fitting.envelopes.coordinates import COUNT, from_mechanics
from ...physics.resonator import exponentiate
from ...records import Resonator, Wave
from ..diagnosis.base.base_priors import choose_freedom
from ..diagnosis.base.data import prepare
from ..planning.known import make_mechanics
from .oscillation import interpolate_oscillation

Array = np.ndarray
ROWS = 1500
"""Rows of the slow model along the run."""
KNOWN = 0.05
"""Relative standard deviation up to which a run shows the scale factor."""
Hidden = tuple[Effect, dict[str, float]]
ChangeAt = Callable[[Array], Array]
"""Times (n,) -> T (n, 2, 2)."""


def integrate_change(wave: Wave, moving: Sequence[Hidden], resonator: Resonator | None) -> ChangeAt:
    """The change T of a run's motion by effects, u → T u, through the rows of the slow model.

    What jumps, jumps from the wave as it was measured.

    Parameters
    ----------
    wave
        The run.
    moving
        Effects that move the wave, and their values.
    resonator
        Of the run; None: the wave's own fit.

    Returns
    -------
    callable
        Times (n,) [s] -> T (n, 2, 2) complex.

    Raises
    ------
    HrgError
        The motion has no end with these values.

    Examples
    --------
    Without an effect nothing is changed:

    >>> import numpy as np
    >>> from hrg_cli.stages.injection.motion import integrate_change
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> integrate_change(draw_input().wave, [], None)(np.array([0.5])).real.tolist()
    [[[1.0, 0.0], [0.0, 1.0]]]
    """
    series, point = _fit_model(wave, resonator)
    smooth = tuple((effect, p) for effect, p in moving if effect.slow_jump is None)
    changes = []
    if smooth:
        t = series.time_s[0]
        changes.append(
            _divide_motions(
                t,
                _predict_motion(series, replace(point, active=smooth)),
                _predict_motion(series, point),
            )
        )
    state = fit_point.build_state(series, point)
    jumps = [effect.slow_jump(p, state) for effect, p in moving if effect.slow_jump is not None]
    measured = interpolate_oscillation(wave).spline
    for instant, jump in sorted(
        ((float(at), np.reshape(change, 2)) for at, change in jumps), key=lambda one: one[0]
    ):
        if series.time_s[0, 0] < instant < series.time_s[0, -2]:
            before = (
                _chain_changes(changes, np.array([instant]))[0] @ measured(np.array([instant]))[0]
            )
            changes.append(
                _change_after(series, replace(point, active=smooth), instant, before, before + jump)
            )
    return partial(_chain_changes, changes)


def _chain_changes(changes: Sequence[ChangeAt], times: Array) -> Array:
    """One change after another, (n, 2, 2)."""
    out = np.broadcast_to(np.eye(2, dtype=complex), (len(times), 2, 2))
    for change in changes:
        out = change(times) @ out
    return out


def _predict_motion(series: MeasuredRuns, point: Point) -> Array:
    """Envelopes (n, 2) of the one run as the model has them. HrgError: they have no end."""
    with np.errstate(over="ignore", invalid="ignore"):
        seen = slow_prediction.predict(series, point).seen[0]
    if not np.all(np.isfinite(seen)):
        raise HrgError(
            f"{', '.join(e.name for e, _ in point.active)}: the motion has no end with these"
            " values; give smaller ones"
        )
    return seen


def _divide_motions(t: Array, changed: Array, plain: Array) -> ChangeAt:
    """T of the envelopes `changed` = T `plain` (n, 2) at times t, smooth in between."""
    from scipy.interpolate import CubicSpline

    spline: ChangeAt = CubicSpline(
        t, _complete_envelopes(changed) @ np.linalg.inv(_complete_envelopes(plain))
    )
    return spline


def _change_after(
    series: MeasuredRuns, point: Point, instant: float, plain: Array, changed: Array
) -> ChangeAt:
    """T from an instant on, at which the envelopes `plain` (2,) become `changed`; the identity
    before."""
    first = int(np.searchsorted(series.time_s[0], instant))
    rest = series.drop_rows_before(first)
    L = slow_equation.build_generators(series, point)[0, first]
    carry = exponentiate(L, rest.time_s[0, 0] - instant)
    ends = [
        np.concatenate([[u], _predict_motion(rest, replace(point, start=(carry @ u)[None]))])
        for u in (changed, plain)
    ]
    # both motions go on from the instant by the same model, so T holds the jump and what it grows
    # to
    late = _divide_motions(np.concatenate([[instant], rest.time_s[0]]), *ends)

    def at(times: Array) -> Array:
        return np.where((times >= instant)[:, None, None], late(times), np.eye(2))

    return at


def _fit_model(wave: Wave, resonator: Resonator | None) -> tuple[MeasuredRuns, Point]:
    """The run's rows and the slow model's start in them; the resonator is given, or fitted to this
    run.

    A run that does not show the scale factor (no rate, or a constant one) has the nominal one.
    """
    scale = None
    if resonator is not None:
        if resonator.mode_number != wave.mode_number:
            raise HrgError(
                f"the resonator has mode_number {resonator.mode_number}, the recording"
                f" {wave.mode_number}; use one of the same"
            )
        scale = make_mechanics(resonator).scale_factor
    series, point, _ = prepare([wave], scale, ROWS)
    free = choose_freedom(series, point, scale)
    if resonator is not None:
        p = from_mechanics(make_mechanics(resonator))
        point, free = replace(point, p=p), CoordinatePriors(p, np.zeros(COUNT))
    try:
        fit = extended_fit.fit(series, point, free)
        if resonator is None and not fit.coordinate_std("scale_factor") < KNOWN * abs(
            fit.coordinate("scale_factor")
        ):
            nominal = choose_scale_factor(wave.mode_number)
            fit = extended_fit.fit(series, point, free.hold("scale_factor", nominal))
        return series, fit.point
    except extended_fit.DivergedError as error:
        raise HrgError(
            f"the slow model finds no fit to this run ({error}); give a --resonator that was"
            " identified from better ones"
        ) from error


def _complete_envelopes(u: Array) -> Array:
    """Envelopes u (n, 2) with their companion, (n, 2, 2): e^{jφ}[e_A, e_B][[a, −jb], [−jb, a]],
    which no ellipse makes singular."""
    turn, e_A, e_B, _ = find_frame(u, 0.0)
    a, b = (np.sum(u * e, axis=-1) * np.conj(turn) for e in (e_A, e_B))
    companion = turn[:, None] * (b[:, None] * e_A + a[:, None] * e_B)
    return np.stack([u, companion], axis=-1)
