"""identify on one channel: one mode or two as the data say, its laws of the amplitude, strike and
tail, aliases; real recordings."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from synthetic_waves import as_wave

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.fitting.envelopes import two_modes
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify, summarise

BOWL = Mechanics(526.4, 0.13)


def details(record):
    return json.loads(record.details)


def one_signal(z, times, std, seed=1, frequency_hz=526.4):
    """A wave of one channel, the other dead."""
    u = np.stack([z, 0 * z], axis=1).astype(complex)
    wave = as_wave(
        u,
        times,
        std,
        Mechanics(frequency_hz, 0.1),
        np.random.default_rng(seed),
        rate=np.zeros(len(times)),
    )
    return wave


@pytest.mark.parametrize("cut", [(0.0, 21.0), (1.5, 19.0), (3.0, 18.0)])
def test_two_modes_of_a_struck_bell_whole_or_cut(cut):
    """Silence, a strike with a quick transient, the decay of two modes, a damper at the end: the
    decay alone is fitted."""
    t = np.arange(0.02, 21.0, 0.04)
    t = t[(t > cut[0]) & (t < cut[1])]
    x = t - 0.5
    z = (
        np.exp((-0.124 + 0.02j) * x)
        + 0.045 * np.exp((-0.128 - 3.51j) * x + 1j)
        + 2.0 * np.exp((-6.0 + 5j) * x)
    )
    z = np.where(t < 0.5, 1e-3, z) * np.where(t > 19.6, np.exp(-8 * (t - 19.6)), 1.0)
    record = identify([one_signal(z, t, 1e-4)])
    modes = details(record)["modes"]
    assert len(modes) == 2 and record.status == "suspect"
    assert [m["frequency_hz"] for m in modes] == pytest.approx(
        [526.4 + 0.02 / (2 * np.pi), 526.4 - 3.51 / (2 * np.pi)], abs=2e-3
    )
    for mode, decay in zip(modes, (0.124, 0.128), strict=True):
        assert (
            abs(mode["damping_rate_1_s"] - decay) < 5 * mode["std_1_s"] + 5e-4
            and mode["std_1_s"] < 0.01
        )
    assert any("left out" in s for s in record.status_reasons) == (cut[0] < 0.5)


@pytest.mark.parametrize("channel", [0, 1])
def test_the_noise_of_a_channel_alone_is_its_own(channel):
    """The mean of a noise and of a channel set to zero is half of it: χ² was two, and its errors
    inflated."""
    fs = 2003.0
    t = np.arange(80_000) / fs
    random = np.random.default_rng(6)
    x = sum(
        a * np.exp(-nu * t) * np.cos(2 * np.pi * f * t)
        for a, nu, f in ((0.8, 0.05, 500.0), (0.4, 0.06, 500.02))
    )
    signals = [0 * t, 0 * t]
    signals[channel] = x + 1e-3 * random.standard_normal(len(t))
    run = Recording(
        c=signals[0], s=signals[1], sample_rate_hz=fs, mode="free", mode_number=2, run_id="one",
        auxiliary_time_s=t[[0, -1]], rate_rad_s=np.zeros(2),
    )  # fmt: skip
    record = identify([collect(estimate(collect(demodulate(run, periods_per_window=10.0))))])
    assert record.chi2_per_dof == pytest.approx(1.0, abs=0.1)
    value, std, *_ = record.parameters()["frequency_split_rad_s"]
    assert abs(value - np.pi * 0.02) < 4 * std  # half of the modes' distance


def test_one_mode_is_not_taken_for_two():
    t = np.arange(0.02, 20.0, 0.04)
    record = identify([one_signal(np.exp((-0.13 + 0.3j) * t), t, 1e-3)])
    assert set(record.parameters()) == {
        "frequency_hz",
        "damping_rate_1_s",
    } and record.chi2_per_dof == pytest.approx(1, abs=0.2)
    for name, true in (("frequency_hz", 526.4 + 0.3 / (2 * np.pi)), ("damping_rate_1_s", 0.13)):
        value, std, _ = record.parameters()[name]
        assert abs(value - true) < 4.5 * std
    assert not any("left out" in s for s in record.status_reasons)


@pytest.mark.parametrize("unit", [1.0, 1e3])
def test_a_pendulum_tells_how_frequency_and_decay_follow_the_amplitude(unit):
    """da/dt = −f − νa − ν₁a², dφ/dt = δ + κa²: each found with honest errors, in any unit of the
    amplitude; no gyro is refused for it."""
    f, nu, drag, kappa = 5e-3, 3e-3, 8e-3, -0.378
    t = np.arange(0.5, 140.0, 0.5)
    fine = np.linspace(0, 140, 140_001)
    a = np.empty(len(fine))
    a[0] = 1.6
    for i, step in enumerate(np.diff(fine)):
        a[i + 1] = a[i] - step * (f + nu * a[i] + drag * a[i] ** 2)
    phase = (
        np.concatenate([[0.0], np.cumsum((a[1:] ** 2 + a[:-1] ** 2) / 2 * np.diff(fine))]) * kappa
    )
    z = np.interp(t, fine, a) * np.exp(1j * np.interp(t, fine, phase))
    waves = [
        one_signal(z[k:] * unit, t[k:] - t[k] + 0.5, 2e-4 * unit, seed=k, frequency_hz=0.971)
        for k in (0, 20, 60)
    ]
    record = identify(waves)
    assert record.status == "suspect" and not any(
        "contradict" in s or "disagree" in s for s in record.status_reasons
    )
    law = details(record)["amplitude_dependence"]
    for name, true in (
        ("frequency_zero_amplitude_rad_s", 2 * np.pi * 0.971),
        ("frequency_per_amplitude2_rad_s", kappa / unit**2),
        ("decay_dry", f * unit),
        ("decay_per_amplitude", drag / unit),
    ):
        assert abs(law[name]["value"] - true) < 5 * law[name]["std"], name
    assert law["frequency_per_amplitude2_rad_s"]["std"] < 0.01 * abs(kappa) / unit**2


def test_a_torsion_pendulum_of_few_slow_windows_and_any_unit():
    """Slow, weakly damped, far off the reference, in units of 1e-9 and 1e6: finite answers, never
    an internal error."""
    for size in (1e-9, 1e6):
        t = np.arange(12) * 40.0 + 20
        z = size * np.exp((-1e-4 + 3e-3j) * t)
        record = identify([one_signal(z, t, 1e-3 * size, frequency_hz=0.02)])
        assert all(np.isfinite(v) and np.isfinite(s) for v, s, _ in record.parameters().values())
        assert record.get("damping_rate_1_s") == pytest.approx(
            1e-4, abs=5 * record.parameters()["damping_rate_1_s"][1]
        )


def test_aliases_of_the_windows_are_named():
    t = np.arange(0.02, 20.0, 0.04)
    record = identify(
        [one_signal(np.exp((-0.13 + 0.3j) * t) + 0.5 * np.exp((-0.2 - 9j) * t), t, 1e-3)]
    )
    for mode in details(record)["modes"]:
        assert mode["aliases_hz"] == pytest.approx(
            [mode["frequency_hz"] - 25, mode["frequency_hz"] + 25]
        )
    assert any(
        "cannot tell" in s and "windows every 0.04 s" in s
        for s in summarise(record)["identifiability"]["flat_directions"]
    )
    assert all({"name", "value", "limit", "passed"} <= set(c) for c in summarise(record)["checks"])


measured = pytest.mark.skipif(
    "HRG_MEASURED_DATA" not in os.environ,
    reason="HRG_MEASURED_DATA does not name the folder of measured data",
)


def wave_of(hrg, tmp_path, source, *options, periods=None):
    from hrg_cli import store
    from hrg_cli.records import Wave

    names = [tmp_path / f"{Path(source).stem}.{n}.h5" for n in ("r", "p", "w")]
    for command in (
        ("import", source, "-o", names[0], "--s", "none", "--mode", "free", *options),
        (
            "demodulate",
            names[0],
            "-o",
            names[1],
            *(("--periods-per-window", periods) if periods else ()),
        ),
        ("estimate", names[1], "-o", names[2]),
    ):
        assert hrg(*command).status in (0, 3)
    return store.read(names[2], Wave)


@measured
@pytest.mark.parametrize(
    "periods",
    [pytest.param(1, marks=pytest.mark.slow), 20, pytest.param(50, marks=pytest.mark.slow)],
)
def test_singing_bowl_as_recorded(hrg, tmp_path, periods):
    folder = Path(os.environ["HRG_MEASURED_DATA"]) / "singing_bowl"
    record = identify([wave_of(hrg, tmp_path, folder / "bowl.flac", periods=periods)])
    modes = details(record)["modes"]
    assert [m["frequency_hz"] for m in modes] == pytest.approx([526.402, 525.840], abs=2e-3)
    assert all(abs(m["damping_rate_1_s"] - 0.127) < 0.006 and m["std_1_s"] < 0.02 for m in modes)


@measured
@pytest.mark.parametrize("files", [(31,), (32,), (31, 32)], ids=str)
def test_plane_pendulum_as_recorded(files, hrg, tmp_path):
    """One record tells the law that both tell: within 2 % of what was found independently."""
    folder = Path(os.environ["HRG_MEASURED_DATA"]) / "pendulum_plane"
    record = identify(
        [wave_of(hrg, tmp_path, folder / f"data{n}.csv", "--mode-number", 1) for n in files]
    )
    law = details(record)["amplitude_dependence"]
    assert law["frequency_zero_amplitude_rad_s"]["value"] == pytest.approx(6.100, abs=2e-3)
    assert law["frequency_per_amplitude2_rad_s"]["value"] == pytest.approx(-0.378, rel=0.02)
    assert record.status == "suspect" and "frequency_split_rad_s" not in record.parameters()


def test_one_channel_is_no_wave_to_diagnose():
    """A model of a turning wave fitted to it would be told in numbers that mean nothing."""
    t = np.arange(0.02, 20.0, 0.04)
    wave = one_signal(np.exp((-0.13 + 0.3j) * t), t, 1e-3).replace(run_id="bowl")
    with pytest.raises(HrgError, match="bowl: one channel alone was recorded"):
        diagnose([wave])


def test_a_chain_of_one_channel_ends_with_its_modes(hrg, tmp_path):
    t = np.arange(80000) / 8000
    c = np.exp(-0.13 * t) * np.cos(2 * np.pi * 526.4 * t)
    noise = 1e-4 * np.random.default_rng(3).standard_normal(len(t))
    still = {"auxiliary_time_s": t[[0, -1]], "rate_rad_s": np.zeros(2)}
    recording = Recording(
        c=c + noise, s=0 * c, sample_rate_hz=8000.0, mode="free", gyro_id="bowl", **still
    )
    store.write(tmp_path / "bowl.h5", recording)
    done = hrg("run", tmp_path / "bowl.h5", "-o", tmp_path / "out", "--json")
    assert done.status == 0
    report = done.json
    assert report["status"] == "suspect"
    assert [s["name"] for s in report["steps"]] == ["demodulate", "estimate", "identify"]
    assert "no cause can be sought" in report["answer"]["sentence"]
    assert not any("diagnose" in line for line in report["answer"]["commands"])


def test_an_amplitude_alone_measures_no_frequency():
    """Without a phase the frequency is the reference's, within half the windows' rate, of however
    many runs; with a run that has one it is that run's."""

    def recorded(phase, seed):
        t = np.arange(0.02, 5.0, 0.04)
        z = np.exp((-0.13 + 2j) * t)
        wave = one_signal(z if phase else np.abs(z), t, 1e-4, seed)
        if phase:
            return wave
        return wave.replace(
            phase_rad=np.zeros(len(t)), phase_rad_std=np.full(len(t), np.pi / np.sqrt(3))
        )

    for runs in ([recorded(False, 1)], [recorded(False, 1), recorded(False, 2)]):
        record = identify(runs)
        value, std, _ = record.parameters()["frequency_hz"]
        assert value == 526.4 and std == pytest.approx(12.5)
        told = summarise(record)
        assert told["parameters"]["frequency_hz"]["assumed"]
        assert "assumed" not in told["parameters"]["damping_rate_1_s"]
        said = told["identifiability"]["flat_directions"]
        assert any("not measured" in s for s in said) and not any("cannot tell" in s for s in said)
        assert not any(
            key.startswith("frequency") for key in details(record)["amplitude_dependence"]
        )
        decay, error, _ = record.parameters()["damping_rate_1_s"]
        assert abs(decay - 0.13) < 5 * error < 1e-3 and 0.7 < record.chi2_per_dof < 1.3
    record = identify([recorded(False, 1), recorded(True, 2)])
    value, std, _ = record.parameters()["frequency_hz"]
    assert abs(value - 526.4 - 1 / np.pi) < 5 * std < 1e-3
    assert "assumed" not in summarise(record)["parameters"]["frequency_hz"]


def test_modes_that_did_not_settle_are_refused(monkeypatch):
    """A start a long way off and one step: what is found is no optimum, and no result."""
    t = np.arange(0.02, 20.0, 0.04)
    z = np.exp((-0.124 + 0.02j) * t) + 0.3 * np.exp((-0.128 - 3.51j) * t)
    wave = one_signal(z, t, 1e-4)
    assert identify([wave]).status == "suspect"
    guess = two_modes.predict
    monkeypatch.setattr(two_modes, "predict", lambda *given: guess(*given) * 1.02)
    assert identify([wave]).status == "suspect", "a worse start alone must not matter"
    monkeypatch.setattr(two_modes, "MOST_STEPS", 1)
    record = identify([wave])
    assert record.status == "refused" and any("settle" in s for s in record.status_reasons)
