"""A window that holds what no wave can is left out and named; a fit of it is that without it."""

import numpy as np
import pytest
import synthetic_waves

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.fitting.envelopes.wild_rows import find_wild_rows, flag_wild_rows
from hrg_cli.records import FLAG_NOT_FINITE
from hrg_cli.stages.identify import identify

ROW = 20


@pytest.fixture(scope="module")
def waves():
    starts = ((0.1, 0.0), (0.6, 2.0), (0.4, -2.0))
    return [
        synthetic_waves.run_down(angle, rate, seconds=1.0, window=5e-3, seed=n)
        for n, (angle, rate) in enumerate(starts)
    ]


def spoilt(wave, name, value):
    values = np.array(getattr(wave, name))
    values[ROW] = value
    return wave.replace(**{name: values})


@pytest.mark.parametrize(
    "name",
    ["main_amplitude", "quadrature_amplitude", "wave_angle_rad", "phase_rad", "temperature_degc"],
)
def test_a_wild_row_is_named_and_left_out(waves, name):
    """1e30 in a run's amplitude was "no run-down of a resonator can be fitted; look at the
    envelopes"."""
    first = waves[0].replace(temperature_degc=np.full(len(waves[0]), 21.5))
    told, said = flag_wild_rows(spoilt(first, name, -1e11))
    assert np.flatnonzero(told.flags).tolist() == [ROW]
    assert f"{name} is -1e+11 in row {ROW + 1} of its wave" in said
    flagged = first.replace(flags=np.where(np.arange(len(first)) == ROW, FLAG_NOT_FINITE, 0))
    found, without = (identify([one, *waves[1:]]) for one in (spoilt(first, name, 1e11), flagged))
    np.testing.assert_array_equal(found.value, without.value)
    assert any(f"{name} is 1e+11 in row {ROW + 1}" in reason for reason in found.status_reasons)


def test_what_a_wave_can_hold_is_not_wild(waves):
    assert flag_wild_rows(waves[0]) == (waves[0], "")
    decay = np.exp(-np.arange(400) / 10)  # of which all but the first rows are next to nothing
    jump = np.where(np.arange(400) < 200, 0.0, 1e9)
    for values in (decay, jump, np.zeros(400), np.full(400, 7.0), np.r_[5.0, np.zeros(399)]):
        assert not len(find_wild_rows(values)[0])


@pytest.mark.parametrize("name", ["wave_angle_rad", "phase_rad", "rate_rad_s", "temperature_degc"])
def test_angles_rates_and_temperatures_beyond_all_measure_are_refused_at_reading(
    waves, name, tmp_path
):
    with pytest.raises(HrgError, match=rf"{name} holds 1e\+30 in row {ROW + 1}, at most"):
        store.write(
            tmp_path / "w.h5",
            spoilt(waves[0].replace(temperature_degc=np.full(len(waves[0]), 20.0)), name, 1e30),
        )
