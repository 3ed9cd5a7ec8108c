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
    """Fits within may compute so many motions together.

    The work of a search that leads nowhere ends, at the same place on every machine: a limit in
    seconds would end it elsewhere on a slower one.

    Parameters
    ----------
    motions
        How many.

    Returns
    -------
    context manager
        Within it `spend_motion` counts.

    Raises
    ------
    WorkSpentError
        From the fit that asks for one more.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.motion_budget import WorkSpentError, limit_motions, spend_motion
    >>> with limit_motions(2):
    ...     for number in range(3):
    ...         try:
    ...             spend_motion()
    ...         except WorkSpentError as error:
    ...             print(number, error)
    2 the search for causes was stopped after 2 fitted motions
    """
    token = _left.set([motions, motions])
    try:
        yield
    finally:
        _left.reset(token)


def spend_motion() -> None:
    """Count one more motion; outside `limit_motions` nothing is counted.

    Raises
    ------
    WorkSpentError
        It is one too many.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.motion_budget import limit_motions, spend_motion
    >>> with limit_motions(1):
    ...     spend_motion()
    """
    left = _left.get()
    if left is None:
        return
    left[0] -= 1
    if left[0] < 0:
        raise WorkSpentError(f"the search for causes was stopped after {left[1]} fitted motions")
