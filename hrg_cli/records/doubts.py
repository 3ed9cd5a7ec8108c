"""What a result inherits from the records it is made of: it is no surer than they are."""

from __future__ import annotations

from collections.abc import Container, Iterable

from .record import Record

IS, MORE = " is ", " more inputs are suspect or refused"
"""What follows a record's name in a doubt about it, and the number of those that are not named."""
NAMED = 6
"""Doubtful records that are named one by one; the rest are counted."""


def name_record(record: Record) -> str:
    """What a sentence calls a record whose file is not known.

    Parameters
    ----------
    record
        A wave is named by its run, any other record by its kind.

    Returns
    -------
    str
        With its article.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.records.doubts import name_record
    >>> run = Recording(
    ...     c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free", run_id="left"
    ... )
    >>> name_record(run)
    'the recording of run left'
    """
    run = f" of run {record.run_id or '?'}" if hasattr(record, "run_id") else ""
    return f"the {record.kind}{run}"


def list_doubts(records: Iterable[tuple[str, Record]]) -> list[str]:
    """What is suspect or refused among the records that a result is made of.

    Parameters
    ----------
    records
        What a sentence calls each, and the record.

    Returns
    -------
    list of str
        One sentence a record with its last reason, which is the worst; from `NAMED` on a count.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.records.doubts import list_doubts
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> list_doubts([("left.h5", run.judged(["the screws were loose"])), ("right.h5", run)])
    ['left.h5 is suspect: the screws were loose']
    """
    doubted = [(name, record) for name, record in records if record.status != "valid"]
    sentences = [
        f"{name}{IS}{record.status}:"
        f" {record.status_reasons[-1] if record.status_reasons else 'no reason is given'}"
        for name, record in doubted[:NAMED]
    ]
    if len(doubted) > NAMED:
        sentences.append(f"{len(doubted) - NAMED}{MORE}")
    return sentences


def is_inherited(sentence: str, doubted: Container[str]) -> bool:
    """Whether a sentence of `list_doubts` tells of one of these records, or counts those that it
    does not name.

    Parameters
    ----------
    sentence
        A reason of a result's status.
    doubted
        Names of the records whose doubts are told where they stand.

    Returns
    -------
    bool
        True: whoever reads of those records has read this.

    Examples
    --------
    >>> from hrg_cli.records.doubts import is_inherited
    >>> is_inherited("left.h5 is suspect: the screws were loose", {"left.h5"})
    True
    >>> is_inherited("the rate is not known", {"left.h5"})
    False
    """
    return sentence.split(IS, 1)[0] in doubted or sentence.endswith(MORE)
