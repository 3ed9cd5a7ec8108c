"""Identification by the propagator: u(t + h) = e^{jδh} exp(Lh) u(t) over all runs, a linear
regression a step; starts the likelihood.

The lag h grows from a row to half a run, so that no phase is ever wrapped: at the first lag any
start converges, each later lag starts from the one before. L is shared by the runs and linear in
the coordinates of `coordinates.py`; δ is each run's own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..least_squares import invert_information
from . import coordinates, matrices
from .coordinates import COUNT, DAMPING, SCALE_FACTOR
from .envelope_runs import EnvelopeRun, average_rows
from .likelihood import Freedom
from .matrices import Matrix, apply

Array = np.ndarray
START_BLOCKS = 1000
RESOLVED = 3.8
"""Fall of the energy that averaging loses for half as long rows, from which rows are short beside
every beat. A mean over a turn by ±x loses 1 − sin²x/x², a fourth for half of x where x is small;
3.8 stands at x = 0.7. The share itself would not do: a weak normal mode may be lost whole
unseen."""
LOST_STD = 5.0
"""Standard deviations of noise up to which no energy counts as lost."""
LONGEST_LAG = 0.5
"""Of the shortest run: half of it is where a rate of turn is best known from pairs of its rows."""
LAG_GROWTH = 4.0
"""From one lag to the next. What a lag leaves unknown, a small part of a radian, has grown by as
much at the next and is still far from half a turn."""
STEPS_A_LAG = 2
FIRST_STEPS = 6
"""Steps at the first lag, which begins where no split is known."""
PAIRS_A_LAG = 4
"""Pairs of rows whose first row lies within one lag on the way; at the last lag, where no row is in
two pairs, all."""
HIDDEN, SHORTER = 0.3, (0.75, 0.6)
"""Part of the largest turn over shorter lags below which a lag hides K, and the parts of it that
are tried instead: one of them is far from every whole number of a swing's periods."""
SETTLED = 1e-3
"""Change of L times lag after which the next step, its square, is left to the next lag."""
NEAR = 0.1
"""Part of a run's energy the first guess may miss at a lag for the regressions to begin there."""
LARGEST_STEP = 10.0
"""Change of L times lag above which a step is not believed."""


def estimate_mean_frequency(run: EnvelopeRun) -> float:
    """Mean angular frequency above the reference from neighbouring rows, half a turn apart at most.

    Parameters
    ----------
    run
        Its envelopes against its reference; steps over a gap are left out.

    Returns
    -------
    float
        rad/s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import estimate_mean_frequency
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.outer(np.exp((2j - 0.1) * t), [1.0, 0.2j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.1)
    >>> round(estimate_mean_frequency(run), 9)
    2.0
    """
    step = np.diff(run.time_s)
    near = step < 1.5 * np.median(step)
    turn = np.sum(run.envelope[1:] * np.conj(run.envelope[:-1]), axis=1)[near]
    return float(np.angle(np.sum(turn)) / np.mean(step[near]))


def estimate_mean_damping(run: EnvelopeRun) -> float:
    """Decay rate from the mean energies of the run's first and last thirds, which fall as e^{−2νt}.

    Parameters
    ----------
    run
        Its envelopes and their σ, whose power is taken off.

    Returns
    -------
    float
        ν [1/s]; finite where the last third is lost in noise.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import estimate_mean_damping
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.outer(np.exp(-0.1 * t), [1.0, 0.2j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.1)
    >>> round(estimate_mean_damping(run), 3)
    0.1
    """
    third = max(1, len(run) // 3)
    # the real and the imaginary part of an envelope each carry σ²
    noise = 2 * run.std[:, None] ** 2
    energy = np.abs(run.envelope) ** 2 - noise
    early, late = energy[:third].sum() / third, energy[-third:].sum() / third
    gap = run.time_s[-third:].mean() - run.time_s[:third].mean()
    floor = noise.mean() / np.sqrt(len(run))
    # the energy falls as e^{−2νt}
    return float(np.log(max(early, floor) / max(late, floor)) / (2 * gap)) if gap > 0 else 0.0


def estimate_scale_factor(runs: Sequence[EnvelopeRun]) -> float:
    """K from the turning between neighbouring rows: C·S' − S·C' = −KΩ(C² + S²), the common phase's
    step taken off first.

    Parameters
    ----------
    runs
        Envelopes and table turns; rows count by their energy, steps over a gap not at all.

    Returns
    -------
    float
        0 without rotation.

    Examples
    --------
    A wave that turns back by 0.3 of what its table turns, while its phase runs by 2 rad/s; steps of
    0.01 rad are straight to 2e-6:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import estimate_scale_factor
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.stack([np.cos(0.03 * t), -np.sin(0.03 * t)]) * np.exp(2j * t)
    >>> run = EnvelopeRun("", t, u.T, 0 * t + 1e-4, 0.1 * t, None, 5e3, 2, 0.1)
    >>> round(estimate_scale_factor([run]), 5)
    0.3
    """
    top = bottom = 0.0
    for run in runs:
        before, after = run.envelope[:-1], run.envelope[1:]
        turn = np.diff(run.turn_rad)
        slow = np.diff(run.time_s) < 1.5 * np.median(np.diff(run.time_s))
        along = np.sum(np.conj(before) * after, axis=1)
        # a phase that turns by δ from row to row would take 1 − cos δ of K away
        after = after * np.exp(-1j * np.angle(along))[:, None]
        cross = np.real(np.conj(before[:, 0]) * after[:, 1] - np.conj(before[:, 1]) * after[:, 0])
        dot = np.abs(along)
        # least squares of cross = −K·turn·dot with weights 1/dot: rows count by their energy
        top -= float(np.sum((turn * cross)[slow]))
        bottom += float(np.sum((turn**2 * dot)[slow]))
    return top / bottom if bottom > 0 else 0.0


def guess_roughly(runs: Sequence[EnvelopeRun]) -> tuple[Array, Array]:
    """A first guess without any anisotropy.

    Parameters
    ----------
    runs
        R of them.

    Returns
    -------
    tuple of ndarray
        Coordinates (7,), of which ν and K are not 0, and the runs' frequency offsets (R,) [rad/s].

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import guess_roughly
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.stack([np.cos(0.03 * t), -np.sin(0.03 * t)]) * np.exp((0.2j - 0.1) * t)
    >>> run = EnvelopeRun("", t, u.T, 0 * t + 1e-4, 0.1 * t, None, 5e3, 2, 0.1)
    >>> p, offsets = guess_roughly([run])
    >>> p.round(3).tolist(), offsets.round(3).tolist()
    ([0.1, 0.0, 0.0, 0.0, 0.0, 0.3, 0.0], [0.2])
    """
    p = np.zeros(COUNT)
    p[DAMPING] = np.median([estimate_mean_damping(r) for r in runs])
    p[SCALE_FACTOR] = estimate_scale_factor(runs)
    return p, np.array([estimate_mean_frequency(r) for r in runs])


def compute_propagator(p: Array, dt: Array, turn: Array, offset_rad_s: Array | float) -> Matrix:
    """exp of the generator without its second order, with a frequency offset: e^{jδt} exp(Lt).

    Parameters
    ----------
    p
        Coordinates (6 or 7,), of which the first six count.
    dt
        Times (n,) [s].
    turn
        What the table turns over each of them, (n,) [rad].
    offset_rad_s
        Of the frequency, (n,) or one.

    Returns
    -------
    tuple of ndarray
        The four entries (n,).

    Examples
    --------
    A split of 0.4 rad/s along the electrodes takes the channels apart by ±0.4·t:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.propagator import compute_propagator
    >>> p, t = np.array([0.1, 0, 0, 0.4, 0, 0.5, 0]), np.array([2.0])
    >>> m = compute_propagator(p, t, 0 * t, 3.0)
    >>> bool(np.isclose(m[0][0], np.exp((-0.1 + 3.4j) * 2)))
    True
    >>> bool(np.isclose(m[3][0], np.exp((-0.1 + 2.6j) * 2)))
    True
    """
    rate = np.divide(turn, dt, out=np.zeros(len(dt)), where=dt != 0)
    mean, L = matrices.split_trace(
        coordinates.compute_entries(np.append(p[:6], 0.0), rate, np.ones(1))
    )
    factor = np.exp((mean + 1j * offset_rad_s) * dt)
    m = matrices.exponentiate(L, dt)
    return m[0] * factor, m[1] * factor, m[2] * factor, m[3] * factor


def make_propagator(p: Array, offset_rad_s: float) -> Callable[[Array, Array], Matrix]:
    """The propagator of the plain generator with a frequency offset, for `average_rows`.

    Parameters
    ----------
    p
        Coordinates (6 or 7,), of which the first six count.
    offset_rad_s
        Of the frequency.

    Returns
    -------
    callable
        Over (dt [s], table turn [rad]), each (n,): the four entries.

    Examples
    --------
    A table turned by 1 rad turns the wave back by K = 0.5 of it, cos 0.5 and sin 0.5:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.propagator import make_propagator
    >>> carry = make_propagator(np.array([0, 0, 0, 0, 0, 0.5, 0]), 0.0)
    >>> [round(float(np.real(part[0])), 4) for part in carry(np.ones(1), np.ones(1))]
    [0.8776, 0.4794, -0.4794, 0.8776]
    """
    return lambda dt, turn: compute_propagator(p, dt, turn, offset_rad_s)


@dataclass(frozen=True)
class Pairs:
    """Rows one lag apart, all runs one after the other: u(t), u(t + h), h, table turn, 1/σ of the
    difference, first pair of each run."""

    before: Array
    after: Array
    dt: Array
    turn: Array
    weight: Array
    first: Array
    run: Array


def pair_rows(runs: Sequence[EnvelopeRun], lag_s: float, all_rows: bool = False) -> Pairs:
    """Pairs of rows about one lag apart within a run.

    Parameters
    ----------
    runs
        R of them.
    lag_s
        Pairs across a gap carry their true time.
    all_rows
        Whether every row begins a pair; otherwise `PAIRS_A_LAG` within a lag do.

    Returns
    -------
    Pairs
        All runs one after the other.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import pair_rows
    >>> t = np.array([0.0, 1.0, 2.0, 3.0, 7.0])
    >>> run = EnvelopeRun("", t, np.ones((5, 2)), 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0)
    >>> pair_rows([run], 2.0, all_rows=True).dt.tolist()
    [2.0, 2.0, 5.0, 4.0]
    """
    parts = []
    for number, run in enumerate(runs):
        # less a little: rounding must not make a lag of whole rows one row longer
        end = np.searchsorted(run.time_s, run.time_s + lag_s * (1 - 1e-9))
        begin = np.flatnonzero(end < len(run))
        if not all_rows:
            begin = begin[:: max(1, int(np.median(end[begin] - begin)) // PAIRS_A_LAG)]
        end = end[begin]
        dt, turn = run.time_s[end] - run.time_s[begin], run.turn_rad[end] - run.turn_rad[begin]
        weight = 1 / np.hypot(run.std[begin], run.std[end])
        parts.append(
            (run.envelope[begin], run.envelope[end], dt, turn, weight, np.full(len(begin), number))
        )
    before, after, dt, turn, weight, which = (np.concatenate(column) for column in zip(*parts))
    return Pairs(before, after, dt, turn, weight, np.flatnonzero(np.diff(which, prepend=-1)), which)


def reflect(v: tuple[Array, Array]) -> tuple[tuple[Array, Array], ...]:
    """R_c v, R_s v and J v, the three traceless real matrices of the plane.

    Parameters
    ----------
    v
        Both components, (n,) each.

    Returns
    -------
    tuple of tuple of ndarray
        Both components of each.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.propagator import reflect
    >>> reflect((3.0, 4.0))
    ((3.0, -4.0), (4.0, 3.0), (4.0, -3.0))
    """
    return (v[0], -v[1]), (v[1], v[0]), (v[1], -v[0])


def _predict(data: Pairs, p: Array, offsets: Array) -> tuple[Array, Array]:
    """e^{jδh} exp(Lh) u(t) of every pair (n, 2), and its derivatives by the first six coordinates
    over σ (6, n, 2)."""
    dt, rate = data.dt, data.turn / data.dt
    mean, L = matrices.split_trace(
        coordinates.compute_entries(np.append(p[:6], 0.0), rate, np.ones(1))
    )
    factor = np.exp((mean + 1j * offsets[data.run]) * dt)
    before = data.before[:, 0] * factor, data.before[:, 1] * factor
    whole, even, third, slope = matrices.compute_exponential_slopes(L, dt)
    flow, turned = apply(whole, before), apply(L, before)
    columns = np.empty((6, len(dt), 2), complex)
    columns[0, :, 0], columns[0, :, 1] = -dt * flow[0], -dt * flow[1]  # ν alone commutes
    # the derivative along R_c, R_s and J (matrices.exponential_slopes) needs tr(LE) and E·before
    for row, trace, image in zip(
        (1, 2, 5), (2 * L[0], L[1] + L[2], L[2] - L[1]), reflect(before), strict=True
    ):
        for channel in (0, 1):
            columns[row, :, channel] = (
                trace * (even * before[channel] + third * turned[channel]) + slope * image[channel]
            )
    # L holds −νδμ·R (damping), +jδω·R (stiffness) and +KΩ·J (turning)
    columns[1:3] *= -1
    np.multiply(columns[1:3], -1j, out=columns[3:5])
    columns *= data.weight[:, None]
    columns[5] *= rate[:, None]
    return np.stack(flow, axis=-1), columns


def _pair_equations(
    data: Pairs, freedom: Freedom, p: Array, offsets: Array
) -> tuple[Array, Array, float]:
    """Information and gradient of (z, the runs' offsets), and χ² of the pairs; an offset has rows
    in its own run alone, so only a border of the matrix is filled."""
    k, size = len(freedom.names), len(freedom.names) + len(offsets)
    now, columns = _predict(data, p, offsets)
    shared = freedom.project(columns)
    own = 1j * (data.dt * data.weight)[:, None] * now
    error = (data.after - now) * data.weight[:, None]

    information, gradient = np.zeros((size, size)), np.zeros(size)
    flat, target = shared.reshape(k, -1), error.ravel()
    information[:k, :k], gradient[:k] = np.real(flat.conj() @ flat.T), np.real(flat.conj() @ target)
    present = k + data.run[data.first]

    def by_run(values: Array) -> Array:
        return np.add.reduceat(np.real(values).sum(axis=-1), data.first, axis=-1)

    information[present, present] = by_run(np.abs(own) ** 2)
    information[:k, present] = by_run(np.conj(shared) * own)
    information[present, :k] = information[:k, present].T
    gradient[present] = by_run(np.conj(own) * error)
    return information, gradient, float(np.sum(np.abs(error) ** 2))


def regress(
    data: Pairs, freedom: Freedom, p: Array, offsets: Array
) -> tuple[Array, Array, Array, float]:
    """One Gauss–Newton step on u(t + h) − e^{jδh} exp(Lh) u(t) over all pairs.

    Parameters
    ----------
    data
        Pairs of rows of R runs.
    freedom
        What is fitted, k directions.
    p
        Coordinates (7,) before it.
    offsets
        The runs' frequency offsets (R,) before it [rad/s].

    Returns
    -------
    tuple of ndarray and float
        New coordinates and offsets, covariance (k, k) by what the pairs scatter, and the mean
        square misfit over σ² before the step.

    Examples
    --------
    From nothing known to a decay of 0.1 1/s and an offset of 0.2 rad/s; a step later they are there
    to the square of what was missing over a lag:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import free_coordinates
    >>> from hrg_cli.fitting.envelopes.propagator import pair_rows, regress
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.outer(np.exp((0.2j - 0.1) * t), [1.0, 0.2j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.1)
    >>> space, data = free_coordinates(["damping"], np.zeros(7)), pair_rows([run], 0.1)
    >>> p, offsets, _, _ = regress(data, space, np.zeros(7), np.zeros(1))
    >>> p, offsets, _, _ = regress(data, space, p, offsets)
    >>> round(float(p[0]), 6), round(float(offsets[0]), 6)
    (0.1, 0.2)
    """
    k = len(freedom.names)
    information, gradient, misfit = _pair_equations(data, freedom, p, offsets)
    here = freedom.locate(p)
    for i, std in enumerate(freedom.prior_std):
        if np.isfinite(std):  # a direction without information stays at its prior
            information[i, i] += std**-2.0
            gradient[i] += (freedom.prior_mean[i] - here[i]) * std**-2.0
    inverse = invert_information(information, 1e-8)
    step, rows = inverse @ gradient, 4 * len(data.dt)
    spread = max(0.0, misfit - float(gradient @ step)) / max(1, rows - len(step))
    return (
        p + freedom.directions @ step[:k],
        offsets + step[k:],
        spread * inverse[:k, :k],
        misfit / rows,
    )


def identify(
    runs: Sequence[EnvelopeRun],
    freedom: Freedom,
    p: Array,
    offsets: Array,
    from_shortest: bool = False,
) -> tuple[Array, Array, Array]:
    """Coordinates and frequency offsets by regressions at growing lag from a first guess.

    Parameters
    ----------
    runs
        R of them.
    freedom
        What is fitted, k directions.
    p, offsets
        First guess, (7,) and (R,) [rad/s].
    from_shortest
        Whether to begin at the shortest lag, not at the longest that the guess follows.

    Returns
    -------
    tuple of ndarray
        Coordinates (7,), frequency offsets (R,) and covariance (k, k) of z.

    Examples
    --------
    A frequency split of 0.5 rad/s on axis 0 from nothing but a rough guess:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import free_coordinates
    >>> from hrg_cli.fitting.envelopes.propagator import guess_roughly, identify
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.stack([np.exp((0.5j - 0.1) * t), np.exp((-0.5j - 0.1) * t)], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.1)
    >>> space = free_coordinates(["damping", "split_cos", "split_sin"], np.zeros(7))
    >>> p, offsets, _ = identify([run], space, *guess_roughly([run]))
    >>> p[[0, 3, 4]].round(6).tolist()
    [0.1, 0.5, 0.0]
    """
    covariance = np.zeros((len(freedom.names),) * 2)
    lags = list_lags(runs)
    first = 0 if from_shortest else find_longest_lag(runs, lags, p, offsets)
    for lag in lags[first:]:
        misfit, data = np.inf, pair_rows(runs, lag, all_rows=lag == lags[-1])
        kept = (p, offsets, covariance)
        # No `least_squares.descend`: this is a first guess, whose steps at one lag need no end of
        # their own; one that makes the fit worse, or is too long to be true, is left to the next
        # lag.
        for _ in range(1 + (FIRST_STEPS if lag == lags[first] else STEPS_A_LAG)):
            next_p, next_offsets, next_covariance, here = regress(data, freedom, p, offsets)
            if not here < misfit * (1 + 1e-9):
                p, offsets, covariance = kept  # the last step made it worse
                break
            kept, misfit = (p, offsets, covariance), here
            moved = _measure_over_lag(next_p - p, data)
            if moved > LARGEST_STEP:
                break
            p, offsets, covariance = next_p, next_offsets, next_covariance
            if moved < SETTLED:
                break
    return p, offsets, covariance


def find_longest_lag(
    runs: Sequence[EnvelopeRun], lags: Sequence[float], p: Array, offsets: Array
) -> int:
    """Place of the longest lag over which a guess misses little of any run's energy.

    No phase is wrapped there, unless by a weak normal mode that beats.

    Parameters
    ----------
    runs
        R of them.
    lags
        Rising [s].
    p, offsets
        The guess, (7,) and (R,) [rad/s].

    Returns
    -------
    int
        0 where it follows over none.

    Examples
    --------
    A guess without the split of 0.5 rad/s misses |e^{j0.5h} − 1|² of the energy, a tenth at
    h = 0.63 s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import find_longest_lag
    >>> t = np.arange(0.0, 20.0, 0.1)
    >>> u = np.stack([np.exp(0.5j * t), np.exp(-0.5j * t)], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.1)
    >>> find_longest_lag([run], [0.1, 0.4, 0.6, 0.7, 6.4], np.zeros(7), np.zeros(1))
    2
    """
    followed = (
        i
        for i in reversed(range(len(lags)))
        if measure_largest_miss(pair_rows(runs, lags[i]), p, offsets) < NEAR
    )
    return next(followed, 0)


def measure_largest_miss(data: Pairs, p: Array, offsets: Array) -> float:
    """Largest part of a run's energy that coordinates and offsets miss over the pairs.

    Parameters
    ----------
    data
        Pairs of rows of R runs.
    p, offsets
        (7,) and (R,) [rad/s].

    Returns
    -------
    float
        0 where the pairs follow them; 4 for an opposite wave.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import measure_largest_miss, pair_rows
    >>> t = np.arange(20.0)
    >>> u = np.outer((-1.0) ** t, [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0)
    >>> measure_largest_miss(pair_rows([run], 1.0), np.zeros(7), np.zeros(1))
    4.0
    """
    x, y = apply(
        compute_propagator(p, data.dt, data.turn, offsets[data.run]),
        (data.before[:, 0], data.before[:, 1]),
    )
    left = np.abs(data.after[:, 0] - x) ** 2 + np.abs(data.after[:, 1] - y) ** 2
    energy = np.sum(np.abs(data.after) ** 2, axis=1)
    return float(np.max(np.add.reduceat(left, data.first) / np.add.reduceat(energy, data.first)))


def list_lags(runs: Sequence[EnvelopeRun]) -> list[float]:
    """Lags from a row to half of the shortest run, each at most four times the one before.

    A table that swings is where it was after every period: of a lag over which no run turns by
    much of what it does over shorter ones K is not seen, and it is made shorter.

    Parameters
    ----------
    runs
        At least one.

    Returns
    -------
    list of float
        Rising [s].

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import list_lags
    >>> t = np.arange(129.0)
    >>> run = EnvelopeRun("", t, np.ones((129, 2)), 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0)
    >>> [round(float(lag), 9) for lag in list_lags([run])]
    [1.0, 4.0, 16.0, 64.0]

    On a table that swings once in 64 s:

    >>> swing = EnvelopeRun(
    ...     "", t, np.ones((129, 2)), 0 * t + 1e-4, np.sin(np.pi * t / 32), None, 5e3, 2, 1.0
    ... )
    >>> [round(float(lag), 9) for lag in list_lags([swing])]
    [1.0, 4.0, 16.0, 38.4]
    """
    span = min(r.duration_s for r in runs)
    shortest = max(float(np.median(np.diff(r.time_s))) for r in runs)
    longest = max(LONGEST_LAG * span, shortest)
    count = 1 + int(np.ceil(np.log(longest / shortest) / np.log(LAG_GROWTH)))
    lags = [lag for lag in np.geomspace(shortest, longest, count) if lag <= 0.9 * span]
    seen = 0.0
    for k, lag in enumerate(lags):
        turn = _find_turn(runs, lag)
        if turn < HIDDEN * seen:
            turn, lags[k] = max((_find_turn(runs, part * lag), part * lag) for part in SHORTER)
        seen = max(seen, turn)
    return lags


def _find_turn(runs: Sequence[EnvelopeRun], lag_s: float) -> float:
    """The largest turn of a table over a lag, rad."""
    largest = 0.0
    for run in runs:
        later = run.time_s[run.time_s <= run.time_s[-1] - lag_s] + lag_s
        turn = np.interp(later, run.time_s, run.turn_rad) - run.turn_rad[: len(later)]
        largest = max(largest, float(np.max(np.abs(turn), initial=0.0)))
    return largest


def _measure_over_lag(change: Array, data: Pairs) -> float:
    """By how much a change of the coordinates turns or shrinks the wave over a lag, rad: K is a
    number of its own and counts by what the table turns."""
    return float(
        np.hypot(
            np.linalg.norm(change[:5]) * np.max(data.dt), change[5] * np.max(np.abs(data.turn))
        )
    )


def thin_rows(
    runs: Sequence[EnvelopeRun], p: Array, offsets: Array, blocks: int
) -> list[EnvelopeRun]:
    """Runs averaged along the motion of a guess.

    Parameters
    ----------
    runs
        R of them.
    p, offsets
        The guess, (7,) and (R,) [rad/s].
    blocks
        Rows of each at most.

    Returns
    -------
    list of EnvelopeRun
        In the order of the runs.

    Examples
    --------
    An offset of 2 rad/s, known, is not averaged away over rows of 3 s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import thin_rows
    >>> t = np.arange(0.0, 30.0, 0.1)
    >>> u = np.outer(np.exp(2j * t), [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.1)
    >>> np.abs(thin_rows([run], np.zeros(7), np.array([2.0]), 10)[0].envelope[0, 0]).round(9)
    np.float64(1.0)
    >>> np.abs(thin_rows([run], np.zeros(7), np.array([0.0]), 10)[0].envelope[0, 0]).round(1)
    np.float64(0.0)
    """
    return [average_rows(r, blocks, make_propagator(p, offset)) for r, offset in zip(runs, offsets)]


def thin_to_beats(
    runs: Sequence[EnvelopeRun], p: Array, offsets: Array, blocks: int, most: int
) -> list[EnvelopeRun]:
    """Runs averaged along a rough guess, but no beat averaged away that the guess does not know.

    Parameters
    ----------
    runs
        R of them.
    p, offsets
        The guess, (7,) and (R,) [rad/s].
    blocks
        Rows of each to begin with.
    most
        Rows of each at most, where the averages lose energy.

    Returns
    -------
    list of EnvelopeRun
        In the order of the runs.

    Examples
    --------
    A beat of 2 rad/s in a run of 100 s asks for rows far shorter than 10 s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import thin_to_beats
    >>> t = np.arange(0.0, 100.0, 0.1)
    >>> u = np.stack([np.exp(1j * t), np.exp(-1j * t)], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.1)
    >>> len(thin_to_beats([run], np.zeros(7), np.zeros(1), 10, 1000)[0])
    160
    """
    thin = thin_rows(runs, p, offsets, blocks)
    lost = measure_lost_energy(runs, thin)
    while blocks < most and np.any(lost > 0):
        blocks = min(2 * blocks, most)
        thin = thin_rows(runs, p, offsets, blocks)
        before, lost = lost, measure_lost_energy(runs, thin)
        if np.all(lost * RESOLVED <= before):
            break
    return thin


def measure_lost_energy(runs: Sequence[EnvelopeRun], thin: Sequence[EnvelopeRun]) -> Array:
    """Energy of the runs that is no longer in their averaged rows.

    Parameters
    ----------
    runs, thin
        The runs and their averages.

    Returns
    -------
    ndarray
        (R,) in variances of their noise; 0 where noise alone may have had it.

    Examples
    --------
    A phase that goes round once within a row is gone, nearly all of 50·(1/0.01)²:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.propagator import measure_lost_energy, thin_rows
    >>> t = np.arange(50.0)
    >>> u = np.outer(np.exp(0.4j * np.pi * t), [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 1.0)
    >>> thin = thin_rows([run], np.zeros(7), np.zeros(1), 10)
    >>> len(thin[0]), (measure_lost_energy([run], thin) / 50e4).round(2).tolist()
    (10, [0.99])
    """
    lost = np.array([_energy(r) - _energy(few) for r, few in zip(runs, thin, strict=True)])
    noise = np.sqrt(8.0 * np.array([len(r) for r in runs]))  # of χ² with four components a row
    return np.where(lost > LOST_STD * noise, lost, 0.0)


def _energy(run: EnvelopeRun) -> float:
    """Σ|u|²/σ² less what noise has in it: averaging rows along their true motion leaves it as it
    is."""
    return float(np.sum(np.abs(run.envelope) ** 2 / run.std[:, None] ** 2)) - 4.0 * len(run)
