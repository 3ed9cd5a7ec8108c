"""What a few dwells leave unknown between them is in the standard deviations, and is told."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
from forced_runs import Truth, forced_run, programme

from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.calibration.interpolation import _say_between, compute_standard_deviations

FIXED = {"harmonics": 2, "scale_factor_harmonics": 2, "model": "table", "bootstrap": 0}
LOW, HIGH, ORDERS = -20.0, 60.0, 5


class Bent(Truth):
    """Every coefficient over temperature with five orders, each `fall` times as large as the one
    before."""

    def __init__(self, seed, fall):
        super().__init__(seed)
        draw = np.random.default_rng([5, seed])
        size = fall ** np.arange(ORDERS + 1.0)[:, None]
        self.d = draw.normal(size=(ORDERS + 1, 5)) * 2e-4 * size
        self.k = draw.normal(size=(ORDERS + 1, 5)) * 3e-4 * size
        self.k[0, 0] = 0.55

    def powers(self, temperature):
        x = (2 * np.asarray(temperature, float) - LOW - HIGH) / (HIGH - LOW)
        return np.moveaxis(np.polynomial.chebyshev.chebvander(x, ORDERS), -1, 0)


def calibrated(truth, nodes, seed, interpolation="cubic"):
    dwells = tuple(np.linspace(LOW, HIGH, nodes))
    waves = programme(truth, dwells, (-0.5, 0.5), seed=seed, duration=15)
    return calibrate(waves, interpolation=interpolation, **FIXED)


def errors_over_std(record, truth):
    """Of D and K over the whole range, rms."""
    x, theta = np.linspace(LOW, HIGH, 200), np.linspace(0, 40, 200)
    true = truth.drift(x, theta), truth.scale(x, theta)
    stds = compute_standard_deviations(record, x, theta)
    return [
        float(np.sqrt(np.mean(((got - it) / std) ** 2)))
        for got, it, std in zip(record.values_at(x, theta), true, stds, strict=True)
    ]


@pytest.mark.parametrize(
    ("nodes", "interpolation"),
    [
        (3, "cubic"),
        pytest.param(4, "cubic", marks=pytest.mark.slow),
        pytest.param(5, "cubic", marks=pytest.mark.slow),
        pytest.param(6, "cubic", marks=pytest.mark.slow),
        pytest.param(8, "cubic", marks=pytest.mark.slow),
        pytest.param(3, "linear", marks=pytest.mark.slow),
        pytest.param(5, "linear", marks=pytest.mark.slow),
    ],
)
def test_between_nodes_errors_are_as_stated_however_the_tables_bend(nodes, interpolation):
    """77 σ before with three nodes and a third order: the splines of three or four nodes had no
    doubt at all."""
    square = []
    for fall in (0.3, 0.6):
        for seed in range(5):
            truth = Bent(seed, fall)
            square.append(errors_over_std(calibrated(truth, nodes, seed, interpolation), truth))
    rms = np.sqrt(np.mean(np.square(square), axis=0))
    assert np.all((rms > 0.2) & (rms < 1.3)), rms


def between_checks(record):
    """{name: check} of what is not known between nodes."""
    every = json.loads(record.details)["checks"]
    return {check["name"]: check for check in every if check["name"].endswith("_between_nodes")}


@pytest.mark.parametrize(
    ("nodes", "fall", "passed"), [(3, 0.6, False), (5, 0.6, False), (5, 0.02, True)]
)
def test_what_lies_between_the_nodes_is_a_check(nodes, fall, passed):
    """Its value is what interpolation adds midway over the error at the nodes."""
    record = calibrated(Bent(1, fall), nodes, 1)
    checks = between_checks(record)
    assert set(checks) == {"drift_between_nodes", "scale_factor_between_nodes"}
    assert all(check["passed"] is passed for check in checks.values()), checks
    theta = np.linspace(0, np.pi / 2, 24, endpoint=False)
    step = (HIGH - LOW) / (nodes - 1)

    def rms(first):
        places = np.repeat(np.arange(first, HIGH + 1e-9, step), len(theta))
        angles = np.tile(theta, len(places) // len(theta))
        return [np.sqrt(np.mean(s**2)) for s in compute_standard_deviations(record, places, angles)]

    for check, midway, at_nodes in zip(checks.values(), rms(LOW + step / 2), rms(LOW), strict=True):
        # the fit's own part midway differs little from that at the nodes
        assert np.hypot(check["value"], 1.0) == pytest.approx(midway / at_nodes, rel=0.3)
    assert (record.status, bool(record.status_reasons)) == ("valid", not passed)


def test_what_few_nodes_leave_unknown_is_said_with_what_to_do():
    record = calibrated(Bent(1, 0.6), 3, 1)
    (said,) = record.status_reasons
    assert record.status == "valid" and "add dwells at 0 and 40 °C" in said
    straight = Bent(1, 0.6)
    straight.d[2:], straight.k[2:] = 0.0, 0.0
    assert not calibrated(straight, 4, 1).status_reasons


@pytest.mark.parametrize(
    ("nodes", "axis", "places"),
    [
        ([1001.994, 1003.7, 1005.406], "frequency", "1002.8 and 1004.6 Hz"),
        ([-40.0, 15.0, 70.0], "temperature", "-12 and 42 °C"),
    ],
)
def test_where_to_dwell_is_told_as_finely_as_the_nodes_lie(nodes, axis, places):
    """In hertz it was "1e+03 and 1e+03"."""
    tables = SimpleNamespace(node=nodes, axis=axis)
    said = _say_between(tables, [1e-5, 1e-5], [1e-6, 1e-6], [True, True])
    assert f"add dwells at {places}" in said


def test_the_error_told_midway_holds_that_of_the_nodes_too():
    """A scale factor that does not bend was "known to 0.002 ppm midway, 0.25 ppm at the nodes"."""
    truth = Bent(1, 0.6)
    truth.k[1:] = 0.0
    record = calibrated(truth, 3, 1)
    (said,) = record.status_reasons
    checks = between_checks(record)
    assert not checks["drift_between_nodes"]["passed"]
    assert checks["scale_factor_between_nodes"]["passed"] and "K to" not in said
    told = [float(x) for x in re.findall(r"D to ([0-9.e+-]+) °/h", said)]
    theta = np.linspace(0, np.pi / 2, 24, endpoint=False)
    for figure, places in zip(told, ([0.0, 40.0], [LOW, 20.0, HIGH]), strict=True):
        stds = compute_standard_deviations(
            record, np.repeat(places, 24), np.tile(theta, len(places))
        )
        rms = np.degrees(np.sqrt(np.mean(stds[0] ** 2))) * 3600
        assert figure == pytest.approx(rms, rel=0.06)
    assert told[0] > 3 * told[1]


def test_runs_that_pass_between_the_nodes_show_how_the_tables_bend():
    """A sweep's residual would show what three nodes cannot hold: nothing is added for it."""
    truth = Truth(3)
    waves = [
        forced_run(truth, lambda t: LOW + (HIGH - LOW) * t / 40, rate, 40.0, k, run_id=f"R{rate:g}")
        for k, rate in enumerate((-0.5, 0.5, 0.02))
    ]
    record = calibrate(waves, nodes=[LOW, 20.0, HIGH], **FIXED)
    assert not any("between" in reason for reason in record.status_reasons)
    assert np.all(np.array(errors_over_std(record, truth)) < 1.5)


@pytest.mark.parametrize("slope", [2e-5, 0.0])
def test_two_nodes_of_one_scale_factor_by_chance_do_not_say_that_it_is_straight(slope):
    """A bend of 400 ppm between nodes whose K differs by 60 ppm was 4.4 σ, and without any
    difference more: its size was told by that difference alone."""
    truth = Bent(1, 0.6)
    truth.k[1:] = 0.0
    truth.k[1, 0], truth.k[2, 0] = slope, 1e-4
    _, scale = errors_over_std(calibrated(truth, 2, 1), truth)
    assert 0.2 < scale < 2.0


@pytest.mark.parametrize("bend", [0.0, 1e-5])
def test_three_nodes_on_a_line_by_chance_do_not_say_that_nothing_bends_between(bend):
    """A cubic of 73 ppm in the mean of K was 28 and 18 σ: that all harmonics fall alike was taken
    for so many proofs, where one of them moves."""
    truth = Bent(1, 0.6)
    truth.k[1:] = 0.0
    truth.k[1:4, 0] = 5e-4, bend, 4e-5
    _, scale = errors_over_std(calibrated(truth, 3, 1), truth)
    assert scale < 2.0
