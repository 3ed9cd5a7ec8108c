"""The outsider's check of files, JSON and exit codes, where it is there."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


def test_the_outsiders_check_passes(tmp_path):
    script = os.environ.get("HRG_CONTRACT_CHECK", "")
    if not Path(script).is_file():
        pytest.skip("HRG_CONTRACT_CHECK names no script")
    done = subprocess.run(
        [
            sys.executable,
            script,
            "--hrg",
            f"{sys.executable} -m hrg_cli.cli",
            "--keep",
            str(tmp_path),
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, [
        line for line in done.stdout.splitlines() if not line.startswith("ok")
    ]
