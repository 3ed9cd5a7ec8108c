"""A cause too small to be named may move a base value by many of its σ: σ holds that."""

import pytest
from diagnosis_programme import programme, verdict

FRICTION = {"dry_friction": {"slope_1_s": 4e-5}}
PAIR = {"nonlinear_damping": {"damping_1_s": 1.5e-4}, "dry_friction": {"slope_1_s": 6e-5}}


def damping_of(seed, hidden):
    """The verdict, the damping's row, and how many of its σ it is off."""
    table = programme(seed, hidden, runs=4)
    record, out = verdict(table)
    row = next(row for row in out["values"] if row["name"] == "damping_rate_1_s")
    return record.verdict, row, (row["value"] - table["device"]["damping_rate_1_s"]) / row["std"]


@pytest.mark.parametrize(("seed", "hidden"), ((1, FRICTION), (2, PAIR)))
def test_what_may_be_there_unnamed_is_in_the_standard_deviation(seed, hidden):
    """A friction of 3.8 σ, and two causes of 3 σ that hide one another: without them in the model
    the damping is 14 and 36 of the fit's own σ off."""
    said, row, off = damping_of(seed, hidden)
    assert said == "adequate" and abs(off) < 4
    assert "dry_friction" in row["doubted_for"]


def test_what_nothing_hints_at_widens_no_standard_deviation():
    said, row, off = damping_of(2, {})
    assert said == "adequate" and abs(off) < 4
    assert "doubted_for" not in row and row["std"] < 5.5e-6  # 5.1e-6 is the fit's own
