"""Text logs of any dialect become the same recording, and broken ones a sentence naming the
line."""

import io
import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hrg_cli.errors import HrgError
from hrg_cli.formats import import_log, read_table
from hrg_cli.formats import text_logs as text_module
from hrg_cli.records import Recording, collect

RATE = 2000.0
T = np.arange(400) / RATE
C, S = np.cos(2 * np.pi * 130 * T), np.sin(2 * np.pi * 131 * T)
CLOSE = {"rtol": 0, "atol": 1e-12}


def whole(path: Path, **settings: object) -> Recording:
    return collect(import_log(path, **settings))  # type: ignore[arg-type]


def written(folder: Path, text: str | bytes, name: str = "log.csv") -> Path:
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def rows(
    columns: list[np.ndarray],
    separator: str = ",",
    decimal: str = ".",
    end: str = "\n",
    form: str = "{!r}",
) -> str:
    lines = [
        separator.join(form.format(float(v)).replace(".", decimal) for v in row)
        for row in zip(*columns)
    ]
    return end.join(lines) + end


@given(
    dialect=st.sampled_from(
        [
            (",", "."),
            (";", "."),
            (";", ","),
            ("\t", "."),
            ("\t", ","),
            ("|", "."),
            (" ", "."),
            ("   ", ","),
            (" , ", "."),
        ]
    ),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    header=st.sampled_from(["", "names", "names and units", "comment", "brackets"]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]),
    order=st.permutations(["time", "c", "s"]),
    comments=st.booleans(),
    last=st.booleans(),
    seed=st.integers(0, 100),
)
@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
def test_every_dialect_gives_the_same_samples(
    tmp_path, dialect, end, header, encoding, order, comments, last, seed
):
    separator, decimal = dialect
    rng = np.random.default_rng(seed)
    values = {
        "time": T[:60],
        "c": rng.standard_normal(60) * 10.0 ** rng.integers(-6, 6),
        "s": rng.standard_normal(60),
    }
    text = rows([values[name] for name in order], separator, decimal, end)
    units = {"time": "s", "c": "V", "s": "V"}
    titles = {
        "": "",
        "names": separator.join(order) + end,
        "names and units": separator.join(order)
        + end
        + separator.join(units[n] for n in order)
        + end,
        "comment": "# " + separator.join(order) + end,
        "brackets": separator.join(f"{n}[{units[n]}]" for n in order) + end,
    }[header]
    text = (
        ("# made by a test °\n".replace("\n", end) if comments else "")
        + titles
        + (text if last else text.rstrip("\r\n"))
    )
    path = written(tmp_path, text.encode(encoding))
    named = {} if header else {name: 1 + order.index(name) for name in order}
    recording = whole(path, **named)
    np.testing.assert_allclose(recording.c, values["c"], rtol=1e-15)
    np.testing.assert_allclose(recording.s, values["s"], rtol=1e-15)
    assert recording.sample_rate_hz == RATE and recording.time_s is None
    assert recording.c_units == ("V" if header in ("names and units", "brackets") else "1")
    assert recording.status == "valid" and recording.run_id == "log"


def test_without_header_the_rising_first_column_is_time(tmp_path):
    recording = whole(written(tmp_path, rows([T, C, S])))
    np.testing.assert_allclose(recording.c, C, **CLOSE)
    assert recording.sample_rate_hz == RATE


def test_quoted_cells_and_decimal_commas(tmp_path):
    buffer = io.StringIO()
    pd.DataFrame({"time": T, "Channel A": C, "Channel B": S}).map(
        lambda v: f"{v:.12f}".replace(".", ",")
    ).to_csv(buffer, index=False, quoting=1)
    recording = whole(written(tmp_path, buffer.getvalue()))
    np.testing.assert_allclose(recording.s, S, rtol=0, atol=1e-12)
    assert recording.sample_rate_hz == RATE


def test_clock_times_cross_midnight_and_stay_uneven(tmp_path):
    t = np.cumsum(np.random.default_rng(1).choice([0.243, 0.314], 400))
    base = pd.Timestamp("2026-01-01 23:59:30")
    clock = [(base + pd.Timedelta(seconds=v)).strftime("%H:%M:%S.%f")[:-3] for v in t]
    text = "".join(f"{c!r},{s!r},{k}\n" for c, s, k in zip(C.tolist(), S.tolist(), clock))
    recording = whole(written(tmp_path, text), mode_number=1)
    assert recording.sample_rate_hz is None and recording.mode_number == 1
    np.testing.assert_allclose(recording.time_s, t - t[0], atol=2e-3)
    np.testing.assert_allclose(recording.c, C, **CLOSE)


@pytest.mark.parametrize("begun", ["11:59:58", "23:59:58", "00:00:01"])
def test_clock_times_of_half_a_day_are_told_by_am_and_pm(tmp_path, begun):
    """Over noon and over midnight; the column was taken for text, and no time was found."""
    t = np.arange(400) * 0.01
    base = pd.Timestamp(f"2026-01-01 {begun}")
    clock = [base + pd.Timedelta(seconds=v) for v in t]
    told = [one.strftime("%I:%M:%S.%f")[:-3] + one.strftime(" %p") for one in clock]
    text = "clock,C,S\n" + "".join(
        f"{k},{c!r},{s!r}\n" for c, s, k in zip(C.tolist(), S.tolist(), told)
    )
    recording = whole(written(tmp_path, text))
    assert recording.sample_rate_hz == pytest.approx(100.0)
    np.testing.assert_allclose(recording.c, C, **CLOSE)


def test_times_that_are_too_seldom_for_the_oscillation_are_doubted(tmp_path):
    """Times in ms of a column that names no unit: 2 Hz of an oscillation at 130 Hz, "valid"."""
    text = "t,C,S\n" + rows([T * 1e3, C, S])
    seldom = whole(written(tmp_path, text), nominal_frequency_hz=130.0)
    assert seldom.status == "suspect" and "give time_units" in seldom.status_reasons[0]
    told = whole(written(tmp_path, text), nominal_frequency_hz=130.0, time_units="ms")
    assert told.status == "valid"


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%dT%H:%M:%S.%fZ",
        "%Y-%m-%d %H:%M:%S.%f",
        "%Y/%m/%d %H:%M:%S.%f",
        "%Y-%m-%dT%H:%M:%S.%f+00:00",
    ],
)
def test_dates_give_start_time_and_rate(tmp_path, form):
    stamps = pd.Timestamp("2026-02-28T23:59:59.900Z") + pd.to_timedelta(T, unit="s")
    text = "when,c,s\n" + "".join(
        f"{k.strftime(form)},{c!r},{s!r}\n" for k, c, s in zip(stamps, C.tolist(), S.tolist())
    )
    recording = whole(written(tmp_path, text))
    assert recording.sample_rate_hz == RATE
    assert recording.start_time == "2026-02-28T23:59:59.9Z"


def test_times_rounded_in_print_are_still_even(tmp_path):
    recording = whole(
        written(
            tmp_path,
            "time,c,s\n"
            + "".join(f"{t:.4f},{c!r},{s!r}\n" for t, c, s in zip(T, C.tolist(), S.tolist())),
        )
    )
    assert recording.sample_rate_hz == RATE
    t = np.arange(20_000) / 30_000.0
    recording = whole(written(tmp_path, "time,c,s\n" + "".join(f"{v:.6f},1.5,2.5\n" for v in t)))
    assert recording.sample_rate_hz == pytest.approx(30_000, rel=2e-6)


@pytest.mark.parametrize("form", ["{!r}", "{:.10g}", "{:.9e}"])
@pytest.mark.parametrize(("unit", "second"), [("s", 1.0), ("min", 1 / 60), ("h", 1 / 3600)])
@pytest.mark.parametrize("rate", [44_100.0, 96_000.0, 12_870.0, 166.963])
def test_a_first_time_of_zero_says_nothing_of_the_rounding(tmp_path, form, unit, second, rate):
    """Short steps are printed with exponents, and the 0 before them has one digit: the rate was
    rounded to one digit too."""
    t = np.arange(3000) / rate * second
    text = f"time ({unit}),c,s\n" + "".join(f"{form.format(v)},1.5,2.5\n" for v in t.tolist())
    assert whole(written(tmp_path, text)).sample_rate_hz == pytest.approx(rate, rel=1e-8)


def test_jittered_times_are_kept(tmp_path):
    t = T + np.random.default_rng(0).uniform(0, 0.02 / RATE, len(T))
    recording = whole(written(tmp_path, "time,c,s\n" + rows([t, C, S])))
    assert recording.sample_rate_hz is None
    np.testing.assert_allclose(recording.time_s, t - t[0], atol=1e-15)
    assert whole(
        written(tmp_path, "time,c,s\n" + rows([t, C, S])), sampling_tolerance=0.05
    ).sample_rate_hz == pytest.approx(RATE, rel=1e-4)


def test_a_gap_keeps_the_times(tmp_path):
    t = np.delete(T, slice(100, 130))
    recording = whole(
        written(
            tmp_path,
            "time,c,s\n" + rows([t, np.delete(C, slice(100, 130)), np.delete(S, slice(100, 130))]),
        )
    )
    assert np.diff(recording.time_s).max() == pytest.approx(31 / RATE)


def test_units_and_slow_columns(tmp_path):
    text = "time (ms);cos [mV];sin [mV];temp [K];table rate (deg/h);drive_main\n" + rows(
        [T * 1e3, C, S, 300 + T, 3600 * np.ones_like(T), 2 * T], ";"
    )
    r = whole(written(tmp_path, text))
    assert r.c_units == "mV" and r.sample_rate_hz == RATE
    np.testing.assert_allclose(r.temperature_degc, 26.85 + T, atol=1e-9)
    np.testing.assert_allclose(r.rate_rad_s, np.pi / 180)
    np.testing.assert_allclose(r.drive_main, 2 * T)
    np.testing.assert_allclose(r.auxiliary_time_s, T, atol=1e-12)
    short = whole(tmp_path / "log.csv", auxiliary_rows=40)
    assert 30 <= len(short.auxiliary_time_s) <= 60
    assert np.average(short.temperature_degc) == pytest.approx(26.85 + T.mean(), abs=0.01)
    assert np.all(np.diff(short.auxiliary_time_s) > 0)


@pytest.mark.parametrize("blank", ["", "nan"])
def test_slow_columns_with_times_of_their_own_end_before_the_channels(tmp_path, blank):
    """A table of text has one length: where the thermometer has no row its cells are blank."""
    lines = rows([T, C, S]).splitlines()
    own = [f"{0.05 * k!r},{20 + k!r}" for k in range(4)]
    cells = [*own, *[f"{blank},{blank}"] * (len(T) - len(own))]
    text = "time,c,s,slow time,temp (degC)\n" + "".join(
        f"{line},{cell}\n" for line, cell in zip(lines, cells, strict=True)
    )
    r = whole(written(tmp_path, text), auxiliary_time="slow time")
    np.testing.assert_allclose(r.auxiliary_time_s, [0, 0.05, 0.1, 0.15], atol=1e-12)
    assert r.temperature_degc.tolist() == [20.0, 21.0, 22.0, 23.0]
    assert len(r.c) == len(T)
    timeless = text.replace("0.1,22", f"{blank},22")
    with pytest.raises(HrgError, match="row 3 of its slow columns holds a value but no time"):
        whole(written(tmp_path, timeless), auxiliary_time="slow time")


@pytest.mark.parametrize(
    ("unit", "factor"),
    [("rad/s", 1), ("deg/s", np.pi / 180), ("deg/h", np.pi / 180 / 3600), ("rpm", np.pi / 30)],
)
def test_rate_units(tmp_path, unit, factor):
    path = written(tmp_path, "time,c,s,rate\n" + rows([T, C, S, np.full_like(T, 7.0)]))
    np.testing.assert_allclose(whole(path, rate_units=unit).rate_rad_s, 7 * factor)


def test_constants_scales_and_names(tmp_path):
    r = whole(
        written(tmp_path, "p,q\n" + rows([C, S])),
        sample_rate_hz=500.0,
        constant_rate_rad_s=0.1,
        constant_temperature_degc=21.0,
        c_scale_factor=2.0,
        units="V",
        gyro_id="G7",
        mode="forced",
    )
    assert r.auxiliary_time_s.tolist() == [0.0, 399 / 500]
    assert r.rate_rad_s.tolist() == [0.1, 0.1] and r.temperature_degc.tolist() == [21.0, 21.0]
    np.testing.assert_allclose(r.physical()[0], 2 * C, **CLOSE)
    assert (r.gyro_id, r.mode, r.c_units) == ("G7", "forced", "V")


def test_not_finite_cells_are_kept_and_counted(tmp_path):
    c = C.copy()
    c[[5, 6]] = np.nan
    c[9] = np.inf
    text = "time,c,s\n" + "".join(
        f"{t!r},{'' if i == 5 else repr(v)},{s!r}\n"
        for i, (t, v, s) in enumerate(zip(T.tolist(), c.tolist(), S.tolist()))
    )
    r = whole(written(tmp_path, text))
    np.testing.assert_array_equal(r.c, c)
    assert r.status == "suspect" and "3 of 400" in r.status_reasons[0]


SCOPES = {
    "preamble of keys": "Model,XYZ\nSample Interval,5.0e-4\nRecord Length,400\n\nTIME,CH1,CH2\n",
    "units row": "x-axis,1,2\nsecond,Volt,Volt\n",
    "lock-in": "% lock-in amplifier\n% Sampling rate: 2000 Hz\n%time;x;y\n",
}


@pytest.mark.parametrize("name", SCOPES)
def test_oscilloscopes_and_lock_ins(tmp_path, name):
    separator = ";" if "lock" in name else ","
    r = whole(written(tmp_path, SCOPES[name] + rows([T - 0.05, C, S], separator)))
    assert r.sample_rate_hz == RATE
    np.testing.assert_allclose(r.s, S, **CLOSE)


def test_scope_with_sequence_numbers_and_increment(tmp_path):
    text = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1e-1,5e-4,\n" + "".join(
        f"{i},{c!r},{s!r},,,\n" for i, (c, s) in enumerate(zip(C.tolist(), S.tolist()))
    )
    r = whole(written(tmp_path, text))
    assert r.sample_rate_hz == RATE
    np.testing.assert_allclose(r.c, C, **CLOSE)


def test_sampling_interval_from_the_preamble(tmp_path):
    r = whole(written(tmp_path, "Sample Interval,500,us\nCH1,CH2\nV,V\n" + rows([C, S])))
    assert r.sample_rate_hz == RATE and r.c_units == "V"


def test_blocks_join_to_the_same_recording(tmp_path, monkeypatch):
    t = np.cumsum(np.random.default_rng(1).uniform(1e-3, 2e-3, 400))
    path = written(tmp_path, "time,c,s,temp\n" + rows([t, C, S, 20 + t]))
    one = import_log(path, auxiliary_rows=70)
    assert isinstance(one, Recording)
    monkeypatch.setattr(text_module, "BLOCK_BYTES", 999)
    many = list(import_log(path, auxiliary_rows=70))
    assert len(many) > 10
    joined = collect(iter(many))
    for name in ("c", "s", "time_s", "auxiliary_time_s", "temperature_degc"):
        np.testing.assert_allclose(getattr(joined, name), getattr(one, name), rtol=1e-15)


BROKEN = {
    "empty": ("", "is empty"),
    "blank lines": ("\n\n\n", "is empty"),
    "header only": ("time,c,s\n", "no line of numbers"),
    "prose": ("Dear all,\nplease find the log\n", "no line of numbers"),
    "one column": ("c\n1.0\n2.0\n3.5\n", 's = "none"'),
    "ragged row": (
        "time,c,s\n" + rows([T, C, S]).replace("\n", "\n1,2\n", 1),
        "line 3 has 2 cells",
    ),
    "broken to its end": (
        "time,c,s\n" + rows([T, C, S]) + "disk full; #\n" * 500,
        "its last row of numbers is line 401, and 500 lines of words follow",
    ),
    "last line broken": ("time,c,s\n" + rows([T, C, S]) + "0.3,0.1", "line 402 has 2 cells"),
    "text in numbers": (
        "time,c,s\n" + rows([T, C, S]) + "0.3,overload,1\n",
        "line 402: 'overload' in column 2 (c)",
    ),
    "repeated time": ("time,c,s\n" + rows([np.floor(T * 500) / 500, C, S]), "give sample_rate_hz"),
    "time goes back": (
        "time,c,s\n" + rows([np.r_[T[:50], T[:350]], C, S]),
        "line 52: the time goes back",
    ),
    "time missing": ("time,c,s\n" + rows([T, C, S]) + ",1,1\n", "time is not a number"),
    "one sample": ("time,c,s\n0,1,2\n", "one sample only"),
    "too many channels": ("time,p,q,r\n" + rows([T, C, S, S]), "name them with c and s"),
    "two units": ("time [s],c [V],s [mV]\n" + rows([T, C, S]), "'V' and channel S in 'mV'"),
    "ticks": ("time [ticks],c,s\n" + rows([T, C, S]), "clock_hz"),
    "no time": ("c,s\n" + rows([C, S]), "give time or sample_rate_hz"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_log_is_one_sentence(tmp_path, name):
    text, expected = BROKEN[name]
    with pytest.raises(HrgError) as error:
        whole(written(tmp_path, text))
    assert (
        expected in str(error.value)
        and "log.csv" in str(error.value)
        and "\n" not in str(error.value)
    )


def test_wrong_settings_are_sentences(tmp_path):
    path = written(tmp_path, "time,c,s\n" + rows([T, C, S]))
    for wrong, expected in (
        ({"c": "nothing"}, "no column"),
        ({"c": 9}, "has 3 columns"),
        ({"c": 2, "s": 2}, "both column"),
        ({"time_units": "fortnight"}, "time_units"),
        ({"c_scale_factor": 0.0}, "c_scale_factor"),
        ({"readout": "carrier"}, "carrier_hz"),
        ({"format": "nonsense"}, "expected one of"),
    ):
        with pytest.raises(HrgError, match=expected):
            whole(path, **wrong)


def test_rounded_clock_with_a_given_rate(tmp_path):
    path = written(tmp_path, "time,c,s\n" + rows([np.floor(T * 500) / 500, C, S]))
    r = whole(path, sample_rate_hz=RATE)
    assert r.sample_rate_hz == RATE and r.status == "valid"
    assert "missing" in whole(path, sample_rate_hz=2 * RATE).status_reasons[0]


def test_one_channel_by_request(tmp_path):
    r = whole(written(tmp_path, "time,c\n" + rows([T, C])), s="none")
    assert not r.s.any() and r.status == "suspect"


def test_table_keeps_titles_and_units(tmp_path):
    table = read_table(written(tmp_path, "rig_rate_rad_s,counts,gyro_temp_C\n" + rows([C, S, T])))
    assert list(table.columns) == ["rig_rate", "counts", "gyro_temp"]
    assert table.attrs["units"] == {"rig_rate": "rad/s", "counts": "", "gyro_temp": "degC"}


def mutated(rng: np.random.Generator, data: bytes) -> bytes:
    """Bytes flipped, cut out, doubled, inserted or cut off."""
    data = bytearray(data)
    for _ in range(rng.integers(1, 6)):
        place, size = int(rng.integers(0, max(1, len(data)))), int(rng.integers(1, 30))
        kind = rng.integers(0, 5)
        if kind == 0:
            data[place : place + 1] = bytes([rng.integers(0, 256)])
        elif kind == 1:
            del data[place : place + size]
        elif kind == 2:
            data[place:place] = data[place : place + size]
        elif kind == 3:
            data[place:place] = bytes(rng.integers(0, 256, size).astype("u1"))
        else:
            del data[len(data) - size :]
    return bytes(data)


def fuzz(tmp_path: Path, count: int, seed: int) -> int:
    rng = np.random.default_rng(seed)
    whole_texts = [
        "time,c,s\n" + rows([T[:30], C[:30], S[:30]]),
        rows([T[:30], C[:30], S[:30]], ";", ","),
        SCOPES["preamble of keys"] + rows([T[:30], C[:30], S[:30]]),
    ]
    clocks = "".join(
        f"{c!r},{s!r},11:50:{i:02d}.5\n"
        for i, (c, s) in enumerate(zip(C[:50].tolist(), S.tolist()))
    )
    refused = 0
    for _ in range(count):
        path = written(tmp_path, mutated(rng, rng.choice([*whole_texts, clocks]).encode()))
        try:
            r = whole(path)
            assert len(r.c) == len(r.s) and (r.sample_rate_hz is None) == (r.time_s is not None)
        except HrgError as error:
            refused += 1
            assert "\n" not in str(error)
    return refused


COMMAS = rows([T, C, S], decimal=",", form="{:.6f}")


@pytest.mark.parametrize("titles", ["time,C,S\n", "# time [s],C [V],S [V]\n", ""])
@pytest.mark.parametrize("given", [{}, {"separator": ","}, {"separator": ",", "decimal": ","}])
def test_commas_of_two_meanings_are_no_columns(tmp_path, titles, given):
    """0,000500,0,921863 is four integers, or two numbers."""
    with pytest.raises(
        HrgError, match=r"commas both separate cells and mark decimals.*6 cells, or 3"
    ):
        whole(written(tmp_path, titles + COMMAS), **given)


def test_whole_numbers_between_commas_are_columns(tmp_path):
    counts = [np.arange(400), *(np.round(1e4 * x) for x in (C, S, C * S))]
    text = "".join(",".join(f"{int(v)}" for v in row) + "\n" for row in zip(*counts))
    for titles in ("", "count,C,S,D\n"):
        r = whole(written(tmp_path, titles + text), sample_rate_hz=RATE, c="2", s="3")
        np.testing.assert_array_equal(r.c, np.round(1e4 * C))
    padded = "".join(f"{i},{100 + i},{3 * i},{500 + i}\n" for i in range(400))
    assert len(whole(written(tmp_path, padded), sample_rate_hz=RATE, c="2", s="4").c) == 400
    quoted = "".join(
        ",".join(f'"{v:.6f}"'.replace(".", ",") for v in row) + "\n" for row in zip(T, C, S)
    )
    np.testing.assert_allclose(whole(written(tmp_path, "time,C,S\n" + quoted)).c, C, atol=1e-6)


def test_mutated_logs_never_give_anything_but_a_sentence(tmp_path):
    assert fuzz(tmp_path, 150, 0) > 20


@pytest.mark.slow
def test_many_mutated_logs(tmp_path):
    assert fuzz(tmp_path, 5000, 1) > 500


def test_the_pendulum(tmp_path):
    folder = os.environ.get("HRG_MEASURED_DATA")
    if not folder:
        pytest.skip("HRG_MEASURED_DATA does not name the folder of measured data")
    r = whole(Path(folder) / "foucault_yverdon" / "oscillation4.csv", mode_number=1)
    steps = np.diff(r.time_s)
    assert len(r) == 37_037 and r.mode_number == 1
    assert 3.0 * 3600 < r.time_s[-1] < 3.1 * 3600
    assert sorted(np.round(steps[steps > 10], 1)) == [16.7, 76.5]


@pytest.mark.parametrize(("cut", "taken"), [(0, 400), (1, 400), (4, 399), (9, 399)])
def test_a_log_cut_within_its_last_number_loses_that_row_and_says_so(tmp_path, cut, taken):
    """-0.31609644 became -0.3, a sample 320 σ off, in silence."""
    t = np.arange(400) / 8000
    c, s = np.cos(2 * np.pi * 1000 * t + 0.3), 0.5 * np.sin(2 * np.pi * 1000 * t + 0.3)
    rows = "".join(f"{a:.6f},{b:.8f},{d:.8f}\n" for a, b, d in zip(t, c, s))
    log = "t [s],c,s\n" + rows[: len(rows) - cut]
    record = whole(written(tmp_path, log))
    assert len(record) == taken
    said = [why for why in record.status_reasons if "ends within its last number" in why]
    assert len(said) == (taken < 400)
