"""A rehearsal holds a result's errors against those it makes on its own twin: right ones pass, too
small ones become suspect."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pytest

from hrg_cli import rehearsal, settings, store
from hrg_cli.errors import HrgError
from hrg_cli.fitting.envelopes import rows
from hrg_cli.fitting.envelopes.coordinates import SPLIT_COMPONENTS
from hrg_cli.fitting.envelopes.envelope_runs import average_rows
from hrg_cli.fitting.noise.colour import ColouredNoise
from hrg_cli.physics import slow_engine
from hrg_cli.physics.resonator import PARAMETERS
from hrg_cli.records import REHEARSAL as PREFIX
from hrg_cli.records import Resonator, collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify
from hrg_cli.stages.rehearse import rehearse
from hrg_cli.stages.rehearsing import twin_colour
from hrg_cli.stages.rehearsing.rehearsals import judge_by_rehearsal
from hrg_cli.stages.rehearsing.repeat import make_wave
from hrg_cli.stages.rehearsing.statistics import Named, judge_figure
from hrg_cli.stages.rehearsing.twin import make_twin
from hrg_cli.stages.rehearsing.twin_colour import draw_course
from hrg_cli.stages.rehearsing.twin_noise import match_noise
from hrg_cli.stages.rehearsing.twin_run import Measured
from hrg_cli.stages.simulate import simulate

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
    return settings.check_settings(identify, changes)


def carried_by_nothing(runs, response, count):
    """Rows averaged as they are, however far the wave turns in one."""

    def still(dt, turn):
        one = np.ones(len(dt), complex)
        return one, 0 * one, 0 * one, one

    return [average_rows(run, 6, still) for run in runs]


def test_a_clean_programme_stays_valid(inputs):
    result = identify([m.wave for m in inputs])
    told = rehearse(result, inputs, own(), times=6)
    assert {f.name for f in told.figures} == {name for name, _ in PARAMETERS}
    assert told.status == "valid" and told.failed == 0, told.reasons
    t_rms = np.sqrt(np.mean([f.error_over_std_rms**2 for f in told.figures]))
    assert 0.6 < t_rms < 1.5
    judged = judge_by_rehearsal(result, told)
    assert judged.status == result.status and json.loads(judged.details)["rehearsal"]["times"] == 6


def test_a_split_lost_in_noise_is_judged_by_its_components():
    """Without splits the sizes come out at 1 σ and never below zero, their axes anywhere: right
    errors, and no reason to doubt them."""
    device = {**DEVICE, "damping_split": 0.0, "frequency_split_hz": 0.0}
    toml = {**TOML, "device": device}
    measured = [
        Measured(
            collect(
                estimate(collect(demodulate(collect(simulate(toml, run=run, seed=9)), **WINDOWS)))
            ),
            RATE_HZ,
            None,
            dict(WINDOWS),
        )
        for run in ("up", "down")
    ]
    result = identify([m.wave for m in measured])
    told = rehearse(result, measured, own(), times=12)
    assert told.status == "valid", told.reasons
    names = {figure.name for figure in told.figures}
    assert {*SPLIT_COMPONENTS} <= names and not {"damping_axis_rad", "stiffness_axis_rad"} & names
    components = [f for f in told.figures if f.name in SPLIT_COMPONENTS]
    assert 0.6 < np.sqrt(np.mean([f.error_over_std_rms**2 for f in components])) < 1.4


def test_rows_too_few_for_the_turning_wave_become_suspect(inputs, monkeypatch):
    """The case it exists for: rows of a fixed number, however far the wave turns in one, give σ
    that do not cover the bias."""
    monkeypatch.setattr(rows, "count_rows", lambda p, runs, least: 6)
    monkeypatch.setattr(rows, "average_along", carried_by_nothing)
    result = identify([m.wave for m in inputs])
    told = rehearse(result, inputs, own(), times=4)
    assert told.status == "suspect" and all(reason.startswith(PREFIX) for reason in told.reasons)
    judged = judge_by_rehearsal(result, told)
    assert judged.status != "valid" and set(told.reasons) <= set(judged.status_reasons)


def test_the_twin_is_the_same_programme(inputs):
    result = identify([m.wave for m in inputs])
    twin = match_noise(make_twin(result, inputs, own()), inputs, 0)
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
                    judge_figure("x", factor * random.normal(size=times) + bias, 7).describe_fault()
                    for _ in range(7)
                )
                for _ in range(600)
            ]
        )

    for times in (4, 30):
        assert blamed(times) < 0.03
    assert blamed(30, 2.0) > 0.99 and blamed(30, 0.4) > 0.99 and blamed(30, bias=2.0) > 0.99


def test_a_std_that_the_programme_does_not_give_is_told(inputs):
    """Twins were held against their own σ alone: a file of a fifth of its σ was "valid"."""
    result = identify([m.wave for m in inputs])
    small = result.replace(std=result.std / 5, covariance=result.covariance / 25)
    told = rehearse(small, inputs, own(), times=4)
    assert told.status == "suspect" and len(told.reasons) == len(result.name), told.reasons
    assert all(f.std_ratio == pytest.approx(0.2, rel=0.3) for f in told.figures)
    place = list(result.name).index("scale_factor")
    large = result.std * np.where(np.arange(len(result.std)) == place, 2.0, 1.0)
    told = rehearse(result.replace(std=large), inputs, own(), times=4)
    assert len(told.reasons) == 1 and "states of scale_factor is 1.9" in told.reasons[0]


def spoil(path, place, factor):
    with h5py.File(path, "a") as file:
        file[place][...] *= factor


def test_nothing_is_written_into_a_file_that_was_changed(folder, hrg):
    """It was sealed again: `verify` told of the change before, and found the file whole after."""
    found = folder / "resonator.h5"
    spoil(found, "resonator/std", 0.2)
    before = found.read_bytes()
    done = hrg("rehearse", found, "--times", "2")
    assert done.status == 1 and "the values of /resonator/std were changed" in done.err, done
    told = hrg("rehearse", found, "--times", "4", "--keep-file", "--json")
    assert told.status in (0, 3) and told.json["status"] == "suspect", told
    assert "states of damping_rate_1_s is 0." in " ".join(told.json["status_reasons"])
    assert found.read_bytes() == before and hrg("verify", found).status == 3
    with h5py.File(found, "a") as file:
        del file.attrs["checksums"]
    assert "keeps no checksums" in hrg("rehearse", found, "--times", "2").err


def test_a_file_that_is_replaced_meanwhile_is_left_alone(folder, hrg, monkeypatch):
    found, repeat = folder / "resonator.h5", rehearsal.rehearse

    def replaced(*given, **more):
        found.write_bytes(b"another's")
        return repeat(*given, **more)

    monkeypatch.setattr(rehearsal, "rehearse", replaced)
    done = hrg("rehearse", found, "--times", "2")
    assert done.status == 1 and "while it was rehearsed" in done.err, done
    assert found.read_bytes() == b"another's"


@pytest.mark.parametrize(("of_each", "common"), [((3.0, 0.0), 0.0), ((0.0, 0.0), 3.0)])
def test_a_twin_has_the_noise_of_either_channel(of_each, common):
    """It had the mean of both in each: the σ that a file states of noise on one channel, which the
    likelihood weighs, was 0.6 of the twins'."""
    made = []
    for number, run in enumerate(("up", "down")):
        recording = collect(simulate(TOML, run=run, seed=5 + number))
        noise = 1e-3 * np.random.default_rng(number).normal(size=(3, len(recording.c)))
        c, s = np.asarray(of_each)[:, None] * noise[:2] + common * noise[2]
        recording = recording.replace(c=recording.c + c, s=recording.s + s)
        wave = collect(estimate(collect(demodulate(recording, **WINDOWS))))
        made.append(Measured(wave, RATE_HZ, None, dict(WINDOWS)))
    told = rehearse(identify([m.wave for m in made]), made, own(), times=4)
    ratios = {f.name: f.std_ratio for f in told.figures}
    assert told.status == "valid", told.reasons
    assert 0.85 < ratios["damping_rate_1_s"] < 1.15 and 0.85 < ratios["scale_factor"] < 1.15


def test_an_earlier_verdict_is_replaced(inputs):
    result = identify([m.wave for m in inputs])
    told = rehearse(result, inputs, own(), times=2)
    blamed = result.judged([f"{PREFIX}something of last week"])
    assert judge_by_rehearsal(blamed, told).status_reasons == (
        *result.status_reasons,
        *told.reasons,
    )
    refused = result.judged(["it cannot be"], "refused")
    assert judge_by_rehearsal(refused, told).status == "refused"


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
        and "scale factor K" in (folder / "r.html").read_text()
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


def test_a_rehearsal_leaves_what_the_result_was_doubted_for(folder, hrg):
    """A resonator of runs with a hidden gain mismatch, "suspect": its rehearsal was "valid", also
    to --strict."""
    found = folder / "resonator.h5"
    store.write(found, store.read(found, Resonator).judged(["it has its doubts"]), force=True)
    done = hrg("rehearse", found, "--times", "2", "--json", "--strict")
    assert done.status == 3 and done.json["status"] == "suspect"
    assert "it has its doubts" in done.json["status_reasons"]
    assert store.read(found, Resonator).status_reasons == tuple(done.json["status_reasons"])


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


def test_a_run_hands_the_verdict_of_its_rehearsals_on(folder, hrg, monkeypatch):
    """Suspect in the resonator, its own step, the answer and the status, though the diagnosis finds
    nothing; done once, and again when more are asked for."""
    recordings = folder / "recordings"
    recordings.mkdir()
    for run in ("up", "down"):
        (folder / f"r-{run}.h5").rename(recordings / f"{run}.h5")
    monkeypatch.setattr(rows, "count_rows", lambda p, runs, least: 6)
    monkeypatch.setattr(rows, "average_along", carried_by_nothing)
    asked = ("run", recordings, "-o", folder / "out", "--set", "demodulate.periods_per_window=2")
    done = hrg(*asked, "--rehearse", "4", "--json")
    report = json.loads(done.out)
    steps = {step["name"]: step for step in report["steps"]}
    assert list(steps)[2:] == ["identify", "rehearse", "diagnose"]
    assert steps["rehearse"]["status"] == "suspect" and steps["rehearse"]["json"]["times"] == 4
    assert store.read(folder / "out" / "resonator.h5", Resonator).status != "valid"
    assert report["status"] != "valid" and report["answer"]["validity"] != "valid"
    assert any(PREFIX in reason for reason in report["status_reasons"])
    assert any(reason.startswith(PREFIX) for reason in report["answer"]["why"])

    made = (folder / "out" / "resonator.h5").stat().st_mtime_ns
    assert json.loads(hrg(*asked, "--rehearse", "4", "--json").out)["status"] == report["status"]
    assert (folder / "out" / "resonator.h5").stat().st_mtime_ns == made
    again = json.loads(hrg(*asked, "--rehearse", "5", "--json").out)
    assert [s["json"]["times"] for s in again["steps"] if s["name"] == "rehearse"] == [5]

    plan = hrg("run", recordings, "-o", folder / "new", "--rehearse", "4", "--dry-run").out
    assert f"hrg rehearse {folder / 'new' / 'resonator.h5'} --times 4" in plan
    lost = hrg("run", recordings, "-o", folder / "new", "--set", "rehearse.seed=1")
    assert lost.status == 1 and "--rehearse N" in lost.err


def wandering(q, tau):
    """An angle that wanders, in the samples."""
    none = ColouredNoise(1.0, 0.0, 0.0, 0.0)
    return (none, none, ColouredNoise(1.0, q, tau, 100.0), none)


def test_a_wander_has_the_density_and_the_correlation_it_is_asked_for():
    """Its variance after t: q[t − τ(1 − e^{−t/τ})], and q t of a random walk."""
    random = np.random.default_rng(4)
    for tau in (0.0, 0.3):
        noise = ColouredNoise(1.0, 2.0, tau, 0.0)
        ends = [draw_course(noise, 0.02, 1.0, random) for _ in range(3000)]
        end = np.array([np.interp(1.0, t, x) for t, x in ends])
        assert np.std(end) == pytest.approx(noise.compute_std_after(1.0), rel=0.06)


def test_the_colour_of_the_noise_is_measured_and_simulated():
    """A wave whose angle wanders: its twin's wanders as much, and white noise alone does not."""
    config = {**TOML, "recording": {"sample_rate_hz": RATE_HZ, "duration_s": 4.0}}
    made = []
    for number, run in enumerate(("up", "down")):
        wander = twin_colour.make_effect(wandering(2e-5, 0.0), 0.0, 0.004, 4.0, (number, 1))
        noisy = {**config, "effects": {wander.name: {}}}
        recording = collect(simulate(noisy, (wander,), run=run, seed=5))
        wave = collect(estimate(collect(demodulate(recording, **WINDOWS))))
        made.append(Measured(wave, RATE_HZ, None, dict(WINDOWS)))
    waves = [m.wave for m in made]
    result = identify(waves)
    twin = match_noise(make_twin(result, made, own()), made, 0)
    measured = twin.runs[0].colour[2]
    # over a tenth of a second, which such a run knows
    assert (
        0.5
        < measured.compute_std_after(0.1)
        / ColouredNoise(1.0, 2e-5, 0.0, 0.0).compute_std_after(0.1)
        < 2
    )
    again = [make_wave(twin, number, 3) for number in range(2)]
    simulated = twin_colour.estimate_of_free_runs(again, own(), 0.0)[2]
    assert 0.4 < simulated.compute_std_after(0.1) / measured.compute_std_after(0.1) < 2.5
    plain = replace(twin, runs=[replace(run, colour=()) for run in twin.runs])
    assert not twin_colour.estimate_of_free_runs(
        [make_wave(plain, n, 3) for n in range(2)], own(), 0.0
    )
    told = rehearse(result, made, own(), times=2).to_json()
    assert "angle" in [c["component"] for c in told["colour"]]


def of_one_channel(start, seed):
    """A run-down in the first channel, the second one empty."""
    config = {**TOML, "device": {**DEVICE, "damping_split": 0.0, "frequency_split_hz": 0.0}}
    config["run"] = [{"run_id": "x", "start": {"amplitude": start}}]
    recording = collect(simulate(config, seed=seed))
    recording = recording.replace(s=np.zeros_like(recording.s))
    wave = collect(estimate(collect(demodulate(recording, periods_per_window=5.0))))
    return Measured(wave, RATE_HZ, None, {"periods_per_window": 5.0})


def test_one_mode_is_rehearsed_and_two_without_axes_are_not():
    made = [of_one_channel(1.0, 1)]
    result = identify([m.wave for m in made])
    assert list(result.name) == ["frequency_hz", "damping_rate_1_s"]
    told = rehearse(result, made, own(), times=6)
    assert {f.name for f in told.figures} == set(result.name)
    assert told.failed == 0 and told.status == "valid", told.reasons
    details = json.loads(result.details)
    two = result.replace(details=json.dumps(details | {"modes": details["modes"] * 2}))
    with pytest.raises(HrgError, match="two modes"):
        rehearse(two, made, own(), times=2)


def test_a_diagnosis_is_rehearsed_with_its_extended_model_for_truth(inputs):
    """The cause is named again, as large as the file says; one that the twin does not hold, or that
    is never named, is told."""
    config = {**TOML, "effects": {"gain_mismatch": {"gain": 0.01}}}
    made = [
        Measured(
            collect(
                estimate(collect(demodulate(collect(simulate(config, run=run, seed=5)), **WINDOWS)))
            ),
            RATE_HZ,
            None,
            dict(WINDOWS),
        )
        for run in ("up", "down")
    ]
    result = diagnose([m.wave for m in made])
    assert [e["name"] for e in json.loads(result.report)["effects"]] == ["gain_mismatch"]
    told = rehearse(result, made, settings.check_settings(diagnose, {}), times=2)
    table = told.to_json()
    assert {"gain_mismatch gain", "scale_factor"} <= {f["name"] for f in table["figures"]}
    assert table["causes"][0] == {"name": "gain_mismatch", "held": True, "named": 2, "times": 2}
    judged = judge_by_rehearsal(result, told)
    assert json.loads(judged.report)["rehearsal"]["times"] == 2
    assert judged.extended_model == result.extended_model
    assert not [r for r in told.reasons if "that the file states" in r]
    report = json.loads(result.report)
    for figure in report["effects"][0]["parameters"].values():
        figure["std"] /= 5
    spoilt = result.replace(report=json.dumps(report))
    told = rehearse(spoilt, made, settings.check_settings(diagnose, {}), times=3)
    assert "states of gain_mismatch gain is 0.2" in " ".join(told.reasons), told.reasons

    assert "is named in 1 of 30" in Named("gain_mismatch", True, 1, 30).describe_fault(1)
    assert "does not hold it" in Named("saturation", False, 9, 30).describe_fault(1)
    assert not Named("saturation", False, 4, 30).describe_fault(1)
    assert not Named("gain_mismatch", True, 12, 30).describe_fault(1)


@pytest.fixture(scope="module")
def driven():
    """A gyro's two driven runs, turned both ways."""
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
    return [
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


def test_tables_whose_band_limit_was_left_open_stay_valid(driven):
    """A harmonic that is not there is averaged over how large it may be: its σ of 100 times what
    repeats scatter by made every such calibration suspect."""
    asked = {"bootstrap": 0, "model": "table"}
    result = calibrate([m.wave for m in driven], **asked)
    told = rehearse(result, driven, settings.check_settings(calibrate, asked), times=3)
    narrow = [f for f in told.figures if f.error_over_std_rms < 0.03]
    assert told.status == "valid" and narrow, told.reasons
    assert {f.rms_least for f in narrow} == {0.0}


def test_a_motion_that_is_known_is_not_followed_again(driven, monkeypatch):
    """The rehearsals of one result differ in the noise alone: samples are the same to the bit."""
    asked = {"harmonics": 1, "scale_factor_harmonics": 1, "bootstrap": 0, "model": "table"}
    result = calibrate([m.wave for m in driven], **asked)
    twin = make_twin(result, driven, settings.check_settings(calibrate, asked))
    first = make_wave(twin, 0, 5)
    monkeypatch.setattr(slow_engine, "follow", None)
    again = make_wave(twin, 0, 5)
    assert np.array_equal(first.wave_angle_rad, again.wave_angle_rad)
    assert not np.array_equal(first.wave_angle_rad, make_wave(twin, 0, 6).wave_angle_rad)


def test_tables_are_rehearsed_with_themselves_for_truth(driven):
    """The twin's own effect turns the wave as the file's tables say; the coefficients come back
    within their errors."""
    made = driven
    asked = {"harmonics": 1, "scale_factor_harmonics": 1, "bootstrap": 0, "model": "table"}
    result = calibrate([m.wave for m in made], **asked)
    told = rehearse(result, made, settings.check_settings(calibrate, asked), times=4)
    assert told.status == "valid" and len(told.figures) == 6, told.reasons
    spoilt = {f"{kind}_harmonics_std": 5.0 for kind in ("drift", "scale_factor")}
    spoilt = {key: getattr(result, key) / factor for key, factor in spoilt.items()}
    held = rehearse(
        result.replace(**spoilt), made, settings.check_settings(calibrate, asked), times=6
    )
    assert held.reasons and all("states of " in reason for reason in held.reasons), held.reasons
    assert 0.5 < np.sqrt(np.mean([f.error_over_std_rms**2 for f in told.figures])) < 1.6
    # the same over frequency, which no thermometer tells
    by_frequency = asked | {"axis": "frequency"}
    result = calibrate([m.wave for m in made], **by_frequency)
    told = rehearse(result, made, settings.check_settings(calibrate, by_frequency), times=4)
    assert len(told.figures) == 6 and not told.failed, told.reasons
    assert 0.4 < np.sqrt(np.mean([f.error_over_std_rms**2 for f in told.figures])) < 1.6
    physical = result.replace(model="physical")
    with pytest.raises(HrgError, match="resonator files"):
        rehearse(physical, made, settings.check_settings(calibrate, by_frequency), times=4)
