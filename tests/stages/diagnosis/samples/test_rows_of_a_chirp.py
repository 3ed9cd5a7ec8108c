"""Rows of long runs are means of many windows, also of a frequency that moves: what is held against
single windows, or written as a start, is no mean."""

import numpy as np

from hrg_cli.effects import find
from hrg_cli.physics import ellipse
from hrg_cli.physics.resonator import Mechanics, build_generator, exponentiate
from hrg_cli.records import Wave
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.extended.written_run import Way, run_table
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.samples.tone_search import find_strongest_tone
from hrg_cli.stages.diagnosis.suspects.rivals import fit_nearest
from hrg_cli.stages.diagnosis.thresholds import GROSS

WINDOWS, WINDOW_S, NOISE, AGEING_1_S = 10_000, 0.004, 1e-5, 1.075e-6
DEVICE = Mechanics(5000.0, 0.033, 0.0013, 0.35, 0.0314, 0.9, 0.55)


def ageing_run() -> Wave:
    """Forty seconds whose frequency moves by 0.2 Hz: in a row of 0.33 s, the mean of 83 windows,
    the phase is 1.6e-4 rad ahead of that in its middle, where a window's own noise is 1e-5."""
    random = np.random.default_rng(3)
    t = (np.arange(WINDOWS) + 0.5) * WINDOW_S
    start = ellipse.compute_envelopes(
        np.array(1.0), np.array(0.1), np.array(0.3), np.array(0.2), mode_number=2
    )
    bend = np.pi * DEVICE.frequency_hz * AGEING_1_S * t**2
    u = exponentiate(build_generator(DEVICE, 0.0), t) @ start * np.exp(1j * bend)[:, None]
    u = u + NOISE * random.standard_normal((WINDOWS, 4)).view(complex)
    a_A, a_B, angle, phase = ellipse.find_wave(u)
    angle, phase = ellipse.unwrap(angle, phase)
    std, zero = np.full(WINDOWS, NOISE), np.zeros(WINDOWS)
    return Wave(
        time_s=t, main_amplitude=a_A, quadrature_amplitude=a_B, wave_angle_rad=angle,
        phase_rad=phase, carrier_phase_rad=zero, main_amplitude_std=std,
        quadrature_amplitude_std=std, wave_angle_rad_std=std, phase_rad_std=std,
        carrier_phase_rad_std=zero, residual_rms=zero, signal_std=std,
        iterations=np.zeros(WINDOWS, "i2"), flags=np.zeros(WINDOWS, "u1"),
        temperature_degc=np.full(WINDOWS, 24.0), rate_rad_s=zero,
        frequency_hz=np.full(WINDOWS, 5000.0), reference_frequency_hz=5000.0,
        window_s=WINDOW_S, mode="free", run_id="long",
    )  # fmt: skip


def test_a_frequency_that_moves_leaves_no_tones_beside_itself():
    """Rows held against windows were four tones at the frequencies that it passed, "partly
    explained" at χ² 3.7 after two minutes; the start as written was as far ahead as the rows."""
    wave = ageing_run()
    base = fit_base([wave], scale_factor=None, blocks=120, free_phase=False)
    fit = fit_nearest(base, list_variants([find("ageing")], base), GROSS)
    assert fit.series.time_s.shape == (1, 120)
    assert fit.chi2 / fit.dof < 1.5
    ((_, found),) = fit.point.active
    assert abs(found["frequency_1_s"] - AGEING_1_S) < 1e-11
    assert find_strongest_tone(fit, [wave]) is None
    table = run_table(fit, [0], wave, wave, 20_000.0, np.zeros(5), Way())
    assert abs(table["start"]["phase_rad"] - 0.2) < 1e-5
