"""The loop closed: what the first runs cannot tell is said as a group, the plan asks for the runs
that do, and those name the cause."""

import pytest
from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.plan import plan
from hrg_cli.stages.planning.like_measured import make_menu_like

FOLLOWS = {
    "thermal_frequency": {"relative_1_k": 2e-6},
    "split_temperature": {"cos_rad_s_k": 0.01, "sin_rad_s_k": 0.005},
}
RAMP = {"kind": "ramp", "start_degc": 20.0, "stop_degc": 23.0}
SOAK = {"kind": "soak", "levels_degc": [20.0, 23.0, 21.0], "dwell_s": 1.0, "transition_s": 0.3}
GRADIENT = {"frequency_s_k": 5e-7, "split_cos_rad_k": 4e-3, "split_sin_rad_k": -3e-3}


def on_one_ramp() -> dict:
    """Runs on the same ramp, at rates of both signs, of a gyro whose frequency and split follow
    temperature and its gradient."""
    table = programme(61, FOLLOWS | {"thermal_gradient": GRADIENT}, runs=4, duration_s=3.0)
    for run in table["run"]:
        run["environment"]["temperature"] = RAMP
    return table


def menu_of(table: dict) -> dict:
    ramps = [
        {
            "run_id": run_id,
            "environment": {"temperature": RAMP | {"start_degc": start, "stop_degc": stop}},
            "start": {"wave_angle_rad": angle},
        }
        for run_id, start, stop, angle in (("steep", 20.0, 29.0, 0.2), ("down", 23.0, 20.0, 0.6))
    ]
    soak = {
        "run_id": "soak",
        "environment": {"temperature": SOAK},
        "start": {"wave_angle_rad": 0.4},
        "recording": {"duration_s": 4.0},
    }
    grid = {"start.wave_angle_rad": [0.1, 0.5], "environment.rate_rad_s": [0.0, 2.0]}
    return {
        "recording": table["recording"],
        "readout": table["readout"],
        "grid": grid,
        "run": [*ramps, soak],
    }


@pytest.mark.slow
def test_one_ramp_leaves_lag_and_gradient_open_and_the_planned_runs_tell_them() -> None:
    table = on_one_ramp()
    made = waves(table)
    blind = diagnose(made)
    said = summarise(blind)
    assert {e["name"] for e in said["effects"]} == set(FOLLOWS)
    group = next(
        g for g in said["not_separable"] if {"thermal_lag", "thermal_gradient"} <= set(g["effects"])
    )
    assert "soak" in group["next_experiment"]
    chosen = plan(blind, menu_of(table), made, runs=3)
    assert "soak" in {run.run_id for run in chosen.runs}
    row = next(
        r for r in chosen.separations if set(r["causes"]) == {"thermal_lag", "thermal_gradient"}
    )
    assert row["before_sigma"] < 20 and row["after_sigma"] > 100
    found = summarise(diagnose([*made, *waves({**table, "run": chosen.file["run"]}, seed=1)]))[
        "effects"
    ]
    assert {e["name"] for e in found} == {*FOLLOWS, "thermal_gradient"}


@pytest.mark.slow
def test_runs_at_rest_leave_the_read_out_open_in_one_group() -> None:
    """At rest gain, non-orthogonality, delay and cross-talk show through the splits alone: one
    group, and a plan that asks for rotation."""
    table = programme(62, {"gain_mismatch": {"gain": 2e-3}}, runs=4)
    for run in table["run"]:
        run["environment"] = {"rate_rad_s": 0.0}
    made = waves(table)
    blind = diagnose(made)
    groups = [set(g["effects"]) for g in summarise(blind)["not_separable"]]
    assert not any(a < b for a in groups for b in groups if len(a) > 1)
    menu = {
        "recording": table["recording"],
        "readout": table["readout"],
        "grid": {
            "start.wave_angle_rad": [0.1, 0.5, 0.9],
            "environment.rate_rad_s": [0.0, 2.0, -2.0],
        },
    }
    chosen = plan(blind, menu, made, runs=2)
    assert any(run.table["environment"]["rate_rad_s"] != 0 for run in chosen.runs)
    first = summarise(diagnose([*made, *waves({**table, "run": chosen.file["run"]}, seed=1)]))[
        "effects"
    ][0]
    assert first["name"] == "gain_mismatch" and first["indistinguishable_from"] == []


def test_what_no_run_can_tell_leaves_the_plan_to_the_variances() -> None:
    """A table's rate error is open for ever: the plan says so and shrinks the worst variance, with
    no σ made of rounding."""
    table = programme(63, runs=3)
    for k, run in enumerate(table["run"]):
        run["environment"] = {"rate_rad_s": (2.0, -2.0, 2.0)[k]}
    made = waves(table)
    menu = {
        "recording": table["recording"],
        "readout": table["readout"],
        "grid": {"start.wave_angle_rad": [0.1, 0.5]},
    }
    chosen = plan(diagnose(made), menu, made, runs=1, causes=["table_rate_error"])
    assert any("table rate error" in sentence for sentence in chosen.impossible)
    assert "σ of" in chosen.runs[0].reason


def test_a_cause_that_nothing_shows_is_a_note_beside_a_plan_that_does_what_it_is_for() -> None:
    """After an explained diagnosis no run like those made shows a centrifugal stiffness: the plan
    was "suspect" for it. What is asked for by name or as a criterion is another matter."""
    table = programme(64, {"gain_mismatch": {"gain": 4e-3}}, runs=3)
    for run, rate in zip(table["run"], (0.0, 0.0, 1.0), strict=True):
        run["environment"] = {"rate_rad_s": rate}
    made = waves(table)
    explained = diagnose(made)
    assert summarise(explained)["verdict"] == "explained"
    menu = make_menu_like(explained)
    chosen = plan(explained, menu, made, runs=2)
    assert any("centrifugal stiffness" in said for said in chosen.impossible)
    assert chosen.status == "valid" and chosen.status_reasons == () and len(chosen.runs) == 2
    for asked in ({"causes": ["centrifugal_stiffness"]}, {"criterion": "separate"}):
        doubted = plan(explained, menu, made, runs=2, **asked)
        assert doubted.status == "suspect"
        assert all("centrifugal stiffness" in said for said in doubted.status_reasons)
    assert plan(explained, menu, made, runs=2, criterion="variance").status == "valid"
