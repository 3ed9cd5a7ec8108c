"""simulate: blocks, seeds, read-out, environment, effects; the truth it writes is the wave that was
simulated."""

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.physics import signals
from hrg_cli.records import Recording, collect
from hrg_cli.settings import load_toml
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import list_run_ids, simulate, summarise

DEVICE = {
    "frequency_hz": 2000.0, "damping_rate_1_s": 0.4, "damping_split_1_s": 0.02, "damping_axis_rad": 0.35,
    "frequency_split_rad_s": 0.3, "stiffness_axis_rad": 0.9, "scale_factor": 0.55,
}  # fmt: skip


SOAK = {"kind": "soak", "levels_degc": [10.0, 30.0], "dwell_s": 0.5, "transition_s": 0.5}
CYCLE = {"kind": "cycle", "low_degc": 10.0, "high_degc": 30.0, "period_s": 1.0}


def config(seconds=1.0, fs=16_000.0, **tables):
    base = {
        "device": DEVICE,
        "start": {"wave_angle_rad": 0.2, "quadrature": 0.03, "phase_rad": 1.0},
    }
    recording = {"sample_rate_hz": fs, "duration_s": seconds} | tables.pop("recording", {})
    return base | tables | {"device": DEVICE | tables.pop("device", {}), "recording": recording}


def run(config, **settings):
    return collect(simulate(config, **settings))


def truth_envelopes(record, times):
    """Envelopes from the truth log, interpolated."""
    from hrg_cli.physics.ellipse import compute_envelopes

    u = compute_envelopes(
        record.truth_main_amplitude,
        record.truth_quadrature_amplitude,
        record.truth_wave_angle_rad,
        record.truth_phase_rad,
        record.mode_number,
    )
    return np.stack([np.interp(times, record.truth_time_s, u[:, k]) for k in (0, 1)], -1)


@pytest.mark.parametrize("mode", ["free", "forced"])
def test_samples_do_not_depend_on_the_block_size(mode):
    """Same samples, log and truth for any block size, over the engine's own chunks (65536 samples)
    too."""
    sine = {"kind": "sine", "amplitude_rad_s": 2.0, "frequency_hz": 1.0}
    c = config(
        9.0,
        control={"mode": mode},
        readout={"noise": 1e-3, "adc_bits": 14},
        environment={"rate": sine},
    )
    whole = run(c)
    assert len(whole) == 144_000
    for size in (1000, 65_536, 100_001):
        blocks = list(simulate(c, block_samples=size))
        assert {len(b) for b in blocks[:-1]} == {size}
        joined = collect(blocks)
        for name in ("c", "s", "auxiliary_time_s", "rate_rad_s", "truth_wave_angle_rad"):
            np.testing.assert_array_equal(getattr(joined, name), getattr(whole, name))
    np.testing.assert_allclose(np.diff(whole.auxiliary_time_s), 0.01)


def test_seeds_repeat_and_differ():
    c = config(0.2, readout={"noise": 1e-3})
    first, again, other, quiet = run(c), run(c), run(c, seed=1), run(config(0.2))
    np.testing.assert_array_equal(first.c, again.c)
    assert np.std(first.c - quiet.c) == pytest.approx(1e-3, rel=0.05)
    assert abs(np.corrcoef(first.c - quiet.c, other.c - quiet.c)[0, 1]) < 0.1
    assert abs(np.corrcoef(first.c - quiet.c, first.s - quiet.s)[0, 1]) < 0.1
    several = config(0.2, readout={"noise": 1e-3}, run=[{"run_id": "a"}, {"run_id": "b"}])
    a, b = (run(several, run=name) for name in "ab")
    assert abs(np.corrcoef(a.c - quiet.c, b.c - quiet.c)[0, 1]) < 0.1


@pytest.mark.parametrize("model", ["fast", "slow"])
def test_truth_is_the_wave_in_the_samples(model):
    """Re[u e^{jω_r t}] of the logged truth gives the samples at the log's times; the start is the
    file's."""
    record = run(config(2.0, environment={"rate_rad_s": 1.0}), model=model)
    at = np.arange(0, len(record), 160)
    t = record.times()[at]
    q = truth_envelopes(record, t) * np.exp(2j * np.pi * 2000.0 * t)[:, None]
    np.testing.assert_allclose(np.stack([record.c[at], record.s[at]], -1), q.real, atol=1e-9)
    assert record.truth_wave_angle_rad[0] == pytest.approx(0.2, abs=1e-12)
    assert record.truth_phase_rad[0] == pytest.approx(1.0, abs=1e-12)
    assert record.truth_quadrature_amplitude[0] == pytest.approx(0.03, abs=1e-12)


def test_models_agree_through_the_whole_stage():
    c = config(
        1.0,
        readout={"kind": "carrier", "carrier_hz": 5000.0, "model": "full", "gap": 5.0},
        environment={"rate_rad_s": 2.0},
    )
    fast, slow = run(c), run(c, model="slow")
    assert np.abs(fast.c - slow.c).max() < 1e-6
    assert np.abs(fast.truth_phase_rad - slow.truth_phase_rad).max() < 1e-6


def test_carrier_gives_seed_b_coefficients():
    """Least squares on the samples finds the eight coefficients of PHYSICS §3 (1), without a
    factor."""
    A, B, theta, phi, psi = 1.0, 0.2, 0.4, 0.7, 0.9
    c = config(
        0.05, 200_000.0, device={"damping_rate_1_s": 1e-9, "damping_split_1_s": 0.0, "frequency_split_rad_s": 0.0},
        start={"amplitude": A, "quadrature": B, "wave_angle_rad": theta / 2, "phase_rad": phi},
        readout={"kind": "carrier", "carrier_hz": 50_000.0, "carrier_phase_rad": psi},
    )  # fmt: skip
    record = run(c)
    t = record.times()
    basis = np.column_stack(
        [
            f(2 * np.pi * (50_000.0 + side * 2000.0) * t)
            for f in (np.cos, np.sin)
            for side in (-1, 1)
        ]
    )
    z = np.concatenate(
        [np.linalg.lstsq(basis, np.asarray(y), rcond=None)[0] for y in (record.c, record.s)]
    )
    np.testing.assert_allclose(
        z, signals.make_signals(np.array([A, B, theta, phi, psi])), atol=1e-6
    )


@pytest.mark.parametrize(("law", "cubic"), [("alternating", 1), ("printed", 3)])
def test_full_electrode_law(law, cubic):
    """Third harmonic and compression as the law's series gap·(c + γc³ + …)."""
    linear, full = (
        run(config(0.05)),
        run(config(0.05, readout={"model": "full", "gap": 20.0, "law": law})),
    )
    np.testing.assert_allclose(full.c, linear.c + cubic * linear.c**3 / 400, atol=1e-4)
    assert np.abs(full.c - linear.c).max() > 1e-3
    with pytest.raises(HrgError, match="stay below the gap"):
        run(config(0.05, readout={"model": "full", "gap": 0.5}))


def test_converter_rounds_and_clips():
    c = {"noise": 0.0, "adc_bits": 12, "full_scale": 0.5}
    ideal, record = run(config(0.1)), run(config(0.1, readout=c))
    assert record.c.dtype == np.int16
    assert record.c_scale_factor == 1.0 / 4096
    assert (record.c.min(), record.c.max()) == (-2048, 2047)
    inside = np.abs(ideal.c) < 0.49
    assert np.abs(record.physical()[0] - ideal.c)[inside].max() <= 0.5 / 4096 + 1e-12
    assert run(config(0.1, readout={"adc_bits": 24})).c.dtype == np.int32
    assert run(config(0.1, recording={"samples": "float32"})).c.dtype == np.float32


def test_clock_error_scales_frequency():
    """Everything seems faster by 1 + ε (PHYSICS R12)."""
    still = {"frequency_split_rad_s": 0.0}
    record = run(config(2.0, device=still, readout={"clock_error": 1e-4}))
    plain = run(config(2.0 * 1.0001, device=still))
    assert np.polyfit(record.truth_time_s, record.truth_phase_rad, 1)[0] == pytest.approx(
        np.polyfit(plain.truth_time_s, plain.truth_phase_rad, 1)[0], abs=1e-3
    )
    cross = np.angle(
        np.sum((record.c[:1600] + 0j) * np.exp(-2j * np.pi * 2000.2 * record.times(0, 1600)))
    )
    late = np.angle(
        np.sum(
            (record.c[-1600:] + 0j)
            * np.exp(-2j * np.pi * 2000.2 * record.times(len(record) - 1600))
        )
    )
    assert (
        abs(np.angle(np.exp(1j * (late - cross)))) < 0.4
    )  # 2000 Hz itself would be off by 2.5 rad


def test_forced_run_holds_amplitude_and_logs_the_drive():
    """a_ΦA = ν_A a_A: the log of the drive is the loss along the wave."""
    c = config(
        4.0,
        device={"frequency_split_rad_s": 0.0},
        control={"mode": "forced"},
        environment={"rate_rad_s": 0.3},
    )
    record = run(c)
    assert record.mode == "forced"
    late = record.auxiliary_time_s > 2
    np.testing.assert_allclose(record.truth_main_amplitude[late], 1.0, atol=2e-3)
    loss = 0.4 + 0.02 * np.cos(4 * (record.truth_wave_angle_rad[late] - 0.35))
    np.testing.assert_allclose(record.drive_main[late], loss, atol=1e-3)


def test_drive_off_lets_the_wave_decay():
    record = run(config(2.0, control={"mode": "forced", "off_s": [[0.5, 1.5]]}))
    t, a = record.truth_time_s, record.truth_main_amplitude
    off = (t > 0.55) & (t < 1.45)
    assert np.polyfit(t[off], np.log(a[off]), 1)[0] == pytest.approx(-0.4, abs=0.03)
    assert np.all(record.drive_main[off] == 0)


@pytest.mark.parametrize(
    ("table", "times", "expected"),
    [
        ({"temperature_degc": 31.0}, [0.0, 1.9], [31.0, 31.0]),
        ({"temperature": {"kind": "ramp", "start_degc": 10.0, "stop_degc": 30.0}}, [0.0, 1.0], [10.0, 20.0]),
        ({"temperature": SOAK}, [0.4, 0.75, 1.2, 1.9], [10.0, 20.0, 30.0, 30.0]),
        ({"temperature": CYCLE}, [0.0, 0.25, 0.5, 1.0], [10.0, 20.0, 30.0, 10.0]),
        ({"temperature": CYCLE | {"shape": "sine"}}, [0.0, 0.5], [10.0, 30.0]),
    ],
)  # fmt: skip
def test_temperature_programmes(table, times, expected):
    record = run(config(2.0, environment=table))
    np.testing.assert_allclose(
        np.interp(times, record.auxiliary_time_s, record.temperature_degc), expected, atol=1e-3
    )


@pytest.mark.parametrize(
    ("table", "times", "expected"),
    [
        ({"rate_rad_s": -1.5}, [0.3], [-1.5]),
        ({"rate": {"kind": "steps", "levels_rad_s": [0.0, 1.0, -1.0], "dwell_s": 0.48}}, [0.2, 0.7, 1.2, 1.9], [0.0, 1.0, -1.0, -1.0]),
        ({"rate_rad_s": 1.0, "rate": {"kind": "sine", "amplitude_rad_s": 2.0, "frequency_hz": 0.5}}, [0.5, 1.5], [3.0, -1.0]),
        ({"rate": {"kind": "sweep", "maximum_rad_s": 2.0}}, [0.0, 0.5, 1.0, 1.5], [0.0, 2.0, 0.0, -2.0]),
        ({"earth_latitude_rad": np.pi / 6}, [1.0], [7.292115e-5 / 2]),
        ({"rate_rad_s": 1.0, "earth_rate_rad_s": 1e-4, "earth_logged": False}, [1.0], [1.0]),
    ],
)  # fmt: skip
def test_rate_programmes(table, times, expected):
    record = run(config(2.0, environment=table))
    np.testing.assert_allclose(
        np.interp(times, record.auxiliary_time_s, record.rate_rad_s), expected, atol=1e-4
    )


def test_the_earth_turns_about_the_vertical_by_the_sine_of_the_latitude():
    record = run(config(2.0, environment={"earth_latitude_rad": np.pi / 6}))
    np.testing.assert_allclose(record.rate_rad_s, 7.292115e-5 / 2, rtol=1e-6)


def test_unlogged_earth_rate_turns_the_wave():
    rest = {"frequency_split_rad_s": 0.0, "damping_split_1_s": 0.0}
    record = run(
        config(1.0, device=rest, environment={"earth_rate_rad_s": 0.01, "earth_logged": False})
    )
    assert np.all(record.rate_rad_s == 0)
    assert np.polyfit(record.truth_time_s, record.truth_wave_angle_rad, 1)[0] == pytest.approx(
        -0.55 / 2 * 0.01, rel=1e-6
    )


def test_wave_angle_runs_on_through_turns():
    record = run(
        config(
            6.0,
            device={"damping_split_1_s": 0.0, "frequency_split_rad_s": 0.0},
            environment={"rate_rad_s": 5.0},
        )
    )
    np.testing.assert_allclose(
        record.truth_wave_angle_rad, 0.2 - 0.275 * 5.0 * record.truth_time_s, atol=1e-6
    )


def test_temperature_moves_frequency_damping_and_splits():
    device = {
        "temperature": {
            "reference_degc": 20.0,
            "frequency_per_degc": [1e-4],
            "damping_rate_per_degc": 0.1,
            "frequency_split_per_degc": 0.2,
        }
    }
    record = run(config(2.0, device=device, environment={"temperature_degc": 25.0}))
    assert np.polyfit(record.truth_time_s, record.truth_phase_rad, 1)[0] == pytest.approx(
        2 * np.pi * 2000 * 5e-4, abs=0.7
    )
    size = np.log(record.truth_main_amplitude**2 + record.truth_quadrature_amplitude**2) / 2
    assert np.polyfit(record.truth_time_s, size, 1)[0] == pytest.approx(-0.6, abs=0.03)


def test_effects_act_and_neutral_ones_do_not():
    plain = run(config(0.3))
    neutral = run(config(0.3, effects={"gain_mismatch": {}}))
    np.testing.assert_allclose(neutral.c, plain.c, atol=1e-12)
    acting = run(config(0.3, effects={"cubic_stiffness": {"pull_rad_s": 2.0}}))
    slope = np.polyfit(acting.truth_time_s, acting.truth_phase_rad - plain.truth_phase_rad, 1)[0]
    assert slope == pytest.approx(2.0 * np.mean(plain.truth_main_amplitude**2), rel=0.05)
    with pytest.raises(HrgError, match="did you mean gain_mismatch"):
        simulate(config(0.3, effects={"gain_mismach": {}}))


@pytest.mark.parametrize(
    ("name", "values", "forced"),
    [
        ("coherent_offset", {"in_phase_c": 1e-3, "quadrature_s": 1e-3}, False),
        ("rate_bias", {"rate_rad_s": 0.01}, False),
        ("thermal_lag", {"time_constant_s": 0.5}, False),
        ("drive_gain", {"gain": 0.02}, True),
        ("drive_gain_mismatch", {"gain": 0.02}, True),
    ],
)
def test_effects_act_alike_in_both_models(name, values, forced):
    """Samples and logs alike: what an effect changes of the truth, of the log, of the drive and of
    the read-out."""
    warming = {
        "temperature": {
            "kind": "cycle",
            "low_degc": 20.0,
            "high_degc": 22.0,
            "period_s": 2.0,
            "shape": "sine",
        },
        "rate_rad_s": 1.0,
    }
    device = {"temperature": {"frequency_per_degc": 2e-5}}
    c = config(
        1.0,
        device=device,
        environment=warming,
        effects={name: values},
        **({"control": {"mode": "forced"}} if forced else {}),
    )
    plain = run(c | {"effects": {}})
    fast, slow = run(c), run(c, model="slow")
    change = max(
        np.abs(fast.c - plain.c).max(), np.abs(fast.temperature_degc - plain.temperature_degc).max()
    )
    assert change > 1e-4
    assert np.abs(fast.c - slow.c).max() < 5e-5
    np.testing.assert_allclose(fast.temperature_degc, slow.temperature_degc)
    np.testing.assert_allclose(fast.rate_rad_s, slow.rate_rad_s)


@pytest.mark.parametrize("model", ["fast", "slow"])
@pytest.mark.parametrize("angle", [0.1, 0.9, 1.6, 3.0])
def test_a_parasitic_force_keeps_to_the_phase(angle, model):
    """2θ̇ = Re(f·e_B)/a with e_B of the file's own wave angle (PHYSICS C11): θ and θ + π/2 are
    driven oppositely."""
    still = {"damping_split_1_s": 0.0, "frequency_split_rad_s": 0.0}
    c = config(
        1.0,
        device=still,
        control={"mode": "forced"},
        start={"wave_angle_rad": angle},
        effects={"parasitic_force": {"in_phase_c_1_s": 1e-3}},
    )
    record = run(c, model=model)
    slope = np.polyfit(record.truth_time_s, record.truth_wave_angle_rad, 1)[0]
    assert 2 * slope == pytest.approx(-1e-3 * np.sin(2 * angle), abs=2e-5)


def test_an_effect_of_the_users_own():
    class Bump:
        name = "bump"

        def values(self, given):
            return dict(given)

        def readout(self, p, readout):
            readout.steps.append(lambda samples, y: y + p["offset"])

        def slow_readout(self, p, u, state):
            return u

    plain, own = (
        run(config(0.1)),
        collect(simulate(config(0.1, effects={"bump": {"offset": 0.25}}), [Bump()])),
    )
    np.testing.assert_allclose(own.c - plain.c, 0.25, atol=1e-12)


def test_recording_round_trip_and_memory(tmp_path):
    """A long run streams to disk: peak memory far below the file's size in memory."""
    import tracemalloc

    c = config(
        60.0,
        50_000.0,
        recording={"gyro_id": "G", "lot_id": "L"},
        readout={"noise": 1e-3, "units": "V"},
    )
    list(simulate(config(0.01)))  # the loop is compiled before memory is watched
    tracemalloc.start()
    store.write(tmp_path / "r.h5", simulate(c, block_samples=200_000))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert (tmp_path / "r.h5").stat().st_size > 48e6
    assert peak < 30e6
    with store.open_record(tmp_path / "r.h5", Recording) as record:
        assert len(record) == 3_000_000
        assert (record.gyro_id, record.lot_id, record.run_id, record.c_units) == (
            "G",
            "L",
            "run",
            "V",
        )
        assert record.nominal_frequency_hz == 2000.0
        assert summarise(record)["mode"] == "free"


def test_runs_of_one_file():
    c = config(
        0.1,
        run=[
            {"start": {"wave_angle_rad": 0.1}},
            {"run_id": "turning", "environment": {"rate_rad_s": 2.0}},
        ],
    )
    assert list_run_ids(c) == ["run1", "turning"]
    first, turning = run(c, run="run1"), run(c, run="turning")
    assert first.truth_wave_angle_rad[0] == pytest.approx(0.1)
    assert turning.truth_wave_angle_rad[0] == pytest.approx(0.2)
    assert turning.rate_rad_s[0] == 2.0
    with pytest.raises(HrgError, match="choose one by --run"):
        simulate(c)
    with pytest.raises(HrgError, match="there is no run third; it has run1, turning"):
        simulate(c, run="third")


@pytest.mark.parametrize(
    "name", ["free_run_downs", "forced_temperature", "carrier_readout", "parametric_drive"]
)
def test_examples_run(name):
    from pathlib import Path

    tables = load_toml(Path(__file__).parents[2] / "configs" / f"{name}.toml")
    first = list_run_ids(tables)[0]
    record = next(simulate(tables, run=first, block_samples=4000))
    assert len(record) == 4000
    assert np.isfinite(record.physical()[0]).all()


def test_one_sample_and_a_single_period():
    assert len(run(config(1e-5))) == 1
    assert len(run(config(5e-4))) == 8


@pytest.mark.parametrize(
    ("table", "change", "says"),
    [
        ("device", {"time_constant_s": 1e-320}, "time_constant_s = .* is beyond what can be"),
        ("start", {"amplitude": 1e300}, r"start.amplitude = 1e\+300 is beyond what can be"),
        ("device", {"temperature": {"reference_degc": 1e16, "frequency_per_degc": [0.0] * 11 + [1.0]}},
         "frequency or rotation is no finite number"),
        ("device", {"temperature": {"reference_degc": 30.0, "damping_rate_per_degc": 1e20}},
         "it grows without bound"),
        ("environment", {"rate": {"kind": "sweep", "maximum_rad_s": 1.0, "period_s": 1e-20}},
         "turns too often"),
    ],
    ids=lambda given: given if isinstance(given, str) else "",
)  # fmt: skip
def test_what_no_number_can_hold_is_refused_in_words(table, change, says):
    """A number may be finite and yet its square, or what it becomes with temperature, is not."""
    config = {
        "device": {"frequency_hz": 1000.0, "time_constant_s": 1.0},
        "recording": {"sample_rate_hz": 8000.0, "duration_s": 0.05},
    }
    config[table] = config.get(table, {}) | change
    with pytest.raises(HrgError, match=says):
        collect(simulate(config))


def test_frequency_hz_is_the_undamped_one():
    """A wave that decays oscillates ν²/(8π²f) lower: 0.0317 Hz at 1 kHz and τ = 20 ms."""
    config = {
        "device": {"frequency_hz": 1000.0, "time_constant_s": 0.02},
        "control": {"mode": "free"},
        "recording": {"sample_rate_hz": 16000.0, "duration_s": 0.12},
        "run": [{"run_id": "a", "start": {"wave_angle_rad": 0.3}}],
    }
    seen = estimate(collect(demodulate(collect(simulate(config)), periods_per_window=4)))
    assert np.mean(collect(seen).frequency_hz) == pytest.approx(
        1000.0 - 50.0**2 / (8 * np.pi**2 * 1000.0), abs=1e-3
    )
