"""The identification methods of seed A as pooled linear regressions on the runs' envelopes, each by
its physical name.

All are linear in the coordinates of `coordinates.py`. The published forms are corrected where
PHYSICS §4 shows an error: 1/π and a full turn in the rotation integrals, the true rate in fixed
axes (the elimination KΩ := −mθ̇ deletes half of the damping split and is an option), e^{+jωt}
throughout. Derivatives are central differences, each row for itself, as published; `increments` and
`stokes` integrate the right-hand side along the run instead, with a free first value, and so weigh
the rows as their noise asks. What differences and sums over rows of finite length leave out (x²/6
of what turns by x a row) is found by putting the method's own answer through its own equations
without noise, and is taken off, until neither changes. Standard deviations are the envelopes' noise
carried through the equations (`noise_propagation.py`): what neighbouring differences share cancels.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...physics import ellipse
from . import noise_propagation
from .coordinates import COUNT
from .envelope_runs import EnvelopeRun
from .likelihood import Freedom
from .method_ranges import out_of_range, warnings

Array = np.ndarray
Noiseless = Callable[[Array], list[EnvelopeRun]]
"""Coordinates (7,) -> the runs' rows as a resonator of these coordinates would show them, without
noise."""
CORRECTIONS = 6
"""Times the truncation is found anew at most."""
SETTLED = 0.05
"""Part of a standard deviation by which the last correction may still move an answer."""
GROUP = 0.1
"""|sin Δφ| or |cos Δφ| up to which a row belongs to a group of seed A's second remark."""
WIDE_STEP = 3.0
"""Step over the median from which two rows are no neighbours: a gap."""


@dataclass(frozen=True)
class Equations:
    """Rows of one run: Σ columns·p + δ·offset = target; columns (N, 7), offset (N,) of the run's
    own frequency (0: not needed).

    Each row sees the run's rows from `first` (N,) on, 3 of them with derivatives. `levels`: None
    there; with increments from row to row the weights (N + 1 a quantity) of their running sums,
    whose first values are free.
    """

    columns: Array
    target: Array
    offset: Array
    weight: Array
    first: Array
    levels: tuple[Array, ...] | None = None

    @property
    def reach(self) -> int:
        """Rows of the run that an equation sees."""
        return 3 if self.levels is None else 4


@dataclass(frozen=True)
class Regression:
    """Coordinates (7,) with NaN where the method does not give them, covariance (7, 7), and what
    the method has to say about its range."""

    p: Array
    covariance: Array
    warnings: list[str] = field(default_factory=list)
    refused: str = ""
    run_chi2: Array = field(default_factory=lambda: np.zeros(0))
    """Each run's misfit squared over what its windows' stated noise predicts, summed, (R,)."""
    run_rows: Array = field(default_factory=lambda: np.zeros(0))
    """Equations of each run in it, (R,)."""
    unsettled: float = 0.0
    """What the last correction of the truncation moved, in the method's own standard deviations."""
    spread: Spread | None = None
    """What the envelopes' noise does to the method, where it was carried through its equations."""
    details: dict[str, Any] = field(default_factory=dict)
    """What it tells beside."""


@dataclass(frozen=True)
class Ellipse:
    """a_A, a_B, electrical angle mθ, phase φ and their derivatives on the rows of a run; `good` is
    False beside gaps."""

    run: EnvelopeRun
    a: Array
    b: Array
    angle: Array
    a_dot: Array
    b_dot: Array
    angle_dot: Array
    rate: Array
    good: Array


def derivative(values: Array, time_s: Array) -> Array:
    """Central differences on uneven times."""
    return np.gradient(values, time_s, axis=0)


def beside_gap(time_s: Array) -> Array:
    """True on rows next to a step over three times the median, and on the first and last: no
    central difference there."""
    wide = np.diff(time_s) > WIDE_STEP * np.median(np.diff(time_s))
    return np.concatenate([[True], wide]) | np.concatenate([wide, [True]])


def table_rate(run: EnvelopeRun) -> Array:
    """Rate on the rows, rad/s."""
    return derivative(run.turn_rad, run.time_s)


def ellipse_of(run: EnvelopeRun) -> Ellipse:
    """The wave in moving axes, continuous in sign and angle."""
    a, b, angle, phase = ellipse.wave(run.envelope, 1)
    angle, phase = ellipse.unwrap(angle, phase, 1)
    t = run.time_s
    return Ellipse(
        run,
        a,
        b,
        angle,
        derivative(a, t),
        derivative(b, t),
        derivative(angle, t),
        table_rate(run),
        ~beside_gap(t),
    )


def _rows(
    run: EnvelopeRun,
    columns: list[Array],
    target: Array,
    keep: Array,
    scale: Array | float = 1.0,
    offset: Array | None = None,
) -> Equations:
    step = float(np.median(np.diff(run.time_s)))
    weight = np.broadcast_to(step / run.std / scale, target.shape)
    full = np.stack([np.broadcast_to(c, target.shape) for c in columns], axis=-1)
    off = np.zeros(len(target)) if offset is None else offset
    return Equations(full[keep], target[keep], off[keep], weight[keep], np.flatnonzero(keep) - 1)


def _joined(parts: Sequence[Equations]) -> Equations:
    columns, target, offset, weight, first = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("columns", "target", "offset", "weight", "first")
    )
    return Equations(columns, target, offset, weight, first)


def moving_axes(
    run: EnvelopeRun, eliminate_rate: bool = False, small: bool = False, frozen: bool = False
) -> Equations:
    """Seed A (15): amplitudes of the main and the quadrature wave, and K from mθ̇ = −KΩ + D with D
    of PHYSICS §4 (8) exact.

    `small`: (14), (16): products of the quadrature with a damping split or with the frequency split
    in ȧ_A are dropped. `frozen`: the splits are taken at the run's mean angle.
    """
    w = ellipse_of(run)
    angle = np.full_like(w.angle, w.angle.mean()) if frozen else w.angle
    c, s, zero = np.cos(2 * angle), np.sin(2 * angle), np.zeros_like(w.a)
    cross = 0.0 if small else 1.0
    first = _rows(
        run,
        [w.a, w.a * c, w.a * s, cross * w.b * s, -cross * w.b * c, zero, zero],
        -w.a_dot,
        w.good,
    )
    second = _rows(
        run,
        [w.b, -cross * w.b * c, -cross * w.b * s, -w.a * s, w.a * c, zero, zero],
        -w.b_dot,
        w.good,
    )
    r = w.b / w.a
    shape = (1 - r**2) * w.a
    third = _rows(
        run,
        [
            zero,
            -s * (1 + cross * r**2) * w.a,
            c * (1 + cross * r**2) * w.a,
            -2 * r * c * w.a,
            -2 * r * s * w.a,
            -w.rate * (shape if not small else w.a),
            zero,
        ],
        w.angle_dot * (shape if not small else w.a),
        w.good & (w.rate != 0),
    )
    # D = νδμ sin χ (1 + r²) − 2rδω cos ζ over (1 − r²), χ = 2mθ − 2mθ_μ: sin χ = s·cos − c·sin of
    # the axis
    third = Equations(
        third.columns * np.array([1, -1, -1, 1, 1, 1, 1]),
        third.target,
        third.offset,
        third.weight,
        third.first,
    )
    return _joined([first, second, third])


def moving_axes_small_quadrature(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A (14), (16)."""
    return moving_axes(run, eliminate_rate, small=True)


def frozen_axes(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A, fourth remark after (17): axes frozen where the wave stands, for a wave that hardly
    turns.

    The printed fourth equation drops the part of the drift; m·dθ/dt = −KΩ + D stands in its place,
    as in moving axes.
    """
    return moving_axes(run, eliminate_rate, frozen=True)


def fixed_axes(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A (17) in the instrument axes with the true rate: amplitudes and phases of both
    channels, K free.

    `eliminate_rate`: the published KΩ := −mθ̇.
    """
    u, dot = run.envelope, derivative(run.envelope, run.time_s)
    keep = ~beside_gap(run.time_s)
    rate = table_rate(run)
    known = np.zeros_like(rate)
    if eliminate_rate:
        known, rate = -ellipse_of(run).angle_dot, np.zeros_like(rate)
    parts = []
    for this, other, sign in ((0, 1, 1.0), (1, 0, -1.0)):
        turn = np.exp(-1j * np.angle(u[:, this]))
        x, y = u[:, this] * turn, u[:, other] * turn
        terms = [-x, -sign * x, -y, 1j * sign * x, 1j * y, sign * rate * y, 0 * y]
        target = dot[:, this] * turn - sign * known * y
        for part in (np.real, np.imag):
            parts.append(
                _rows(run, [part(v) for v in terms], part(target), keep, offset=part(1j * x))
            )
    return _joined(parts)


def fixed_axes_weighted(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Amplitude equations of (17) and the weighted difference of its phase equations, which needs
    no mean frequency.

    a_C a_S Δφ̇ = 2δω_c a_C a_S + (δω_s cos Δφ + KΩ·(−sin Δφ))(a_S² − a_C²) + Δν_s sin Δφ (a_C² +
    a_S²), Δφ = φ_C − φ_S.
    """
    return _fixed_axes(run, eliminate_rate)


def fixed_axes_groups(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A, second remark after (17): the same in two groups of data.

    Main group, the wave between the electrodes' axes: sin Δφ → 0, cos Δφ → ±1. Further group, the
    wave on one of them: cos Δφ → 0, sin Δφ → ±1. Rows in between are left out; the printed a_C a_S
    Δφ̇ → 0 would leave the frequency split unknown and is kept.
    """
    return _fixed_axes(run, eliminate_rate, grouped=True)


def _fixed_axes(run: EnvelopeRun, eliminate_rate: bool, grouped: bool = False) -> Equations:
    """The channels' products as they are, whole or in two groups."""
    cross = run.envelope[:, 0] * np.conj(run.envelope[:, 1])
    return _channel_products(
        run,
        cross.real,
        cross.imag,
        np.abs(run.envelope[:, 0]) ** 2,
        np.abs(run.envelope[:, 1]) ** 2,
        eliminate_rate,
        False,
        grouped=grouped,
    )


def products(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """The same from the time averages 2⟨C²⟩, 2⟨S²⟩, 2⟨CS⟩, −2⟨C·S(t − t₃)⟩ alone, the noise's own
    power taken off; no A, B, θ is formed."""
    noise = 2 * run.std**2
    cross = run.envelope[:, 0] * np.conj(run.envelope[:, 1])
    c2, s2 = np.abs(run.envelope[:, 0]) ** 2 - noise, np.abs(run.envelope[:, 1]) ** 2 - noise
    return _channel_products(run, cross.real, cross.imag, c2, s2, eliminate_rate, True)


def _channel_products(
    run: EnvelopeRun,
    x: Array,
    y: Array,
    c2: Array,
    s2: Array,
    eliminate_rate: bool,
    whole: bool,
    grouped: bool = False,
) -> Equations:
    """½d(a_C²)/dt, ½d(a_S²)/dt and, `whole`, d(a_C a_S e^{jΔφ})/dt, else a_C a_S Δφ̇ alone; x + jy
    = a_C a_S e^{jΔφ}.

    `grouped`: Δφ is rounded to a multiple of π/2 where it is within `GROUP` of one; the other rows
    weigh nothing.
    """
    t = run.time_s
    keep = ~beside_gap(t)
    rate = table_rate(run)
    known, zero = np.zeros_like(rate), np.zeros_like(rate)
    if eliminate_rate:
        known, rate = -ellipse_of(run).angle_dot, zero
    size = np.sqrt(np.maximum(c2 + s2, 1e-300))
    product = np.sqrt(np.maximum(x**2 + y**2, 1e-300))
    sin, cos = y / product, x / product
    left = cos * derivative(y, t) - sin * derivative(x, t)
    if grouped:
        size = np.where(np.minimum(np.abs(sin), np.abs(cos)) < GROUP, size, np.inf)
        sin, cos = np.round(sin), np.round(cos)
        x, y = product * cos, product * sin
    amplitude = [
        _rows(
            run,
            [-c2, -c2, -x, zero, y, rate * x, zero],
            derivative(c2, t) / 2 - known * x,
            keep,
            size,
        ),
        _rows(
            run,
            [-s2, s2, -x, zero, -y, -rate * x, zero],
            derivative(s2, t) / 2 + known * x,
            keep,
            size,
        ),
    ]
    total, difference = c2 + s2, s2 - c2
    if whole:
        in_phase = _rows(
            run,
            [-2 * x, zero, -total, -2 * y, zero, rate * difference, zero],
            derivative(x, t) - known * difference,
            keep,
            size,
        )
        quadrature = _rows(
            run, [-2 * y, zero, zero, 2 * x, difference, zero, zero], derivative(y, t), keep, size
        )
        return _joined([*amplitude, in_phase, quadrature])
    phase = _rows(
        run,
        [zero, zero, sin * total, 2 * product, cos * difference, -rate * sin * difference, zero],
        left + known * sin * difference,
        keep,
        size,
    )
    return _joined([*amplitude, phase])


def _increments(
    run: EnvelopeRun, equations: Sequence[tuple[list[Array], Array, Array]]
) -> Equations:
    """Increments of quantities from row to row against ∫columns dt, trapezium rule with its end
    correction; standard deviations a row."""
    t = run.time_s
    step = np.diff(t)[:, None]
    pieces, targets = [], []
    for columns, quantity, _ in equations:
        full = np.stack([np.broadcast_to(c, quantity.shape) for c in columns], axis=-1)
        slope = derivative(full, t)
        pieces.append((full[1:] + full[:-1]) / 2 * step - np.diff(slope, axis=0) * step**2 / 12)
        targets.append(np.diff(quantity))
    n = len(t) - 1
    first = np.tile(np.arange(n) - 1, len(equations))
    levels = tuple(1 / np.broadcast_to(std, t.shape) for _, _, std in equations)
    return Equations(
        np.concatenate(pieces),
        np.concatenate(targets),
        np.zeros(len(first)),
        np.ones(len(first)),
        first,
        levels,
    )


def increments(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A (15) integrated: increments of a_A, a_B instead of derivatives, and those of mθ, with
    the rate or without."""
    w = ellipse_of(run)
    c, s, zero = np.cos(2 * w.angle), np.sin(2 * w.angle), np.zeros_like(w.a)
    r = w.b / w.a
    up, down = (1 + r**2) / (1 - r**2), 1 / (1 - r**2)
    return _increments(
        run,
        [
            ([-w.a, -w.a * c, -w.a * s, -w.b * s, w.b * c, zero, zero], w.a, run.std),
            ([-w.b, w.b * c, w.b * s, w.a * s, -w.a * c, zero, zero], w.b, run.std),
            (
                [zero, s * up, -c * up, -2 * r * c * down, -2 * r * s * down, -w.rate, zero],
                w.angle,
                run.std * np.sqrt(w.a**2 + w.b**2) / np.abs(w.a**2 - w.b**2),
            ),
        ],
    )


def stokes(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """The exact linear four-vector form Ṡ = M S (PHYSICS §0), integrated; no axes, so circular
    orbits too; noise power taken off S₀.

    S₀ = |(S₁, S₂, S₃)| of one wave, so its own equation says nothing new; the other three have
    independent noise 2σ√S₀.
    """
    s0, s1, s2, s3 = np.moveaxis(ellipse.stokes(run.envelope), -1, 0)
    s0 = s0 - 4 * run.std**2
    rate, zero = table_rate(run), np.zeros_like(s0)
    std = 2 * run.std * np.sqrt(np.maximum(s0, 4 * run.std**2))
    return _increments(
        run,
        [
            ([-2 * s1, -2 * s0, zero, zero, 2 * s3, 2 * rate * s2, zero], s1, std),
            ([-2 * s2, zero, -2 * s0, -2 * s3, zero, -2 * rate * s1, zero], s2, std),
            ([-2 * s3, zero, zero, 2 * s2, -2 * s1, zero, zero], s3, std),
        ],
    )


METHODS: dict[str, Callable[..., Equations]] = {
    "moving-axes": moving_axes,
    "moving-axes-small-quadrature": moving_axes_small_quadrature,
    "fixed-axes": fixed_axes,
    "fixed-axes-weighted": fixed_axes_weighted,
    "fixed-axes-groups": fixed_axes_groups,
    "frozen-axes": frozen_axes,
    "increments": increments,
    "products": products,
    "stokes": stokes,
}
EXACT = {
    "moving-axes-small-quadrature": "moving-axes",
    "fixed-axes-groups": "fixed-axes-weighted",
    "frozen-axes": "moving-axes",
}
"""Methods whose equations are approximate -> the exact ones with the same differences."""


@dataclass(frozen=True)
class Rows:
    """Weighted rows of one run with its own unknowns (frequency, first values) projected off:
    design (N, k), target (N,), the projector's basis (N, c) and the weights (N,).
    """

    design: Array
    target: Array
    own: Array
    weight: Array


def weighted(run: EnvelopeRun, equations: Equations, freedom: Freedom) -> Rows:
    """The regression's rows: the equations themselves, or the running sums of increments, begun
    anew after a gap."""
    shared, target, weight = (
        equations.columns @ freedom.directions,
        equations.target - equations.columns @ freedom.origin,
        equations.weight,
    )
    if equations.levels is None:
        own = equations.offset[:, None]
    else:
        count = len(equations.levels)
        joined = np.column_stack([shared, target]).reshape(count, len(run) - 1, -1)
        sums = np.concatenate(
            [np.zeros((count, 1, joined.shape[2])), np.cumsum(joined, axis=1)], axis=1
        ).reshape(count * len(run), -1)
        shared, target, weight = sums[:, :-1], sums[:, -1], np.concatenate(equations.levels)
        step = np.diff(run.time_s)
        piece = np.concatenate([[0], np.cumsum(step > WIDE_STEP * np.median(step))])
        group = (np.arange(count)[:, None] * (piece[-1] + 1) + piece).ravel()
        own = (group[:, None] == np.arange(group[-1] + 1)).astype(float)
    own = own * weight[:, None]
    size = np.linalg.norm(own, axis=0)
    basis = np.linalg.qr(own[:, size > 0])[0]
    rows = np.column_stack([shared, target]) * weight[:, None]
    rows = rows - basis @ (basis.T @ rows)
    return Rows(rows[:, :-1], rows[:, -1], basis, weight)


def truncation(model: Sequence[EnvelopeRun], p: Array, method: str) -> list[Array]:
    """What the method's differences and sums leave of noiseless runs of coordinates p, equation by
    equation (N,) a run.

    The approximations of a method are none of it: those of small quadrature are judged by the exact
    equations' differences.
    """
    exact = METHODS[EXACT.get(method, method)]
    out = []
    for run in model:
        equations = exact(run)
        out.append(equations.target - equations.columns @ p)
    return out


@dataclass(frozen=True)
class Spread:
    """What the envelopes' noise does to a method: covariance (k, k) of its coordinates by the
    stated noise, and each run's predicted variance of every misfit."""

    covariance: Array
    variances: list[Array]


def solve(
    runs: Sequence[EnvelopeRun],
    freedom: Freedom,
    method: str,
    eliminate_rate: bool = False,
    model: Noiseless | None = None,
    start: Array | None = None,
    spread: Spread | None = None,
) -> Regression:
    """Pooled weighted least squares of one method over all runs, its covariance from the envelopes'
    noise.

    model, start: noiseless rows for any coordinates, and the coordinates (7,) at which the
    truncation is first taken from them; None: the equations stay as published. spread: the noise's
    where it is known already, from runs that hardly differ. The noise's level is the stated one, or
    what the residuals say where that is more.
    """
    reason = out_of_range(runs, method)
    if reason:
        return _none(reason)
    published = [METHODS[method](run, eliminate_rate) for run in runs]
    corrected = model is not None and start is not None and not eliminate_rate
    here = np.zeros(COUNT) if start is None else np.array(start, float)
    left_out = [np.zeros(len(e.target)) for e in published]
    change = 0.0
    for turn in range(CORRECTIONS if corrected else 1):
        if model is not None and corrected:
            left_out = truncation(model(here), here, method)
        equations = [
            dataclasses.replace(e, target=e.target - t)
            for e, t in zip(published, left_out, strict=True)
        ]
        solution = _least_squares(runs, equations, freedom)
        if solution is None:
            return _none(f"no row of these runs is one that {method} takes; use likelihood")
        if spread is None or (turn > 1 and change >= SETTLED):
            spread = _spread(runs, equations, left_out, solution, method, eliminate_rate)
        chi2, rows = _misfits(runs, equations, left_out, solution.p, spread, method, eliminate_rate)
        p = solution.p
        covariance = spread.covariance * max(1.0, chi2.sum() / max(1, rows.sum()))
        known = np.isfinite(p) & (np.diag(covariance) > 0)
        change = (
            float(
                np.max(np.abs(p - here)[known] / np.sqrt(np.diag(covariance)[known]), initial=0.0)
            )
            if corrected
            else 0.0
        )
        here = np.where(np.isfinite(p), p, here)
        if change < SETTLED:
            break
    return Regression(
        p,
        covariance,
        warnings(runs, method, eliminate_rate),
        run_chi2=chi2,
        run_rows=rows,
        unsettled=change,
        spread=spread,
    )


def _none(reason: str) -> Regression:
    """No answer, and why."""
    return Regression(np.full(COUNT, np.nan), np.full((COUNT, COUNT), np.nan), refused=reason)


@dataclass(frozen=True)
class Solution:
    """Coordinates p (7,), NaN where the equations say nothing; z = inverse (k, N)·targets, p =
    origin + directions (7, k)·z; the rows of every run."""

    p: Array
    inverse: Array
    directions: Array
    parts: list[Rows]


def _least_squares(
    runs: Sequence[EnvelopeRun], equations: Sequence[Equations], freedom: Freedom
) -> Solution | None:
    """The equations' weighted least squares; None where no equation weighs anything."""
    parts = [weighted(run, e, freedom) for run, e in zip(runs, equations, strict=True)]
    design, target = (
        np.concatenate([p.design for p in parts]),
        np.concatenate([p.target for p in parts]),
    )
    scale = np.linalg.norm(design, axis=0)
    used = scale > 0
    if not used.any():
        return None
    matrix = design[:, used] / scale[used]
    U, size, Vt = np.linalg.svd(matrix, full_matrices=False)
    keep = size > 1e-8 * size[0]
    inverse = (Vt[keep].T / size[keep]) @ U[:, keep].T / scale[used, None]
    D = freedom.directions[:, used]
    p = freedom.origin + D @ (inverse @ target)
    p[~(np.abs(D).sum(axis=1) > 0) & (np.abs(freedom.directions).sum(axis=1) > 0)] = np.nan
    return Solution(p, inverse, D, parts)


def _misfit(
    e: Equations, known: Array, p: Array, method: str, eliminate_rate: bool
) -> Callable[[EnvelopeRun], Array]:
    """The misfits (N,) of a run's equations at p, its own frequency taken off, as a function of the
    run's envelopes."""
    p = np.nan_to_num(p)  # no column asks for what a method does not give
    left, own = (e.target - e.columns @ p) * e.weight, e.offset * e.weight
    offset = float(own @ left / (own @ own)) if np.any(own) else 0.0

    def misfit(moved: EnvelopeRun) -> Array:
        trial = METHODS[method](moved, eliminate_rate)
        return trial.target - known - trial.columns @ p - trial.offset * offset

    return misfit


def _spread(
    runs: Sequence[EnvelopeRun],
    equations: Sequence[Equations],
    left_out: Sequence[Array],
    solution: Solution,
    method: str,
    eliminate_rate: bool,
) -> Spread:
    """The noise of every row of every run carried to the coordinates."""
    total, variances = np.zeros((len(solution.inverse),) * 2), []
    ends = np.cumsum([len(part.target) for part in solution.parts])
    for run, e, known, part, end in zip(
        runs, equations, left_out, solution.parts, ends, strict=True
    ):
        influence = solution.inverse[:, end - len(part.target) : end] * part.weight
        if e.levels is not None:  # an increment moves every sum after it
            nodes = influence.reshape(len(influence), len(e.levels), -1)
            influence = np.cumsum(nodes[:, :, :0:-1], axis=2)[:, :, ::-1].reshape(
                len(influence), -1
            )
        misfit = _misfit(e, known, solution.p, method, eliminate_rate)
        covariance, variance = noise_propagation.covariance(
            run, misfit, e.first, e.reach, influence
        )
        total += covariance
        variances.append(variance)
    return Spread(solution.directions @ total @ solution.directions.T, variances)


def _misfits(
    runs: Sequence[EnvelopeRun],
    equations: Sequence[Equations],
    left_out: Sequence[Array],
    p: Array,
    spread: Spread,
    method: str,
    eliminate_rate: bool,
) -> tuple[Array, Array]:
    """Each run's χ² and its number of equations (R,)."""
    chi2, rows = [], []
    for run, e, known, variance in zip(runs, equations, left_out, spread.variances, strict=True):
        seen = variance > 0
        left = _misfit(e, known, p, method, eliminate_rate)(run)
        chi2.append(float(np.sum(left[seen] ** 2 / variance[seen])))
        rows.append(int(seen.sum()))
    return np.array(chi2), np.array(rows)
