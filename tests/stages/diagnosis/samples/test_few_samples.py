"""Windows of a period that hold five samples: their residual is the motion's, and their noise is known
from the scatter from window to window."""

import numpy as np
import pytest

from hrg_cli import Recording, collect, demodulate, estimate, identify, simulate
from hrg_cli.stages.diagnose import diagnose, summarise

FREQUENCY_HZ, QUALITY = 1.009, 199.0


def programme(samples_a_period, noise):
    """Five clean runs of sixty periods of a slow gyro that decays by 1.6 % a period."""
    damping = np.pi * FREQUENCY_HZ / QUALITY
    return {
        "device": {
            "frequency_hz": FREQUENCY_HZ,
            "damping_rate_1_s": damping,
            "damping_split_1_s": 2e-4,
            "damping_axis_rad": 0.3,
            "frequency_split_rad_s": 2.3 * 2 * damping,
            "stiffness_axis_rad": 0.2,
            "scale_factor": 0.277,
        },
        "readout": {"noise": noise},
        "recording": {
            "sample_rate_hz": samples_a_period * FREQUENCY_HZ,
            "duration_s": 60 / FREQUENCY_HZ,
        },
        "run": [
            {
                "run_id": f"r{k}",
                "start": {"wave_angle_rad": 0.3 * k, "quadrature": 0.05, "amplitude": 1.0},
                "environment": {"rate_rad_s": rate},
            }
            for k, rate in enumerate((0.0, 0.05, -0.05, 0.1, -0.1))
        ],
    }


@pytest.mark.parametrize(
    ("samples_a_period", "noise"), [(4.95, 3.7e-4), (4.95, 3.7e-5), (3.94, 1e-4)]
)
def test_clean_gyros_are_clean(samples_a_period, noise):
    """Their noise came from a difference of nearly equal numbers, 0.3 to 90 times the samples' own:
    χ² up to 7, a knock of 8 σ, and `identify` suspect."""
    table = programme(samples_a_period, noise)
    waves = [
        collect(
            estimate(
                collect(
                    demodulate(
                        collect(simulate(table, run=run["run_id"], seed=3)), periods_per_window=1.0
                    )
                )
            )
        )
        for run in table["run"]
    ]
    stated = np.array([np.median(wave.signal_std) for wave in waves]) / noise
    # two of five samples make a coefficient: no less than that, and a third more for what is taken off
    assert np.all((stated > 0.5) & (stated < 1.5)), stated
    report = summarise(diagnose(waves))
    failed = [(c["name"], c["value"], c["limit"]) for c in report["checks"] if not c["passed"]]
    assert report["verdict"] == "adequate", failed
    assert identify(waves).status == "valid"


@pytest.mark.parametrize("periods_per_window", [1.0, 2.0])
def test_uneven_samples_of_a_moving_wave_state_their_noise(periods_per_window):
    """A split of 22 rad/s at noise of 1e-5, samples 0.3 of a step beside an even grid: windows hold the
    motion unequally, and its share in some was taken for noise, 5 to 11 times the samples' own."""
    frequency_hz, noise = 1000.0, 1e-5
    rng = np.random.default_rng(4)
    time = (np.arange(6000) + rng.uniform(-0.3, 0.3, 6000)) / (12 * frequency_hz)
    own = np.array([-2.0 + 22.4j, -2.0 - 22.4j])
    modes = np.array([[0.8, 0.3], [-0.3, 0.8]])
    envelope = np.exp(np.multiply.outer(time, own)) @ modes
    samples = (envelope * np.exp(2j * np.pi * frequency_hz * time)[:, None]).real
    samples += noise * rng.standard_normal(samples.shape)
    periods = collect(
        demodulate(
            Recording(
                c=samples[:, 0],
                s=samples[:, 1],
                time_s=time,
                sample_rate_hz=12 * frequency_hz,
                mode="free",
                readout="direct",
                mode_number=2,
                gyro_id="G",
                run_id="r",
            ),
            periods_per_window=periods_per_window,
        )
    )
    ideal = noise * np.sqrt(2 / (12 * periods_per_window))
    stated = np.median(periods.signals_std, axis=0) / ideal
    assert np.all((stated > 0.9) & (stated < 1.3)), stated
