"""A table of dwells as rows, the curve through them without spikes, and the figures of that curve.

output/S₀ = K(T)·Ω − D(T) + Σ_p c_p Ω^p, as `rate_table` has it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import HrgError, name_some
from ...fitting.least_squares import fit_columns
from ...fitting.tables.dwell_spikes import find_deviating_rows
from ...fitting.tables.dwells import (
    ROUNDING,
    ROWS_A_NODE,
    build_dwell_design,
    choose_powers,
    compute_held_out_rms,
    find_least_count,
    find_spikes,
    list_node_choices,
)
from ..diagnosis.thresholds import SIGNIFICANT

Array = np.ndarray
LARGEST_SHARE = 0.2
"""Share of the rows that may be spikes; if more stand out, it is the curve that is wrong."""
MOST_ROUNDS = 20
"""Rounds of leaving out spikes and fitting anew."""
LEAST_ROWS = 10


@dataclass(frozen=True)
class Dwells:
    """Rows (n,): output over the nominal scale, rate in rad/s, temperature; nodes (j,), what lies
    between them, and whether the gyro turned."""

    output: Array
    rate_rad_s: Array
    temperature_degc: Array
    nodes: Array
    interpolation: str
    turning: bool

    def take(self, rows: Array) -> Dwells:
        """Some of the rows (n,) bool."""
        return replace(
            self,
            output=self.output[rows],
            rate_rad_s=self.rate_rad_s[rows],
            temperature_degc=self.temperature_degc[rows],
        )


@dataclass(frozen=True)
class Curve:
    """The curve through the rows that are no spikes."""

    powers: list[int]
    scores: dict[str, float]
    """Error of rows left out by highest power."""
    X: Array
    """(n, k) columns of all rows: −D of every node, K of every node, the powers."""
    coefficients: Array
    """(k,)"""
    residual: Array
    """(n,)"""
    keep: Array
    """(n,) rows that are no spikes."""
    too_many: int
    """Rows that stood out, where they were too many to be spikes and all were kept."""


def read_dwell_rows(
    table: Mapping[str, Any],
    names: tuple[str, str | None, str | None],
    word: tuple[int | None, float, float],
) -> tuple[Array, Array, Array, Array]:
    """The rows of a table of dwells in which everything is finite.

    Parameters
    ----------
    table
        Column name -> values (n,).
    names
        Columns of output, rate [rad/s] and temperature; None: there is none.
    word
        Bits of the temperature's two's complement or None, and its scale and offset to °C.

    Returns
    -------
    tuple of ndarray
        Output, rate [rad/s] and temperature [°C], zeros where there is no column; the rows' numbers
        from 1.

    Raises
    ------
    HrgError
        No such column, or fewer than ten rows.

    Examples
    --------
    A thermometer's word of 16 bits, a count of which is 1/256 °C; 65280 is −256 counts:

    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.dwell_curve import read_dwell_rows
    >>> table = {"out": np.ones(10), "word": np.full(10, 65280)}
    >>> _, rate, degc, number = read_dwell_rows(
    ...     table, ("out", None, "word"), (16, 1 / 256, 0.0)
    ... )
    >>> float(rate[0]), float(degc[0]), int(number[0])
    (0.0, -1.0, 1)
    """
    output, rate, temperature = names
    y = _column(table, output)
    omega = np.zeros(len(y)) if rate is None else _column(table, rate)
    degc = np.zeros(len(y))
    if temperature is not None:
        bits, scale, offset = word
        read = _column(table, temperature)
        if bits is not None:
            read = np.where(read >= 2.0 ** (bits - 1), read - 2.0**bits, read)
        degc = read * scale + offset
    good = np.isfinite(y) & np.isfinite(omega) & np.isfinite(degc)
    if good.sum() < LEAST_ROWS:
        raise HrgError(
            f"the table has {int(good.sum())} finite rows of {len(y)}, at least ten were expected;"
            " check the columns' names and units"
        )
    return y[good], omega[good], degc[good], 1 + np.flatnonzero(good)


def _column(table: Mapping[str, Any], name: str) -> Array:
    if name not in table:
        raise HrgError(f"the table has no column {name!r}; it has {name_some(table)}")
    return np.asarray(table[name], float)


def find_supported_curve(
    dwells: Dwells, spacing_degc: float, largest_power: int, spike_sigma: float
) -> tuple[Dwells, Curve, Array]:
    """The curve of a table of dwells as far as rows support it.

    A row beyond all others in temperature or rate that deviates from where their curve leads is a
    spike, or the curve bends there: no row beside it tells. The curve ends before it.

    Parameters
    ----------
    dwells
        The rows (n,); their own nodes do not count.
    spacing_degc
        Of the nodes, at most.
    largest_power
        Highest power of the rate that may be chosen, on rows left out.
    spike_sigma
        Standard deviations from which a row is a spike.

    Returns
    -------
    tuple
        The rows that the curve reaches with their nodes, the curve, and which rows (n,) they are.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.dwell_curve import Dwells, find_supported_curve
    >>> degc, noise = np.linspace(0, 90, 10), np.random.default_rng(0).standard_normal(10)
    >>> output = 1e-3 * degc + 1e-6 * noise
    >>> output[9] += 1e-4
    >>> dwells = Dwells(output, 0 * degc, degc, np.zeros(0), "cubic", False)
    >>> found, _, reached = find_supported_curve(dwells, 5.0, 1, 6.0)
    >>> found.nodes.tolist(), np.flatnonzero(~reached).tolist()
    ([0.0, 80.0], [9])
    """
    found, curve = _find_anew(dwells, spacing_degc, largest_power, spike_sigma)
    reached = ~_find_beyond(found, curve.keep)
    if reached.all():
        return found, curve, reached
    shorter = _find_anew(dwells.take(reached), spacing_degc, largest_power, spike_sigma)
    beyond = _find_beyond(shorter[0], shorter[1].keep)
    if not beyond.any():
        return *shorter, reached
    # ends that go one after the other are no spikes: the curve does not follow the rows
    everything = np.ones(len(reached), bool)
    too_many = int((~curve.keep).sum() + beyond.sum())
    return found, _fit(found, everything, largest_power, too_many), everything


def _find_anew(
    dwells: Dwells, spacing_degc: float, largest_power: int, spike_sigma: float
) -> tuple[Dwells, Curve]:
    """The curve of rows at nodes laid for them."""
    choices = list_node_choices(
        dwells.rate_rad_s,
        dwells.temperature_degc,
        spacing_degc,
        dwells.interpolation,
        dwells.turning,
    )
    return find_curve(dwells, choices, largest_power, spike_sigma)


def _find_beyond(dwells: Dwells, keep: Array) -> Array:
    """Rows (n,) bool that lie beyond all that are kept, in temperature or in rate."""
    beyond = np.zeros(len(keep), bool)
    for x in (dwells.temperature_degc, dwells.rate_rad_s):
        beyond |= (x < x[keep].min()) | (x > x[keep].max())
    return beyond


def find_curve(
    dwells: Dwells, choices: Sequence[Array], largest_power: int, spike_sigma: float
) -> tuple[Dwells, Curve]:
    """The curve of a table of dwells at the nodes that serve best, without spikes.

    Where the rows must choose their nodes, nodes and spikes are chosen together, since each hides
    behind the other: a spike asks for nodes, and nodes too few make spikes of a bend.

    Parameters
    ----------
    dwells
        The rows; their own nodes do not count.
    choices
        Nodes (j,) [°C] that the rows can carry.
    largest_power
        Highest power of the rate that may be chosen, on rows left out.
    spike_sigma
        Standard deviations from which a row is a spike.

    Returns
    -------
    tuple
        The rows with the chosen nodes, and the curve.

    Examples
    --------
    Ten dwells on a line but one:

    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.dwell_curve import Dwells, find_curve
    >>> degc, noise = np.linspace(0, 60, 10), np.random.default_rng(0).standard_normal(10)
    >>> output = 1e-3 * degc + 1e-6 * noise
    >>> output[4] += 1e-4
    >>> choices = [np.linspace(0, 60, count) for count in (2, 3, 4, 5, 6)]
    >>> dwells = Dwells(output, 0 * degc, degc, np.zeros(0), "cubic", False)
    >>> found, curve = find_curve(dwells, choices, 1, 6.0)
    >>> len(found.nodes), np.flatnonzero(~curve.keep).tolist()
    (4, [4])
    """
    least = (2 if dwells.turning else 1) * len(choices[0])
    if len(choices) == 1 and len(dwells.output) >= ROWS_A_NODE * least:
        dwells = replace(dwells, nodes=choices[0])
        return dwells, fit_without_spikes(dwells, largest_power, spike_sigma)
    highest = min(largest_power, max(len(np.unique(dwells.rate_rad_s)) - 1, 1))
    trials = [(nodes, list(range(2, p + 1))) for nodes in choices for p in range(1, highest + 1)]
    chance = SIGNIFICANT / len(trials)
    tried = [
        _try_few(replace(dwells, nodes=nodes), powers, chance, spike_sigma)
        for nodes, powers in trials
    ]
    best = min(tried, key=lambda few: few.score)
    return best.dwells, best.find_curve(
        {str(1 + len(t.powers)): t.held_out for t in tried if t.dwells.nodes is best.dwells.nodes}
    )


@dataclass(frozen=True)
class _Few:
    """Few rows with nodes and powers on trial."""

    dwells: Dwells
    powers: list[int]
    X: Array
    """(n, k)"""
    keep: Array
    """(n,) rows that the others do not contradict."""
    too_many: int
    held_out: float
    """Root mean square of the rows kept, each predicted without its fold."""
    score: float

    def find_curve(self, scores: dict[str, float]) -> Curve:
        """The curve through the rows kept."""
        y, keep = self.dwells.output, self.keep
        coefficients = fit_columns(self.X[keep], y[keep])
        rest = y - self.X @ coefficients
        return Curve(self.powers, scores, self.X, coefficients, rest, keep, self.too_many)


def _try_few(dwells: Dwells, powers: list[int], chance: float, spike_sigma: float) -> _Few:
    """Rows that deviate from the curve of the others, and how well the others predict each other.

    n ln σ² of rows left out stands for −2 ln L; a row with a shift of its own costs 2 ln(n/α), the
    odds against it.
    """
    d, y, n = dwells, dwells.output, len(dwells.output)
    X = build_dwell_design(
        d.rate_rad_s, d.temperature_degc, d.nodes, d.interpolation, d.turning, powers
    )
    least = max(find_least_count(y) / np.sqrt(12), ROUNDING * float(np.abs(y).max()))
    most = int(LARGEST_SHARE * n)
    found = find_deviating_rows(y, X, most, chance, spike_sigma, least)
    too_many = len(found) if len(found) > most else 0
    keep = np.ones(n, bool)
    keep[[] if too_many else found] = False
    held_out = compute_held_out_rms(y[keep], X[keep])
    missed = max(held_out, least, np.finfo(float).tiny)
    price = 2 * np.log(n / chance) * int((~keep).sum())
    score = float(2 * n * np.log(missed) + price)
    return _Few(d, powers, X, keep, too_many, held_out, score)


def fit_without_spikes(dwells: Dwells, largest_power: int, spike_sigma: float) -> Curve:
    """The curve of a table of dwells, spikes left out until their choice repeats.

    Parameters
    ----------
    dwells
        The rows.
    largest_power
        Highest power of the rate that may be chosen, on rows left out.
    spike_sigma
        Standard deviations from which a row is a spike.

    Returns
    -------
    Curve
        All rows are kept where more than a fifth stand out: then the curve is wrong, not the rows.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.dwell_curve import Dwells, fit_without_spikes
    >>> rate = np.tile(np.linspace(-1.0, 1.0, 12), 10)
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal(120)
    >>> noise[7] = 0.1
    >>> dwells = Dwells(rate + noise, rate, 0 * rate, np.zeros(1), "linear", True)
    >>> np.flatnonzero(~fit_without_spikes(dwells, 1, 6.0).keep).tolist()
    [7]
    """
    keep, step = np.ones(len(dwells.output), bool), find_least_count(dwells.output)
    for _ in range(MOST_ROUNDS):
        curve = _fit(dwells, keep, largest_power)
        spikes = find_spikes(curve.X, curve.residual, keep, spike_sigma, step)
        if (~spikes == keep).all():
            return curve
        if spikes.sum() > LARGEST_SHARE * len(keep):
            return _fit(dwells, np.ones(len(keep), bool), largest_power, int(spikes.sum()))
        keep = ~spikes
    return replace(curve, keep=keep)


def _fit(dwells: Dwells, keep: Array, largest_power: int, too_many: int = 0) -> Curve:
    d = dwells
    y, omega, degc = d.output, d.rate_rad_s, d.temperature_degc
    powers, scores = choose_powers(
        y[keep], omega[keep], degc[keep], d.nodes, d.interpolation, d.turning, largest_power
    )
    X = build_dwell_design(omega, degc, d.nodes, d.interpolation, d.turning, powers)
    coefficients = fit_columns(X[keep], y[keep])
    return Curve(powers, scores, X, coefficients, y - X @ coefficients, keep, too_many)


def list_curve_figures(dwells: Dwells, curve: Curve, scale: float) -> dict[str, Any]:
    """The figures of a data sheet of the curve through a table of dwells.

    Parameters
    ----------
    dwells
        The rows.
    curve
        Through those that are no spikes.
    scale
        Nominal output per rad/s.

    Returns
    -------
    dict
        Coefficients of the powers, residuals before, after and of rows left out [rad/s],
        nonlinearity and asymmetry [ppm of the largest rate], and how bias and scale factor follow
        the temperature.

    Examples
    --------
    A gain that differs by 1 % between left and right bends by ⅔ of half of that about its best
    line:

    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.dwell_curve import (
    ...     Dwells,
    ...     fit_without_spikes,
    ...     list_curve_figures,
    ... )
    >>> rate = np.tile(np.linspace(-1.0, 1.0, 11), 20)
    >>> noise = 1e-6 * np.random.default_rng(0).standard_normal(220)
    >>> dwells = Dwells(rate + 0.005 * rate**2 + noise, rate, 0 * rate, np.zeros(1), "linear", True)
    >>> figures = list_curve_figures(dwells, fit_without_spikes(dwells, 3, 6.0), 1.0)
    >>> round(figures["asymmetry_ppm"], -2), round(figures["nonlinearity_ppm"], -2)
    (10000.0, 3300.0)
    """
    y, omega, keep, count = dwells.output, dwells.rate_rad_s, curve.keep, len(dwells.nodes)
    out: dict[str, Any] = {
        "nominal_scale": scale,
        "powers": curve.powers,
        "power_coefficients": curve.coefficients[2 * count :].tolist() if dwells.turning else [],
        "held_out_by_power": curve.scores,
        "rows": len(y),
        "rejected": int((~keep).sum()),
        "residual_rms_rad_s": {
            "before": _rms(_fit_line(y[keep], omega[keep], dwells.turning)),
            "after": _rms(curve.residual[keep]),
            "held_out": compute_held_out_rms(y[keep], curve.X[keep]),
        },
    }
    if dwells.turning:
        gain = curve.coefficients[count : 2 * count]
        out |= _bends(omega, curve.powers, out["power_coefficients"])
        if count > 1:
            out["scale_factor_coefficient_ppm_per_degc"] = float(
                np.polyfit(dwells.nodes, gain, 1)[0] / gain.mean() * 1e6
            )
    if count > 1:
        out["bias_coefficient_rad_s_per_degc"] = float(
            np.polyfit(dwells.nodes, -curve.coefficients[:count], 1)[0]
        )
    return out


def _fit_line(y: Array, omega: Array, turning: bool) -> Array:
    """What one scale factor and one bias leave of the rows; a bias alone where nothing turned."""
    ones = np.ones(len(y))
    plain = np.stack([ones, omega], axis=1) if turning else ones[:, None]
    return np.asarray(y - plain @ fit_columns(plain, y))


def _bends(omega: Array, powers: list[int], coefficients: list[float]) -> dict[str, float]:
    """Nonlinearity (largest departure from the best line) and asymmetry between both signs, as
    parts of the largest rate."""
    largest = float(np.abs(omega).max())
    grid = np.linspace(omega.min(), omega.max(), 201)
    bend = sum((c * grid**p for p, c in zip(powers, coefficients)), np.zeros(len(grid)))
    straight = np.polyval(np.polyfit(grid, bend, 1), grid)
    even = sum((c * largest**p for p, c in zip(powers, coefficients) if p % 2 == 0), 0.0)
    return {
        "nonlinearity_ppm": float(np.abs(bend - straight).max() / largest * 1e6),
        "asymmetry_ppm": float(2 * even / largest * 1e6),
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))
