"""Rows of long runs are means of many windows, also of a frequency that moves: what is held against
single windows, or written as a start, is no mean."""

import numpy as np
from synthetic_waves import as_wave, envelope

from hrg_cli.effects import find
from hrg_cli.physics.resonator import Mechanics
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
    t = (np.arange(WINDOWS) + 0.5) * WINDOW_S
    bend = np.pi * DEVICE.frequency_hz * AGEING_1_S * t**2
    u = envelope(DEVICE, 0.3, 0.0, t, ratio=0.1, phase=0.2) * np.exp(1j * bend)[:, None]
    wave = as_wave(
        u, t, NOISE, DEVICE, np.random.default_rng(3), rate=0 * t, run_id="long",
        temperature_degc=np.full(WINDOWS, 24.0),
    )  # fmt: skip
    return wave.replace(signal_std=np.full(WINDOWS, NOISE))  # known, not found window by window


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
