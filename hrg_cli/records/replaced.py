"""Resonators in whose place that of a diagnosis stands: what the linear one leaves is explained,
and its own values are those of a model without the causes found."""

from __future__ import annotations

from collections.abc import Sequence

from .diagnosis import Diagnosis
from .record import REHEARSAL, Record
from .resonator import Resonator

EXTENDED = "extended model"
"""Method of a resonator that a diagnosis leaves beside its file."""


def find_replaced(records: Sequence[Record]) -> list[int]:
    """Linear resonators that a diagnosis of the same waves explains, with its own resonator at
    hand.

    Parameters
    ----------
    records
        Results that are looked at together.

    Returns
    -------
    list of int
        Their places. A resonator that its rehearsal blames stays: no diagnosis explains that.

    Examples
    --------
    A resonator alone has nothing in its place:

    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.records.replaced import find_replaced
    >>> resonator = Resonator(
    ...     name=np.array(["frequency_split_rad_s"]), value=np.array([2e-3]), std=np.array([1e-4]),
    ...     units=np.array(["rad s-1"]), covariance=np.array([[1e-8]]),
    ... )
    >>> find_replaced([resonator.judged(["the linear resonator leaves more than the noise"])])
    []
    """
    gyros = {
        record.gyro_id
        for record in records
        if isinstance(record, Resonator) and record.method == EXTENDED and record.status == "valid"
    }
    explained = [
        _waves_of(record)
        for record in records
        if isinstance(record, Diagnosis)
        and (record.status, record.verdict) == ("valid", "explained")
        and record.gyro_id in gyros
    ]
    return [
        place
        for place, record in enumerate(records)
        if isinstance(record, Resonator)
        and record.method != EXTENDED
        and record.status != "valid"
        and not any(reason.startswith(REHEARSAL) for reason in record.status_reasons)
        and _waves_of(record)
        and any(_waves_of(record) <= waves for waves in explained)
    ]


def _waves_of(record: Record) -> set[str]:
    """Checksums of the waves that a result was made of."""
    return {source.sha256 for source in record.provenance.sources if source.kind == "wave"}
