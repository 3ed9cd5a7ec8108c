"""One run that oscillates beside the others: its clock where that mends all else of it too, else the
run is named with what would make it so."""

import numpy as np
import pytest
from diagnosis_programme import programme
from wrong_runs import estimated, recordings

from hrg_cli.stages.diagnose import diagnose, summarise

FOLLOWS = {"thermal_frequency": {"relative_1_k": 3e-6, "reference_temperature_degc": 22.0}}


def diagnosed(records):
    return summarise(diagnose(estimated(records)))


@pytest.mark.parametrize("wrong", [2e-4, -4e-4])
def test_a_clock_too_little_off_for_a_gross_misfit_is_named(wrong):
    """A few parts in 10⁴ leave χ² 1.5 to 3: "turning that changes with rate", or a force of 29 σ
    whose numbers were none."""
    records = recordings(programme(71, runs=4, noise=3e-5), 71)
    records[3] = records[3].replace(sample_rate_hz=records[3].sample_rate_hz * (1 + wrong))
    out = diagnosed(records)
    (one,) = out["suspect_runs"]
    assert (one["run_id"], one["what"]) == ("run3", "sampling rate wrong")
    factor = float(one["correction"].split(" ")[-1])
    assert factor == pytest.approx(1 + wrong, abs=2e-6)


@pytest.mark.parametrize("kelvin", [2.0, -0.3])
def test_a_thermometer_that_reads_beside_is_told_in_kelvin(kelvin):
    """A constant offset does no more than part one run's frequency from the others'."""
    records = recordings(programme(72, FOLLOWS, runs=5, noise=1e-4), 72)
    records[1] = records[1].replace(temperature_degc=records[1].temperature_degc + kelvin)
    out = diagnosed(records)
    assert [effect["name"] for effect in out["effects"]] == ["thermal_frequency"]
    assert out["verdict"] == "partly explained"
    told = out["frequencies"]["sentence"]
    assert told.startswith("run1 alone oscillates")
    read = float(told.split("reads ")[1].split(" K")[0])
    assert read == pytest.approx(abs(kelvin), rel=0.01)
    assert ("too high" in told) is (kelvin > 0)


def test_a_gyro_of_its_own_frequency_is_told_where_no_cause_follows_it():
    """5 ppm, too little for a clock to be asked."""
    records = recordings(programme(73, runs=4, noise=1e-4), 73)
    records[2] = records[2].replace(sample_rate_hz=records[2].sample_rate_hz * (1 + 5e-6))
    out = diagnosed(records)
    assert out["effects"] == [] and out["suspect_runs"] == []
    assert out["verdict"] == "unexplained"
    assert out["frequencies"]["sentence"].startswith("run2 alone oscillates")


def test_a_run_clipped_below_what_others_reach_is_told_and_left_out():
    """The range of its own recorder: fitted along, it was a knock of 19 σ beside χ² 6600."""
    records = recordings(programme(74, runs=4, noise=1e-4), 74)
    top = 0.6 * float(np.abs(records[0].c).max())
    records[0] = records[0].replace(
        c=np.clip(records[0].c, -top, top), s=np.clip(records[0].s, -top, top)
    )
    out_record = diagnose(estimated(records))
    out = summarise(out_record)
    assert out["verdict"] == "adequate" and out["effects"] == []
    assert any("run0: " in why and "clipped" in why for why in out_record.status_reasons)


def test_a_run_of_few_codes_is_told_and_struck_by_nothing():
    """7 bits without dither in one of four: a step of a gain of 11 σ and a knock of 8 σ."""
    records = recordings(programme(75, runs=4, noise=2e-5), 75)
    step = float(np.abs(records[2].c).max()) / 40
    coarse = {
        name: np.round(np.asarray(getattr(records[2], name), float) / step).astype("i2")
        for name in ("c", "s")
    }
    records[2] = records[2].replace(
        **coarse, c_scale_factor=step, s_scale_factor=step, least_count=step
    )
    record = diagnose(estimated(records))
    assert any(why.startswith("run2: rounding makes most") for why in record.status_reasons)
    assert summarise(record)["effects"] == []
