"""How finely runs are averaged: no row spans more of the wave's motion than the fit can follow, and
memory stays bounded.

A mean over a row in which the wave turns by x is short by x²/24 of what turns. Windows are
therefore carried along a motion before they are averaged, and the motion is the fitted one, found
again until the rows and the fit agree: then nothing of x²/24 is left, whatever the rate, and a
row's length decides only how well the fit's slopes and differences follow it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...errors import HrgError
from . import coordinates, matrices
from .envelope_runs import EnvelopeRun, average_rows
from .matrices import Matrix
from .response import Response

Array = np.ndarray
Carry = Callable[[Array, Array], Matrix]
MOTION_RAD = 0.25
"""Motion of the wave (turning, beat, decay) that a row spans at most."""
COARSEST_RAD = 1.0
"""Motion a row may span where memory allows no more rows; beyond it the runs are refused."""
MOST_ROWS = 40_000
"""Rows of all runs together that are kept: about a kilobyte each in the fit."""
FAST = 0.99
"""Quantile of |Ω| that counts as a run's rate: single spikes of a log do not."""


def estimate_speed(run: EnvelopeRun, p: Array) -> float:
    """How fast the wave moves: turning, beat and decay together, at the run's fastest.

    Parameters
    ----------
    run
        What its table turns.
    p
        Coordinates (7,).

    Returns
    -------
    float
        |K||Ω| + |ν| + νδμ + δω [rad/s], |Ω| its 99 % quantile.

    Examples
    --------
    K = 0.5 at 2 rad/s, a decay of 0.1 1/s and a split of 0.3 rad/s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rows import estimate_speed
    >>> t = np.arange(20.0)
    >>> run = EnvelopeRun("", t, np.ones((20, 2)), 0 * t + 1e-4, 2 * t, None, 5e3, 2, 1.0)
    >>> round(estimate_speed(run, np.array([0.1, 0, 0, 0.3, 0, 0.5, 1.0])), 9)
    1.4
    """
    step = np.diff(run.time_s)
    turning = float(np.quantile(np.abs(np.diff(run.turn_rad)) / step, FAST)) if len(step) else 0.0
    splits = np.hypot(*p[coordinates.DAMPING_SPLIT]) + np.hypot(*p[coordinates.FREQUENCY_SPLIT])
    return float(abs(p[coordinates.SCALE_FACTOR]) * turning + abs(p[coordinates.DAMPING]) + splits)


def count_rows(p: Array, runs: Sequence[EnvelopeRun], least: int) -> int:
    """Rows to which each run is averaged, so that none spans more than a quarter radian of motion.

    Parameters
    ----------
    p
        Coordinates (7,) of the motion.
    runs
        What is averaged; fewer windows than that are not averaged.
    least
        Rows wanted in any case.

    Returns
    -------
    int
        At least `least`, and otherwise no more than all runs together may keep.

    Raises
    ------
    HrgError
        Memory allows only rows so long that the fit could not follow the wave.

    Examples
    --------
    A wave that moves by 1.4 rad/s for 1000 s of windows of 0.01 s: 1400 rad in quarters.

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rows import count_rows
    >>> t, p = np.arange(99_999) * 0.01, np.array([0.1, 0, 0, 0.3, 0, 0.5, 1.0])
    >>> run = EnvelopeRun("", t, np.ones((len(t), 2)), 0 * t + 1e-4, 2 * t, None, 5e3, 2, 0.01)
    >>> count_rows(p, [run], 300)
    5600
    """
    motion = [estimate_speed(r, p) * (r.duration_s + r.window_s) for r in runs]
    wanted = max(
        (min(m / MOTION_RAD, len(r)) for m, r in zip(motion, runs, strict=True)), default=0.0
    )
    if not np.isfinite(wanted):
        return least
    most = max(least, MOST_ROWS // len(runs))
    rows = int(np.clip(np.ceil(wanted), least, most))
    for run, whole in zip(runs, motion, strict=True):
        if len(run) > rows and whole / rows > COARSEST_RAD:
            raise HrgError(
                f"{run.run_id or 'the run'}: the wave moves by {whole / rows:.2g} rad in each of"
                f" the {rows} rows that memory has, {COARSEST_RAD:g} rad at most were expected;"
                " identify fewer or shorter runs at once"
            )
    return rows


def average_along(runs: Sequence[EnvelopeRun], response: Response, rows: int) -> list[EnvelopeRun]:
    """Runs averaged along the motion of a fit: its generator, second order and phase.

    Parameters
    ----------
    runs
        With all their windows.
    response
        The model at the fit's state.
    rows
        Of a run at most.

    Returns
    -------
    list of EnvelopeRun
        In the order of the runs.

    Examples
    --------
    A turning and decaying wave averaged tenfold along its own motion is still on it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.response import State, make_batch, respond
    >>> from hrg_cli.fitting.envelopes.rows import average_along
    >>> t, p = np.linspace(0.0, 20.0, 401), np.array([0.1, 0, 0, 0, 0, 0.5, 0.0])
    >>> u = np.exp(-0.1 * t)[:, None] * np.stack([np.cos(0.5 * t), -np.sin(0.5 * t)], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, t, None, 5e3, 2, 0.05)
    >>> model = respond(make_batch([run]), State(p, u[:1].astype(complex), np.zeros((1, 1))))
    >>> (thin,) = average_along([run], model, 40)
    >>> size = np.linalg.norm(thin.envelope, axis=1)
    >>> len(thin), bool(np.allclose(size, np.exp(-0.1 * thin.time_s)))
    (40, True)
    """
    return [
        average_rows(run, rows, carry, phase)
        for run, (carry, phase) in zip(runs, list_motions(runs, response), strict=True)
    ]


def list_motions(
    runs: Sequence[EnvelopeRun], response: Response
) -> list[tuple[Carry, Callable[[Array], Array]]]:
    """Each run's motion by a fit, as `average_rows` takes it.

    Parameters
    ----------
    runs
        What is to be carried.
    response
        The model at the fit's state, of the same runs.

    Returns
    -------
    list of tuple
        The propagator over (dt [s], table turn [rad]), and the phase [rad] at times [s].

    Examples
    --------
    A decay by 0.1 1/s, 2 rad above the reference over a run of 20 s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.response import State, make_batch, respond
    >>> from hrg_cli.fitting.envelopes.rows import list_motions
    >>> t, p = np.linspace(0.0, 20.0, 401), np.array([0.1, 0, 0, 0, 0, 0.5, 0.0])
    >>> run = EnvelopeRun("", t, np.ones((401, 2)), 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.05)
    >>> model = respond(make_batch([run]), State(p, np.ones((1, 2), complex), np.array([[2.0]])))
    >>> ((carry, phase),) = list_motions([run], model)
    >>> bool(np.isclose(carry(np.ones(1), np.zeros(1))[0][0], np.exp(-0.1))), float(phase(10.0))
    (True, 1.0)
    """
    state, data = response.state, response.batch
    offsets = state.compute_offsets_rad_s(data.span_s)
    out = []
    for i, (run, seen) in enumerate(zip(runs, data.runs, strict=True)):
        omega = 2 * np.pi * run.reference_frequency_hz + float(offsets[i])
        out.append(
            (
                _carry(state.p, omega),
                _phase(state.phase[i], float(seen.time_s[0]), float(data.span_s[i])),
            )
        )
    return out


def _carry(p: Array, omega: float) -> Carry:
    def carry(dt: Array, turn: Array) -> Matrix:
        rate = np.divide(turn, dt, out=np.zeros(len(dt)), where=dt != 0)
        # exp(Lt) has a closed form once the trace is apart, which is a growth of both envelopes
        mean, L = matrices.split_trace(coordinates.compute_entries(p, rate, np.array([omega])))
        growth, m = np.exp(mean * dt), matrices.exponentiate(L, dt)
        return m[0] * growth, m[1] * growth, m[2] * growth, m[3] * growth

    return carry


def _phase(coefficients: Array, first_s: float, span_s: float) -> Callable[[Array], Array]:
    def phase(time_s: Array) -> Array:
        # from 0 at the first row: the phase there is the start envelope's own
        x = (time_s - first_s) / span_s
        return np.asarray(x * np.polynomial.polynomial.polyval(x, coefficients))

    return phase
