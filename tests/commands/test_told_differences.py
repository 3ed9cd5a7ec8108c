"""`hrg diff` on the screen: names and units of the trade; the JSON keeps keys and SI."""

import json

import numpy as np
import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.commands.told_differences import describe_beyond, list_differences
from hrg_cli.comparing import compare, compare_tables
from hrg_cli.reporting.figure_names import name_figure, name_figures


def moved(record, sigmas):
    return record.replace(value=np.asarray(record.value) + sigmas * np.asarray(record.std))


def test_the_screen_has_no_keys_and_no_radians(tmp_path, hrg):
    old = by_hand.resonator()
    store.write(tmp_path / "old.h5", old)
    store.write(tmp_path / "new.h5", moved(old, 3.0))
    shown = hrg("diff", tmp_path / "old.h5", tmp_path / "new.h5").out
    assert "_" not in shown.replace("θ_", "") and "rad" not in shown, shown
    for words in ("damping rate ν", "scale factor K", "°/h", "mHz", "°", "ppm", "2.12"):
        assert words in shown, words
    kept = hrg("diff", tmp_path / "old.h5", tmp_path / "new.h5", "--json").json
    names = {one["name"]: one["units"] for one in kept["differences"]}
    assert names["frequency_split_rad_s"] == "rad s-1" and "damping_rate_1_s" in names


def test_a_change_has_the_size_and_sign_of_its_figure():
    old = by_hand.resonator()
    found = compare(old, moved(old, -3.0)).differences
    rows = {row[0]: row for row in list_differences([d for d in found if d.sigma is not None])}
    values = dict(zip(old.name, zip(old.value, old.std)))
    factor, std = values["scale_factor"]
    change = rows["scale factor K"][3]
    assert change.startswith("−") and change.endswith("ppm")
    mantissa, _, power = change[1:].removesuffix(" ppm").partition("×10")
    size = float(mantissa.partition("(")[0]) * 10 ** int(power.translate(SUPERSCRIPTS) or 0)
    assert size == pytest.approx(3e6 * std / factor, rel=0.1)
    for figure in ("scale factor K", "damping rate ν"):
        assert rows[figure][4] == "−2.12", "σ of both: 3/√2"


def test_a_figure_that_is_gone_is_not_unmoved(tmp_path, hrg):
    """A resonator of runs at rest tells no K: beside one that does, "nothing moved from the
    baseline"."""
    whole = by_hand.resonator()
    kept = np.array([str(name) != "scale_factor" for name in whole.name])
    columns = {n: np.asarray(getattr(whole, n))[kept] for n in ("name", "value", "std", "units")}
    less = whole.replace(**columns, covariance=np.asarray(whole.covariance)[np.ix_(kept, kept)])
    for name, record in (("whole.h5", whole), ("less.h5", less)):
        store.write(tmp_path / name, record)
    both = tmp_path / "whole.h5", tmp_path / "less.h5"
    words = "scale factor K is in the old result alone"
    gone = hrg("check", both[1], "--baseline", both[0], "--json")
    assert gone.status == 3 and any(words in one for one in gone.json["status_reasons"])
    assert hrg("diff", *both, "--limit-sigma", "5").status == 3
    for old, new, place in ((*both, "old"), (*both[::-1], "new")):
        assert f"scale factor K: in the {place} result alone" in hrg("diff", old, new).out
    assert hrg("check", both[0], "--baseline", both[1]).status == 0


SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("details.final_analysis.readout_matrix.gain_mismatch", "readout matrix gain mismatch"),
        ("effects.nonlinear_damping.damping_1_s", "nonlinear damping: damping"),
        ("values.stiffness_axis_rad", "stiffness axis θ_ω"),
        ("gain.drift_error_deg_h.before", "drift error before"),
        ("allan.angle_random_walk_rad_sqrt_s.value", "angle random walk"),
        ("methods.propagator.scale_factor", "methods propagator scale factor K"),
        ("table.drift_rad_s", "drift D, where the tables differ most"),
    ],
)
def test_keys_in_words(key, words):
    assert name_figure(key) == words


def test_a_figure_kept_twice_is_told_once():
    old = by_hand.diagnosis()
    report = json.loads(old.report)
    rows = list_differences(compare(old, old.replace(report=json.dumps(report))).differences)
    assert len(rows) == len(set(rows))


@pytest.mark.parametrize("kind", ["resonator", "diagnosis"])
def test_a_file_and_itself_have_nothing_to_tell(tmp_path, hrg, kind):
    """Every figure was a row of zeros."""
    store.write(tmp_path / "one.h5", getattr(by_hand, kind)())
    shown = hrg("diff", tmp_path / "one.h5", tmp_path / "one.h5").out
    assert shown.splitlines() == ["nothing moved"]
    kept = hrg("diff", tmp_path / "one.h5", tmp_path / "one.h5", "--json").json
    assert all(one["difference"] == 0 for one in kept["differences"]) and kept["largest_sigma"] == 0


@pytest.mark.parametrize("nodes", [1, 2, 5, 9])
def test_a_table_and_itself_differ_by_nothing(nodes):
    """What interpolation rounds of one of the two was 1e-11 σ."""
    one = by_hand.calibration(nodes)
    found = compare_tables(one, one)
    assert len(found) == 2 and all(d.difference == 0 and d.sigma == 0 for d in found)


def test_what_rounding_moves_is_not_told(tmp_path, hrg):
    old = by_hand.resonator()
    store.write(tmp_path / "old.h5", old)
    given = ("diff", tmp_path / "old.h5", tmp_path / "new.h5")
    for sigmas, told in ((1e-8, "no figure moved by 0.01 σ or more\n"), (0.03, None)):
        store.write(tmp_path / "new.h5", moved(old, sigmas), force=True)
        shown = hrg(*given).out
        assert shown == told if told else "scale factor K" in shown


def test_what_moved_too_far_is_said_in_names_and_units(tmp_path, hrg):
    """The sentences of --limit-sigma were keys and no values."""
    old = by_hand.resonator()
    store.write(tmp_path / "old.h5", old)
    store.write(tmp_path / "new.h5", moved(old, 30.0))
    for words in (
        ("diff", tmp_path / "old.h5", tmp_path / "new.h5"),
        ("check", tmp_path / "new.h5", "--baseline", tmp_path / "old.h5"),
    ):
        told = hrg(*words, "--limit-sigma", "6")
        assert told.status == 3 and "_" not in told.err.replace("θ_", ""), told.err
        assert "scale factor K moved by 21.2 σ (" in told.err and " ppm), at most 6" in told.err
    both = [json.loads(by_hand.diagnosis().report), by_hand.diagnosis()]
    less = both[1].replace(report=json.dumps(both[0] | {"effects": both[0]["effects"][1:]}))
    gone = both[0]["effects"][0]["name"]
    [said] = [s for s in describe_beyond(compare(both[1], less), 1e9) if s.startswith("cause")]
    assert said == f"cause {gone.replace('_', ' ')} is in the old result alone"


def test_figures_of_one_name_are_told_apart():
    split = "frequency_split_rad_s"
    assert name_figures([("resonator", split)]) == {("resonator", split): "frequency split Δf"}
    two = name_figures([("resonator", split), ("diagnosis", f"values.{split}")])
    assert set(two.values()) == {"frequency split Δf, resonator", "frequency split Δf, diagnosis"}
    same = name_figures([("diagnosis", f"values.{split}"), ("diagnosis", f"details.{split}")])
    assert len(set(same.values())) == 2 and all(split in words for words in same.values())
