"""Lots of forced gyros drawn at random: what is called valid is as good as it says, and auto takes
a variant as good as the best."""

import json

import numpy as np
import pytest
from drawn_gyros import Drawn

from hrg_cli.errors import HrgError
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.calibration.interpolation import compute_standard_deviations

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
        error = record.values_at(x, theta)[0] - truth
        z = error / compute_standard_deviations(record, x, theta)[0]
        out[model] = (
            record.status == "valid",
            float(np.sqrt(np.mean(z**2))),
            float(np.sqrt(np.mean(error**2))),
        )
    return out


def judge(lots, least_share, least_within):
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
    assert np.mean(np.array(ratios) < 1.1) >= least_share, np.round(ratios, 2)
    assert np.mean(surely) >= least_within, np.round(ratios, 2)


def test_no_random_walk_is_found_where_there_is_none():
    """A gyro with measured parts that are nearly functions of each other: a direction that the data
    hardly see may not pass for a walk. What is valid then is judged at the noise there is."""
    record = calibrate(Drawn(1003).programme(), bootstrap=0)
    assert json.loads(record.details)["noise"]["angle_random_walk_rad_sqrt_s"] == 0.0
    assert record.status == "valid"


def test_an_average_over_harmonics_is_tested_where_its_own_fit_would_stand():
    """Its average shrinks harmonics by parts of their error; nearly invisible combinations made a
    score of hundreds of that."""
    record = calibrate(Drawn(1044).programme(), bootstrap=0)
    assert record.model == "combined" and record.status == "valid", record.status_reasons


def test_a_first_harmonic_alone_does_not_deny_the_harmonics_it_leaves_out():
    """A harmonic 8θ too faint to be proven is in the stated error of a model without it, and in
    what it does to the others; where the user leaves it out, it is not."""
    z = []
    for seed in (2, 7, 12):
        gyro = Drawn(seed)
        assert gyro.kind == "faint"
        waves = gyro.programme()
        record = calibrate(waves, model="parametric", bootstrap=0)
        theta = np.linspace(0, np.pi, 60, endpoint=False)
        for node in gyro.temperatures:
            at = np.full_like(theta, node)
            error = record.values_at(at, theta)[0] - gyro.tables(at, theta)[0]
            z.append(np.mean((error / compute_standard_deviations(record, at, theta)[0]) ** 2))
        assert np.all(record.drift_harmonics_std[:, 3:5] > 0)
    assert np.sqrt(np.mean(z)) < 1.5
    alone = calibrate(waves, model="parametric", harmonics=1, bootstrap=0)
    assert alone.drift_harmonics.shape[1] == 3


def test_a_firm_loop_and_a_soft_one():
    """Of the soft one the split is known from the frequency: which of two variants that each knew
    half of it had the better luck, no rule could tell."""
    judge([tried(seed) for seed in (0, 18)], 1.0, 1.0)


@pytest.mark.slow
def test_a_hundred_gyros():
    judge([tried(seed) for seed in range(100)], 0.95, 0.97)


@pytest.mark.slow
def test_a_quadrature_read_too_large_stays_in_the_error():
    """5 % of the split's drift, some σ to a hundred: the drift departs from what the frequency
    tells."""
    z = []
    for seed in (3, 4, 8, 9, 13, 14, 18, 19):
        gyro = Drawn(seed)
        waves = [
            wave.replace(quadrature_amplitude=1.05 * np.asarray(wave.quadrature_amplitude))
            for wave in gyro.programme()
        ]
        record = calibrate(waves, bootstrap=0)
        assert record.status == "valid", record.status_reasons
        theta = np.linspace(0, np.pi, 60, endpoint=False)
        for node in gyro.temperatures:
            at = np.full_like(theta, node)
            error = record.values_at(at, theta)[0] - gyro.tables(at, theta)[0]
            z.append(np.mean((error / compute_standard_deviations(record, at, theta)[0]) ** 2))
    assert np.sqrt(np.mean(z)) < 1.4
