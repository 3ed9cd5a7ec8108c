"""Times in days, as spreadsheets count them: read as such where somebody says so, never taken for
seconds."""

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.formats import import_log
from hrg_cli.records import collect

T = np.arange(4000) / 2000.0
C, S = np.cos(2 * np.pi * 101.3 * T), 0.4 * np.cos(2 * np.pi * 101.3 * T + 0.2)


def imported(folder, title, digits, begun=46355.5, mark=".", **settings):
    """A log whose times are days, printed to so many digits behind the mark."""
    days = [f"{begun + t / 86400:.{digits}f}".replace(".", mark) for t in T]
    rows = [f"{day};{c:.6f};{s:.6f}".replace(".", mark) for day, c, s in zip(days, C, S)]
    path = folder / "log.csv"
    path.write_text("\n".join([f"{title};c;s", *rows]) + "\n")
    return collect(import_log(path, **settings))


@pytest.mark.parametrize("digits", [10, 12, 15])
@pytest.mark.parametrize(
    ("title", "mark", "settings"),
    [("Time (d)", ".", {}), ("Zeit [Tage]", ",", {}), ("Time", ".", {"time_units": "d"})],
)
def test_days_that_are_called_so_are_even_times(tmp_path, title, mark, settings, digits):
    found = imported(tmp_path, title, digits, mark=mark, **settings)
    assert (found.sample_rate_hz, found.status, found.start_time) == (2000.0, "valid", "")


@pytest.mark.parametrize("digits", [5, 12])
def test_a_spreadsheets_days_are_never_seconds(tmp_path, digits):
    """2000 Hz would be 173 MHz; with few digits one time stands in many rows."""
    with pytest.raises(HrgError, match=r"begin at 46355\.5 as the days.*give time_units"):
        imported(tmp_path, "Time", digits)


def test_days_from_the_runs_beginning_are_doubted(tmp_path):
    found = imported(tmp_path, "Time", 14, begun=0.0)
    assert found.status == "suspect" and "give time_units" in found.status_reasons[0]


def test_days_with_few_digits_need_a_rate(tmp_path):
    told = imported(tmp_path, "Time", 5, time_units="d", sample_rate_hz=2000.0)
    assert told.status == "valid"
    unnamed = imported(tmp_path, "Time", 5, sample_rate_hz=2000.0)
    assert unnamed.status == "suspect" and "time_units" in unnamed.status_reasons[0]


def test_seconds_of_a_day_stay_seconds(tmp_path):
    rows = [f"{46355.5 + t:.4f},{c:.6f},{s:.6f}" for t, c, s in zip(T, C, S)]
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["time,c,s", *rows]) + "\n")
    found = collect(import_log(path))
    assert (found.sample_rate_hz, found.status) == (2000.0, "valid")
