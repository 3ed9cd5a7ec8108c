"""The figures of a report's files, drawn one after another as long as there is room."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from markupsafe import Markup

from .. import store
from ..records import (
    Calibration,
    Compensated,
    Diagnosis,
    Periods,
    Record,
    Recording,
    Resonator,
    Wave,
)
from .figures import calibration, diagnosis, periods, recording, result, wave
from .figures.drawing import Plot, use_style, write_svg
from .page_files import PageEntry, Picture, drop_repeats, thin_out
from .text import clean_text

PAGE_BYTES = 2_600_000
"""Figures beyond this are left out of the page, least important first, and the page says so."""
DRAWN_OF_A_KIND = 4
"""Files of one kind whose figures are drawn; the others are in the tables."""
RESULTS_FIRST = (
    "diagnosis",
    "calibration",
    "resonator",
    "compensated",
    "wave",
    "recording",
    "periods",
)


@dataclass(frozen=True)
class Beside:
    """What the other files on the page say about a file: truth by run, and the runs whose periods
    are shown."""

    truths: dict[str, Recording]
    demodulated: frozenset[str]


def draw_files(paths: Sequence[Path], entries: list[PageEntry], truth: bool) -> None:
    """Draw the figures of every file of a page, results first, as long as there is room.

    Parameters
    ----------
    paths
        Files of the page.
    entries
        What the page tells of them, to which the figures are added.
    truth
        Whether what a simulation knows is shown.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.reporting.page_figures import draw_files
    >>> from hrg_cli.reporting.page_files import describe_file
    >>> c = np.cos(0.3 * np.arange(999))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "run.h5"
    ...     _ = store.write(path, Recording(c=c, s=c, sample_rate_hz=1e4, mode="free"))
    ...     entries = [describe_file(path, 0, full=True)]
    ...     draw_files([path], entries, truth=False)
    >>> len(entries[0].pictures) > 0, entries[0].pictures[0].svg.startswith("<svg")
    (True, True)
    """
    beside = look_beside(paths, entries, truth)
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
        for plot in draw_file(paths[index], beside):
            picture = make_picture(plot, f"f{index}-{plot.key}")
            if len(picture.svg) > room:
                entry.left_out += 1
                continue
            room -= len(picture.svg)
            entry.pictures.append(picture)


def make_picture(plot: Plot, anchor: str) -> Picture:
    """A figure as a page holds it.

    Parameters
    ----------
    plot
        The figure.
    anchor
        By which the page links to it.

    Returns
    -------
    Picture
        With its SVG and its words.

    Examples
    --------
    >>> from hrg_cli.reporting.page_figures import make_picture
    >>> from hrg_cli.reporting.figures.drawing import Plot, make_panels, use_style
    >>> with use_style():
    ...     picture = make_picture(Plot("k", "Drift", "It is small.", make_panels()[0]), "f0-k")
    >>> picture.title, picture.svg.startswith("<svg")
    ('Drift', True)
    """
    return Picture(
        anchor, clean_text(plot.title), clean_text(plot.caption), Markup(write_svg(plot, anchor))
    )


def look_beside(paths: Sequence[Path], entries: list[PageEntry], truth: bool) -> Beside:
    """What the other files of a page say about a file.

    Parameters
    ----------
    paths
        Files of the page.
    entries
        What the page tells of them.
    truth
        Whether the truths of recordings are asked for.

    Returns
    -------
    Beside
        Truths by run, and the runs that have periods.

    Examples
    --------
    >>> from pathlib import Path
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.reporting.page_figures import look_beside
    >>> look_beside([Path("run.h5")], [Told(record=Told(run_id="a"))], truth=False).truths
    {}
    """
    truths = {}
    for path, entry in zip(drop_repeats(paths), entries):
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


def draw_file(path: Path, beside: Beside) -> Iterator[Plot]:
    """The figures of a file, drawn one after another.

    Parameters
    ----------
    path
        A file that hrg wrote.
    beside
        What the others say about it.

    Returns
    -------
    iterator of Plot
        In the order of the page.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.reporting.page_figures import Beside, draw_file
    >>> c = np.cos(0.3 * np.arange(999))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "run.h5"
    ...     _ = store.write(path, Recording(c=c, s=c, sample_rate_hz=1e4, mode="free"))
    ...     plots = list(draw_file(path, Beside({}, frozenset())))
    >>> len(plots)
    3
    """
    with store.open_record(path, store.find_kind(path)) as record, use_style():
        record = thin_out(record)
        draw = _DRAW[type(record)]
        yield from draw(record, beside)


_DRAW: dict[type[Record], Callable[..., list[Plot]]] = {
    Recording: lambda r, beside: recording.plot_recording(r, bool(beside.truths)),
    Periods: lambda r, _: periods.plot_periods(r),
    Wave: lambda r, beside: wave.plot_wave(
        r, beside.truths.get(r.run_id), r.run_id not in beside.demodulated
    ),
    Resonator: lambda r, _: result.plot_resonator(r),
    Calibration: lambda r, _: calibration.plot_calibration(r),
    Compensated: lambda r, _: result.plot_compensated(r),
    Diagnosis: lambda r, _: diagnosis.plot_diagnosis(r),
}
