"""The tables of `hrg ledger show` and `history` on the screen, in people's units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..ledger.charts import BEYOND, Chart
from ..ledger.gauge import Component, GaugeStudy
from ..ledger.golden import Golden
from ..ledger.history import FigureHistory, History
from ..ledger.overview import FigureReport, Overview, Standing
from ..ledger.trend import Move
from .console import print_table, say
from .figure_names import name_figure, name_figures
from .page_table import PageTable
from .quantities import choose_unit, format_quantity
from .text import format_number

Names = Mapping[tuple[str, str], str]
"""(kind, key) of a figure -> what it is called."""
MOVED, CHANGED = "moved most", "from its history"
"""Columns of the gyros: since the last result, and against all earlier ones that agreed."""


def show_overview(found: Overview) -> None:
    """Print every gyro, then every figure over the gyros, then the golden unit.

    Parameters
    ----------
    found
        What `hrg ledger show` tells.

    Examples
    --------
    >>> from hrg_cli.ledger.overview import make_overview
    >>> from hrg_cli.reporting.ledger_tables import show_overview
    >>> show_overview(make_overview([]))
    0 results of 0 gyros
    gyro  kind  results  newest  station  status  moved most  from its history  limits
    """
    say(say_what_counts(found))
    _print([tabulate_gyros(found), *tabulate_figures(found)])
    if found.false_alarms_expected:
        say(
            f"points beyond 3 σ expected by chance: {format_number(found.false_alarms_expected, 2)}"
        )


def show_history(found: History) -> None:
    """Print every result of one gyro, then how its figures moved.

    Parameters
    ----------
    found
        What `hrg ledger history` tells.

    Examples
    --------
    >>> import contextlib, io
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.history import tell_history
    >>> from hrg_cli.reporting.ledger_tables import show_history
    >>> entry = Entry("ab" * 32, "r.h5", "resonator", "SN-1", "2026-01-01T00:00:00Z", "refused")
    >>> with contextlib.redirect_stdout(io.StringIO()) as shown:
    ...     show_history(tell_history([entry], "SN-1"))
    >>> shown.getvalue().split()[:3], "refused" in shown.getvalue()
    (['processed', 'kind', 'status'], True)
    """
    _print([tabulate_results(found), tabulate_courses(found)])


def say_what_counts(found: Overview) -> str:
    """How many results of how many gyros there are, and how many are left out.

    Parameters
    ----------
    found
        What `hrg ledger show` tells.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.overview import make_overview
    >>> from hrg_cli.reporting.ledger_tables import say_what_counts
    >>> entry = Entry("ab" * 32, "r.h5", "resonator", "SN-1", "2026-01-01T00:00:00Z", "refused")
    >>> say_what_counts(make_overview([entry]))
    '1 result of 1 gyro; left out of the statistics: 1 refused'
    """
    left_out = [
        f"{count} {what}"
        for count, what in (
            (found.refused, "refused"),
            (found.reprocessed, "of samples that were processed again later"),
        )
        if count
    ]
    said = f"; left out of the statistics: {', '.join(left_out)}" if left_out else ""
    gyros = len({s.entry.gyro_id for s in found.standings})
    return f"{_many(found.entries, 'result')} of {_many(gyros, 'gyro')}{said}"


def tabulate_gyros(found: Overview) -> PageTable:
    """Every gyro's standing as a table.

    Parameters
    ----------
    found
        What `hrg ledger show` tells.

    Returns
    -------
    PageTable
        A row a standing.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.overview import make_overview
    >>> from hrg_cli.reporting.ledger_tables import tabulate_gyros
    >>> entry = Entry("ab" * 32, "r.h5", "resonator", "SN-1", "2026-01-01T00:00:00Z", "valid")
    >>> tabulate_gyros(make_overview([entry])).rows[0][:2]
    ('SN-1', 'resonator')
    """
    head = ("gyro", "kind", "results", "newest", "station", "status", MOVED, CHANGED, "limits")
    return PageTable("", head, [_standing(row) for row in found.standings])


def tabulate_figures(found: Overview) -> list[PageTable]:
    """Every figure over the gyros, its gauge study and the golden unit as tables.

    Parameters
    ----------
    found
        What `hrg ledger show` tells.

    Returns
    -------
    list of PageTable
        Without those that would be empty.

    Examples
    --------
    >>> from hrg_cli.ledger.overview import make_overview
    >>> from hrg_cli.reporting.ledger_tables import tabulate_figures
    >>> tabulate_figures(make_overview([]))
    []
    """
    names = name_figures([(row.kind, row.name) for row in found.figures])
    of_golden = name_figures({(row.kind, row.name) for row in found.golden})
    tables = [
        PageTable(
            "over the gyros (one value each)",
            ("figure", "gyros", "mean", "spread", "chart", "Cp", "Cpk"),
            [_population(row, names) for row in found.figures],
        ),
        PageTable(
            "gauge study (standard deviations; what is not told apart: –)",
            (
                "figure", "gyros", found.by, "interaction", "repeats", "own σ", "gauge of variance",
                "wrongly accepted",
            ),
            [_study(row, names) for row in found.figures if row.gauge is not None],
        ),
        PageTable(
            "golden unit",
            (
                "figure", found.by, "n", "mean", "from the others", "since the first", "per day",
                "chart",
            ),
            [_golden(row, of_golden) for row in found.golden],
        ),
    ]  # fmt: skip
    return [table for table in tables if table.rows]


def tabulate_results(found: History) -> PageTable:
    """Every result of one gyro as a table, in the order of processing.

    Parameters
    ----------
    found
        What `hrg ledger history` tells.

    Returns
    -------
    PageTable
        With why a result does not count.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.history import tell_history
    >>> from hrg_cli.reporting.ledger_tables import tabulate_results
    >>> entry = Entry("ab" * 32, "r.h5", "resonator", "SN-1", "2026-01-01T00:00:00Z", "refused")
    >>> tabulate_results(tell_history([entry], "SN-1")).rows[0][-2:]
    ('abababababab', 'refused')
    """
    counting = {entry.sha256 for entry in found.counting}
    rows = [
        (
            e.processed,
            e.kind,
            e.status,
            *(e.station, e.operator, e.fixture, e.firmware, e.order),
            e.sha256[:12],
            "" if e.sha256 in counting else "refused" if e.status == "refused" else "done again",
        )
        for e in found.entries
    ]
    head = (
        "processed", "kind", "status", "station", "operator", "fixture", "firmware", "order",
        "SHA-256", "left out",
    )  # fmt: skip
    return PageTable("", head, rows)


def tabulate_courses(found: History) -> PageTable:
    """How every figure of one gyro moved, as a table.

    Parameters
    ----------
    found
        What `hrg ledger history` tells.

    Returns
    -------
    PageTable
        A row a figure.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.history import tell_history
    >>> from hrg_cli.reporting.ledger_tables import tabulate_courses
    >>> def tell(value, day):
    ...     figures, at = {"scale_factor": Figure(value, 1e-3, "1")}, f"2026-01-0{day}T00:00:00Z"
    ...     return Entry(str(day), "r.h5", "resonator", "SN-1", at, "valid", figures=figures)
    >>> table = tabulate_courses(tell_history([tell(0.55, 1), tell(0.56, 2)], "SN-1"))
    >>> table.rows[0][3]
    '0.0100(14), +7.1 σ'
    """
    names = name_figures([(row.kind, row.name) for row in found.figures])
    since = ("against the last", "of the limit", "since the first", "of the limit")
    head = ("figure", "n", "now", *since, "per day", "limit in", "chart")
    return PageTable("", head, [_course(row, names) for row in found.figures])


def _print(tables: Sequence[PageTable]) -> None:
    for table in tables:
        print_table(table.caption, table.head, table.rows)


def _many(count: int, what: str) -> str:
    return f"{count} {what}{'' if count == 1 else 's'}"


def _standing(row: Standing) -> tuple[str, ...]:
    missed = [name_figure(h.row.name) for h in row.held if not h.passed]
    moved = (
        f"{name_figure(row.moved_figure)} {say_sigma(row.moved_sigma)}" if row.moved_figure else "–"
    )
    return (
        row.entry.gyro_id,
        row.entry.kind,
        str(row.results),
        row.entry.processed[:10],
        row.entry.station or "–",
        " ".join(filter(None, (row.entry.status, row.entry.verdict))),
        moved,
        _changed(row),
        ("misses " + ", ".join(missed) if missed else "within") if row.held else "–",
    )


def _changed(row: Standing) -> str:
    """What is farthest from the gyro's own history, and since when."""
    if row.changed is None:
        return "–"
    since = "" if row.changed.since is None else f" since {row.changed.since[:10]}"
    return f"{name_figure(row.changed_figure)} {say_sigma(row.changed.sigma)}{since}"


def _population(row: FigureReport, names: Names) -> tuple[str, ...]:
    cp, cpk = "–", "–"
    if row.capability is not None:
        found = row.capability
        cp = _interval(found.cp, found.cp_interval)
        cpk = _interval(found.cpk, found.cpk_interval) + ("" if found.is_normal else " not normal")
    return (
        names[row.kind, row.name],
        str(row.gyros),
        format_quantity(row.name, row.mean, row.mean_std, row.units),
        _spread(row, row.std),
        _chart(row.chart),
        cp,
        cpk,
    )


def _study(row: FigureReport, names: Names) -> tuple[str, ...]:
    study = row.gauge
    assert isinstance(study, GaugeStudy)
    risk = "–" if row.risks is None else f"{format_number(100 * row.risks.false_acceptance, 2)} %"
    return (
        names[row.kind, row.name],
        *(
            _component(row, study.components.get(name))
            for name in ("gyro", "station", "interaction", "repeat")
        ),
        _spread(row, study.own_std),
        f"{format_number(100 * study.share_of_variance, 2)} %",
        risk,
    )


def _golden(row: Golden, names: Names) -> tuple[str, ...]:
    return (
        names[row.kind, row.name],
        row.station or "–",
        str(row.measurements),
        format_quantity(row.name, row.mean, row.mean_std, row.units),
        _moved(row.name, row.from_others, row.units),
        _moved(row.name, row.since_first, row.units),
        "–"
        if row.trend is None
        else format_quantity(row.name, row.trend.slope_per_day, row.trend.slope_std, row.units),
        _chart(row.chart),
    )


def _course(row: FigureHistory, names: Names) -> tuple[str, ...]:
    return (
        names[row.kind, row.name],
        str(len(row.values)),
        format_quantity(row.name, row.values[-1], row.stds[-1], row.units),
        _moved(row.name, row.since_before, row.units),
        _share(row.share_before),
        _moved(row.name, row.since_first, row.units),
        _share(row.share_first),
        "–"
        if row.trend is None
        else format_quantity(row.name, row.trend.slope_per_day, row.trend.slope_std, row.units),
        "–" if row.days_to_limit is None else f"{format_number(row.days_to_limit, 2)} d",
        _chart(row.chart),
    )


def _moved(name: str, move: Move | None, units: str) -> str:
    """A change, and in brackets how many σ that is."""
    if move is None:
        return "–"
    if move.sigma is None:
        return format_quantity(name, move.change, None, units)
    std = abs(move.change / move.sigma) if move.sigma else None
    return f"{format_quantity(name, move.change, std, units)}, {say_sigma(move.sigma)}"


def say_sigma(value: float | None) -> str:
    """How many σ a change is.

    Parameters
    ----------
    value
        In σ; None: not known.

    Returns
    -------
    str
        With its sign.

    Examples
    --------
    >>> from hrg_cli.reporting.ledger_tables import say_sigma
    >>> say_sigma(-7.07), say_sigma(None)
    ('−7.1 σ', '–')
    """
    return "–" if value is None else f"{value:+.1f} σ".replace("-", "−")


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:+.2g} %".replace("-", "−")


def _spread(row: FigureReport, std: float | None) -> str:
    """A standard deviation, in the unit that its own size asks for."""
    if std is None:
        return "–"
    factor, unit = choose_unit(row.name, std, row.units)
    return f"{format_number(std * factor, 3)} {unit}".strip()


def _component(row: FigureReport, found: Component | None) -> str:
    if found is None:
        return "–"
    factor, unit = choose_unit(row.name, found.std or found.high, row.units)
    low, high = format_number(found.low * factor, 2), format_number(found.high * factor, 2)
    return f"{format_number(found.std * factor, 3)} [{low}, {high}] {unit}".strip()


def _interval(value: float | None, interval: tuple[float, float] | None) -> str:
    if value is None or interval is None:
        return "–"
    return (
        f"{format_number(value, 3)} [{format_number(interval[0], 3)},"
        f" {format_number(interval[1], 3)}]"
    )


def _chart(chart: Chart | None) -> str:
    """How many points break which kind of rule."""
    if chart is None:
        return "–"
    beyond = sum(v.rule == BEYOND for v in chart.violations)
    warnings = len({v.point for v in chart.violations if v.rule != BEYOND})
    if beyond:
        return f"out: {beyond} beyond 3 σ"
    return f"in control{f', {warnings} warned of' if warnings else ''}"
