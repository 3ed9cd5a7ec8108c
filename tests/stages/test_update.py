"""A calibration that lost its coefficients, brought up to date by a resonator found later."""

import json
from dataclasses import replace

import numpy as np
import pytest
from elliptic_runs import DEVICE, elliptic_run, resonator_of, tempered

from hrg_cli.errors import HrgError
from hrg_cli.fitting.tables.increments import build_path
from hrg_cli.physics.drift import compute_drift
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.calibration.interpolation import (
    compute_measured_drift,
    compute_standard_deviations,
)
from hrg_cli.stages.calibration.resonators import compute_coefficients
from hrg_cli.stages.update import _chi2, summarise, update

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
    path = build_path(wave, harmonics=1)
    x, theta = (
        path.average_neighbours(path.temperature_degc),
        path.average_neighbours(path.angle_rad),
    )
    found = record.values_at(x, theta)[0] + compute_measured_drift(record, path)
    error = found - compute_drift(device(temperature), theta, path.average_neighbours(path.ratio))
    return float(np.sqrt(np.mean(error**2))), float(
        np.sqrt(np.mean((error / compute_standard_deviations(record, x, theta)[0]) ** 2))
    )


@pytest.mark.parametrize("moved", [False, True])
def test_a_reference_of_another_temperature_is_carried_to_the_new_ones(calibration, moved):
    """The tables know what 40 °C do to this gyro: that is no move of its coefficients (it counted as
    one of hundreds of σ, and was put into every node)."""
    ratios = []
    for seed in range(5):
        new = resonator_of((later if moved else tempered)(20.0), 20.0, 2e-3, seed=seed)
        old = resonator_of(tempered(40.0), 40.0, 2e-3, seed=50 + seed)
        record = update(calibration, new, old)
        assert record.status == "valid" and summarise(record)["changed"] == moved
        assert "carried" in summarise(record)["reference"]
        if moved:
            before, _ = drift_error(calibration, later, 20.0)
            ratios.append(drift_error(record, later, 20.0)[0] / before)
    assert not moved or np.sqrt(np.mean(np.square(ratios))) < 0.2


@pytest.mark.parametrize("by_reference", [True, False])
def test_what_moved_is_put_right_and_told_in_sigma(calibration, by_reference):
    ratios, square = [], []
    for seed in range(5):
        new = resonator_of(later(20.0), 20.0, 2e-3, seed=seed)
        old = resonator_of(tempered(20.0), 20.0, 2e-3, seed=50 + seed) if by_reference else None
        record = update(calibration, new, old)
        rows = {row["name"]: row for row in summarise(record)["moved"]}
        assert summarise(record)["changed"] and abs(rows["K_DC_rad_s"]["moved_sigma"]) > 10
        for row in rows.values():  # each with its own deviation, that of the change with both
            assert row["std"] == pytest.approx(np.hypot(row["before_std"], row["now_std"]))
            variance = np.diag(compute_coefficients(new)[1])
            assert np.isclose(variance, row["now_std"] ** 2, rtol=1e-6, atol=0).any()
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
    assert record.status == calibration.status and not summarise(record)["changed"]
    assert all(abs(row["moved_sigma"]) < 5 for row in summarise(record)["moved"])
    assert all(row["tables"] == "kept" for row in summarise(record)["moved"])
    assert np.array_equal(record.drift_harmonics, calibration.drift_harmonics)
    assert record.drift_rad_s_std == pytest.approx(calibration.drift_rad_s_std)


def test_windows_that_cannot_tell_are_refused(calibration):
    blind = resonator_of(later(20.0), 20.0, 2e-3, seed=1)
    covariance = np.array(blind.covariance)
    covariance[0, 0] = covariance[1, 1] = 4.0
    record = update(calibration, blind.replace(covariance=covariance))
    assert record.status == "refused" and any(
        "cannot tell whether it moved" in reason for reason in record.status_reasons
    )


def errors_over_sigma(calibration, device, relative_std, draws=200):
    """Error over σ (draws, 15) of K_DC, K_DS, K and the measured quadrature in all three nodes; σ
    over that of the tables (5,) and of the resonator (5,) at 20 °C. The tables are drawn about those
    of `calibration` by their own covariance, the resonator about `device`'s, whose difference from
    the gyro of the tables' time moves the truth in every node."""
    random = np.random.default_rng(7)
    drift, scale = (
        np.asarray(t) for t in (calibration.drift_harmonics, calibration.scale_factor_harmonics)
    )
    first, details = drift.shape[1], json.loads(calibration.details)
    root = np.linalg.cholesky(calibration.covariance + 1e-40 * np.eye(len(calibration.covariance)))
    quadrature, its_std = (np.array(details["measured"][k]) for k in ("coefficients", "std"))
    exact = resonator_of(device(20.0), 20.0, relative_std)
    (now, spread), (then, _) = (
        compute_coefficients(r) for r in (exact, resonator_of(tempered(20.0), 20.0, relative_std))
    )
    at_20 = np.concatenate([drift[1, 1:3], scale[1, :1], quadrature[1]])
    truth = np.concatenate([drift[:, 1:3], scale[:, :1], quadrature], axis=1) + now - then
    z = []
    for _ in range(draws):
        error = (root @ random.normal(size=len(root))).reshape(3, -1)
        measured = details["measured"] | {
            "coefficients": (quadrature + its_std * random.normal(size=(3, 2))).tolist()
        }
        tables = calibration.replace(
            drift_harmonics=drift + error[:, :first],
            scale_factor_harmonics=scale + error[:, first:],
            details=json.dumps(details | {"measured": measured}),
        )
        # the tables' own place at 20 °C is the gyro's of that time
        found = random.multivariate_normal(at_20 + now - then, spread, method="eigh")
        record = update(tables, resonator_with(exact, found))
        moved = json.loads(record.details)["measured"]
        value, std = (
            np.concatenate([np.asarray(d)[:, 1:3], np.asarray(s)[:, :1], np.array(q)], axis=1)
            for d, s, q in (
                (record.drift_harmonics, record.scale_factor_harmonics, moved["coefficients"]),
                (record.drift_harmonics_std, record.scale_factor_harmonics_std, moved["std"]),
            )
        )
        z.append(((value - truth) / std).ravel())
    own = np.concatenate(
        [
            calibration.drift_harmonics_std[1, 1:3],
            calibration.scale_factor_harmonics_std[1, :1],
            its_std[1],
        ]
    )
    return np.array(z), std[1] / own, std[1] / np.sqrt(np.diag(spread))


def resonator_with(resonator, coefficients):
    """The resonator whose K_DC, K_DS, K and −2δω(cos, sin) 2mθ_ω are these."""
    k_dc, k_ds, scale_factor, cos, sin = coefficients
    values = {
        "damping_split_1_s": np.hypot(k_dc, k_ds),
        "damping_axis_rad": np.mod(np.arctan2(-k_dc, k_ds) / 4, np.pi / 2),
        "frequency_split_rad_s": np.hypot(cos, sin) / 2,
        "stiffness_axis_rad": np.mod(np.arctan2(-sin, -cos) / 4, np.pi / 2),
        "scale_factor": scale_factor,
    }
    return resonator.replace(value=np.array([values[str(name)] for name in resonator.name]))


@pytest.mark.parametrize("relative_std", [3e-6, 1e-4, 3e-3])
def test_what_stood_still_is_known_better_than_by_either_alone(calibration, relative_std):
    z, of_tables, of_resonator = errors_over_sigma(calibration, tempered, relative_std)
    # 200 draws of some ten independent numbers: the rms scatters by 2 to 5 %; 1 % is taken for moved
    assert np.all((np.sqrt((z**2).mean(axis=0)) > 0.85) & (np.sqrt((z**2).mean(axis=0)) < 1.2))
    assert np.all(of_tables < 1 + 1e-9) and np.all(of_resonator < 1 + 1e-9)


def test_what_moved_is_as_well_known_as_the_resonator_knows_it(calibration):
    """At the node where it was identified; at others the change may have been another."""
    z, _, of_resonator = errors_over_sigma(calibration, later, 1e-6)
    low, there, high = np.sqrt((z**2).mean(axis=0)).reshape(3, 5)
    assert np.all((there > 0.85) & (there < 1.2))
    assert np.all(low < 1.2) and np.all(high < 1.2)
    assert of_resonator == pytest.approx(np.ones(5), rel=1e-4)


def test_a_change_that_grows_with_the_coefficients_is_within_sigma_at_other_temperatures(
    calibration,
):
    """Found at 20 °C alone and put into every node it was 6 to 9 σ off at the others, "valid"."""
    new, old = resonator_of(later(20.0), 20.0, 1e-5), resonator_of(tempered(20.0), 20.0, 1e-5)
    record = update(calibration, new, old)
    z = [drift_error(record, later, at)[1] for at in (0.0, 40.0)]
    assert max(z) < 1.5, z
    assert any(
        "at 20 °C alone" in one and "identify the resonator there too" in one
        for one in record.status_reasons
    )


def test_resonators_that_are_exchanged_are_doubted(calibration):
    """The one given as that of the tables' time contradicts them, the new one does not: the change
    was applied with the wrong sign, "valid"."""
    now, then = resonator_of(later(20.0), 20.0, 2e-3), resonator_of(tempered(20.0), 20.0, 2e-3)
    assert update(calibration, now, then).status == "valid"
    exchanged = update(calibration, then, now)
    assert exchanged.status == "suspect"
    assert any("the two may be exchanged" in one for one in exchanged.status_reasons)


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
    rows = {row["name"]: row for row in summarise(record)["moved"]}
    assert "K" not in rows and abs(rows["K_DC_rad_s"]["moved_sigma"]) > 10
    np.testing.assert_allclose(record.scale_factor, calibration.scale_factor, rtol=1e-12)
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


def test_a_change_without_an_error_is_refused_and_not_passed_over():
    """A pseudo-inverse took a direction without error for one along which nothing can move."""
    change, spread = np.array([0.0, 0.0, 1e-3, 0.0, 0.0]), np.diag([1e-8, 1e-8, 0.0, 1e-6, 1e-6])
    with pytest.raises(HrgError, match="state no error for a part"):
        _chi2(change, spread, slice(2, 3))
    # units of any size are no singularity
    spread[2, 2] = 1e-24
    assert _chi2(change, spread, slice(0, 5)) == pytest.approx(1e18)


def test_a_scale_factor_that_was_given_is_no_news(calibration):
    resonator = resonator_of(later(20.0), 20.0, 2e-3, seed=1)
    at = [str(n) for n in resonator.name].index("scale_factor")
    value, std, covariance = (getattr(resonator, n).copy() for n in ("value", "std", "covariance"))
    value[at], std[at], covariance[at], covariance[:, at] = 0.7, 0.0, 0.0, 0.0
    given = resonator.replace(value=value, std=std, covariance=covariance)
    found = update(calibration, given)
    # K follows what the splits say of it by its covariance with them, and nothing of what was given
    assert found.scale_factor_harmonics[:, 0] == pytest.approx(
        calibration.scale_factor_harmonics[:, 0], rel=1e-5
    )
    assert any("the resonator tells no" in reason for reason in found.status_reasons)


def test_the_same_resonator_now_and_then_is_said(calibration, hrg, tmp_path):
    """It was to "name each run once, or its errors come out too small"."""
    from hrg_cli import store

    tables, now, copy = (tmp_path / name for name in ("cal.h5", "now.h5", "copy.h5"))
    store.write(tables, calibration)
    store.write(
        now,
        resonator_of(DEVICE, 20.0).replace(name=np.array(resonator_of(DEVICE, 20.0).name, object)),
    )
    copy.write_bytes(now.read_bytes())
    for reference in (now, copy):
        told = hrg(
            *("update", tables, "--resonator", now, "--reference", reference),
            *("-o", tmp_path / "new.h5"),
        )
        assert told.status == 1 and not (tmp_path / "new.h5").exists()
        assert "is the same data as" in told.err and "each run once" not in told.err
        assert "two resonator files of different runs were expected" in told.err
