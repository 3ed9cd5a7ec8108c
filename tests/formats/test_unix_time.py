"""Times that count from 1970 are known by their size: the unit that a log does not name, and when
the run began."""

import numpy as np
import pytest

from hrg_cli.formats import import_log
from hrg_cli.records import collect

T = np.arange(2000) / 1000.0
C, S = np.cos(2 * np.pi * 51.3 * T), 0.4 * np.cos(2 * np.pi * 51.3 * T + 0.2)
BEGAN, STAMP = 1_760_000_000, "2025-10-09T08:53:20Z"


def imported(folder, title, counts):
    rows = [f"{count},{c:.6f},{s:.6f}" for count, c, s in zip(counts, C, S)]
    path = folder / "log.csv"
    path.write_text("\n".join([f"{title},c,s", *rows]) + "\n")
    return collect(import_log(path))


@pytest.mark.parametrize(
    ("title", "per_second"),
    [("time", 1000), ("timestamp", 10**6), ("time", 10**9), ("time (ms)", 1000)],
)
def test_the_unit_of_whole_counts_is_told_by_their_size(tmp_path, title, per_second):
    step = per_second // 1000
    found = imported(tmp_path, title, [BEGAN * per_second + step * k for k in range(len(T))])
    assert found.sample_rate_hz == pytest.approx(1000.0, rel=1e-6)
    assert found.start_time[:19] == STAMP[:19]


def test_seconds_since_1970_begin_the_run(tmp_path):
    found = imported(tmp_path, "time", [f"{BEGAN + t:.4f}" for t in T])
    assert found.sample_rate_hz == 1000.0 and found.start_time == STAMP


def test_a_clock_that_began_with_the_instrument_names_no_day(tmp_path):
    """Three weeks after it was switched on, in seconds or milliseconds."""
    for per_second in (1, 1000):
        title = {1: "time", 1000: "time (ms)"}[per_second]
        found = imported(tmp_path, title, [f"{(2e6 + t) * per_second:.4f}" for t in T])
        assert found.sample_rate_hz == 1000.0 and found.start_time == ""
