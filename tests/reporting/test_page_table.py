"""What the page makes of a JSON object, and of any figure: words, units, rounded values, what good and
bad look like; nothing about what is not there."""

import itertools
import json
import re

import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.reporting.figures.good_and_bad import explain_reading
from hrg_cli.reporting.page_answers import draw_answer
from hrg_cli.reporting.page_diagnosis import list_diagnosis
from hrg_cli.reporting.page_figures import draw_file, look_beside
from hrg_cli.reporting.page_files import describe_file
from hrg_cli.reporting.page_table import list_figures

CONTENT = {
    "drift_rms_rad_s": {"before": 8.4e-5, "after": 4.848e-6},
    "gain_mismatch": 0.0040016,
    "gain_mismatch_std": 7.75e-7,
    "is_late": False,
    "nothing": None,
    "noise": {
        "bias_instability_rad_s": {"value": 0, "std": 1.0, "low": 0, "high": 4.8481e-6},
        "quantization_rad": {"value": 5.9154e-5, "std": 1.24e-6, "low": 5.6e-5, "high": 6.1e-5},
        "chi2_per_dof": 1.17461,
    },
    "checks": [
        {
            "name": "drift_harmonic_2",
            "value": 0.5,
            "passed": True,
            "sentence": "the drift holds more",
        },
        {"name": "b", "value": 7.123456789, "passed": False, "sentence": "too much is left"},
    ],
    "variants": {"one": {"drift_rad_s": {"value": 4.8481e-6, "low": 4e-6, "high": 6e-6}}},
}


def cells(tables):
    return {row[0]: row[1:] for table in tables for row in table.rows}


def test_words_units_and_rounded_values():
    told = cells(list_figures("Figures", CONTENT))
    assert told["drift rms: before"] == ("17.3 °/h",) and told["drift rms: after"] == ("1 °/h",)
    assert told["gain mismatch"] == ("0.0040016(8)",) and "gain mismatch σ" not in told
    assert told["is late"] == ("no",) and "nothing" not in told
    assert told["bias instability"] == ("below 1 °/h",)
    assert told["quantization"] == ("59.2(12) µrad",)
    assert told["χ² per dof"] == ("1.17",)
    assert told["one"] == ("1 °/h (0.825 … 1.24)",)


def test_a_check_that_passes_says_nothing():
    told = cells(list_figures("Figures", CONTENT))
    assert told["drift harmonic 2"] == ("0.5", "yes", "–")
    assert told["b"] == ("7.123", "no", "too much is left")


def test_causes_are_told_by_what_is_left_of_them_after_the_fit():
    """A cause that another one imitates scores high beside the base model; that is no finding."""
    tested = [
        {"name": "gain_mismatch", "z": 304.0, "z_left": 0.1, "upper_limit": None, "units": "1"},
        {"name": "parasitic_force", "z": 220.0, "z_left": 1.234, "upper_limit": 2.6722e-5,
         "units": "rad", "visible": True},
        {"name": "clock_error", "z": 0.0, "z_left": 0.0, "upper_limit": None, "units": "1",
         "visible": False},
    ]  # fmt: skip
    record = by_hand.diagnosis()
    record = record.replace(report=json.dumps(json.loads(record.report) | {"tested": tested}))
    (table,) = [t for t in list_diagnosis(record) if t.caption == "Causes tested"]
    assert table.rows == [
        ("gain mismatch", "found", "–"),
        ("parasitic force", "1.23", "27 µrad"),
    ]
    assert not any("_" in word for t in list_diagnosis(record) for row in t.rows for word in row)


@pytest.mark.parametrize("kind", sorted(by_hand.RECORDS))
def test_every_figure_says_what_good_and_bad_look_like(tmp_path, kind):
    path = tmp_path / f"{kind}.h5"
    store.write(path, by_hand.RECORDS[kind]())
    beside = look_beside([path], [describe_file(path, 0, False)], True)
    for plot in itertools.chain(draw_answer(path), draw_file(path, beside)):
        assert plot.caption.count("Good:") == 1, plot.key
        assert plot.caption.count("Bad:") == 1, plot.key
        assert not re.search(r"[a-z]_[a-z]", re.sub(r"a_[AB]", "", plot.caption)), plot.caption


def test_what_is_told_by_the_figure_itself_is_not_told_again():
    assert explain_reading("answer") == "" and explain_reading("departure-phase").startswith(
        "Good: "
    )
