"""Work shared among processes through the interface of `concurrent.futures`: inline, local
processes, or Dask distributed.

A task whose process was killed is done again: first with the others that were lost, then alone; a
task that kills its process even alone is given up, the others are not touched by it.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import os
import signal
import threading
import time
import uuid
import warnings
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from . import threads
from .errors import HrgError
from .extras import PlainPythonWarning, tell_how_to_install

Task = TypeVar("Task")
Result = TypeVar("Result")
OpenExecutor = Callable[[], contextlib.AbstractContextManager[Executor]]
CONNECT_S = 15
"""Seconds to wait for a scheduler."""
WORKERS_S = 60
"""Seconds to wait for a scheduler's first worker, or for another after the last one left."""
LOOK_S = 5.0
"""Seconds between two looks at whether anybody is still working."""
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


def _end_with_parent() -> None:
    """In a worker: the terminal's Ctrl-C and words are the parent's, and the worker ends when the
    parent does, however it ended."""
    warnings.filterwarnings("ignore", category=PlainPythonWarning)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        assert parent is not None
        parent.join()
        os._exit(1)

    if parent is not None:
        threading.Thread(target=watch, daemon=True).start()


class _Processes(ProcessPoolExecutor):
    """Processes of this machine: each has a task at hand when it has ended one."""

    def __init__(self, jobs: int, **options: Any) -> None:
        super().__init__(jobs, **options)
        self.room = 2 * jobs


@contextlib.contextmanager
def start_processes(jobs: int) -> Iterator[Executor]:
    """Processes of this machine with one thread each; this process itself for one.

    They end with this process. Left by an exception (Ctrl-C, a full disk), what is pending is
    dropped and what runs is killed at once.

    Parameters
    ----------
    jobs
        How many.

    Returns
    -------
    context manager
        Of an `Executor`.

    Examples
    --------
    >>> from hrg_cli.executors import start_processes
    >>> with start_processes(1) as executor:
    ...     executor.submit(sum, [1, 2]).result()
    3
    """
    if jobs == 1:
        yield InlineExecutor()
        return
    before = {name: os.environ.get(name) for name in threads.NAMES}
    os.environ.update(dict.fromkeys(threads.NAMES, "1"))
    try:
        pool = _Processes(
            jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_end_with_parent
        )
        before_us = set(multiprocessing.active_children())
        try:
            yield pool
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in set(multiprocessing.active_children()) - before_us:
                child.kill()
                child.join()
            raise
        finally:
            pool.shutdown(wait=True)
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.__setitem__(name, value)


class DaskExecutor(Executor):
    """A Dask client as an executor that notices when nobody is left to work."""

    def __init__(self, client: Any, where: str) -> None:
        self._client, self._where = client, where
        self._inner = client.get_executor(pure=False, retries=2)
        self._alone_since: float | None = None
        self._room, self._counted = 1, -math.inf

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """The future of fn(*args, **kwargs) on a worker; a task that has a `title` bears it on
        Dask's dashboard."""
        title = getattr(args[0], "title", "") if args else ""
        named = {"key": f"{title}-{uuid.uuid4().hex}"} if title else {}
        future: Future[Any] = self._inner.submit(fn, *args, **kwargs, **named)
        return future

    @property
    def room(self) -> int:
        """Two tasks a worker's thread; workers that come and go are counted now and then."""
        if time.monotonic() - self._counted >= LOOK_S:
            threads = self._client.nthreads()
            self._room, self._counted = max(1, 2 * sum(threads.values())), time.monotonic()
        return self._room

    def need_workers(self) -> None:
        """HrgError: for `WORKERS_S` the scheduler has had no worker."""
        if self._client.scheduler_info()["workers"]:
            self._alone_since = None
            return
        self._alone_since = self._alone_since or time.monotonic()
        if time.monotonic() - self._alone_since >= WORKERS_S:
            raise HrgError(
                f"{self._where}: the Dask scheduler has had no worker for {WORKERS_S:g} s; start"
                f" one with `dask worker {self._where}`, the same command then goes on"
            )

    def drop(self) -> None:
        """Give up what is pending."""
        self._inner.shutdown(wait=False, cancel_futures=True)


@contextlib.contextmanager
def connect_dask(address: str | None, jobs: int) -> Iterator[Executor]:
    """Dask's workers as an executor.

    Parameters
    ----------
    address
        Of a running scheduler; None: workers are started here.
    jobs
        How many are started here.

    Returns
    -------
    context manager
        Of an `Executor`.

    Raises
    ------
    HrgError
        Dask is missing, or no scheduler is there.

    Examples
    --------
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.executors import connect_dask
    >>> try:
    ...     with connect_dask("nowhere", 1):
    ...         pass
    ... except HrgError as error:
    ...     print(str(error).split(" (")[0])
    nowhere: no Dask scheduler answers there
    """
    try:
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise HrgError(
            f"sharing work with Dask needs {tell_how_to_install('distributed')}"
        ) from error
    cluster = None
    with _quiet_distributed(), contextlib.ExitStack() as closing:
        if address is None:
            with _interrupts_held_back():
                cluster = LocalCluster(
                    n_workers=jobs, threads_per_worker=1, processes=True, dashboard_address=None
                )  # type: ignore[no-untyped-call]
            closing.callback(cluster.close)  # type: ignore[no-untyped-call]
        try:
            client = Client(address or cluster, timeout=CONNECT_S)  # type: ignore[no-untyped-call]
        except (OSError, TimeoutError, ValueError) as error:
            raise HrgError(
                f"{address}: no Dask scheduler answers there ({error}); start one with `dask"
                " scheduler`, or leave --scheduler out"
            ) from error
        closing.callback(client.close)  # type: ignore[no-untyped-call]
        executor = DaskExecutor(client, address or "the cluster started here")
        try:
            yield executor
        except BaseException:
            with contextlib.suppress(Exception):
                executor.drop()
            raise


@contextlib.contextmanager
def _interrupts_held_back() -> Iterator[None]:
    """Ctrl-C reaches every process of a terminal: workers started in here, and by threads started
    in here, leave it to this one, which ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # started later, it would let them through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


WORKERS_LOG = "DASK_LOGGING__DISTRIBUTED"
"""What Dask's workers, processes of their own, take the level of their logs from."""


@contextlib.contextmanager
def _quiet_distributed() -> Iterator[None]:
    """Dask logs lost connections and closed loops with tracebacks, also at the end of a good run;
    here a result or a sentence counts."""
    import logging

    names = (
        "distributed",
        "distributed.nanny",
        "distributed.worker",
        "distributed.scheduler",
        "distributed.core",
        "distributed.client",
    )
    loggers = [
        logging.getLogger(name)
        for name in (
            *names,
            "distributed.comm",
            "distributed.utils",
            "tornado.application",
            "asyncio",
        )
    ]
    before = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    theirs = os.environ.get(WORKERS_LOG)
    os.environ[WORKERS_LOG] = "critical"
    try:
        yield
    finally:
        for logger, level in zip(loggers, before):
            logger.setLevel(level)
        if theirs is None:
            os.environ.pop(WORKERS_LOG, None)
        else:
            os.environ[WORKERS_LOG] = theirs


def run_tasks(
    work: Callable[[Task], Result],
    tasks: Sequence[Task],
    open_executor: OpenExecutor,
    done: Callable[[int], None] = lambda count: None,
    then: Callable[[Task, Result | None], Sequence[Task]] = lambda task, result: (),
) -> list[Result | None]:
    """The results of a function over tasks, each done in a process that may be killed.

    Parameters
    ----------
    work
        Its exceptions are raised: it is its duty to report its own failures as results.
    tasks
        One argument each.
    open_executor
        Opens what they are done by; again after a process was killed.
    done
        Called with how many are done.
    then
        Called with a task that ended and its result: tasks that follow from it. They go before
        those that wait, and are told to `then` in their turn.

    Returns
    -------
    list
        In the tasks' order; None where its process was killed even when it ran alone.

    Examples
    --------
    >>> from hrg_cli.executors import run_tasks, start_processes
    >>> run_tasks(abs, [-1, 2], lambda: start_processes(1))
    [1, 2]
    """
    every = list(tasks)
    results: dict[int, Result | None] = {}
    ready, alone = deque(range(len(every))), deque[int]()
    losses: Counter[int] = Counter()

    def ended(index: int, result: Result | None) -> None:
        results[index] = result if index < len(tasks) else None
        following = then(every[index], result)
        ready.extendleft(reversed(range(len(every), len(every) + len(following))))
        every.extend(following)
        done(len(results))

    while ready or alone:
        queue = ready or deque([alone.popleft()])
        last = queue is not ready
        with open_executor() as executor:
            lost = _together(executor, work, every, queue, ended)
        losses.update(lost)
        for index in reversed(lost):
            if last:
                ended(index, None)
            else:
                (ready if losses[index] < ROUNDS else alone).appendleft(index)
    return [results[index] for index in range(len(tasks))]


class _Lost:
    """In place of a result: the process was killed."""


def _together(
    executor: Executor,
    work: Callable[[Any], Any],
    every: Sequence[Any],
    queue: deque[int],
    ended: Callable[[int, Any], None],
) -> list[int]:
    """Work off the queue, which may grow meanwhile, until it is empty or the executor is broken;
    the tasks whose process was killed."""
    running: dict[Future[Any], int] = {}
    lost: list[int] = []
    broken = False
    while running or (queue and not broken):
        while queue and not broken and len(running) < _room(executor):
            try:
                running[executor.submit(work, every[queue[0]])] = queue[0]
                queue.popleft()
            except (BrokenExecutor, RuntimeError):
                broken = True
        over, _ = wait(running, timeout=LOOK_S, return_when=FIRST_COMPLETED)
        if not over and isinstance(executor, DaskExecutor):
            executor.need_workers()
        for future in over:
            index, result = running.pop(future), _result(future)
            if isinstance(result, _Lost):
                lost.append(index)
            else:
                ended(index, result)
    if broken and not lost:
        lost.append(queue.popleft())  # it could not even be begun
    return lost


def _room(executor: Executor) -> int:
    """Tasks that an executor is given at once: so few that what follows from one that ended is soon
    begun, so many that nobody waits."""
    return int(getattr(executor, "room", 1))


def _result(future: Future[Any]) -> Any:
    try:
        return future.result()
    except (BrokenExecutor, CancelledError):
        return _Lost()
    except Exception as error:
        if type(error).__name__ not in ("KilledWorker", "CommClosedError", "FutureCancelledError"):
            raise
        return _Lost()
