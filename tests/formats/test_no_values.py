"""Marks for "no value" among temperatures and rates are left out and told; values stay."""

import numpy as np
import pytest

from hrg_cli.formats import import_envelope, import_log
from hrg_cli.records import collect

N = 1000
T = np.arange(N) / 2000.0
C, S = np.cos(2 * np.pi * 101.3 * T), 0.4 * np.cos(2 * np.pi * 101.3 * T + 0.2)
ABSENT = np.arange(N) % 50 == 7


def log(folder, title, values, other="rate (deg/s)"):
    """A log with a slow column, and one of 2 beside it."""
    table = np.column_stack([T, C, S, values, np.full(N, 2.0)])
    path = folder / "log.csv"
    titles = f"t (s),c (V),s (V),{title},{other}"
    np.savetxt(path, table, delimiter=",", header=titles, comments="", fmt="%.10g")
    return path


@pytest.mark.parametrize("mark", [-9999.0, -999.0, 9999.0, 1e30])
@pytest.mark.parametrize("other", ["rate (deg/s)", "note"])
def test_a_mark_is_no_temperature(tmp_path, mark, other):
    path = log(tmp_path, "temperature", np.where(ABSENT, mark, 20.0 + T), other)
    found = collect(import_log(path))
    measured = np.isfinite(found.temperature_degc)
    kept = found.auxiliary_time_s[measured]
    assert measured.sum() == N - 20 and found.status == "valid"
    np.testing.assert_allclose(found.temperature_degc[measured], 20.0 + kept, atol=1e-7)
    assert "20 of 1000 values of its temperature column" in found.status_reasons[0]
    assert "line 9, line 59" in found.status_reasons[0]


def test_a_mark_is_no_rate(tmp_path):
    path = log(tmp_path, "rate (deg/s)", np.where(ABSENT, -9999.0, 30.0), "temperature")
    rate = collect(import_log(path)).rate_rad_s
    np.testing.assert_allclose(rate[np.isfinite(rate)], np.radians(30.0), rtol=1e-12)


def test_what_may_be_a_value_stays(tmp_path):
    """9999°/h is 2.8°/s, and a kelvin above absolute zero is cold."""
    turning = log(tmp_path, "rate (deg/h)", np.where(ABSENT, 9999.0, 100.0), "temperature")
    assert collect(import_log(turning)).rate_rad_s[7] == pytest.approx(np.radians(9999 / 3600))
    cold = collect(import_log(log(tmp_path, "temperature (K)", np.where(ABSENT, 4.2, 300.0))))
    assert cold.temperature_degc[7] == pytest.approx(4.2 - 273.15) and not cold.status_reasons


def test_different_values_below_absolute_zero_doubt_the_unit(tmp_path):
    found = collect(import_log(log(tmp_path, "temperature (K)", np.where(ABSENT, -5.0 - T, 10.0))))
    assert found.status == "suspect" and "give temperature_units" in found.status_reasons[0]


def test_a_window_has_the_mean_of_the_temperatures_it_holds(tmp_path):
    path = log(tmp_path, "temperature", np.where(ABSENT, -9999.0, 20.0))
    found = collect(
        import_envelope(
            path, c_in_phase=2, c_quadrature=3, reference_frequency_hz=5e3, rows_per_window=100
        )
    )
    np.testing.assert_allclose(found.temperature_degc, 20.0)
    assert any("20 of 1000 values" in reason for reason in found.status_reasons)
