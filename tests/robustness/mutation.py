"""Damaged copies of good files, and a process beside the tests that tries them."""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import psutil

import hrg_cli

HANG_S, WAITS = 10.0, 6
"""A hang: so much processor time (a busy machine is none), or six times that on the clock."""
HEADER = 4096
FRESH_MB = 500.0
"""A worker that once took so much is replaced, so that the next trial's peak is its own."""


def damaged(good: bytes, rng: np.random.Generator) -> bytes:
    """A copy with one to three damages: flipped bits, overwritten runs, huge or tiny sizes, cut,
    doubled or moved parts."""
    data = bytearray(good)
    for _ in range(int(rng.integers(1, 4))):
        if not data:
            break
        reach = min(len(data), HEADER) if rng.random() < 0.5 else len(data)
        at = int(rng.integers(reach))
        kind = int(rng.integers(8))
        if kind == 0:
            data[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            data[at] = int(rng.integers(256))
        elif kind == 2:
            run = int(rng.integers(1, 64))
            data[at : at + run] = bytes([int(rng.choice([0, 255, 32, 48]))]) * len(
                data[at : at + run]
            )
        elif kind == 3:
            value = int(
                rng.choice(
                    [0, 1, 2**31 - 1, 2**32 - 1, 2**40, 2**62, 2**63 - 1],
                    p=[0.1, 0.1, 0.2, 0.2, 0.2, 0.1, 0.1],
                )
            )
            size = int(rng.choice([4, 8]))
            at -= at % 8 if rng.random() < 0.7 else 0
            part = (value & (2 ** (8 * size) - 1)).to_bytes(size, "little")
            data[at : at + size] = part[: len(data[at : at + size])]
        elif kind == 4:
            del data[at:]
        elif kind == 5:
            run = int(rng.integers(1, 512))
            data[at:at] = data[at : at + run]
        elif kind == 6:
            del data[at : at + int(rng.integers(1, 512))]
        else:
            other, run = int(rng.integers(len(data))), int(rng.integers(1, 256))
            data[at : at + run] = data[other : other + len(data[at : at + run])]
    return bytes(data)


@dataclass
class Answer:
    """What a trial gave: "read", "refused", "defect", "bad words", "crash" or "hang"."""

    result: str
    says: str = ""
    peak_mb: float = 0.0


class Trials:
    """A worker process that is started again when a library crashes or hangs."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self.start_mb = 0.0

    def _start(self) -> subprocess.Popen[bytes]:
        roots = [
            str(Path(hrg_cli.__file__).parents[1]),
            *filter(None, [os.environ.get("PYTHONPATH")]),
        ]
        environment = {
            **os.environ,
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
            "PYTHONPATH": os.pathsep.join(roots),
        }
        worker = Path(__file__).with_name("trial_worker.py")
        self._process = subprocess.Popen(
            [sys.executable, str(worker)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=environment,
        )
        ready = self._line(120.0)
        assert ready is not None, "the worker did not start"
        self.start_mb = ready["peak_mb"]
        return self._process

    def _line(self, seconds: float) -> dict | None:
        assert self._process is not None and self._process.stdout is not None
        if not select.select([self._process.stdout], [], [], seconds)[0]:
            raise TimeoutError
        line = self._process.stdout.readline()
        return json.loads(line) if line else None

    def _answer(self, process: subprocess.Popen[bytes]) -> dict | None:
        """The worker's answer; TimeoutError after `HANG_S` of its own processor time, or `WAITS`
        times that on the clock."""
        used = psutil.Process(process.pid).cpu_times()
        for _ in range(WAITS):
            try:
                return self._line(HANG_S)
            except TimeoutError:
                now = psutil.Process(process.pid).cpu_times()
                if now.user + now.system - used.user - used.system > HANG_S:
                    raise
        raise TimeoutError

    def attempt(self, task: str, path: Path) -> Answer:
        """Try one file."""
        process = self._process or self._start()
        assert process.stdin is not None
        process.stdin.write(json.dumps({"task": task, "path": str(path)}).encode() + b"\n")
        process.stdin.flush()
        try:
            answer = self._answer(process)
        except TimeoutError:
            self.close()
            return Answer("hang", f"longer than {HANG_S} s")
        if answer is None:
            status = process.wait()
            self._process = None
            return Answer("crash", f"exit status {status}")
        peak_mb = answer["peak_mb"] - self.start_mb
        if peak_mb > FRESH_MB:
            self.close()
        return Answer(answer["result"], answer.get("where", answer.get("says", "")), peak_mb)

    def close(self) -> None:
        """End the worker."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            self._process = None
