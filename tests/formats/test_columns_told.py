"""An import tells every column: as what and in which unit it was taken, or why it was left; a unit
that is not of the quantity is refused."""

import json

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.formats import import_envelope, import_log
from hrg_cli.formats.unit_spellings import split_name
from hrg_cli.records import collect

N, RATE = 400, 8000.0
RNG = np.random.default_rng(11)
T = np.arange(N) / RATE
C = np.cos(2 * np.pi * 513 * T) + 0.01 * RNG.standard_normal(N)
S = 0.4 * np.cos(2 * np.pi * 513 * T + 0.2) + 0.01 * RNG.standard_normal(N)


def log(folder, slow, separator=",", decimal="."):
    """A log of both channels and slow columns {title: value}."""
    titles = ["time (s)", "c (V)", "s (V)", *slow]
    rows = np.column_stack([T, C, S, *(np.full(N, value) for value in slow.values())])
    text = [separator.join(f"{v:.6f}".replace(".", decimal) for v in row) for row in rows]
    path = folder / "log.csv"
    path.write_text("\n".join([separator.join(titles), *text]) + "\n", encoding="utf-8")
    return path


def told(recording):
    return json.loads(recording.details)


RPM = 2 * np.pi / 60


@pytest.mark.parametrize(
    "title",
    [
        "rate_rpm",
        "rate (rpm)",
        "rate [rev/min]",
        "rate (U/min)",
        "rate (1/min)",
        "rate [rev / min]",
        "rate_rev_per_min",
        "table rate (RPM)",
        "omega_rpm",
        "rate (rev per min)",
        "rate in rpm",
    ],
)
def test_turns_a_minute_become_rad_s(tmp_path, title):
    made = collect(import_log(log(tmp_path, {title: 3.0})))
    np.testing.assert_allclose(made.rate_rad_s, 3 * RPM, rtol=1e-12)
    assert told(made)["columns"]["rate"]["taken_in"] == "rad/s" and not told(made)["columns_left"]


@pytest.mark.parametrize(
    "title, value",
    [(t, 72.5) for t in ("T (°F)", "temp_degF", "T_degF", "temperature [Fahrenheit]", "T (deg F)")]
    + [(t, 72.5) for t in ("oven (℉)", "temperature (ºF)", "Temp [F]")]
    + [(t, 295.65) for t in ("T (K)", "temperature_k", "Pt100 [Kelvin]", "temperature (K)")]
    + [(t, 22.5) for t in ("T [°C]", "T_degC", "temp_c", "temperature (℃)", "Pt100 (deg C)")],
)
def test_temperatures_become_degrees_celsius(tmp_path, title, value):
    for separator, decimal in ((",", "."), (";", ",")):
        made = collect(import_log(log(tmp_path, {title: value}, separator, decimal)))
        np.testing.assert_allclose(made.temperature_degc, 22.5, atol=1e-9)
        assert not told(made)["columns_left"]


def test_a_temperature_of_no_unit_that_no_gyro_has_in_degrees_celsius_is_told(tmp_path):
    """298 was taken for °C in silence: a resonator's values would stand at that temperature."""
    path = log(tmp_path, {"temperature": 298.15})
    made = collect(import_log(path))
    assert made.status == "suspect" and 'give temperature_units = "K"' in made.status_reasons[0]
    right = collect(import_log(path, temperature_units="K"))
    assert right.status == "valid" and abs(right.temperature_degc.mean() - 25) < 1e-9
    warm = collect(import_log(log(tmp_path, {"temperature": 85.0})))
    assert warm.status == "valid"
    # a unit that is named is the lab's word
    assert collect(import_log(path, temperature_units="degC")).status == "valid"


@pytest.mark.parametrize(
    "title", ["rate (Hz)", "rate_hz", "rate [mV]", "rate (V)", "rate (furlong)"]
)
def test_a_unit_that_is_no_rate_is_a_sentence(tmp_path, title):
    path = log(tmp_path, {title: 0.5})
    with pytest.raises(HrgError, match=r"log\.csv: its column 4 \(rate\) is in .* give rate_units"):
        import_log(path)
    made = collect(import_log(path, rate_units="rps"))
    np.testing.assert_allclose(made.rate_rad_s, np.pi, rtol=1e-12)
    left = told(collect(import_log(path, rate="none")))["columns_left"]
    assert [column["column"] for column in left] == [4]


def test_a_unit_that_is_no_temperature_or_time_is_a_sentence(tmp_path):
    with pytest.raises(HrgError, match=r"column 4 \(temperature\) is in 'mV'.*degC, K, degF"):
        import_log(log(tmp_path, {"temperature (mV)": 0.5}))
    path = log(tmp_path, {})
    path.write_text(path.read_text().replace("time (s)", "time (fortnights)"))
    with pytest.raises(HrgError, match=r"column 1 \(time\) is in 'fortnights'.*give time_units"):
        import_log(path)


def test_every_column_is_taken_or_left(tmp_path, hrg):
    slow = {"humidity (%)": 40.0, "gyro rate (deg/s)": 1.0, "oven (°C)": 60.0, "case (°C)": 30.0}
    path = log(tmp_path, {**slow, "rate": 0.1})
    made = hrg("import", path, "-o", tmp_path / "r.h5", "--json").json
    taken = {column["column"] for column in made["columns"].values()}
    left = {column["column"]: column for column in made["columns_left"]}
    assert taken == {1, 2, 3, 8} and set(left) == {4, 5, 6, 7}
    assert "another column is the rate" in left[5]["why"]
    assert "--temperature oven takes this one" in left[6]["why"], "two: neither is chosen"
    shown = hrg("import", path, "-o", tmp_path / "r.h5", "--force").out
    assert "column 4 (humidity)" in shown and "rad/s (the log names none)" in shown
    chosen = hrg(
        "import", path, "-o", tmp_path / "r.h5", "--force", "--temperature", "oven", "--json"
    )
    assert chosen.json["columns"]["temperature"]["column"] == 6


def test_a_temperature_titled_t_is_no_time(tmp_path):
    path = log(tmp_path, {"T (°C)": 21.0})
    path.write_text(path.read_text().replace("time (s)", "samples (s)"))
    columns = told(collect(import_log(path)))["columns"]
    assert columns["time"]["column"] == 1 and columns["temperature"]["column"] == 4


def test_a_text_column_is_named(tmp_path):
    path = log(tmp_path, {"remark": 1.0})
    path.write_text(path.read_text().replace("1.000000\n", "ok\n"))
    left = told(collect(import_log(path)))["columns_left"]
    assert left == [{"column": 4, "name": "remark", "units": "", "why": "holds text"}]


def test_demodulated_logs_tell_it_too(tmp_path):
    rows = np.column_stack([np.arange(N) / 50, 1e-3 * RNG.standard_normal((N, 2)) + 1])
    rows = np.column_stack([rows, np.full(N, 80.6), np.full(N, 3.0), np.full(N, 40.0)])
    path = tmp_path / "lock-in.csv"
    header = "time [s],X [V],Y [V],T (°F),rate_rpm,humidity"
    np.savetxt(path, rows, delimiter=",", header=header, comments="", encoding="utf-8")
    named = {"c_in_phase": 2, "c_quadrature": 3, "reference_frequency_hz": 5000.0}
    made = collect(import_envelope(path, **named))
    np.testing.assert_allclose(made.temperature_degc, 27.0, rtol=1e-9)
    np.testing.assert_allclose(made.rate_rad_s, 3 * RPM, rtol=1e-9)
    assert [c["name"] for c in told(made)["columns_left"]] == ["humidity"]


@pytest.mark.parametrize(
    "title, expected",
    [
        ("rate_rpm", ("rate", "rpm")),
        ("rate_deg_per_s", ("rate", "deg/s")),
        ("rate_rad_s", ("rate", "rad/s")),
        ("T_degF", ("T", "degF")),
        ("T/K", ("T", "K")),
        ("ϑ/°C", ("ϑ", "°C")),
        ("t/s", ("t", "s")),
        ("Ω/(rad/s)", ("Ω", "rad/s")),
        ("CH1/V", ("CH1", "V")),
        ("deg/s", ("deg/s", "")),
        ("warps", ("warps", "")),
        ("loop_k", ("loop_k", "")),
        ("drive_main", ("drive_main", "")),
    ],
)
def test_units_at_the_end_of_a_title(title, expected):
    assert split_name(title) == expected


def counted(folder, titles, first, channels=(C, S)):
    path = folder / "counted.csv"
    rows = "\n".join(f"{n},{c:.6f},{s:.6f}" for n, c, s in zip(first, *channels, strict=True))
    path.write_text(f"{titles}\n{rows}\n", encoding="utf-8")
    return path


def test_a_column_that_counts_rows_is_no_time_beside_a_rate_that_was_given(tmp_path):
    path = counted(tmp_path, "sample,adc_c,adc_s", range(N))
    made = collect(import_log(path, sample_rate_hz=RATE))
    assert made.sample_rate_hz == RATE and made.status == "valid"
    np.testing.assert_allclose(made.physical(0, N)[0], C, atol=1e-6)


def test_ticks_of_a_clock_that_was_told_are_times(tmp_path):
    path = counted(tmp_path, "ticks,ch1,ch2", np.arange(N) * 125)
    made = collect(import_log(path, clock_hz=1e6))
    assert made.sample_rate_hz == pytest.approx(RATE) and made.status == "valid"
    with pytest.raises(HrgError, match="give time or sample_rate_hz"):
        import_log(path)


@pytest.mark.parametrize("title", ["rate_deg/s", "table_rate_deg/s", "rate_°/s", "rate_mdeg/s"])
def test_a_unit_with_a_stroke_may_follow_an_underscore(tmp_path, title):
    made = collect(import_log(log(tmp_path, {title: 3.0})))
    unit = np.pi / 180 * (1e-3 if "mdeg" in title else 1)
    np.testing.assert_allclose(made.rate_rad_s, 3 * unit, rtol=1e-6)


@pytest.mark.parametrize(
    ("title", "value", "rate"),
    [
        ("Drehrate (°/s)", 90.0, np.pi / 2),
        ("Drehrate (deg/s)", 90.0, np.pi / 2),
        ("Drehteller [mrad/s]", 500.0, 0.5),
        ("wz (dps)", 90.0, np.pi / 2),
        ("Tisch [°/h]", 3600.0, np.pi / 180),
        ("Vitesse angulaire (rad/s)", 0.5, 0.5),
    ],
)
def test_the_only_column_of_a_rate_needs_no_title_that_is_known(tmp_path, title, value, rate):
    """A German log lost its rate, with a note alone, and was valid."""
    made = collect(import_log(log(tmp_path, {title: value})))
    np.testing.assert_allclose(made.rate_rad_s, rate, rtol=1e-9)
    assert made.status == "valid" and not told(made)["columns_left"]


@pytest.mark.parametrize("role", ["rate", "temperature"])
def test_several_columns_that_may_be_it_are_a_doubt_that_names_them(tmp_path, role):
    unit = {"rate": "°/s", "temperature": "°C"}[role]
    path = log(tmp_path, {f"Soll ({unit})": 20.0, f"Ist ({unit})": 21.0})
    made = collect(import_log(path))
    assert made.status == "suspect"
    (said,) = made.status_reasons
    assert said == (
        f"no column is taken as the {role}, for 2 may be it ('Soll', 'Ist'); choose with"
        f" --{role} 'Soll', or --{role} none"
    )
    for choice in ("Ist", "none"):
        assert collect(import_log(path, **{role: choice})).status == "valid"


def test_a_title_that_is_known_goes_before_other_columns_of_its_unit(tmp_path):
    made = collect(import_log(log(tmp_path, {"Soll (°/s)": 20.0, "Drehrate (°/s)": 90.0})))
    np.testing.assert_allclose(made.rate_rad_s, np.pi / 2, rtol=1e-9)
    assert made.status == "valid"


@pytest.mark.parametrize(
    ("unit", "rate", "said"),
    [("rad/s", 2.0, 1), ("dps", np.radians(2.0), 0), (None, np.radians(2.0), 0)],
)
def test_a_unit_told_against_a_title_is_said(tmp_path, unit, rate, said):
    found = collect(import_log(log(tmp_path, {"table rate (deg/s)": 2.0}), rate_units=unit))
    assert found.rate_rad_s[0] == pytest.approx(rate) and found.status == "valid"
    assert sum("'deg/s' by its own title" in reason for reason in found.status_reasons) == said
