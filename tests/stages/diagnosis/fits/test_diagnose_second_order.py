"""Effects to second order in the rates over ω, through raw samples of the second-order motion: sizes
are right and nothing stands beside them that is not there."""

import pytest
from diagnosis_programme import programme, verdict

QUARTZ = 85e-6
"""Frequency of fused silica, a kelvin."""


def fast_split(effects, seed):
    """Four runs of a gyro of 1 kHz whose split turns a wave by 2 rad a second."""
    table = programme(seed, effects, runs=4, noise=1e-5)
    table["device"] |= {"frequency_hz": 1003.7, "frequency_split_rad_s": 2.0}
    return table


def assert_alone(table, name, sizes):
    """The cause is named, nothing else is, and its sizes stand within 4 σ."""
    out = verdict(table)[1]
    assert [e["name"] for e in out["effects"]] == [name]
    assert out["verdict"] == "explained", out["checks"]
    found = out["effects"][0]["parameters"]
    for parameter, size in sizes.items():
        assert abs(found[parameter]["value"] - size) < 4 * found[parameter]["std"], parameter


@pytest.mark.parametrize(
    ("name", "sizes"),
    [
        ("cubic_stiffness", {"pull_rad_s": 0.06}),
        pytest.param(
            "anisotropic_cubic_stiffness",
            {"cos_rad_s": 0.02, "sin_rad_s": 0.01},
            marks=pytest.mark.slow,
        ),
        ("inertial_nonlinearity", {"inverse_length_squared": 1e-4}),
        ("nonlinear_damping", {"damping_1_s": 0.03}),
    ],
)
def test_a_force_that_is_not_linear_feels_the_split(name, sizes):
    """Without the second order sizes are 10 to 14 σ off, and knocks, forces or a pick-off's cubic
    stand beside them."""
    assert_alone(fast_split({name: sizes}, 1), name, sizes)


def test_a_frequency_that_moves_takes_the_amplitude_along():
    """aω^½ stays; without it a gain of −α/2 a kelvin is named beside the frequency. The fit counts
    from the runs' own temperature, about a kelvin from the simulation's."""
    table = fast_split({"thermal_frequency": {"relative_1_k": QUARTZ}}, 1)
    out = verdict(table)[1]
    assert out["verdict"] == "explained"
    assert [e["name"] for e in out["effects"]] == ["thermal_frequency"]
    value = out["effects"][0]["parameters"]["relative_1_k"]["value"]
    assert value == pytest.approx(QUARTZ, rel=10 * QUARTZ)


@pytest.mark.slow
def test_a_part_a_second_is_one_of_the_runs_own_frequency():
    """The waves stand 0.3 Hz beside the resonator's own frequency, which was 30 σ of this."""
    assert_alone(
        fast_split({"ageing": {"frequency_1_s": 1e-4}}, 1), "ageing", {"frequency_1_s": 1e-4}
    )
