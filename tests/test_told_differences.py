"""`hrg diff` on the screen: names and units of the trade; the JSON keeps keys and SI."""

import json

import numpy as np
import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.commands.told_differences import told_differences
from hrg_cli.comparing import compare
from hrg_cli.reporting.figure_names import name_of_figure


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
    rows = {row[0]: row for row in told_differences([d for d in found if d.sigma is not None])}
    values = dict(zip(old.name, zip(old.value, old.std)))
    factor, std = values["scale_factor"]
    change = rows["scale factor K"][3]
    assert change.startswith("−") and change.endswith("ppm")
    mantissa, _, power = change[1:].removesuffix(" ppm").partition("×10")
    size = float(mantissa.partition("(")[0]) * 10 ** int(power.translate(SUPERSCRIPTS) or 0)
    assert size == pytest.approx(3e6 * std / factor, rel=0.1)
    for figure in ("scale factor K", "damping rate ν"):
        assert rows[figure][4] == "−2.12", "σ of both: 3/√2"


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
    assert name_of_figure(key) == words


def test_a_figure_kept_twice_is_told_once():
    old = by_hand.diagnosis()
    report = json.loads(old.report)
    rows = told_differences(compare(old, old.replace(report=json.dumps(report))).differences)
    assert len(rows) == len(set(rows))
