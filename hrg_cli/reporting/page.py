"""The report: one HTML page that needs no network, or its figures alone as PNG, for any set of hrg
files.

Identical files give identical bytes: the page holds no date of its own and its figures no random
ids. Whatever a file says (names, history, reasons) is text on the page, never markup.
"""

from __future__ import annotations

import base64
import hashlib
import itertools
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from .. import store
from ..errors import HrgError
from ..limits import Row
from ..records import (
    KINDS,
    Calibration,
    Compensated,
    Diagnosis,
    Periods,
    Record,
    Recording,
    Resonator,
    Wave,
)
from ..version import __version__
from .answer import Answer, answer
from .figures import calibration, diagnosis, recording, result, wave
from .figures.answer import before_and_after
from .figures.drawing import Plot, png, style, svg
from .figures_in_words import told
from .living import as_text, living_data
from .methods import cited, methods
from .page_content import STEPS, ShownStep, list_steps, list_tables
from .page_table import PageTable
from .surface import surface_data
from .tables import facts
from .text import number, plain

FOLDER = Path(__file__).parent
SCRIPTS = ("page.js", "plots.js", "living.js", "surface.js")
PAGE_BYTES = 2_600_000
"""Figures beyond this are left out of the page, least important first, and the page says so."""
DRAWN_OF_A_KIND = 4
"""Files of one kind whose figures are drawn; the others are in the tables."""
ROWS_HELD = 200_000
"""Rows of a series held in memory for its figures; of longer ones every k-th is taken."""
RESULTS_FIRST = (
    "diagnosis",
    "calibration",
    "resonator",
    "compensated",
    "wave",
    "recording",
    "periods",
)


SHADES = {
    "sound": "valid",
    "fault found": "refused",
    "bench fault": "suspect",
    "in doubt": "suspect",
    "not examined": "skipped",
}
"""Health of a gyro -> the page's colour for it."""


@dataclass(frozen=True)
class Picture:
    """A figure on the page."""

    anchor: str
    title: str
    words: str
    svg: Markup


@dataclass
class PageEntry:
    """One file on the page."""

    name: str
    anchor: str
    record: Record
    size: int
    sha256: str
    facts: list[tuple[str, str]]
    tables: list[PageTable]
    sources: list[tuple[str, str, str, str]] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    left_out: int = 0

    @property
    def provenance(self) -> dict[str, Any]:
        """Provenance as text."""
        p = self.record.provenance
        return {
            "history": [plain(h) for h in p.history],
            "settings": plain(p.settings),
            "created": plain(p.created),
            "generated_by": plain(p.generated_by),
        }


@dataclass(frozen=True)
class Beside:
    """What the other files on the page say about a file: truth by run, and the runs whose periods
    are shown."""

    truths: dict[str, Recording]
    demodulated: frozenset[str]


def build_report(
    paths: Sequence[Path], *, truth: bool = False, full: bool = False, rows: Sequence[Row] = ()
) -> str:
    """The page of these files as HTML: the answer of every gyro first; runs, files and history
    folded behind it.

    truth: also show what a simulation knows (the truth of a recording, over the wave of the same
    run); full: draw the figures of every file, too (`truth` does); rows: figures held against
    limits. HrgError: no file, a file is missing, damaged or not an hrg file.
    """
    full = full or truth
    entries = [_entry(path, index, full) for index, path in enumerate(_unique(paths))]
    answers = _answers(_unique(paths), entries, rows)
    if full:
        _draw_all(_unique(paths), entries, truth)
    _link_sources(entries)
    return _render(entries, answers, truth, full)


def _draw_all(paths: Sequence[Path], entries: list[PageEntry], truth: bool) -> None:
    """The figures of every file, results first, as long as there is room."""
    beside = _beside(paths, entries, truth)
    order = sorted(range(len(entries)), key=lambda i: RESULTS_FIRST.index(entries[i].record.kind))
    drawn: dict[str, int] = {}
    room = PAGE_BYTES
    for index in order:
        entry = entries[index]
        kind = entry.record.kind
        drawn[kind] = drawn.get(kind, 0) + 1
        if drawn[kind] > DRAWN_OF_A_KIND:
            entry.left_out = -1
            continue
        for plot in _plots(paths[index], beside):
            picture = _picture(plot, f"f{index}-{plot.key}")
            if len(picture.svg) > room:
                entry.left_out += 1
                continue
            room -= len(picture.svg)
            entry.pictures.append(picture)


def _picture(plot: Plot, anchor: str) -> Picture:
    return Picture(anchor, plain(plot.title), plain(plot.words), Markup(svg(plot, anchor)))


@dataclass(frozen=True)
class Shown:
    """The answer of one gyro on the page: its figures, the data of those that move, the paragraph
    for a report."""

    answer: Answer
    anchor: str
    pictures: list[Picture]
    living: dict[str, Any] | None
    surface: dict[str, Any] | None
    methods: str


def _answers(paths: Sequence[Path], entries: list[PageEntry], rows: Sequence[Row]) -> list[Shown]:
    """The answer of every gyro that has a result, in the files' order."""
    gyros: dict[str, dict[str, Path]] = {}
    counts: dict[str, dict[str, int]] = {}
    for path, entry in zip(paths, entries):
        gyro = str(getattr(entry.record, "gyro_id", ""))
        counts.setdefault(gyro, {})[entry.record.kind] = (
            counts.get(gyro, {}).get(entry.record.kind, 0) + 1
        )
        if entry.record.kind in (
            "diagnosis",
            "calibration",
            "resonator",
            "compensated",
        ) and not _is_extended(entry.record):
            gyros.setdefault(gyro, {})[entry.record.kind] = path
    found = []
    for place, (gyro, files) in enumerate(gyros.items(), start=1):
        records = {kind: store.read_any(path) for kind, path in files.items()}
        made = answer(
            list(records.values()), rows, {kind: path.name for kind, path in files.items()}
        )
        if made is None:
            continue
        pictures, living, surface = [], None, None
        with style():
            drawn: list[Plot | None] = []
            if isinstance(told := records.get("diagnosis"), Diagnosis):
                drawn.append(before_and_after(told, made.departure, made.causes))
                living = living_data(told)
            if isinstance(tables_of := records.get("calibration"), Calibration):
                drawn += calibration.calibration_plots(tables_of, first_only=True)
                surface = surface_data(tables_of)
            pictures = [
                _picture(plot, f"answer-{place}-{plot.key}") for plot in drawn if plot is not None
            ]
        found.append(
            Shown(
                made,
                f"answer-{place}",
                pictures,
                living,
                surface,
                methods(list(records.values()), counts[gyro]),
            )
        )
    return found


def _is_extended(record: Record) -> bool:
    """A resonator made beside a diagnosis, which the diagnosis speaks for."""
    return isinstance(record, Resonator) and record.method == "extended model"


def write_figures(paths: Sequence[Path], folder: Path, *, truth: bool = False) -> list[Path]:
    """Every figure as PNG in `folder` (made when missing), named FILE-FIGURE.png; the paths
    written. HrgError: as `build_report`."""
    folder = Path(folder)
    entries = [_entry(path, index, False) for index, path in enumerate(_unique(paths))]
    beside = _beside(paths, entries, truth)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise HrgError(
            f"{folder}: is no folder and cannot be made one ({error.strerror}); choose another"
            " --output"
        ) from error
    written: list[Path] = []
    used: set[str] = set()
    for path in _unique(paths):
        for plot in itertools.chain(_answer_plot(path), _plots(path, beside)):
            name = re.sub(r"[^A-Za-z0-9._-]", "_", f"{path.stem}-{plot.key}").lstrip(".")[:120]
            while name in used:
                name += "_"
            used.add(name)
            target = folder / f"{name}.png"
            with store.atomic_path(target, force=True) as temporary:
                png(plot, temporary)
            written.append(target)
    return written


def _answer_plot(path: Path) -> Iterator[Plot]:
    """The answer's figure of a diagnosis."""
    if store.kind_of(path) is Diagnosis:
        record = store.read(path, Diagnosis)
        made = answer([record])
        with style():
            plot = (
                before_and_after(record, made.departure, made.causes) if made is not None else None
            )
            if plot is not None:
                yield plot


def status_of(paths: Sequence[Path]) -> tuple[str, list[str]]:
    """Worst status of these files and every reason, each with its file's name."""
    order = ["valid", "suspect", "refused"]
    worst, reasons = "valid", []
    for path in _unique(paths):
        with store.open_record(path, store.kind_of(path)) as record:
            worst = max(worst, record.status, key=order.index)
            reasons += [f"{path.name}: {reason}" for reason in record.status_reasons]
    return worst, reasons


def _unique(paths: Sequence[Path]) -> list[Path]:
    found = list(dict.fromkeys(Path(p) for p in paths))
    if not found:
        raise HrgError("no file to report on; name one or more files that hrg wrote")
    return found


def _entry(path: Path, index: int, full: bool) -> PageEntry:
    with store.open_record(path, store.kind_of(path)) as record:
        record = _thinned(record) if full or not isinstance(record, Periods | Wave) else record
        shown = told(facts(record))
        kept = record
        found_tables = list_tables(kept) if full else []
    bare = _bare(kept)
    return PageEntry(
        plain(path.name),
        f"file-{index + 1}",
        bare,
        path.stat().st_size,
        store.sha256(path),
        shown,
        found_tables,
    )


def _bare(record: Record) -> Record:
    """The record without its rows."""
    nothing: dict[str, Any] = {
        name: np.empty((0,) * len(spec.dims))
        for name, spec in record.columns().items()
        if spec.dims
    }
    return replace(record, **nothing)


def _thinned(record: Record) -> Record:
    """The record in memory (a recording stays on disk), every k-th row of a very long one."""
    if isinstance(record, Recording):
        return record
    step = max(1, -(-len(record) // ROWS_HELD))
    columns = [
        name
        for name, spec in record.columns().items()
        if spec.dims and spec.dims[0] == "row" and getattr(record, name) is not None
    ]
    if not columns:
        return record
    parts: dict[str, list[np.ndarray]] = {name: [] for name in columns}
    block = step * (1 << 16)
    for start in range(0, len(record), block):
        for name in columns:
            parts[name].append(np.asarray(getattr(record, name)[start : start + block])[::step])
    joined: dict[str, Any] = {
        name: np.concatenate(values) for name, values in parts.items() if values
    }
    return replace(record, **joined)


def _beside(paths: Sequence[Path], entries: list[PageEntry], truth: bool) -> Beside:
    truths = {}
    for path, entry in zip(_unique(paths), entries):
        if truth and isinstance(entry.record, Recording):
            with store.open_record(path, Recording) as record:
                if record.truth_time_s is not None and len(record.truth_time_s):
                    truths[record.run_id] = replace(
                        record, c=np.empty(0), s=np.empty(0), time_s=None
                    )
    return Beside(
        truths,
        frozenset(entry.record.run_id for entry in entries if isinstance(entry.record, Periods)),
    )


def _plots(path: Path, beside: Beside) -> Iterator[Plot]:
    """The figures of a file, drawn one after another."""
    with store.open_record(path, store.kind_of(path)) as record, style():
        record = _thinned(record)
        draw = _DRAW[type(record)]
        yield from draw(record, beside)


_DRAW: dict[type[Record], Callable[..., list[Plot]]] = {
    Recording: lambda r, beside: recording.plots(r, bool(beside.truths)),
    Periods: lambda r, _: recording.period_plots(r),
    Wave: lambda r, beside: wave.plots(
        r, beside.truths.get(r.run_id), r.run_id not in beside.demodulated
    ),
    Resonator: lambda r, _: result.resonator_plots(r),
    Calibration: lambda r, _: calibration.calibration_plots(r),
    Compensated: lambda r, _: result.compensated_plots(r),
    Diagnosis: lambda r, _: diagnosis.diagnosis_plots(r),
}


def _link_sources(entries: list[PageEntry]) -> None:
    """Say of each source whether the file on this page is the very one."""
    by_hash = {entry.sha256: entry for entry in entries}
    names = {entry.name for entry in entries}
    for entry in entries:
        for source in entry.record.provenance.sources:
            if source.sha256 in by_hash:
                said = f"is {by_hash[source.sha256].name} on this page"
            else:
                said = (
                    "a file of this name on this page has other content"
                    if plain(source.name) in names
                    else "not on this page"
                )
            entry.sources.append(
                (plain(source.name), plain(source.kind), plain(source.sha256), said)
            )


def _render(entries: list[PageEntry], answers: list[Shown], truth: bool, full: bool) -> str:
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["size"] = _size
    script = "".join((FOLDER / name).read_text(encoding="utf-8") for name in SCRIPTS)
    order = ["valid", "suspect", "refused"]
    kinds = [cls.kind for cls in KINDS]
    groups = [(kind, [e for e in entries if e.record.kind == kind]) for kind in kinds]
    history = list(dict.fromkeys(line for e in entries for line in e.provenance["history"]))
    chain: list[ShownStep] = list_steps(
        [(e.record.kind, e.record.status) for e in entries], history
    )
    gyros = sorted({plain(getattr(e.record, "gyro_id", "")) for e in entries} - {""})
    return environment.get_template("page.html").render(
        entries=entries,
        answers=answers,
        cited=cited,
        as_text=as_text,
        shade=SHADES,
        full=full,
        reasons=_reasons(entries),
        number=number,
        groups=[(kind, found) for kind, found in groups if found],
        step_of={kind: name for kind, _, name in STEPS},
        chain=chain,
        history=history,
        gyros=gyros,
        worst=max((e.record.status for e in entries), key=order.index),
        truth=truth,
        version=__version__,
        css=Markup((FOLDER / "page.css").read_text(encoding="utf-8")),
        script=Markup(script),
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        plain=plain,
    )


def _reasons(entries: list[PageEntry]) -> list[tuple[str, str, list[str]]]:
    """Every reason once: (status, reason, the files that give it); what a result inherits from its
    inputs is told at the input."""
    doubted = {entry.name for entry in entries if entry.record.status != "valid"}
    found: dict[tuple[str, str], list[str]] = {}
    for entry in entries:
        for reason in map(plain, entry.record.status_reasons):
            if reason.split(" is ", 1)[0] not in doubted:
                found.setdefault((entry.record.status, reason), []).append(entry.name)
    return [(status, reason, names) for (status, reason), names in found.items()]


def _size(count: int) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000 or unit == "GB":
            return f"{count:.3g} {unit}" if count < 1000 else f"{count:.0f} {unit}"
        count = count / 1000  # type: ignore[assignment]
    raise AssertionError
