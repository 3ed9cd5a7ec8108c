"""Each bound of a declaration at its edge: the value on it, the next one beyond it, and what is not
finite."""

from dataclasses import replace

import numpy as np
import pytest
import records_by_hand

from hrg_cli.records import Column, Valid, Wave
from hrg_cli.store.validity import attribute_problem, bound_together, values_problem

EDGES = (
    (Valid(above=2.0), 2.0, np.nextafter(2.0, 3.0), "above 2"),
    (Valid(at_least=2.0), np.nextafter(2.0, 1.0), 2.0, "2.*expected"),
    (Valid(at_most=2.0), np.nextafter(2.0, 3.0), 2.0, "2.*expected"),
    (Valid(), np.inf, 1e300, "finite"),
    (Valid(), -np.inf, -1e300, "finite"),
    (Valid(infinite=True, at_most=2.0), np.inf, -np.inf, "2.*expected"),
)


@pytest.mark.parametrize(("valid", "wrong", "right", "says"), EDGES)
def test_values_and_attributes_at_their_bounds(valid, wrong, right, says):
    column = Column("", "a number", ("row",), None, None, "f8", False, None, valid)
    good, bad = np.array([right, right]), np.array([right, wrong])
    assert values_problem(good, column) is None and attribute_problem(right, column) is None
    problem = values_problem(bad, column)
    assert problem is not None and "row 2" in problem
    assert attribute_problem(wrong, replace(column, dims=None)) is not None


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda r: {"node_min": r.node_max, "node_max": r.node_min}, "above its highest"),
        (lambda r: {"rate_min_rad_s": 1.0, "rate_max_rad_s": -1.0}, "above its highest"),
        (lambda r: {"covariance": np.asarray(r.covariance)[:-1, :-1]}, "one a coefficient"),
        (lambda r: {"scale_factor": 0 * np.asarray(r.scale_factor)}, "scale_factor holds 0"),
        (lambda r: {"scale_factor": 1e-320 * np.asarray(r.scale_factor)}, "scale_factor holds 0"),
        (lambda r: {"drift_harmonics": np.asarray(r.drift_harmonics)[:, :-1]}, "pairs of cos"),
    ],
)
def test_the_fields_of_a_calibration_agree(change, says):
    record = records_by_hand.calibration()
    assert bound_together(record) is None
    assert says in bound_together(record.replace(**change(record)))


@pytest.mark.parametrize("first", (-1e300, -1.1e12))
def test_times_out_of_all_proportion_are_refused(first):
    times = np.array([first, 0.0, 1.0])
    assert "at least -1000000000000" in values_problem(times, Wave.columns()["time_s"])
    assert values_problem(np.array([-9e11, 0.0, 9e11]), Wave.columns()["time_s"]) is None
