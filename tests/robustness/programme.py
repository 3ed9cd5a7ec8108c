"""Every command with small good inputs of its own: what the faults are put into."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path

import forced_runs
import h5py
import numpy as np
import records_by_hand
import scipy.io
import soundfile
import synthetic_waves

from hrg_cli import pipeline, settings, store
from hrg_cli.ledger import database, entering
from robustness import judge

ROOT = Path(__file__).parents[2]
GYRO = """# a gyro
[device]
frequency_hz = 1003.7
time_constant_s = 2.5
damping_split = 0.05
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
LIMITS = """[resonator]
frequency_split_rad_s = { maximum = 0.5 }
[calibration]
bias_rad_s = { minimum = -1.0, maximum = 1.0 }
[wave]
flagged_part = 0.1
"""


@dataclass(frozen=True)
class Case:
    """A command; `{NAME}` in its words is an input, `{out}` the output; `damaged`: the inputs that
    faults are put into."""

    name: str
    words: tuple[str, ...]
    damaged: tuple[str, ...]
    output: str
    costly: bool = False


def _case(name: str, text: str, damaged: str, output: str, costly: bool = False) -> Case:
    return Case(name, tuple(text.split()), tuple(damaged.split()), output, costly)


FORCED = " ".join(f"{{forced{n}.h5}}" for n in range(6))
SHOWN = "{wave.h5} {calibration.h5} {diagnosis.h5}"
CASES = (
    _case("demodulate", "demodulate {recording.h5} -o {out}", "recording.h5", "out.h5"),
    _case("estimate", "estimate {periods.h5} -o {out}", "periods.h5", "out.h5"),
    _case("identify", "identify {free0.h5} {free1.h5} {free2.h5} -o {out}", "free0.h5", "out.h5"),
    _case(
        "rate",
        "rate {free0.h5} --resonator {resonator.h5} -o {out} --nodes 4",
        "free0.h5 resonator.h5",
        "out.h5",
    ),
    _case(
        "calibrate",
        f"calibrate {FORCED} -o {{out}} --harmonics 1",
        "forced0.h5",
        "out.h5",
    ),
    _case(
        "compensate",
        "compensate {forced0.h5} --calibration {calibration.h5} -o {out}",
        "forced0.h5 calibration.h5",
        "out.h5",
    ),
    _case("diagnose", "diagnose {free0.h5} {free1.h5} -o {out}", "free0.h5", "out.h5", costly=True),
    _case(
        "update",
        "update {calibration.h5} --resonator {later.h5} -o {out}",
        "calibration.h5 later.h5",
        "out.h5",
    ),
    _case(
        "forecast",
        "forecast {resonator.h5} -o {out} --duration-s 20",
        "resonator.h5",
        "out.csv",
    ),
    _case("mismatch", "mismatch {forced0.h5} -o {out}", "forced0.h5", "out.csv"),
    _case(
        "inject",
        "inject {recording.h5} --effect gain_mismatch --set gain=1e-3 -o {out}",
        "recording.h5",
        "out.h5",
    ),
    _case("diff", "diff {resonator.h5} {later.h5} -o {out}", "resonator.h5 later.h5", "out.json"),
    _case("export csv", "export {calibration.h5} -o {out}", "calibration.h5", "out.csv"),
    _case("export json", "export {calibration.h5} -o {out}", "calibration.h5", "out.json"),
    _case("export header", "export {calibration.h5} -o {out}", "calibration.h5", "out.h"),
    _case(
        "export fixed",
        "export {calibration.h5} -o {out} --fixed-point-bits 16",
        "calibration.h5",
        "out.h",
    ),
    _case(
        "check resonator",
        "check {resonator.h5} --limits {limits.toml} -o {out}",
        "resonator.h5 limits.toml",
        "out.json",
    ),
    _case(
        "check calibration",
        "check {calibration.h5} --limits {limits.toml} -o {out}",
        "calibration.h5",
        "out.json",
    ),
    _case("info recording", "info {recording.h5} -o {out}", "recording.h5", "out.json"),
    _case("info calibration", "info {calibration.h5} -o {out}", "calibration.h5", "out.json"),
    _case("info diagnosis", "info {diagnosis.h5} -o {out}", "diagnosis.h5", "out.json"),
    _case("verify", "verify {wave.h5} {resonator.h5} -o {out}", "wave.h5 resonator.h5", "out.json"),
    _case(
        "ledger add",
        "ledger add {resonator.h5} {diagnosis.h5} --ledger {out}",
        "resonator.h5",
        "out.sqlite",
    ),
    _case(
        "ledger show",
        "ledger show --ledger {ledger.sqlite} --limits {limits.toml} --golden G-17 -o {out}",
        "ledger.sqlite limits.toml",
        "out.json",
    ),
    _case(
        "ledger history",
        "ledger history G-17 --ledger {ledger.sqlite} --limits {limits.toml} -o {out}",
        "ledger.sqlite limits.toml",
        "out.json",
    ),
    _case("simulate", "simulate {gyro.toml} -o {out} --seed 1", "gyro.toml", "out.h5"),
    _case("simulate loops", "simulate {loops.toml} -o {out} --seed 1", "loops.toml", "out.h5"),
    _case(
        "simulate bench",
        "simulate {bench.toml} -o {out} --seed 1 --run sine",
        "bench.toml",
        "out.h5",
    ),
    _case("import csv", "import {log.csv} -o {out}", "log.csv", "out.h5"),
    _case("import wav", "import {log.wav} -o {out}", "log.wav", "out.h5"),
    _case("import hdf5", "import {log.h5} -o {out}", "log.h5", "out.h5"),
    _case("import matlab", "import {log.mat} -o {out}", "log.mat", "out.h5", costly=True),
    _case("import parquet", "import {log.parquet} -o {out}", "log.parquet", "out.h5"),
    _case("import tdms", "import {log.tdms} -o {out}", "log.tdms", "out.h5"),
    _case(
        "plan",
        "plan {resonator.h5} --menu {menu.toml} -o {out}",
        "resonator.h5 menu.toml",
        "out.toml",
        costly=True,
    ),
    _case(
        "report",
        "report {wave.h5} {calibration.h5} {diagnosis.h5} -o {out}",
        "wave.h5 calibration.h5 diagnosis.h5",
        "out.html",
        costly=True,
    ),
    _case(
        "rehearse",
        "rehearse {resonator.h5} {free0.h5} {free1.h5} {free2.h5} --times 2 --keep-file -o {out}",
        "resonator.h5 free0.h5",
        "out.json",
        costly=True,
    ),
    _case("run", "run {recording.h5} -o {out}", "recording.h5", "out", costly=True),
    _case("batch", "batch {lot.toml} -o {out}", "lot.toml recording.h5", "out", costly=True),
)


def build(folder: Path) -> Path:
    """The good inputs of every command."""
    store.write(folder / "recording.h5", records_by_hand.recording(seconds=0.3))
    values = settings.check_settings(pipeline.STAGES["demodulate"].load_function(), {})
    pipeline.run_stage("demodulate", [folder / "recording.h5"], folder / "periods.h5", values)
    for n, (theta, rate) in enumerate(((0.1, 0.0), (0.6, 2.0), (0.4, -2.0))):
        wave = synthetic_waves.run_down(
            theta, rate, seconds=1.0, window=5e-3, seed=n, gyro_id="G-17"
        )
        store.write(folder / f"free{n}.h5", wave)
        warm = replace(wave, temperature_degc=np.full(len(wave), 20.0))
        store.write(folder / f"warm{n}.h5", warm)
    truth = forced_runs.Truth()
    for n, (temperature, rate) in enumerate((t, r) for t in (0.0, 40.0) for r in (-0.5, 0.02, 0.5)):
        wave = forced_runs.forced_run(
            truth, temperature, rate, 40.0, n, dt=0.4, run_id=f"{n}", gyro_id="G-17"
        )
        store.write(folder / f"forced{n}.h5", wave)
    values = settings.check_settings(pipeline.STAGES["identify"].load_function(), {})
    for name, waves in (("resonator", "free"), ("later", "warm")):
        pipeline.run_stage(
            "identify",
            [folder / f"{waves}{n}.h5" for n in range(3)],
            folder / f"{name}.h5",
            values,
        )
    for kind in ("wave", "diagnosis"):
        record = records_by_hand.RECORDS[kind]()
        store.write(folder / f"{kind}.h5", record if kind != "wave" else record.rows(0, 300))
    table = settings.check_settings(pipeline.STAGES["calibrate"].load_function(), {"harmonics": 1})
    pipeline.run_stage(
        "calibrate", [folder / f"forced{n}.h5" for n in range(6)], folder / "calibration.h5", table
    )
    database.add_entries(
        folder / "ledger.sqlite",
        [
            entering.make_entry(folder / f"{kind}.h5", "", {})
            for kind in ("resonator", "calibration")
        ],
    )
    (folder / "gyro.toml").write_text(GYRO)
    (folder / "limits.toml").write_text(LIMITS)
    shutil.copy(ROOT / "configs" / "menu.toml", folder)
    for name in ("loops.toml", "bench.toml"):
        shutil.copy(Path(__file__).with_name(name), folder)
    (folder / "lot.toml").write_text('recordings = "recording.h5"\nstages = ["identify"]\n')
    _logs(folder)
    return folder


def _logs(folder: Path) -> None:
    """One log in every foreign format."""
    time = np.arange(400) / 5000
    c, s = np.cos(2 * np.pi * 431 * time), np.sin(2 * np.pi * 431 * time)
    rows = [f"{t:.6f},{a:.6f},{b:.6f},20.0" for t, a, b in zip(time, c, s)]
    (folder / "log.csv").write_text(
        "time [s],C [V],S [V],temperature [degC]\n" + "\n".join(rows) + "\n"
    )
    soundfile.write(folder / "log.wav", np.stack([c, s], 1), 5000)
    with h5py.File(folder / "log.h5", "w") as file:
        for name, values in (("time", time), ("c", c), ("s", s)):
            file.create_dataset(name, data=values, chunks=True, compression="gzip")
    scipy.io.savemat(folder / "log.mat", {"time": time, "c": c, "s": s})
    try:
        import pandas as pd

        pd.DataFrame({"time": time, "c": c, "s": s}).to_parquet(folder / "log.parquet")
    except ImportError:
        pass
    try:
        from nptdms import ChannelObject, TdmsWriter

        with TdmsWriter(folder / "log.tdms") as writer:
            writer.write_segment(
                [
                    ChannelObject("g", name, values)
                    for name, values in (("time", time), ("c", c), ("s", s))
                ]
            )
    except ImportError:
        pass


def prepared(case: Case, good: Path, folder: Path) -> list[str]:
    """All inputs of a command in an empty folder, and its command line there."""
    judge.clean(folder)
    named = {word[1:-1] for word in case.words if word.startswith("{") and word != "{out}"}
    for name in {*named, *case.damaged}:
        shutil.copy(good / name, folder / name)
    words = [
        str(folder / (case.output if word == "{out}" else word[1:-1])) if word[0] == "{" else word
        for word in case.words
    ]
    return [*words, "-q", "--json"]


def ready(folder: Path, costly: bool = True) -> list[Case]:
    """The cases whose inputs could be made here."""
    return [
        case
        for case in CASES
        if (costly or not case.costly) and all((folder / name).exists() for name in case.damaged)
    ]


def named(cases: list[Case], only: str) -> list[Case]:
    """The cases whose names begin with one of the words in `only`, which commas join."""
    return [case for case in cases if case.name.startswith(tuple(only.split(",")))]
