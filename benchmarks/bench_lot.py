"""A lot on one and on two processes, and once more when nothing changed.

python benchmarks/bench_lot.py [gyros]
"""

import sys
import tempfile
from pathlib import Path

from recordings import GYRO, RATE_HZ, hrg, run_down

from hrg_cli import store

SAMPLES = 100_000


def main(gyros: int) -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for k in range(gyros):
            store.write(
                folder / f"g{k:03}.h5",
                run_down(SAMPLES, theta=0.1 + 0.02 * k, seed=k, gyro_id=f"G{k:03}"),
            )
        (folder / "lot.toml").write_text(
            'recordings = "g*.h5"\nstages = ["identify"]\n[demodulate]\nperiods_per_window = 50.0\n'
            f"[identify]\nscale_factor = {GYRO.scale_factor}\nrate_rad_s = 0.0\n"
        )
        taken = {
            jobs: hrg("batch", folder / "lot.toml", "-o", folder / f"out{jobs}", "--jobs", jobs)
            for jobs in (1, 2)
        }
        again = hrg("batch", folder / "lot.toml", "-o", folder / "out2", "--jobs", 1)
    print(
        f"| {gyros} gyros, {SAMPLES / RATE_HZ:g} s of {RATE_HZ / 1e3:g} kHz each, to the resonator"
        " | seconds | processor seconds |"
    )
    print("|---|---|---|")
    for title, (wall, processor, _) in {
        "one process": taken[1],
        "two processes": taken[2],
        "again, nothing changed": again,
    }.items():
        print(f"| {title} | {wall:.1f} | {processor:.1f} |")
    print(f"\nTwo processes end {taken[1][0] / taken[2][0]:.2f} times as early as one.")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 32)
