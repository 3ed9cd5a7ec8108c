"""Runs whose temperature log ends before they do, or begins after them."""

import json

import numpy as np
import pytest
from forced_runs import Truth, forced_run, programme

from hrg_cli.records import collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.compensate import compensate
from hrg_cli.stages.compensation import logged_run


@pytest.fixture(scope="module")
def truth():
    return Truth(21)


@pytest.fixture(scope="module")
def tables(truth):
    """Of three nodes, as if it were known that they do not bend between them."""
    found = calibrate(
        programme(truth, (-10, 15, 40), (-0.5, 0.05, 0.5), duration=40),
        harmonics=2,
        scale_factor_harmonics=2,
        bootstrap=0,
    )
    details = json.loads(found.details) | {"interpolation_std": {}}
    return found.replace(details=json.dumps(details))


def unlogged(truth, beyond, degc=lambda t: -5 + t):
    """A run at 0.4 rad/s without a rate log, its temperature NaN `beyond` parts of it."""
    run = forced_run(truth, degc, lambda t: 0.4 + 0 * t, 40, 99, noise=1e-6)
    part = np.arange(len(run)) / len(run)
    return run.replace(
        temperature_degc=np.where(beyond(part), np.nan, run.temperature_degc), rate_rad_s=None
    )


def told(done):
    return [why for why in done.status_reasons if "is not logged and is taken" in why]


@pytest.mark.parametrize(
    "beyond", [lambda part: part > 0.2, lambda part: part < 0.8, lambda part: part > 0.7]
)
def test_a_temperature_held_while_it_moved_is_suspect(tables, truth, beyond):
    done = collect(compensate(unlogged(truth, beyond), tables))
    whole = collect(compensate(unlogged(truth, lambda part: part < 0), tables))
    off = (done.angle_estimate_rad - whole.angle_estimate_rad)[-1]
    (why,) = told(done)
    assert done.status == "suspect"
    assert abs(off) > 5 * done.angle_estimate_rad_std[-1]
    assert float(why.split("up to ")[1].split(" rad")[0]) > 0.9 * abs(off)


@pytest.mark.parametrize(
    "beyond, degc",
    [
        (lambda part: part > 0.997, lambda t: -5 + t),
        (lambda part: (part > 0.3) & (part < 0.6), lambda t: -5 + t),
        (lambda part: part > 0.8, lambda t: 15 + 0 * t),
    ],
)
def test_windows_at_an_end_and_a_dwell_are_held(tables, truth, beyond, degc):
    done = collect(compensate(unlogged(truth, beyond, degc), tables))
    assert done.status == "valid" and not told(done)


def test_a_piece_beyond_the_log_is_held_as_the_whole_is(tables, truth, monkeypatch):
    """It was refused, its temperature "missing", where the run did not fit into one piece."""
    run = unlogged(truth, lambda part: part > 0.5)
    whole = collect(compensate(run, tables))
    monkeypatch.setattr(logged_run, "ROWS_AT_ONCE", 100)
    parts = collect(compensate(run, tables))
    assert parts.angle_estimate_rad == pytest.approx(whole.angle_estimate_rad, abs=1e-9)
    assert told(parts) == told(whole) != []
