"""Programmes in which one run, or one log, is wrong: made from the fast engine's raw samples,
before they are demodulated."""

import copy

import numpy as np
from diagnosis_programme import programme

from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import list_run_ids, simulate

TURNING = (0.0, 1.5, 2.0, -2.0, -1.0, 1.0)
KINDS = {
    "swapped": "channels swapped",
    "inverted": "one channel inverted",
    "gyro": "another gyro",
    "like gyro": "another gyro",
    "sampling": "sampling rate wrong",
    "knock": "knock",
    "sign": "rate log of wrong sign",
    "degrees": "rate log in °/s",
    "scale": "rate log of wrong scale",
    "missing rate": "rate log missing",
    "late": "rate log late",
    "offset": "rate log offset",
    "pressure": "loss of pressure",
    "gain": "one channel's gain changed",
    "range": "one channel's gain changed",
    "late channel": "one channel late",
}
"""Ways a run may be wrong, and what they are to be called."""
COURSES = {"kind": "sine", "amplitude_rad_s": 2.0, "frequency_hz": 0.8}


def table_of(seed, effects=None, *, turning=None, runs=6, **settings):
    """A programme whose runs turn more often than the plain one's."""
    table = programme(seed, effects, runs=runs, **settings)
    if turning is None:
        turning = seed % 2
    if turning and not settings.get("rate"):
        for run, rate in zip(table["run"], TURNING, strict=False):
            run["environment"]["rate_rad_s"] = rate
    return table


def recordings(table, seed=0):
    """The raw samples of every run."""
    return [collect(simulate(table, run=run, seed=seed)) for run in list_run_ids(table)]


def estimated(records, periods_per_window=40.0):
    """Waves of recordings."""
    return [
        collect(estimate(collect(demodulate(r, periods_per_window=periods_per_window))))
        for r in records
    ]


def knocked(table, record, k, at_s, velocity, seed=0):
    """The recording with momentum given to the resonator at an instant, `velocity` (2,) in ωa: its
    answer added (superposition)."""
    size = float(np.hypot(*velocity))
    other = copy.deepcopy(table)
    other["run"] = [copy.deepcopy(table["run"][k])]
    rate = record.sample_rate_hz
    first = round(at_s * rate)
    other["recording"]["duration_s"] = table["recording"]["duration_s"] - first / rate
    other["readout"] = {"noise": 0.0}
    # Re[e^{j(ωt − π/2)}]: no displacement, all velocity
    angle = float(np.arctan2(velocity[1], velocity[0])) / 2
    other["run"][0]["start"] = {
        "wave_angle_rad": angle,
        "phase_rad": -np.pi / 2,
        "quadrature": 0.0,
        "amplitude": size,
    }
    answer = collect(simulate(other))
    c, s = np.array(record.c, float), np.array(record.s, float)
    n = min(len(c) - first, len(answer.c))
    c[first : first + n] += answer.c[:n]
    s[first : first + n] += answer.s[:n]
    return record.replace(c=c, s=s)


def turning_run(table):
    """The first run that turns after the first two."""
    return next(
        k
        for k, run in enumerate(table["run"])
        if k >= 2 and run["environment"].get("rate_rad_s", 1.0)
    )


def wrong(kind, seed, **settings):
    """(waves, run_id of the wrong one) of a programme with one run wrong."""
    random = np.random.default_rng([seed, 77])
    if kind in ("late", "offset"):
        settings["rate"] = COURSES
    table = table_of(seed, **settings)
    k = int(random.integers(0, len(table["run"])))
    if kind in ("sign", "degrees", "scale", "missing rate"):
        k = turning_run(table)
    if kind in ("gyro", "like gyro"):
        own = programme(seed + 500)["device"]
        near = table["device"]["frequency_hz"] * (1 + (3e-3 if kind == "gyro" else 1e-4))
        if kind == "like gyro":
            own = table["device"] | {
                "damping_rate_1_s": table["device"]["damping_rate_1_s"] * 1.02,
                "frequency_split_rad_s": table["device"]["frequency_split_rad_s"] * 1.3,
                "stiffness_axis_rad": table["device"]["stiffness_axis_rad"] + 0.3,
            }
        table["run"][k]["device"] = own | {"frequency_hz": near}
    if kind == "pressure":
        table["run"][k]["device"] = {"damping_rate_1_s": table["device"]["damping_rate_1_s"] * 1.15}
    records = recordings(table, seed)
    one = records[k]
    if kind == "swapped":
        one = one.replace(c=one.s, s=one.c)
    elif kind == "inverted":
        one = one.replace(s=-np.asarray(one.s))
    elif kind == "sampling":
        one = one.replace(
            sample_rate_hz=one.sample_rate_hz * (1.0 + random.choice([-0.2, 0.15, 1.0])),
            nominal_frequency_hz=None,
        )
    elif kind == "knock":
        one = knocked(
            table, one, k, float(random.uniform(0.5, 1.5)), 0.02 * random.standard_normal(2), seed
        )
    elif kind == "sign":
        one = one.replace(rate_rad_s=-np.asarray(one.rate_rad_s))
    elif kind == "degrees":
        one = one.replace(rate_rad_s=np.degrees(one.rate_rad_s))
    elif kind == "scale":
        one = one.replace(rate_rad_s=1.3 * np.asarray(one.rate_rad_s))
    elif kind == "missing rate":
        one = one.replace(rate_rad_s=None)
    elif kind == "late":
        time, rate = np.asarray(one.auxiliary_time_s), np.asarray(one.rate_rad_s)
        one = one.replace(rate_rad_s=np.interp(time - 0.05, time, rate))
    elif kind == "offset":
        one = one.replace(rate_rad_s=np.asarray(one.rate_rad_s) + 0.1)
    elif kind in ("gain", "range"):
        one = one.replace(c=np.asarray(one.c) * (1.05 if kind == "gain" else 10.0))
    elif kind == "late channel":
        one = one.replace(c=np.asarray(one.c)[1:], s=np.asarray(one.s)[:-1])
    records[k] = one
    return estimated(records), table["run"][k]["run_id"]
