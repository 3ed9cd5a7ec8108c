"""The work of a search, counted in motions computed, so that it ends at the same place on every
machine."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar


class WorkSpentError(Exception):
    """All motions that a search may compute are computed; no `HrgError`, which fits are given up
    for one by one."""


_left: ContextVar[list[int] | None] = ContextVar("motions left", default=None)


@contextmanager
def limit_motions(motions: int) -> Iterator[None]:
    """Fits within may compute so many motions together: the work of a search that leads nowhere
    ends, at the same place on every machine.

    WorkSpentError: from the fit that asks for one more.
    """
    token = _left.set([motions, motions])
    try:
        yield
    finally:
        _left.reset(token)


def spend_motion() -> None:
    """One more motion. WorkSpentError: it is one too many."""
    left = _left.get()
    if left is None:
        return
    left[0] -= 1
    if left[0] < 0:
        raise WorkSpentError(f"the search for causes was stopped after {left[1]} fitted motions")
