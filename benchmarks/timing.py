"""How long an action takes, as all benchmarks measure it."""

import time
from collections.abc import Callable


def best(action: Callable[[], object], times: int = 3) -> float:
    """Shortest of several runs [s]."""
    taken = []
    for _ in range(times):
        start = time.perf_counter()
        action()
        taken.append(time.perf_counter() - start)
    return min(taken)
