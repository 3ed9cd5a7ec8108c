"""The recovery study on simulated recordings with a cause of their own: what it finds, what it
counts as false, how it goes on."""

import csv
import json
import subprocess
import sys

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.commands import study as study_command
from hrg_cli.effects import find
from hrg_cli.errors import HrgError
from hrg_cli.records import collect
from hrg_cli.stages.simulate import list_run_ids, simulate
from hrg_cli.studies import recovery
from hrg_cli.studies.hidden import draw_programme
from hrg_cli.studies.recovery import (
    assemble,
    describe_background,
    draw_figure,
    judge_report,
    recovery_study,
    tabulate,
)
from hrg_cli.studies.recovery_sizes import fit_background

EFFECTS = ["damping_drift", "momentum_kick", "drive_rotation"]


@pytest.fixture(scope="module")
def recordings():
    """Three short runs of a gyro whose frequency follows the amplitude: that is its background."""
    made = draw_programme(np.random.default_rng(8), "gain_mismatch", 3e-4)
    made["recording"] = {"sample_rate_hz": 20011.0, "duration_s": 1.0}
    made["run"], made["effects"] = made["run"][:3], {"cubic_stiffness": {"pull_rad_s": 0.3}}
    return [collect(simulate(made, run=run)) for run in list_run_ids(made)]


@pytest.mark.slow
def test_what_is_hidden_is_found_with_its_size_beside_the_background(recordings):
    sure = "electrode_nonorthogonality"
    result = recovery_study(
        recordings, effects=[*EFFECTS, sure], sizes=[12.0, 40.0], periods_per_window=40.0
    )
    assert result["background"]["named"] == ["cubic_stiffness"]
    for name in ("damping_drift", "momentum_kick", sure):
        at = result["effects"][name]["by_size"]
        assert at["40"]["first"][0] == 1 and at["40"]["false"][0] == 0, name
    # a drift of the damping is that of a gain in free runs: the two are one group at any size
    for name in ("damping_drift", sure):
        assert result["effects"][name]["by_size"]["12"]["first"][0] == 1
    assert result["all"]["by_size"]["12"]["false"][0] == 0
    assert "cannot show it" in result["effects"]["drive_rotation"]["not_shown"]
    large = {row["effect"]: row for row in result["rows"] if row["size"] == 40}
    for name in ("momentum_kick", sure):
        # 4 σ of 40
        for ratio in large[name]["found_over_true"].values():
            assert ratio == pytest.approx(1, abs=0.1 if name == sure else 0.15)
    (parameter,) = large[sure]["error_over_std"]
    size = large[sure]["error_over_std"][parameter] / (
        large[sure]["found_over_true"][parameter] - 1
    )
    assert abs(size) == pytest.approx(40, rel=0.1), "a size in σ is the size found over its own σ"


@pytest.fixture
def quick(monkeypatch):
    """The study without its diagnoses: what is asked for, and rows as an ideal diagnosis would give
    them."""
    asked = []
    nothing = {"verdict": "adequate", "effects": [], "after": {"chi2_per_dof": 1.0}}

    def recovered(task):
        name, draw, sizes = task[3:6]
        asked.append(name)
        if name == "drive_rotation":
            return [{"effect": name, "draw": draw, "size": None, "not_shown": "no drive"}]
        return [
            {"effect": name, "draw": draw, "size": s, "true": {}, "first": True, "among": True, "false": [], "verdict": "explained",
             "found_over_true": {"a": 1.1}, "error_over_std": {"a": 0.1 * s}}
            for s in sizes
        ]  # fmt: skip

    monkeypatch.setattr(recovery, "_diagnosed", lambda waves, scale_factor: nothing)
    monkeypatch.setattr(recovery, "recover", recovered)
    return asked


def test_an_interrupted_study_goes_on_where_it_was(quick, recordings):
    told = []
    result = recovery_study(
        recordings, (), told.append, effects=EFFECTS, sizes=[12.0, 40.0], periods_per_window=40.0
    )
    assert quick == EFFECTS and [len({row["effect"] for row in rows}) for rows in told] == [1, 2, 3]
    again = recovery_study(
        recordings, told[1], effects=EFFECTS, sizes=[12.0, 40.0], periods_per_window=40.0
    )
    assert quick == [*EFFECTS, EFFECTS[2]] and again == result


def test_table_and_figure(quick, recordings):
    study = recovery_study(recordings, effects=EFFECTS, sizes=[12.0, 40.0], periods_per_window=40.0)
    heads, rows = tabulate(study)
    assert len(rows) == len(EFFECTS) + 1 and all(len(row) == len(heads) for row in rows)
    of = {row[0]: row for row in rows}
    assert (
        of["damping_drift"][1:4] == ("1.00", "1.00", "0.00")
        and of["drive_rotation"][-1] == "no drive"
    )
    drawing = draw_figure(study)
    assert [axes.get_title() for axes in drawing.axes] == [
        "named first",
        "a false name beside",
        "size found over true",
    ]


def test_the_background_is_told_on_the_screen_and_blamed_in_the_table():
    """A background of χ² 329 was not told, and its own cause was one that "these runs cannot
    show"."""
    background = {"verdict": "partly explained", "after": {"chi2_per_dof": 329.0}}
    background["effects"] = [{"name": "cubic_stiffness"}]
    rows = [
        {"effect": name, "draw": 0, "size": None, "not_shown": f"{name}: these runs cannot show it"}
        for name in ("cubic_stiffness", "drive_rotation")
    ]
    study = assemble(rows, [5.0], background)
    said = {row[0]: row[-1] for row in tabulate(study)[1]}
    assert "part of the background" in said["cubic_stiffness"]
    assert said["drive_rotation"].endswith("cannot show it")
    told = "background: partly explained, χ² 329: cubic stiffness"
    assert describe_background(study) == told
    assert draw_figure(study).get_suptitle() == told


def test_the_command_tells_the_background(hrg, recordings, tmp_path, monkeypatch):
    background = {"verdict": "partly explained", "after": {"chi2_per_dof": 329.0}}
    background["effects"] = [{"name": "cubic_stiffness"}]
    monkeypatch.setattr(
        recovery, "recovery_study", lambda *given, **more: assemble([], [5.0], background)
    )
    monkeypatch.setattr(study_command, "_settings_of_study", lambda *given: {})
    store.write(tmp_path / "run.h5", recordings[0])
    done = hrg("study", "recovery", tmp_path / "run.h5")
    assert "background: partly explained, χ² 329: cubic stiffness" in done.out, done


def test_what_is_hidden_is_of_the_size_asked_for(recordings, monkeypatch):
    """Every effect that these runs show changes them by its size, and twice the size by twice as
    much."""
    waves = [recovery._make_wave(recording, 40.0) for recording in recordings]
    cause = {
        "name": "cubic_stiffness",
        "parameters": {"pull_rad_s": {"value": 0.3, "std": 1e-4, "units": ""}},
        "indistinguishable_from": [],
    }
    background = {"verdict": "explained", "effects": [cause], "after": {"chi2_per_dof": 1.0}}
    monkeypatch.setattr(recovery, "_diagnosed", lambda waves, scale_factor: background)
    fit = fit_background(waves, None, background)
    for name in ("momentum_kick", "saturation"):
        one, two = recovery.recover(
            (recordings, waves, background, name, 0, (10.0, 20.0), 40.0, None, 0)
        )
        assert one["size"] == 10 and not one["first"] and one["false"] == []
        if name != "saturation":
            assert all(
                two["true"][p.name] == pytest.approx(2 * one["true"][p.name])
                for p in find(name).fitted()
            )
    (row,) = recovery.recover(
        (recordings, waves, background, "drive_rotation", 0, (10.0,), 40.0, None, 0)
    )
    assert "cannot show it" in row["not_shown"]
    assert fit.chi2 / fit.dof < 1.2


def entry(name, value=1.0, std=0.1, others=()):
    return {
        "name": name,
        "parameters": {"gain": {"value": value, "std": std, "units": "1"}},
        "indistinguishable_from": list(others),
    }


def test_names_of_the_background_are_neither_false_nor_first():
    effect, true = find("gain_mismatch"), {"gain": 2.0}

    def judge(named, before=()):
        reports = [
            {"verdict": "explained", "effects": list(effects), "after": {"chi2_per_dof": 1.0}}
            for effects in (named, before)
        ]
        return judge_report(*reports, effect, true)

    row = judge([entry("ageing"), entry("gain_mismatch", 1.8)], [entry("ageing")])
    assert row["first"] and row["among"] and row["false"] == []
    assert row["found_over_true"]["gain"] == pytest.approx(0.9) and row["error_over_std"][
        "gain"
    ] == pytest.approx(-2)
    row = judge([entry("ageing"), entry("gain_mismatch", 1.8)])
    assert not row["first"] and row["among"] and row["false"] == ["ageing"]
    row = judge([entry("gain_mismatch", 2.5)], [entry("gain_mismatch", 0.5)])
    assert row["first"] and row["found_over_true"]["gain"] == pytest.approx(1)
    row = judge([entry("rate_bias", others=("gain_mismatch",))])
    assert row["first"] and row["false"] == []
    row = judge([entry("rate_bias", others=("gain_mismatch", "ageing", "drive_rotation"))])
    assert not row["among"] and row["false"] == ["rate_bias"]
    assert (
        assemble([], [5.0], {"verdict": "adequate", "effects": [], "after": {"chi2_per_dof": 1.0}})[
            "effects"
        ]
        == {}
    )


def test_the_study_says_what_is_missing(recordings):
    with pytest.raises(HrgError, match="no recording is named"):
        recovery_study([])
    with pytest.raises(HrgError, match="did you mean"):
        recovery_study(recordings, effects=["gain_mismach"])
    with pytest.raises(HrgError, match="no diagnosis as they are"):
        recovery_study([recordings[0], recordings[0]], periods_per_window=40.0)


@pytest.mark.slow
def test_the_command_writes_table_figure_and_figures(tmp_path, recordings):
    paths = []
    for recording in recordings:
        store.write(path := tmp_path / f"{recording.run_id}.h5", recording, False)
        paths.append(str(path))
    command = [
        sys.executable,
        "-m",
        "hrg_cli.cli",
        "study",
        "recovery",
        *paths,
        "--effects",
        "damping_drift",
        "--sizes",
        "30",
    ]
    command += ["-o", str(tmp_path / "out"), "--set", "periods_per_window=40"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "recovery.csv",
        "recovery.json",
        "recovery.png",
    }
    rows = list(csv.reader((tmp_path / "out" / "recovery.csv").read_text().splitlines()))
    assert rows[0][0] == "effect" and rows[1][:2] == ["damping_drift", "1.00"]
    assert json.loads((tmp_path / "out" / "recovery.json").read_text())["result"]["rows"][0][
        "first"
    ]
    refused = subprocess.run(
        [*command[:4], "redundancy", paths[0]], capture_output=True, text=True, check=False
    )
    assert refused.returncode == 2 and "makes its own data" in refused.stderr
