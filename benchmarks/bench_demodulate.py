"""demodulate against merely reading the same uncompressed file with h5py: as a function, and as
whole processes in pairs; growth, memory.

python benchmarks/bench_demodulate.py [millions of samples]
"""

import resource
import sys
import tempfile
from functools import partial
from pathlib import Path

import h5py
import numpy as np
from timing import best, processor_seconds

from hrg_cli import store
from hrg_cli.records import Recording
from hrg_cli.stages.demodulate import demodulate

RATE_HZ, FREQUENCY_HZ = 64_000.0, 5_003.37
BLOCK = 1 << 20


def write_recording(path: Path, samples: int) -> None:
    """Two int16 channels of a slow ring-down with two counts of noise, written block by block,
    uncompressed."""
    rng = np.random.default_rng(1)

    def blocks():  # type: ignore[no-untyped-def]
        for start in range(0, samples, BLOCK):
            t = np.arange(start, min(start + BLOCK, samples)) / RATE_HZ
            u = np.exp(-t / 600 + 2j * np.pi * np.fmod(FREQUENCY_HZ * t, 1.0))
            c, s = (20000 * u.real).astype("f4"), (9000 * (u * np.exp(0.4j)).real).astype("f4")
            noise = rng.standard_normal((2, len(t)), dtype="f4") * 2
            yield Recording(
                c=np.rint(c + noise[0]).astype("i2"),
                s=np.rint(s + noise[1]).astype("i2"),
                sample_rate_hz=RATE_HZ,
                mode="free",
                run_id="bench",
            )

    store.write(path, blocks())


def read_only(path: Path) -> None:
    """Merely read both channels in blocks."""
    with h5py.File(path) as file:
        for name in ("c", "s"):
            channel = file["recording"][name]
            for start in range(0, len(channel), BLOCK):
                channel[start : start + BLOCK]


def run(path: Path, periods: float) -> int:
    """Demodulate, keeping nothing; the number of rows."""
    with store.open_record(path, Recording) as recording:
        return sum(len(block) for block in demodulate(recording, periods_per_window=periods))


READ = """
import h5py
with h5py.File({path!r}) as file:
    for name in "cs":
        channel = file["recording"][name]
        for start in range(0, len(channel), 1 << 20):
            channel[start : start + (1 << 20)]
"""


def as_processes(path: Path) -> None:
    """Print how much processor time `hrg demodulate` takes against a script that only reads, pair
    by pair."""
    output = str(path.with_suffix(".periods.h5"))
    for periods in (1, 50):
        command = [
            sys.executable,
            "-m",
            "hrg_cli.cli",
            "demodulate",
            str(path),
            "-o",
            output,
            "--force",
            "-q",
        ]
        pairs = [
            (
                processor_seconds([sys.executable, "-c", READ.format(path=str(path))]),
                processor_seconds([*command, "--periods-per-window", str(periods)]),
            )
            for _ in range(3)
        ]
        reading, whole = min(pairs, key=lambda pair: pair[1])
        ratio = f"{whole / reading:.1f} x a process that only reads ({reading:.2f} s)"
        print(f"  whole process, {periods} periods per window: {whole:.2f} s, {ratio}")


def main(millions: float) -> None:
    """Print the ratios, the growth and the peak memory of one run."""
    with tempfile.TemporaryDirectory() as folder:
        sizes = [int(millions * 1e6 / 4), int(millions * 1e6)]
        paths = [Path(folder) / f"{size}.h5" for size in sizes]
        for path, size in zip(paths, sizes, strict=True):
            write_recording(path, size)
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        for path, size in zip(paths, sizes, strict=True):
            reading = best(partial(read_only, path))
            print(f"{size / 1e6:g} million samples x 2 int16: reading {reading:.3f} s")
            for periods in (1.0, 50.0):
                taken = best(partial(run, path, periods), 2)
                print(
                    f"  {periods:g} periods per window: {taken:.3f} s, {taken / reading:.1f} x"
                    f" reading, {taken / size * 1e9:.1f} ns a pair"
                )
            as_processes(path)
        after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(f"peak memory {after:.0f} MB (before demodulating {before:.0f} MB)")


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else 50.0)
