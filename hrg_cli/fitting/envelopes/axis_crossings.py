"""The stiffness axis of free runs from the turning points of the quadrature: seed A's second remark
after (16), for a wave that nobody drives.

In the working mode a_B itself changes its sign where the wave passes a stiffness axis; in a free
run both amplitudes decay alike, and a_B/a_A has a turning point there. With a_B/a_A = tan ε seed A
(13), which is exact and holds no rate, reads
    ε̇ = δω sin(2mθ − 2mθ_ω) + νδμ cos(2mθ − 2mθ_μ) sin 2ε,
    d(½ ln S₀)/dt = −ν − νδμ cos(2mθ − 2mθ_μ) cos 2ε,        S₀ = a_A² + a_B²;
less the damping's small part ε̇ rises through zero at θ_ω and falls through it at θ_ω + π/2m. Every
row belongs to the nearer of the two, every passage of one has its own constant, and the sine is
integrated along the measured angle: no passage need be slow, straight or whole, and a wave that
stands between them says on which side. ε and ½ ln S₀ of a row have the standard deviation σ/√S₀,
independent from row to row, so that least squares gives each side's (δω cos 2mθ_ω, δω sin 2mθ_ω)
with its information; the informations' sum gives the one answer. The angle that the sine is
integrated along has noise too, σ/(√S₀ cos 2ε) of mθ, which adds up from row to row and is carried
to the answer. What the sine's integral over rows
of finite length leaves out is found by putting the answer through the same equations without noise,
and is taken off.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...physics import ellipse
from .coordinates import (
    COUNT,
    DAMPING,
    DAMPING_SPLIT,
    FREQUENCY_SPLIT,
    SECOND_ORDER,
    to_parameters,
)
from .envelope_runs import EnvelopeRun
from .inference import widen_axes
from .method_ranges import USES_AXES, find_refusal, list_warnings
from .normal_equations import Normal, add_normals, build_normal, take_means_off
from .regressions import CORRECTIONS, SETTLED, WIDE_STEP, Noiseless, Regression

Array = np.ndarray
METHOD = "axis-crossings"
assert METHOD in USES_AXES
SIDES = ("stiff", "soft")
LEAST_ROWS = 3
"""Rows of a passage from which its own constant leaves something."""
DISTINCT = 0.5
"""Standard deviation of 2mθ_ω, rad, up to which one side of a run is an answer of its own."""


@dataclass(frozen=True)
class Side:
    """The passages of one axis in one run: number of the run, the axis's side, how often the wave
    went over it, what its rows say; of the rows the design over σ (n, 4), σ (n,), the passage (n,),
    2mθ (n,) and its standard deviation (n,), and the time (n,)."""

    run: int
    side: str
    passages: int
    normal: Normal
    design: Array
    std: Array
    passage: Array
    angle: Array
    angle_std: Array
    time_s: Array

    def compute_bend(self, answer: Array) -> Array:
        """What a row's angle adds to all later ε (n,), beside its neighbours: h/2·∂ε̇/∂2mθ of the
        steps on its two sides, (n, 2)."""
        half = np.diff(self.time_s) / 2 * (np.diff(self.passage) == 0)
        middle = (self.angle[1:] + self.angle[:-1]) / 2
        slope = half * (answer[0] * np.cos(middle) + answer[1] * np.sin(middle))
        return np.column_stack([np.append(0, slope), np.append(slope, 0)]) * self.angle_std[:, None]

    def compute_wander_covariance(self, answer: Array, covariance: Array) -> Array:
        """Covariance (4, 4) by the angles' noise of the least squares that has `covariance`."""
        # the influences of a passage sum to zero, so those after a step are minus those up to it
        up_to = np.cumsum(covariance @ (self.design / self.std[:, None]).T, axis=1)
        before, after = self.compute_bend(answer).T
        moved = np.column_stack([np.zeros(4), up_to[:, :-1]]) * before + up_to * after
        return np.asarray(moved @ moved.T)

    def compute_excess(self, answer: Array) -> float:
        """What the angles' noise adds to χ² on average."""
        step2 = self.compute_bend(answer).sum(axis=1) ** 2
        out = 0.0
        for k in np.unique(self.passage):
            own = self.passage == k
            n = int(own.sum())
            left = np.arange(n, 0, -1)  # rows that a row's angle moves
            moved = np.sum(step2[own] * (left - left**2 / n))
            out += float(moved / np.mean(self.std[own] ** 2))
        return out


@dataclass(frozen=True)
class Crossings:
    """The one answer (4,) with covariance (4, 4), each run's χ², scaled so that noise alone gives
    its degrees of freedom (R,), the sides, and what the decay alone says of the damping split."""

    answer: Array
    covariance: Array
    chi2: Array
    freedom: Array
    sides: list[Side]
    decay: Normal


@dataclass(frozen=True)
class EllipseCourse:
    """A run's rows: 2mθ unwrapped, ε, ½ ln S₀, their standard deviation, the gapless piece a row is
    in, all (n,)."""

    run: EnvelopeRun
    angle: Array
    ellipticity: Array
    log_size: Array
    std: Array
    piece: Array
    ellipticity_left: Array | float = 0.0
    log_size_left: Array | float = 0.0
    """What the integrals leave out of either (n,)."""

    def integrate(self, slow: Array) -> Array:
        """∫ slow·e^{j2mθ} dt from the first row (n,): 2mθ straight between rows, slow (n,) at its
        mean."""
        half = np.diff(self.angle) / 2
        turned = np.exp(1j * (self.angle[:-1] + half)) * np.sinc(half / np.pi)
        return np.append(
            0, np.cumsum(np.diff(self.run.time_s) * turned * (slow[1:] + slow[:-1]) / 2)
        )

    def build_ellipticity_columns(self) -> Array:
        """ε less its constant, by the four unknowns (n, 4)."""
        split = self.integrate(np.ones_like(self.std))
        damping = self.integrate(np.sin(2 * self.ellipticity))
        return np.column_stack([split.imag, -split.real, damping.real, damping.imag])

    def build_decay_columns(self) -> Array:
        """½ ln S₀ less its constant, by ν and the four unknowns (n, 5)."""
        turned = self.integrate(np.cos(2 * self.ellipticity))
        none = np.zeros_like(self.std)
        return np.column_stack([-self.run.time_s, none, none, -turned.real, -turned.imag])

    def subtract_model(self, model: EnvelopeRun, p: Array) -> EllipseCourse:
        """The course less what the equations leave of a noiseless run of coordinates p (7,)."""
        exact = build_ellipse_course(dataclasses.replace(model, std=np.zeros(len(model))))
        own = np.array([p[DAMPING], *p[FREQUENCY_SPLIT], *p[DAMPING_SPLIT]])
        return dataclasses.replace(
            self,
            ellipticity_left=exact.ellipticity - exact.build_ellipticity_columns() @ own[1:],
            log_size_left=exact.log_size - exact.build_decay_columns() @ own,
        )


def build_ellipse_course(run: EnvelopeRun) -> EllipseCourse:
    """The ellipse's course on a run's rows, the noise's own power taken off S₀.

    Parameters
    ----------
    run
        Envelopes and σ.

    Returns
    -------
    EllipseCourse
        2mθ, ε = arctan(a_B/a_A), ½ ln S₀ and their standard deviation, row by row.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.axis_crossings import build_ellipse_course
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.outer(np.exp(-0.1 * t), [1.0, -0.2j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-6, 0 * t, None, 5e3, 2, 0.1)
    >>> course = build_ellipse_course(run)
    >>> round(float(np.tan(course.ellipticity[50])), 9), round(float(np.ptp(course.log_size)), 6)
    (0.2, 1.99)
    """
    a, b, angle, phase = ellipse.find_wave(run.envelope, 1)
    power = np.maximum(a**2 + b**2 - 4 * run.std**2, run.std**2)
    step = np.diff(run.time_s)
    piece = np.append(0, np.cumsum(step > WIDE_STEP * np.median(step)))
    angle = 2 * ellipse.unwrap(angle, phase, 1)[0]
    return EllipseCourse(
        run, angle, np.arctan2(b, a), np.log(power) / 2, run.std / np.sqrt(power), piece
    )


def build_decay_equations(w: EllipseCourse) -> Normal:
    """What the decay of S₀ says of the damping split; ν is the run's own.

    d(½ ln S₀)/dt = −ν − νδμ cos(2mθ − 2mθ_μ) cos 2ε.

    Parameters
    ----------
    w
        A run's ellipse.

    Returns
    -------
    Normal
        Of (δω cos, δω sin, νδμ cos, νδμ sin), nothing of the first two.

    Examples
    --------
    A straight wave that turns along mθ = t in a shell whose damping is larger along axis 0:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.axis_crossings import (
    ...     build_decay_equations, build_ellipse_course,
    ... )
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> u = np.exp(-0.1 * t - 0.02 * np.sin(2 * t) / 2) * np.stack([np.cos(t), np.sin(t)])
    >>> run = EnvelopeRun("", t, u.T, 0 * t + 1e-6, 0 * t, None, 5e3, 2, 0.01)
    >>> found = build_decay_equations(build_ellipse_course(run))
    >>> np.linalg.lstsq(found.information[2:, 2:], found.product[2:])[0].round(6) + 0
    array([0.02, 0.  ])
    """
    return build_normal(
        w.build_decay_columns(), w.log_size - w.log_size_left, w.std, w.piece, own=1
    )


def bound_damping_split(runs: Sequence[EnvelopeRun]) -> Normal:
    """What a passive resonator says of its damping split: it is not above the damping.

    That is at most what the fastest run decays by; where the runs say nothing of the split, this
    does.

    Parameters
    ----------
    runs
        At least one.

    Returns
    -------
    Normal
        Both components 0 ± the fastest decay rate, or 1 over a run's length where that is more.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.axis_crossings import bound_damping_split
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.outer(np.exp(-0.25 * t), [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-6, 0 * t, None, 5e3, 2, 0.1)
    >>> np.diag(bound_damping_split([run]).information).round(6).tolist()
    [0.0, 0.0, 16.0, 16.0]
    """
    fall = [
        -np.polyfit(r.time_s - r.time_s[0], np.log(np.linalg.norm(r.envelope, axis=1)), 1)[0]
        for r in runs
    ]
    most = max(*fall, *(1 / r.duration_s for r in runs))
    return Normal(np.diag([0.0, 0.0, most**-2.0, most**-2.0]), np.zeros(4), 0.0, 0)


def find_sides(w: EllipseCourse, number: int, axis: float) -> list[Side]:
    """What a run says at the stiff and at the soft axis.

    Every row belongs to the nearer axis; a passage is a stretch of rows of one axis, and its
    constant (the ellipticity it came with) is its own.

    Parameters
    ----------
    w
        The run's ellipse.
    number
        Of the run.
    axis
        A first guess of 2mθ_ω [rad].

    Returns
    -------
    list of Side
        At most two, each with at least `LEAST_ROWS` rows.

    Examples
    --------
    A wave that turns by mθ = 1 … 4 rad over an axis guessed at 2mθ_ω = 0 passes the soft one at
    π/2 and the stiff one at π:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.axis_crossings import build_ellipse_course, find_sides
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> t = np.arange(1.0, 4.0, 0.01)
    >>> u = np.stack([np.cos(t), np.sin(t)], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-6, 0 * t, None, 5e3, 2, 0.01)
    >>> [(one.side, one.passages) for one in find_sides(build_ellipse_course(run), 0, 0.0)]
    [('stiff', 1), ('soft', 1)]
    """
    columns, target = w.build_ellipticity_columns(), w.ellipticity - w.ellipticity_left
    # which axis the wave is nearest to, even the stiff one, odd the soft one; a passage is a
    # stretch near one of them, and its constant (the ellipticity it came with) is its own
    nearest = np.floor((w.angle - axis) / np.pi + 0.5).astype(int)
    begun = (np.diff(nearest, prepend=nearest[0]) != 0) | (np.diff(w.piece, prepend=0) != 0)
    passage = np.cumsum(begun)
    long = np.bincount(passage)[passage] >= LEAST_ROWS
    over = np.floor((w.angle - axis) / np.pi)
    out = []
    for parity, side in enumerate(SIDES):
        own = long & (nearest % 2 == parity)
        if own.any():
            rows = build_normal(columns[own], target[own], w.std[own], passage[own])
            crossed = np.sum((np.diff(over) != 0) & (nearest[1:] % 2 == parity))
            angle_std = 2 * w.std[own] / np.cos(2 * w.ellipticity[own])
            design = take_means_off(columns[own], w.std[own], passage[own])
            out.append(
                Side(
                    number,
                    side,
                    int(crossed),
                    rows,
                    design,
                    w.std[own],
                    passage[own],
                    w.angle[own],
                    angle_std,
                    w.run.time_s[own],
                )
            )
    return out


def fit_crossings(
    runs: Sequence[EnvelopeRun], model: Sequence[EnvelopeRun] = (), p: Array | None = None
) -> Crossings:
    """The frequency split as a vector, from all sides of all free runs by inverse covariance.

    Parameters
    ----------
    runs
        Free ones.
    model, p
        The same runs of coordinates p (7,) without noise, by which what the integrals leave out is
        taken off.

    Returns
    -------
    Crossings
        The one answer, each run's χ², and the sides.

    Examples
    --------
    A split of 0.05 rad/s on axis 0 from a wave that the table turns once round:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.axis_crossings import fit_crossings
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 20.0, 0.02), np.array([0.1, 0.0, 0.0, 0.05, 0.0, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.0]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.02)
    >>> fit_crossings([run]).answer[:2].round(5) + 0
    array([0.05, 0.  ])
    """
    courses = [build_ellipse_course(run) for run in runs]
    if p is not None:
        courses = [w.subtract_model(m, p) for w, m in zip(courses, model, strict=True)]
    beside = add_normals([bound_damping_split(runs), *(build_decay_equations(w) for w in courses)])
    found: list[Side] = []
    axis = 0.0
    for _ in range(2):  # any guess divides the rows; the sides are those of what they say
        found = [side for i, w in enumerate(courses) for side in find_sides(w, i, axis)]
        if not found:
            break
        answer, covariance = add_normals([beside, *(side.normal for side in found)]).solve()
        axis = float(np.arctan2(answer[1], answer[0]))
    if not found:
        none = np.full(4, np.nan)
        return Crossings(none, np.full((4, 4), np.nan), np.zeros(0), np.zeros(0, int), [], beside)
    chi2, freedom, excess = np.zeros(len(runs)), np.zeros(len(runs), int), np.zeros(len(runs))
    wander = np.zeros((4, 4))
    for side in found:
        chi2[side.run] += side.normal.compute_misfit(answer)
        freedom[side.run] += side.normal.freedom
        excess[side.run] += side.compute_excess(answer)
        wander += side.compute_wander_covariance(answer, covariance)
    for side in found:  # the answer follows a part of what the angles' noise does
        excess[side.run] -= float(np.trace(side.normal.information @ wander))
    covariance = covariance + wander
    chi2 *= freedom / np.maximum(1, freedom + excess)
    factor = max(1.0, float(chi2.sum()) / max(1, int(freedom.sum())))
    return Crossings(answer, covariance * factor, chi2, freedom, found, beside)


def list_axes(found: Crossings, runs: Sequence[EnvelopeRun]) -> list[dict[str, Any]]:
    """The stiffness axis as each side of each run alone gives it, where it does.

    Parameters
    ----------
    found
        The fit to all runs.
    runs
        The same runs.

    Returns
    -------
    list of dict
        `value` [rad], `std`, `run_id`, `side` and `passages` of each that passed the axis and knows
        it better than `DISTINCT`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.axis_crossings import fit_crossings, list_axes
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 20.0, 0.02), np.array([0.1, 0.0, 0.0, 0.0, 0.05, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.0]
    >>> run = EnvelopeRun("left", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.02)
    >>> [(one["side"], round(one["value"], 3)) for one in list_axes(fit_crossings([run]), [run])]
    [('stiff', 0.393), ('soft', 0.393)]
    """
    out = []
    for side in found.sides:
        answer, covariance = (side.normal + found.decay).solve()
        covariance = covariance + side.compute_wander_covariance(answer, covariance)
        x, y = answer[:2]
        across = np.array([-y, x]) / max(float(x**2 + y**2), 1e-300)
        std = float(np.sqrt(max(0.0, across @ covariance[:2, :2] @ across)))
        if side.passages and 0 < std < DISTINCT:
            run = runs[side.run]
            period = np.pi / run.mode_number
            out.append(
                {
                    "value": float(np.mod(np.arctan2(y, x) / (2 * run.mode_number), period)),
                    "std": std / (2 * run.mode_number),
                    "run_id": run.run_id,
                    "side": side.side,
                    "passages": side.passages,
                }
            )
    return out


def combine_estimates(found: Crossings, mode_number: int) -> dict[str, float]:
    """The one answer as an axis, and how often an axis was passed.

    Parameters
    ----------
    found
        The fit to all runs.
    mode_number
        m.

    Returns
    -------
    dict
        `value` [rad] in [0, π/m), `std` and `crossings`.

    Examples
    --------
    Components of 3 and 4, each known to 0.01, on the axis arctan(4/3)/2m:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.axis_crossings import Crossings, combine_estimates
    >>> answer, none = np.array([3.0, 4.0, 0.0, 0.0]), np.zeros(0)
    >>> found = Crossings(answer, 1e-4 * np.eye(4), none, none, [], None)
    >>> {name: round(value, 5) for name, value in combine_estimates(found, 2).items()}
    {'value': 0.23182, 'std': 0.0005, 'crossings': 0}
    """
    p, covariance = np.zeros(COUNT), np.zeros((COUNT, COUNT))
    p[FREQUENCY_SPLIT] = found.answer[:2]
    covariance[FREQUENCY_SPLIT, FREQUENCY_SPLIT] = found.covariance[:2, :2]
    values, slopes = to_parameters(p, mode_number)
    spread = slopes @ covariance @ slopes.T
    widen_axes(spread, covariance, p, mode_number)
    return {
        "value": float(values[4]),
        "std": float(np.sqrt(spread[4, 4])),
        "crossings": sum(side.passages for side in found.sides),
    }


def _corrected(
    runs: Sequence[EnvelopeRun], found: Crossings, model: Noiseless, start: Array
) -> tuple[Crossings, float]:
    """The crossings less what the method makes of noiseless rows, until they stay; the last change
    in σ."""
    change = 0.0
    for _ in range(CORRECTIONS):
        here = np.array(start, float)
        here[FREQUENCY_SPLIT] = found.answer[:2]
        before, found = found, fit_crossings(runs, model(here), here)
        moved = np.abs(found.answer - before.answer)[:2] / np.sqrt(np.diag(found.covariance)[:2])
        change = float(np.max(moved))
        if change < SETTLED:
            break
    return found, change


def solve(
    runs: Sequence[EnvelopeRun], model: Noiseless | None = None, start: Array | None = None
) -> Regression:
    """The axis finder as a method of identification, of the frequency split and its axis alone.

    Parameters
    ----------
    runs
        Free ones.
    model
        Noiseless rows for any coordinates (7,), by which what the integrals leave out is taken off.
    start
        The first coordinates (7,) for it.

    Returns
    -------
    Regression
        Coordinates with NaN but for the split; refused where the runs have no axes.

    Examples
    --------
    A circle has none:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.axis_crossings import solve
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> t = np.arange(20.0)
    >>> u = np.outer(np.ones(20), [1.0, 1j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-6, 0 * t, None, 5e3, 2, 1.0)
    >>> solve([run]).refused[:41]
    'axis-crossings needs an elongated wave, |'
    """
    p, covariance = np.full(COUNT, np.nan), np.full((COUNT, COUNT), np.nan)
    refusal = find_refusal(runs, METHOD)
    if refusal:
        return Regression(p, covariance, refused=refusal)
    found, change = fit_crossings(runs), 0.0
    if not found.sides:
        return Regression(p, covariance, refused=f"{METHOD} needs gapless rows, none were found")
    if model is not None and start is not None:
        found, change = _corrected(runs, found, model, start)
    covariance[FREQUENCY_SPLIT, FREQUENCY_SPLIT] = found.covariance[:2, :2]
    p[FREQUENCY_SPLIT], p[SECOND_ORDER] = found.answer[:2], 0.0
    return Regression(
        p,
        np.nan_to_num(covariance),
        list_warnings(runs, METHOD, False),
        run_chi2=found.chi2,
        run_rows=found.freedom,
        unsettled=change,
        details={
            "stiffness_axes": list_axes(found, runs),
            "stiffness_axis_of_crossings": combine_estimates(found, runs[0].mode_number),
        },
    )
