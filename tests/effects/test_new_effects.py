"""Dry friction, a knock, gains by temperature, phase drift, converter: their own laws, and that a
diagnosis names them."""

import copy
import tomllib

import numpy as np
import pytest

from hrg_cli.effects import converter_nonlinearity, dry_friction, find
from hrg_cli.effects.momentum_kick import list_phased_instants
from hrg_cli.physics import ellipse
from hrg_cli.physics.plant import SlowState, add_accelerations
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.records import collect
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.base.data import prepare
from hrg_cli.stages.simulate import list_run_ids, simulate
from hrg_cli.studies.hidden import draw_programme, make_waves

NOISE = 3e-4
FOUND = {
    "dry_friction": {"slope_1_s": 3e-3},
    "gain_temperature": {"relative_1_k": 3e-3},
    "mismatch_temperature": {"relative_1_k": 3e-3},
    "phase_drift": {"slope_rad_s": 4e-3},
    "converter_nonlinearity": {"mid_scale": 5e-4},
}


def state():
    zero = np.zeros(())
    return SlowState(
        Mechanics(5000.0, 0.3), *[zero] * 6, np.zeros(2), zero, zero, 2 * np.pi * 5000.0
    )


@pytest.mark.parametrize(
    ("a", "b"), [(1.0, 0.5), (1.0, 1.0), (1.0, 0.9999), (2.0, 1e-2), (1.0, 1e-9)]
)
def test_the_means_of_dry_friction_are_the_integrals(a, b):
    """⟨sin²/ρ⟩ and ⟨cos²/ρ⟩ by the arithmetic–geometric mean against the tanh rule on each quarter
    period."""
    x = np.linspace(-4, 4, 4001)
    angle = np.pi / 4 * (1 + np.tanh(np.pi / 2 * np.sinh(x)))
    small = np.pi / 2 / (1 + np.exp(-np.pi * np.sinh(x)))  # the same angle, exact where it is tiny
    angle = np.where(x < 0, small, angle)
    width = (
        np.pi / 4 * np.pi / 2 * np.cosh(x) / np.cosh(np.pi / 2 * np.sinh(x)) ** 2 * (x[1] - x[0])
    )
    rho = np.sqrt(a**2 * np.sin(angle) ** 2 + b**2 * np.cos(angle) ** 2)
    G, Q = dry_friction.compute_means(np.array(a), np.array(b))
    for sign, wave in ((-1, np.sin(angle) ** 2), (1, np.cos(angle) ** 2)):
        mean = np.sum(wave / rho * width) * 2 / np.pi
        assert G * (0.5 + sign * Q * (a**2 - b**2)) == pytest.approx(mean, rel=1e-9)


def test_dry_friction_of_a_line_of_a_circle_and_of_an_ellipse():
    """A line loses the slope whatever its amplitude, a circle π/4 of it; an ellipse narrows and
    does not turn."""
    slope = 1e-3
    for a in (1.0, 0.01):
        for b, lost in ((0.0, (1.0, 0.0)), (a, (np.pi / 4, np.pi / 4))):
            u = ellipse.compute_envelopes(np.array(a), np.array(b), np.array(0.3), np.array(0.7))
            du = dry_friction.slow({"slope_1_s": slope}, u, state())
            wanted = ellipse.compute_envelopes(
                np.array(-slope * lost[0]), np.array(-slope * lost[1]), np.array(0.3), np.array(0.7)
            )
            assert du == pytest.approx(wanted, abs=1e-9 * slope)
    u = ellipse.compute_envelopes(np.array(1.0), np.array(0.1), np.array(0.3), np.array(0.7))
    after = ellipse.find_wave(u + 1e-3 * dry_friction.slow({"slope_1_s": slope}, u, state()), 2)
    assert after[2] == pytest.approx(0.3, abs=1e-12) and after[3] == pytest.approx(0.7, abs=1e-12)
    assert after[1] / after[0] < 0.1 - 1e-8


def test_dry_friction_knows_no_size_of_the_motion():
    """A run that has died away to 1e-120 made numbers that are none, and so of the score."""
    u = np.array([[1.0, 0.3j], [0.2, 0.9]])
    with np.errstate(over="raise", invalid="raise"):
        pull = dry_friction.slow({"slope_1_s": 0.1}, np.stack([u, 1e-120 * u]), None)
    assert np.allclose(pull[0], pull[1], rtol=1e-9)


def test_a_line_with_dry_friction_comes_to_rest_in_a_straight_line():
    config = {
        "device": {"frequency_hz": 1000.0, "damping_rate_1_s": 0.0, "scale_factor": 0.5},
        "recording": {"sample_rate_hz": 7100.0, "duration_s": 1.0},
        "effects": {"dry_friction": {"slope_1_s": 0.8}},
    }
    made = collect(simulate(config))
    blocks = np.abs(np.asarray(made.c)[: 7100 // 71 * 71]).reshape(-1, 71).max(axis=1)
    t = (np.arange(len(blocks)) + 0.5) * 0.01
    assert blocks[:95] == pytest.approx(1 - 0.8 * t[:95], abs=0.012)


@pytest.mark.parametrize(
    ("h", "q"),
    [(0.03, 0.0), (-0.03, 0.0), (0.0, 0.07), (0.03, 0.07), (-0.02, 0.07), (0.9, 0.0), (1.2, 0.0)],
)
def test_the_describing_function_of_the_converter_is_the_fundamental_of_its_codes(h, q):
    angle = 2 * np.pi * (np.arange(1_000_000) + 0.5) / 1_000_000
    for size in (1.0, 0.37):
        y = size * np.cos(angle)
        seen = np.sign(y) * np.maximum(np.abs(y) - h, 0)
        seen = q * np.rint(seen / q) if q else seen
        p = {"mid_scale": h, "step": q}
        wanted = converter_nonlinearity.slow_readout(p, np.array([size + 0j, 0.0]), state())
        assert 2 * np.mean(seen * np.cos(angle)) == pytest.approx(wanted[0].real, abs=1e-5)


def test_two_further_accelerations_stand_beside_each_other():
    both = add_accelerations(
        lambda t, x, y, vx, vy: (x + t, y), lambda t, x, y, vx, vy: (vx, 2 * vy)
    )
    assert both(0.5, 1.0, 2.0, 3.0, 4.0) == pytest.approx((4.5, 10.0))


def measured(effects, run=None, seed=5):
    table = draw_programme(np.random.default_rng(seed), "gain_mismatch", NOISE)
    if run is None:
        table["effects"] = effects
    else:
        table["run"][run]["effects"] = effects
    return make_waves(table, seed, "gain_mismatch")


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name == "gain_temperature" else pytest.mark.slow)
        for name in FOUND
    ],
)
def test_a_new_effect_is_named_with_its_size(name):
    report = summarise(diagnose(measured({name: FOUND[name]})))
    found = next(e for e in report["effects"] if e["name"] == name)
    for parameter, true in FOUND[name].items():
        value = found["parameters"][parameter]
        assert abs(value["value"] - true) < 4 * value["std"] < 0.05 * true
    assert report["after"]["chi2_per_dof"] < 1.1


def test_a_knock_in_one_run_is_named_with_its_run_instant_and_velocities():
    kick = {"c_velocity_over_omega": 2e-3, "s_velocity_over_omega": -1e-3, "time_s": 0.813}
    runs = measured({"momentum_kick": kick}, run=2)
    made = diagnose(runs)
    report = summarise(made)
    assert [e["name"] for e in report["effects"]] == ["momentum_kick"] and report["after"][
        "chi2_per_dof"
    ] < 1.05
    found = report["effects"][0]
    assert found["held"]["run"]["value"] == 2 and found["held"]["time_s"]["value"] == pytest.approx(
        0.813, abs=0.01
    )
    values = [found["parameters"][k] for k in ("c_velocity_over_omega", "s_velocity_over_omega")]
    sign = np.sign(values[0]["value"])  # half a period later the same knock has the other sign
    for value, true in zip(values, (2e-3, -1e-3), strict=True):
        assert abs(sign * value["value"] - true) < 4 * value["std"]
    written = tomllib.loads(made.extended_model)
    assert "momentum_kick" not in written.get("effects", {})
    assert [
        k for k, run in enumerate(written["run"]) if "momentum_kick" in run.get("effects", {})
    ] == [2]
    assert len(list_run_ids(written)) == len(runs)


def test_runs_without_a_knock_offer_no_instant():
    """One programme of a thousand may hold a row that is taken for a jump."""
    assert not any(
        list_phased_instants(prepare(measured({}, seed=seed), None, 120)[0]) for seed in range(2)
    )


def test_a_knock_moves_velocity_and_not_displacement():
    config = {
        "device": {"frequency_hz": 1000.0, "damping_rate_1_s": 0.1, "scale_factor": 0.5},
        "recording": {"sample_rate_hz": 50_000.0, "duration_s": 0.01},
    }
    at = 0.0050003
    kick = {
        "momentum_kick": {"c_velocity_over_omega": 0.1, "s_velocity_over_omega": 0.05, "time_s": at}
    }
    plain, struck = (
        collect(simulate(config)),
        collect(simulate(copy.deepcopy(config) | {"effects": kick})),
    )
    t = np.arange(len(plain.c)) / 50_000.0
    for channel, size in (("c", 0.1), ("s", 0.05)):
        change = np.asarray(getattr(struck, channel)) - np.asarray(getattr(plain, channel))
        wanted = np.where(
            t > at, size * np.sin(2 * np.pi * 1000 * (t - at)) * np.exp(-0.1 * (t - at)), 0.0
        )
        assert change == pytest.approx(wanted, abs=1e-5)


def test_the_phase_of_the_knock_is_a_fine_instant():
    effect = find("momentum_kick")
    period = 2 * np.pi / state().mechanics.omega_rad_s
    given = {"c_velocity_over_omega": 1e-3, "s_velocity_over_omega": 2e-3}
    coarse = effect.slow_jump(effect.values(given | {"time_s": 0.3 + period / 4}), state())
    fine = effect.slow_jump(effect.values(given | {"time_s": 0.3, "phase_rad": np.pi / 2}), state())
    assert coarse[0] == pytest.approx(fine[0], abs=1e-12) and coarse[1] == pytest.approx(
        fine[1], abs=1e-9
    )
