"""`hrg run`: the chain on one gyro's recordings into a folder, the answer, and a page
about it."""

from __future__ import annotations

import dataclasses
import json
import shlex
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import settings, store
from ..chain import Step, list_undiagnosed
from ..errors import HrgError
from ..extended import find_extended_paths
from ..extras import tell_lack_of_pages
from ..gyro import Input, find_gyro, list_inputs, need_readable, read_headings, run_gyro
from ..holding import hold
from ..limits import Row, check_tables
from ..pipeline import STAGES
from ..records.doubts import is_inherited
from ..reporting import answer_text, console
from ..reporting.answer import Answer, answer
from ..reporting.check_pages import explain_figure
from ..stages.demodulate import demodulate
from .common import Common
from .dry_run import say_by_hand
from .frame import Files, make_command, make_rehearse_option, need_inputs, read_command_line
from .options import make_flags


@make_command(
    "run",
    "hrg run recordings/ -o results/ --jobs 2",
    flags=make_flags(demodulate, "from_s", "to_s"),
    says={
        "output": "Folder of the results; the same folder resumes.",
        "config": "TOML file with a table a stage.",
        "assignments": (
            "Change one setting of a stage, e.g. demodulate.periods_per_window=4; may be repeated."
        ),
        "seed": "Seed of every stage that draws.",
        "jobs": "Processes that share the recordings, and the rehearsals of --rehearse.",
    },
)
def main(
    run: Common,
    /,
    recordings: Files = None,
    limits: Annotated[
        Path | None,
        typer.Option(help="TOML file with limits the results must hold.", show_default=False),
    ] = None,
    full: Annotated[
        bool,
        typer.Option("--full", help="Draw the figures of every run and file on the page, too."),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what would be done, and do nothing.")
    ] = False,
    rehearse: Annotated[int | None, make_rehearse_option("resonator and calibration")] = None,
    **part: Any,
) -> None:
    """The whole chain on the recordings (or logs, or a folder of them) of one gyro: the answer, and
    a page to show."""
    if run.show_config:
        resolve_tables(run, part, rehearse)
    run.finish(*run_files(recordings or [], run, limits, full, dry_run, part, rehearse))


MARK = "run.json"
Shown = tuple[dict[str, Any], Callable[[], None]]


def run_files(
    recordings: Sequence[Path],
    run: Common,
    limits: Path | None = None,
    full: bool = False,
    dry_run: bool = False,
    part: Mapping[str, float | None] | None = None,
    rehearse: int | None = None,
) -> Shown:
    """Run the chain on files; --config gives each stage's table, --set takes stage.key=value.

    Parameters
    ----------
    recordings
        Of one gyro: recordings, logs, or their folder.
    run
        The command's options.
    limits
        TOML file with limits that the results must hold.
    full
        The page has the figures of every run and file.
    dry_run
        What would be done is told, and nothing is done.
    part
        Where demodulate cuts [s], from_s and to_s.
    rehearse
        How many times resonator and calibration are rehearsed.

    Returns
    -------
    tuple
        The command's JSON, and the function that shows the answer.

    Raises
    ------
    HrgError
        Every recording failed, mixed gyros, outputs in the way.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from types import SimpleNamespace as Options
    >>> from hrg_cli.commands.run import run_files
    >>> typed = Options(
    ...     config=None, assignments=(), seed=None, show_config=False,
    ...     need_output=lambda _: Path("results"),
    ... )
    >>> with TemporaryDirectory() as folder:
    ...     log = Path(folder) / "run-1.csv"
    ...     _ = log.write_text("0.0,0.1,0.2")
    ...     report, _ = run_files([log], typed, dry_run=True)
    >>> [line.split()[1] for line in report["steps"]]
    ['import', 'demodulate', 'estimate', 'identify', 'diagnose']
    """
    started = time.monotonic()
    tables = resolve_tables(run, part or {}, rehearse)
    rehearsals = read_rehearsals(tables)
    wanted = settings.load_toml(limits) if limits is not None else {}
    check_tables(wanted)
    paths = need_inputs(recordings, "the recordings of one gyro, or their folder")
    folder = run.need_output("results/")
    if dry_run:
        return _plan(say_by_hand(paths, folder, tables, run), started)
    inputs = list_inputs(paths, tables.get("import", {}).get("s_file"))
    gyro = find_gyro(need_readable(read_headings(inputs)))
    made_folder = not folder.is_dir()
    if made_folder:
        store.check_output(folder)
        folder.mkdir()
    page, force = folder / "report.html", run.force or (folder / MARK).exists()
    store.check_output(page, force)
    steps = _follow_chain(paths, folder, tables, wanted, run, gyro, rehearsals)
    _need_result(steps, folder if made_folder else None)
    made = _files_made(steps, folder)
    found, rows = _judge_results(made, wanted)
    pageless = tell_lack_of_pages()
    if not pageless:
        _write_page(page, [*_list_shown(inputs, steps), *made], rows, full, force)
    report = _judge(steps, rows) | {
        "output": str(folder),
        "answer": found.to_json() if found else None,
        "steps": [dataclasses.asdict(step) for step in steps],
        "undiagnosed": (undiagnosed := list_undiagnosed(steps)),
        "report": str(page) if made and not pageless else None,
    }
    _write_report(folder / MARK, report)
    report["elapsed_s"] = round(time.monotonic() - started, 3)

    def show() -> None:
        if found is not None:
            answer_text.show(found, folder)
        if undiagnosed:
            console.say(say_undiagnosed(len(undiagnosed), folder))
        console.say(f"page: {page}" if not pageless else f"no page: {pageless}")

    return report, show


def _list_shown(inputs: Sequence[Input], steps: Sequence[Step]) -> list[Path]:
    """The recordings that a page can show: those that no step failed on."""
    failed = {name for step in steps if step.status == "failed" for name in step.inputs}
    h5 = (one.path for one in inputs if one.path.suffix == ".h5" and one.path.exists())
    return [path for path in h5 if path.name not in failed]


def _files_made(steps: Sequence[Step], folder: Path) -> list[Path]:
    """The files of the steps that succeeded, each once: a rehearsal writes into the file that it
    rehearses."""
    made = [step for step in steps if step.status != "failed" and step.name != "rehearse"]
    return list(dict.fromkeys(folder / step.output for step in made))


def _write_report(path: Path, report: Mapping[str, Any]) -> None:
    text = json.dumps(console.clean(report), indent=1, ensure_ascii=False) + "\n"
    with store.write_whole(path, force=True) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _follow_chain(
    paths: Sequence[Path],
    folder: Path,
    tables: Mapping[str, Any],
    wanted: Mapping[str, Any],
    run: Common,
    gyro: str,
    rehearsals: Mapping[str, Any] | None,
) -> list[Step]:
    """The chain's steps, told on the screen as they are done."""
    quiet = run.quiet or run.json
    with console.show_progress(f"run {gyro}".strip(), quiet) as progress:

        def told(step: Step, share: float) -> None:
            progress(share)
            if run.verbose and not quiet:
                console.tell(f"{step.name} → {step.output}: {step.status}")

        return run_gyro(
            paths,
            folder,
            tables,
            limits=wanted,
            force=run.force,
            command_line=read_command_line(),
            told=told,
            jobs=run.jobs,
            rehearse=rehearsals,
        )


def _need_result(steps: Sequence[Step], made_folder: Path | None) -> None:
    """HrgError: no step of the chain gave a result of the gyro; a folder that was made for it goes
    again where it is empty."""
    failed = [step for step in steps if step.status == "failed"]
    results = ("identify", "diagnose", "calibrate")
    if not failed or any(s.name in results and s.status != "failed" for s in steps):
        return
    if made_folder is not None and not any(made_folder.iterdir()):
        made_folder.rmdir()
    raise HrgError(failed[0].reasons[0])


def _judge(steps: Sequence[Step], rows: Sequence[Row]) -> dict[str, Any]:
    """Kind, status and reasons of the whole: the worst of its steps, where a diagnosis explains
    what the linear resonator leaves without that one; refused where a step failed or a limit is
    missed."""
    deciding = (
        [step for step in steps if step.name != "identify"] if _is_explained(steps) else steps
    )
    missed = [explain_figure(row) for row in rows if not row.passed]
    failed = any(step.status == "failed" for step in steps)
    worst = "refused" if failed or missed else max((s.status for s in deciding), key=_ORDER.index)
    return {
        "kind": "run",
        "status": worst,
        "status_reasons": [*missed, *list_reasons(deciding), *_tell_replaced(steps)],
    }


_ORDER = ["valid", "suspect", "refused"]


def resolve_tables(
    run: Common, part: Mapping[str, float | None], rehearse: int | None = None
) -> dict[str, Any]:
    """The settings by stage; with --show-config they are printed and the command ends.

    Parameters
    ----------
    run
        The command's options.
    part
        Where demodulate cuts [s], from_s and to_s.
    rehearse
        How many times resonator and calibration are rehearsed.

    Returns
    -------
    dict
        Stage -> what is set of it.

    Raises
    ------
    HrgError
        There is no such stage.

    Examples
    --------
    >>> from types import SimpleNamespace as Options
    >>> from hrg_cli.commands.run import resolve_tables
    >>> typed = Options(
    ...     config=None, assignments=("identify.bootstrap=100",), seed=None, show_config=False
    ... )
    >>> resolve_tables(typed, {"from_s": 0.5, "to_s": None})
    {'identify': {'bootstrap': 100}, 'demodulate': {'from_s': 0.5}}
    """
    tables: dict[str, Any] = settings.load_toml(run.config) if run.config else {}
    for text in run.assignments:
        settings.assign(tables, *settings.parse_assignment(text))
    for key, value in part.items():
        if value is not None:
            settings.assign(tables, f"demodulate.{key}", value)
    if rehearse is not None:
        settings.assign(tables, "rehearse.times", rehearse)
    for name, stage in STAGES.items():
        if run.seed is not None and settings.accepts(stage.load_function(), "seed"):
            settings.assign(tables, f"{name}.seed", run.seed)
    if run.seed is not None and "rehearse" in tables:
        settings.assign(tables, "rehearse.seed", run.seed)
    unknown = sorted(set(tables) - {*STAGES, "import", "rehearse"})
    if unknown:
        raise HrgError(
            f"{run.config or '--set'}: there is no stage {unknown[0]}; tables are"
            f" {', '.join(['import', *STAGES, 'rehearse'])}"
        )
    if run.show_config:
        whole = {
            name: settings.check_settings(stage.load_function(), tables.get(name, {}))
            for name, stage in STAGES.items()
        }
        rehearsals = read_rehearsals(tables)
        run.leave_with_settings(whole | ({} if rehearsals is None else {"rehearse": rehearsals}))
    return tables


def read_rehearsals(tables: Mapping[str, Any]) -> dict[str, Any] | None:
    """The whole settings of the rehearsals of a run.

    Parameters
    ----------
    tables
        Settings by stage.

    Returns
    -------
    dict or None
        None where a run is to have none.

    Raises
    ------
    HrgError
        Something is set of them, but not how many there are to be.

    Examples
    --------
    >>> from hrg_cli.commands.run import read_rehearsals
    >>> read_rehearsals({}) is None, read_rehearsals({"rehearse": {"times": 30}})["times"]
    (True, 30)
    """
    if "rehearse" not in tables:
        return None
    if "times" not in tables["rehearse"]:
        raise HrgError(
            "rehearse: settings of rehearsals without their number; give --rehearse N, or"
            " rehearse.times in the configuration"
        )
    from ..stages.rehearse import rehearse

    return settings.check_settings(rehearse, tables["rehearse"])


def list_reasons(steps: Sequence[Step]) -> list[str]:
    """Every reason of a chain once.

    What a result inherits from its inputs is told at the input, and the same reason of many files
    once for all.

    Parameters
    ----------
    steps
        Of the chain.

    Returns
    -------
    list of str
        Sentences, each with the file that it is first of.

    Examples
    --------
    >>> from hrg_cli.chain import Step
    >>> from hrg_cli.commands.run import list_reasons
    >>> waves = [Step("estimate", (), f"{k}.wave.h5", "suspect", ("is clipped",)) for k in "abc"]
    >>> list_reasons(waves)
    ['a.wave.h5 and 2 more: is clipped']
    """
    doubted = {step.output for step in steps if step.status in ("suspect", "refused")}
    named: dict[str, list[str]] = {}
    for step in steps:
        for reason in step.reasons:
            known = is_inherited(reason, doubted)
            if not known and step.output not in named.setdefault(reason, []):
                named[reason].append(step.output)
    return [
        f"{outputs[0]}{f' and {len(outputs) - 1} more' if len(outputs) > 1 else ''}: {reason}"
        for reason, outputs in named.items()
    ]


def say_undiagnosed(count: int, folder: Path) -> str:
    """That driven runs are not in the diagnosis, why, and what to type for one with them.

    Parameters
    ----------
    count
        Of them.
    folder
        Of the results.

    Returns
    -------
    str
        Two lines.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.commands.run import say_undiagnosed
    >>> print(say_undiagnosed(2, Path("results")))
    the diagnosis is of the free runs alone: with the 2 forced runs it may take many minutes; then:
          hrg diagnose results/*.wave.h5 -o results/diagnosis-of-all.h5
    """
    inside = shlex.quote(str(folder))
    what = "1 forced run" if count == 1 else f"{count} forced runs"
    return (
        f"the diagnosis is of the free runs alone: with the {what} it may take many minutes; then:"
        f"\n      hrg diagnose {inside}/*.wave.h5 -o {inside}/diagnosis-of-all.h5"
    )


def _find_explained(results: Sequence[Path]) -> list[Path]:
    """The resonator that a diagnosis among the results leaves, where it does."""
    left = (find_extended_paths(path)[1] for path in results if path.name == "diagnosis.h5")
    return [path for path in left if path.exists()]


def _is_explained(steps: Sequence[Step]) -> bool:
    """Whether a diagnosis explains what the linear resonator leaves, so that the doubt about that
    resonator is settled."""
    return any(
        step.name == "diagnose"
        and step.status == "valid"
        and step.json.get("verdict") == "explained"
        for step in steps
    )


def _tell_replaced(steps: Sequence[Step]) -> list[str]:
    """That a resonator in doubt is not the one to go on with, where a diagnosis explains it."""
    diagnoses = [step.output for step in steps if step.name == "diagnose"]
    return [
        f"{step.output}: {step.status} by itself;"
        f" {find_extended_paths(Path(diagnoses[0]))[1].name}, with the causes found, stands in"
        " its place"
        for step in steps
        if step.name == "identify" and step.status != "valid" and _is_explained(steps)
    ]


def _plan(lines: list[str], started: float) -> Shown:
    """What would be done, as commands."""
    report = {
        "kind": "plan of a run",
        "status": "valid",
        "status_reasons": [],
        "output": None,
        "steps": lines,
    }
    return report | {"elapsed_s": round(time.monotonic() - started, 3)}, lambda: console.say(
        "\n".join(lines)
    )


def _judge_results(made: Sequence[Path], limits: dict[str, Any]) -> tuple[Answer | None, list[Row]]:
    results = [
        path for path in made if path.name in ("resonator.h5", "diagnosis.h5", "calibration.h5")
    ]
    records = [store.read_any(path) for path in results]
    explained = [store.read_any(path) for path in _find_explained(results)]
    rows = [row for held in hold([*records, *explained], limits) for row in held]
    return (
        answer(records, rows, {record.kind: path.name for record, path in zip(records, results)}),
        rows,
    )


def _write_page(
    page: Path, files: Sequence[Path], rows: Sequence[Row], full: bool, force: bool
) -> None:
    from ..reporting.page import build_report

    text = build_report(files, rows=rows, full=full)
    with store.write_whole(page, force) as temporary:
        temporary.write_text(text, encoding="utf-8")
