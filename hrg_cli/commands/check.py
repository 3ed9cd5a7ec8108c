"""`hrg check`: files held against limits and a baseline."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import settings, store
from ..comparing import compare
from ..errors import HrgError, UsageError
from ..holding import hold
from ..limits import Row
from ..records import Record
from ..records.replaced import find_replaced
from ..reporting import check_pages, console
from ..reporting.answer import Answer, answer
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, Files, make_command, need_inputs
from .told_differences import describe_beyond

Shown = tuple[dict[str, Any], Callable[[], None]]
USUAL_SIGMA = 5.0
"""Difference from a baseline, in σ, that passes where the command does not say another."""


@make_command(
    "check",
    "hrg check results/*.h5 --limits configs/limits.toml --junit check.xml",
    idle=NO_DRAWS | ONE_PROCESS | {"strict": "the limits say which status passes"},
    says={
        "output": "File to write the JSON report into.",
        "config": "TOML file with more limits, over those of --limits.",
        "assignments": (
            'Change one limit, e.g. diagnosis.causes=0 or resonator.damping_split_1_s="5 deg/h";'
            " may be repeated."
        ),
        "show_config": "Print the limits as TOML and leave.",
    },
    also_written=("junit", "markdown"),
)
def main(
    run: Common,
    /,
    files: Files = None,
    limits: Annotated[
        Path | None, typer.Option(help="TOML file with the limits.", show_default=False)
    ] = None,
    baseline: Annotated[
        Path | None,
        typer.Option(
            help="Earlier result, or folder of results by the same names, to compare with in σ.",
            show_default=False,
        ),
    ] = None,
    limit_sigma: Annotated[
        float,
        typer.Option(
            min=0.0, help="Difference from the baseline that passes, in σ.", show_default=True
        ),
    ] = USUAL_SIGMA,
    junit: Annotated[
        Path | None, typer.Option(help="File to write as JUnit XML.", show_default=False)
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="File to write as a Markdown summary.", show_default=False)
    ] = None,
) -> None:
    """Hold the figures of files against limits and an earlier result: exit status 0 within, 3
    outside."""
    run.finish(*check_files(files or [], run, limits, baseline, limit_sigma, junit, markdown))


@dataclass(frozen=True)
class Checked:
    """One file: its record, its rows, and what of the baseline it misses (None: not compared)."""

    path: Path
    name: str
    """As much of the path as tells it from the others."""
    record: Record
    rows: list[Row]
    moved: list[str] | None

    @property
    def passed(self) -> bool:
        """Every figure within its limits and near its baseline."""
        return all(row.passed for row in self.rows) and not self.moved


def check_files(
    files: Sequence[Path],
    run: Common,
    limits: Path | None,
    baseline: Path | None,
    limit_sigma: float,
    junit: Path | None,
    markdown: Path | None,
) -> Shown:
    """Hold files against limits and a baseline's results.

    Parameters
    ----------
    files
        Of hrg, of any kind.
    run
        The command's options; tables of --config lie over those of `limits`, --set over both.
    limits
        TOML file with the limits.
    baseline
        Earlier result, or folder of results by the same names.
    limit_sigma
        Difference from the baseline that passes [σ].
    junit, markdown
        Files to write.

    Returns
    -------
    tuple
        The command's JSON, and the function that shows its tables.

    Raises
    ------
    UsageError
        There is nothing to hold files against.
    HrgError
        The limits hold nothing of these files, or one cannot be read.

    Examples
    --------
    >>> from types import SimpleNamespace as Options
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.commands.check import check_files
    >>> try:
    ...     check_files([], Options(config=None, assignments=()), None, None, 5.0, None, None)
    ... except HrgError as error:
    ...     print(error)
    no limits are named; add --limits limits.toml, or --baseline results/
    """
    started = time.monotonic()
    wanted = resolve_limits(run, limits)
    if not wanted and baseline is None:
        raise UsageError("no limits are named; add --limits limits.toml, or --baseline results/")
    if run.show_config:
        run.leave_with_settings(wanted)
    for path in (junit, markdown):
        if path is not None:
            store.check_output(path, run.force)
    paths = need_inputs(files, "hrg files")
    with ExitStack() as opened:
        records = [opened.enter_context(_needed_of(path)) for path in paths]
        compared = [
            None if baseline is None else _compare_with(path, record, baseline, limit_sigma)
            for path, record in zip(paths, records, strict=True)
        ]
        done = [
            Checked(*one)
            for one in zip(
                paths, tell_apart(paths), records, hold(records, wanted), compared, strict=True
            )
        ]
        if not any(one.rows or one.moved is not None for one in done):
            raise HrgError(
                f"{paths[0]}: the limits hold nothing for a {done[0].record.kind} file, nor for any"
                f" other; write [{done[0].record.kind}]"
            )
        found = _answer_one_gyro(done)
    for target, text in (
        (junit, check_pages.write_junit(done, found)),
        (markdown, check_pages.write_markdown(done, found)),
    ):
        if target is not None:
            with store.write_whole(target, run.force) as temporary:
                temporary.write_text(text, encoding="utf-8")
    report = _report(done, found) | {"elapsed_s": round(time.monotonic() - started, 3)}
    return run.write_report(report), lambda: _show(done)


def _needed_of(path: Path) -> AbstractContextManager[Record]:
    """A file's record with its rows left on disk: limits and baselines ask for a few figures."""
    return store.open_record(path, store.find_kind(path))


def _answer_one_gyro(done: Sequence[Checked]) -> Answer | None:
    """The answer of the files; None where they are of several gyros, for an answer is one
    gyro's."""
    records = [one.record for one in done]
    if len({getattr(record, "gyro_id", "") for record in records}) != 1:
        return None
    return answer(
        records,
        [row for one in done for row in one.rows],
        {one.record.kind: one.path.name for one in done},
    )


def _report(done: Sequence[Checked], found: Answer | None) -> dict[str, Any]:
    """The command's JSON, but for its time."""
    passed = all(one.passed for one in done)
    return {
        "kind": "check",
        "status": "valid" if passed else "refused",
        "status_reasons": [
            f"{one.name}: {reason}" if len(done) > 1 else reason
            for one in done
            for reason in check_pages.explain_missed(one)
        ],
        "passed": passed,
        "answer": found.to_json() if found else None,
        "files": [
            {
                "file": str(one.path),
                "kind": one.record.kind,
                "passed": one.passed,
                "moved": one.moved,
            }
            for one in done
        ],
        "rows": [
            {"file": str(one.path), **vars(row), "margin_sigma": row.margin_sigma}
            for one in done
            for row in one.rows
        ],
    }


def _show(done: Sequence[Checked]) -> None:
    """Every figure beside its limit, with its file where there are several."""
    head = ("figure", "value", "limit", "margin, σ", "passed")
    lines = [(one.name, *check_pages.format_cells(row)) for one in done for row in one.rows]
    if len(done) > 1 and lines:
        console.print_table("", ("file", *head), lines)
    elif lines:
        console.print_table("", head, [line[1:] for line in lines])
    for place in find_replaced([one.record for one in done]):
        console.say(
            f"{done[place].name}: {done[place].record.status} by itself, and not held; the"
            " diagnosis' own resonator, with the causes found, stands in its place"
        )
    for one in done:
        if one.moved == []:
            console.say(f"{one.name}: nothing moved from the baseline")


def resolve_limits(run: Common, limits: Path | None) -> dict[str, Any]:
    """The limits of a file, tables of --config over them, --set over both.

    Parameters
    ----------
    run
        The command's options.
    limits
        TOML file; None: there is none.

    Returns
    -------
    dict
        Kind of file -> figure -> limit.

    Examples
    --------
    >>> from types import SimpleNamespace as Options
    >>> from hrg_cli.commands.check import resolve_limits
    >>> resolve_limits(Options(config=None, assignments=("diagnosis.causes=0",)), None)
    {'diagnosis': {'causes': 0}}
    """
    wanted: dict[str, Any] = {}
    for path in (p for p in (limits, run.config) if p is not None):
        settings.merge(wanted, settings.load_toml(path))
    for text in run.assignments:
        settings.assign(wanted, *settings.parse_assignment(text))
    return wanted


def tell_apart(paths: Sequence[Path]) -> list[str]:
    """Names of files, as long as it takes to tell them apart.

    Parameters
    ----------
    paths
        Of the files.

    Returns
    -------
    list of str
        The paths' ends.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.commands.check import tell_apart
    >>> tell_apart([Path("lot/a/wave.h5"), Path("lot/b/wave.h5")])
    ['a/wave.h5', 'b/wave.h5']
    """
    for parts in range(1, max(len(path.parts) for path in paths) + 1):
        names = [str(Path(*path.parts[-parts:])) for path in paths]
        if len(set(names)) == len(names):
            break
    return names


def _compare_with(path: Path, record: Record, baseline: Path, limit_sigma: float) -> list[str]:
    """What has moved by more than `limit_sigma` since the baseline."""
    if not baseline.is_dir():
        with _needed_of(baseline) as earlier:
            return describe_beyond(
                compare(earlier, record, (str(baseline), str(path))), limit_sigma
            )
    other = baseline / path.name
    if not other.exists():
        return [f"{other.name} is not in the baseline {baseline}"]
    with _needed_of(other) as earlier:
        return describe_beyond(compare(earlier, record, (str(other), str(path))), limit_sigma)
