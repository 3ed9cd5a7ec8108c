"""The answer of every gyro on a report: its words, its figures, the data of those that move."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import store
from ..limits import Row
from ..records import Calibration, Diagnosis, Record, Resonator
from ..records.replaced import EXTENDED
from .answer import Answer, answer
from .figures import calibration
from .figures.answer import plot_before_and_after
from .figures.drawing import Plot, use_style
from .living import gather_living_data
from .methods_paragraph import Methods, write_methods
from .page_figures import make_picture
from .page_files import PageEntry, Picture
from .surface import gather_surface_data

ANSWERING = ("diagnosis", "calibration", "resonator", "compensated")
"""Kinds of files that are a result."""


@dataclass(frozen=True)
class Shown:
    """The answer of one gyro on the page: its figures, the data of those that move, the paragraph
    for a report."""

    answer: Answer
    anchor: str
    pictures: list[Picture]
    living: dict[str, Any] | None
    surface: dict[str, Any] | None
    methods: Methods


def answer_gyros(
    paths: Sequence[Path], entries: list[PageEntry], rows: Sequence[Row]
) -> list[Shown]:
    """The answer of every gyro that has a result.

    Parameters
    ----------
    paths
        Files of the page.
    entries
        What the page tells of them.
    rows
        Figures held against limits.

    Returns
    -------
    list of Shown
        In the files' order; empty where no file is a result.

    Examples
    --------
    >>> from pathlib import Path
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.reporting.page_answers import answer_gyros
    >>> answer_gyros([Path("run.h5")], [Told(record=Told(gyro_id="A", kind="recording"))], [])
    []
    """
    gyros: dict[str, dict[str, Path]] = {}
    counts: dict[str, Counter[str]] = {}
    for path, entry in zip(paths, entries):
        gyro, kind = str(getattr(entry.record, "gyro_id", "")), entry.record.kind
        counts.setdefault(gyro, Counter())[kind] += 1
        if kind in ANSWERING and not _is_extended(entry.record):
            gyros.setdefault(gyro, {})[kind] = path
    found = []
    for place, (gyro, files) in enumerate(gyros.items(), start=1):
        shown = _show(f"answer-{place}", files, counts[gyro], rows)
        if shown is not None:
            found.append(shown)
    return found


def _show(
    anchor: str, files: Mapping[str, Path], counts: Mapping[str, int], rows: Sequence[Row]
) -> Shown | None:
    """The answer of one gyro from its results by kind; None where they make none."""
    records = {kind: store.read_any(path) for kind, path in files.items()}
    made = answer(list(records.values()), rows, {kind: path.name for kind, path in files.items()})
    if made is None:
        return None
    drawn: list[Plot | None] = []
    living, surface = None, None
    with use_style():
        if isinstance(told := records.get("diagnosis"), Diagnosis):
            drawn.append(plot_before_and_after(told, made.departure, made.causes))
            living = gather_living_data(told)
        if isinstance(tables_of := records.get("calibration"), Calibration):
            drawn += calibration.plot_calibration(tables_of, first_only=True)
            surface = gather_surface_data(tables_of)
        pictures = [
            make_picture(plot, f"{anchor}-{plot.key}") for plot in drawn if plot is not None
        ]
    paragraph = write_methods(list(records.values()), counts)
    return Shown(made, anchor, pictures, living, surface, paragraph)


def _is_extended(record: Record) -> bool:
    """A resonator made beside a diagnosis, which the diagnosis speaks for."""
    return isinstance(record, Resonator) and record.method == EXTENDED


def draw_answer(path: Path) -> Iterator[Plot]:
    """The answer's figure of a diagnosis.

    Parameters
    ----------
    path
        A file that hrg wrote.

    Returns
    -------
    iterator of Plot
        Empty of other files, and of a diagnosis without rows.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.reporting.page_answers import draw_answer
    >>> made = Recording(c=np.zeros(9), s=np.zeros(9), sample_rate_hz=1e4, mode="free")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = store.write(Path(folder) / "run.h5", made)
    ...     list(draw_answer(Path(folder) / "run.h5"))
    []
    """
    if store.find_kind(path) is Diagnosis:
        record = store.read(path, Diagnosis)
        made = answer([record])
        with use_style():
            plot = (
                plot_before_and_after(record, made.departure, made.causes)
                if made is not None
                else None
            )
            if plot is not None:
                yield plot
