"""Calibration from tables of dwells: simulated gyros, and the measured fibre-optic and cold MEMS
gyros."""

import os
from pathlib import Path

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.stages.rate_table import find_rate, rate_table, summarise


def dwells(seed, rows=600, noise=2e-5):
    draw = np.random.default_rng(seed)
    rate, degc = draw.uniform(-2, 2, rows), np.linspace(20, 50, rows)
    gain, bias = 1e5 * (1 + 4e-4 * (degc - 35)), -1e3 * (1e-4 + 1e-5 * (degc - 35)) * 1e5 / 1e3
    output = gain * rate - bias + 1e5 * (-3e-4 * rate**3 + noise * draw.normal(size=rows))
    return {"rate": rate, "out": output, "degc": degc}, gain / 1e5, bias / 1e5


def test_gain_bias_and_cubic_are_recovered_with_honest_errors():
    square, cubes = [], []
    for seed in range(20):
        table, _, _ = dwells(seed)
        record = rate_table(
            table, output="out", rate="rate", temperature="degc", nominal_scale=1e5, largest_power=3
        )
        truth_gain = 1 + 4e-4 * (record.node - 35)
        truth_drift = -(1e-4 + 1e-5 * (record.node - 35))
        square.append(
            ((record.scale_factor[:, 0] - truth_gain) / record.scale_factor_std[:, 0]) ** 2
        )
        square.append(
            ((record.drift_rad_s[:, 0] - truth_drift) / record.drift_rad_s_std[:, 0]) ** 2
        )
        cubes.append(summarise(record)["power_coefficients"][1])
    assert 0.75 < np.mean(square) < 1.4
    assert np.mean(cubes) == pytest.approx(-3e-4, rel=0.01)


def test_a_slow_table_bends_as_a_fast_one_does():
    """Rates a hundred thousand times as small (5 °/h): the same curve in other units, the powers of
    the rate and the errors with it."""
    table, _, _ = dwells(3)
    slow = {**table, "rate": table["rate"] * 1e-5}
    names = {"output": "out", "rate": "rate", "temperature": "degc", "largest_power": 5}
    fast = rate_table(table, nominal_scale=1e5, **names)
    found = rate_table(slow, nominal_scale=1e10, **names)
    assert found.scale_factor == pytest.approx(fast.scale_factor)
    assert found.scale_factor_std == pytest.approx(fast.scale_factor_std)
    assert found.drift_rad_s == pytest.approx(fast.drift_rad_s * 1e-5)
    powers, coefficients = summarise(fast)["powers"], summarise(fast)["power_coefficients"]
    assert powers == summarise(found)["powers"] and 3 in powers
    in_slow = [c * 1e5 ** (p - 1) for p, c in zip(powers, coefficients, strict=True)]
    assert summarise(found)["power_coefficients"] == pytest.approx(in_slow)


def test_rates_come_back_through_the_nonlinearity():
    table, _, _ = dwells(1)
    record = rate_table(table, output="out", rate="rate", temperature="degc")
    error = find_rate(record, table["out"], table["degc"]) - table["rate"]
    assert np.sqrt(np.mean(error**2)) < 1.2 * 2e-5
    assert summarise(record)["scale_factor_coefficient_ppm_per_degc"] == pytest.approx(
        400, rel=0.02
    )
    with pytest.raises(HrgError, match="leave the table"):
        find_rate(record, np.zeros(1), 90.0)


def test_spikes_are_rejected_and_said():
    table, _, _ = dwells(2)
    table["out"][[5, 100, 400]] += 3e3
    record = rate_table(table, output="out", rate="rate", temperature="degc")
    assert (
        summarise(record)["rejected"] == 3
        and "3 of 600 rows are spikes" in record.status_reasons[0]
    )


def test_unusable_tables():
    table, _, _ = dwells(0)
    with pytest.raises(HrgError, match="no column 'speed'; it has rate, out, degc"):
        rate_table(table, output="out", rate="speed")
    with pytest.raises(HrgError, match="one rate only"):
        rate_table(table | {"rate": np.ones(600)}, output="out", rate="rate")
    with pytest.raises(HrgError, match="finite rows"):
        rate_table(table | {"out": np.full(600, np.nan)}, output="out", rate="rate")


def measured(*parts):
    folder = os.environ.get("HRG_MEASURED_DATA")
    if not folder or not (Path(folder) / Path(*parts)).exists():
        pytest.skip("the measured data are not here (HRG_MEASURED_DATA)")
    import pandas as pd

    return pd.read_csv(Path(folder) / Path(*parts))


def test_fibre_optic_gyro():
    """A cubic in rate with rate × T leaves 4.3e-4 rad/s on the rows it was fitted to; we ask less
    of rows not used."""
    table = measured("fog_rate_temperature", "fog_rate_temp_773pts.csv")
    record = rate_table(
        table,
        output="gyro_raw_counts",
        rate="rig_rate_rad_s",
        temperature="gyro_temp_C",
        gyro_id="fog",
    )
    figures = summarise(record)["residual_rms_rad_s"]
    assert figures["held_out"] < 4.2e-4 and figures["after"] < 3.2e-4 < figures["before"]
    assert -500 < summarise(record)["scale_factor_coefficient_ppm_per_degc"] < -400
    assert (np.diff(record.scale_factor[:, 0]) < 0).all()
    assert 1e4 < summarise(record)["nonlinearity_ppm"] < 5e4


def test_cold_mems_gyro():
    table = measured("mems_gyro_cold", "TVCtest3_7_20.csv").rename(columns=str.strip)
    word = table["temp"].to_numpy().astype(np.uint16).view(np.int16)
    columns = {name: table[name].to_numpy() for name in table} | {"word": word}
    records = {
        axis: rate_table(
            columns,
            output=f"gyro{axis} rad/s",
            temperature="word",
            temperature_scale=1 / 256,
            temperature_offset_degc=25.0,
        )
        for axis in "xyz"
    }
    assert any("spikes" in reason for reason in records["x"].status_reasons)
    for axis, change in (("x", 0.0085), ("y", 0.004)):
        assert abs(np.ptp(records[axis].drift_rad_s)) == pytest.approx(change, rel=0.15)
        assert (
            summarise(records[axis])["residual_rms_rad_s"]["held_out"]
            < 0.5 * summarise(records[axis])["residual_rms_rad_s"]["before"]
        )
    assert all("bias only" in record.status_reasons[-1] for record in records.values())


def counted(step=150.0, rows=10):
    """Ten dwells of a quartz-like oscillator, no repetition, read by a counter with coarse steps;
    no spike."""
    degc = np.linspace(20, 65, rows)
    truth = 3.7286e6 - 110 * (degc - 20) - 0.1 * (degc - 20) ** 2
    return {"hz": np.round(truth / step) * step, "degc": degc}, truth


def test_smooth_dwells_without_repetition_have_no_spikes_and_an_honest_spread():
    """The nodes took every row: residuals of nothing, "6 of 10 rows are spikes", D = 0.0 ± 0.0 at
    six temperatures."""
    table, truth = counted()
    record = rate_table(table, output="hz", temperature="degc")
    assert summarise(record)["rejected"] == 0 and not any(
        "spike" in reason for reason in record.status_reasons
    )
    assert len(record.node) <= 7 and (np.abs(record.drift_rad_s) > 3e6).all()
    found = np.interp(table["degc"], record.node, -record.drift_rad_s[:, 0])
    assert np.sqrt(np.mean((found - truth) ** 2)) < 150
    assert (record.drift_rad_s_std > 10).all() and (record.drift_rad_s_std < 200).all()


@pytest.mark.parametrize("seed", range(3))
def test_errors_of_few_dwells_are_as_stated(seed):
    square = []
    for k in range(30):
        draw = np.random.default_rng(100 * seed + k)
        degc = np.linspace(20, 65, 12)
        table = {"out": 1.0 + 1e-3 * (degc - 40) + 1e-4 * draw.normal(size=12), "degc": degc}
        record = rate_table(table, output="out", temperature="degc")
        square.append(
            np.mean(
                (
                    (-record.drift_rad_s[:, 0] - 1.0 - 1e-3 * (record.node - 40))
                    / record.drift_rad_s_std[:, 0]
                )
                ** 2
            )
        )
    assert 0.5 < np.sqrt(np.mean(square)) < 1.4


def test_rows_on_the_curve_to_the_last_digit_have_no_standard_deviation():
    degc = np.linspace(20, 65, 12)
    record = rate_table({"out": 1.0 + 0.25 * degc, "degc": degc}, output="out", temperature="degc")
    assert record.status == "suspect" and any(
        "cannot be known" in reason for reason in record.status_reasons
    )
    assert np.isnan(record.drift_rad_s_std).all()
    constant = rate_table({"out": np.ones(12), "degc": degc}, output="out", temperature="degc")
    assert constant.status == "suspect" and not (constant.drift_rad_s_std == 0).any()


def test_a_true_spike_among_a_few_dwells_and_a_curve_that_is_wrong():
    draw = np.random.default_rng(0)
    degc = np.linspace(20, 65, 40)
    out = 1.0 + 1e-3 * (degc - 40) + 1e-5 * draw.normal(size=40)
    out[17] += 5e-3
    record = rate_table(
        {"out": out, "degc": degc}, output="out", temperature="degc", node_spacing_degc=20
    )
    assert summarise(record)["rejected"] == 1
    bent = 1.0 + 1e-2 * np.sin((degc - 20) / 3) ** 9
    wrong = rate_table(
        {"out": bent + 1e-6 * draw.normal(size=40), "degc": degc},
        output="out",
        temperature="degc",
        node_spacing_degc=40,
    )
    assert summarise(wrong)["rejected"] <= 8


def test_three_dwell_temperatures_carry_three_nodes():
    """Nodes between the dwells would be nobody's: lstsq put nothing there."""
    draw = np.random.default_rng(1)
    degc = np.repeat([0.0, 20.0, 40.0], 30)
    record = rate_table(
        {"out": 2.0 + 1e-2 * degc + 1e-4 * draw.normal(size=90), "degc": degc},
        output="out",
        temperature="degc",
    )
    assert len(record.node) <= 3 and -record.drift_rad_s[:, 0] == pytest.approx(
        2.0 + 1e-2 * record.node, abs=1e-3
    )


def test_quartz_has_no_spike():
    table = measured("quartz_temperature", "B100.csv")
    record = rate_table(table, output="frequency_hz", temperature="temperature_c")
    assert summarise(record)["rejected"] == 0 and (np.abs(record.drift_rad_s) > 3e6).all()
    assert (record.drift_rad_s_std > 20).all() and (record.drift_rad_s_std < 1000).all()


def small_table(seed, temperatures, repeats, turning, spike, row, bend=2e-7):
    """Few dwells of 1e-6 noise on a curve, one of them shifted by so many times the noise."""
    draw = np.random.default_rng(seed)
    degc = np.repeat(np.linspace(0, 60, temperatures), repeats)
    truth = 1e-3 + 1e-5 * (degc - 30) + bend * (degc - 20) ** 2
    out = truth + 1e-6 * draw.normal(size=len(degc))
    out[row] += spike * 1e-6
    table = {"degc": degc, "out": out}
    if turning:
        rate = np.resize([-1.0, 0.0, 1.0], len(degc))
        table |= {"out": out + 0.5 * rate, "rate": rate}
    names = {"output": "out", "temperature": "degc"}
    return table, names | ({"rate": "rate"} if turning else {})


@pytest.mark.parametrize(
    "shape, spike",
    [((10, 1, False), 50), ((10, 1, True), 500), ((5, 3, True), 50), ((20, 1, False), 500)],
)
def test_one_spike_among_few_dwells_is_named_with_its_row(shape, spike):
    """The nodes were chosen with the spike inside: two of them, σ 12 to 140 times the noise, and no
    word of it."""
    for seed in range(4):
        table, names = small_table(seed, *shape, spike, 5)
        record = rate_table(table, **names)
        assert summarise(record)["rejected_rows"] == [6]
        assert "row 6 (" in record.status_reasons[0]
        assert np.median(record.drift_rad_s_std) < 5e-6


@pytest.mark.parametrize("shape", [(10, 1, False), (10, 1, True), (20, 1, False)])
@pytest.mark.parametrize("row", [0, -1])
def test_an_end_that_nothing_confirms_is_suspect_and_no_part_of_the_table(shape, row):
    for seed in range(4):
        table, names = small_table(seed, *shape, 500, row, bend=0)
        record = rate_table(table, **names)
        assert record.status == "suspect" and "cannot be known" in record.status_reasons[-1]
        assert summarise(record)["rejected_rows"] == [1 if row == 0 else shape[0]]
        assert record.node_min > 0 if row == 0 else record.node_max < 60
        assert (record.drift_rad_s_std < 1e-5).all()


def test_smooth_curves_of_few_dwells_have_no_spikes():
    curves = (np.square, np.exp, lambda u: np.sin(3 * u), lambda u: np.tanh(3 * u - 1.5))
    for seed in range(40):
        draw = np.random.default_rng(seed)
        degc = np.repeat(np.linspace(0, 60, draw.integers(10, 41)), draw.choice([1, 2]))
        out = curves[seed % 4](degc / 60) + 10 ** draw.uniform(-4, -1) * draw.normal(size=len(degc))
        record = rate_table({"out": out, "T": degc}, output="out", temperature="T")
        assert record.status == "valid" and summarise(record)["rejected"] == 0
