"""Rows of a log that are not finite: left out and told, each quantity by itself."""

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify

SAMPLING_HZ, LENGTH_S = 8123.0, 4.0
LOG_S = np.linspace(0, LENGTH_S, 41)
RATE, WARM = 0.3 + 0.1 * LOG_S, 20 + LOG_S


def recorded(rate=RATE, warm=WARM):
    """A ringing of 1 kHz beside a log of 41 rows."""
    t = np.arange(0, LENGTH_S, 1 / SAMPLING_HZ)
    wave = np.exp(-0.3 * t) * np.cos(6285.0 * t) * np.array([[1.0], [0.4]])
    c, s = wave + 1e-3 * np.random.default_rng(7).standard_normal((2, len(t)))
    return Recording(
        c=c, s=s, sample_rate_hz=SAMPLING_HZ, mode="free", run_id="r0",
        auxiliary_time_s=LOG_S, rate_rad_s=rate, temperature_degc=warm,
    )  # fmt: skip


def demodulated(**log):
    return collect(demodulate(recorded(**log), periods_per_window=10.0))


def without(values, rows, what=np.nan):
    """A log without some of its rows."""
    out = values.copy()
    out[rows] = what
    return out


@pytest.mark.parametrize("what", [np.nan, np.inf])
def test_single_rows_are_read_from_those_beside_them(what):
    found = demodulated(rate=without(RATE, [3, 17, 40], what))
    whole = demodulated()
    np.testing.assert_allclose(found.rate_rad_s, whole.rate_rad_s, atol=1e-9 + 0.011)
    inside = found.time_s < LOG_S[39]
    np.testing.assert_allclose(found.rate_rad_s[inside], whole.rate_rad_s[inside], atol=1e-9)
    np.testing.assert_array_equal(found.temperature_degc, whole.temperature_degc)
    assert "the rate log holds 3 of 41 values that are not finite" in " ".join(found.status_reasons)


def test_a_thermometer_that_is_read_less_often_is_read_between():
    rare = np.arange(41) % 10 > 0
    found = demodulated(warm=without(WARM, rare))
    np.testing.assert_allclose(found.temperature_degc, demodulated().temperature_degc, atol=1e-9)
    assert found.status == "valid"


def test_nothing_is_known_in_a_hole():
    found = demodulated(rate=without(RATE, slice(10, 20)))
    hole = (found.time_s > LOG_S[9] + 0.1) & (found.time_s < LOG_S[20] - 0.1)
    assert hole.sum() > 50
    np.testing.assert_array_equal(np.isnan(found.rate_rad_s), hole)


def test_a_log_without_a_finite_value_is_called_that():
    """It was "400 of 400 windows lie outside its rate log"."""
    found = demodulated(rate=np.full(41, np.nan))
    assert np.isnan(found.rate_rad_s).all()
    said = "the rate log holds no finite value: all of its 41 rows are NaN"
    assert said in " ".join(found.status_reasons)
    with pytest.raises(HrgError, match=f"run r0: {said}.*no run is left"):
        identify([collect(estimate(found))])
