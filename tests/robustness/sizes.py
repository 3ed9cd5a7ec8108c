"""Sizes: a large log through import, demodulate, estimate and identify, and a lot of many tiny
gyros. `sizes.py --gigabytes 2 --gyros 2000`; memory and open files are kept for `page.py`.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import bench_lot
import h5py
import recordings

KEPT = Path("build/faults/sizes.jsonl")
BYTES_PER_SAMPLE = 4
"""Two channels of 16 bits."""
PERIODS = 100
"""Oscillation periods a window."""
MOST_MB = 300.0
SAMPLES, RUNS = 10_000, 2
"""Of a tiny gyro."""
SLACK_MB, SLACK_FILES = 30.0, 2
"""By which a lot's memory after all of its gyros may exceed that after a tenth, and its open files
those of a lot a tenth as large: flat."""


def log(path: Path, gigabytes: float) -> None:
    """A laboratory's log of so many bytes: a run-down of as many samples, not compressed."""
    samples = round(gigabytes * 1e9 / BYTES_PER_SAMPLE)
    seconds = samples / recordings.RATE_HZ
    gyro = replace(
        recordings.GYRO, damping_rate_1_s=1.0 / seconds, damping_split_1_s=0.08 / seconds
    )
    with h5py.File(path, "w") as file:
        channels = [
            file.create_dataset(name, (samples,), "i2", chunks=(recordings.BLOCK,)) for name in "cs"
        ]
        start = 0
        for block in recordings.run_down(samples, gyro=gyro):
            for channel, values in zip(channels, (block.c, block.s), strict=True):
                channel[start : start + len(block)] = values
            start += len(block)


def chain(folder: Path, gigabytes: float) -> dict[str, object]:
    """Peak MB of every command of the chain, each in a process of its own."""
    log(folder / "log.h5", gigabytes)
    size = (folder / "log.h5").stat().st_size
    steps = {
        "import": ("log.h5", f"--sample-rate-hz={recordings.RATE_HZ}"),
        "demodulate": ("import.h5", f"--set=periods_per_window={PERIODS}"),
        "estimate": ("demodulate.h5",),
        "identify": (
            "estimate.h5",
            f"--set=scale_factor={recordings.GYRO.scale_factor}",
            "--set=rate_rad_s=0.0",
        ),
    }
    peak_mb, processor_s = {}, {}
    for name, (source, *options) in steps.items():
        _, processor_s[name], peak_mb[name] = recordings.hrg(
            name, folder / source, "-o", folder / f"{name}.h5", *options
        )
        print(f"{name}: {processor_s[name]:.1f} s, {peak_mb[name]:.0f} MB", flush=True)
    return {"bytes": size, "peak_mb": peak_mb, "processor_s": processor_s}


def lot(gyros: int) -> dict[str, float]:
    """A lot of so many tiny gyros in one process: its memory and open files on the way."""
    with tempfile.TemporaryDirectory() as name:
        made = bench_lot.make(Path(name), gyros, SAMPLES, RUNS)
        words = (bench_lot.__file__, "--inside", made, Path(name) / "out", 1)
        return json.loads(recordings.measured(*words)[3]) | {"gyros": gyros}


def broken(told: dict) -> list[str]:
    """What a size broke, in words."""
    if "peak_mb" in told:
        return [f"{name} took {mb:.0f} MB" for name, mb in told["peak_mb"].items() if mb > MOST_MB]
    few, many = told["lots"]
    out = []
    if many["ended_mb"] > many["begun_mb"] + SLACK_MB:
        out.append(f"{many['begun_mb']:.0f} MB grew to {many['ended_mb']:.0f} MB")
    if many["files"] > few["files"] + SLACK_FILES:
        out.append(f"{many['files']:.0f} open files, {few['files']:.0f} in the small lot")
    return out


def keep(told: dict) -> list[str]:
    """Write the figures down; what they broke."""
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    with KEPT.open("a") as lines:
        lines.write(json.dumps(told | {"failures": broken(told)}) + "\n")
    print(json.dumps(told), *broken(told), sep="\n", flush=True)
    return broken(told)


def main() -> int:
    """Status 1 where a bound was broken."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--gigabytes", type=float, default=0.0)
    parser.add_argument("--gyros", type=int, default=0)
    asked = parser.parse_args()
    failures = []
    if asked.gigabytes:
        with tempfile.TemporaryDirectory() as name:
            failures += keep(chain(Path(name), asked.gigabytes))
    if asked.gyros:
        failures += keep({"lots": [lot(max(1, asked.gyros // 10)), lot(asked.gyros)]})
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
