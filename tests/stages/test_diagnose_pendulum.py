"""The recorded Foucault pendulum: the linear model with the known Earth rate is far from enough, and the tool says so."""

import os
from pathlib import Path

import numpy as np
import pytest

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose, summary
from hrg_cli.stages.estimate import estimate
from hrg_cli.units import DEGREE_PER_HOUR

EARTH_RATE_RAD_S = 10.96 * DEGREE_PER_HOUR


def pendulum():
    folder = os.environ.get("HRG_MEASURED_DATA")
    if not folder:
        pytest.skip("set HRG_MEASURED_DATA to the folder of measured data")
    rows = [line.split(",") for line in (Path(folder) / "foucault_yverdon" / "oscillation4.csv").read_text().split()]
    x, y = np.array([[float(a), float(b)] for a, b, _ in rows]).T
    t = np.array([sum(float(part) * unit for part, unit in zip(clock.split(":"), (3600, 60, 1), strict=True)) for *_, clock in rows])
    keep = np.concatenate([[True], np.diff(t) > 0])
    t = (t - t[0])[keep]
    return Recording(
        c=(x - x.mean())[keep], s=(y - y.mean())[keep], time_s=t, mode="free", mode_number=1, run_id="yverdon",
        auxiliary_time_s=t[[0, -1]], rate_rad_s=np.full(2, EARTH_RATE_RAD_S),
    )  # fmt: skip


@pytest.mark.slow
def test_the_pendulum_is_more_than_linear():
    wave = collect(estimate(collect(demodulate(pendulum(), periods_per_window=2.0))))
    out = summary(diagnose([wave], scale_factor=1.0))
    assert out["verdict"] in ("partly explained", "unexplained")
    assert out["baseline"]["chi2_per_dof"] > 10
    assert out["effects"] or out["remainder"]["terms"]
