"""What is said of a run that is not what it says it is."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any


@dataclass(frozen=True)
class Suspicion:
    """A run (or all: "all runs") that is wrong: in few words what, the figures that show it, and
    what to do."""

    run_id: str
    what: str
    evidence: str
    correction: str

    def to_json(self) -> dict[str, Any]:
        """The suspicion as the JSON has it."""
        return asdict(self)

    @property
    def sentence(self) -> str:
        """All of it for a person."""
        return f"{self.run_id}: {self.what} ({self.evidence}); {self.correction}"
