"""Work shared among processes through the interface of `concurrent.futures`: inline, local processes, or Dask distributed.

A task whose process was killed is done again: first with the others that were lost, then alone; a task that kills its process
even alone is given up, the others are not touched by it.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, as_completed
from typing import Any, TypeVar

from .errors import HrgError

Task = TypeVar("Task")
Result = TypeVar("Result")
OpenExecutor = Callable[[], contextlib.AbstractContextManager[Executor]]
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
CONNECT_S = 15
"""Seconds to wait for a scheduler."""
ROUNDS = 2
"""Rounds with all workers before the lost tasks are tried alone."""


class InlineExecutor(Executor):
    """Does the work at once, in this process."""

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The finished future of fn(*args, **kwargs)."""
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


@contextlib.contextmanager
def local_processes(jobs: int) -> Iterator[Executor]:
    """`jobs` processes of this machine with one thread each; this process itself for one."""
    if jobs == 1:
        yield InlineExecutor()
        return
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
            yield pool
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


@contextlib.contextmanager
def dask_workers(address: str | None, jobs: int) -> Iterator[Executor]:
    """The workers of a running scheduler (`address`), or `jobs` started here. HrgError: Dask missing, no scheduler there."""
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise HrgError("sharing work with Dask needs the library distributed; run pip install 'hrg-cli[lots]'") from error
    cluster = None
    if address is None:
        cluster = LocalCluster(n_workers=jobs, threads_per_worker=1, processes=True, dashboard_address=None)  # type: ignore[no-untyped-call]
    try:
        try:
            client = Client(address or cluster, timeout=CONNECT_S)  # type: ignore[no-untyped-call]
        except (OSError, TimeoutError, ValueError) as error:
            raise HrgError(
                f"{address}: no Dask scheduler answers there ({error}); start one with `dask scheduler`, or leave --scheduler out"
            ) from error
        with client:
            yield client.get_executor(pure=False, retries=2)
    finally:
        if cluster is not None:
            cluster.close()  # type: ignore[no-untyped-call]


def run_tasks(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    open_executor: OpenExecutor,
    done: Callable[[int], None] = lambda count: None,
) -> list[Result | None]:
    """work(task) of every task, in the tasks' order; None where its process was killed even when it ran alone.

    An exception of `work` itself is raised: it is the work's duty to report its own failures as results.
    """
    results: list[Result | None] = [None] * len(tasks)
    lost = list(range(len(tasks)))
    finished = 0
    for _ in range(ROUNDS):
        if not lost:
            return results
        with open_executor() as executor:
            again: list[int] = []
            for index, result in _round(executor, work, tasks, lost):
                if isinstance(result, _Lost):
                    again.append(index)
                else:
                    results[index] = result
                    finished += 1
                    done(finished)
        lost = sorted(again)
    for index in lost:
        with open_executor() as executor:
            for _, result in _round(executor, work, tasks, [index]):
                results[index] = None if isinstance(result, _Lost) else result
        finished += 1
        done(finished)
    return results


class _Lost:
    """In place of a result: the process was killed."""


def _round(executor: Executor, work: Callable[[Any], Any], tasks: Sequence[Any], indexes: Sequence[int]) -> Iterator[tuple[int, Any]]:
    futures: dict[Future[Any], int] = {}
    for index in indexes:
        try:
            futures[executor.submit(work, tasks[index])] = index
        except (BrokenExecutor, RuntimeError):
            yield index, _Lost()
    for future in as_completed(futures):
        try:
            yield futures[future], future.result()
        except (BrokenExecutor, CancelledError):
            yield futures[future], _Lost()
        except Exception as error:
            if type(error).__name__ not in ("KilledWorker", "CommClosedError", "FutureCancelledError"):
                raise
            yield futures[future], _Lost()
