"""A split that is not clear of its noise: its size and axis are not Gaussian, so every method states
its components."""

import json
from dataclasses import replace

import numpy as np
import pytest
from synthetic_waves import GYRO, programme

from hrg_cli.fitting.envelopes.coordinates import SPLITS
from hrg_cli.stages.identification.splits import describe_weak_splits
from hrg_cli.stages.identify import identify

STARTS = ((0.0, 0.8), (0.3, -0.8), (0.6, 0.0))


def found(split_over_sigma, seed):
    """All methods' answers to three runs whose frequency split is so many standard deviations."""
    gyro = replace(GYRO, frequency_split_rad_s=5e-4 * split_over_sigma, damping_split_1_s=0.06)
    waves = programme(gyro, seed, STARTS, std=6e-3, seconds=6.0, window=0.02)
    return gyro, json.loads(identify(waves, method="all", scale_factor=0.55).details)


def test_every_method_states_a_weak_split_by_its_components():
    """Where the size is below 8 of its standard deviations every method says so, and the components
    it gives are right; the damping split, which is clear, is left as it is."""
    size, _, names = SPLITS[1]
    gyro, details = found(3.0, 4)
    angle = 2 * gyro.mode_number * gyro.stiffness_axis_rad
    true = gyro.frequency_split_rad_s * np.array([np.cos(angle), np.sin(angle)])
    judged = 0
    for row in details["methods"]:
        cells = row["parameters"]
        if row["refused"] or row["warnings"] or size not in cells:
            continue
        weak = cells[size]["value"] < 8 * cells[size]["std"]
        assert weak == any(s.startswith(size) for s in row["weak_splits"]), row["method"]
        for name, put_in in zip(names, true, strict=True):
            component = row["split_components"][name]
            assert abs(component["value"] - put_in) < 4.5 * component["std"], row["method"]
        judged += weak
    assert judged >= 4


def test_a_clear_split_needs_no_word():
    values = {"frequency_split_rad_s": 9.0, "stiffness_axis_rad": 0.3}
    std = {"frequency_split_rad_s": 1.0, "stiffness_axis_rad": 0.03}
    components = {name: {"value": 6.4, "std": 1.0} for name in SPLITS[1][2]}
    assert describe_weak_splits(values, std, components) == []
    (said,) = describe_weak_splits({**values, "frequency_split_rad_s": 5.0}, std, components)
    assert "frequency_split_cos_rad_s = 6.4 ± 1" in said
    held = {**components, SPLITS[1][2][0]: {"value": 6.4, "std": 0.0}}
    assert describe_weak_splits({**values, "frequency_split_rad_s": 5.0}, std, held) == []


def test_every_method_states_a_uniform_axis_where_no_split_is_shown():
    """An axis of a split that noise alone may show has the σ of a uniform one, π/(m√12), in every
    method that gives it."""
    size, axis, _ = SPLITS[1]
    gyro, details = found(0.7, 5)
    uniform = np.pi / gyro.mode_number / np.sqrt(12)
    judged = 0
    for row in details["methods"]:
        cells = row["parameters"]
        if row["refused"] or axis not in cells:
            continue
        assert cells[axis]["std"] <= uniform * (1 + 1e-9), row["method"]
        if cells[size]["value"] < 1.5 * row["split_slope_std"][size]:
            assert cells[axis]["std"] > 0.99 * uniform, row["method"]
            judged += 1
    assert judged >= 4


def test_a_bootstrap_states_the_same_kinds_of_errors():
    """Axes of splits that are not shown uniform, and the components with the draws' covariance."""
    gyro = replace(GYRO, frequency_split_rad_s=3e-4, damping_split_1_s=0.06)
    waves = programme(gyro, 5, STARTS, std=6e-3, seconds=6.0, window=0.02)
    plain, drawn = (identify(waves, scale_factor=0.55, bootstrap=n) for n in (0, 200))
    uniform = np.pi / gyro.mode_number / np.sqrt(12)
    assert drawn.parameters()["stiffness_axis_rad"][1] == pytest.approx(uniform)
    own, other = (json.loads(r.details)["split_components"] for r in (plain, drawn))
    for name in own:
        assert other[name]["std"] == pytest.approx(own[name]["std"], rel=0.35)
        assert other[name]["std"] != own[name]["std"]
