"""Lots of forced gyros drawn at random: what is called valid is as good as it says, and auto takes
a variant as good as the best."""

import numpy as np
import pytest
from drawn_gyros import Drawn

from hrg_cli.errors import HrgError
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.calibration.table import standard_deviations, values

VARIANTS = ("auto", "table", "parametric", "quadrature", "phase", "combined")


def tried(seed):
    """{variant: (valid, rms of error/σ, rms error) at temperatures and angles never seen} of one
    gyro."""
    gyro = Drawn(seed)
    waves = gyro.programme()
    draw = np.random.default_rng(seed)
    x, theta = (
        draw.uniform(gyro.temperatures[0], gyro.temperatures[-1], 300),
        draw.uniform(0, np.pi, 300),
    )
    truth = gyro.tables(x, theta)[0]
    out = {}
    for model in VARIANTS:
        try:
            record = calibrate(waves, model=model, bootstrap=0)
        except HrgError:
            continue  # a gyro without a quadrature has no part to be measured
        error = values(record, x, theta)[0] - truth
        z = error / standard_deviations(record, x, theta)[0]
        out[model] = (
            record.status == "valid",
            float(np.sqrt(np.mean(z**2))),
            float(np.sqrt(np.mean(error**2))),
        )
    return out


def judge(lots, least_share):
    valid = {
        model: [found[model][1] for found in lots if model in found and found[model][0]]
        for model in VARIANTS
    }
    assert len(valid["auto"]) >= 0.9 * len(lots)
    for model, z in valid.items():
        # an own table has some ten coefficients: its rms scatters by a fifth, that of many by less
        assert not z or np.sqrt(np.mean(np.square(z))) < 1.3 * (1 + 0.3 / np.sqrt(len(z))), (
            model,
            z,
        )
        assert max(z, default=0.0) < 2.2, (model, z)
    ratios, surely = [], []
    for found in lots:
        _, z, error = found["auto"]
        ratios.append(error / min(e for model, (_, _, e) in found.items() if model != "auto"))
        # which of several that fit had the better luck nobody can know: an error within the stated
        # one is as good
        surely.append(ratios[-1] < 1.1 or z < 1.0)
    assert np.mean(np.array(ratios) < 1.1) >= least_share and np.mean(surely) >= 0.95, np.round(
        ratios, 2
    )


def test_a_firm_loop_and_a_soft_one():
    judge([tried(seed) for seed in (0, 8)], 0.5)


@pytest.mark.slow
def test_a_hundred_gyros():
    judge([tried(seed) for seed in range(100)], 0.8)
