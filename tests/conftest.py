"""What several tests need: the command line in this process, small recordings, the measured
data."""

import json
import os
import re
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import hypothesis.core
import numpy as np
import pytest
from hypothesis import HealthCheck, settings

import hrg_cli
from hrg_cli.records import Recording

PACKAGE = Path(hrg_cli.__file__).parents[1]
"""Where the package under test lies: a process that a test starts must import the same one."""


def importing_the_same() -> dict[str, str]:
    """Environment of a process that imports what this one can: the package, the tests' helpers."""
    return os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}


SEED = os.environ.get("HRG_TEST_SEED", "")
"""Empty: every drawn example is the same each time; a number: another set of examples (`make
faults` gives another each time)."""
settings.register_profile(
    "hrg",
    deadline=None,
    derandomize=not SEED,
    suppress_health_check=[HealthCheck.too_slow],
    print_blob=bool(SEED),
)
settings.load_profile("hrg")
if SEED:
    hypothesis.core.global_force_seed = int(SEED)

EXPECTED_SKIPS = (
    r"HRG_MEASURED_DATA",  # recordings that are not part of the project
    r"HRG_CONTRACT_CHECK",
    r"no right to mount",  # a small or read-only disk needs root
    r"root may read and write everywhere",
    r"no openssl here",
    r"a column that is its own scale",
)
"""Reasons that a test may be left out for. In CI (the environment variable CI) any other reason
fails the run: a test that silently no longer runs tests nothing."""
_skipped: Counter = Counter()


def pytest_runtest_logreport(report):
    if report.skipped and isinstance(report.longrepr, tuple):
        _skipped[report.longrepr[2].removeprefix("Skipped: ")] += 1


def unexpected_skips(reasons):
    """Reasons that are not among those expected."""
    return sorted(
        reason
        for reason in reasons
        if not any(re.search(expected, reason) for expected in EXPECTED_SKIPS)
    )


def pytest_sessionfinish(session, exitstatus):
    if os.environ.get("CI") and exitstatus == 0 and unexpected_skips(_skipped):
        session.exitstatus = 1


def pytest_terminal_summary(terminalreporter):
    for reason, count in sorted(_skipped.items()):
        terminalreporter.write_line(f"skipped {count} ×: {reason}")
    for reason in unexpected_skips(_skipped):
        terminalreporter.write_line(f"NOT EXPECTED to be skipped (fails in CI): {reason}")


@dataclass
class Result:
    """What a command left behind."""

    status: int
    out: str
    err: str

    @property
    def json(self):
        return json.loads(self.out)


@pytest.fixture
def hrg(monkeypatch, capsys):
    """Run `hrg` with arguments in this process."""
    from hrg_cli.cli import main

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["hrg", *map(str, arguments)])
        capsys.readouterr()
        try:
            main()
            status = 0
        except SystemExit as leaving:
            status = int(leaving.code or 0)
        out, err = capsys.readouterr()
        return Result(status, out, err)

    return run


@pytest.fixture(scope="session")
def measured_data():
    """The folder of measured recordings, or a skip that says how to name it."""
    folder = os.environ.get("HRG_MEASURED_DATA", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("HRG_MEASURED_DATA names no folder of measured recordings")
    return Path(folder)


def ringing(
    frequency_hz=1000.0,
    sample_rate_hz=10000.0,
    seconds=0.4,
    decay_1_s=1.0,
    angle_rad=0.3,
    noise=1e-3,
    seed=0,
    full_scale=1.0,
    **fields,
):
    """A recording of a decaying standing wave, 16 bit."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * sample_rate_hz)) / sample_rate_hz
    wave = 0.8 * np.exp(-decay_1_s * t) * np.cos(2 * np.pi * frequency_hz * t + 0.4)
    lsb = full_scale / 32767
    c, s = (
        np.round(
            np.clip((g * wave + noise * rng.standard_normal(len(t))) / lsb, -32767, 32767)
        ).astype("i2")
        for g in (np.cos(2 * angle_rad), np.sin(2 * angle_rad))
    )
    given = dict(
        c=c,
        s=s,
        sample_rate_hz=sample_rate_hz,
        mode="free",
        c_scale_factor=lsb,
        s_scale_factor=lsb,
        c_units="V",
        s_units="V",
        gyro_id="G",
        run_id="r",
    )
    return Recording(**(given | fields))
