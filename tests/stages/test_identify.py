"""identify as a whole: recovery over its range, its errors' honesty, what it refuses to know, real
oscillators."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from synthetic_waves import GYRO, NAMES, PROGRAMME, as_wave, envelope, errors, programme, run_down

from hrg_cli.errors import HrgError
from hrg_cli.fitting.envelopes.rate_from_model import fit_free_rate
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.stages.identify import identify, summarise
from hrg_cli.store.covariance_checks import find_covariance_problem


def details(record):
    return json.loads(record.details)


@pytest.mark.parametrize(
    ("what", "mechanics", "options"),
    [
        ("noise 1e-5", GYRO, {"std": 1e-5}),
        ("noise 0.1", GYRO, {"std": 0.1}),
        ("circular", GYRO, {"ratio": 1.0, "std": 1e-3}),
        ("no quadrature", GYRO, {"ratio": 0.0, "std": 1e-3}),
        (
            "30 beats, split 100 times the damping",
            Mechanics(5000.0, 0.08, 0.004, 0.35, 8.0, 0.9, 0.277),
            {"std": 1e-3, "seconds": 24.0, "window": 8e-3},
        ),
        (
            "split a hundredth of the damping",
            Mechanics(5000.0, 0.3, 0.03, 0.35, 0.003, 0.9, 0.277),
            {"std": 1e-4},
        ),
        (
            "0.01 beats",
            Mechanics(5000.0, 0.1, 0.01, 0.35, 0.016, 0.9, 0.55),
            {"std": 1e-4, "seconds": 2.0},
        ),
        (
            "a pendulum's mode",
            Mechanics(0.5, 1e-3, 1e-4, 0.6, 2e-3, 1.9, 1.0, 1),
            {
                "std": 1e-3,
                "seconds": 1500.0,
                "window": 2.0,
                "runs": [(0.0, 0.0), (0.7, 0.0), (1.5, 3e-3), (0.4, -3e-3)],
            },
        ),
        ("rates to 10 rad/s", GYRO, {"std": 1e-3, "runs": [(0.0, 10.0), (0.3, -10.0), (0.5, 0.0)]}),
        (
            "a rate that swings",
            GYRO,
            {"std": 1e-4, "runs": [(0.0, lambda t: 5 * np.sin(4 * t)), (0.5, lambda t: 2 - t)]},
        ),
    ],
)
def test_recovery_over_the_range(what, mechanics, options):
    record = identify(programme(mechanics, seed=7, **options))
    assert set(record.parameters()) == set(NAMES)
    assert record.chi2_per_dof == pytest.approx(1, abs=0.12), what
    assert all(abs(e) < 4.5 for e in errors(record, mechanics).values()), (
        what,
        errors(record, mechanics),
    )
    assert record.status == "valid" or (what == "noise 0.1"), record.status_reasons


def test_errors_are_honest():
    """(error/σ)² over draws is χ²: its mean over 30 draws of 7 parameters lies within its own
    statistics."""
    squares = []
    for seed in range(30):
        record = identify(programme(std=1e-3, window=2e-2, seed=seed + 100, runs=PROGRAMME[1:]))
        squares.append([e**2 for e in errors(record).values()])
    mean = np.mean(squares, axis=0)
    assert np.all(np.abs(mean - 1) < 5 * np.sqrt(2 / 30)), mean
    assert 0.7 < np.mean(squares) < 1.35


def test_all_methods_in_one_table_and_each_alone():
    waves = programme(std=1e-3, ratio=0.05, seed=2)
    table = details(identify(waves, method="all"))["methods"]
    assert table[0]["method"] == "likelihood" and len(table) == 13
    for row in table[1:]:
        if row["method"] == "axis-crossings":
            continue  # of the frequency split alone
        cell = row["parameters"]["damping_rate_1_s"]
        if row["method"] not in (
            "moving-axes-small-quadrature",
            "fixed-axes-groups",
            "frozen-axes",
        ):  # these are approximate
            assert abs(cell["difference"]) < 6 * cell["std"], row["method"]
    one = identify(waves, method="stokes")
    assert one.method == "stokes" and one.chi2_per_dof == pytest.approx(1, abs=0.2)
    assert all(abs(e) < 5 for e in errors(one, names=NAMES[1:]).values())
    halved = identify(waves, method="fixed-axes", eliminate_rate=True)
    assert halved.status == "suspect" and any("halved" in s for s in halved.status_reasons)
    with pytest.raises(HrgError, match="full period"):
        identify(programme(std=1e-3, runs=[(0.1, 0.0), (0.3, 0.1)]), method="rotation-integrals")


@pytest.mark.parametrize("method", ["moving-axes", "increments"])
def test_a_quadrature_lost_in_noise_skips_the_frequency_split(method):
    gyro = Mechanics(5000.0, 0.31, 0.03, 0.35, 1e-5, 0.9, 0.55)
    runs = [(0.0, 0.0), (0.4, 0.0), (0.8, 0.0), (0.3, 1.0), (0.5, -1.0)]
    record = identify(programme(gyro, std=3e-3, ratio=0.0, window=1e-2, runs=runs), method=method)
    assert not {"frequency_split_rad_s", "stiffness_axis_rad"} & set(record.parameters())
    assert record.status == "suspect" and any(
        "frequency split is skipped" in s for s in record.status_reasons
    )


def test_without_rotation_the_scale_factor_is_left_out():
    record = identify(programme(std=1e-3, runs=PROGRAMME[:4]))
    assert "scale_factor" not in record.parameters()
    assert any("no run was rotated" in s for s in json.loads(record.flat_directions))
    assert record.status == "valid"


def test_one_run_down_at_rest_says_what_it_cannot_tell():
    gyro = Mechanics(5000.0, 0.3, 1e-4, 0.35, 1e-3, 0.9, 0.55)
    record = identify([run_down(0.3, mechanics=gyro, std=1e-2)])
    assert record.status == "suspect"
    assert any("one run-down at rest fixes only the mean decay" in s for s in record.status_reasons)
    assert abs(errors(record, gyro)["damping_rate_1_s"]) < 4.5
    more = identify(
        [run_down(a, mechanics=gyro, std=1e-4, seed=i) for i, a in enumerate((0.1, 0.5, 0.9))]
    )
    assert not any("one run-down" in s for s in more.status_reasons)


def test_a_constant_rate_in_place_of_the_log_and_held_values():
    waves = [
        w.replace(rate_rad_s=None)
        for w in programme(std=1e-3, runs=[(0.1, 2.0), (0.4, 2.0), (0.7, 2.0)])
    ]
    record = identify(waves, rate_rad_s=2.0)
    assert abs(errors(record)["scale_factor"]) < 4.5
    held = identify(
        waves, rate_rad_s=2.0, scale_factor=0.55, damping_axis_rad=0.35, stiffness_axis_rad=0.9
    )
    assert held.parameters()["scale_factor"][:2] == (0.55, 0.0) and held.get(
        "damping_axis_rad"
    ) == pytest.approx(0.35)
    assert abs(errors(held)["damping_split_1_s"]) < 4.5
    unknown = identify(waves, fit_rate=True, scale_factor=0.55)
    found = details(unknown)["rate_rad_s"]
    assert unknown.status == "valid" and abs(found["value"] - 2.0) < 4.5 * found["std"]


def test_a_run_that_disagrees_is_named():
    waves = programme(std=1e-4)
    other = Mechanics(4987.3, 0.31, 0.02, 0.35, 0.11, 0.9, 0.55)
    waves[2] = run_down(0.4, 0.0, mechanics=other, std=1e-4, run_id="the odd one")
    record = identify(waves)
    assert record.status in ("suspect", "refused") and any(
        "the odd one disagrees" in s for s in record.status_reasons
    )


def test_coloured_residuals_widen_the_errors():
    """A slow wander of the read-out (noise of 1/f kind): white errors would be far too small."""
    rng = np.random.default_rng(9)
    squares = []
    for seed in range(8):
        waves = []
        for wave in programme(std=1e-3, window=1e-2, seed=seed, runs=PROGRAMME):
            wander = (
                np.convolve(rng.standard_normal(len(wave) + 40), np.ones(40) / 40, "valid")[
                    : len(wave)
                ]
                * 1e-2
            )
            waves.append(wave.replace(quadrature_amplitude=wave.quadrature_amplitude + wander))
        record = identify(waves)
        assert any("coloured" in s for s in record.status_reasons)
        squares.append([e**2 for n, e in errors(record).items() if n != "frequency_hz"])
    assert np.mean(squares) < 3
    assert details(record)["variance_factor"] > 3 * record.chi2_per_dof


def test_windows_that_state_more_noise_than_there_is_are_told():
    """As a hum does that all windows hold alike: values within a tenth of their σ, "valid"."""
    waves = [
        wave.replace(
            **{
                name: 3 * np.asarray(getattr(wave, name))
                for name in ("main_amplitude_std", "quadrature_amplitude_std", "wave_angle_rad_std")
            },
            phase_rad_std=3 * np.asarray(wave.phase_rad_std),
            signal_std=3 * np.asarray(wave.signal_std),
        )
        for wave in programme(GYRO, seed=7)
    ]
    record = identify(waves)
    assert record.status == "suspect" and any(
        "state 3" in why and "too large" in why for why in record.status_reasons
    )


def test_profile_and_bootstrap_agree_with_the_covariance_where_all_is_linear():
    record = identify(programme(std=1e-3, seed=4), profile=True, bootstrap=200)
    plain = identify(programme(std=1e-3, seed=4))
    for name, interval in details(record)["profile"].items():
        low, high = interval["68"]
        assert (high - low) / 2 == pytest.approx(plain.parameters()[name][1], rel=0.15), name
    ratio = [record.parameters()[n][1] / plain.parameters()[n][1] for n in NAMES[1:]]
    assert all(0.6 < r < 1.6 for r in ratio)


@pytest.mark.parametrize("draws", [4, 100])
def test_a_bootstrap_keeps_the_covariance_one(draws):
    """Runs that disagree widen the plain errors, not those of the draws; the frequency, which no
    draw moves, follows the other parameters as before."""
    waves = programme(std=1e-4, seed=4)
    drift = 0.05 * np.linspace(0, 1, len(waves[0])) ** 2
    waves[0] = waves[0].replace(wave_angle_rad=waves[0].wave_angle_rad + drift)
    plain, record = identify(waves), identify(waves, bootstrap=draws)
    assert find_covariance_problem(record.covariance) is None
    assert np.sqrt(np.diag(record.covariance)) == pytest.approx(record.std)
    assert np.all(record.std <= 1.01 * plain.std)


def test_one_channel_gives_split_and_decays_but_no_axes():
    """A bowl before one microphone: the second channel is dead."""
    gyro = Mechanics(4987.3, 0.31, 0.012, 0.35, 3.0, 0.9, 0.55)
    rng = np.random.default_rng(1)
    times = (np.arange(1500) + 0.5) * 4e-3
    u = envelope(gyro, 0.3, 0.0, times)
    u[:, 1] = 0.0
    record = identify([as_wave(u, times, 1e-3, gyro, rng, rate=np.zeros(1500))])
    assert set(record.parameters()) == {"frequency_hz", "damping_rate_1_s", "frequency_split_rad_s"}
    assert all(abs(e) < 4.5 for e in errors(record, gyro).values()) and record.status == "suspect"
    assert (
        any("one signal" in s and "no axes" in s for s in record.status_reasons)
        and len(details(record)["modes"]) == 2
    )


def test_growing_and_driven_waves():
    grows = Mechanics(5000.0, -0.2, 0.0, 0.0, 0.1, 0.9, 0.55)
    record = identify(
        [run_down(a, mechanics=grows, std=1e-3, seed=i) for i, a in enumerate((0.0, 0.4))]
    )
    assert record.status == "refused" and any("grows" in s for s in record.status_reasons)
    wave = run_down(0.3, std=1e-3)
    with pytest.raises(HrgError, match="driven throughout"):
        identify([wave.replace(mode="forced", drive_main=np.ones(len(wave)))])
    drive = np.ones(len(wave))
    drive[300:1700] = 0
    cut = identify([wave.replace(mode="forced", drive_main=drive)])
    assert abs(errors(cut)["damping_rate_1_s"]) < 4.5
    with pytest.raises(HrgError, match="no run"):
        identify([])
    with pytest.raises(HrgError, match="mode numbers"):
        identify([wave, wave.replace(mode_number=1)])


def test_summary_is_the_contract():
    out = summarise(identify(programme(std=1e-3)))
    assert set(out["parameters"]) == set(NAMES)
    assert set(out["parameters"]["scale_factor"]) == {"value", "std", "units"}
    assert out["runs"] == [f"run {i}" for i in range(6)]
    assert {"condition", "flat_directions"} <= set(out["identifiability"])
    json.dumps(out, allow_nan=False)


def test_rate_from_the_reference_model():
    """Ω(t) with honest errors where −mθ'/K carries the whole drift; the model sees the drift, the
    formula does not."""
    gyro = Mechanics(4987.3, 0.31, 0.05, 0.35, 0.3, 0.9, 0.55)
    resonator = identify(programme(gyro, std=1e-5))
    rate = lambda t: 0.3 * np.sin(2 * np.pi * t / 3) + 0.2  # noqa: E731
    estimate = fit_free_rate(
        run_down(0.3, rate, mechanics=gyro, std=1e-4, seed=11), resonator, nodes=16
    )
    error = estimate.rate_rad_s - rate(estimate.time_s)
    assert np.mean((error / estimate.rate_rad_s_std) ** 2) == pytest.approx(
        1, abs=5 * np.sqrt(2 / 16)
    )
    inner = slice(2, -2)
    assert np.std(error[inner]) < 0.1 * np.std(
        (estimate.plain_rate_rad_s - rate(estimate.time_s))[inner]
    )
    with pytest.raises(HrgError, match="scale_factor"):
        fit_free_rate(run_down(0.3, std=1e-4), identify(programme(std=1e-3, runs=PROGRAMME[:3])))


def test_truth_is_not_read(tmp_path):
    """The wave record carries none; identify sees rate and envelopes alone, so a wrong frequency
    column changes nothing."""
    waves = programme(std=1e-3)
    changed = [
        w.replace(frequency_hz=w.frequency_hz * 2, residual_rms=w.residual_rms + 1) for w in waves
    ]
    assert np.array_equal(identify(waves).value, identify(changed).value)


measured = pytest.mark.skipif(
    "HRG_MEASURED_DATA" not in os.environ,
    reason="HRG_MEASURED_DATA does not name the folder of measured data",
)


def wave_of(hrg, tmp_path, source, options, demodulation=()):
    from hrg_cli import store
    from hrg_cli.records import Wave

    names = [tmp_path / n for n in ("r.h5", "p.h5", "w.h5")]
    for command in (
        ("import", source, "-o", names[0], *options),
        ("demodulate", names[0], "-o", names[1], *demodulation),
        ("estimate", names[1], "-o", names[2]),
    ):
        assert hrg(*command).status in (0, 3)
    return store.read(names[2], Wave)


@measured
def test_recorded_pendulum(hrg, tmp_path):
    """Split, axis and decay with block-bootstrap intervals, the free rate refused."""
    folder = Path(os.environ["HRG_MEASURED_DATA"]) / "foucault_yverdon"
    options = (
        "--mode-number",
        1,
        "--mode",
        "free",
        "--constant-rate-rad-s",
        10.96 / 3600 * np.pi / 180,
    )
    wave = wave_of(hrg, tmp_path, folder / "oscillation4.csv", options)
    record = identify([wave], scale_factor=1.0, bootstrap=200)
    assert record.mode_number == 1 and record.status == "suspect"
    nu, std, _ = record.parameters()["damping_rate_1_s"]
    seen = np.flatnonzero(wave.good())[[0, -1]]
    mean = -np.diff(np.log(wave.main_amplitude[seen]))[0] / np.diff(wave.time_s[seen])[0]
    split = record.get("damping_split_1_s")
    assert abs(nu - mean) < split + 5 * std and 0 < std < 0.5 * nu
    assert record.get("frequency_split_rad_s") == pytest.approx(2.9e-5, rel=0.3)
    assert set(details(record)["bootstrap"]["intervals"]) >= {
        "damping_rate_1_s",
        "frequency_split_rad_s",
        "stiffness_axis_rad",
    }
    assert record.get("frequency_hz") == pytest.approx(1 / 8.942, rel=1e-3)
    free = identify([wave], fit_rate=True, scale_factor=1.0)
    assert free.status == "refused" and any(
        "ill-conditioned" in s and "damping split" in s for s in free.status_reasons
    )
    default = identify([wave])
    assert "scale_factor" not in default.parameters() and any(
        "scale_factor is not determined" in s for s in json.loads(default.flat_directions)
    )


@measured
def test_struck_bell(hrg, tmp_path):
    """A split pair before two microphones that are no orthogonal pair: split and both decays, no
    axes."""
    source = Path(os.environ["HRG_MEASURED_DATA"]) / "bell" / "perc_bell.flac"
    wave = wave_of(
        hrg,
        tmp_path,
        source,
        ("--mode", "free", "--nominal-frequency-hz", 3618),
        ("--periods-per-window", 32),
    )
    record = identify([wave])
    modes = details(record)["modes"]
    assert [m["frequency_hz"] for m in modes] == pytest.approx([3621.0, 3615.4], abs=0.3)
    assert record.get("frequency_split_rad_s") == pytest.approx(np.pi * 5.64, rel=0.02)
    assert (
        0.5 < record.get("damping_rate_1_s") < 2 and "stiffness_axis_rad" not in record.parameters()
    )
    assert record.status == "suspect" and any("no axes" in s for s in record.status_reasons)
