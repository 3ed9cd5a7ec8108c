"""The whole chain on recordings of 1, 4 and 16 million samples: processor time of each stage and
peak memory.

python benchmarks/bench_chain.py [millions of samples ...]

Each length runs in a fresh process: once over a short recording, so that imports are done, then
over the long one, from file to file as the commands do. The last line is the same chain as three
commands, starts of Python and imports included.
"""

import json
import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from recordings import GYRO, hrg, measured, run_down

from hrg_cli import pipeline, settings, store

PERIODS = 10
"""Oscillation periods per window: about 200 samples."""
SHORT = 100_000
STAGES = ("demodulate", "estimate", "identify")
GIVEN = {
    "demodulate": {"periods_per_window": PERIODS},
    "estimate": {},
    "identify": {"scale_factor": GYRO.scale_factor, "rate_rad_s": 0.0},
}


def stages(run: Path) -> dict[str, tuple[float, float]]:
    """Processor seconds of every stage, and the process's peak MB after it."""
    found, source = {}, run
    for name in STAGES:
        stage = pipeline.STAGES[name]
        output = run.with_suffix(f".{stage.gives}.h5")
        values = settings.check_settings(stage.load_function(), GIVEN[name])
        before = time.process_time()
        pipeline.run_stage(name, [source], output, values, force=True, command_line=f"hrg {name}")
        found[name] = (
            time.process_time() - before,
            resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        )
        source = output
    return found


def commands(run: Path) -> float:
    """Processor seconds of the chain as three commands."""
    total, source = 0.0, run
    for name in STAGES:
        output = run.with_suffix(f".{name}.h5")
        flags = [f"--set={key}={value}" for key, value in GIVEN[name].items()]
        total += hrg(name, source, "-o", output, *flags)[1]
        source = output
    return total


def main(millions: list[float]) -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        store.write(folder / "short.h5", run_down(SHORT))
        print(
            "| samples | "
            + " | ".join(f"{s}, s" for s in STAGES)
            + " | whole, s | peak MB | as three commands, s |"
        )
        print("|---|" + "---|" * 6)
        totals: list[float] = []
        for size in millions:
            run = folder / f"run{size:g}.h5"
            store.write(run, run_down(round(size * 1e6)))
            found = json.loads(measured(__file__, "--inside", folder / "short.h5", run)[3])
            cells = " | ".join(f"{found[s][0]:.2f}" for s in STAGES)
            total = sum(found[s][0] for s in STAGES)
            print(
                f"| {size:g} million | {cells} | {total:.2f} | {found['identify'][1]:.0f} |"
                f" {commands(run):.1f} |",
                flush=True,
            )
            totals.append(total)
            run.unlink()
    print("\nSeconds of the processor, which other programs on the machine hardly change.")
    if len(millions) > 2:
        slope, start = np.polyfit(millions, totals, 1)
        apart = np.max(np.abs(np.polyval((slope, start), millions) - totals))
        print(
            f"Growth: {start:.2f} s + {slope:.3f} s a million samples, every length within"
            f" {apart:.2f} s of that line."
        )


if __name__ == "__main__":
    if sys.argv[1:2] == ["--inside"]:
        stages(Path(sys.argv[2]))
        print(json.dumps(stages(Path(sys.argv[3]))))
    else:
        main([float(text) for text in sys.argv[1:]] or [1, 4, 16])
