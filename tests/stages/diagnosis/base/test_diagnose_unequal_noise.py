"""Channels of unequal noise, and noise that both have in common: every channel is weighed by its own
in `diagnose` and `identify`. Samples of the fast engine, noise added beside it."""

import numpy as np
import pytest

from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify
from hrg_cli.stages.simulate import simulate

NOISE = 1e-4
GAIN, PULL = 3e-3, 0.01
DEVICE = {
    "frequency_hz": 1000.0,
    "quality_factor": 20_000.0,
    "damping_split": 0.02,
    "damping_axis_rad": 0.3,
    "frequency_split_hz": 0.03,
    "stiffness_axis_rad": 0.5,
}
NU = np.pi * 1000 / 20_000


def samples(effects=None, rates=(1.0, -1.0, 0.5)):
    """Recordings without noise."""
    table = {
        "device": DEVICE,
        "effects": effects or {},
        "recording": {"sample_rate_hz": 8000.0, "duration_s": 2.0},
        "run": [
            {"run_id": f"run{k}", "environment": {"rate_rad_s": rate}}
            for k, rate in enumerate(rates)
        ],
    }
    return [collect(simulate(table, model="fast", run=run["run_id"])) for run in table["run"]]


def waves(quiet, c, s, seed=0, turned_rad=0.0):
    """Waves of the recordings with noise of c and s times `NOISE` in the channels, which are turned
    by an angle afterwards."""
    random = np.random.default_rng(seed)
    turn = np.array(
        [
            [np.cos(turned_rad), -np.sin(turned_rad)],
            [np.sin(turned_rad), np.cos(turned_rad)],
        ]
    )
    out = []
    for one in quiet:
        noise = NOISE * np.array([[c], [s]]) * random.standard_normal((2, len(one.c)))
        seen = turn @ (np.stack([one.c, one.s]) + noise)
        noisy = one.replace(c=seen[0], s=seen[1])
        out.append(collect(estimate(collect(demodulate(noisy, periods_per_window=20)))))
    return out


def pooled(runs):
    """The waves as if both channels had one noise."""
    return [run.replace(channel_std=None, noise_correlation=None) for run in runs]


def named(found):
    """Verdict, χ² per degree of freedom, and each cause's first parameter with its σ."""
    report = summarise(found)
    causes = {
        one["name"]: next((p["value"], p["std"]) for p in one["parameters"].values())
        for one in report["effects"]
    }
    return report["verdict"], report["after"]["chi2_per_dof"], causes


@pytest.fixture(scope="module")
def clean():
    return samples()


@pytest.mark.parametrize("c, s", [(3, 1), (1, 10)])
def test_clean_gyros_are_adequate_whatever_a_channel_s_noise(clean, c, s):
    verdict, chi2, causes = named(diagnose(waves(clean, c, s)))
    assert (verdict, causes) == ("adequate", {})
    assert chi2 == pytest.approx(1, abs=0.12)


def test_a_cause_beside_unequal_noise_is_named_alone_at_its_size():
    runs = waves(samples({"gain_mismatch": {"gain": GAIN}}), 3, 1)
    verdict, _, causes = named(diagnose(runs))
    assert (verdict, list(causes)) == ("explained", ["gain_mismatch"])
    value, std = causes["gain_mismatch"]
    assert abs(value - GAIN) < 3 * std


def test_weighing_makes_known_better_than_one_noise_for_both(clean):
    runs = waves(clean, 3, 1)
    weighed, blunt = (
        fit_base(one, scale_factor=None, blocks=120, free_phase=False)
        for one in (runs, pooled(runs))
    )
    for name in ("damping", "damping_cos", "scale_factor"):
        assert weighed.coordinate_std(name) < blunt.coordinate_std(name)
    assert weighed.coordinate_std("scale_factor") < 0.75 * blunt.coordinate_std("scale_factor")


def test_channels_turned_into_one_another_say_the_same(clean):
    """The noise of turned channels is common to both; the answer does not know the angle."""
    quiet = samples({"cubic_stiffness": {"pull_rad_s": PULL}})
    plain, turned = (
        named(diagnose(waves(quiet, 5, 1, turned_rad=angle))) for angle in (0.0, np.pi / 4)
    )
    assert plain[0] == turned[0] == "explained"
    assert list(plain[2]) == list(turned[2]) == ["cubic_stiffness"]
    (value, std), (again, its) = plain[2]["cubic_stiffness"], turned[2]["cubic_stiffness"]
    assert abs(value - PULL) < 3 * std
    assert abs(again - value) < 0.3 * std
    assert its == pytest.approx(std, rel=0.1)


def test_identify_weighs_channels_by_their_own_noise(clean):
    names = ["damping_rate_1_s", "damping_split_1_s", "frequency_split_rad_s", "scale_factor"]
    truth = np.array([NU, 0.02 * NU, np.pi * 0.03, 0.55])

    def fitted(runs):
        record = identify(runs)
        at = [list(record.name).index(name) for name in names]
        return record.value[at], record.std[at]

    errors = []
    for seed in range(4):
        runs = waves(clean, 1, 10, seed)
        value, std = fitted(runs)
        errors.append((value - truth) / std)
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.4
    blunt = fitted(pooled(runs))[1]
    assert np.all(std < 0.9 * blunt) and std[-1] < 0.5 * blunt[-1]


def test_the_level_of_equal_noise_alone_changes_nothing(clean):
    runs = waves(clean, 1, 1)
    known, alike = identify(runs), identify(pooled(runs))
    np.testing.assert_array_equal(known.value, alike.value)
    np.testing.assert_array_equal(known.std, alike.std)
