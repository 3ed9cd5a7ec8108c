"""A rehearsal holds a result's errors against those it makes on its own twin: right ones pass, too
small ones become suspect."""

import json

import numpy as np
import pytest

from hrg_cli import settings, store
from hrg_cli.errors import HrgError
from hrg_cli.fitting.envelopes import rows
from hrg_cli.fitting.envelopes.envelope_runs import averaged
from hrg_cli.physics.resonator import PARAMETERS
from hrg_cli.records import Resonator, collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify
from hrg_cli.stages.rehearse import PREFIX, figure, matched, rehearse, with_verdict
from hrg_cli.stages.simulate import simulate
from hrg_cli.stages.twin import Measured, twin_of

RATE_HZ = 2000.0
DEVICE = {
    "frequency_hz": 500.0, "time_constant_s": 2.0, "damping_split": 0.05, "damping_axis_rad": 0.35, "frequency_split_hz": 0.3,
    "stiffness_axis_rad": 0.9, "scale_factor": 0.554,
}  # fmt: skip
WINDOWS = {"periods_per_window": 2.0}
TOML = {
    "device": DEVICE,
    "readout": {"noise": 1e-3},
    "recording": {"sample_rate_hz": RATE_HZ, "duration_s": 2.0},
    "run": [
        {"run_id": "up", "environment": {"rate_rad_s": 6.0}, "start": {"wave_angle_rad": 0.1}},
        {"run_id": "down", "environment": {"rate_rad_s": -6.0}, "start": {"wave_angle_rad": 0.6}},
    ],
}


@pytest.fixture(scope="module")
def inputs():
    """Two run-downs on a turning table: the wave turns by 6.6 rad in each."""
    return [
        Measured(
            collect(
                estimate(collect(demodulate(collect(simulate(TOML, run=run, seed=5)), **WINDOWS)))
            ),
            RATE_HZ,
            None,
            dict(WINDOWS),
        )
        for run in ("up", "down")
    ]


def own(**changes):
    return settings.checked(identify, changes)


def carried_by_nothing(runs, response, count):
    """Rows averaged as they are, however far the wave turns in one."""

    def still(dt, turn):
        one = np.ones(len(dt), complex)
        return one, 0 * one, 0 * one, one

    return [averaged(run, 6, still) for run in runs]


def test_a_clean_programme_stays_valid(inputs):
    result = identify([m.wave for m in inputs])
    told = rehearse(result, inputs, own(), times=6)
    assert {f.name for f in told.figures} == {name for name, _ in PARAMETERS}
    assert told.status == "valid" and told.failed == 0, told.reasons
    t_rms = np.sqrt(np.mean([f.error_over_std_rms**2 for f in told.figures]))
    assert 0.6 < t_rms < 1.5
    judged = with_verdict(result, told)
    assert judged.status == result.status and json.loads(judged.details)["rehearsal"]["times"] == 6


def test_rows_too_few_for_the_turning_wave_become_suspect(inputs, monkeypatch):
    """The case it exists for: rows of a fixed number, however far the wave turns in one, give σ
    that do not cover the bias."""
    monkeypatch.setattr(rows, "needed", lambda p, runs, least: 6)
    monkeypatch.setattr(rows, "along", carried_by_nothing)
    result = identify([m.wave for m in inputs])
    told = rehearse(result, inputs, own(), times=4)
    assert told.status == "suspect" and all(reason.startswith(PREFIX) for reason in told.reasons)
    judged = with_verdict(result, told)
    assert judged.status != "valid" and set(told.reasons) <= set(judged.status_reasons)


def test_the_twin_is_the_same_programme(inputs):
    result = identify([m.wave for m in inputs])
    twin = matched(twin_of(result, inputs, own()), inputs, 0)
    for run, measured in zip(twin.config["run"], inputs, strict=True):
        again = collect(simulate(twin.config, run=run["run_id"], seed=1))
        wave = collect(estimate(collect(demodulate(again, **WINDOWS))))
        assert len(wave) == pytest.approx(len(measured.wave), abs=2)
        assert wave.window_s == pytest.approx(measured.wave.window_s, rel=1e-6)
        assert np.median(wave.signal_std) == pytest.approx(
            np.median(measured.wave.signal_std), rel=0.05
        )
        assert np.median(wave.rate_rad_s) == pytest.approx(
            np.median(measured.wave.rate_rad_s), rel=1e-9
        )
        n = min(len(wave), len(measured.wave)) - 1
        difference = (wave.wave_angle_rad - measured.wave.wave_angle_rad)[:n]
        assert (
            np.ptp(difference) < 0.03
        )  # noise of both, 1e-3 of an amplitude that has fallen to a third


def test_limits_leave_right_results_alone_and_find_wrong_ones():
    """Of right programmes of seven figures one in a hundred is blamed; errors twice their σ, or
    half of it, are found."""
    random = np.random.default_rng(3)

    def blamed(times, factor=1.0, bias=0.0):
        return np.mean(
            [
                any(
                    figure("x", factor * random.normal(size=times) + bias, 7).sentence()
                    for _ in range(7)
                )
                for _ in range(600)
            ]
        )

    for times in (4, 30):
        assert blamed(times) < 0.03
    assert blamed(30, 2.0) > 0.99 and blamed(30, 0.4) > 0.99 and blamed(30, bias=2.0) > 0.99


def test_an_earlier_verdict_is_replaced(inputs):
    result = identify([m.wave for m in inputs])
    told = rehearse(result, inputs, own(), times=2)
    blamed = result.judged([f"{PREFIX}something of last week"])
    assert with_verdict(blamed, told).status_reasons == (*result.status_reasons, *told.reasons)
    refused = result.judged(["it cannot be"], "refused")
    assert with_verdict(refused, told).status == "refused"


def test_too_much_work_is_refused_with_advice(inputs):
    result = identify([m.wave for m in inputs])
    with pytest.raises(HrgError, match="give --times 5"):
        rehearse(result, inputs, own(), times=30, most_samples=40_000.0)
    with pytest.raises(HrgError, match="samples_a_period"):
        rehearse(result, inputs, own(), times=2, most_samples_a_run=1000.0)
    with pytest.raises(HrgError, match="modes"):
        rehearse(
            result.replace(
                name=result.name[:2],
                value=result.value[:2],
                std=result.std[:2],
                units=result.units[:2],
            ),
            inputs,
            own(),
        )


@pytest.fixture
def folder(tmp_path, hrg):
    (tmp_path / "sim.toml").write_text(settings.to_toml(TOML))
    assert hrg("simulate", tmp_path / "sim.toml", "-o", tmp_path / "r.h5", "-q").status == 0
    waves = []
    for run in ("up", "down"):
        hrg(
            "demodulate",
            tmp_path / f"r-{run}.h5",
            "-o",
            tmp_path / f"{run}.p.h5",
            "--periods-per-window",
            "2",
            "-q",
        )
        waves.append(tmp_path / f"{run}.w.h5")
        hrg("estimate", tmp_path / f"{run}.p.h5", "-o", waves[-1], "-q")
    assert hrg("identify", *waves, "-o", tmp_path / "resonator.h5", "-q").status == 0
    return tmp_path


def test_command(folder, hrg):
    before = store.read(folder / "resonator.h5", Resonator)
    done = hrg(
        "rehearse", folder / "resonator.h5", "--times", "2", "--json", "-o", folder / "r.html"
    )
    assert done.status == 0, done.err
    report = json.loads(done.out)
    assert report["times"] == 2 and report["status"] == "valid" and report["written"]
    assert {"name", "bias_over_std", "error_over_std_rms", "coverage_68", "coverage_95"} <= set(
        report["figures"][0]
    )
    after = store.read(folder / "resonator.h5", Resonator)
    assert (
        after.provenance.sources == before.provenance.sources
        and len(after.provenance.history) == len(before.provenance.history) + 1
    )
    assert np.array_equal(after.covariance, before.covariance) and after.status == before.status
    assert (
        "<svg" in (folder / "r.html").read_text()
        and "scale_factor" in (folder / "r.html").read_text()
    )

    bytes_before = (folder / "resonator.h5").read_bytes()
    (folder / "up.w.h5").rename(folder.parent / "elsewhere.h5")
    lost = hrg("rehearse", folder / "resonator.h5", "--times", "2")
    assert lost.status == 1 and "up.w.h5" in lost.err and lost.err.count("\n") == 1
    named = hrg(
        "rehearse",
        folder / "resonator.h5",
        folder.parent / "elsewhere.h5",
        "--times",
        "2",
        "--keep-file",
        "-o",
        folder / "r.svg",
        "-q",
    )
    assert named.status == 0 and (folder / "r.svg").read_text().startswith("<?xml")
    assert (folder / "resonator.h5").read_bytes() == bytes_before
    (folder.parent / "elsewhere.h5").unlink()
    assert hrg("rehearse", folder / "down.w.h5").status == 2


def test_at_once(folder, hrg):
    done = hrg(
        "identify",
        folder / "up.w.h5",
        folder / "down.w.h5",
        "-o",
        folder / "again.h5",
        "--rehearse",
        "2",
        "--json",
    )
    report = json.loads(done.out)
    assert (
        done.status == 0
        and report["rehearsal"]["times"] == 2
        and report["status"] == store.read(folder / "again.h5", Resonator).status
    )


@pytest.mark.slow
def test_tables_are_rehearsed_with_themselves_for_truth():
    """The twin's own effect turns the wave as the file's tables say; the coefficients come back
    within their errors."""
    device = {
        "frequency_hz": 500.0,
        "time_constant_s": 5.0,
        "damping_split": 0.02,
        "damping_axis_rad": 0.5,
        "scale_factor": 0.55,
    }
    control = {
        "mode": "forced",
        "amplitude": 1.0,
        "quadrature_loop": "finite",
        "quadrature_gain_1_s": 20.0,
    }
    rates = {"down": -3.0, "up": 3.0}
    config = {
        "device": device,
        "control": control,
        "readout": {"noise": 1e-3},
        "recording": {"sample_rate_hz": 2000.0, "duration_s": 8.0},
        "run": [
            {"run_id": name, "environment": {"rate_rad_s": rate}} for name, rate in rates.items()
        ],
    }
    windows = {"periods_per_window": 5.0}
    made = [
        Measured(
            collect(
                estimate(
                    collect(demodulate(collect(simulate(config, run=name, seed=3)), **windows))
                )
            ),
            2000.0,
            None,
            windows,
        )
        for name in rates
    ]
    asked = {"harmonics": 1, "scale_factor_harmonics": 1, "bootstrap": 0, "model": "table"}
    result = calibrate([m.wave for m in made], **asked)
    told = rehearse(result, made, settings.checked(calibrate, asked), times=4)
    assert told.status == "valid" and len(told.figures) == 6, told.reasons
    assert 0.5 < np.sqrt(np.mean([f.error_over_std_rms**2 for f in told.figures])) < 1.6
