"""What effects of the motion do to a run: the slow model of its resonator integrated with and
without them from the same start, u₁ = T u₀, T (2, 2) complex as a function of time.

e_A, e_B of the plain wave with their companion, [u, ū] = e^{jφ}[e_A, e_B][[a, −jb], [−jb, a]], make
T of two envelopes one division, which no ellipse makes singular. What jumps, jumps from the wave as
it was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...effects.effect import Effect, find_frame
from ...errors import HrgError
from ...fitting.causes import extended_fit, fit_point, slow_equation, slow_prediction
from ...fitting.causes.coordinate_priors import CoordinatePriors
from ...fitting.causes.descent import move_point
from ...fitting.causes.extended_fit import ExtendedFit
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
TOLD = 0.02
"""Part of what effects do to the motion from which it is told that it is not known better."""
Hidden = tuple[Effect, dict[str, float]]
ChangeAt = Callable[[Array], Array]
"""Times (n,) -> T (n, 2, 2)."""


@dataclass(frozen=True)
class Change:
    """The change T of a run's motion by effects, what part of it the run alone does not tell (0
    where the resonator was given), and the times [s] between which what jumps does."""

    at: ChangeAt
    doubt: float
    span_s: tuple[float, float] = (-np.inf, np.inf)

    def list_doubts(self) -> list[str]:
        """What to say of it; nothing where it is known well enough."""
        if self.doubt < TOLD:
            return []
        part = f"to {self.doubt:.2g} of it" if self.doubt < 1 else "not at all"
        return [
            f"what the effects do to the motion is known {part}, since the model fitted to this"
            " run alone is known no better; identify all runs of the gyro and give --resonator"
        ]


def integrate_change(wave: Wave, moving: Sequence[Hidden], resonator: Resonator | None) -> Change:
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
    Change
        Times (n,) [s] -> T (n, 2, 2) complex, with its doubt.

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
    >>> integrate_change(draw_input().wave, [], None).at(np.array([0.5])).real.tolist()
    [[[1.0, 0.0], [0.0, 1.0]]]
    """
    series, point, known = _fit_model(wave, resonator)
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
    first_s, last_s = float(series.time_s[0, 0]), float(series.time_s[0, -2])
    for instant, jump in sorted(
        ((float(at), np.reshape(change, 2)) for at, change in jumps), key=lambda one: one[0]
    ):
        if first_s < instant < last_s:
            before = (
                _chain_changes(changes, np.array([instant]))[0] @ measured(np.array([instant]))[0]
            )
            changes.append(
                _change_after(series, replace(point, active=smooth), instant, before, before + jump)
            )
    doubt = _find_doubt(series, known, smooth)
    return Change(partial(_chain_changes, changes), doubt, (first_s, last_s))


def _find_doubt(series: MeasuredRuns, fit: ExtendedFit | None, smooth: tuple[Hidden, ...]) -> float:
    """Error of (T − 1) u over its size, rms over the run, by what the fit to the run leaves open
    of the resonator, and by what it misses of the wave; None: the resonator was given."""
    if fit is None or not smooth:
        return 0.0

    def change(point: Point) -> Array:
        plain, changed = (
            _complete_envelopes(_predict_motion(series, replace(point, active=active)))
            for active in ((), smooth)
        )
        return np.asarray(changed @ np.linalg.inv(plain))

    u = _predict_motion(series, fit.point)[..., None]
    size, spread = change(fit.point), 0.0
    missed = 0.0 if fit.is_adequate else np.sqrt(fit.chi2 / fit.dof) / _find_usual_clearness(series)
    power, directions = np.linalg.eigh(fit.covariance)
    try:
        for std, direction in zip(np.sqrt(np.maximum(power, 0.0)), directions.T, strict=True):
            moved = move_point(fit.point, fit.layout, std * direction)
            spread += float(np.sum(np.abs((change(moved) - size) @ u) ** 2))
    except (HrgError, np.linalg.LinAlgError):
        return np.inf
    known = np.sqrt(spread / np.sum(np.abs((size - np.eye(2)) @ u) ** 2))
    return float(np.hypot(known, missed))


def _find_usual_clearness(series: MeasuredRuns) -> float:
    """Amplitude over σ, the median of a run's rows."""
    good = series.weight > 0
    amplitude = np.linalg.norm(series.envelope, axis=-1)
    return float(np.median((amplitude * series.weight)[good]))


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


def _fit_model(
    wave: Wave, resonator: Resonator | None
) -> tuple[MeasuredRuns, Point, ExtendedFit | None]:
    """The run's rows and the slow model's start in them; the resonator is given, or fitted to this
    run: then the fit with all that is free in it, too.

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
        if resonator is not None:
            return series, fit.point, None
        if free.loose is not None and not fit.is_adequate:
            # a nominal scale factor that the run contradicts is not the gyro's
            fit = min(fit, extended_fit.fit(series, fit.point, free.loose), key=lambda f: f.chi2)
        if fit.coordinate_std("scale_factor") < KNOWN * abs(fit.coordinate("scale_factor")):
            return series, fit.point, fit
        nominal = choose_scale_factor(wave.mode_number)
        held = extended_fit.fit(series, point, free.hold("scale_factor", nominal))
        return series, held.point, fit
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
