"""Lots of four runs a gyro on one and on two processes: time, and what the parent needs.

python benchmarks/bench_lot.py [gyros ...]
"""

import json
import os
import resource
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from recordings import GYRO, RATE_HZ, measured, run_down

from hrg_cli import store
from hrg_cli.lots.batch import choose_executor, run_lot

SAMPLES, RUNS = 20_000, 4
SPREAD_HZ = 2.0
"""Scatter of the gyros' frequencies."""
LOT = (
    'recordings = "data/*.h5"\nstages = ["identify"]\n[demodulate]\nperiods_per_window = 50.0\n'
    f"[identify]\nscale_factor = {GYRO.scale_factor}\nrate_rad_s = 0.0\n"
)


def make(folder: Path, gyros: int, samples: int = SAMPLES, runs: int = RUNS) -> Path:
    """The recordings of so many gyros, and the lot's file."""
    rng = np.random.default_rng(0)
    (folder / "data").mkdir()
    for k in range(gyros):
        gyro = replace(GYRO, frequency_hz=GYRO.frequency_hz + rng.normal(0, SPREAD_HZ))
        for run in range(runs):
            recording = run_down(samples, 0.1 + 0.4 * run, runs * k + run, gyro, f"G{k:04}")
            store.write(folder / "data" / f"g{k:04}-{run}.h5", recording)
    (folder / "lot.toml").write_text(LOT)
    return folder / "lot.toml"


def used(who: int) -> float:
    """Processor seconds so far."""
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def inside(lot: Path, folder: Path, jobs: int) -> dict[str, float]:
    """Run a lot in this process; its own and its children's seconds, its memory and open files on
    the way."""
    seen: list[tuple[float, int]] = []

    def look(share: float | None) -> None:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        seen.append((pages * resource.getpagesize() / 1e6, len(os.listdir("/proc/self/fd"))))

    started, before = time.perf_counter(), used(resource.RUSAGE_SELF)
    report = run_lot(lot, folder, open_executor=choose_executor(jobs), progress=look)
    if report["passed"] != report["gyros"]:
        raise SystemExit(f"{report['status_reasons'][:3]}")
    tenth = seen[len(seen) // 10]
    return {
        "wall_s": time.perf_counter() - started,
        "own_s": used(resource.RUSAGE_SELF) - before,
        "children_s": used(resource.RUSAGE_CHILDREN),
        "begun_mb": tenth[0],
        "ended_mb": seen[-1][0],
        "files": max(files for _, files in seen),
    }


def main(sizes: list[int]) -> None:
    """Print the table."""
    print(
        f"| gyros × {RUNS} runs of {SAMPLES / RATE_HZ:g} s at {RATE_HZ / 1e3:g} kHz | one process, s"
        " | two processes, s | times as early | by processor time | of it the parent, s | parent's"
        " memory after a tenth and all of the work, MB | open files | again, s |"
    )
    print("|---|" + "---|" * 8)
    seconds = []
    for gyros in sizes:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            lot = make(folder, gyros)
            runs = [(1, "one"), (2, "two"), (1, "one")]
            one, two, again = (
                json.loads(measured(__file__, "--inside", lot, folder / out, jobs)[3])
                for jobs, out in runs
            )
        shared = two["own_s"] + two["children_s"] / 2
        seconds.append(one["own_s"])
        print(
            f"| {gyros} | {one['wall_s']:.1f} | {two['wall_s']:.1f} |"
            f" {one['wall_s'] / two['wall_s']:.2f} | {one['own_s'] / shared:.2f} |"
            f" {two['own_s']:.1f} | {two['begun_mb']:.0f}, {two['ended_mb']:.0f} |"
            f" {two['files']:.0f} | {again['wall_s']:.1f} |",
            flush=True,
        )
    print(
        "\nBy processor time: that of one process over the parent's and half of its workers', which"
        " other programs on the machine hardly change."
    )
    if len(sizes) > 1:
        growth = np.polyfit(np.log(sizes), np.log(seconds), 1)[0]
        print(f"Growth of the seconds with the gyros: exponent {growth:.2f}.")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--inside"]:
        print(json.dumps(inside(Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]))))
    else:
        main([int(text) for text in sys.argv[1:]] or [12, 25, 50])
