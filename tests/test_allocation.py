"""Freed memory that stays with the process."""

import platform
import subprocess
import sys

import pytest

BLOCKS = """
import resource, sys
import numpy as np
from hrg_cli.allocation import keep_freed
if sys.argv[1] == "keep":
    keep_freed()
for _ in range(200):
    blocks = [np.ones(1 << 20) for _ in range(4)]
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt)
"""


def count_faults(how: str) -> int:
    run = subprocess.run(
        [sys.executable, "-c", BLOCKS, how], capture_output=True, text=True, check=True
    )
    return int(run.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library keeps its own way")
def test_blocks_that_come_again_find_their_pages():
    assert 4 * count_faults("keep") < count_faults("leave")
