"""How long an action takes, as all benchmarks measure it."""

import os
import resource
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence


def best(
    action: Callable[[], object],
    times: int = 3,
    clock: Callable[[], float] = time.perf_counter,
) -> float:
    """Shortest of several runs [s]; by `time.process_time` other programs hardly change it."""
    taken = []
    for _ in range(times):
        start = clock()
        action()
        taken.append(clock() - start)
    return min(taken)


def processor_seconds(command: Sequence[str], extra: Mapping[str, str] | None = None) -> float:
    """Processor time of a process of its own, children and all [s]; `extra` in its environment."""
    # both processes keep their compiled modules, as a user's do: else each compiles them anew
    kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    environment = {**kept, **(extra or {})}
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=environment)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
