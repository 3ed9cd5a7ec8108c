"""A run's frequency that moves by more than a fit could find its way through: its course from
neighbouring windows, as a polynomial.

Gauss–Newton on phases wraps where the frequency's drift turns the phase by some radians more than a
straight line; so that part is taken from the windows' own phase steps first (frequency with
temperature, a pendulum's with its amplitude squared), and refined by the fit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence

import numpy as np

from .envelope_runs import EnvelopeRun
from .matrices import Matrix, apply
from .propagator import make_propagator
from .response import Batch

Array = np.ndarray
DEGREE = 8
"""Degree of the frequency's polynomial; the phase's is one more."""
FEWEST_ROWS = 64
CLEAR, MOSTLY = 8.0, 0.8
"""Amplitude over its noise from which a phase step is believed, and the part of the rows that must
be so clear."""
WRAPS_RAD = 3.0
"""Bend of the phase's course above which a fit that starts from a straight line may lose a turn."""
Course = np.polynomial.Polynomial


def find_bends(runs: Sequence[EnvelopeRun], scale_factor: float) -> list[Course] | None:
    """How each run's phase bends, where a fit could lose a turn of one.

    A turning ellipse runs ahead by KΩ·S₃/S₀, so a rate that changes bends its phase, and that is
    the model's own: each row is turned back by K (roughly known) times the table's turn.

    Parameters
    ----------
    runs
        Envelopes of each.
    scale_factor
        K, roughly.

    Returns
    -------
    list of Polynomial or None
        Phase [rad] over the time from a run's first row [s], less its straight line and what the
        table's turning does to it; None where no run's phase bends by more than `WRAPS_RAD`.

    Examples
    --------
    A frequency that rises by 0.1 rad/s², whose phase is a parabola of 0.05·t²; within 10 s it bends
    by too little to mislead a fit:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.phase_course import find_bends
    >>> t = np.linspace(0.0, 40.0, 801)
    >>> u = np.outer(np.exp(0.05j * t**2), [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.05)
    >>> (course,) = find_bends([run], 0.5)
    >>> round(float(course.deriv(2)(20.0)), 6)
    0.1
    >>> find_bends([run.select_rows(slice(0, 200))], 0.5) is None
    True
    """
    found = [_bend(run, scale_factor) for run in runs]
    times = [run.time_s - run.time_s[0] for run in runs]
    most = max(
        (float(np.ptp(course(t))) for course, t in zip(found, times, strict=True)), default=0.0
    )
    return found if most > WRAPS_RAD else None


def _bend(run: EnvelopeRun, scale_factor: float) -> Course:
    t = run.time_s - run.time_s[0]
    phase = follow_phase(run, make_propagator(np.array([0, 0, 0, 0, 0, scale_factor, 0]), 0.0))
    return phase - Course.fit(t, phase(t), 1).convert()


def follow_phase(run: EnvelopeRun, carry: Callable[[Array, Array], Matrix]) -> Course:
    """How far a run's phase runs ahead of a motion, from one window to the next.

    Parameters
    ----------
    run
        Envelopes of it.
    carry
        carry(dt, dturn): the propagator of that motion over dt [s] and table turn [rad].

    Returns
    -------
    Polynomial
        Phase [rad] over the time from the run's first row [s], 0 there; 0 throughout where the run
        is short or lost in noise.

    Examples
    --------
    A frequency that rises by 0.1 rad/s², seen beside a motion of 2 rad/s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.phase_course import follow_phase
    >>> from hrg_cli.fitting.envelopes.propagator import make_propagator
    >>> t = np.linspace(0.0, 40.0, 801)
    >>> u = np.outer(np.exp(2j * t + 0.05j * t**2), [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.05)
    >>> round(float(follow_phase(run, make_propagator(np.zeros(7), 2.0))(30.0)), 6)
    45.0
    """
    if len(run) < FEWEST_ROWS:
        return Course([0.0])
    clear = np.linalg.norm(run.envelope, axis=1) > CLEAR * run.std
    if np.mean(clear) < MOSTLY:
        return Course([0.0])
    t = run.time_s - run.time_s[0]
    step = np.diff(t)
    # over a gap the phase may have turned by any number of turns
    near = (step < 1.5 * np.median(step)) & clear[1:] & clear[:-1]
    earlier, later = run.envelope[:-1], run.envelope[1:]
    c, s = apply(carry(step, np.diff(run.turn_rad)), (earlier[:, 0], earlier[:, 1]))
    product = later[:, 0] * np.conj(c) + later[:, 1] * np.conj(s)
    mean = np.angle(np.sum(product[near]))
    rate = (mean + np.angle(product * np.exp(-1j * mean))) / step
    middle = (t[1:] + t[:-1]) / 2
    # a phase has the noise σ/|u|; the strongest row counts for ten usual ones at most
    weight = np.sqrt(np.abs(product)) / run.std[1:]
    weight = np.minimum(weight, 10 * np.median(weight[near]))
    return Course.fit(middle[near], rate[near], DEGREE, w=weight[near]).convert().integ()


def straighten_phases(
    runs: Sequence[EnvelopeRun], courses: Sequence[Course], sign: float = -1.0
) -> list[EnvelopeRun]:
    """Runs with these courses of the phase taken off, or put back.

    Parameters
    ----------
    runs
        Envelopes of each.
    courses
        Of each run its phase [rad] over the time from its first row [s].
    sign
        −1: off; +1: back.

    Returns
    -------
    list of EnvelopeRun
        Their envelopes times e^{±jφ}.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.phase_course import Course, straighten_phases
    >>> t = np.linspace(100.0, 140.0, 801)
    >>> u = np.outer(np.exp(0.05j * (t - 100) ** 2), [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.05)
    >>> (straight,) = straighten_phases([run], [Course([0.0, 0.0, 0.05])])
    >>> bool(np.allclose(straight.envelope[:, 0], 1.0))
    True
    """
    return [
        dataclasses.replace(
            r, envelope=r.envelope * np.exp(sign * 1j * c(r.time_s - r.time_s[0]))[:, None]
        )
        for r, c in zip(runs, courses, strict=True)
    ]


def bend_back(
    data: Batch, runs: Sequence[EnvelopeRun], courses: Sequence[Course], phase: Array
) -> tuple[list[EnvelopeRun], Array]:
    """What a fit of straightened runs is with their courses put back.

    Parameters
    ----------
    data
        The straightened runs' rows that were fitted.
    runs, courses
        The runs before, whose first rows begin the courses, and those.
    phase
        Coefficients (R, k) of (t/T)¹…ᵏ [rad], from the first of the fitted rows over their span T.

    Returns
    -------
    tuple of list of EnvelopeRun and ndarray
        The rows with the courses in their phases, and the coefficients (R, k') that go with them;
        what a course holds at the first row goes into the start state.

    Examples
    --------
    A parabola of 0.05·t² over 40 s is 80·(t/T)²:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.phase_course import Course, bend_back
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 40.0, 801)
    >>> run = EnvelopeRun("", t, np.ones((801, 2)), 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.05)
    >>> course = Course([0.0, 0.0, 0.05])
    >>> rows, phase = bend_back(make_batch([run]), [run], [course], np.array([[3.0]]))
    >>> phase.round(9).tolist(), bool(np.allclose(np.angle(rows[0].envelope[20]), 0.05))
    ([[3.0, 80.0]], True)
    """
    rows, orders = [], max([phase.shape[1], *(len(c) - 1 for c in courses)])
    out = np.zeros((len(courses), orders))
    out[:, : phase.shape[1]] = phase
    for i, (seen, run, course) in enumerate(zip(data.runs, runs, courses, strict=True)):
        first = float(seen.time_s[0] - run.time_s[0])
        turn = course(seen.time_s - run.time_s[0])
        rows.append(dataclasses.replace(seen, envelope=seen.envelope * np.exp(1j * turn)[:, None]))
        moved = course(Course([first, float(data.span_s[i])])).coef
        out[i, : len(moved) - 1] += moved[1:]
    return rows, out
