"""What a drive's log leaves unknown of runs that are held out is judged beside the cause that is asked
for, and without it beside none."""

import zlib

import numpy as np

from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.studies.hidden import hide


def test_a_drive_turned_by_sixteen_sigma_is_named():
    """Found at 15 σ it was given up: along the walk that was found beside no cause, which held what
    the cause does, the runs left out were foretold better without."""
    random = np.random.default_rng([7, 0, zlib.crc32(b"drive_rotation")])
    seed = int(random.integers(2**31)) + 3
    hidden = hide("drive_rotation", random, 3e-4)
    report = summarise(diagnose(hidden.measure(16.0, seed)))
    assert [one["name"] for one in report["effects"]] == ["drive_rotation"]
    (angle,) = report["effects"][0]["parameters"].values()
    true = hidden.choose_values(16.0)["electrical_angle_rad"]
    assert abs(angle["value"] - true) < 4 * angle["std"]
