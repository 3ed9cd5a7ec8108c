"""Coefficients pooled from resonator files: what a file holds because it was given is no
measurement."""

import numpy as np
import pytest
from elliptic_runs import resonator_of, tempered

from hrg_cli.errors import HrgError
from hrg_cli.records import Resonator
from hrg_cli.stages.calibration.resonators import (
    NAMES,
    compute_coefficients,
    list_held,
    pool_resonators,
)

K, DC, DS = NAMES.index("K"), NAMES.index("K_DC_rad_s"), NAMES.index("K_DS_rad_s")
NOISE = 2e-3


def resonator(temperature=20.0, seed=0, noise=NOISE) -> Resonator:
    return resonator_of(tempered(temperature), temperature, noise, seed=seed)


def holding(found: Resonator, name: str, value: float) -> Resonator:
    """The file with a parameter that was given to `identify`."""
    at = [str(n) for n in found.name].index(name)
    values, std, covariance = found.value.copy(), found.std.copy(), found.covariance.copy()
    values[at], std[at] = value, 0.0
    covariance[at], covariance[:, at] = 0.0, 0.0
    return found.replace(value=values, std=std, covariance=covariance)


def pooled(*files):
    """Value and standard deviation (5,) of files of one temperature."""
    found = pool_resonators(files, "temperature", np.array([20.0]), 20.0, 20.0, "linear")
    assert not [check for check in found.checks if not check.passed]
    return found.value[0], np.sqrt(np.diag(found.covariance[0]))


def test_a_file_says_what_it_holds():
    assert list_held(resonator()) == set()
    assert list_held(holding(resonator(), "scale_factor", 0.55)) == {"scale_factor"}


def test_a_scale_factor_held_in_every_file_stays_as_it_was_given():
    """It came out as −1.6e-17: what no file measured had no weight at all."""
    value, std = pooled(*(holding(resonator(seed=k), "scale_factor", 0.55) for k in range(3)))
    assert value[K] == 0.55 and std[K] == 0.0
    measured, measured_std = pooled(*(resonator(seed=k) for k in range(3)))
    others = [i for i in range(5) if i != K]
    assert value[others] == pytest.approx(measured[others], rel=1e-9)
    assert std[others] == pytest.approx(measured_std[others], rel=1e-9)


@pytest.mark.parametrize("given", [0.55, 0.70])
def test_a_held_scale_factor_has_no_say_beside_a_measured_one(given):
    alone, alone_std = compute_coefficients(resonator(seed=1))
    value, std = pooled(resonator(seed=1), holding(resonator(seed=2), "scale_factor", given))
    assert value[K] == pytest.approx(alone[K], rel=1e-12)
    assert std[K] == pytest.approx(np.sqrt(alone_std[K, K]), rel=1e-9)
    # of all else both files know
    assert std[DC] < 0.8 * np.sqrt(alone_std[DC, DC])


@pytest.mark.parametrize("axis", [0.0, 0.4, 1.2])
def test_a_held_axis_has_a_say_along_itself_alone(axis):
    """Near 0° and 90° one component of the split is nearly all of it: units of their own for each
    would make the other look known."""
    device = tempered(20.0)
    base = resonator_of(device, 20.0, NOISE)
    turned = base.replace(value=np.where(base.name == "damping_axis_rad", axis, base.value))
    known = holding(turned, "damping_axis_rad", axis)
    wide = np.where(base.name == "damping_axis_rad", 0.3, np.sqrt(np.diag(base.covariance)))
    loose = turned.replace(std=wide, covariance=np.diag(wide**2))
    value, std = pooled(loose, known)
    _, alone = compute_coefficients(loose)
    across = np.array([np.cos(4 * axis), np.sin(4 * axis)])
    found = pool_resonators((loose, known), "temperature", np.array([20.0]), 20.0, 20.0, "linear")
    block = np.ix_([DC, DS], [DC, DS])
    assert across @ found.covariance[0][block] @ across == pytest.approx(
        across @ alone[block] @ across, rel=1e-6
    )
    assert value == pytest.approx(compute_coefficients(turned)[0], rel=1e-9) and std[K] > 0


def test_files_of_one_place_that_hold_different_values_are_refused():
    files = [holding(resonator(seed=k), "scale_factor", 0.55 + 0.01 * k) for k in range(2)]
    with pytest.raises(HrgError, match=r"hold scale_factor at 0\.55 and 0\.56"):
        pooled(*files)


def test_a_scale_factor_measured_at_one_temperature_and_held_at_another_is_refused():
    files = (resonator(0.0), holding(resonator(40.0), "scale_factor", 0.55))
    with pytest.raises(HrgError, match="holds scale_factor at a value that was given"):
        pool_resonators(files, "temperature", np.array([0.0, 40.0]), 0.0, 40.0, "linear")
    # beside one of its own temperature that measured it, it is
    both = (*files, resonator(40.0, seed=3))
    found = pool_resonators(both, "temperature", np.array([0.0, 40.0]), 0.0, 40.0, "linear")
    assert found.value[1, K] == pytest.approx(compute_coefficients(both[2])[0][K], rel=1e-9)


def test_what_is_held_takes_no_degree_of_freedom():
    """χ² of 40 draws of three files of which four coefficients are measured: 8 degrees each, so the
    mean scatters by 0.08."""
    found = []
    for seed in range(40):
        files = [holding(resonator(seed=3 * seed + k), "scale_factor", 0.55) for k in range(3)]
        pool = pool_resonators(files, "temperature", np.array([20.0]), 20.0, 20.0, "linear")
        found += [check.value for check in pool.checks]
    assert len(found) == 40 and np.mean(found) == pytest.approx(1.0, abs=0.25)
