"""Programmes of runs for the diagnosis tests: random devices, the fast engine's raw samples,
demodulated and estimated."""

import numpy as np

from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import list_run_ids, simulate

RATES = (0.0, 0.0, 2.0, -2.0, 0.0, 0.0, 1.0, -1.0)


def programme(
    seed,
    effects=None,
    *,
    runs=6,
    duration_s=2.0,
    noise=3e-4,
    forced=False,
    quadrature_loop="off",
    cycle=False,
    rate=None,
):
    """A simulation file's tables: a random device at several angles, amplitudes, rates and
    temperatures; `forced`: every other run."""
    random = np.random.default_rng(seed)
    table = {
        "device": {
            "frequency_hz": random.uniform(4500, 5500),
            "damping_rate_1_s": random.uniform(0.25, 0.4),
            "damping_split_1_s": random.uniform(0.005, 0.02),
            "damping_axis_rad": random.uniform(0, 1.5),
            "frequency_split_rad_s": random.uniform(0.05, 0.15),
            "stiffness_axis_rad": random.uniform(0, 1.5),
            "scale_factor": random.uniform(0.5, 0.6),
        },
        "recording": {"sample_rate_hz": 20011.0, "duration_s": duration_s},
        "readout": {"noise": noise},
        "effects": effects or {},
        "run": [],
    }
    for k in range(runs):
        warm = {
            "kind": "ramp",
            "start_degc": 22.0 + k % 3,
            "stop_degc": 22.0 + k % 3 + (1.0, -0.8, 0.5)[k % 3],
        }
        if cycle:
            warm = {
                "kind": "cycle",
                "low_degc": 22.0,
                "high_degc": 23.0,
                "period_s": duration_s * (0.5, 0.75, 1.0)[k % 3],
                "shape": "sine",
            }
        run = {
            "run_id": f"run{k}",
            "start": {
                "wave_angle_rad": 0.25 * k + random.uniform(0, 0.1),
                "phase_rad": random.uniform(0, 6),
                "quadrature": random.uniform(-0.1, 0.1),
                "amplitude": (1.0, 0.5, 1.0, 0.7)[k % 4],
            },
            "environment": {"temperature": warm}
            | ({"rate": rate} if rate else {"rate_rad_s": RATES[k]}),
        }
        if forced and k % 2 == 0:
            run["control"] = {"mode": "forced", "quadrature_loop": quadrature_loop}
            run["start"]["quadrature"] = 0.0
        table["run"].append(run)
    return table


def waves(table, extra=(), seed=0, periods_per_window=40.0):
    """What the chain makes of the programme's raw samples."""
    out = []
    for run in list_run_ids(table):
        periods = collect(
            demodulate(
                collect(simulate(table, extra, run=run, seed=seed)),
                periods_per_window=periods_per_window,
            )
        )
        out.append(collect(estimate(periods)))
    return out


def verdict(table, extra=(), **settings):
    """The diagnosis and its JSON."""
    diagnosis = diagnose(waves(table, extra), **settings)
    return diagnosis, summarise(diagnosis)
