"""The recovery study on simulated recordings with a cause of their own: what it finds, what it counts as false, how it goes on."""

import csv
import json
import subprocess
import sys

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.records import collect
from hrg_cli.stages.simulate import run_ids, simulate
from hrg_cli.studies import recovery
from hrg_cli.studies.hidden import programme
from hrg_cli.studies.recovery import assembled, figure, judged, recovery_study, table

EFFECTS = ["damping_drift", "momentum_kick", "drive_rotation"]


@pytest.fixture(scope="module")
def recordings():
    """Three short runs of a gyro whose frequency follows the amplitude: that is its background."""
    made = programme(np.random.default_rng(8), "gain_mismatch", 3e-4)
    made["recording"] = {"sample_rate_hz": 20011.0, "duration_s": 1.0}
    made["run"], made["effects"] = made["run"][:3], {"cubic_stiffness": {"pull_rad_s": 0.3}}
    return [collect(simulate(made, run=run)) for run in run_ids(made)]


@pytest.fixture(scope="module")
def study(recordings):
    told = []
    result = recovery_study(recordings, (), told.append, effects=EFFECTS, sizes=[12.0, 40.0], periods_per_window=40.0)
    return result, told


def test_what_is_hidden_is_found_with_its_size_beside_the_background(study):
    result, _ = study
    assert result["background"]["named"] == ["cubic_stiffness"]
    for name in ("damping_drift", "momentum_kick"):
        at = result["effects"][name]["by_size"]
        assert at["40"]["first"][0] == 1 and at["40"]["false"][0] == 0, name
        assert result["effects"][name]["found_over_true"] == pytest.approx(1, abs=0.15)
    assert result["effects"]["damping_drift"]["by_size"]["12"]["first"][0] == 1 and result["all"]["by_size"]["12"]["false"][0] == 0
    assert "cannot show it" in result["effects"]["drive_rotation"]["not_shown"]


def test_a_size_is_what_it_is_in_sigma(study):
    """The size found over its own σ is the size hidden, within the noise of one."""
    result, _ = study
    for row in result["rows"]:
        if row["size"] == 40 and len(row["error_over_std"]) == 1:
            (parameter,) = row["error_over_std"]
            over_std = row["error_over_std"][parameter] / (row["found_over_true"][parameter] - 1)
            assert abs(over_std) == pytest.approx(40, rel=0.1)


def test_an_interrupted_study_goes_on_where_it_was(study, recordings, monkeypatch):
    result, told = study
    assert [len({row["effect"] for row in rows}) for rows in told] == [1, 2, 3]
    asked = []
    monkeypatch.setattr(recovery, "recovered", lambda task: asked.append(task[3]) or [])
    again = recovery_study(recordings, told[1], effects=EFFECTS, sizes=[12.0, 40.0], periods_per_window=40.0)
    assert asked == EFFECTS[2:] and again["effects"]["damping_drift"] == result["effects"]["damping_drift"]


def test_table_and_figure(study):
    heads, rows = table(study[0])
    assert len(rows) == len(EFFECTS) + 1 and all(len(row) == len(heads) for row in rows)
    drawing = figure(study[0])
    assert [axes.get_title() for axes in drawing.axes] == ["named first", "a false name beside", "size found over true"]


def entry(name, value=1.0, std=0.1, others=()):
    return {"name": name, "parameters": {"gain": {"value": value, "std": std, "units": "1"}}, "indistinguishable_from": list(others)}


def test_names_of_the_background_are_neither_false_nor_first():
    from hrg_cli.effects import find

    effect, true = find("gain_mismatch"), {"gain": 2.0}

    def judge(named, before=()):
        reports = [{"verdict": "explained", "effects": list(effects), "after": {"chi2_per_dof": 1.0}} for effects in (named, before)]
        return judged(*reports, effect, true)

    row = judge([entry("ageing"), entry("gain_mismatch", 1.8)], [entry("ageing")])
    assert row["first"] and row["among"] and row["false"] == []
    assert row["found_over_true"]["gain"] == pytest.approx(0.9) and row["error_over_std"]["gain"] == pytest.approx(-2)
    row = judge([entry("ageing"), entry("gain_mismatch", 1.8)])
    assert not row["first"] and row["among"] and row["false"] == ["ageing"]
    row = judge([entry("gain_mismatch", 2.5)], [entry("gain_mismatch", 0.5)])
    assert row["first"] and row["found_over_true"]["gain"] == pytest.approx(1)
    row = judge([entry("rate_bias", others=("gain_mismatch",))])
    assert row["first"] and row["false"] == []
    row = judge([entry("rate_bias", others=("gain_mismatch", "ageing", "drive_rotation"))])
    assert not row["among"] and row["false"] == ["rate_bias"]
    assert assembled([], [5.0], {"verdict": "adequate", "effects": [], "after": {"chi2_per_dof": 1.0}})["effects"] == {}


def test_the_study_says_what_is_missing(recordings):
    with pytest.raises(HrgError, match="no recording is named"):
        recovery_study([])
    with pytest.raises(HrgError, match="did you mean"):
        recovery_study(recordings, effects=["gain_mismach"])


def test_the_command_writes_table_figure_and_figures(tmp_path, recordings):
    paths = []
    for recording in recordings:
        store.write(path := tmp_path / f"{recording.run_id}.h5", recording, False)
        paths.append(str(path))
    command = [sys.executable, "-m", "hrg_cli.cli", "study", "recovery", *paths, "--effects", "damping_drift", "--sizes", "30"]
    command += ["-o", str(tmp_path / "out"), "--set", "periods_per_window=40"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"recovery.csv", "recovery.json", "recovery.png"}
    rows = list(csv.reader((tmp_path / "out" / "recovery.csv").read_text().splitlines()))
    assert rows[0][0] == "effect" and rows[1][:2] == ["damping_drift", "1.00"]
    assert json.loads((tmp_path / "out" / "recovery.json").read_text())["result"]["rows"][0]["first"]
    refused = subprocess.run([*command[:4], "redundancy", paths[0]], capture_output=True, text=True, check=False)
    assert refused.returncode == 2 and "makes its own data" in refused.stderr
