"""A line written twice is left out and named; one time with two values refuses the log."""

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.formats import import_log, text_logs
from hrg_cli.records import collect

N = 1000
T = np.arange(N) / 2000.0
C, S = np.cos(2 * np.pi * 101.3 * T), 0.4 * np.cos(2 * np.pi * 101.3 * T + 0.2)
LINES = [f"{t:.4f},{c:.6f},{s:.6f},20.0" for t, c, s in zip(T, C, S)]


def imported(folder, lines):
    path = folder / "log.csv"
    path.write_text("\n".join(["t,c,s,temperature", *lines]) + "\n")
    return collect(import_log(path))


@pytest.mark.parametrize("block", [1 << 20, 700])
def test_a_line_written_twice_counts_once(tmp_path, monkeypatch, block):
    monkeypatch.setattr(text_logs, "BLOCK_BYTES", block)
    lines = [line for k, line in enumerate(LINES) for _ in range(2 if k in (400, 700) else 1)]
    lines[900] = lines[900].rsplit(",", 1)[0] + ",-9999"
    found = imported(tmp_path, lines)
    np.testing.assert_allclose(found.c, C, rtol=0, atol=5.1e-7)
    assert found.sample_rate_hz == 2000.0 and found.status == "valid"
    said = " ".join(found.status_reasons)
    assert "line 403 (1 row): the same as the line above" in said
    assert "line 704 (1 row)" in said and "line 902" in said


def test_one_time_with_two_values_is_refused(tmp_path):
    lines = [*LINES[:401], LINES[400].replace("20.0", "20.1"), *LINES[401:]]
    with pytest.raises(HrgError, match=r"line 403 repeats the time.*keep one row of each time"):
        imported(tmp_path, lines)


def test_coarse_times_of_a_wave_at_rest_are_no_doubled_lines(tmp_path):
    with pytest.raises(HrgError, match="repeats the time"):
        imported(tmp_path, [f"{t:.3f},1.0,0.0,20.0" for t in T])
