"""The linearised flow along a prediction, and the sensitivities that follow from it: any number of
them costs one sweep over the rows."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...effects.effect import Effect, find_frame, no_term, same_signal, same_state
from ...physics.resonator import exponentiate
from ..envelopes import coordinates
from ..envelopes.coordinates import COUNT, SECOND_ORDER
from .measured_runs import MeasuredRuns
from .slow_equation import (
    RungeKuttaStage,
    apply_generators,
    compute_second_order_force,
    find_effect_turns,
    find_steady_generators,
    predict_jumps,
)
from .slow_prediction import Near, Prediction, accumulate_steps
from .turned_motion import find_slope
from .wave_frame import make_real_matrix, to_reals

Array = np.ndarray
ORDER_STEP = 1e-2
"""Difference of the second order's scale, in which the model is nearly linear."""
SPLIT = (3, 4)
"""Coordinates of the frequency split, which a force feels in second order."""
ROUNDING = 1e-14
"""Part of what a term stands beside (the drive it deflects, the signal it changes) below which it
is rounding."""
AT_A_TIME = 1 << 20
"""Numbers in the columns that are made together (8 MB): fewer at a time hold no less in all, and
take longer."""
Wanted = tuple[Effect, Mapping[str, float], Mapping[str, float]]
"""An effect, the values where it stands (neutral for one that is not active), and the difference
steps of the parameters asked for."""


def multiply_out(vectors: Array, g: Array) -> Array:
    """Products of functions and vectors, the columns of a function side by side.

    Parameters
    ----------
    vectors
        (…, 4, J).
    g
        (…, C).

    Returns
    -------
    ndarray
        (…, 4, C·J).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.sensitivities import multiply_out
    >>> vectors = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 30.0], [4.0, 40.0]])
    >>> multiply_out(vectors, np.array([1.0, 5.0]))[0].tolist()
    [1.0, 10.0, 5.0, 50.0]
    """
    count = vectors.shape[-1]
    out = np.empty((*vectors.shape[:-1], g.shape[-1] * count))
    for j in range(count):
        np.multiply(g[..., None, :], vectors[..., j, None], out=out[..., j::count])
    return out


@dataclass(frozen=True)
class Propagation:
    """The linearised flow along a prediction: step propagators (R, n−1, 4, 4), read-out slope (R,
    n, 4, 4), motion at rows and middles."""

    prediction: Prediction
    centre: MeasuredRuns
    middle: Array
    step: Array
    half: Array
    view: Array | None
    rows: RungeKuttaStage = field(repr=False)
    halves: RungeKuttaStage = field(repr=False)

    @property
    def near(self) -> Near:
        """What finds a motion close by sooner."""
        return self.prediction.motion, self.step

    def propagate(
        self,
        at_rows: Array,
        at_middle: Array,
        start: Array | None = None,
        in_steps: Array | None = None,
    ) -> Array:
        """Changes (R, n, 4, K) of the motion by source terms (R, n, 4, K), (R, n−1, 4, K) in u' and
        changes of the start (R, 4, K).

        in_steps: what jumps within the steps, (R, n−1, 4, K).
        """
        source = self.gather_in_steps(at_rows, at_middle)
        if in_steps is not None:
            source += in_steps
        return self.carry_jumps(source, start)

    def carry_jumps(self, jumps: Array, start: Array | None = None) -> Array:
        """Changes (R, n, 4, K) of the motion by jumps at the steps' ends (R, n−1, 4, K) and changes
        of the start (R, 4, K)."""
        return accumulate_steps(self.step, np.zeros((4, 1)) if start is None else start, jumps)

    def gather_in_steps(self, at_rows: Array, at_middle: Array) -> Array:
        """What such source terms have added at every step's end, (R, n−1, 4, K)."""
        h = self.prediction.series.step_s[..., None, None]
        # Simpson's rule, each term carried to the step's end by the flow from where it acts
        source = (h / 6 * self.step) @ at_rows[:, :-1]
        source += (h * (4 / 6) * self.half) @ at_middle
        source += h / 6 * at_rows[:, 1:]
        return np.asarray(source)

    def propagate_products(
        self, at_rows: Array, at_middle: Array, g_rows: Array, g_middle: Array
    ) -> Array:
        """The same for sources that are vectors (R, n, 4, J) times functions (R, n, C), columns of
        a function side by side."""
        h = self.prediction.series.step_s[..., None, None]
        source = multiply_out(h / 6 * (self.step @ at_rows[:, :-1]), g_rows[:, :-1])
        source += multiply_out(h * (4 / 6) * (self.half @ at_middle), g_middle)
        source += multiply_out(h / 6 * at_rows[:, 1:], g_rows[:, 1:])
        return self.carry_jumps(source)

    def read_out(self, change: Array) -> Array:
        """Changes of the motion through the read-out's slope, (R, n, 4, K)."""
        return change if self.view is None else self.view @ change

    def whiten_read_out(self, change: Array) -> Array:
        """The same over σ of what the fit judges."""
        return self.prediction.whiten_judged(self.read_out(change))


def linearise_flow(prediction: Prediction) -> Propagation:
    """The linearised flow along a prediction.

    Parameters
    ----------
    prediction
        Of R runs of n rows.

    Returns
    -------
    Propagation
        Propagators of every step, the read-out's slope, and the motion between the rows.

    Examples
    --------
    A step of 0.1 s of a wave that decays by 0.1 1/s:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.sensitivities import linearise_flow
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.array([[1.0, 0.2j]]), np.zeros(1))
    >>> flow = linearise_flow(predict(series, point))
    >>> bool(np.allclose(flow.step, np.exp(-0.01) * np.eye(4)))
    True
    """
    series, point, u = prediction.series, prediction.point, prediction.motion
    centre = series.middles
    h = series.step_s[..., None, None]
    rows, halves = RungeKuttaStage(series, point), RungeKuttaStage(centre, point)
    L = rows.build_generators()
    steady = find_steady_generators(series, L)[:, None]
    L, M = L - steady, halves.build_generators() - steady
    turn = find_effect_turns(rows, series)
    steady, turned = steady + turn, make_real_matrix(turn)
    slope_rows = apply_generators(L, u) + rows.compute_source(u)
    before = slope_rows[:, :-1] - apply_generators(turn, u[:, :-1])
    after = slope_rows[:, 1:] - apply_generators(turn, u[:, 1:])
    hh, half = series.step_s[..., None], series.step_s / 2
    # cubic Hermite interpolation of the midpoint, in the frame that moves with the steady part
    ahead, back = exponentiate(steady, half), exponentiate(steady, -half)
    middle = (
        apply_generators(back, u[:, 1:]) + apply_generators(ahead, u[:, :-1])
    ) / 2 + hh / 8 * (apply_generators(ahead, before) - apply_generators(back, after))
    A, B = make_real_matrix(L), make_real_matrix(M)
    view = None
    if not rows.idle:
        A, B = A + find_slope(rows.compute_source, u), B + find_slope(halves.compute_source, middle)
        view = find_slope(rows.read_out, u)
    eye = np.eye(4)

    def flow(first: Array, mid: Array, last: Array, h: Array) -> Array:
        E = make_real_matrix(exponentiate(steady, h[..., 0, 0] / 2))
        # the classical Runge–Kutta step of fourth order, the steady part E taken exactly (Lawson
        # 1967)
        k1 = first
        k2 = mid @ E @ (eye + h / 2 * k1)
        k3 = mid @ (E + h / 2 * k2)
        k4 = last @ E @ (E + h * k3)
        return E @ (E @ (eye + h / 6 * k1) + h / 3 * (k2 + k3)) + h / 6 * k4

    first, mid, last = A[:, :-1] - turned, B - turned, A[:, 1:] - turned
    step = flow(first, mid, last, h)
    half = flow(mid, (mid + last) / 2, last, h / 2)
    return Propagation(prediction, centre, middle, step, half, view, rows, halves)


def _base_sources(
    flow: Propagation, series: MeasuredRuns, u: Array, stage: RungeKuttaStage
) -> Array:
    """What the shared coordinates and the run's frequency add to u' at the motion u, reals (R, n,
    4, 8): u' is linear in all but the scale of the second order, which is differenced."""
    point, hz = flow.prediction.point, series.reference_frequency_hz
    omega = 2 * np.pi * hz + point.offset_rad_s[:, None]
    plain = coordinates.build_generator(np.append(point.p[:6], 0.0), series.rate_rad_s, 1.0)
    full = coordinates.build_generator(np.append(point.p[:6], 1.0), series.rate_rad_s, omega)
    turning = series.rate_rad_s[..., None] * np.stack([u[..., 1], -u[..., 0]], -1)
    columns = [apply_generators(b, u) for b in coordinates.BASIS] + [
        turning,
        apply_generators(full - plain, u),
        1j * u,
    ]
    if flow.prediction.series.forced.any():
        # the force's second order goes with the same coordinates
        drive = stage.make_state(u).drive
        for k in SPLIT:
            second = compute_second_order_force(np.eye(COUNT)[k], hz)
            columns[k] = columns[k] + point.p[SECOND_ORDER] * apply_generators(second, drive)
        change = stage.replace_second_order(_more_order(point.p), hz).compute_source(
            u
        ) - stage.compute_source(u)
        columns[COUNT - 1] = columns[COUNT - 1] + change / ORDER_STEP
    held = np.isfinite(series.held_amplitude)
    if held.any():
        # the drive makes up for what the resonator loses along the wave, whatever its parameters
        turn, e_A, _, _ = find_frame(u, series.phase_rad)
        for c in columns:
            along = held * np.real(np.sum(c * e_A, axis=-1) * np.conj(turn)) * turn
            c -= along[..., None] * e_A
    return np.stack([to_reals(c) for c in columns], axis=-1)


def _more_order(p: Array) -> Array:
    """Coordinates (7,) with a little more of the second order."""
    return np.asarray(p + np.eye(COUNT)[COUNT - 1] * ORDER_STEP)


def find_base_sensitivities(flow: Propagation) -> tuple[Array, Array]:
    """What the shared coordinates and each run's own numbers do to what the fit judges, over σ.

    Parameters
    ----------
    flow
        Along a prediction of R runs of n rows.

    Returns
    -------
    tuple of ndarray
        Of the coordinates (R, n, 4, 7), and of each run's own start state and frequency
        (R, n, 4, 5).

    Examples
    --------
    ∂u/∂ν = −t·u, here over a σ of 1/1000:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.sensitivities import find_base_sensitivities, linearise_flow
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> from hrg_cli.fitting.causes.wave_frame import to_complex
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.array([[1.0, 0.2j]]), np.zeros(1))
    >>> found = predict(series, point)
    >>> of_all, of_each = find_base_sensitivities(linearise_flow(found))
    >>> bool(np.allclose(to_complex(of_all[..., 0]), -1e3 * t[..., None] * found.seen))
    True
    >>> bool(np.allclose(to_complex(of_each[..., 4]), 1e3j * t[..., None] * found.seen))
    True
    """
    prediction = flow.prediction
    series, u = prediction.series, prediction.motion
    start = np.zeros((len(series.names), 4, COUNT + 1 + 4))
    start[:, :, COUNT + 1 :] = np.eye(4)
    pad = [(0, 0)] * 3 + [(0, 4)]  # a start state has no source: it is carried alone
    carried = flow.read_out(flow.carry_jumps(np.pad(_gather_base(flow), pad), start))
    if series.forced.any():
        more = flow.rows.replace_second_order(
            _more_order(prediction.point.p), series.reference_frequency_hz
        )
        carried[..., COUNT - 1] += to_reals(more.read_out(u) - flow.rows.read_out(u)) / ORDER_STEP
    carried = prediction.whiten_judged(carried)
    own = np.concatenate([carried[..., COUNT + 1 :], carried[..., COUNT : COUNT + 1]], axis=-1)
    return carried[..., :COUNT], own


def gather_base_in_steps(flow: Propagation) -> Array:
    """What the shared coordinates add at the end of every step of the motion.

    Parameters
    ----------
    flow
        Along a prediction of R runs of n rows.

    Returns
    -------
    ndarray
        Per unit of each, (R, n − 1, 4, 7).

    Examples
    --------
    Carried on they are the coordinates' sensitivities:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.sensitivities import (
    ...     find_base_sensitivities,
    ...     gather_base_in_steps,
    ... )
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> flow = draw_fit().flow
    >>> carried = flow.whiten_read_out(flow.carry_jumps(gather_base_in_steps(flow)))
    >>> bool(np.allclose(carried, find_base_sensitivities(flow)[0]))
    True
    """
    return _gather_base(flow)[..., :COUNT]


def _gather_base(flow: Propagation) -> Array:
    """The same of the coordinates and of a frequency, (R, n − 1, 4, 8)."""
    prediction = flow.prediction
    rows = _base_sources(flow, prediction.series, prediction.motion, flow.rows)
    mids = _base_sources(flow, flow.centre, flow.middle, flow.halves)
    return flow.gather_in_steps(rows, mids)


_Pair = tuple[Mapping[str, float], Mapping[str, float], float]
"""Values above and below, and the step between them."""


@dataclass(frozen=True)
class _Terms:
    """What an effect adds by its parameters (R, n, 4, K), None for none: sources in u' at rows and
    middles, what is seen, jumps."""

    at_rows: Array | None
    at_middle: Array | None
    direct: Array | None
    in_steps: Array | None = None


class _Seen:
    """The motion at rows and middles with the state of everything that stands, in which single
    effects' terms are looked at."""

    def __init__(self, flow: Propagation) -> None:
        self.flow, self.u = flow, flow.prediction.motion
        self.at_rows, self.at_middle = (
            flow.rows.make_state(self.u),
            flow.halves.make_state(flow.middle),
        )

    def differentiate(
        self, effect: Effect, values: Mapping[str, float], steps: Mapping[str, float]
    ) -> _Terms:
        """Differences are forward from a neutral value, else central."""
        pairs = []
        for name, size in steps.items():
            up, down = {**values, name: values[name] + size}, {**values, name: values[name] - size}
            # an effect may be defined on one side of its neutral value only
            if values[name] == next(p.neutral for p in effect.parameters if p.name == name):
                down = dict(values)
            pairs.append((up, down, up[name] - down[name]))
        if effect.slow_environment is not same_state:
            return self._through_the_environment(effect, pairs)
        others = self.flow.rows.remove_effect(effect).read_out(self.u)
        rows = middles = direct = None
        if effect.slow is not no_term:
            at, between = self.flow.rows, self.flow.halves
            rows = _differences(
                lambda p: at.compute_force(effect, p, self.u, self.at_rows),
                pairs,
                self.at_rows.drive,
            )
            middles = _differences(
                lambda p: between.compute_force(effect, p, self.flow.middle, self.at_middle),
                pairs,
                self.at_middle.drive,
            )
        if effect.slow_readout is not same_signal:
            direct = _differences(
                lambda p: effect.slow_readout(p, others, self.at_rows), pairs, others
            )
        jumps = None
        if effect.slow_jump is not None:
            series, point = self.flow.prediction.series, self.flow.prediction.point
            jumps = _differences(lambda p: predict_jumps(series, point, effect, p), pairs, self.u)
        return _Terms(rows, middles, direct, jumps)

    def _through_the_environment(self, effect: Effect, pairs: Sequence[_Pair]) -> _Terms:
        """Of an effect that changes what all others look at."""
        point, series = self.flow.prediction.point, self.flow.prediction.series
        others = tuple(pair for pair in point.active if pair[0].name != effect.name)

        def stage(series: MeasuredRuns, changed: Mapping[str, float]) -> RungeKuttaStage:
            return RungeKuttaStage(series, replace(point, active=(*others, (effect, changed))))

        return _Terms(
            _differences(
                lambda p: stage(series, p).compute_source(self.u), pairs, self.at_rows.drive
            ),
            _differences(
                lambda p: stage(self.flow.centre, p).compute_source(self.flow.middle),
                pairs,
                self.at_middle.drive,
            ),
            _differences(lambda p: stage(series, p).read_out(self.u), pairs, self.u),
        )


def _differences(
    term: Callable[[Mapping[str, float]], Array], pairs: Sequence[_Pair], beside: Array
) -> Array | None:
    """Of a term by its parameters as reals (R, n, 4, K); None where it does nothing beyond the
    rounding of what it stands beside."""
    columns, low, before, largest = [], np.empty(0), None, 0.0
    for up, down, span in pairs:
        if down != before:
            low, before = term(down), down
        change = term(up) - low
        largest = max(largest, float(np.max(np.abs(change))))
        columns.append(to_reals(change) / span)
    return (
        np.stack(columns, axis=-1)
        if not largest <= ROUNDING * float(np.max(np.abs(beside)))
        else None
    )


def find_effect_sensitivities(flow: Propagation, wanted: Sequence[Wanted]) -> list[Array]:
    """What every effect's parameters do to what the fit judges, over σ.

    The motion of many is carried in one sweep.

    Parameters
    ----------
    flow
        Along a prediction of R runs of n rows.
    wanted
        Effects with the values where they stand and the difference steps of their parameters.

    Returns
    -------
    list of ndarray
        (R, n, 4, K) of each, K its steps.

    Examples
    --------
    Gains that differ by g change C by g/2·C and S by −g/2·S, over a σ of 1/1000:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.sensitivities import find_effect_sensitivities, linearise_flow
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> from hrg_cli.fitting.causes.wave_frame import to_complex
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, weight=none + 1e3, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.array([[1.0, 0.2j]]), np.zeros(1))
    >>> effect = next(one for one in EFFECTS if one.name == "gain_mismatch")
    >>> found = predict(series, point)
    >>> wanted = [(effect, {"gain": 0.0}, {"gain": 1e-3})]
    >>> (columns,) = find_effect_sensitivities(linearise_flow(found), wanted)
    >>> bool(np.allclose(to_complex(columns[..., 0]), 500 * found.seen * [1, -1]))
    True
    """
    seen, out = _Seen(flow), list[Array]()
    rows = 4 * flow.prediction.series.weight.size
    for some in batch_columns([len(steps) for _, _, steps in wanted], rows):
        out += _sweep(seen, [wanted[k] for k in some])
    return out


def batch_columns(widths: Sequence[int], rows: int) -> Iterator[list[int]]:
    """Places of neighbours whose columns are made together: as many as `AT_A_TIME` numbers hold, so
    that what is at work at once does not grow with the runs.

    Parameters
    ----------
    widths
        Columns of each.
    rows
        Numbers in a column.

    Returns
    -------
    iterator of list
        One at least in each.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.sensitivities import batch_columns
    >>> list(batch_columns([1, 2, 1, 9], 300_000))
    [[0, 1], [2], [3]]
    """
    some, held = list[int](), 0
    for place, width in enumerate(widths):
        if some and (held + width) * rows > AT_A_TIME:
            yield some
            some, held = [], 0
        some.append(place)
        held += width
    if some:
        yield some


def _sweep(seen: _Seen, wanted: Sequence[Wanted]) -> list[Array]:
    """The same of a few, in one sweep through all runs: the propagators are the cost, not the
    columns."""
    flow = seen.flow
    terms = [seen.differentiate(*one) for one in wanted]
    counts = [len(steps) for _, _, steps in wanted]
    moving = [
        k
        for k, t in enumerate(terms)
        if not (t.at_rows is None and t.at_middle is None and t.in_steps is None)
    ]
    out = [np.zeros((*flow.prediction.series.weight.shape, 4, count)) for count in counts]
    if moving:
        rows = [_fill_missing(terms[k].at_rows, out[k]) for k in moving]
        middles = [_fill_missing(terms[k].at_middle, out[k][:, 1:]) for k in moving]
        jumps = (
            [_fill_missing(terms[k].in_steps, out[k][:, 1:]) for k in moving]
            if any(t.in_steps is not None for t in terms)
            else None
        )
        carried = flow.propagate(
            np.concatenate(rows, -1),
            np.concatenate(middles, -1),
            in_steps=None if jumps is None else np.concatenate(jumps, -1),
        )
        ends = np.cumsum([counts[k] for k in moving])[:-1]
        for k, part in zip(moving, np.split(flow.read_out(carried), ends, axis=-1), strict=True):
            out[k] = part
    return [
        flow.prediction.whiten_judged(o if t.direct is None else o + t.direct)
        for o, t in zip(out, terms, strict=True)
    ]


def _fill_missing(terms: Array | None, nothing: Array) -> Array:
    return nothing if terms is None else terms
