"""Causes beside the decoy each could be taken for: the tool must name the cause, or say that the
runs cannot tell."""

import numpy as np
import pytest
from diagnosis_programme import programme, verdict, waves

from hrg_cli.effects import Effect, Parameter
from hrg_cli.stages.diagnose import diagnose, summarise

SOAK = {
    "kind": "soak",
    "levels_degc": [22.0, 24.0, 21.0, 23.0],
    "dwell_s": 0.35,
    "transition_s": 0.15,
}
FEED = {
    "displacement_c_s": 3e-4,
    "displacement_s_s": -1e-4,
    "velocity_c_s": 0.0,
    "velocity_s_s": 2e-4,
}
OFFSET = {"in_phase_c": 1e-4, "in_phase_s": -5e-5, "quadrature_c": 0.0, "quadrature_s": 1e-4}
FOLLOWS = {"relative_1_k": 3e-7, "reference_temperature_degc": 22.0}
AXES = {"damping_axis_rad", "stiffness_axis_rad"}


def named(table, *wanted, extra=()):
    """The wanted effects, and they alone, are found, each alone or in a group; every parameter
    within 4 σ; the rest is white."""
    _, out = verdict(table, extra)
    groups = [{e["name"], *e["indistinguishable_from"]} for e in out["effects"]]
    assert len(groups) == len(wanted) and all(
        any(name in group for group in groups) for name in wanted
    ), (out["verdict"], groups)
    assert out["verdict"] == "explained" and out["remainder"] is None
    for effect in out["effects"]:
        for name, found in effect["parameters"].items():
            true = table["effects"].get(effect["name"], {}).get(name, 0.0)
            assert abs(found["value"] - true) < 4 * found["std"] + 0.01 * abs(true), (
                effect["name"],
                name,
                found,
                true,
            )
    return out


def true_values(table, out, *names):
    """Those base parameters of the diagnosis are within 4 σ of the device's."""
    rows = {row["name"]: row for row in out["values"]}
    for name in names:
        difference = rows[name]["value"] - table["device"][name]
        if name in AXES:
            difference = (difference + np.pi / 4) % (np.pi / 2) - np.pi / 4
        assert abs(difference) < 4 * rows[name]["std"], (name, rows[name], table["device"][name])


def in_soak(seed, effects, runs=4):
    """A programme whose temperature goes in soak steps."""
    table = programme(seed, effects, runs=runs)
    for k, run in enumerate(table["run"]):
        levels = np.roll(SOAK["levels_degc"], k).tolist()
        run["environment"] |= {"temperature": SOAK | {"levels_degc": levels}}
    return table


def test_a_gain_mismatch_is_not_a_damping_split():
    table = programme(31, {"gain_mismatch": {"gain": 2e-3}})
    true_values(table, named(table, "gain_mismatch"), "damping_split_1_s", "damping_axis_rad")


@pytest.mark.slow  # of an offset alone test_diagnose_orientation.py holds the same
@pytest.mark.parametrize("forced", [False, True])
def test_an_offset_hidden_by_a_larger_cause_needs_no_phase_of_its_own_sign(forced):
    """(mθ, φ) and (mθ + π, φ + π) are one wave: written either way, run by run, it has the same
    causes, though the larger one is found before anything tells the signs."""
    offset = {name: 2 * value for name, value in OFFSET.items()}
    effects = {"coherent_offset": offset, "gain_mismatch": {"gain": 2e-3}}
    recorded = waves(programme(33, effects, forced=forced, runs=6))
    turned = [
        wave.replace(
            wave_angle_rad=wave.wave_angle_rad + np.pi / 2, phase_rad=wave.phase_rad + np.pi
        )
        if number in (1, 3, 4)
        else wave
        for number, wave in enumerate(recorded)
    ]
    as_written, otherwise = (summarise(diagnose(runs)) for runs in (recorded, turned))
    for out in (as_written, otherwise):
        assert out["verdict"] == "explained"
        assert [e["name"] for e in out["effects"]] == ["gain_mismatch", "coherent_offset"]
    z = [[abs(e["z"]) for e in out["effects"]] for out in (as_written, otherwise)]
    np.testing.assert_allclose(z[1], z[0], rtol=1e-3)


@pytest.mark.slow
def test_feed_through_is_no_offset():
    named(programme(32, {"drive_feedthrough": FEED}, forced=True), "drive_feedthrough")


@pytest.mark.slow
def test_an_offset_is_no_feed_through():
    named(programme(32, {"coherent_offset": OFFSET}, forced=True), "coherent_offset")


def test_a_drive_gain_is_not_a_damping():
    table = programme(37, {"drive_gain": {"gain": 0.01}}, forced=True, runs=4)
    true_values(table, named(table, "drive_gain"), "damping_split_1_s", "damping_axis_rad")


@pytest.mark.slow
def test_a_drive_gain_mismatch_is_not_a_damping_split():
    table = programme(33, {"drive_gain_mismatch": {"gain": 0.01}}, forced=True)
    true_values(table, named(table, "drive_gain_mismatch"), "damping_split_1_s", "damping_axis_rad")


@pytest.mark.slow
@pytest.mark.parametrize(("split_rad_s", "noise"), ((0.1, 1e-4), (np.pi * 1e-3, 2e-5)))
def test_a_phase_error_of_the_quadrature_drive_is_not_a_damping_split(split_rad_s, noise):
    effects = {"quadrature_drive_phase_error": {"phase_rad": 5e-3}}
    table = programme(34, effects, forced=True, quadrature_loop="finite", noise=noise)
    table["device"]["frequency_split_rad_s"] = split_rad_s
    for run in table["run"]:
        if "control" in run:
            run["control"]["quadrature_gain_1_s"] = (
                2.0  # a fast loop at 5 kHz has a phase error of its own, k_q/4ω
            )
    true_values(table, named(table, "quadrature_drive_phase_error"), "damping_split_1_s")


@pytest.mark.slow
def test_a_cubic_spring_beside_a_quadrature_is_not_a_frequency_split():
    table = programme(35, {"cubic_stiffness": {"pull_rad_s": 5e-3}})
    for k, run in enumerate(table["run"]):
        run["start"]["quadrature"] = 0.1 * run["start"]["amplitude"] * (-1) ** (k // 2)
    true_values(
        table, named(table, "cubic_stiffness"), "frequency_split_rad_s", "stiffness_axis_rad"
    )


@pytest.mark.slow
def test_a_gap_nonlinearity_is_no_quartic_spring():
    named(programme(36, {"pickoff_nonlinearity": {"cubic": 2e-3}}), "pickoff_nonlinearity")


@pytest.mark.slow
def test_a_quartic_spring_is_no_gap_nonlinearity():
    named(
        programme(36, {"anisotropic_cubic_stiffness": {"cos_rad_s": 3e-3, "sin_rad_s": -2e-3}}),
        "anisotropic_cubic_stiffness",
    )


@pytest.mark.slow
def test_a_great_frequency_split_is_neither_a_gap_nor_a_scale_error():
    """Its second order makes 8θ without any a², and a mean drift that imitates a scale factor at
    low rates (PHYSICS M3)."""
    table = programme(37)
    table["device"] |= {"frequency_split_rad_s": 1.0}
    for run, rate in zip(table["run"], (0.0, 0.3, -0.3, 1.0, -1.0, 2.0), strict=True):
        run["environment"]["rate_rad_s"] = rate
    _, out = verdict(table)
    assert out["verdict"] == "adequate" and out["effects"] == []
    true_values(table, out, "scale_factor", "frequency_split_rad_s", "stiffness_axis_rad")


@pytest.mark.slow
def test_a_lag_is_neither_hysteresis_nor_gradient():
    named(
        in_soak(38, {"thermal_frequency": FOLLOWS, "thermal_lag": {"time_constant_s": 0.05}}),
        "thermal_frequency",
        "thermal_lag",
    )


@pytest.mark.slow
def test_a_gradient_is_neither_lag_nor_hysteresis():
    gradient = {"frequency_s_k": 2e-8, "split_cos_rad_k": 3e-4, "split_sin_rad_k": -2e-4}
    named(
        in_soak(39, {"thermal_frequency": FOLLOWS, "thermal_gradient": gradient}),
        "thermal_frequency",
        "thermal_gradient",
    )


@pytest.mark.slow
def test_hysteresis_is_neither_lag_nor_gradient():
    named(
        in_soak(40, {"thermal_frequency": FOLLOWS, "thermal_hysteresis": {"relative": 5e-8}}),
        "thermal_frequency",
        "thermal_hysteresis",
    )


def test_a_cause_costs_no_more_than_the_parameters_that_it_needs():
    """Ramps of one speed up and down: a gradient that moves the frequency alone and a hysteresis are
    the same there. That the gradient may also move the split is no reason to name the other."""
    table = programme(42, {"thermal_gradient": {"frequency_s_k": 1.5e-9}}, runs=4)
    for run in table["run"]:
        run["environment"] |= {
            "temperature": {
                "kind": "cycle",
                "low_degc": 22.0,
                "high_degc": 23.0,
                "period_s": 1.0,
                "shape": "triangle",
            }
        }
    _, out = verdict(table)
    (one,) = out["effects"]
    group = {one["name"], *one["indistinguishable_from"]}
    assert out["verdict"] == "explained" and {"thermal_gradient", "thermal_hysteresis"} <= group


def test_damping_that_drifts_does_not_grow_with_amplitude():
    named(programme(41, {"damping_drift": {"slope_1_s2": 1e-3}}), "damping_drift")


@pytest.mark.slow
def test_damping_that_grows_with_amplitude_does_not_drift():
    named(programme(41, {"nonlinear_damping": {"damping_1_s": 2e-3}}), "nonlinear_damping")


def constant_quadrature(p, readout):
    """E = j r₀ J: a wave without quadrature is seen with r₀ (PHYSICS R6)."""

    def step(block, y):
        late = block.v_over_omega  # Im of the analytic signal is −v/ω, so j·(c, s) is seen as v/ω
        return y + p["size"] * np.stack([late[1], -late[0]])

    readout.steps.append(step)


SIZE = Parameter("size", "1", 1e-3, "r₀")
TURNED = Effect(
    name="stranger",
    family="test",
    page="constant quadrature",
    parameters=(SIZE,),
    readout=constant_quadrature,
)


@pytest.mark.slow
def test_a_constant_quadrature_is_a_damping_split():
    """By the gauge theorem [jr₀J, jδωR] is a damping split 2r₀δω, at every rate."""
    table = programme(42, {"stranger": {"size": 1e-3}}, noise=1e-4)
    _, still = verdict(table, (TURNED,))
    assert still["verdict"] == "adequate" and still["effects"] == []
    split = {row["name"]: row for row in still["values"]}["damping_split_1_s"]
    assert abs(split["value"] - table["device"]["damping_split_1_s"]) > 8 * split["std"]


@pytest.mark.slow
def test_a_constant_quadrature_is_a_damping_split_that_moves_with_the_frequency_split():
    """By the same theorem: of a split δω R(2mθ_ω) that changes by s a kelvin, 2r₀s a kelvin, turned
    by a right angle; no data tell the two apart."""
    slope = np.array([0.05, -0.03])
    moving = dict(zip(("cos_rad_s_k", "sin_rad_s_k"), slope, strict=True))
    moving["reference_temperature_degc"] = 22.0
    table = programme(42, {"stranger": {"size": 1e-3}, "split_temperature": moving}, noise=1e-4)
    _, out = verdict(table, (TURNED,))
    found = {e["name"]: e["parameters"] for e in out["effects"]}
    assert set(found) == {"split_temperature", "damping_split_temperature"}
    turned = 2e-3 * np.array([slope[1], -slope[0]])
    for name, true in zip(("cos_1_s_k", "sin_1_s_k"), turned, strict=True):
        size = found["damping_split_temperature"][name]
        assert abs(size["value"] - true) < 4 * size["std"]


def test_a_wrong_table_rate_is_said_to_be_the_scale_factor():
    _, out = verdict(programme(43, {"table_rate_error": {"relative": 2e-3}}, runs=4))
    assert out["verdict"] == "adequate" and out["effects"] == []
    group = next(g for g in out["not_separable"] if "table_rate_error" in g["effects"])
    assert "scale factor" in group["base"]
    assert next(t for t in out["tested"] if t["name"] == "table_rate_error")["upper_limit"] is None


@pytest.mark.parametrize("name", ["table_rate_error", "clock_error"])
def test_beside_a_known_scale_factor_the_clock_and_the_table_are_one(name):
    table = programme(43, {name: {"relative": 2e-3}})
    _, out = verdict(table, scale_factor=table["device"]["scale_factor"])
    (found,) = out["effects"]
    assert {found["name"], *found["indistinguishable_from"]} == {"table_rate_error", "clock_error"}
    size = found["parameters"]["relative"]
    assert abs(size["value"] - 2e-3) < 4 * size["std"] and out["verdict"] == "explained"


@pytest.mark.slow
def test_the_papers_traps_leave_no_mark():
    """No half of the damping split, no axis 45° off, no factor π: every value of a clean gyro is
    the device's."""
    table = programme(44)
    _, out = verdict(table)
    assert out["verdict"] == "adequate"
    true_values(table, out, *(name for name in table["device"] if name != "frequency_hz"))


@pytest.mark.slow
def test_a_parametric_drive_damps_the_quadrature():
    """One ring electrode pumps a_A and damps a_B alike (PHYSICS M3p): no log says so, but the runs
    show a quadrature gain of ν."""
    table = programme(45, forced=True)
    for run in table["run"]:
        if "control" in run:
            run["control"]["drive"] = "parametric"
    _, out = verdict(table, most_effects=1)
    (first,) = out["effects"]
    assert first["name"] == "finite_quadrature_gain"
    assert first["parameters"]["gain_1_s"]["value"] == pytest.approx(
        table["device"]["damping_rate_1_s"], rel=0.05
    )


def test_a_gap_is_no_cause():
    """Nothing is measured for a third of every run, in which the wave turns by a radian; the model
    crosses it in small steps."""
    table = programme(46, runs=4)
    found = [
        w.replace(
            flags=np.where((w.time_s > 0.6) & (w.time_s < 1.2), 4, w.flags).astype(w.flags.dtype)
        )
        for w in waves(table)
    ]
    out = summarise(diagnose(found))
    assert out["verdict"] == "adequate" and out["effects"] == []
    true_values(table, out, "scale_factor", "damping_split_1_s", "frequency_split_rad_s")


def test_a_loop_that_settles_within_a_row_is_no_cause():
    """A quadrature loop of 20 1/s takes the wave's quadrature out within two of the fit's rows: the
    command bends within them."""
    table = programme(47, runs=4, forced=True, quadrature_loop="finite", noise=1e-4)
    for run in table["run"]:
        run["start"]["quadrature"] = 0.05
    _, out = verdict(table)
    assert out["verdict"] == "adequate" and out["effects"] == []


@pytest.mark.parametrize(("split", "coupling", "noise"), [(0.02, 2e-3, 5e-5), (0.01, 2e-3, 3e-5)])
def test_a_part_that_outdoes_its_wholes_may_stand_first(split, coupling, noise):
    """An anisotropic cubic is a part of the cubics, which are asked for first; beside another cause
    it leaves a gross misfit too, and nothing came, or five causes that were not there."""
    table = programme(
        14,
        {
            "anisotropic_cubic_stiffness": {"cos_rad_s": 0.8 * split, "sin_rad_s": -0.6 * split},
            "quadrature_crosstalk": {"coupling": coupling},
        },
        runs=4,
        noise=noise,
    )
    named(table, "anisotropic_cubic_stiffness", "quadrature_crosstalk")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (
            {"electrode_nonorthogonality": {"angle_rad": -2.8e-3}},
            {"gain_temperature": {"relative_1_k": 6.35e-3, "reference_temperature_degc": 22.5}},
        ),
        (
            {"thermal_frequency": {"relative_1_k": 8.4e-6, "reference_temperature_degc": 25.0}},
            {"mismatch_temperature": {"relative_1_k": 8.9e-3, "reference_temperature_degc": 25.0}},
        ),
    ],
    ids=["non-orthogonality", "frequency"],
)
def test_two_gross_causes_are_found_where_a_third_does_some_of_both(first, second):
    """One by one a force or an offset of four parameters came first, and with whatever followed the
    misfit stayed gross: "unexplained", or an offset that was not there."""
    _, out = verdict(programme(213, first | second, runs=4, noise=1e-4))
    names = [effect["name"] for effect in out["effects"]]
    assert out["verdict"] == "explained" and {*first, *second} <= set(names), names
    # a mismatch counts from a temperature of its own: the rest of it is a gain mismatch and its square
    assert set(names) <= {*first, *second, "gain_mismatch", "gain_temperature"}
