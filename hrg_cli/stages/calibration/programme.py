"""Is a calibration programme able to give a table: nodes of temperature, rates and wave angles at
each; what run is missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ...errors import HrgError, name_some
from ...fitting.tables.increments import AnglePath
from ...fourier import compute_node_weights

Array = np.ndarray
ANGLE_BINS = 36
SINGLE_NODE_MARGIN_DEGC = 3.0
"""A table from one temperature holds within this distance of it."""
SINGLE_NODE_MARGIN_HZ = 1.0
TWO_RATES = 0.2
"""Part of the range of all rates by which those at one angle must differ to tell K from D there."""
NODE_SPACING_DEGC = 15.0
"""Spacing of nodes laid over a temperature sweep."""
SMALLEST_GAP_DEGC, SMALLEST_GAP_HZ = 1.0, 0.2
"""Means of two dwells are at least so far apart."""
WIDE = 1.5
"""Spacings between two dwells from which sweeps through them get nodes of their own."""
SWEEPING = 2.0
"""Times the span of every run that dwells, which all that sweep beside them have at least."""


def _spread_over_sweep(low: float, high: float, spacing: float, narrowest: float) -> Array:
    """Even nodes over a sweep, two to nine; one in the middle of a range too narrow to bend
    over."""
    if high - low <= narrowest:
        return np.array([(low + high) / 2])
    return np.linspace(low, high, int(np.clip(round((high - low) / spacing) + 1, 2, 9)))


def choose_nodes(
    paths: Sequence[AnglePath], axis: str, given: Sequence[float] | None
) -> tuple[Array, float, float, list[str]]:
    """Where the tables have their nodes, and over which range they may be used.

    Runs that dwell give nodes at their means, since K and D are measured there; a sweep gets even
    nodes.

    Parameters
    ----------
    paths
        The runs.
    axis
        "temperature" [°C] or "frequency" [Hz].
    given
        Nodes that were asked for; None: of the runs.

    Returns
    -------
    tuple
        Nodes (J,), the lowest and highest value the tables may be used at, and remarks.

    Raises
    ------
    HrgError
        The quantity is missing in a part of the runs, or asked nodes leave it or are equal.

    Examples
    --------
    Dwells at 20 and 60 °C:

    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.programme import choose_nodes
    >>> dwells = [draw_path(1.0, blocks=9, temperature_degc=degc) for degc in (20.0, 60.0)]
    >>> nodes, low, high, remarks = choose_nodes(dwells, "temperature", None)
    >>> nodes.tolist(), low, high, remarks
    ([20.0, 60.0], 20.0, 60.0, [])
    """
    name = "temperature" if axis == "temperature" else "frequency"
    x = np.concatenate([p.find_abscissa(axis) for p in paths])
    if not np.isfinite(x).any():
        return np.zeros(1), -np.inf, np.inf, [_say_no_axis(name, given)]
    if not np.isfinite(x).all():
        missing = [p.run_id or "?" for p in paths if not np.isfinite(p.find_abscissa(axis)).all()]
        raise HrgError(
            f"run {name_some(missing)}: {name} is missing in a part of the runs; log it in all of"
            " them or leave these runs out"
        )
    low, high = float(x.min()), float(x.max())
    if given is not None:
        nodes = np.array(sorted(given), float)
        if (np.diff(nodes) <= 0).any():
            raise HrgError(f"nodes {list(given)}: two are equal; every node must be another {name}")
        return nodes, low, high, []
    return _nodes_of_runs(paths, axis, low, high)


def _say_no_axis(name: str, given: Sequence[float] | None) -> str:
    """The remark on runs that hold nothing a table could follow. HrgError: it was to have several
    nodes."""
    if given is not None and len(given) > 1:
        raise HrgError(
            f"the runs hold no {name}, so nodes {list(given)} cannot be filled; log"
            " temperature_degc, or leave nodes out"
        )
    return (
        f"the runs hold no {name}: the tables cannot follow it and cannot guard against it; log"
        " temperature_degc"
    )


def _nodes_of_runs(
    paths: Sequence[AnglePath], axis: str, low: float, high: float
) -> tuple[Array, float, float, list[str]]:
    """Nodes where the runs dwell, since K and D are measured there; of sweeps even ones."""
    by_temperature = axis == "temperature"
    margin = SINGLE_NODE_MARGIN_DEGC if by_temperature else SINGLE_NODE_MARGIN_HZ
    spacing = NODE_SPACING_DEGC if by_temperature else (high - low) / 4
    nodes, sweeps = _find_dwells(paths, axis)
    if not len(nodes):
        nodes = _spread_over_sweep(low, high, spacing, 2 * margin)
    elif sweeps:
        nodes = _fill_between(nodes, sweeps, axis, spacing)
    if len(nodes) > 1:
        return nodes, low, high, []
    unit, name = ("°C", "temperature") if by_temperature else ("Hz", "frequency")
    remark = (
        f"all runs are near {nodes[0]:.6g} {unit}: one node, the tables hold from"
        f" {low - margin:.6g} to {high + margin:.6g} {unit} only; add runs at another {name}"
    )
    return nodes, low - margin, high + margin, [remark]


def _find_dwells(paths: Sequence[AnglePath], axis: str) -> tuple[Array, list[AnglePath]]:
    """Means of the groups of runs that each keep one temperature, and the runs beside them that
    sweep; no means where the runs that sweep are not clearly others than those that dwell."""
    spans = np.array([np.ptp(p.find_abscissa(axis)) for p in paths])
    widest = np.argsort(-spans, kind="stable")
    for count in range(len(paths)):
        away, kept = widest[:count], np.sort(widest[count:])
        if count and spans[away[-1]] <= SWEEPING * spans[kept].max():
            continue
        centres = _group_dwells([paths[k] for k in kept], axis)
        if centres is not None:
            return centres, [paths[k] for k in away]
    return np.zeros(0), list(paths)


def _fill_between(dwells: Array, sweeps: Sequence[AnglePath], axis: str, spacing: float) -> Array:
    """The dwells' nodes, and even ones where sweeps leave these or, at several rates, pass far
    between two of them."""
    x = np.concatenate([p.average_neighbours(p.find_abscissa(axis)) for p in sweeps])
    rates = np.concatenate([p.rate_rad_s for p in sweeps])
    smallest = SMALLEST_GAP_DEGC if axis == "temperature" else SMALLEST_GAP_HZ
    ends = [float(x.min())] if x.min() < dwells[0] - smallest else []
    more = [float(x.max())] if x.max() > dwells[-1] + smallest else []
    edges = np.array([*ends, *dwells, *more])
    out = [edges[:1]]
    for a, b in pairwise(edges.tolist()):
        here = rates[(x > a) & (x < b)]
        turning = len(here) and np.ptp(here) > TWO_RATES * np.abs(rates).max()
        parts = round((b - a) / spacing) if b - a > WIDE * spacing and turning else 1
        out.append(np.linspace(a, b, parts + 1)[1:])
    return np.concatenate(out)


def _group_dwells(paths: Sequence[AnglePath], axis: str) -> Array | None:
    """Means of the groups of runs that each keep one temperature; None when one sweeps."""
    means = np.array([p.find_abscissa(axis).mean() for p in paths])
    spans = np.array([np.ptp(p.find_abscissa(axis)) for p in paths])
    order = np.argsort(means)
    smallest = SMALLEST_GAP_DEGC if axis == "temperature" else SMALLEST_GAP_HZ
    total = float(np.ptp(means))
    # runs of one dwell are a little apart; what is farther is another dwell
    gap = max(smallest, 0.04 * total)
    groups: list[list[int]] = [[int(order[0])]]
    for a, b in pairwise(order):
        if means[b] - means[a] > gap:
            groups.append([])
        groups[-1].append(int(b))
    centres = np.array([means[g].mean() for g in groups])
    distance = (
        np.diff(centres).min()
        if len(centres) > 1
        else (2 * SINGLE_NODE_MARGIN_DEGC if axis == "temperature" else 2 * SINGLE_NODE_MARGIN_HZ)
    )
    width = max(float(spans[g].max() + np.ptp(means[g])) for g in groups)
    return centres if width <= 0.5 * distance else None


@dataclass(frozen=True)
class Finding:
    """A sentence about the programme and whether it forbids a table."""

    sentence: str
    refuses: bool


def examine(
    paths: Sequence[AnglePath],
    nodes: Array,
    axis: str,
    harmonics: int,
    scale_harmonics: int,
) -> list[Finding]:
    """What runs cannot give at each node: two rates (K against D), both signs, the whole period of
    the angle, and this at two rates.

    Parameters
    ----------
    paths
        The runs.
    nodes
        Of the tables (J,).
    axis
        Quantity of the nodes.
    harmonics
        Of 2mθ that the drift shall have.
    scale_harmonics
        Of 2mθ that the scale factor shall have; of none, one angle tells it from the drift.

    Returns
    -------
    list of Finding
        Empty where the programme gives the tables.

    Examples
    --------
    One run at one rate cannot tell the drift from the scale factor:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.programme import examine
    >>> t = np.arange(99.0)
    >>> path = draw_path(blocks=99, angle_rad=-0.1 * t, rate_integral_rad=0.4 * t)
    >>> [finding.refuses for finding in examine([path], np.array([20.0]), "temperature", 1, 1)]
    [True]
    """
    findings: list[Finding] = []
    unit = "°C" if axis == "temperature" else "Hz"
    rates = np.concatenate([p.rate_rad_s for p in paths])
    times = np.concatenate([p.interval_s for p in paths])
    angles = np.concatenate([p.average_neighbours(p.angle_rad) for p in paths])
    travels = np.concatenate([np.diff(p.angle_rad) for p in paths])
    run = np.concatenate([np.full(len(p), i) for i, p in enumerate(paths)])
    m = paths[0].mode_number
    x = (
        np.concatenate([p.average_neighbours(p.find_abscissa(axis)) for p in paths])
        if len(nodes) > 1
        else np.zeros(len(rates))
    )
    weights = compute_node_weights(x, nodes)
    fastest = float(np.abs(rates).max(initial=0.0))
    for j, node in enumerate(nodes):
        at = f"at {node:.4g} {unit} " if len(nodes) > 1 else ""
        # increments that make at least a third of this node's value
        near = weights[:, j] > 0.3
        names = name_some(dict.fromkeys(paths[i].run_id or f"number {i + 1}" for i in run[near]))
        if not near.any():
            findings.append(
                Finding(
                    f"no run is near the node {node:.4g} {unit}; add runs at three rates (0, + and"
                    " −) there",
                    True,
                )
            )
            continue
        rated, several = _examine_rates(rates[near], times[near], fastest, at, names)
        findings += rated
        if several and harmonics:
            here = angles[near], travels[near], rates[near]
            # all that takes part in this node's value
            about = weights[:, j] > 0
            findings += _examine_angles(*here, harmonics, m, at, names) or _examine_rates_at_angles(
                angles[about], travels[about], rates[about], scale_harmonics, m, at, names
            )
    return findings


def _examine_rates(
    here: Array, time: Array, fastest: float, at: str, names: str
) -> tuple[list[Finding], bool]:
    """What rates `here` (n,) over times (n,) at a node cannot tell of K and D, and whether they are
    several."""
    mean = float(np.average(here, weights=time))
    spread = float(np.sqrt(np.average((here - mean) ** 2, weights=time)))
    if spread < max(1e-3 * fastest, 1e-12):
        if abs(mean) < 1e-3 * fastest or fastest == 0:
            sentence = (
                f"{at}no run turns (run {names}): the scale factor K cannot be told; "
                "add a run at a rate well above the drift, best two of both signs"
            )
        else:
            sentence = (
                f"{at}there is one rate only, {mean:.4g} rad/s (run {names}): K and D"
                f" cannot be told apart; add a run at another rate, best at {-mean:.4g}"
                " rad/s, and one near 0"
            )
        return [Finding(sentence, True)], False
    if here.max() < 0.05 * fastest or here.min() > -0.05 * fastest:
        sign = "positive" if here.min() > -0.05 * fastest else "negative"
        sentence = (
            f"{at}all turning runs are {sign}: asymmetry of the scale factor cannot be"
            " seen; add a run of the other sign"
        )
        return [Finding(sentence, False)], True
    return [], True


def _examine_angles(
    angle: Array, travel: Array, rate: Array, harmonics: int, m: int, at: str, names: str
) -> list[Finding]:
    """The arc of the wave angle's period that the runs at a node, or the turning ones among them,
    leave out, where it is longer than so many harmonics allow."""
    period = np.pi / m
    # the scale factor's harmonics are seen by turning runs alone, the drift's by all
    turning = np.abs(rate) > 0.2 * np.abs(rate).max()
    for what, chosen in (("the runs", np.ones(len(rate), bool)), ("the turning runs", turning)):
        arc = _uncovered(angle[chosen], travel[chosen], m)
        if arc is not None and arc[1] > period / (2 * harmonics + 1):
            start, length = arc
            return [
                Finding(
                    f"{at}{what} (run {names}) cover {100 * (1 - length / period):.0f} % of the"
                    f" wave angle's period of {np.degrees(period):.0f}°:"
                    f" {np.degrees(start):.0f}° to {np.degrees(start + length):.0f}° is"
                    " missing; add a run that starts or turns through there, or turn for"
                    " longer",
                    True,
                )
            ]
    return []


def _examine_rates_at_angles(
    angle: Array, travel: Array, rate: Array, scale_harmonics: int, m: int, at: str, names: str
) -> list[Finding]:
    """The arc that is passed at one rate only, where it is longer than so many harmonics of K
    allow: D − KΩ is told there, and neither of the two."""
    if not scale_harmonics:
        return []
    passed = _list_bins_passed(angle, travel, m)
    least = np.full(ANGLE_BINS, np.inf)
    most = np.full(ANGLE_BINS, -np.inf)
    for bins in passed:
        np.minimum.at(least, bins, rate)
        np.maximum.at(most, bins, rate)
    period, arc = np.pi / m, _find_longest_gap(most - least > TWO_RATES * np.ptp(rate), m)
    if arc is None or arc[1] <= period / (2 * scale_harmonics + 1):
        return []
    start, length = arc
    return [
        Finding(
            f"{at}the runs ({names}) pass {np.degrees(start):.0f}° to"
            f" {np.degrees(start + length):.0f}° of the wave angle at one rate only, where K and D"
            " cannot be told apart; turn the slow runs for longer, or give"
            " scale_factor_harmonics=0",
            True,
        )
    ]


def _list_bins_passed(angle: Array, travel: Array, m: int) -> list[Array]:
    """Bins (n,) of the period π/m that increments pass: all of their travel, not only its
    middle."""
    period = np.pi / m
    return [
        (np.mod(angle + part * travel, period) / period * ANGLE_BINS).astype(int) % ANGLE_BINS
        for part in np.linspace(-0.5, 0.5, 5)
    ]


def _uncovered(angle: Array, travel: Array, m: int) -> tuple[float, float] | None:
    """(start, length) of the largest arc of the period π/m that no increment passes; None when all
    is passed."""
    hit = np.zeros(ANGLE_BINS, bool)
    for bins in _list_bins_passed(angle, travel, m):
        hit[bins] = True
    return _find_longest_gap(hit, m)


def _find_longest_gap(hit: Array, m: int) -> tuple[float, float] | None:
    """(start, length) of the longest run of bins of the period π/m that are not hit; None where all
    are."""
    period = np.pi / m
    if hit.all():
        return None
    # twice round, so that an arc across the period's end is one
    twice = np.concatenate([hit, hit])
    best, begin, start = 0, 0, 0
    for i, seen in enumerate(twice):
        if seen:
            start = i + 1
        elif i + 1 - start > best:
            best, begin = i + 1 - start, start
    best = min(best, ANGLE_BINS)
    return (begin % ANGLE_BINS) * period / ANGLE_BINS, best * period / ANGLE_BINS
