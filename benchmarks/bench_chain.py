"""The whole chain on long recordings, a lot on one and two processes, and what a notebook would do with the same data.

python benchmarks/bench_chain.py [--millions 1 4 16] [--gyros 32]

Every command runs in a process of its own: its wall time and peak memory are the operating system's. Prints Markdown.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import curve_fit, least_squares

from hrg_cli import store
from hrg_cli.physics import ellipse
from hrg_cli.physics.resonator import Mechanics, exponential, generator
from hrg_cli.records import Recording, Wave

GYRO = Mechanics(5003.7, 0.05, 0.004, 0.35, 0.11, 0.9, 0.55)
RATE_HZ, NOISE, WINDOW = 100e3, 1e-3, 1000
LSB = 2.0 / 32768
BLOCK = 1 << 20
COMPARED, PERIOD = 60_000, 20
"""Samples that the notebooks get too, and samples of one of their windows (a period)."""
ROOT = Path(__file__).parent.parent


def envelopes(times: np.ndarray, theta: float, gyro: Mechanics = GYRO) -> np.ndarray:
    """Exact envelopes (n, 2) of a run-down at rest."""
    return exponential(generator(gyro, 0.0), times) @ ellipse.envelopes(0.9, 0.01, theta, 0.2, gyro.mode_number)


def run_down(samples: int, theta: float = 0.3, seed: int = 0, gyro: Mechanics = GYRO, gyro_id: str = "G") -> Iterator[Recording]:
    """A 16-bit recording of a free run-down, block by block."""
    rng = np.random.default_rng(seed)
    for start in range(0, samples, BLOCK):
        t = np.arange(start, min(start + BLOCK, samples)) / RATE_HZ
        coarse = np.arange(t[0], t[-1] + 0.02, 0.01)
        slow = envelopes(coarse, theta, gyro)
        turning = np.exp(2j * np.pi * gyro.frequency_hz * t)
        signal = [(np.interp(t, coarse, u.real) + 1j * np.interp(t, coarse, u.imag)) * turning for u in slow.T]
        c, s = (np.round((x.real + NOISE * rng.standard_normal(len(t))) / LSB).astype("i2") for x in signal)
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
child = os.posix_spawn(sys.executable, [sys.executable, "-m", "hrg_cli.cli", *sys.argv[1:]], os.environ)
_, status, usage = os.wait4(child, 0)
seconds = [time.perf_counter() - started, usage.ru_utime + usage.ru_stime]
print(json.dumps([os.waitstatus_to_exitcode(status), *seconds, usage.ru_maxrss / 1024]), file=sys.stderr)
"""
"""A small process between this one and a command: a child's peak memory starts from that of its parent."""


def hrg(*arguments: object) -> tuple[float, float, float]:
    """Wall seconds, processor seconds (with children) and peak MB of one command."""
    words = [sys.executable, "-S", "-c", LAUNCHER, *map(str, arguments), "-q"]
    done = subprocess.run(words, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True)
    status, wall, processor, memory = json.loads(done.stderr.splitlines()[-1])
    if status not in (0, 3):
        raise SystemExit(f"hrg {arguments[0]} failed: {done.stderr}")
    return wall, processor, memory


def chain(folder: Path, millions: float) -> dict[str, tuple[float, float]]:
    """Processor seconds and peak MB of every stage on one recording."""
    run = folder / f"run{millions:g}.h5"
    store.write(run, run_down(round(millions * 1e6)))
    periods, wave, resonator = (run.with_suffix(f".{kind}.h5") for kind in ("periods", "wave", "resonator"))
    window = f"periods_per_window={WINDOW / RATE_HZ * GYRO.frequency_hz:.6f}"
    stages = {
        "demodulate": ("demodulate", run, "-o", periods, "--set", window),
        "estimate": ("estimate", periods, "-o", wave),
        "identify": ("identify", wave, "-o", resonator, "--scale-factor", GYRO.scale_factor, "--rate-rad-s", 0.0),
    }
    return {name: hrg(*words)[1:] for name, words in stages.items()}


def print_chain(folder: Path, millions: list[float]) -> None:
    """Table of the chain's processor seconds, which other programs on the machine hardly change, and memory by length."""
    _, bare, memory_of_bare = hrg("effects")
    print(
        "| samples | "
        + " | ".join(f"{s}, processor s | {s}, MB" for s in ("demodulate", "estimate", "identify"))
        + " | whole, processor s a million |"
    )
    print("|---|" + "---|" * 7)
    for size in millions:
        found = chain(folder, size)
        cells = " | ".join(f"{taken:.2f} | {memory:.0f}" for taken, memory in found.values())
        print(f"| {size:g} million | {cells} | {sum(taken for taken, _ in found.values()) / size:.2f} |", flush=True)
    print(f"\nA command that does nearly nothing (`hrg effects`) takes {bare:.2f} s and {memory_of_bare:.0f} MB of these.\n")


def print_lot(folder: Path, gyros: int) -> None:
    """Seconds of a lot on one and two processes."""
    data = folder / "lot"
    data.mkdir()
    for k in range(gyros):
        store.write(data / f"g{k:03}.h5", run_down(100_000, theta=0.1 + 0.02 * k, seed=k, gyro_id=f"G{k:03}"))
    (data / "lot.toml").write_text(
        'recordings = "*.h5"\nstages = ["identify"]\n[demodulate]\nperiods_per_window = 50.0\n'
        f"[identify]\nscale_factor = {GYRO.scale_factor}\nrate_rad_s = 0.0\n"
    )
    taken = {jobs: hrg("batch", data / "lot.toml", "-o", folder / f"out{jobs}", "--jobs", jobs)[:2] for jobs in (1, 2)}
    again = hrg("batch", data / "lot.toml", "-o", folder / "out2", "--jobs", 2)[:2]
    print(f"| lot of {gyros} gyros, 1 s of 100 kHz each | seconds | processor seconds |\n|---|---|---|")
    for name, (wall, processor) in {"one process": taken[1], "two processes": taken[2], "again, nothing changed": again}.items():
        print(f"| {name} | {wall:.1f} | {processor:.1f} |")
    print(f"\nTwo processes are {taken[1][0] / taken[2][0]:.2f} times as fast as one; load of the machine {os.getloadavg()[0]:.1f}.\n")


def loops_of_scipy(c: np.ndarray, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, float]:
    """A loop of least_squares over the periods; the wave by the exact formulas; ν from the logarithm of the amplitude."""
    x, found = np.zeros(4), []
    for a, b, at in zip(c.reshape(-1, PERIOD), s.reshape(-1, PERIOD), t.reshape(-1, PERIOD)):
        basis = np.stack([np.cos(2 * np.pi * GYRO.frequency_hz * at), np.sin(2 * np.pi * GYRO.frequency_hz * at)], 1)
        x = least_squares(lambda x, a=a, b=b, basis=basis: np.concatenate([basis @ x[:2] - a, basis @ x[2:] - b]), x).x
        found.append(x)
    y = np.array(found)
    main, _, theta, _ = ellipse.wave(np.stack([y[:, 0] - 1j * y[:, 1], y[:, 2] - 1j * y[:, 3]], 1), 2)
    return theta, -np.polyfit(t.reshape(-1, PERIOD).mean(1), np.log(main), 1)[0]


def notebook_of_pandas(c: np.ndarray, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, float]:
    """groupby window, curve_fit of a sine (amplitude, frequency, phase) a channel, arctangent of the amplitudes, curve_fit of the decay."""

    def sine(t: np.ndarray, amplitude: float, frequency: float, phase: float) -> np.ndarray:
        return amplitude * np.cos(2 * np.pi * frequency * t + phase)

    def one(part: pd.DataFrame) -> pd.Series:
        at = part["t"].to_numpy() - part["t"].iloc[0]
        phase = 2 * np.pi * GYRO.frequency_hz * part["t"].iloc[0]
        (ac, _, pc), _ = curve_fit(sine, at, part["c"], p0=(part["c"].max(), GYRO.frequency_hz, phase))
        (as_, _, ps), _ = curve_fit(sine, at, part["s"], p0=(part["s"].max(), GYRO.frequency_hz, pc))
        return pd.Series(
            {"t": part["t"].mean(), "theta": np.arctan2(as_ * np.sign(np.cos(ps - pc)), ac) / 2, "a": np.hypot(ac, as_)}
        )

    table = pd.DataFrame({"t": t, "c": c, "s": s, "window": np.arange(len(t)) // PERIOD})
    rows = table.groupby("window")[["t", "c", "s"]].apply(one)
    (_, nu), _ = curve_fit(lambda t, a, nu: a * np.exp(-nu * t), rows["t"], rows["a"], p0=(1.0, 0.1))
    return rows["theta"].to_numpy(), float(nu)


def print_alternatives(folder: Path) -> None:
    """Seconds and errors against the truth, on the same data."""
    run = folder / "short.h5"
    store.write(run, run_down(COMPARED))
    whole = next(run_down(COMPARED))
    c, s, t = whole.c * LSB, whole.s * LSB, np.arange(COMPARED) / RATE_HZ
    middle = t.reshape(-1, PERIOD).mean(1)
    truth = ellipse.wave(envelopes(middle, 0.3), 2)[2]
    taken = {}

    def line(name: str, theta: np.ndarray, nu: float, started: float) -> None:
        taken[name] = time.perf_counter() - started
        off = (theta - truth + np.pi / 4) % (np.pi / 2) - np.pi / 4
        error = 100 * abs(nu / GYRO.damping_rate_1_s - 1)
        print(f"| {name} | {taken[name]:.2f} | {1e6 * np.sqrt(np.mean(off**2)):.0f} | {error:.2f} % |")

    print(f"| {COMPARED} samples, a window a period | seconds | wave angle off by, µrad rms | ν off by |\n|---|---|---|---|")
    started = time.perf_counter()
    line("scipy: a loop of least_squares", *loops_of_scipy(c, s, t), started)
    started = time.perf_counter()
    line("pandas: groupby and curve_fit", *notebook_of_pandas(c, s, t), started)
    by_library(run)
    started = time.perf_counter()
    wave, nu = by_library(run)
    line("hrg as a library", np.interp(middle, wave.time_s, wave.wave_angle_rad), nu, started)
    *others, ours = taken
    print("\n" + "; ".join(f"hrg takes 1/{taken[name] / taken[ours]:.0f} of the time of {name}" for name in others) + ".")
    print("Only hrg gives the splits, their axes and standard deviations; the notebooks take the decay at one angle for ν.\n")


def by_library(run: Path) -> tuple[Wave, float]:
    """The chain as library calls: the wave and ν."""
    from hrg_cli import collect, demodulate, estimate, identify

    with store.open_record(run, Recording) as record:
        periods = collect(demodulate(record, periods_per_window=1.0))
    wave = collect(estimate(periods))
    found = identify([wave], scale_factor=GYRO.scale_factor, rate_rad_s=0.0).parameters()
    return wave, found["damping_rate_1_s"][0]


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--millions", type=float, nargs="+", default=[0.5, 1, 2])
    parser.add_argument("--gyros", type=int, default=8)
    given = parser.parse_args()
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, Python {platform.python_version()}\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print_alternatives(folder)
        print_lot(folder, given.gyros)
        print_chain(folder, given.millions)


if __name__ == "__main__":
    main()
