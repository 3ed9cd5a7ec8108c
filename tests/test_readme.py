"""The README tells no lie: its generated parts are fresh, its commands run."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

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
