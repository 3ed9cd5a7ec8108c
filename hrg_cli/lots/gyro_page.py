"""The page of one gyro of a lot beside its results, and what the lot's table says of its answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .. import memory, store
from ..extras import tell_lack_of_pages
from ..holding import hold
from ..reporting.answer import Answer, answer
from ..reporting.quantities import LABELS, RATE_OF_DECAY

PAGE = "report.html"


def answer_gyro(
    files: Sequence[Path], limits: Mapping[str, Any], epoch: int | None
) -> dict[str, Any]:
    """Write the page of a gyro's results into their folder, unless it was written before.

    Parameters
    ----------
    files
        The results.
    limits
        What the lot's file wants of them, by kind.
    epoch
        The time that the lot orders, s since 1970; None: the true one.

    Returns
    -------
    dict
        Sentence, health, causes with their shares, error before and after, limits missed; nothing
        where there is no result.

    Examples
    --------
    >>> from hrg_cli.lots.gyro_page import answer_gyro
    >>> answer_gyro([], {}, None)
    {}
    """
    if not files:
        return {}
    page = files[0].with_name(PAGE)
    note = page.with_suffix(".json")
    key = memory.make_key([limits, epoch], files)
    done = memory.recall(note, key)
    if done is not None:
        return done
    records = [store.read_any(path) for path in files]
    rows = [row for held in hold(records, limits) for row in held]
    pageless = tell_lack_of_pages()
    if not pageless:
        from ..reporting.page import build_report

        text = build_report(files, rows=rows)
        with store.write_whole(page, force=True) as temporary:
            temporary.write_text(text, encoding="utf-8")
    found = answer(records, rows, {r.kind: p.name for r, p in zip(records, files, strict=True)})
    result = {} if found is None else _short(found) | {"missed": _missed(found)}
    if not pageless:
        memory.remember(note, key, result, [page])
    return result


def _missed(found: Answer) -> list[str]:
    """The limits that the gyro misses, in people's units."""
    return [
        f"{r.label} {r.value}, {'limit' if r.limit[:1] in '≥≤' else 'wanted'} {r.limit}"
        for r in found.requirements
        if not r.passed
    ]


def label_figure(name: str) -> str:
    """A figure in words.

    Parameters
    ----------
    name
        Of a column of the table.

    Returns
    -------
    str
        What people call it.

    Examples
    --------
    >>> from hrg_cli.lots.gyro_page import label_figure
    >>> label_figure("values.gain_mismatch.value")
    'gain mismatch'
    """
    stem = name.removeprefix("values.").removesuffix(".value")
    if stem == "damping_rate_1_s":  # its values and limits are rates
        return RATE_OF_DECAY
    return LABELS.get(stem, stem.replace("_", " "))


def _short(found: Answer) -> dict[str, Any]:
    """What the table needs of an answer."""
    departure = found.departure
    whole = departure.before if departure is not None else 0.0
    causes = []
    for cause in found.causes:
        share = getattr(cause, departure.key) if departure is not None else None
        causes.append(
            {
                "name": cause.name,
                "size": cause.size,
                "share": min(1.0, share / whole) if share is not None and whole > 0 else None,
                "rivals": list(cause.rivals),
            }
        )
    return {
        "sentence": found.sentence,
        "health": found.health,
        "causes": causes,
        "departure": None
        if departure is None
        else {
            "words": departure.words,
            "unit": departure.unit,
            "before": departure.before,
            "after": departure.after,
        },
    }
