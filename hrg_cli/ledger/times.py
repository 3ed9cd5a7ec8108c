"""Times as the ledger keeps them: ISO 8601, to the second, UTC."""

from __future__ import annotations

from datetime import UTC, datetime


def moment(text: str) -> float:
    """Seconds since 1970 of an ISO 8601 time; one without a zone is UTC. ValueError: it is none."""
    found = datetime.fromisoformat(text)
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def iso(seconds: float) -> str:
    """The text of seconds since 1970."""
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
