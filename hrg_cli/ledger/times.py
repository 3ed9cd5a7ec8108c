"""Times as the ledger keeps them: ISO 8601, to the second, UTC."""

from __future__ import annotations

from datetime import UTC, datetime


def format_time(seconds: float) -> str:
    """The text of seconds since 1970.

    Parameters
    ----------
    seconds
        [s]

    Returns
    -------
    str
        ISO 8601, to the second, UTC.

    Examples
    --------
    >>> from hrg_cli.ledger.times import format_time
    >>> format_time(86400.0)
    '1970-01-02T00:00:00Z'
    """
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
