"""The ledger's commands."""

from __future__ import annotations

from typing import Any

from .shape import Common, Number


class LedgerAdd(Common):
    """`hrg ledger add`."""

    ledger: str
    """The ledger."""
    added: int
    """Results entered."""
    known: int
    """Results that were there already, by SHA-256."""
    files: list[dict[str, Any]]
    """Each file: gyro_id, kind, status, true times, station and so on, sha256, whether it is
    new."""


class LedgerShow(Common):
    """`hrg ledger show`."""

    ledger: str
    """The ledger."""
    entries: int
    """Results told of."""
    refused: int
    """Results left out because they are refused."""
    reprocessed: int
    """Results left out because the same samples were processed again later."""
    false_alarms_expected: Number
    """Points beyond 3 σ to expect by chance in all charts."""
    gyros: list[dict[str, Any]]
    """Each gyro's last result, what moved most in σ since the one before, what is farthest from the
    gyro's own history and since when, and its limits."""
    figures: list[dict[str, Any]]
    """Each figure: chart, capability, gauge study, risks."""
    golden: list[dict[str, Any]]
    """With --golden: the golden unit's drift at each station."""


class LedgerHistory(Common):
    """`hrg ledger history`."""

    ledger: str
    """The ledger."""
    gyro_id: str
    """The gyro."""
    entries: list[dict[str, Any]]
    """Each result; counts: whether it is the last of its samples."""
    figures: list[dict[str, Any]]
    """Each figure over time: values, σ, moves in σ and in shares of the limit, how far it is from
    its own history and since when, chart."""
    limits: list[dict[str, Any]]
    """The last result against limits."""
