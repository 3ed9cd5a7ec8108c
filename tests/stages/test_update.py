"""A calibration that lost its coefficients, brought up to date by a resonator found later."""

import json
from dataclasses import replace

import numpy as np
import pytest
from elliptic_runs import DEVICE, elliptic_run, resonator_of, tempered

from hrg_cli.errors import HrgError
from hrg_cli.fitting.tables.increments import path_of
from hrg_cli.physics.drift import drift
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.calibration.table import measured_drift, standard_deviations
from hrg_cli.stages.update import summary, update

PLAN = ((0.4, 0.1, 0.05), (-0.4, 0.9, -0.05), (0.4, 0.7, -0.04), (-0.4, 0.3, 0.06))


def later(temperature):
    """The gyro a year on: its damping split grew by a tenth, its axes turned, its frequency split
    fell."""
    then = tempered(temperature)
    return replace(
        then,
        damping_split_1_s=then.damping_split_1_s * 1.1,
        damping_axis_rad=then.damping_axis_rad + 0.02,
        frequency_split_rad_s=then.frequency_split_rad_s * 0.9,
        scale_factor=then.scale_factor * (1 + 3e-5),
    )


@pytest.fixture(scope="module")
def calibration():
    runs = [
        elliptic_run(
            tempered(T), T, rate, start, ratio, f"T{T:g} {i}", seed=10 * k + i, duration=10.0
        )
        for k, T in enumerate((0.0, 20.0, 40.0))
        for i, (rate, start, ratio) in enumerate(PLAN)
    ]
    return calibrate(runs, model="quadrature", bootstrap=0)


def drift_error(record, device, temperature):
    """(rms drift error, rms of error/σ) along a run of the gyro as it is now."""
    wave = elliptic_run(
        device(temperature), temperature, 0.3, 0.2, 0.04, "now", seed=99, duration=10.0
    )
    path = path_of(wave, harmonics=1)
    x, theta = path.middle(path.temperature_degc), path.middle(path.angle_rad)
    found = record.values_at(x, theta)[0] + measured_drift(record, path)
    error = found - drift(device(temperature), theta, path.middle(path.ratio))
    return float(np.sqrt(np.mean(error**2))), float(
        np.sqrt(np.mean((error / standard_deviations(record, x, theta)[0]) ** 2))
    )


@pytest.mark.parametrize("by_reference", [True, False])
def test_what_moved_is_put_right_and_told_in_sigma(calibration, by_reference):
    ratios, square = [], []
    for seed in range(5):
        new = resonator_of(later(20.0), 20.0, 2e-3, seed=seed)
        old = resonator_of(tempered(20.0), 20.0, 2e-3, seed=50 + seed) if by_reference else None
        record = update(calibration, new, old)
        rows = {row["name"]: row for row in summary(record)["moved"]}
        assert summary(record)["changed"] and abs(rows["K_DC_rad_s"]["moved_sigma"]) > 10
        before, _ = drift_error(calibration, later, 20.0)
        after, z = drift_error(record, later, 20.0)
        ratios.append(after / before)
        square.append(z**2)
    assert np.sqrt(np.mean(np.square(ratios))) < 0.2
    assert 0.4 < np.sqrt(np.mean(square)) < 1.6
    assert (record.status == "valid") == by_reference, record.status_reasons


def test_a_gyro_that_did_not_move_stays_and_nothing_is_claimed(calibration):
    record = update(
        calibration,
        resonator_of(tempered(20.0), 20.0, 2e-3, seed=3),
        resonator_of(tempered(20.0), 20.0, 2e-3, seed=4),
    )
    assert record.status == calibration.status and not summary(record)["changed"]
    assert all(abs(row["moved_sigma"]) < 5 for row in summary(record)["moved"])
    assert (record.drift_rad_s_std >= calibration.drift_rad_s_std).all()


def test_windows_that_cannot_tell_are_refused(calibration):
    blind = resonator_of(later(20.0), 20.0, 2e-3, seed=1)
    covariance = np.array(blind.covariance)
    covariance[0, 0] = covariance[1, 1] = 4.0
    record = update(calibration, blind.replace(covariance=covariance))
    assert record.status == "refused" and any(
        "cannot tell whether it moved" in reason for reason in record.status_reasons
    )


def without(resonator, *names):
    """The resonator as a method found it that does not tell these parameters."""
    kept = [k for k, name in enumerate(resonator.name) if name not in names]
    columns = {f: np.array(getattr(resonator, f))[kept] for f in ("name", "value", "std", "units")}
    return resonator.replace(**columns, covariance=np.array(resonator.covariance)[kept][:, kept])


def test_what_the_working_mode_does_not_tell_stays_as_it_was(calibration):
    """No mean decay and no scale factor there: the splits are brought up to date all the same, and
    K and its deviation are the tables'."""
    now = without(resonator_of(later(20.0), 20.0, 2e-3, seed=1), "damping_rate_1_s", "scale_factor")
    record = update(calibration, now)
    rows = {row["name"]: row for row in summary(record)["moved"]}
    assert "K" not in rows and abs(rows["K_DC_rad_s"]["moved_sigma"]) > 10
    assert np.array_equal(record.scale_factor, calibration.scale_factor)
    assert record.scale_factor_std == pytest.approx(calibration.scale_factor_std)
    assert any("tells no scale factor" in reason for reason in record.status_reasons)
    before, after = (drift_error(r, later, 20.0)[0] for r in (calibration, record))
    assert after < 0.2 * before
    still = update(calibration, without(now, "frequency_split_rad_s", "stiffness_axis_rad"))
    measured = [json.loads(r.details)["measured"] for r in (still, calibration)]
    assert measured[0] == measured[1]
    with pytest.raises(HrgError, match="holds none of what the tables do"):
        update(
            calibration,
            now.replace(
                **{k: getattr(now, k)[:0] for k in ("name", "value", "std", "units")},
                covariance=np.zeros((0, 0)),
            ),
        )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gyro_id": "other"}, "gyro other"),
        ({"temperature_degc": 80.0}, "identified at 80 °C, the tables hold from 0 to 40"),
        ({"temperature_degc": None}, "says no temperature"),
        ({"status": "refused", "status_reasons": ("diverged",)}, "refused"),
        ({"mode_number": 3}, "mode_number 3"),
    ],
)
def test_a_resonator_that_does_not_belong_is_an_error(calibration, change, words):
    with pytest.raises(HrgError, match=words):
        update(calibration, resonator_of(DEVICE, 20.0).replace(**change))


def test_the_command_writes_what_compensate_takes(calibration, hrg, tmp_path):
    from hrg_cli import store

    store.write(tmp_path / "cal.h5", calibration)
    store.write(
        tmp_path / "now.h5",
        resonator_of(later(20.0), 20.0, 2e-3, seed=0).replace(
            name=np.array(resonator_of(DEVICE, 20.0).name, object)
        ),
    )
    result = hrg(
        "update",
        tmp_path / "cal.h5",
        "--resonator",
        tmp_path / "now.h5",
        "-o",
        tmp_path / "new.h5",
        "--json",
    )
    assert result.status == 0 and result.json["kind"] == "calibration" and result.json["changed"]
    assert {row["name"] for row in result.json["moved"]} >= {"K_DC_rad_s", "K_DS_rad_s", "K"}
    wave = elliptic_run(later(20.0), 20.0, 0.3, 0.2, 0.04, "now", seed=5, duration=5.0)
    store.write(tmp_path / "now.wave.h5", wave)
    done = hrg(
        "compensate",
        tmp_path / "now.wave.h5",
        "--calibration",
        tmp_path / "new.h5",
        "-o",
        tmp_path / "c.h5",
        "--json",
    )
    assert done.status == 0 and json.loads(json.dumps(done.json))["kind"] == "compensated"
    assert hrg("update", tmp_path / "cal.h5", "-o", tmp_path / "x.h5").status == 2
