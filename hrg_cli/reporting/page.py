"""The report: one HTML page that needs no network, or its figures alone as PNG, for any set of hrg
files.

Identical files give identical bytes: the page holds no date of its own and its figures no random
ids. Whatever a file says (names, history, reasons) is text on the page, never markup.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from .. import store
from ..errors import HrgError
from ..limits import Row
from ..records import KINDS
from .figures.drawing import write_png
from .living import dump_text
from .page_answers import Shown, answer_gyros, draw_answer
from .page_content import STEPS, ShownStep, list_steps
from .page_figures import draw_file, draw_files, look_beside
from .page_files import PageEntry, describe_file, drop_repeats
from .templates import render_page
from .text import clean_text, format_number

SCRIPTS = ("page.js", "plots.js", "living.js", "surface.js")
SHADES = {
    "sound": "valid",
    "fault found": "refused",
    "bench fault": "suspect",
    "in doubt": "suspect",
    "not examined": "skipped",
}
"""Health of a gyro -> the page's colour for it."""


def build_report(
    paths: Sequence[Path], *, truth: bool = False, full: bool = False, rows: Sequence[Row] = ()
) -> str:
    """The page of files as HTML: the answer of every gyro first, runs, files and history folded
    behind it.

    Parameters
    ----------
    paths
        Files that hrg wrote.
    truth
        Also show what a simulation knows: the truth of a recording, over the wave of the same run.
    full
        Draw the figures of every file; `truth` does too.
    rows
        Figures held against limits.

    Returns
    -------
    str
        HTML that needs no other file.

    Raises
    ------
    HrgError
        No file, or one that is missing, damaged or not an hrg file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.reporting.page import build_report
    >>> made = Recording(
    ...     c=np.zeros(99), s=np.zeros(99), sample_rate_hz=1e4, mode="free", gyro_id="A"
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = store.write(Path(folder) / "run.h5", made)
    ...     page = build_report([Path(folder) / "run.h5"])
    >>> "run.h5" in page, "<link" in page, "src=" in page
    (True, False, False)
    """
    full = full or truth
    entries = [describe_file(path, index, full) for index, path in enumerate(drop_repeats(paths))]
    answers = answer_gyros(drop_repeats(paths), entries, rows)
    if full:
        draw_files(drop_repeats(paths), entries, truth)
    _link_sources(entries)
    return _render(entries, answers, truth, full)


def write_figures(
    paths: Sequence[Path], folder: Path, force: bool = False, *, truth: bool = False
) -> list[Path]:
    """Write every figure of files as PNG, all of them or none.

    Parameters
    ----------
    paths
        Files that hrg wrote.
    folder
        Where to; it is made when missing.
    force
        Figures of these names that are there already may be replaced.
    truth
        As `build_report`.

    Returns
    -------
    list of Path
        FILE-FIGURE.png.

    Raises
    ------
    HrgError
        As `build_report`; the folder cannot be made; a figure of that name is there.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.reporting.page import write_figures
    >>> c = np.cos(0.3 * np.arange(999))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = store.write(
    ...         Path(folder) / "run.h5", Recording(c=c, s=c, sample_rate_hz=1e4, mode="free")
    ...     )
    ...     written = write_figures([Path(folder) / "run.h5"], Path(folder))
    >>> written[0].name.startswith("run-"), written[0].suffix
    (True, '.png')
    """
    folder = Path(folder)
    entries = [describe_file(path, index, False) for index, path in enumerate(drop_repeats(paths))]
    beside = look_beside(paths, entries, truth)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise HrgError(
            f"{folder}: is no folder and cannot be made one ({error.strerror}); choose another"
            " --output"
        ) from error
    written: list[Path] = []
    with ExitStack() as outputs:
        for path in drop_repeats(paths):
            for plot in itertools.chain(draw_answer(path), draw_file(path, beside)):
                target = folder / f"{_name_picture(path, plot.key)}.png"
                while target in written:
                    target = target.with_stem(target.stem + "_")
                write_png(plot, outputs.enter_context(store.write_whole(target, force)))
                written.append(target)
    return written


def _name_picture(path: Path, key: str) -> str:
    """Name of a file's figure, in characters that every file system takes."""
    return re.sub(r"[^A-Za-z0-9._-]", "_", f"{path.stem}-{key}").lstrip(".")[:120]


def find_worst_status(paths: Sequence[Path]) -> tuple[str, list[str]]:
    """Worst status of files, and why.

    Parameters
    ----------
    paths
        Files that hrg wrote.

    Returns
    -------
    tuple
        "valid", "suspect" or "refused", and every reason with its file's name.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.reporting.page import find_worst_status
    >>> made = Recording(c=np.zeros(9), s=np.zeros(9), sample_rate_hz=1e4, mode="free")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = store.write(Path(folder) / "run.h5", made.judged(["it is clipped"], "suspect"))
    ...     find_worst_status([Path(folder) / "run.h5"])
    ('suspect', ['run.h5: it is clipped'])
    """
    order = ["valid", "suspect", "refused"]
    worst, reasons = "valid", []
    for path in drop_repeats(paths):
        with store.open_record(path, store.find_kind(path)) as record:
            worst = max(worst, record.status, key=order.index)
            reasons += [f"{path.name}: {reason}" for reason in record.status_reasons]
    return worst, reasons


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
                    if clean_text(source.name) in names
                    else "not on this page"
                )
            entry.sources.append(
                (clean_text(source.name), clean_text(source.kind), clean_text(source.sha256), said)
            )


def _render(entries: list[PageEntry], answers: list[Shown], truth: bool, full: bool) -> str:
    order = ["valid", "suspect", "refused"]
    kinds = [cls.kind for cls in KINDS]
    groups = [(kind, [e for e in entries if e.record.kind == kind]) for kind in kinds]
    history = list(dict.fromkeys(line for e in entries for line in e.provenance["history"]))
    chain: list[ShownStep] = list_steps(
        [(e.record.kind, e.record.status) for e in entries], history
    )
    gyros = sorted({clean_text(getattr(e.record, "gyro_id", "")) for e in entries} - {""})
    return render_page(
        "page.html",
        SCRIPTS,
        entries=entries,
        answers=answers,
        as_text=dump_text,
        shade=SHADES,
        full=full,
        reasons=_reasons(entries),
        number=format_number,
        groups=[(kind, found) for kind, found in groups if found],
        step_of={kind: name for kind, _, name in STEPS},
        chain=chain,
        history=history,
        gyros=gyros,
        worst=max((e.record.status for e in entries), key=order.index),
        truth=truth,
    )


def _reasons(entries: list[PageEntry]) -> list[tuple[str, str, list[str]]]:
    """Every reason once: (status, reason, the files that give it); what a result inherits from its
    inputs is told at the input."""
    doubted = {entry.name for entry in entries if entry.record.status != "valid"}
    found: dict[tuple[str, str], list[str]] = {}
    for entry in entries:
        for reason in map(clean_text, entry.record.status_reasons):
            if reason.split(" is ", 1)[0] not in doubted:
                found.setdefault((entry.record.status, reason), []).append(entry.name)
    return [(status, reason, names) for (status, reason), names in found.items()]
