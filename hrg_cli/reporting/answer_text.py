"""The answer in a terminal: the sentence, the two words, then short tables; nothing longer than two
lines."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from .answer import Answer
from .console import print_table, say
from .text import drop_empty_columns, format_number


def show(found: Answer, folder: Path = Path()) -> None:
    """Print an answer: the sentence, health and validity, then short tables.

    Parameters
    ----------
    found
        The answer.
    folder
        Where the files lie that it tells what to do with.

    Examples
    --------
    >>> import contextlib, io
    >>> import numpy as np
    >>> from hrg_cli import Resonator, answer
    >>> from hrg_cli.reporting.answer_text import show
    >>> found = Resonator(
    ...     name=np.array(["scale_factor"]), units=np.array(["1"]), value=np.array([0.55]),
    ...     std=np.array([1e-3]), covariance=np.array([[1e-6]]),
    ... )
    >>> with contextlib.redirect_stdout(io.StringIO()) as shown:
    ...     show(answer([found]))
    >>> "fit: valid" in shown.getvalue()
    True
    """
    say(found.sentence.replace(". ", ".\n"))
    say(
        f"gyro: {found.health}; fit: {found.validity}"
        + (f"; verdict: {found.verdict}" if found.verdict else "")
    )
    for reason in found.why:
        say(f"  {reason}")
    if found.requirements:
        required = [
            (r.label, r.value, r.limit, _margin(r.margin_sigma), "yes" if r.passed else "NO")
            for r in found.requirements
        ]
        print_table("", ("requirement", "value", "limit", "margin, σ", "passed"), required)
    if found.causes:
        causes = [
            (
                c.words,
                c.size,
                _share(c.drift_deg_h),
                _share(c.amplitude_ppm),
                format_number(abs(c.z), 3),
                ", ".join(c.rivals).replace("_", " "),
            )
            for c in found.causes
        ]
        head = ("cause", "size", "drift, °/h", "amplitude, ppm", "σ", "cannot be told from")
        print_table("", *drop_empty_columns(head, causes))
    if found.parameters:
        print_table(
            "", (f"{found.parameters_of}", ""), [(p.label, p.text) for p in found.parameters]
        )
    if found.moved:
        moved = [(m.label, m.believed, m.measured, format_number(m.sigma, 3)) for m in found.moved]
        print_table("", ("wrong in the supplied model", "believed", "measured", "σ"), moved)
    for line in (found.forecast, *found.suspect_runs, *found.stability):
        if line:
            say(line)
    for line in found.next_runs:
        say(f"next run, {line}")
    if found.commands:
        where = "then: " if folder == Path() else f"then, in {folder}:\n      "
        say(where + "\n      ".join(found.commands))


VERDICT = re.compile(r'the verdict is "[^"]*": (.*)', re.S)


def list_untold(reasons: Sequence[str], why: Sequence[str]) -> list[str]:
    """The reasons of files that an answer's own do not tell.

    Parameters
    ----------
    reasons
        "FILE: …"
    why
        The answer's.

    Returns
    -------
    list of str
        In their order.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_text import list_untold
    >>> list_untold(["a.h5: it is clipped", "b.h5: it is short"], ["it is clipped"])
    ['b.h5: it is short']
    """
    shown = [line.removeprefix("check failed: ") for line in why]

    def is_told(reason: str) -> bool:
        text = reason.partition(": ")[2] or reason
        failed = VERDICT.fullmatch(text)
        parts = failed[1].split("; ") if failed else [text]
        return all(any(line.startswith(part) for line in shown) for part in parts)

    return [reason for reason in reasons if not is_told(reason)]


def _share(value: float | None) -> str:
    return "–" if value is None else format_number(value, 3)


def _margin(value: float | None) -> str:
    return "–" if value is None else format_number(value, 2)
