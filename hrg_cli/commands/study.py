"""`hrg study NAME`: run a study, write its figures as JSON (and CSV) and its pictures
as PNG into a folder."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import pipeline, settings, store
from ..errors import UsageError
from ..extras import warn_of_plain_python
from ..records import Recording
from ..reporting import console
from ..store import check_output, keep_whole_or_none, write_whole
from ..version import __version__
from .common import Common
from .frame import make_command
from .options import parse_numbers, parse_words

STUDIES = {
    "gauss-newton": "gauss_newton",
    "redundancy": "redundancy",
    "identification": "identification",
    "programmes": "programmes",
    "diagnosis": "diagnosis",
    "recovery": "recovery",
}
"""Name on the command line -> module in `studies`: its function NAME_study gives plain figures,
`draw_figure` a picture of them."""


def _study_names(incomplete: str) -> list[str]:
    """Names of studies, for the shell's completion."""
    return [name for name in STUDIES if name.startswith(incomplete)]


@make_command(
    "study",
    "hrg study gauss-newton -o study/",
    idle={"strict": "a study has no validity of its own"},
    says={
        "jobs": (
            "Processes that share the draws of the programmes, diagnosis and recovery studies;"
            " the others use one."
        )
    },
)
def main(
    run: Common,
    /,
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help=f"{', '.join(STUDIES)}.",
            autocompletion=_study_names,
        ),
    ] = None,
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RECORDING...", help="Of recovery: one gyro's recordings.", show_default=False
        ),
    ] = None,
    effects: Annotated[
        str | None,
        typer.Option(
            help="Effects to hide, joined by commas (default: all).",
            show_default=False,
            parser=parse_words,
            metavar="NAME,...",
        ),
    ] = None,
    sizes: Annotated[
        str | None,
        typer.Option(
            help="Their sizes in σ, joined by commas.",
            show_default=False,
            parser=parse_numbers,
            metavar="NUMBER,...",
        ),
    ] = None,
) -> None:
    """Repeat one of the papers' experiments, or a study of this project's own methods: table and
    figures into a folder.

    recovery hides every effect in RECORDINGs of yours and tells what a diagnosis finds of it.
    programmes and recovery go on where they were stopped: give the same folder again.
    """
    run.finish(*_run_study(name, run, recordings or [], effects=effects, sizes=sizes))


OF_RECORDINGS, RESUMED = ("recovery",), ("programmes", "recovery")
"""Studies of the user's own recordings, and those that take up what an interrupted one has done."""
OF_NO_ROW = ("jobs", "programmes")
"""Settings that no row of a study depends on: how the work is shared, and how much of it there
is."""


def _run_study(
    name: str | None, run: Common, recordings: Sequence[Path] = (), **flags: Any
) -> tuple[dict[str, Any], Callable[[], None]]:
    """Run the study; its JSON report and the function that shows its table."""
    if name not in STUDIES:
        raise UsageError(f"no study is called {name!r}; there are {', '.join(STUDIES)}")
    if recordings and name not in OF_RECORDINGS:
        raise UsageError(f"the study {name} makes its own data; leave out {recordings[0]}")
    started = time.monotonic()
    module = import_module(f"hrg_cli.studies.{STUDIES[name]}")
    study = getattr(module, f"{STUDIES[name]}_study")
    values = _settings_of_study(name, study, run, flags)
    folder = run.output
    if folder is not None:
        _claim_outputs(folder, name, run.force)
    if values.get("jobs", 1) > 1:  # its processes leave it to this one
        warn_of_plain_python()
    mark: dict[str, Any] = {"settings": {k: v for k, v in values.items() if k not in OF_NO_ROW}}
    if name in OF_RECORDINGS:
        read = [store.read(Path(path), Recording) for path in recordings]
        mark["files"] = [store.compute_sha256(Path(path)) for path in recordings]
        result = _resumed(partial(study, read, **values), name, folder, mark)
    elif name in RESUMED:
        result = _resumed(partial(study, **values), name, folder, mark)
    else:
        result = study(**values)
    report: dict[str, Any] = {
        **pipeline.make_common_keys("study", "valid", (), folder, started),
        "name": name,
        "settings": values,
        "result": result,
    }
    shown = module.tabulate(result) if hasattr(module, "tabulate") else _flat(result)
    if folder is not None:
        _write_study(folder / name, module.draw_figure(result), shown, report, run.force)
        (folder / f"{name}.unfinished.json").unlink(missing_ok=True)

    def show() -> None:
        if hasattr(module, "describe_background"):
            console.say(module.describe_background(result))
        console.print_table("", *shown)

    return report, show


def _settings_of_study(
    name: str, study: Callable[..., Any], run: Common, flags: Mapping[str, Any]
) -> dict[str, Any]:
    """The study's resolved settings; flags of the command that are other studies' are left out.
    UsageError: one of those was given."""
    for key, value in flags.items():
        if value is not None and not settings.accepts(study, key):
            raise UsageError(f"the study {name} has no --{key}; leave it out")
    return run.resolve_settings(
        study, **{key: value for key, value in flags.items() if settings.accepts(study, key)}
    )


def _write_study(
    place: Path, figure: Any, shown: Sequence[Any], report: Mapping[str, Any], force: bool
) -> None:
    """Figure, table and report beside one another, all whole or none; the report last, so that it
    says that the others are there."""
    picture, table, told = outputs = _list_outputs(place)
    with keep_whole_or_none(outputs):
        with write_whole(picture, force) as temporary:
            figure.savefig(temporary, format="png", dpi=120)
        with (
            write_whole(table, force) as temporary,
            temporary.open("w", encoding="utf-8", newline="") as file,
        ):
            csv.writer(file).writerows([shown[0], *shown[1]])
        with write_whole(told, force) as temporary:
            temporary.write_text(
                json.dumps(console.clean(report), indent=1, ensure_ascii=False), encoding="utf-8"
            )


def _claim_outputs(folder: Path, name: str, force: bool) -> None:
    """Make the folder; HrgError: one of the study's files cannot be written there."""
    check_output(folder / "x", True) if folder.is_dir() else check_output(folder)
    folder.mkdir(exist_ok=True)
    for output in _list_outputs(folder / name):
        check_output(output, force)


def _list_outputs(place: Path) -> list[Path]:
    """A study's figure, table and report."""
    return [place.with_suffix(suffix) for suffix in (".png", ".csv", ".json")]


def _resumed(
    study: Callable[[Sequence[Any], Callable[[Sequence[Any]], None]], dict[str, Any]],
    name: str,
    folder: Path | None,
    mark: Mapping[str, Any],
) -> dict[str, Any]:
    """A study whose rows are kept in the folder while it runs, and taken up where its `mark`, what
    the rows depend on, is the same."""
    mark = {**mark, "version": __version__}
    kept = None if folder is None else folder / f"{name}.unfinished.json"
    known: list[Any] = []
    if kept is not None and kept.is_file():
        before = json.loads(kept.read_text(encoding="utf-8"))
        known = before["rows"] if before["mark"] == mark else []

    def keep(rows: Sequence[Any]) -> None:
        if kept is not None:
            with write_whole(kept, True) as temporary:
                temporary.write_text(
                    json.dumps(console.clean({"mark": mark, "rows": rows}), ensure_ascii=False),
                    encoding="utf-8",
                )

    return study(known, keep)


def _flat(
    result: dict[str, Any], prefix: str = ""
) -> tuple[tuple[str, str], list[tuple[str, Any]]]:
    """The plain figures of a result, nested names joined by dots."""
    rows: list[tuple[str, Any]] = []
    for key, value in result.items():
        if isinstance(value, dict):
            rows += _flat(value, f"{prefix}{key}.")[1]
        elif not isinstance(value, list):
            rows.append((f"{prefix}{key}", value))
    return ("figure", "value"), rows
