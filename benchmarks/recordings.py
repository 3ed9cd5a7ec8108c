"""What the benchmarks of the whole share: recordings of a known gyro, and a command measured by the
operating system."""

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from hrg_cli.physics import ellipse
from hrg_cli.physics.resonator import Mechanics, build_generator, exponentiate
from hrg_cli.records import Recording

GYRO = Mechanics(5003.7, 0.05, 0.004, 0.35, 0.11, 0.9, 0.55)
RATE_HZ, NOISE = 100e3, 1e-3
LSB = 2.0 / 32768
BLOCK = 1 << 20
ROOT = Path(__file__).parent.parent


def envelopes(times: np.ndarray, theta: float, gyro: Mechanics = GYRO) -> np.ndarray:
    """Exact envelopes (n, 2) of a run-down at rest."""
    return exponentiate(build_generator(gyro, 0.0), times) @ ellipse.compute_envelopes(
        0.9, 0.01, theta, 0.2, gyro.mode_number
    )


def run_down(
    samples: int, theta: float = 0.3, seed: int = 0, gyro: Mechanics = GYRO, gyro_id: str = "G"
) -> Iterator[Recording]:
    """A 16-bit recording of a free run-down, block by block."""
    rng = np.random.default_rng(seed)
    for start in range(0, samples, BLOCK):
        t = np.arange(start, min(start + BLOCK, samples)) / RATE_HZ
        coarse = np.arange(t[0], t[-1] + 0.02, 0.01)
        slow = envelopes(coarse, theta, gyro)
        turning = np.exp(2j * np.pi * gyro.frequency_hz * t)
        signal = [
            (np.interp(t, coarse, u.real) + 1j * np.interp(t, coarse, u.imag)) * turning
            for u in slow.T
        ]
        c, s = (
            np.round((x.real + NOISE * rng.standard_normal(len(t))) / LSB).astype("i2")
            for x in signal
        )
        yield Recording(
            c=c,
            s=s,
            sample_rate_hz=RATE_HZ,
            mode="free",
            c_scale_factor=LSB,
            s_scale_factor=LSB,
            gyro_id=gyro_id,
            run_id=f"{gyro_id}-{seed}",
        )


LAUNCHER = """
import json, os, sys, time
started = time.perf_counter()
child = os.posix_spawn(sys.executable, [sys.executable, *sys.argv[1:]], os.environ)
_, status, usage = os.wait4(child, 0)
seconds = [time.perf_counter() - started, usage.ru_utime + usage.ru_stime]
print(json.dumps([os.waitstatus_to_exitcode(status), *seconds, usage.ru_maxrss / 1024]), file=sys.stderr)
"""
"""A small process between this one and a command: a child's peak memory starts from that of its
parent."""


def measured(*arguments: object) -> tuple[float, float, float, str]:
    """Wall seconds, processor seconds (with children), peak MB and standard output of a Python
    process."""
    words = [sys.executable, "-S", "-c", LAUNCHER, *map(str, arguments)]
    done = subprocess.run(
        words,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    status, wall, processor, memory = json.loads(done.stderr.splitlines()[-1])
    if status not in (0, 3):
        raise SystemExit(f"{arguments[:4]} failed: {done.stderr}")
    return wall, processor, memory, done.stdout


def hrg(*arguments: object) -> tuple[float, float, float]:
    """Wall seconds, processor seconds (with children) and peak MB of one quiet command."""
    return measured("-m", "hrg_cli.cli", *arguments, "-q")[:3]
