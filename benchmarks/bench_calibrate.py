"""calibrate ten gyros × five temperatures × three rates, its growth with the length of the runs,
and its peak memory.

python benchmarks/bench_calibrate.py [windows a run]
"""

import resource
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from hrg_cli import store
from hrg_cli.records import Wave
from hrg_cli.stages.calibrate import calibrate, summarise

TEMPERATURES, RATES = (-20.0, 0.0, 20.0, 40.0, 60.0), (-0.5, 0.05, 0.5)
WINDOW_S, NOISE = 0.01, 1e-5


def write_run(path: Path, gyro: int, degc: float, rate: float, windows: int) -> None:
    """A forced run, written block by block: the wave turns by the rate, with an exactly integrable
    drift of angle 4θ.

    m·dθ/dt = −KΩ + D sin 4θ integrates to tan 2θ of an elementary function; its series to first
    order in D/KΩ serves here.
    """
    draw = np.random.default_rng([gyro, int(degc + 100), int(100 * rate + 100)])
    K, D = 0.55 * (1 + 1e-5 * degc), 2e-4 * (1 + 0.004 * degc) * (1 + 0.1 * gyro)
    start = draw.uniform(0, np.pi)

    def blocks():  # type: ignore[no-untyped-def]
        for first in range(0, windows, 1 << 16):
            t = np.arange(first, min(first + (1 << 16), windows)) * WINDOW_S
            n = len(t)
            even = start - K * rate * t / 2
            angle = (
                even
                + D / (4 * K * rate) * (np.cos(4 * even) - np.cos(4 * start))
                + NOISE * draw.standard_normal(n)
            )
            one, zero, noise = np.ones(n), np.zeros(n), np.full(n, NOISE)
            yield Wave(
                time_s=t, main_amplitude=one, quadrature_amplitude=zero, wave_angle_rad=angle, phase_rad=zero, carrier_phase_rad=zero,
                main_amplitude_std=noise, quadrature_amplitude_std=noise, wave_angle_rad_std=noise, phase_rad_std=noise,
                carrier_phase_rad_std=zero, residual_rms=zero, signal_std=noise, iterations=np.zeros(n, "i2"), flags=np.zeros(n, "u1"),
                temperature_degc=np.full(n, degc), rate_rad_s=np.full(n, rate), frequency_hz=5000 * one, reference_frequency_hz=5000.0,
                window_s=WINDOW_S, mode="forced", gyro_id=f"g{gyro}", run_id=f"T{degc:g} R{rate:g}",
            )  # fmt: skip

    store.write(path, blocks())


def calibrate_gyro(folder: Path, gyro: int, windows: int) -> tuple[float, dict[str, float]]:
    """Seconds to calibrate one gyro from its files, opened lazily, and its held-out figures."""
    paths = []
    for degc in TEMPERATURES:
        for rate in RATES:
            paths.append(folder / f"{gyro}-{degc:g}-{rate:g}.h5")
            write_run(paths[-1], gyro, degc, rate, windows)
    began = time.perf_counter()
    with ExitStack() as stack:
        record = calibrate([stack.enter_context(store.open_record(p, Wave)) for p in paths])
    taken = time.perf_counter() - began
    for path in paths:
        path.unlink()
    out = summarise(record)
    return taken, {
        "before": out["drift_rms_rad_s"]["before"],
        "held out": out["drift_rms_rad_s"]["held_out"],
    }


def memory_mb() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def main() -> None:
    windows = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        calibrate_gyro(folder, 0, 2_000)
        rows = [calibrate_gyro(folder, gyro, windows) for gyro in range(10)]
        total = sum(taken for taken, _ in rows)
        gain = np.mean([figures["before"] / figures["held out"] for _, figures in rows])
        runs = len(TEMPERATURES) * len(RATES)
        print(
            f"ten gyros x {runs} runs of {windows} windows: {total:.1f} s, held-out drift falls"
            f" {gain:.1f} times"
        )
        for factor in (1, 4, 16):
            taken, _ = calibrate_gyro(folder, 0, factor * windows)
            print(
                f"  {factor * windows:>9} windows a run: {taken:.2f} s a gyro, peak memory so far"
                f" {memory_mb():.0f} MB"
            )


if __name__ == "__main__":
    main()
