"""Tables from forced runs whose drift and scale factor are known everywhere."""

import json

import numpy as np
import pytest
from forced_runs import Truth, forced_run, programme

from hrg_cli import Calibration, store
from hrg_cli.errors import HrgError
from hrg_cli.fitting.tables import table_design
from hrg_cli.stages.calibrate import calibrate, summarise
from hrg_cli.stages.calibration import chosen
from hrg_cli.stages.calibration.interpolation import compute_standard_deviations

FIXED = {"harmonics": 2, "scale_factor_harmonics": 2, "bootstrap": 0}


def even_scale_factor(seed):
    """A gyro whose scale factor depends on temperature alone, whose drift has one harmonic."""
    truth = Truth(seed)
    truth.k[:, 1:], truth.k[1:, 0], truth.d[:, 3:] = 0, (1e-4, 1e-5), 0
    return truth


def normalised_errors(
    seed, temperatures=(-20, 0, 20, 40, 60), points=300, settings=None, gyro=Truth, **more
):
    """Error / stated standard deviation of D and K at points the runs never stood at."""
    truth = gyro(100 + seed)
    record = calibrate(
        programme(truth, temperatures, seed=seed, rates=(-0.5, 0.0, 0.5), **more),
        **(FIXED if settings is None else settings),
    )
    assert record.status == "valid", record.status_reasons
    draw = np.random.default_rng(seed)
    x, theta = (
        draw.uniform(temperatures[0], temperatures[-1], points),
        draw.uniform(0, np.pi, points),
    )
    found, std = record.values_at(x, theta), compute_standard_deviations(record, x, theta)
    return [
        (f - t) / s for f, t, s in zip(found, (truth.drift(x, theta), truth.scale(x, theta)), std)
    ]


@pytest.mark.parametrize("walk", [pytest.param(0.0, marks=pytest.mark.slow), 1e-11])
def test_errors_at_unseen_points_are_as_stated(walk):
    """Quadratic over five nodes, which show that nothing bends further."""
    drift, scale = (
        np.concatenate(z)
        for z in zip(*(normalised_errors(s, duration=12.0, walk=walk) for s in range(6)))
    )
    for z in (drift, scale):
        # six gyros with some nine independent coefficients each: the rms of z scatters by 10 %
        assert 0.7 < np.sqrt(np.mean(z**2)) < 1.3
        assert np.mean(np.abs(z) < 1.96) > 0.88


@pytest.mark.slow
@pytest.mark.parametrize("gyro", [Truth, even_scale_factor])
@pytest.mark.parametrize(
    ("walk", "settings"), [(0.0, FIXED), (1e-11, FIXED), (0.0, {"bootstrap": 0})]
)
def test_coverage_over_many_gyros(walk, settings, gyro):
    """Limits given, and chosen by the stage; all four harmonics there, and most of them absent.

    Of harmonics that are absent, and whose limit nobody gives, σ holds the chance that they are there:
    the runs know K's to a tenth of what they know its mean to, and σ is as much wider."""
    in_doubt = settings is not FIXED and gyro is even_scale_factor
    errors = [
        normalised_errors(s, duration=30.0, walk=walk, settings=settings, gyro=gyro)
        for s in range(30)
    ]
    for z in (np.concatenate(z) for z in zip(*errors)):
        assert np.sqrt(np.mean(z**2)) < 1.2
        # thirty gyros with some 25 coefficients each tell a coverage to 0.9 %
        most = 1.0 if in_doubt else 0.97 + 0.009
        assert 0.93 - 0.009 <= np.mean(np.abs(z) < 1.96) <= most


def test_a_wave_that_stands_shows_no_course_over_its_own_noise():
    """At rest this one ends where its drift is zero; sorted by the measured angle its increments
    went slowly, by a chance of 1e-20, and the gyro was suspect."""
    normalised_errors(29, duration=30.0)


def test_without_noise_the_tables_are_the_truth():
    truth = Truth(5)
    record = calibrate(
        programme(truth, (0, 20, 40), (-0.3, 0.3), duration=30, noise=1e-12), **FIXED
    )
    x, theta = np.linspace(0, 40, 50), np.linspace(0, 1.5, 50)
    drift, scale = record.values_at(x, theta)
    assert np.abs(drift - truth.drift(x, theta)).max() < 2e-5 * np.abs(truth.d[0]).max()
    assert np.abs(scale - truth.scale(x, theta)).max() < 1e-7


def test_held_out_drift_is_near_what_the_true_coefficients_leave(monkeypatch):
    """The truth's own residual, in the same cells, is the yardstick."""
    caught = {}
    original = chosen.gather_cells

    def spy(fitted, whole, held, folds):
        layout = fitted.layout
        truth_coefficients = np.zeros(layout.size)
        for j, node in enumerate(layout.nodes):
            powers = truth.powers(node)
            truth_coefficients[layout.drift(j)][:5] = powers @ truth.d
            truth_coefficients[layout.scale(j)][:5] = powers @ truth.k
        exact = np.repeat(truth_coefficients[:, None], whole.shape[1], axis=1)
        caught["truth"] = original(
            fitted, exact, np.repeat(exact[:, :, None], held.shape[2], axis=2), folds
        )[1]
        return original(fitted, whole, held, folds)

    monkeypatch.setattr(chosen, "gather_cells", spy)
    ratios = []
    for seed in range(4):
        truth = Truth(seed)
        record = calibrate(
            programme(truth, (-20, 20, 60), (-0.5, 0.02, 0.5), seed=seed, duration=30, noise=3e-5),
            bootstrap=0,
        )
        left = caught["truth"]
        true_rms = np.sqrt(np.mean(left.residual_rad_s[left.low, -1] ** 2))
        figures = summarise(record)["drift_rms_rad_s"]
        ratios.append(figures["held_out"] / true_rms)
        assert figures["before"] > 3 * figures["held_out"] >= 2.9 * figures["after"]
    assert max(ratios) < 1.3


def test_a_run_worked_through_in_stretches_gives_the_same(monkeypatch):
    waves = programme(Truth(3), (0, 40), (-0.5, 0.5), duration=12)
    whole = calibrate(waves, ladder=True, bootstrap=0)
    monkeypatch.setattr(table_design, "ROWS_AT_ONCE", 100)
    parts = calibrate(waves, ladder=True, bootstrap=0)
    assert parts.drift_harmonics == pytest.approx(whole.drift_harmonics, abs=1e-10)
    assert parts.covariance == pytest.approx(whole.covariance, rel=1e-4, abs=1e-22)
    for key in ("drift_rms_rad_s", "scale_factor_rms_ppm"):
        assert summarise(parts)[key] == pytest.approx(summarise(whole)[key], rel=1e-6)


def test_band_limit_is_found_and_the_ladder_descends():
    record = calibrate(programme(Truth(2), (0, 30), (-0.5, 0.5), duration=25), bootstrap=50)
    out = summarise(record)
    assert out["harmonics"] == 2
    drift = [row["drift_rms_rad_s"] for row in out["ladder"]]
    scale = [row["scale_factor_rms_ppm"] for row in out["ladder"]]
    assert drift[0] > drift[1] > drift[2] and scale[0] > scale[1] > scale[2]
    assert (
        out["ladder"][2]["drift_interval_rad_s"][0]
        <= drift[2]
        <= out["ladder"][2]["drift_interval_rad_s"][1]
    )
    json.dumps(out, allow_nan=False)


def test_repeated_programmes_are_held_out_as_whole_runs():
    truth = Truth(4)
    waves = [
        w
        for day in range(3)
        for w in programme(truth, (10, 40), (-0.4, 0.4), seed=day, duration=15)
    ]
    waves = [w.replace(run_id=f"{w.run_id} {i}") for i, w in enumerate(waves)]
    assert summarise(calibrate(waves, **FIXED))["held_out_by"] == "runs"


@pytest.mark.parametrize(
    ("temperatures", "rates", "kept", "words"),
    [
        (
            (20,),
            (0.5,),
            slice(None),
            "one rate only.*0.5 rad/s.*K and D cannot be told apart.*add a run",
        ),
        ((0, 40), (-0.5, 0.5), slice(0, 3), "at 40 °C there is one rate only"),
        ((20,), (0.0,), slice(None), "no run turns"),
        (
            (20,),
            (0.05, 0.02),
            slice(None),
            "cover .* % of the wave angle's period of 90°: .* is missing",
        ),
        (
            (20,),
            (0.5, -0.02),
            slice(None),
            "of the wave angle at one rate only, where K and D cannot be told apart; turn the slow",
        ),
    ],
)
def test_programmes_that_cannot_serve_are_refused_with_the_missing_run(
    temperatures, rates, kept, words
):
    record = calibrate(programme(Truth(1), temperatures, rates, duration=12)[kept], bootstrap=0)
    assert record.status == "refused"
    import re

    assert any(re.search(words, reason) for reason in record.status_reasons), record.status_reasons


def test_a_slow_run_tells_a_scale_factor_without_harmonics_from_the_drift_at_one_angle():
    """With harmonics of K a fast run and a slow one gave K 15 % off, 8 σ, "valid"."""
    truth = Truth(1, scale_ripple=0.0, curved=False)
    waves = programme(truth, (-20, 20, 60), (0.3, -0.02), duration=30, noise=1e-6)
    record = calibrate(waves, scale_factor_harmonics=0, bootstrap=0)
    assert record.status == "valid"
    k, std = record.scale_factor_harmonics[:, 0], record.scale_factor_harmonics_std[:, 0]
    assert np.all(np.abs(k - truth.scale(np.array(record.node), 0.0)) < 4 * std)


def test_one_temperature_gives_one_node_with_a_narrow_range():
    record = calibrate(programme(Truth(1), (20,), (-0.5, 0.5), duration=15), bootstrap=0)
    assert record.status == "suspect" and "one node" in record.status_reasons[0]
    assert list(record.node) == [20.0] and (record.node_min, record.node_max) == (17.0, 23.0)


def test_runs_without_temperature_and_rates_by_run():
    waves = [
        w.replace(temperature_degc=None, rate_rad_s=None)
        for w in programme(Truth(1, curved=False), (20,), (-0.5, 0.5), duration=15)
    ]
    record = calibrate(waves, rates_rad_s={"T20 R-0.5": -0.5, "T20 R0.5": 0.5}, **FIXED)
    assert record.status == "suspect" and record.scale_factor_harmonics[0, 0] == pytest.approx(
        0.55, rel=1e-4
    )
    with pytest.raises(HrgError, match="no rate log"):
        calibrate(waves)


def earth_along(latitude_deg, tilt_deg, azimuth_deg):
    """Earth's rate along an axis, rad/s: scalar product of two vectors (east, north, up)."""
    latitude, tilt, azimuth = np.radians([latitude_deg, tilt_deg, azimuth_deg])
    of_day = 2 * np.pi / 86164.0905
    earth = of_day * np.array([0.0, np.cos(latitude), np.sin(latitude)])
    horizontal = np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
    return earth @ (np.sin(tilt) * horizontal + np.cos(tilt) * np.array([0.0, 0.0, 1.0]))


@pytest.mark.parametrize(
    ("earth", "told"),
    [
        (5e-5, {"earth_rate_deg_h": 5e-5 * 206264.80625}),
        (earth_along(48, 0, 0), {"latitude_deg": 48.0}),
        (
            earth_along(-33, 70, 25),
            {"latitude_deg": -33.0, "axis_tilt_deg": 70.0, "axis_azimuth_deg": 25.0},
        ),
    ],
)
def test_earth_rate_moves_the_drift_by_k_times_it(earth, told):
    truth = Truth(1)
    waves = programme(truth, (20,), (-0.5, 0.5), duration=20)
    seen = [w.replace(rate_rad_s=w.rate_rad_s - earth) for w in waves]
    right = calibrate(seen, **told, **FIXED)
    wrong = calibrate(seen, **FIXED)
    assert right.drift_harmonics[0, 0] == pytest.approx(
        truth.d[0, 0], abs=5 * right.drift_harmonics_std[0, 0]
    )
    assert wrong.drift_harmonics[0, 0] - right.drift_harmonics[0, 0] == pytest.approx(
        -0.55 * earth, rel=0.01
    )


def test_frequency_in_place_of_temperature():
    truth = Truth(7)
    waves = programme(truth, (0, 20, 40), (-0.5, 0.5), duration=20)
    by_temperature, by_frequency = (
        calibrate(waves, **FIXED),
        calibrate(waves, axis="frequency", **FIXED),
    )
    assert by_frequency.node == pytest.approx(5000 + 0.4 * (by_temperature.node - 20))
    assert by_frequency.drift_harmonics == pytest.approx(by_temperature.drift_harmonics, abs=1e-9)
    assert by_frequency.temperature_degc is None


@pytest.mark.parametrize("interpolation", ["linear", "cubic", "monotone", "smooth"])
def test_sweeps_over_temperature(interpolation, tmp_path):
    truth = Truth(8, curved=False)
    waves = [
        forced_run(truth, lambda t: -20 + 2 * t, rate, 40, i, dt=0.04, run_id=f"sweep {i}")
        for i, rate in enumerate((-0.5, 0.5, -0.5, 0.5))
    ]
    record = calibrate(waves, interpolation=interpolation, **FIXED)
    assert record.status == "valid" and len(record.node) == 6
    x, theta = np.linspace(-15, 55, 40), np.linspace(0, 3, 40)
    drift, _ = record.values_at(x, theta)
    std = compute_standard_deviations(record, x, theta)[0]
    assert np.sqrt(np.mean(((drift - truth.drift(x, theta)) / std) ** 2)) < 2.5
    store.write(tmp_path / "tables.h5", record)
    np.testing.assert_array_equal(
        store.read(tmp_path / "tables.h5", Calibration).values_at(x, theta)[0], drift
    )


def test_a_hidden_half_turn_is_found():
    waves = programme(Truth(1), (20,), (-0.5, 0.5), duration=15)
    moved = waves[1].wave_angle_rad.copy()
    moved[400:] += np.pi / 2
    gap = np.zeros(len(moved), "u1")
    gap[380:420] = 2
    record = calibrate([waves[0], waves[1].replace(wave_angle_rad=moved, flags=gap)], **FIXED)
    plain = calibrate([waves[0], waves[1].replace(flags=gap)], **FIXED)
    assert json.loads(record.details)["jumps_of_half_a_turn"] == 1
    assert record.drift_harmonics == pytest.approx(plain.drift_harmonics, abs=2e-9)


def test_a_stray_harmonic_is_reported_and_kept_out_of_the_tables():
    truth = Truth(1)
    waves = programme(truth, (20,), (-0.5, 0.5), duration=30)
    # an offset at the resonance: an angle error of 2θ
    shifted = [
        w.replace(wave_angle_rad=w.wave_angle_rad + 2e-4 * np.sin(2 * w.wave_angle_rad))
        for w in waves
    ]
    record = calibrate(shifted, **FIXED)
    assert record.status == "suspect" and any(
        "stray harmonic 2θ" in reason for reason in record.status_reasons
    )
    assert not any("6θ" in reason for reason in record.status_reasons)
    assert calibrate(waves, **FIXED).status_reasons[0].startswith("all runs are near")


def test_wrong_company_is_named():
    waves = programme(Truth(1), (20,), (-0.5, 0.5), duration=5)
    with pytest.raises(HrgError, match="gyros"):
        calibrate([waves[0], waves[1].replace(gyro_id="other")])
    with pytest.raises(HrgError, match="mode numbers"):
        calibrate([waves[0], waves[1].replace(mode_number=3)])
    with pytest.raises(HrgError, match="at least one"):
        calibrate([])
    with pytest.raises(HrgError, match="resonator"):
        calibrate(waves, model="physical")


def test_mode_number_one():
    truth = Truth(11, mode_number=1, drift=5e-4)
    record = calibrate(programme(truth, (20,), (-0.4, 0.4), duration=40), **FIXED)
    assert record.wave_angle_rad.max() < np.pi and record.drift_harmonics[0, 1:3] == pytest.approx(
        truth.d[0, 1:3], rel=0.02
    )


@pytest.mark.parametrize(
    ("change", "status", "words"),
    [
        ({"wave_angle_rad": np.zeros(600)}, "refused", "cover"),
        ({"rate_rad_s": np.zeros(600)}, "refused", "no run turns"),
        ({"temperature_degc": np.full(600, np.nan)}, "suspect", "no temperature"),
        ({"wave_angle_rad_std": np.zeros(600)}, "valid", None),
        ({"flags": (np.arange(600) % 2).astype("u1")}, "valid", None),
        ({"main_amplitude": np.zeros(600)}, "valid", None),
        ({"temperature_degc": np.where(np.arange(600) < 50, np.nan, 20.0)}, "suspect", "one node"),
    ],
)
def test_odd_columns(change, status, words):
    waves = [w.replace(**change) for w in programme(Truth(1), (0, 40), (-0.5, 0.5), duration=12)]
    record = calibrate(waves, model="all", ladder=True, bootstrap=5)
    assert record.status == status and (
        words is None or any(words in reason for reason in record.status_reasons)
    )
    assert np.isfinite(record.drift_rad_s_std).all()
    json.dumps(summarise(record), allow_nan=False)


def test_noise_that_damps_the_harmonics_is_said():
    draw = np.random.default_rng(0)
    waves = programme(Truth(1), (20,), (-0.5, 0.5), duration=12)
    loud = [
        w.replace(wave_angle_rad=w.wave_angle_rad + 0.1 * draw.normal(size=len(w))) for w in waves
    ]
    assert any(
        "damps the harmonic 8θ" in reason
        for reason in calibrate(loud, model="table", **FIXED).status_reasons
    )


class Curvy(Truth):
    """Temperature courses that no polynomial of the nodes reproduces."""

    def powers(self, temperature):
        x = (np.asarray(temperature, float) - 20) / 40
        return np.stack([np.ones_like(x), np.sin(2 * x), np.exp(-2 * x**2)])


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_doubt_from_interpolation_is_in_the_stated_error(interpolation):
    square = []
    for seed in range(3):
        truth = Curvy(seed)
        waves = programme(truth, (-20, 0, 20, 40, 60), (-0.5, 0.5), seed=seed, duration=15)
        record = calibrate(waves, interpolation=interpolation, **FIXED)
        x, theta = np.linspace(-20, 60, 200), np.linspace(0, 40, 200)
        drift, std = record.values_at(x, theta)[0], compute_standard_deviations(record, x, theta)[0]
        square.append(np.mean(((drift - truth.drift(x, theta)) / std) ** 2))
    assert 0.3 < np.sqrt(np.mean(square)) < 1.2
