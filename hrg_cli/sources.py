"""The inputs of a command: what they are, that they hold no samples twice, and that they stay as
they are while they are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from threading import Event
from typing import Any

from . import store
from .errors import EACH_RUN_ONCE, HrgError, NotHrgError
from .origins import find_samples, find_shared, name_part
from .records import KINDS, Periods, Recording, Source, Wave


class Sources:
    """The inputs' names, kinds and SHA-256, hashed in the background while the stage reads them; a
    changed input is an error.

    taken: the command's settings; a part cut out of a recording (from_s, to_s) is told from its
    other parts by them.
    """

    def __init__(self, paths: Sequence[Path], taken: Mapping[str, Any] | None = None) -> None:
        self._paths = [Path(p) for p in paths]
        self._pool = ThreadPoolExecutor(1)
        self._failed = Event()
        self._part = name_part(taken or {})

    def __enter__(self) -> Sources:
        for place, path in enumerate(self._paths):
            store.need_readable(path)
            if path in self._paths[:place]:
                raise HrgError(f"{path}: is the same data as {path}; {_say_once(path)}")
        self._before = [self._stamp(p) for p in self._paths]
        self._hashes: list[Future[str]] = [
            self._pool.submit(store.compute_sha256, p, self._failed) for p in self._paths
        ]
        self._samples = [find_samples(path, self._part) for path in self._paths]
        for first, second in find_shared(self._samples):
            path, other = self._paths[second], self._paths[first]
            if other != path and _kind_name(path) == _kind_name(other):
                raise HrgError(
                    f"{path}: is the same data as {other}, both go back to the same samples;"
                    f" {_say_once(path)}"
                )
        return self

    def __exit__(self, *exception: object) -> None:
        if exception[0] is not None:
            self._failed.set()  # a failed command does not wait for gigabytes to be hashed
        self._pool.shutdown(wait=True, cancel_futures=True)

    @staticmethod
    def _stamp(path: Path) -> tuple[int, int]:
        stat = path.stat()
        return stat.st_size, stat.st_mtime_ns

    def finish(self) -> tuple[Source, ...]:
        """The sources, after checking that none changed since the command began."""
        hashes = [future.result() for future in self._hashes]
        for path, before in zip(self._paths, self._before):
            if not path.exists() or self._stamp(path) != before:
                raise HrgError(
                    f"{path}: changed while it was read; run the command again when it is whole"
                )
        first: dict[str, Path] = {}
        for path, digest in zip(self._paths, hashes):
            if digest in first:
                raise HrgError(f"{path}: is the same data as {first[digest]}; {_say_once(path)}")
            first[digest] = path
        return tuple(
            Source(path.name, _kind_name(path), digest, samples)
            for path, digest, samples in zip(self._paths, hashes, self._samples)
        )


RESULTS = {cls.kind for cls in KINDS} - {Recording.kind, Periods.kind, Wave.kind}
"""Kinds of files that hold no run's rows, of which each counts in the errors."""


def _say_once(path: Path) -> str:
    """What to do about an input that is there twice."""
    kind = _kind_name(path)
    if kind in RESULTS:
        return f"two {kind} files of different runs were expected: name another, or leave one out"
    return EACH_RUN_ONCE


def _kind_name(path: Path) -> str:
    try:
        return store.find_kind(path).kind
    except NotHrgError:
        return path.suffix.lstrip(".").lower() or "file"
