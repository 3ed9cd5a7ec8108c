"""Threads of the numerical libraries, as the command starts them."""

import os
import subprocess
import sys

import pytest

SEEN = (
    "import os, sys\nfrom hrg_cli import cli\nsys.argv = ['hrg', '--version']\n"
    "try:\n    cli.main()\nexcept SystemExit:\n    pass\n"
    "print(os.environ['OMP_NUM_THREADS'], os.environ['OPENBLAS_NUM_THREADS'])"
)


@pytest.mark.parametrize(("asked", "seen"), [({}, "1 1"), ({"OMP_NUM_THREADS": "3"}, "3 1")])
def test_one_thread_unless_the_user_says_otherwise(asked, seen):
    known = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    run = subprocess.run(
        [sys.executable, "-c", SEEN], env=known | asked, capture_output=True, text=True, check=True
    )
    assert run.stdout.splitlines()[-1] == seen
