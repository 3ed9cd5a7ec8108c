"""The rows that a regression starts from: those the likelihood was fitted to, as a resonator of
first order in |L|/ω would show them.

Seed A's equations hold u' = L₁u, the first term of L = L₁ − (L² + 2ΓL)/(2jω) (PHYSICS §5). What the
second does to the envelopes is taken off them by the likelihood's own model of phase φ(t),
u₁ = u·e^{−jφ} − [u_model(s) − u_model(0)], with the scale s of the second order that it found.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...fitting.envelopes import coordinates, propagator
from ...fitting.envelopes.base_freedom import Known, choose_scale_factor, make_freedom
from ...fitting.envelopes.coordinates import SECOND_ORDER
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.likelihood import Fit, Freedom, fit
from ...fitting.envelopes.response import State, make_batch, respond
from . import closing
from .verdict import read_second_order_std

Array = np.ndarray


@dataclass(frozen=True)
class PreparedRows:
    """What a regression starts from: the likelihood's rows as a first-order resonator shows them at
    its own mean frequency, the likelihood's coordinates (7,) and what is free.
    """

    rows: list[EnvelopeRun]
    p: Array
    covariance: Array
    space: Freedom
    beside: PreparedRows | None = None
    """The same with the scale of the second order one of its standard deviations larger; None where
    that scale is held."""

    def simulate(self, p: Array) -> list[EnvelopeRun]:
        """The rows as a resonator of coordinates p (7,) would show them, started as the runs
        did."""
        data = make_batch(self.rows)
        p = np.append(p[:6], 0.0)
        found = fit(
            data,
            _hold_all_but_second_order(p),
            np.zeros(1),
            data.envelope[:, 0],
            np.zeros((len(self.rows), 1)),
        )
        x = data.time_s / data.span_s[:, None]
        model = found.response.model * np.exp(-1j * found.response.state.phase * x)[..., None]
        return [
            dataclasses.replace(r, envelope=model[i, : len(r)]) for i, r in enumerate(self.rows)
        ]


def _hold_all_but_second_order(p: Array) -> Freedom:
    """All coordinates held at p, the second order at its own value: what is fitted are the runs'
    starts and phases."""
    only = np.zeros((coordinates.COUNT, 1))
    only[6, 0] = 1.0
    return Freedom(
        ("second_order",),
        np.append(p[:6], 0.0),
        only,
        np.full(1, p[SECOND_ORDER]),
        np.full(1, 1e-9),
    )


def prepare_rows(runs: Sequence[EnvelopeRun], known: Known, best: Fit) -> PreparedRows:
    """The rows the likelihood was fitted to, averaged along its motion, without their phases' drift
    and second order.

    Seed A's equations are of first order in |L|/ω. What the second order (rate times split or
    damping over ω) does to the envelopes is taken off them by the likelihood's model, with the
    scale the likelihood found; where it is known no better than its standard deviation, the rows
    `beside` have one more of it taken off.

    Parameters
    ----------
    runs
        Free ones of one gyro.
    known
        What is held; K at its nominal value too where no run turns and none is given.
    best
        The likelihood's optimum on them.

    Returns
    -------
    PreparedRows
        Rows, the likelihood's coordinates on them and their covariance.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.first_order_rows import prepare_rows
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> ready = prepare_rows(runs, Known(), fit_base_model(runs, blocks=100))
    >>> [len(run) for run in ready.rows], ready.p[[0, 5]].round(3).tolist()
    ([100, 100], [0.1, 0.55])
    """
    if known.scale_factor is None and max(float(np.ptp(r.turn_rad)) for r in runs) == 0:
        known = dataclasses.replace(known, scale_factor=choose_scale_factor(runs[0].mode_number))
    ready = _take_off_second_order(runs, known, best, float(best.p[SECOND_ORDER]))
    std = read_second_order_std(best)
    if std == 0 or _weigh_second_order(best) * std < closing.SETTLED:
        return ready
    return dataclasses.replace(
        ready, beside=_take_off_second_order(runs, known, best, float(best.p[SECOND_ORDER]) + std)
    )


def _weigh_second_order(best: Fit) -> float:
    """What the second order does to all rows, in their noise: no linear answer moves by more of its
    own standard deviations (Cauchy and Schwarz)."""
    data, state = best.response.batch, best.response.state
    first, second = (
        respond(data, State(np.append(best.p[:6], order), state.start, state.phase)).model
        for order in (0.0, 1.0)
    )
    return float(np.linalg.norm(data.whiten(second - first)))


def _take_off_second_order(
    runs: Sequence[EnvelopeRun], known: Known, best: Fit, scale: float
) -> PreparedRows:
    """The likelihood's rows less `scale` times what the second order does to them."""
    data, state = best.response.batch, best.response.state
    x = data.time_s / data.span_s[:, None]
    phase = sum(state.phase[:, k - 1 : k] * x**k for k in range(1, state.phase.shape[1] + 1))
    none = np.zeros((len(data.runs), 1))
    first, second = (
        respond(data, State(np.append(best.p[:6], order), state.start, none)).model
        for order in (0.0, scale)
    )
    # the mean frequency's shift by the second order is the run's own and stays
    envelope = data.envelope * np.exp(-1j * phase)[..., None] - (second - first)
    offsets = state.compute_offsets_rad_s(data.span_s) / (2 * np.pi)
    thin = [
        dataclasses.replace(
            r,
            envelope=envelope[i, : len(r)],
            reference_frequency_hz=r.reference_frequency_hz + float(offsets[i]),
        )
        for i, r in enumerate(data.runs)
    ]
    space = make_freedom(known, best.p, runs[0].mode_number, max(r.duration_s for r in runs))
    p, _, covariance = propagator.identify(
        thin, space, np.append(best.p[:6], 0.0), np.zeros(len(thin))
    )
    return PreparedRows(thin, p, covariance, space)
