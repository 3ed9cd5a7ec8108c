"""A logged quantity between its rows: straight lines, bent to the cubic through four rows where the
log shows the bend.

In the interval from t_k, x = t − t_k, of length h: p = line + x (x − h)(α + β x), α and β from
divided differences (Newton). The bend is taken where it exceeds twice the cubic's own error, |Π(t −
t_i)|·|f[five rows]|, in the middle, and where the second differences at both ends of the interval
are of one bend: both are so along a smooth course, not in noise, at jumps, at corners of a ramp or
between the steps of a converter. On even rows the cubic's mean over the interval is brought to that
of the quintic through six rows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray
FEWEST = 6
"""Rows from which a bend is looked for."""
SMOOTH = 0.9
"""Change of the second difference over an interval, over the greatest about it, below which the
course bends there and has no corner, where it is 1, nor a step, where it is 2."""
STEADY = 0.5
"""Relative change of the slope from one step to the next up to which a course counts as steady;
noise alone changes it by more than 1."""

EVEN = 1e-6
"""Part of a step by which the steps of even rows may differ."""

THROUGH_SIX = np.array([11.0, -93.0, 802.0, 802.0, -93.0, 11.0]) / 1440
"""Weights of six even rows in the mean of their quintic over the middle interval."""

SHARPENINGS, SHARP = 16, 1e-9
"""Rounds by which a course is brought to its means, each of which leaves at most half of what the
last left, and the part of the largest mean that may be left: where the courses of two rounds are
bent in different places a few rounds turn the wave by more than none do."""


@dataclass(frozen=True)
class Course:
    """Rows (n,), values (n,), and the coefficients α, β of every interval's bend (n − 1,)."""

    time_s: Array
    value: Array
    alpha: Array
    beta: Array

    def interpolate(self, time_s: Array) -> Array:
        """Values at any times; beyond the ends a steady course goes on for one step, then (and any
        other at once) the last value holds.

        Parameters
        ----------
        time_s
            Any times, s.

        Returns
        -------
        ndarray
            As many values.
        """
        t = self.time_s
        if len(t) == 1:
            return np.full(np.shape(time_s), self.value[0])
        inside = np.clip(time_s, *self.domain)
        k = np.clip(np.searchsorted(t, inside, side="right") - 1, 0, len(t) - 2)
        x, h = inside - t[k], t[k + 1] - t[k]
        return np.asarray(
            self.value[k]
            + x
            * (
                (self.value[k + 1] - self.value[k]) / h
                + (x - h) * (self.alpha[k] + self.beta[k] * x)
            )
        )

    @property
    def domain(self) -> tuple[float, float]:
        """Times from which and to which the rows tell the course."""
        t = self.time_s
        return t[0] - self._find_reach(0, 1, 2), t[-1] + self._find_reach(-1, -2, -3)

    def _find_reach(self, end: int, next_one: int, third: int) -> float:
        """How far a course goes on beyond an end: one step where its last two steps are bent, or
        nearly as steep as each other."""
        if len(self.time_s) < 3:
            return 0.0
        rows = [end, next_one, third]
        last, before = np.diff(self.value[rows]) / np.diff(self.time_s[rows])
        steady = abs(last - before) <= STEADY * abs(last)
        bent = bool(self.alpha[end] and self.alpha[next_one])
        return abs(float(self.time_s[next_one] - self.time_s[end])) if steady or bent else 0.0

    def integrate(self) -> Array:
        """Integral of the course from its first row to each row.

        In an interval of length h, ∫₀ʰ x(x − h)(α + βx) dx = −h³(α/6 + βh/12) beside the trapezium
        of the line.

        Returns
        -------
        ndarray
            (n,), value times s; the first is 0.
        """
        h = np.diff(self.time_s)
        # ∫₀ʰ x(x − h)(α + βx) dx = −h³(α/6 + βh/12), beside the trapezium of the line
        bent = h**3 * (self.alpha / 6 + self.beta * h / 12)
        return np.concatenate([[0.0], np.cumsum(h * (self.value[1:] + self.value[:-1]) / 2 - bent)])

    def integrate_to(self, time_s: Array) -> Array:
        """Integral of the course from its first row to any times, by Simpson's rule from the row
        before each, exact on the cubics; beyond the ends from the end.

        Parameters
        ----------
        time_s
            Any times, s.

        Returns
        -------
        ndarray
            As many integrals, value times s.
        """
        t = self.time_s
        if len(t) == 1:
            return np.asarray(self.value[0] * (time_s - t[0]))
        k = np.clip(np.searchsorted(t, time_s, side="right") - 1, 0, len(t) - 1)
        part = (
            (time_s - t[k])
            / 6
            * (
                self.interpolate(t[k])
                + 4 * self.interpolate((t[k] + time_s) / 2)
                + self.interpolate(time_s)
            )
        )
        return np.asarray(self.integrate()[k] + part)


@dataclass(frozen=True)
class Impulse:
    """∫ of a quantity from its log's start: a course between the borders of the log's rows, and the
    quantity's first and last mean, which hold where the log has ended."""

    course: Course
    first: float
    last: float

    def integrate_to(self, time_s: Array) -> Array:
        """Integral of the quantity from its log's start to any times.

        Parameters
        ----------
        time_s
            Any times, s.

        Returns
        -------
        ndarray
            As many integrals, value times s.
        """
        start, end = self.course.domain
        inside = np.clip(time_s, start, end)
        beyond = time_s - inside
        held = np.where(beyond < 0, self.first, self.last)
        return np.asarray(self.course.interpolate(inside) + held * beyond)


def integrate_means(time_s: Array, mean: Array) -> Impulse:
    """Integral of a quantity whose rows are means about their times, at the borders between them.

    A row counts from half way to the row before to half way to the next one. So the course keeps
    what a log of means says, and what one that holds each value until the next says half a step
    later, however rough the quantity is.

    Parameters
    ----------
    time_s
        Of the rows (n,), increasing, s.
    mean
        Of the quantity about each row (n,).

    Returns
    -------
    Impulse
        Its integral as a function of time.

    Examples
    --------
    A rate of 1 rad/s from 3 s on, logged each second, turns by 4.5 rad until 7 s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.course import integrate_means
    >>> t = np.arange(10.0)
    >>> turned = integrate_means(t, np.where(t >= 3, 1.0, 0.0))
    >>> (turned.integrate_to(np.array([2.5, 7.0])) - turned.integrate_to(np.array([0.0]))).round(
    ...     12
    ... ).tolist()
    [0.0, 4.5]
    """
    t, y = np.asarray(time_s, float), np.asarray(mean, float)
    if len(t) == 1:
        t, y = t + np.array([-0.5, 0.5]), np.repeat(y, 2)
    middle = (t[1:] + t[:-1]) / 2
    border = np.concatenate([[2 * t[0] - middle[0]], middle, [2 * t[-1] - middle[-1]]])
    through = build_course(border, np.concatenate([[0.0], np.cumsum(y * np.diff(border))]))
    return Impulse(through, float(y[0]), float(y[-1]))


def estimate_means(time_s: Array, value: Array) -> Array:
    """Means about a log's rows of which it has the values at single instants.

    A row stands for its surroundings, half way to its neighbours: of length h, their centre c off
    the row's time, so that their mean is y + (c − t) ẏ + (h²/24 + (c − t)²/2) ÿ. Rows at uneven
    times are off it whatever they hold; the bend is taken where the log shows one (not in noise,
    nor in steps that hold each value).

    Parameters
    ----------
    time_s
        Of the rows (n,), increasing, s.
    value
        At the rows (n,).

    Returns
    -------
    ndarray
        (n,); the first and the last are the values themselves, and all of fewer than `FEWEST` rows.

    Examples
    --------
    The mean of a sinusoid over a row of length h is sinc(ωh/2) of its value:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.course import estimate_means
    >>> t = np.arange(0.0, 40.0, 0.5)
    >>> found = estimate_means(t, np.cos(0.5 * t)) / np.cos(0.5 * t)
    >>> round(float(found[40]), 4), round(float(np.sin(0.125) / 0.125), 4)
    (0.9974, 0.9974)
    """
    t, y = np.asarray(time_s, float), np.asarray(value, float)
    if len(t) < FEWEST:
        return y
    shown = build_course(t, y).alpha != 0
    before, behind = np.diff(t)[:-1], np.diff(t)[1:]
    left, right = np.diff(y)[:-1] / before, np.diff(y)[1:] / behind
    # slope and second derivative at the row of the parabola through it and its neighbours
    first = (left * behind + right * before) / (before + behind)
    second = 2 * (right - left) / (before + behind)
    # the row's borders lie at t − before/2 and t + behind/2
    off, length = (behind - before) / 4, (before + behind) / 2
    bend = np.where(shown[1:] & shown[:-1], second * (length**2 / 24 + off**2 / 2), 0.0)
    return y + np.concatenate([[0.0], off * first + bend, [0.0]])


def average_over_windows(impulse: Impulse, time_s: Array, width_s: Array | float) -> Array:
    """Means of a quantity over windows about times, from its integral.

    Parameters
    ----------
    impulse
        ∫ of the quantity.
    time_s
        Middles of the windows (n,), s.
    width_s
        Their length, one or (n,), s.

    Returns
    -------
    ndarray
        (n,), unit of the quantity.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.course import average_over_windows, integrate_means
    >>> ramp = integrate_means(np.arange(10.0), np.arange(10.0))
    >>> average_over_windows(ramp, np.array([3.0, 4.2]), 2.0).round(12).tolist()
    [3.0, 4.2]
    """
    half = np.asarray(width_s) / 2
    return np.asarray(
        (impulse.integrate_to(time_s + half) - impulse.integrate_to(time_s - half)) / width_s
    )


def build_from_means(time_s: Array, mean: Array, width_s: float) -> Course:
    """The course whose means over windows about its rows are the given ones.

    Parameters
    ----------
    time_s
        Of the rows (n,), increasing, s.
    mean
        Over a window about each row (n,).
    width_s
        Of a window, s.

    Returns
    -------
    Course
        Through values that are sharper than the means, as far as the course is smooth.

    Examples
    --------
    Windows of a second take 1 − sin(0.25)/0.25, a hundredth, off a swing of 0.5 rad/s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.course import build_from_means
    >>> t = np.arange(0.0, 60.0)
    >>> true = np.cos(0.5 * t)
    >>> mean = true * np.sin(0.25) / 0.25
    >>> found = build_from_means(t, mean, 1.0).value
    >>> [float(np.abs(x - true)[10:50].max().round(4)) for x in (mean, found)]
    [0.0104, 0.0001]
    """
    found = build_course(time_s, mean)
    t, half = found.time_s, width_s / 2
    for _ in range(SHARPENINGS):
        area = found.integrate_to(t + half) - found.integrate_to(t - half)
        missed = mean - area / width_s
        if np.abs(missed).max() <= SHARP * np.abs(mean).max():
            break
        found = build_course(time_s, found.value + missed)
    return found


def _is_smooth(second: Array, k: Array) -> Array:
    """Whether the second divided differences (n − 1,) at both ends of the intervals k (n,) are of
    one bend: they differ by less than the greatest of them and their neighbours.

    At a corner of straight lines one of them is the corner and the other 0, at a step they are
    opposite, however unevenly the rows lie; along a sinusoid of eight rows a period and more they
    differ by 0.84 of the greatest at most, where it turns from one side to the other.
    """
    around = [second[np.clip(k + j, 0, len(second) - 1)] for j in (-2, -1, 0, 1)]
    return np.abs(around[2] - around[1]) < SMOOTH * np.max(np.abs(around), axis=0)


def build_course(time_s: Array, value: Array) -> Course:
    """The course through a log's rows: times increasing, values finite.

    Parameters
    ----------
    time_s
        Of the rows (n,), s.
    value
        At the rows (n,).

    Returns
    -------
    Course
        Straight lines where the log shows no bend, or has fewer than `FEWEST` rows.

    Examples
    --------
    A swing is bent between its rows, steps are not:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.course import build_course
    >>> t = np.arange(20.0)
    >>> swing, steps = build_course(t, np.sin(0.3 * t)), build_course(t, np.where(t < 9, 0.0, 1.0))
    >>> x = np.array([8.5])
    >>> (
    ...     float(abs(swing.interpolate(x) - np.sin(0.3 * x))[0].round(4)),
    ...     float(steps.interpolate(x)[0]),
    ... )
    (0.0, 0.5)
    """
    t, y = np.asarray(time_s, float), np.asarray(value, float)
    n = max(0, len(t) - 1)
    if len(t) < FEWEST:
        return Course(t, y, np.zeros(n), np.zeros(n))
    # of[j]: divided differences of order j, f[t_i … t_{i+j}] at i
    of = [y]
    for order in range(1, 5):
        of.append(np.diff(of[-1]) / (t[order:] - t[:-order]))
    k = np.arange(n)
    first = np.clip(k - 1, 0, len(t) - 4)
    # Newton's form begins with the interval's own two rows, then takes the row before (in the first
    # interval the one behind): f[3 rows] + (t − t_third)·f[4 rows] = α + βx
    third_row = np.where(k > 0, k - 1, 2)
    alpha = of[2][np.maximum(k - 1, 0)] + (t[k] - t[third_row]) * of[3][first]
    beta = of[3][first]
    # bend and error are compared where both are largest: in the middle, |x(x − h)| = h²/4
    middle, h = (t[:-1] + t[1:]) / 2, np.diff(t)
    bend = h**2 / 4 * np.abs(alpha + beta * h / 2)
    around = np.abs(of[4])
    fourth = np.maximum(*(around[np.clip(first + j, 0, len(around) - 1)] for j in (-1, 0)))
    error = np.prod([np.abs(middle - t[first + j]) for j in range(4)], axis=0) * fourth
    bent = (bend > 2 * error) & _is_smooth(of[2], k)
    return _bend_through_six(Course(t, y, np.where(bent, alpha, 0.0), np.where(bent, beta, 0.0)))


def _bend_through_six(cubics: Course) -> Course:
    """The same, bent further so that its means are those of quintics through six rows where these
    are even and the course bends over them: of a swing that turns by x a row the cubics' integral
    misses 11x⁴/720 of itself, the quintics' 191x⁶/60480.

    The quintic's integral over the middle of its five intervals is h (11, −93, 802, 802, −93,
    11)/1440 of its rows; a change of α adds −h³/6 of it to the cubic's.
    """
    around = np.lib.stride_tricks.sliding_window_view
    h = np.diff(cubics.time_s)
    even = np.ptp(around(h, 5), axis=1) <= EVEN * h[2:-2]
    # where a swing passes through zero one interval of them shows no bend
    bent = (around(cubics.alpha, 5) != 0).sum(1) >= 4
    middle = h[2:-2]
    through = middle * (around(cubics.value, 6) @ THROUGH_SIX)
    missed = np.where(even & bent, through - np.diff(cubics.integrate())[2:-2], 0.0)
    alpha = cubics.alpha.copy()
    alpha[2:-2] -= 6 * missed / middle**3
    return Course(cubics.time_s, cubics.value, alpha, cubics.beta)
