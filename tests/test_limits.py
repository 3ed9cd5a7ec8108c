"""Figures held against limits."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from forced_runs import Truth, programme

from hrg_cli.errors import HrgError, UsageError
from hrg_cli.limits import MOST_LIMITS, Judged, check, find_table, list_rows
from hrg_cli.reporting.lot_page import find_limits
from hrg_cli.settings import load_toml
from hrg_cli.stages.calibrate import calibrate


@pytest.fixture(scope="module")
def record():
    return calibrate(
        programme(Truth(3), (0, 40), (-0.5, 0.5), duration=12),
        harmonics=2,
        scale_factor_harmonics=2,
        bootstrap=0,
    )


def test_within_and_outside(record):
    rows = check(
        record,
        {
            "calibration": {
                "scale_factor": {"minimum": 0.5, "maximum": 0.6},
                "drift_rms_rad_s.held_out": 1e-12,
            }
        },
    )
    assert [row.passed for row in rows] == [True, True, False]
    assert (
        "drift_rms_rad_s.held_out is" in rows[2].describe()
        and "at most 1e-12" in rows[2].describe()
    )


def test_what_is_not_in_the_file_does_not_pass(record):
    row = check(record, {"calibration": {"quality": 1.0}})[-1]
    assert not row.passed and row.describe() == "quality is not in the file"


def test_status_is_judged(record):
    suspect = record.judged(["because"])
    assert not check(suspect, {"harmonics": 4})[0].passed
    assert check(suspect, {"status": "suspect", "harmonics": 4})[0].passed
    with pytest.raises(HrgError, match="status"):
        check(suspect, {"status": "good"})


@pytest.mark.parametrize("limit", ["big", True, {"max": 1.0}, {"minimum": "a"}, float("nan"), {}])
def test_wrong_limits_are_named(record, limit):
    with pytest.raises(HrgError, match=r"limit harmonics|hold nothing"):
        check(record, {"calibration": {"harmonics": limit}})


def test_limits_for_another_kind_only(record):
    with pytest.raises(HrgError, match=r"\[calibration\]"):
        check(record, {"resonator": {"scale_factor": 1.0}})


def test_the_example_file(record):
    rows = check(record, load_toml(Path(__file__).parents[1] / "configs" / "limits.toml"))
    assert len(rows) == 5 and all(row.value is not None for row in rows)


@pytest.mark.parametrize("value", ["1e400", "-1e400", "NaN"])
def test_what_is_not_finite_passes_no_limit(record, value):
    damaged = record.replace(details=record.details[:-1] + f', "strange": {value}' + "}")
    for limit in ({"minimum": -1.0}, {"maximum": 1.0}, 1.0):
        assert not check(damaged, {"calibration": {"details.strange": limit}})[-1].passed


def test_a_figure_at_its_limit_passes_and_beyond_does_not(record):
    for value, passed in ((4.0, True), (4.5, False)):
        whole = record.replace(details=record.details[:-1] + f', "figure": {value}' + "}")
        assert check(whole, {"calibration": {"details.figure": 4.0}})[-1].passed is passed
        assert check(whole, {"calibration": {"details.figure": {"minimum": 8.5 - value}}})[
            -1
        ].passed is (not passed)


@pytest.mark.parametrize("count", [MOST_LIMITS, MOST_LIMITS + 1])
def test_a_file_of_limits_is_bounded(record, count):
    """A limits file of hundreds of thousands of keys is no limits file; its work is refused."""
    table = {"calibration": {f"bias_{k}": {"minimum": 0.0} for k in range(count)}}
    if count > MOST_LIMITS:
        with pytest.raises(HrgError, match=f"hold {count} entries .* {MOST_LIMITS} at most"):
            check(record, table)
    else:
        assert len(check(record, table)) == count + 1  # and the status


JUDGED = Judged(
    "calibration", "valid", {"drift_rms_rad_s.held_out": 1e-6, "scale_factor": 0.55}, None
)


@pytest.mark.parametrize(
    "written",
    [
        '"drift_rms_rad_s.held_out" = "5 deg/h"',
        'drift_rms_rad_s.held_out = "5 deg/h"',
        'drift_rms_rad_s = { held_out = { maximum = "5 deg/h" } }',
        '[calibration.drift_rms_rad_s]\nheld_out = "5 deg/h"',
    ],
)
def test_a_name_with_dots_needs_no_quotes(written):
    """Without them it was "limit drift_rms_rad_s has held_out", and --set had no way to give it."""
    limits = tomllib.loads(f"[calibration]\n{written}\n")
    _, row = list_rows(JUDGED, find_table("calibration", limits))
    assert row.name == "drift_rms_rad_s.held_out"
    assert row.maximum == pytest.approx(5 * np.pi / 180 / 3600)


@pytest.mark.parametrize("limit", ["{ minimun = 0.5 }", "{ minimum = 0.5, most = 0.6 }"])
def test_a_mistyped_bound_stays_one(limit):
    limits = tomllib.loads(f"[calibration]\nscale_factor = {limit}\n")
    with pytest.raises(UsageError, match="minimum"):
        list_rows(JUDGED, find_table("calibration", limits))


def test_a_lots_limit_needs_no_quotes():
    limits = tomllib.loads("[calibration]\ndrift_rms_rad_s.held_out = 1e-3\n")
    assert find_limits("drift_rms_rad_s_held_out", limits) == (None, 1e-3)
