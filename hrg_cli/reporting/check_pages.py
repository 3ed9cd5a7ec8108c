"""What a check says to machines and to a merge request: JUnit XML and a table in Markdown, with the
answer's sentence on top."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol
from xml.etree import ElementTree

from ..limits import Row
from ..records import Record
from .answer import Answer, describe_requirement
from .text import clean_text, format_number


class JudgedFile(Protocol):
    """A file held against limits and a baseline."""

    @property
    def path(self) -> Path:
        """The file."""

    @property
    def name(self) -> str:
        """As much of its path as tells it from the others."""

    @property
    def record(self) -> Record:
        """What it holds."""

    @property
    def rows(self) -> list[Row]:
        """Its figures against limits."""

    @property
    def moved(self) -> list[str] | None:
        """What is too far from the baseline; None: not compared."""


def explain_missed(one: JudgedFile) -> list[str]:
    """Why a file does not pass.

    Parameters
    ----------
    one
        Held against limits and a baseline.

    Returns
    -------
    list of str
        A sentence each; empty where it passes.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.limits import Row
    >>> from hrg_cli.reporting.check_pages import explain_missed
    >>> explain_missed(Told(rows=[Row("scale_factor", 0.45, 0.5, None, False)], moved=None))
    ['scale_factor is 0.45, the limit is ≥ 0.5']
    """
    return [explain_figure(row) for row in one.rows if not row.passed] + list(one.moved or [])


def explain_figure(row: Row) -> str:
    """Why a figure does not pass, in the units of the screen.

    Parameters
    ----------
    row
        Of `hrg check`.

    Returns
    -------
    str
        A sentence.

    Examples
    --------
    >>> from hrg_cli.limits import Row
    >>> from hrg_cli.reporting.check_pages import explain_figure
    >>> explain_figure(Row("scale_factor", 0.45, 0.5, None, False))
    'scale_factor is 0.45, the limit is ≥ 0.5'
    """
    if row.words is not None or row.value is None:
        return row.describe()
    shown = describe_requirement(row)
    return f"{clean_text(shown.name)} is {shown.value}, the limit is {shown.limit}"


def format_cells(row: Row) -> tuple[str, str, str, str, str]:
    """A figure against its limit as cells of a table.

    Parameters
    ----------
    row
        Of `hrg check`.

    Returns
    -------
    tuple of str
        Figure, value, limit, margin in σ, and whether it passed.

    Examples
    --------
    >>> from hrg_cli.limits import Row
    >>> from hrg_cli.reporting.check_pages import format_cells
    >>> format_cells(Row("scale_factor", 0.55, 0.5, None, True, std=0.01))[2:]
    ('≥ 0.5', '5', 'yes')
    """
    shown = describe_requirement(row)
    return (
        clean_text(shown.name),
        shown.value,
        shown.limit,
        format_number(shown.margin_sigma, 2),
        "yes" if shown.passed else "NO",
    )


def write_junit(files: Sequence[JudgedFile], found: Answer | None) -> str:
    """A check as JUnit XML: a suite a file, a case a figure and one for the baseline.

    Parameters
    ----------
    files
        Held against limits and a baseline.
    found
        The answer, whose sentence is the suite's output; None: there is none.

    Returns
    -------
    str
        XML.

    Examples
    --------
    >>> from pathlib import Path
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.limits import Row
    >>> from hrg_cli.reporting.check_pages import write_junit
    >>> rows = [Row("scale_factor", 0.45, 0.5, None, False)]
    >>> one = Told(rows=rows, moved=None, path=Path("resonator.h5"), record=Told(kind="resonator"))
    >>> print(write_junit([one], None).splitlines()[1])
    <testsuites name="hrg check" tests="1" failures="1">
    """
    root = ElementTree.Element("testsuites", name="hrg check")
    for one in files:
        cases = [(row.name, None if row.passed else explain_figure(row)) for row in one.rows]
        if one.moved is not None:
            cases.append(("baseline", "; ".join(one.moved) or None))
        failures = sum(why is not None for _, why in cases)
        suite = ElementTree.SubElement(
            root,
            "testsuite",
            name=str(one.path),
            tests=str(len(cases)),
            failures=str(failures),
            errors="0",
        )
        for name, why in cases:
            case = ElementTree.SubElement(
                suite,
                "testcase",
                classname=f"{one.record.kind}.{one.path.stem}",
                name=clean_text(name),
            )
            if why is not None:
                ElementTree.SubElement(case, "failure", message=clean_text(why)).text = clean_text(
                    why
                )
        if found is not None and one.record.kind in ("diagnosis", "resonator", "calibration"):
            said = [found.sentence, f"gyro: {found.health}; fit: {found.validity}", *found.why]
            ElementTree.SubElement(suite, "system-out").text = "\n".join(map(clean_text, said))
    for key in ("tests", "failures"):
        root.set(key, str(sum(int(suite.get(key, "0")) for suite in root)))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def write_markdown(files: Sequence[JudgedFile], found: Answer | None) -> str:
    """A check as a summary for a merge request.

    Parameters
    ----------
    files
        Held against limits and a baseline.
    found
        The answer, whose sentence stands on top; None: there is none.

    Returns
    -------
    str
        Markdown.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.limits import Row
    >>> from hrg_cli.reporting.check_pages import write_markdown
    >>> rows = [Row("scale_factor", 0.55, 0.5, None, True)]
    >>> print(
    ...     write_markdown([Told(rows=rows, moved=None, name="resonator.h5")], None).splitlines()[0]
    ... )
    ### hrg check: passed
    """
    passed = not any(explain_missed(one) for one in files)
    lines = [f"### hrg check: {'passed' if passed else 'FAILED'}", ""]
    if found is not None:
        lines += [
            _escaped(found.sentence),
            "",
            f"gyro: **{found.health}**; fit: **{found.validity}**",
            "",
        ]
    rows = [(one.name, *format_cells(row)) for one in files for row in one.rows]
    if rows:
        lines += [
            "| file | figure | value | limit | margin, σ | passed |",
            "|---|---|---|---|---|---|",
        ]
        lines += ["| " + " | ".join(_escaped(c) for c in row) + " |" for row in rows]
    lines += [
        f"* {_escaped(one.name)}: {_escaped(reason)}" for one in files for reason in one.moved or []
    ]
    return "\n".join(lines) + "\n"


def _escaped(text: str) -> str:
    for mark in ("\\", "|", "<", "*", "_", "`"):
        text = text.replace(mark, f"\\{mark}" if mark != "<" else "&lt;")
    return clean_text(text)
