"""Times as the ledger keeps them: ISO 8601, to the second, UTC."""

from __future__ import annotations

from datetime import UTC, datetime


def parse_time(text: str) -> float:
    """Seconds since 1970 of a time as text.

    Parameters
    ----------
    text
        ISO 8601; one without a zone is UTC.

    Returns
    -------
    float
        s.

    Examples
    --------
    >>> from hrg_cli.ledger.times import parse_time
    >>> parse_time("1970-01-02T00:00:00"), parse_time("1970-01-01T01:00:00+01:00")
    (86400.0, 0.0)
    """
    found = datetime.fromisoformat(text)
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


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
