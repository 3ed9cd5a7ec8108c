"""The rate from a reference model (seed A's last task): Ω(t) fitted to a run's envelopes beside the
identified resonator.

Ω(t) is a cubic spline through its values at even nodes. The envelopes are fitted as a whole
(likelihood.py), so the drift of the wave is taken out by the model itself, not by a table; the run
keeps its own start state and frequency, the resonator is known to its covariance (rate_fit.py). The
start is linear in Ω (rate_start.py). Beside it stands −m·(dθ/dt)/K, which has the drift in it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...errors import HrgError
from ...physics.resonator import PARAMETERS, Mechanics
from ...records import Resonator, Wave
from ...units import round_down
from .envelope_runs import EnvelopeRun, from_wave
from .rate_estimate import MOST_NODES, RateEstimate, build_cardinals
from .rate_fit import Reference, fit_rate, make_reference
from .rate_start import estimate_plain_rate, estimate_stokes_start

Array = np.ndarray
ROWS_A_NODE, ROWS_A_FINER_NODE = 4, 2
"""Windows for each node of an answer at least, and of the fit with twice as many nodes that checks
it: so every answer can be checked."""
FEWEST_NODES, USUAL_NODES = 4, 20
TOO_COARSE = 5.0
"""Standard deviations of a fall of χ² with twice as many nodes from which the rate changes faster
than the nodes follow."""
PHASE_NODES = (12, 48)
"""Nodes of the phase by which a frequency may move, tried where a constant one does not fit."""
OUTDONE = 2.0
"""Times less of χ² that a moving frequency must leave where it does not leave the noise alone."""
NO_BETTER = 0.9
"""Part of the χ² that twice as many nodes must leave at most for a poor fit to be worth still more
of them."""


def count_nodes(name: str, windows: int, window_s: float, nodes: int | None) -> tuple[int, int]:
    """Nodes to begin with, and the most that the windows carry.

    Parameters
    ----------
    name
        Of the run, for a sentence.
    windows, window_s
        How many good windows it has, and their length.
    nodes
        Those asked for; None: as many as is usual.

    Returns
    -------
    tuple of int
        Both numbers.

    Raises
    ------
    HrgError
        More are asked for than the windows carry.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.rate_from_model import count_nodes
    >>> count_nodes("run left", 100, 0.02, None), count_nodes("run left", 100, 0.02, 8)
    ((12, 25), (8, 25))
    """
    most = windows // ROWS_A_NODE
    usual = int(np.clip(most // 2, FEWEST_NODES, USUAL_NODES))
    count = nodes if nodes is not None else usual
    if count > most:
        shorter = round_down(window_s * windows / (ROWS_A_NODE * count))
        raise HrgError(
            f"{name}: {windows} good windows, at least {ROWS_A_NODE * count} were expected for"
            f" {count} nodes; ask for fewer, or demodulate with windows of at most {shorter:g} s"
        )
    return count, most


def fit_free_rate(wave: Wave, resonator: Resonator, nodes: int | None = None) -> RateEstimate:
    """Ω(t) of a free run on even times, given the resonator.

    Its standard deviations hold the noise and the resonator's own.

    Parameters
    ----------
    wave
        A free run.
    resonator
        As it was identified.
    nodes
        Of the spline; None: 20, fewer for a short run, and twice as many again and again until χ²
        agrees with the stated noise and asks for no more, as far as the windows carry them.

    Returns
    -------
    RateEstimate
        On the nodes.

    Raises
    ------
    HrgError
        The resonator has no scale factor, or too few windows for the nodes.

    Examples
    --------
    A run-down on a table at 1 rad/s, which turns the wave back by K = 0.5 of its own turn:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Resonator, Wave
    >>> from hrg_cli.fitting.envelopes.rate_from_model import fit_free_rate
    >>> name = np.array(["frequency_hz", "damping_rate_1_s", "scale_factor"])
    >>> exact = dict(std=np.zeros(3), covariance=np.zeros((3, 3)))
    >>> units, value = np.array(["Hz", "s-1", "1"]), np.array([5e3, 0.1, 0.5])
    >>> gyro = Resonator(name=name, units=units, value=value, **exact)
    >>> t = np.arange(0.0, 10.0, 0.05)
    >>> wave = Wave(**{f.name: 0 * t + 1e-5 for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=np.zeros(200, "u1"), iterations=np.zeros(200, "i2"), mode="free",
    ...     main_amplitude=np.exp(-0.1 * t), quadrature_amplitude=0 * t, wave_angle_rad=-0.25 * t,
    ...     phase_rad=0 * t, reference_frequency_hz=5e3, window_s=0.05,
    ... ))
    >>> fit_free_rate(wave, gyro, 4).rate_rad_s.round(4).tolist()
    [1.0, 1.0, 1.0, 1.0]
    """
    values = {name: value for name, (value, _, _) in resonator.parameters().items()}
    if "scale_factor" not in values:
        raise HrgError(
            f"{resonator.gyro_id or 'the resonator'}: has no scale_factor, which a rate needs;"
            " identify it with rotated runs"
        )
    run = from_wave(wave, 0.0)
    count, most = count_nodes(wave.run_id or "the run", len(run), run.window_s, nodes)
    mechanics = Mechanics(
        **{k: values.get(k, 0.0) for k, _ in PARAMETERS}, mode_number=run.mode_number
    )
    known = make_reference(resonator, mechanics)

    def find(reference: Reference) -> RateEstimate:
        if nodes is None:
            return _grow_nodes(run, count, most, reference)
        return _check_nodes(run, count, reference)

    found = find(known)
    if not found.adequate:
        found = _follow_frequency(found, run, lambda count: find(replace(known, phase_nodes=count)))
    return replace(found, most_nodes=min(most, MOST_NODES), window_s=run.window_s)


def _follow_frequency(
    found: RateEstimate, run: EnvelopeRun, find: Callable[[int], RateEstimate]
) -> RateEstimate:
    """The rate beside a frequency that moves, on as few nodes of its phase as leave no more than
    chance; as it was where that does not explain most of the misfit.

    A frequency that warms and cools with the gyro tells nothing against its resonator.
    """
    before = 0
    for count in PHASE_NODES:
        if len(run) < ROWS_A_NODE * count:
            break
        moving, more = find(count), count - before
        fallen = found.chi2_per_dof * found.dof - moving.chi2_per_dof * moving.dof
        explains = moving.adequate or moving.chi2_per_dof < found.chi2_per_dof / OUTDONE
        if not (moving.converged and explains and fallen > more + TOO_COARSE * np.sqrt(2 * more)):
            break
        found, before = moving, count
    return found


def _most_checked(run: EnvelopeRun) -> int:
    """Nodes of the finest fit that checks an answer."""
    return min(len(run) // ROWS_A_FINER_NODE, MOST_NODES)


def _check_nodes(run: EnvelopeRun, count: int, known: Reference) -> RateEstimate:
    """The best fit on so many nodes, with what twice as many gain, as far as the windows carry
    them."""
    found, finer = _find_best_fit(run, count, known), 2 * count - 1
    if finer > _most_checked(run):
        return found
    closer = fit_rate(run, *_refine_grid(run, found, finer, known), known)
    return replace(found, finer=closer.measure_loss(count))


def _grow_nodes(run: EnvelopeRun, count: int, most: int, known: Reference) -> RateEstimate:
    """The fit on as many nodes as the data ask for, doubled from `count` to `most`."""
    found = _fit_from_stokes(run, count, known)
    while (finer_count := 2 * len(found.time_s) - 1) <= _most_checked(run):
        # what too few nodes found is no start for more
        finer = (
            fit_rate(run, *_refine_grid(run, found, finer_count, known), known)
            if found.adequate
            else _fit_from_stokes(run, finer_count, known)
        )
        gained = finer.measure_loss(len(found.time_s))
        found = replace(found, finer=gained)
        enough = gained.z < TOO_COARSE and (
            found.adequate or finer.chi2_per_dof > NO_BETTER * found.chi2_per_dof
        )
        if enough or finer_count > most:
            break
        found = finer
    if found.adequate:
        return found
    return min(found, _find_best_fit(run, len(found.time_s), known), key=lambda e: e.chi2_per_dof)


def _fit_from_stokes(run: EnvelopeRun, nodes: int, known: Reference) -> RateEstimate:
    """The fit from the Stokes start."""
    grid = np.linspace(run.time_s[0], run.time_s[-1], nodes)
    return fit_rate(
        run,
        grid,
        estimate_stokes_start(run, grid, known.p),
        estimate_plain_rate(run, grid, known.scale_factor),
        known,
    )


def _find_best_fit(run: EnvelopeRun, nodes: int, known: Reference) -> RateEstimate:
    """The best fit from the Stokes start, and where that is poor, from a constant and from the
    plain rate."""
    grid = np.linspace(run.time_s[0], run.time_s[-1], nodes)
    plain = estimate_plain_rate(run, grid, known.scale_factor)
    best: RateEstimate | None = None
    for rate in (estimate_stokes_start(run, grid, known.p), np.full(nodes, plain.mean()), plain):
        found = fit_rate(run, grid, rate, plain, known)
        if best is None or found.chi2_per_dof < best.chi2_per_dof:
            best = found
        if best.adequate:
            break
    assert best is not None
    return best


def _refine_grid(
    run: EnvelopeRun, found: RateEstimate, nodes: int, known: Reference
) -> tuple[Array, Array, Array]:
    """A finer grid, the rate found on it, and the plain rate on it."""
    grid = np.linspace(run.time_s[0], run.time_s[-1], nodes)
    return (
        grid,
        found.rate_rad_s @ build_cardinals(grid, found.time_s),
        estimate_plain_rate(run, grid, known.scale_factor),
    )
