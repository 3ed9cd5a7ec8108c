"""The README tells no lie: its generated parts are fresh, its commands run."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from hrg_cli import Calibration, Recording, store
from hrg_cli.reporting import handbook

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"<!-- commands run by a test -->\n```sh\n(.*?)```", README, re.S)


def test_generated_parts_are_fresh():
    assert handbook.renewed(README) == README, "run `python -m hrg_cli.reporting.handbook README.md`"
    for part in handbook.PARTS:
        assert f"<!-- generated: {part} -->" in README


@pytest.mark.parametrize("block", BLOCKS, ids=range(len(BLOCKS)))
def test_commands_run(block, tmp_path):
    for name in ("configs", "sample_data"):
        shutil.copytree(ROOT / name, tmp_path / name)
    hrg = tmp_path / "bin" / "hrg"
    hrg.parent.mkdir()
    hrg.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m hrg_cli.cli "$@"\n')
    hrg.chmod(0o755)
    environment = os.environ | {"PATH": f"{hrg.parent}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    done = subprocess.run(["bash", "-euxc", block], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


def test_library_example_runs(tmp_path, monkeypatch):
    """Four short forced runs on a turning table; the tables of the README's five lines hold the K that was put in."""
    (code,) = re.findall(r"As a library:\n\n```python\n(.*?)```", README, re.S)
    (tmp_path / "runs").mkdir()
    t, scale_factor = np.arange(0, 40, 1 / 1500), 0.55
    for k, rate in enumerate((-0.5, -0.3, 0.3, 0.5)):
        theta = 0.1 - scale_factor * rate * t / 2
        carrier = np.cos(2 * np.pi * 251.3 * t)
        noise = 1e-4 * np.random.default_rng(k).standard_normal((2, len(t)))
        log = dict(auxiliary_time_s=t[::1500], temperature_degc=np.full(len(t[::1500]), 20.0), rate_rad_s=np.full(len(t[::1500]), rate))
        c, s = np.cos(2 * theta) * carrier + noise[0], np.sin(2 * theta) * carrier + noise[1]
        store.write(tmp_path / "runs" / f"{k}.h5", Recording(c=c, s=s, sample_rate_hz=1500.0, mode="forced", run_id=str(k), **log))
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})
    table = store.read(tmp_path / "calibration.h5", Calibration)
    assert np.abs(table.scale_factor - scale_factor).max() < 1e-3 and np.abs(table.drift_rad_s).max() < 1e-3
