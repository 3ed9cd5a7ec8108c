"""plan: predicted standard deviations are those identify then states, the runs chosen are those
physics asks for, menus are checked."""

import numpy as np
import pytest
import records_by_hand as by_hand
from diagnosis_programme import programme, waves

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.physics.resonator import PARAMETERS, Mechanics
from hrg_cli.records import Resonator, collect
from hrg_cli.settings import to_toml
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify
from hrg_cli.stages.plan import plan
from hrg_cli.stages.planning.like_measured import make_menu_like
from hrg_cli.stages.simulate import simulate

TRUTH = Mechanics(500.0, 0.4, 0.02, 0.35, 0.6, 0.9, 0.55)
MENU = {
    "recording": {"sample_rate_hz": 4000.0, "duration_s": 4.0},
    "readout": {"noise": 1e-3},
    "grid": {"start.wave_angle_rad": [0.1, 0.5], "environment.rate_rad_s": [0.0, 1.5, -1.5]},
}


def known(std=np.inf):
    names = [name for name, _ in PARAMETERS]
    return Resonator(
        name=np.array(names, dtype=object),
        value=np.array([getattr(TRUTH, name) for name in names]),
        std=np.full(len(names), std),
        units=np.array([u for _, u in PARAMETERS], dtype=object),
        covariance=np.diag(np.full(len(names), std**2)),
    )


def measured(made, seed):
    """The planned runs, simulated with noise, through the chain."""
    waves = []
    for run in made.runs:
        recording = collect(
            simulate(
                made.file, model="slow", run=run.run_id if len(made.runs) > 1 else None, seed=seed
            )
        )
        waves.append(collect(estimate(collect(demodulate(recording, periods_per_window=5)))))
    return waves


def test_the_predicted_deviations_are_those_of_the_identification():
    made = plan(known(), MENU, runs=3)
    found = identify(measured(made, 1)).parameters()
    for name, expected in made.after.items():
        assert expected / found[name][1] == pytest.approx(1.0, abs=0.25), name


def test_runs_measured_already_count_and_more_runs_never_know_less():
    first = plan(known(), MENU, runs=1)
    again = plan(known(), MENU, measured(first, 2), runs=1)
    for name in first.after:
        assert again.before[name] / first.after[name] == pytest.approx(1.0, abs=0.25), name
        assert again.after[name] <= again.before[name] * (1 + 1e-6)
    assert again.runs[0].run_id != first.runs[0].run_id


def test_a_gain_mismatch_asks_for_rotation():
    """At rest a read-out matrix shows through its commutator with the splits alone, which are small
    beside KΩ."""
    made = plan(known(), MENU, runs=2, causes=["gain_mismatch"])
    rates = [run.table["environment"]["rate_rad_s"] for run in made.runs]
    assert any(rate != 0 for rate in rates)
    (row,) = made.separations
    assert row["before_sigma"] < 1 and row["after_sigma"] > 10
    at_rest = MENU | {"grid": MENU["grid"] | {"environment.rate_rad_s": [0.0]}}
    hidden = plan(known(), at_rest, runs=2, causes=["gain_mismatch"])
    assert hidden.separations[0]["after_sigma"] < 0.6 * row["after_sigma"]


def test_a_wrong_table_rate_is_never_told_from_the_scale_factor():
    made = plan(known(), MENU, runs=2, causes=["table_rate_error"])
    assert made.status == "suspect" and "scale factor" in made.impossible[0]
    assert made.separations[0]["after_sigma"] < 0.5


def test_the_promised_separation_is_the_measured_one():
    """One rate hides which read-out stands beside the splits; the planned runs show the gain
    mismatch with the σ that was promised."""
    table = programme(51, {"gain_mismatch": {"gain": 2e-3}}, runs=4)
    for run in table["run"]:
        run["environment"] = {"rate_rad_s": 2.0}
    made = waves(table)
    blind = diagnose(made)
    (cause,) = summarise(blind)["effects"]
    assert len(cause["indistinguishable_from"]) == 3
    menu = {
        "recording": table["recording"],
        "readout": table["readout"],
        "grid": {
            "start.wave_angle_rad": [0.1, 0.5, 0.9],
            "environment.rate_rad_s": [0.0, 2.0, -2.0],
        },
    }
    chosen = plan(blind, menu, made, runs=2, causes=["gain_mismatch"])
    row, *from_one_another = chosen.separations
    assert row["causes"] == ["gain_mismatch", "the base model"]
    assert all(one["before_sigma"] < 0.1 for one in from_one_another)
    assert all(one["after_sigma"] > 100 for one in from_one_another)
    assert all(run.table["environment"]["rate_rad_s"] == -2.0 for run in chosen.runs)
    further = waves({**table, "run": chosen.file["run"]}, seed=1)
    first = summarise(diagnose([*made, *further]))["effects"][0]
    assert first["name"] == "gain_mismatch"
    measured_sigma = first["parameters"]["gain"]["value"] / first["parameters"]["gain"]["std"]
    assert measured_sigma / row["after_sigma"] == pytest.approx(1.0, abs=0.1)


def test_the_plan_is_a_simulation_file():
    made = plan(known(), MENU, runs=2)
    assert {run.run_id for run in made.runs} == {run["run_id"] for run in made.file["run"]}
    assert made.file["device"]["frequency_split_rad_s"] == TRUTH.frequency_split_rad_s
    assert len(measured(made, 3)) == 2


@pytest.mark.parametrize(
    ("menu", "says"),
    [
        ({**MENU, "device": {"frequency_hz": 1.0}}, r"\[device\]"),
        ({k: v for k, v in MENU.items() if k != "grid"}, "holds no run"),
        ({**MENU, "readout": {}}, "without noise"),
        ({**MENU, "grid": {"start.wave_angle": [0.0]}}, "wave_angle"),
        ({**MENU, "grid": {"start.wave_angle_rad": 0.0}}, "lists"),
        ({**MENU, "grid": {"start.wave_angle_rad": [0.001 * k for k in range(500)]}}, "at most"),
    ],
)
def test_wrong_menus_are_refused_in_words(menu, says):
    with pytest.raises(HrgError, match=says):
        plan(known(), menu)


def test_unknown_causes_and_nothing_to_separate_are_refused():
    with pytest.raises(HrgError, match="there is no effect"):
        plan(known(), MENU, causes=["gremlins"])
    with pytest.raises(HrgError, match="nothing is to be separated"):
        plan(known(), MENU, criterion="separate")


def written(**parts):
    """A diagnosis with this model: runs of 3 and 4 s, one of them turned at −2.5 rad/s."""
    device = {name: getattr(TRUTH, name) for name, _ in PARAMETERS} | {"mode_number": 2}
    run = {"readout": {"noise": 1e-3}, "start": {"amplitude": 0.5, "wave_angle_rad": 0.2}}
    model = {
        "device": device,
        "recording": {"sample_rate_hz": 4000.0, "duration_s": 1.0},
        "run": [
            {"run_id": "a", "recording": {"duration_s": 3.0}, **run},
            {
                "run_id": "b",
                "recording": {"duration_s": 4.0},
                "environment": {"rate_rad_s": -2.5, "temperature_degc": 31.0},
                **run,
            },
        ],
    }
    for each in model["run"]:
        each.update(parts)
    return by_hand.diagnosis().replace(extended_model=to_toml(model))


def test_without_a_menu_runs_like_those_measured_are_offered():
    """No faster, no longer, no quieter than the bench has shown; and K, which rest hides, is asked
    for by turning."""
    menu = make_menu_like(written())
    assert menu["recording"] == {"sample_rate_hz": 4000.0, "duration_s": 4.0}
    assert menu["readout"]["noise"] == 1e-3
    again, grid = menu["run"][:2], menu["run"][2:]
    assert [run["run_id"] for run in again] == ["a-again", "b-again"]
    assert again[1]["environment"] == {"rate_rad_s": -2.5, "temperature_degc": 31.0}
    assert {run["environment"]["rate_rad_s"] for run in grid} == {0.0, 2.5, -2.5}
    assert {run["start"]["amplitude"] for run in grid} == {0.5}
    assert len({run["start"]["wave_angle_rad"] for run in grid}) == 4
    chosen = plan(known(), menu, runs=1)
    assert chosen.runs[0].table["environment"]["rate_rad_s"] != 0


def test_runs_that_no_model_tells_are_asked_for(tmp_path, hrg):
    assert make_menu_like(written(control={"mode": "forced"})) is None
    store.write(tmp_path / "r.h5", known(1e-3))
    done = hrg("plan", tmp_path / "r.h5", "-o", tmp_path / "next.toml")
    assert done.status == 2 and "add --menu FILE" in done.err
