"""Differences of two results for people: the names and units of the trade, not keys and SI."""

from __future__ import annotations

from collections.abc import Sequence

from ..comparing import Comparison, Difference
from ..reporting.figure_names import name_figure
from ..reporting.quantities import choose_unit, format_quantity, round_with_std
from ..reporting.text import clean_text, format_number

HEAD = ("figure", "old", "new", "change", "moved by, σ")


def list_differences(found: Sequence[Difference]) -> list[tuple[str, ...]]:
    """Differences as rows of a table; a figure that is kept in two places once.

    Parameters
    ----------
    found
        Of two results.

    Returns
    -------
    list of tuple
        The texts of `HEAD`, in units of the trade.

    Examples
    --------
    >>> from hrg_cli.commands.told_differences import list_differences
    >>> from hrg_cli.comparing import Difference
    >>> one = Difference("scale_factor", 0.55, None, 0.551, None, "1", 1e-3, 1.0)
    >>> [(row[0], row[-1]) for row in list_differences([one, one])]
    [('scale factor K', '1')]
    """
    rows: list[tuple[str, ...]] = []
    for one in found:
        row = (
            name_figure(one.name),
            _said(one, one.old, one.old_std),
            _said(one, one.new, one.new_std),
            _change(one),
            format_number(one.sigma, 3),
        )
        if row not in rows:
            rows.append(row)
    return rows


def describe_beyond(found: Comparison, limit_sigma: float) -> list[str]:
    """What changed beyond a limit, in sentences.

    Parameters
    ----------
    found
        Of two results.
    limit_sigma
        σ by which a figure may have moved.

    Returns
    -------
    list of str
        What moved by more, figures that the new result lacks, causes that are in one result alone,
        and which words changed.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.commands.told_differences import describe_beyond
    >>> words = [("verdict", "explained", "adequate")]
    >>> lone = {"lone_causes": [("old", "gain_mismatch")], "lone_figures": []}
    >>> found = Told(differences=[], words=words, **lone)
    >>> for sentence in describe_beyond(found, 4.0):
    ...     print(sentence)
    cause gain mismatch is in the old result alone
    verdict was explained, is adequate
    """
    far = [d for d in found.differences if d.sigma is not None and abs(d.sigma) > limit_sigma]
    said = [
        f"{name} moved by {sigma} σ ({change}), at most {limit_sigma:g} was wanted"
        for name, _, _, change, sigma in list_differences(far)
    ]
    said += [
        f"{name} is in the {place} result alone: whether it moved is not known"
        for place, name in list_lone_figures(found)
        if place == "old"
    ]
    said += [
        f"cause {cause} is in the {place} result alone" for place, cause in list_lone_causes(found)
    ]
    return said + [
        f"{name} was {clean_text(old)}, is {clean_text(new)}" for name, old, new in found.words
    ]


def list_lone_causes(found: Comparison) -> list[tuple[str, str]]:
    """Causes that one result alone has, in words: "old" or "new", and the cause.

    Parameters
    ----------
    found
        Of two results.

    Returns
    -------
    list of tuple
        In the order found.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.commands.told_differences import list_lone_causes
    >>> list_lone_causes(Told(lone_causes=[("old", "gain_mismatch")]))
    [('old', 'gain mismatch')]
    """
    return [(place, clean_text(cause.replace("_", " "))) for place, cause in found.lone_causes]


def list_lone_figures(found: Comparison) -> list[tuple[str, str]]:
    """Measured figures that one result alone has, in words: "old" or "new", and the figure.

    Parameters
    ----------
    found
        Of two results.

    Returns
    -------
    list of tuple
        In the order found.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.commands.told_differences import list_lone_figures
    >>> list_lone_figures(Told(lone_figures=[("old", "scale_factor")]))
    [('old', 'scale factor K')]
    """
    return [(place, name_figure(name)) for place, name in found.lone_figures]


def _said(one: Difference, value: float, std: float | None) -> str:
    """A value of either result, both in the unit of the larger one."""
    factor, unit = choose_unit(one.name, max(abs(one.old), abs(one.new)), one.units or "1")
    shown = round_with_std(value * factor, None if std is None else std * abs(factor))
    return f"{shown} {unit}".strip()


def _change(one: Difference) -> str:
    """The difference with its σ: of a scale factor in ppm of the old one, of any other in its own
    unit."""
    both = abs(one.difference / one.sigma) if one.sigma else None
    if one.name.rpartition(".")[2] == "scale_factor" and one.old:
        ppm = 1e6 / one.old
        return f"{round_with_std(one.difference * ppm, both and both * abs(ppm))} ppm"
    return format_quantity(one.name, one.difference, both, one.units or "1")
