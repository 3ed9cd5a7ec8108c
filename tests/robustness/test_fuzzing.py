"""Damaged inputs: every file is read or refused in one sentence; nothing crashes, hangs, or takes
memory because a header says so."""

from __future__ import annotations

import os
from collections import Counter

import h5py
import numpy as np
import pytest
import records_by_hand
import soundfile

from hrg_cli import store
from robustness import mutation

PEAK_MB = 1200.0
"""Memory a small damaged file may cost at most, over that of the imports."""

CONFIG = """# a gyro
[device]
frequency_hz = 1003.7
time_constant_s = 2.5
damping_split = 0.05
damping_axis_rad = 0.35
frequency_split_rad_s = 0.4
scale_factor = 0.554

[readout]
noise = 5e-4
adc_bits = 16
units = "V"

[recording]
sample_rate_hz = 8000.0
duration_s = 0.05

[effects.gain_mismatch]
gain = 1e-3

[[run]]
run_id = "1"
start.wave_angle_rad = 0.1
environment = { temperature_degc = 0.0, rate_rad_s = 1.0 }
"""


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    """Good files a task may start from."""
    folder = tmp_path_factory.mktemp("good")
    records = [folder / f"{kind}.h5" for kind in records_by_hand.RECORDS]
    for path, (kind, make) in zip(records, records_by_hand.RECORDS.items()):
        store.write(path, make(seconds=0.4) if kind == "recording" else make())
    (folder / "gyro.toml").write_text(CONFIG)
    time = np.arange(400) / 5000
    rows = [
        f"{t:.6f},{np.cos(2 * np.pi * 431 * t):.6f},{np.sin(2 * np.pi * 431 * t):.6f},20.0"
        for t in time
    ]
    (folder / "log.csv").write_text(
        "time [s],C [V],S [V],temperature [degC]\n" + "\n".join(rows) + "\n"
    )
    soundfile.write(
        folder / "log.wav",
        np.stack([np.cos(2 * np.pi * 431 * time), np.sin(2 * np.pi * 431 * time)], 1),
        5000,
    )
    with h5py.File(folder / "log.h5", "w") as file:
        for name, values in (
            ("time", time),
            ("c", np.cos(2 * np.pi * 431 * time)),
            ("s", np.sin(2 * np.pi * 431 * time)),
        ):
            file.create_dataset(name, data=values, chunks=True, compression="gzip")
    logs = [folder / f"log.{suffix}" for suffix in ("csv", "wav", "h5")]
    return {"record": records, "chain": records[:1], "toml": [folder / "gyro.toml"], "log": logs}


@pytest.fixture(scope="module")
def trials():
    running = mutation.Trials()
    yield running
    running.close()


def fuzz(good, trials, folder, tasks: dict[str, int], seed: int) -> Counter:
    rng = np.random.default_rng(seed)
    counts: Counter = Counter()
    failures = []
    for task, number in tasks.items():
        contents = [(path.suffix, path.read_bytes()) for path in good[task]]
        for trial in range(number):
            suffix, content = contents[trial % len(contents)]
            path = folder / f"damaged{suffix}"
            path.write_bytes(mutation.damaged(content, rng))
            answer = trials.attempt(task, path)
            counts[task, answer.result] += 1
            if answer.result not in ("read", "refused") or answer.peak_mb > PEAK_MB:
                kept = path.with_name(f"{task}-{seed}-{trial}-{answer.result}{suffix}")
                os.replace(path, kept)
                failures.append(f"{kept}: {answer.result}, {answer.peak_mb:.0f} MB: {answer.says}")
    assert not failures, f"{len(failures)} of {sum(tasks.values())}, {dict(counts)}\n" + "\n".join(
        failures[:5]
    )
    return counts


@pytest.mark.parametrize("task", ["record", "chain", "toml", "log"])
def test_undamaged_files_are_read(task, good, trials):
    for path in good[task]:
        answer = trials.attempt(task, path)
        assert answer.result == "read", answer


def test_damaged_files_are_read_or_refused(good, trials, tmp_path):
    counts = fuzz(good, trials, tmp_path, {"record": 100, "chain": 12, "toml": 40, "log": 24}, 1)
    assert counts["record", "refused"] > 20 and counts["toml", "refused"] > 10


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 12))
def test_thousands_of_damaged_files(seed, good, trials, tmp_path):
    fuzz(good, trials, tmp_path, {"record": 400, "chain": 50, "toml": 120, "log": 80}, seed)
