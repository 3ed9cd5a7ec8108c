"""Gyros drawn at random whose loops act on a board: converters, a window read and held, a delay, a
phase loop of 1 Hz."""

import numpy as np

FREQUENCY_HZ, PERIODS_PER_UPDATE = 5000.0, 16
AMPLITUDE_GAIN_1_S, QUADRATURE_GAIN_1_S = 5.0, 10.0
SAMPLE_RATE_HZ = 21000.0


def draw_gyro(seed):
    """Device and board of one gyro of a lot; `seed` a sequence that names the lot and the gyro."""
    draw = np.random.default_rng(seed)
    device = {
        "frequency_hz": FREQUENCY_HZ,
        "time_constant_s": float(draw.uniform(3, 6)),
        "damping_split": float(draw.uniform(0.01, 0.03)),
        "damping_axis_rad": float(draw.uniform(0, np.pi / 2)),
        "frequency_split_rad_s": float(draw.uniform(0.0, 0.02)),
        "stiffness_axis_rad": float(draw.uniform(0, np.pi / 2)),
        "scale_factor": float(draw.uniform(0.5, 0.6)),
    }
    board = {
        "periods_per_update": PERIODS_PER_UPDATE,
        "delay_periods": float(draw.integers(0, 60)),
        "drive_bits": 16,
        "drive_full_scale": 4.0,
        "phase_loop_hz": 1.0,
    }
    return device, board


def configure_runs(device, board, rates, gyro_id, duration_s=10.0, **recording):
    """A simulation file's tables: forced runs at the rates, noise of the converters and of heat."""
    return {
        "device": device,
        "electronics": board,
        "control": {
            "mode": "forced",
            "amplitude_gain_1_s": AMPLITUDE_GAIN_1_S,
            "quadrature_loop": "finite",
            "quadrature_gain_1_s": QUADRATURE_GAIN_1_S,
        },
        "readout": {"noise": 3e-3, "adc_bits": 16},
        "noise": {"temperature_k": 300.0, "effective_mass_kg": 1e-3, "metres_per_unit": 1e-6},
        "recording": {
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "duration_s": duration_s,
            "gyro_id": gyro_id,
            **recording,
        },
        "run": [{"run_id": f"R{r:g}", "environment": {"rate_rad_s": r}} for r in rates],
    }
