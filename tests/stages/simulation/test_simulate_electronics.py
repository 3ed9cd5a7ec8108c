"""[electronics], [noise] and [spring] of a simulation file: what they mean, what is refused, and what a recording says of its loops."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.records import collect
from hrg_cli.stages.simulate import simulate

DEVICE = {
    "frequency_hz": 1000.0,
    "damping_rate_1_s": 0.5,
    "frequency_split_rad_s": 1.2,
    "stiffness_axis_rad": 0.6,
}
FORCED = {"mode": "forced", "quadrature_loop": "finite"}


def run(model="fast", seed=1, seconds=4.0, **tables):
    recording = {"sample_rate_hz": 8000.0, "duration_s": seconds} | tables.pop("recording", {})
    return collect(
        simulate({"device": DEVICE, "recording": recording, **tables}, model=model, seed=seed)
    )


def test_the_spring_of_the_forecast_rounds_the_resonator_for_every_angle_and_model():
    """Along the stiffest axis without tuning: the quadrature stays where the split made it grow,
    and the mean frequency falls by s."""
    for angle in (0.1, 0.5):
        start = {"wave_angle_rad": angle}
        rough = run(start=start)
        spring = {"size_rad_s": 1.2, "axis_rad": 0.6}
        for model in ("fast", "slow"):
            still = run(model, start=start, spring=spring)
            ratio, grown = (
                np.abs(r.truth_quadrature_amplitude / r.truth_main_amplitude).max()
                for r in (still, rough)
            )
            assert ratio < 0.01 * grown
            phase = np.polyfit(still.truth_time_s, still.truth_phase_rad, 1)[0]
            assert phase == pytest.approx(-1.2, abs=2e-3)


def test_a_loop_too_late_is_simulated_and_said():
    good = run(control=FORCED, electronics={})
    assert good.status == "valid"
    late = {"delay_periods": 200.0, "drive_full_scale": 3.0}
    bad = run(control=FORCED | {"amplitude_gain_1_s": 30.0}, electronics=late)
    assert bad.status == "suspect"
    assert any("do not hold the wave" in reason for reason in bad.status_reasons)
    assert any("saturates" in reason for reason in bad.status_reasons)
    with pytest.raises(HrgError, match="unstable"):
        run(
            control=FORCED | {"amplitude_gain_1_s": 1e5},
            electronics={"delay_periods": 100.0},
            seconds=60.0,
        )


def test_electronics_leaves_the_log_and_the_noise_to_see():
    quiet = run(control=FORCED, electronics={})
    noisy = run(control=FORCED, electronics={}, readout={"noise": 1e-3})
    again = run(control=FORCED, electronics={}, readout={"noise": 1e-3})
    assert np.array_equal(noisy.c, again.c)
    assert np.std(noisy.c - quiet.c) == pytest.approx(1e-3, rel=0.05)
    seen = np.std(
        (noisy.drive_quadrature - quiet.drive_quadrature)[200:]
    )  # gain 5, windows of 16 periods of 8 samples
    assert seen == pytest.approx(5 * 1e-3 * np.sqrt(2 / 128), rel=0.3)


@pytest.mark.parametrize("bits", [7, 9])
def test_a_converter_s_steps_are_noise_of_a_twelfth_of_their_square(bits):
    """q = 2 full scales/2^bits, with noise of one step to dither: each sample is off by q/√12, the
    quadrature of a window of N samples by √(2/N) of that, the command by the loop's gain."""
    step = 2 * 1.5 / 2**bits
    fine, coarse = (
        run(
            control=FORCED,
            electronics={},
            readout={"noise": step} | converter,
            environment={"rate_rad_s": 2.0},
        )
        for converter in ({}, {"adc_bits": bits, "full_scale": 1.5})
    )
    off = coarse.drive_quadrature[200:] - fine.drive_quadrature[200:]
    # 230 commands: ± 5 %; the loop's answer to its own noise is slow
    assert np.std(off) == pytest.approx(5 * step / np.sqrt(12) * np.sqrt(2 / 128), rel=0.2)


@pytest.mark.parametrize(
    ("tables", "words"),
    [
        ({"electronics": {}}, "drives loops"),
        ({"control": FORCED, "electronics": {"drive_bits": 12}}, "drive_full_scale"),
        ({"noise": {"temperature_k": 300.0}}, "effective_mass_kg"),
        ({"noise": {"drive_density": 1e-6}}, "of the drive"),
        ({"noise": {"readout_corner_hz": 1.0}}, "readout.noise"),
        ({"readout": {"law": "printed"}}, 'model = "full"'),
        ({"readout": {"model": "full", "gap": 9.0, "electrode_gaps": [1.0]}}, "electrode_gaps"),
    ],
)
def test_what_does_not_belong_together_is_refused(tables, words):
    with pytest.raises(HrgError, match=words):
        run(**tables)


def test_the_slow_model_has_no_samples_for_a_board():
    with pytest.raises(HrgError, match="--model fast"):
        run("slow", control=FORCED, electronics={})
    with pytest.raises(HrgError, match="--model fast"):
        run("slow", noise={"temperature_k": 300.0, "effective_mass_kg": 1e-3})


def test_the_example_file_runs():
    config = tomllib.loads((Path(__file__).parents[3] / "configs" / "electronics.toml").read_text())
    config["recording"]["duration_s"] = 4.0
    record = collect(simulate(config))
    assert record.status == "valid"
    assert np.abs(record.truth_main_amplitude[200:] - 1).max() < 0.01
