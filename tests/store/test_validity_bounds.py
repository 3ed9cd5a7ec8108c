"""Each bound of a declaration at its edge: the value on it, the next one beyond it, and what is not
finite."""

from dataclasses import replace

import numpy as np
import pytest
import records_by_hand

from hrg_cli.records import Column, Valid, Wave
from hrg_cli.store.covariance_checks import find_covariance_problem
from hrg_cli.store.validity import find_attribute_problem, find_values_problem, list_bound_together

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
    assert (
        find_values_problem(good, column) is None and find_attribute_problem(right, column) is None
    )
    problem = find_values_problem(bad, column)
    assert problem is not None and "row 2" in problem
    assert find_attribute_problem(wrong, replace(column, dims=None)) is not None


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
    assert list_bound_together(record) is None
    assert says in list_bound_together(record.replace(**change(record)))


@pytest.mark.parametrize("first", (-1e300, -1.1e12))
def test_times_out_of_all_proportion_are_refused(first):
    times = np.array([first, 0.0, 1.0])
    assert "at least -1000000000000" in find_values_problem(times, Wave.columns()["time_s"])
    assert find_values_problem(np.array([-9e11, 0.0, 9e11]), Wave.columns()["time_s"]) is None


COVARIANCE = np.array([[4.0, -1e-9, 0.0], [-1e-9, 1e-18, 0.0], [0.0, 0.0, 0.0]])
"""Units far apart, a correlation of −1/2, a value that is known exactly."""
BROKEN = {
    "negative variance, -4 in row 1": ((0, 0), -4.0),
    "negative variance, -1e-18 in row 2": ((1, 1), -1e-18),
    "not symmetric in row 1, column 2": ((0, 1), 1e-9),
    "correlation of -1.05 in row 1, column 2": (([0, 1], [1, 0]), -2.1e-9),
    "correlation of inf in row 1, column 3": (([0, 2], [2, 0]), 1e-12),
}


@pytest.mark.parametrize("kind", ["resonator", "calibration"])
@pytest.mark.parametrize("says", BROKEN)
def test_a_covariance_is_one(kind, says):
    """A variance of −1e-3 passed, and `rate` made a valid result of it."""
    record = records_by_hand.RECORDS[kind]()
    size = len(record.covariance)
    matrix = np.zeros((size, size))
    matrix[:3, :3] = COVARIANCE
    assert list_bound_together(record.replace(covariance=matrix)) is None
    place, value = BROKEN[says]
    matrix[place] = value
    assert says in list_bound_together(record.replace(covariance=matrix))


REPORTS = {
    "values is no list": '{"values": 3}',
    "effects is no list": '{"effects": [3]}',
    "a row of values has no value": '{"values": [{"name": "x"}]}',
    "a row of values has no std": '{"values": [{"name": "x", "value": 1, "std": true}]}',
    "a row of effects has no name": '{"effects": [{"name": 3}]}',
    "a row of not_separable has no effects": '{"not_separable": [{}]}',
    "the parameters of 'drag' are none": '{"effects": [{"name": "drag", "parameters": {"k": 1}}]}',
}


@pytest.mark.parametrize("says", REPORTS)
def test_the_tables_of_a_diagnosis_are_tables(says):
    """`diff`, `ledger add`, `check` and `plan` ended in internal errors."""
    record = records_by_hand.RECORDS["diagnosis"]()
    assert says in list_bound_together(record.replace(report=REPORTS[says]))
    whole = '{"values": [{"name": "x", "value": 1, "std": 2.5}], "effects": null, "wander": []}'
    assert list_bound_together(record) is None is list_bound_together(record.replace(report=whole))


def test_rounding_breaks_no_covariance():
    """A random matrix of rank 3 with deviations from 1e-9 to 1e9 and rounding of 1e-9 of each."""
    rng = np.random.default_rng(0)
    root = rng.normal(size=(8, 3)) * 10.0 ** np.linspace(-9, 9, 8)[:, None]
    matrix = root @ root.T
    matrix *= 1 + 1e-9 * rng.normal(size=matrix.shape)
    assert find_covariance_problem(matrix) is None
    assert find_covariance_problem(np.full((2, 2), 1e300)) is None
