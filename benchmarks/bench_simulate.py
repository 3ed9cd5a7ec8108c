"""simulate's fast engine against a less accurate scipy.integrate.solve_ivp (DOP853), its samples a
second, and the growth with length.

python benchmarks/bench_simulate.py
"""

import resource
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from hrg_cli.physics import fast_engine
from hrg_cli.physics.coefficients import Coefficients, compute_state
from hrg_cli.physics.ellipse import compute_envelopes
from hrg_cli.physics.plant import Control, Environment, ThermalCourses, make_linear_plant
from hrg_cli.physics.resonator import J, Mechanics
from hrg_cli.stages.simulate import simulate

MECHANICS = Mechanics(5000.0, 0.35, 0.01, 0.3, 0.2, 0.9, 0.55)
SAMPLE_RATE_HZ, RATE_RAD_S = 40_000.0, 1.0
COMPARED_S = 0.1
DEVICE = {
    "frequency_hz": 5000.0,
    "damping_rate_1_s": 0.35,
    "damping_split_1_s": 0.01,
    "frequency_split_rad_s": 0.2,
}
CASES = {
    "free run-down": {},
    "turning, warming": {
        "device": DEVICE | {"temperature": {"frequency_per_degc": 85e-6}},
        "environment": {
            "rate_rad_s": 1.0,
            "temperature": {"kind": "ramp", "start_degc": 20.0, "stop_degc": 30.0},
        },
    },
    "forced, two loops": {"control": {"mode": "forced", "quadrature_loop": "finite"}},
    "cubic stiffness": {"effects": {"cubic_stiffness": {"pull_rad_s": 0.01}}},
    "noise, 16 bits": {"readout": {"noise": 1e-3, "adc_bits": 16}},
}


def against_general_integrator() -> None:
    """Time a simulated second of both, with their errors against the matrix exponential."""
    environment = Environment(
        np.array([0.0, 1e4]), *(np.full(2, v) for v in (20.0, RATE_RAD_S, 20.0, RATE_RAD_S))
    )
    plant = make_linear_plant(MECHANICS, ThermalCourses(), environment)
    u0 = compute_envelopes(*map(np.asarray, (1.0, 0.02, 0.2, 0.5)))
    count = round(COMPARED_S * SAMPLE_RATE_HZ)
    damping = 2 * (plant.damping[0] - MECHANICS.scale_factor * RATE_RAD_S * J)
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-plant.stiffness[0], -damping]])
    table = Coefficients(environment, plant)
    z0, w0 = compute_state(table, np.zeros(1), u0[None], MECHANICS.omega_rad_s)
    v0 = (
        MECHANICS.omega_rad_s * w0[0]
        - plant.damping[0] @ z0[0]
        + MECHANICS.scale_factor * RATE_RAD_S * J @ z0[0]
    )
    state = np.concatenate([z0[0], v0])
    t = np.arange(count) / SAMPLE_RATE_HZ
    step, exact = expm(A / SAMPLE_RATE_HZ), np.empty((count, 4))
    for k in range(count):
        exact[k], state = state, step @ state
    (a, b), (c, d) = (row.tolist() for row in plant.stiffness[0])
    (e, f), (g, h) = (row.tolist() for row in damping)

    def equation(_: float, s: np.ndarray) -> list[float]:
        x, y, vx, vy = s.tolist()
        return [vx, vy, -a * x - b * y - e * vx - f * vy, -c * x - d * y - g * vx - h * vy]

    began = time.perf_counter()
    general = solve_ivp(equation, (0, t[-1]), exact[0], "DOP853", t, rtol=1e-9, atol=1e-9)
    general_s = (time.perf_counter() - began) / COMPARED_S
    long = round(20 * SAMPLE_RATE_HZ)
    for _ in fast_engine.run(
        environment, plant, Control(), u0, 1 / SAMPLE_RATE_HZ, 10
    ):  # compiled before it is timed
        pass
    began = time.perf_counter()
    blocks = fast_engine.run(environment, plant, Control(), u0, 1 / SAMPLE_RATE_HZ, long)
    first = next(blocks).samples.z[:, :count]
    for _ in blocks:
        pass
    fast_s = (time.perf_counter() - began) / (long / SAMPLE_RATE_HZ)
    print("5 kHz at 40 kHz, turning at 1 rad/s        a simulated second   error")
    print(
        f"  solve_ivp DOP853, rtol 1e-9               {general_s:10.3f} s      "
        f" {np.abs(general.y[:2] - exact[:, :2].T).max():.0e}"
    )
    print(
        f"  fast engine                               {fast_s:10.5f} s      "
        f" {np.abs(first - exact[:, :2].T).max():.0e}"
    )
    print(f"  ratio                                     {general_s / fast_s:10.0f}")


def timed(seconds: float, **tables: object) -> tuple[float, int]:
    """Time and samples of the whole stage, its stream thrown away."""
    config = {
        "device": DEVICE,
        "recording": {"sample_rate_hz": SAMPLE_RATE_HZ, "duration_s": seconds},
    } | tables
    began, samples = time.perf_counter(), 0
    for block in simulate(config):
        samples += len(block)
    return time.perf_counter() - began, samples


def main() -> None:
    """Print the figures."""
    against_general_integrator()
    print("\nwhole stage, fast model                     million samples/s")
    for name, tables in CASES.items():
        timed(0.1, **tables)
        taken, samples = timed(40.0, **tables)
        print(f"  {name:<41} {samples / taken / 1e6:10.1f}")
    print("\ngrowth with length (free run-down)          time         ns a sample")
    for seconds in (10.0, 40.0, 160.0, 640.0):
        taken, samples = timed(seconds)
        print(
            f"  {samples / 1e6:8.1f} million samples                 {taken:8.2f} s  "
            f" {taken / samples * 1e9:8.1f}"
        )
    print(f"\npeak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024:.0f} MB")


if __name__ == "__main__":
    main()
