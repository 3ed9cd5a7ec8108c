"""A test that is left out for a reason nobody expects fails CI; expected ones are counted."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CONFTEST = Path(__file__).with_name("conftest.py")


@pytest.mark.parametrize(
    ("reason", "ci", "status"),
    [
        ("no time today", "1", 1),
        ("HRG_MEASURED_DATA names no folder", "1", 0),
        ("no time today", "", 0),
        ("chromium and chromium-driver are not installed", "1", 1),
    ],
)
def test_unexpected_skips_fail_in_ci(reason, ci, status, tmp_path):
    (tmp_path / "conftest.py").write_text(CONFTEST.read_text())
    (tmp_path / "test_one.py").write_text(
        f"import pytest\n\n\ndef test_a():\n    pytest.skip({reason!r})\n\n\ndef test_b():\n   "
        " pass\n"
    )
    environment = {
        **os.environ,
        "CI": ci,
        "PYTHONPATH": os.pathsep.join([str(CONFTEST.parents[1]), os.environ.get("PYTHONPATH", "")]),
    }
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", str(tmp_path)]
    done = subprocess.run(
        command, capture_output=True, text=True, env=environment, cwd=tmp_path, check=False
    )
    assert done.returncode == status, done.stdout
    assert f"skipped 1 ×: {reason}" in done.stdout
    assert ("NOT EXPECTED" in done.stdout) == (not reason.startswith("HRG_"))
