"""Where the fit of a rate starts: from the Stokes form, or from the wave's own turning.

With the known resonator's part A (PHYSICS §0), S₁' = A₁ + 2KΩS₂, S₂' = A₂ − 2KΩS₁, both integrated
from the run's first row: linear in Ω, and without axes, so circular orbits do no harm.
"""

from __future__ import annotations

import numpy as np

from ...physics import ellipse
from ..least_squares import fit_columns
from .envelope_runs import EnvelopeRun
from .rate_estimate import build_cardinals
from .response import State, make_batch, respond
from .trapezium import integrate

Array = np.ndarray
START_ROWS = 8000
"""Rows from which the start is taken at most."""


def estimate_plain_rate(run: EnvelopeRun, grid: Array, scale_factor: float) -> Array:
    """The rate as the wave's own turning shows it, −m·(dθ/dt)/K, the drift not taken off.

    Parameters
    ----------
    run
        Its wave angle is smoothed over a quarter of a node's distance.
    grid
        Nodes (k,) [s].
    scale_factor
        K.

    Returns
    -------
    ndarray
        (k,) rad/s.

    Examples
    --------
    A table at 1 rad/s turns the wave back by K = 0.3 of that:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rate_start import estimate_plain_rate
    >>> t = np.arange(0.0, 20.0, 0.05)
    >>> u = np.stack([np.cos(0.3 * t), -np.sin(0.3 * t)], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-5, t, None, 5e3, 2, 0.05)
    >>> estimate_plain_rate(run, np.linspace(0.0, 19.0, 4), 0.3).round(6).tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    angle, _ = ellipse.unwrap(*ellipse.find_wave(run.envelope, 1)[2:], 1)
    turned = -_smooth(angle, max(1, len(run) // (4 * len(grid)))) / scale_factor
    return np.asarray(np.gradient(np.interp(grid, run.time_s, turned), grid))


def estimate_stokes_start(run: EnvelopeRun, grid: Array, p: Array) -> Array:
    """Rate on the nodes by linear least squares on S₁ and S₂ of the run; valid through circles.

    Parameters
    ----------
    run
        Its table turn does not count.
    grid
        Nodes (k,) [s].
    p
        Coordinates (7,) of the resonator, known.

    Returns
    -------
    ndarray
        (k,) rad/s.

    Examples
    --------
    A table at 1 rad/s under a resonator whose splits make the wave drift as well:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rate_start import estimate_stokes_start
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.02), np.array([0.1, 0.02, 0.01, 0.2, 0.1, 0.3, 0.0])
    >>> u = exponentiate(build_generator(p, 1.0, 3e4), t) @ [1.0, 0.5j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-5, 0 * t, None, 5e3, 2, 0.02)
    >>> estimate_stokes_start(run, np.linspace(0.0, 9.98, 4), p).round(4).tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    run = run.select_rows(slice(None, None, -(-len(run) // START_ROWS)))
    t = run.time_s
    s0, s1, s2, s3 = np.moveaxis(ellipse.compute_stokes(run.envelope), -1, 0)
    nu, dc, ds, wc, ws, factor = p[:6]
    shape = 2 * factor * build_cardinals(t, grid)
    # σ of S₁ = |C|² − |S|², as of S₂, is 2σ√S₀; where the wave is lost, S₀ is what noise alone
    # makes
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
    # what no row tells, as the rate at a node in a gap, stays at 0: the fit that follows finds it
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
    """Mean angular frequency above the reference of a run whose turning is known.

    Parameters
    ----------
    run
        Envelopes and table turn.
    p
        Coordinates (7,) of the resonator.

    Returns
    -------
    float
        rad/s: what the run's phase runs ahead of the model, whose own splits are in it.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rate_start import estimate_mean_offset
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.02), np.array([0.1, 0.02, 0.01, 0.2, 0.1, 0.3, 0.0])
    >>> u = exponentiate(build_generator(p, 1.0, 3e4) + 0.7j * np.eye(2), t) @ [1.0, 0.5j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-5, t, None, 5e3, 2, 0.02)
    >>> round(estimate_mean_offset(run, p), 6)
    0.7
    """
    run = run.select_rows(slice(None, None, -(-len(run) // START_ROWS)))
    data = make_batch([run])
    model = respond(data, State(p, run.envelope[:1], np.zeros((1, 1)))).model[0]
    # its phase is how far the run is ahead of the model; products of neighbours need no unwrapping
    ahead = np.sum(run.envelope * model.conj(), axis=1)
    step = np.diff(run.time_s)
    near = step < 1.5 * np.median(step)
    return float(np.angle(np.sum((ahead[1:] * ahead[:-1].conj())[near])) / np.mean(step[near]))
