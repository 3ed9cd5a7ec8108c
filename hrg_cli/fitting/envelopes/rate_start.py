"""Where the fit of a rate starts: from the Stokes form, or from the wave's own turning.

With the known resonator's part A (PHYSICS §0), S₁' = A₁ + 2KΩS₂, S₂' = A₂ − 2KΩS₁, both integrated
from the run's first row: linear in Ω, and without axes, so circular orbits do no harm.
"""

from __future__ import annotations

import numpy as np

from ...physics import ellipse
from ..least_squares import fit_columns
from .envelope_runs import EnvelopeRun
from .rate_estimate import cardinal
from .response import State, make_batch, respond
from .trapezium import integrate

Array = np.ndarray
START_ROWS = 8000
"""Rows from which the start is taken at most."""


def estimate_plain_rate(run: EnvelopeRun, grid: Array, scale_factor: float) -> Array:
    """−m·(dθ/dt)/K on the grid, the angle smoothed over a quarter of a node's distance."""
    angle, _ = ellipse.unwrap(*ellipse.wave(run.envelope, 1)[2:], 1)
    turned = -_smooth(angle, max(1, len(run) // (4 * len(grid)))) / scale_factor
    return np.asarray(np.gradient(np.interp(grid, run.time_s, turned), grid))


def estimate_stokes_start(run: EnvelopeRun, grid: Array, p: Array) -> Array:
    """Rate on the nodes by linear least squares on S₁ and S₂ of the run, the rest of the resonator
    known; valid through circles."""
    run = run.rows(slice(None, None, -(-len(run) // START_ROWS)))
    t = run.time_s
    s0, s1, s2, s3 = np.moveaxis(ellipse.stokes(run.envelope), -1, 0)
    nu, dc, ds, wc, ws, factor = p[:6]
    shape = 2 * factor * cardinal(t, grid)
    std = 2 * run.std * np.sqrt(np.maximum(s0, 4 * run.std**2))
    design, target = [], []
    for value, known, turning in (
        (s1, -2 * nu * s1 - 2 * dc * s0 + 2 * ws * s3, s2),
        (s2, -2 * nu * s2 - 2 * ds * s0 - 2 * wc * s3, -s1),
    ):
        rows = (
            np.column_stack([integrate(shape * turning, t).T, value - integrate(known, t)])
            / std[:, None]
        )
        level = (1 / std) / np.linalg.norm(1 / std)
        rows -= np.outer(level, level @ rows)  # the first value is free
        design.append(rows[:, :-1])
        target.append(rows[:, -1])
    return fit_columns(np.concatenate(design), np.concatenate(target), 1e-6)


def _smooth(values: Array, width: int) -> Array:
    """Running mean of odd width, ends by reflection about the end value."""
    width |= 1
    half = width // 2
    padded = np.concatenate(
        [2 * values[0] - values[half:0:-1], values, 2 * values[-1] - values[-2 : -half - 2 : -1]]
    )
    return np.convolve(padded, np.ones(width) / width, "valid")


def estimate_mean_offset(run: EnvelopeRun, p: Array) -> float:
    """Mean angular frequency above the reference of a run whose turning is known, rad/s: what its
    phase runs ahead of the model."""
    run = run.rows(slice(None, None, -(-len(run) // START_ROWS)))
    data = make_batch([run])
    model = respond(data, State(p, run.envelope[:1], np.zeros((1, 1)))).model[0]
    ahead = np.sum(run.envelope * model.conj(), axis=1)
    step = np.diff(run.time_s)
    near = step < 1.5 * np.median(step)
    return float(np.angle(np.sum((ahead[1:] * ahead[:-1].conj())[near])) / np.mean(step[near]))
