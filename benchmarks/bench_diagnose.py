"""diagnose eight runs × 500 windows × the whole catalogue, as a ratio to the base fit's own time;
the same with two hidden effects.

python benchmarks/bench_diagnose.py
"""

import time

import numpy as np

from hrg_cli.fitting.envelopes import envelope_runs
from hrg_cli.fitting.envelopes.base_fit import fit_base_model
from hrg_cli.physics import ellipse
from hrg_cli.physics.resonator import Mechanics, build_generator, exponentiate
from hrg_cli.records import Wave
from hrg_cli.stages.diagnose import diagnose, summarise

RUNS, WINDOWS, WINDOW_S, NOISE = 8, 500, 0.008, 2e-5
DEVICE = Mechanics(5000.0, 0.3, 0.012, 0.35, 0.11, 0.9, 0.55)


GAIN, BIAS_RAD_S, ROUNDS = 2e-3, 0.01, 7


def run(number: int, hidden: bool = False) -> Wave:
    """A ring-down of the linear slow model at its own angle, amplitude and rate; `hidden`: a gain
    mismatch, and a biased rate."""
    random = np.random.default_rng(number)
    t = (np.arange(WINDOWS) + 0.5) * WINDOW_S
    rate = (0.0, 0.0, 2.0, -2.0)[number % 4]
    start = ellipse.compute_envelopes(
        np.array((1.0, 0.5)[number // 4]),
        np.array(0.05),
        np.array(0.2 * number),
        np.array(random.uniform(0, 6)),
    )
    u = exponentiate(build_generator(DEVICE, rate + BIAS_RAD_S * hidden), t) @ start
    if hidden:
        u = u * np.array([1 + GAIN / 2, 1 - GAIN / 2])
    u = u + NOISE * (
        random.standard_normal((WINDOWS, 2)) + 1j * random.standard_normal((WINDOWS, 2))
    )
    a_A, a_B, angle, phase = ellipse.find_wave(u)
    angle, phase = ellipse.unwrap(angle, phase)
    std, zero = np.full(WINDOWS, NOISE), np.zeros(WINDOWS)
    return Wave(
        time_s=t, main_amplitude=a_A, quadrature_amplitude=a_B, wave_angle_rad=angle, phase_rad=phase,
        carrier_phase_rad=zero, main_amplitude_std=std,
        quadrature_amplitude_std=std, wave_angle_rad_std=std, phase_rad_std=std, carrier_phase_rad_std=zero,
        residual_rms=zero, signal_std=std,
        iterations=np.zeros(WINDOWS, "i2"), flags=np.zeros(WINDOWS, "u1"), temperature_degc=24 + 0.2 * t, rate_rad_s=np.full(WINDOWS, rate),
        frequency_hz=np.full(WINDOWS, 5000.0), reference_frequency_hz=5000.0, window_s=WINDOW_S, mode="free", run_id=f"run{number}",
    )  # fmt: skip


def timed(waves: list[Wave]) -> tuple[float, float, dict]:
    """(base fit, diagnose) in processor time, the medians of rounds in which they take turns, and
    what diagnose says.

    Whatever else the machine does slows both alike; the best of a few rounds would favour the
    shorter one.
    """
    base, whole, out = [], [], summarise(diagnose(waves))
    for _ in range(ROUNDS):
        for work, times in (
            (lambda: fit_base_model([envelope_runs.from_wave(w) for w in waves]), base),
            (lambda: diagnose(waves), whole),
        ):
            started = time.process_time()
            work()
            times.append(time.process_time() - started)
    return float(np.median(base)), float(np.median(whole)), out


def main() -> None:
    """The ratio of a clean gyro's programme, and of one with two effects to be found."""
    for hidden in (False, True):
        base, whole, out = timed([run(k, hidden) for k in range(RUNS)])
        visible, found = (
            sum(t["visible"] for t in out["tested"]),
            [e["name"] for e in out["effects"]],
        )
        print(
            f"base fit {base:.3f} s; diagnose {whole:.3f} s, {len(out['tested'])} effects"
            f" ({visible} visible), verdict"
            f" {out['verdict']}{': ' + ', '.join(found) if found else ''}"
        )
        print(f"ratio {whole / base:.2f}" + ("" if hidden else " (at most 10)"))


if __name__ == "__main__":
    main()
