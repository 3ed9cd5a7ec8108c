"""What a user would write instead, on the same data: a scipy fit a period, and a pandas notebook
with curve_fit.

python benchmarks/bench_alternatives.py
"""

import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
from recordings import GYRO, LSB, RATE_HZ, envelopes, run_down
from scipy.optimize import curve_fit, least_squares

from hrg_cli import store
from hrg_cli.physics import ellipse
from hrg_cli.records import Recording, Wave

COMPARED, PERIOD = 60_000, 20
"""Samples that everybody gets, and samples of a window (a period)."""


def loops_of_scipy(c: np.ndarray, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, float]:
    """A loop of least_squares over the periods; the wave by the exact formulas; ν from the
    logarithm of the amplitude."""
    x, found = np.zeros(4), []
    for a, b, at in zip(c.reshape(-1, PERIOD), s.reshape(-1, PERIOD), t.reshape(-1, PERIOD)):
        basis = np.stack(
            [
                np.cos(2 * np.pi * GYRO.frequency_hz * at),
                np.sin(2 * np.pi * GYRO.frequency_hz * at),
            ],
            1,
        )
        x = least_squares(
            lambda x, a=a, b=b, basis=basis: np.concatenate([basis @ x[:2] - a, basis @ x[2:] - b]),
            x,
        ).x
        found.append(x)
    y = np.array(found)
    main, _, theta, _ = ellipse.find_wave(
        np.stack([y[:, 0] - 1j * y[:, 1], y[:, 2] - 1j * y[:, 3]], 1), 2
    )
    return theta, -np.polyfit(t.reshape(-1, PERIOD).mean(1), np.log(main), 1)[0]


def notebook_of_pandas(c: np.ndarray, s: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, float]:
    """groupby window, curve_fit of a sine (amplitude, frequency, phase) a channel, arctangent of
    the amplitudes, curve_fit of the decay."""

    def sine(t: np.ndarray, amplitude: float, frequency: float, phase: float) -> np.ndarray:
        return amplitude * np.cos(2 * np.pi * frequency * t + phase)

    def one(part: pd.DataFrame) -> pd.Series:
        at = part["t"].to_numpy() - part["t"].iloc[0]
        phase = 2 * np.pi * GYRO.frequency_hz * part["t"].iloc[0]
        (ac, _, pc), _ = curve_fit(
            sine, at, part["c"], p0=(part["c"].max(), GYRO.frequency_hz, phase)
        )
        (as_, _, ps), _ = curve_fit(
            sine, at, part["s"], p0=(part["s"].max(), GYRO.frequency_hz, pc)
        )
        return pd.Series(
            {
                "t": part["t"].mean(),
                "theta": np.arctan2(as_ * np.sign(np.cos(ps - pc)), ac) / 2,
                "a": np.hypot(ac, as_),
            }
        )

    table = pd.DataFrame({"t": t, "c": c, "s": s, "window": np.arange(len(t)) // PERIOD})
    rows = table.groupby("window")[["t", "c", "s"]].apply(one)
    (_, nu), _ = curve_fit(
        lambda t, a, nu: a * np.exp(-nu * t), rows["t"], rows["a"], p0=(1.0, 0.1)
    )
    return rows["theta"].to_numpy(), float(nu)


def compare(folder: Path) -> None:
    """Seconds and errors against the truth, on the same data."""
    run = folder / "short.h5"
    store.write(run, run_down(COMPARED))
    whole = next(run_down(COMPARED))
    c, s, t = whole.c * LSB, whole.s * LSB, np.arange(COMPARED) / RATE_HZ
    middle = t.reshape(-1, PERIOD).mean(1)
    truth = ellipse.find_wave(envelopes(middle, 0.3), 2)[2]
    taken = {}

    def line(name: str, theta: np.ndarray, nu: float, started: float) -> None:
        taken[name] = time.process_time() - started
        off = (theta - truth + np.pi / 4) % (np.pi / 2) - np.pi / 4
        error = 100 * abs(nu / GYRO.damping_rate_1_s - 1)
        print(
            f"| {name} | {taken[name]:.2f} | {1e6 * np.sqrt(np.mean(off**2)):.0f} | {error:.2f} % |"
        )

    print(
        f"| {COMPARED} samples, a window a period | processor seconds | wave angle off by, µrad rms"
        " | ν off by |\n|---|---|---|---|"
    )
    started = time.process_time()
    line("scipy: a loop of least_squares", *loops_of_scipy(c, s, t), started)
    started = time.process_time()
    line("pandas: groupby and curve_fit", *notebook_of_pandas(c, s, t), started)
    by_library(run)
    started = time.process_time()
    wave, nu = by_library(run)
    line("hrg as a library", np.interp(middle, wave.time_s, wave.wave_angle_rad), nu, started)
    *others, ours = taken
    print(
        "\n"
        + "; ".join(
            f"hrg takes 1/{taken[name] / taken[ours]:.0f} of the time of {name}" for name in others
        )
        + "."
    )
    print(
        "Only hrg gives the splits, their axes and standard deviations; the notebooks take the"
        " decay at one angle for ν.\n"
    )


def by_library(run: Path) -> tuple[Wave, float]:
    """The chain as library calls: the wave and ν."""
    from hrg_cli import collect, demodulate, estimate, identify

    with store.open_record(run, Recording) as record:
        periods = collect(demodulate(record, periods_per_window=1.0))
    wave = collect(estimate(periods))
    found = identify([wave], scale_factor=GYRO.scale_factor, rate_rad_s=0.0).parameters()
    return wave, found["damping_rate_1_s"][0]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        compare(Path(name))
