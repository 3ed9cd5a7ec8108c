"""A board whose commands step in time with the oscillation: their saw tooth has a part near 2ω, which
makes a slow force that no log holds (`drive/held_commands.py`)."""

import numpy as np
import pytest

from hrg_cli import collect, demodulate, estimate, simulate
from hrg_cli.fitting.causes.whitened_rows import flatten_rows
from hrg_cli.stages.diagnosis.base import joint_fit
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.drive.held_commands import PARTS, _moved

pytest.importorskip("numba")
SAMPLING_HZ, HOLD = 8000.0, 8
"""A board that reads for eight samples and holds its command for the next eight."""


def fitted(beat_rad_s, rates=(-2.0, 3.0), effects=None):
    """The base fit of two runs of a gyro of which 2ω is so far from the second harmonic of its board's
    steps."""
    hz = SAMPLING_HZ / HOLD - beat_rad_s / (4 * np.pi)
    config = {
        "device": {
            "frequency_hz": hz, "damping_rate_1_s": 0.3, "damping_split": 0.03, "damping_axis_rad": 0.3,
            "frequency_split_rad_s": 0.1, "stiffness_axis_rad": 0.8, "scale_factor": 0.55,
        },
        "electronics": {"periods_per_update": 1, "phase_loop_hz": 5.0},
        "control": {"mode": "forced", "amplitude_gain_1_s": 5.0, "quadrature_loop": "finite", "quadrature_gain_1_s": 10.0},
        "readout": {"noise": 1e-5},
        "effects": effects or {},
        "recording": {"sample_rate_hz": SAMPLING_HZ, "duration_s": 4.0, "log_rate_hz": 100.0},
        "run": [{"run_id": f"R{r:g}", "environment": {"rate_rad_s": r}} for r in rates],
    }  # fmt: skip
    recordings = [collect(simulate(config, run=f"R{r:g}", seed=1)) for r in rates]
    waves = [collect(estimate(collect(demodulate(r, periods_per_window=20)))) for r in recordings]
    return fit_base(waves, scale_factor=None, blocks=120, free_phase=False)


BEAT = -6.0


@pytest.fixture(scope="module")
def blind():
    """The fit that asks for no steps."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(joint_fit, "find_likely_beats", lambda fit: [])
        return fitted(BEAT)


def test_steps_near_the_oscillation_make_the_force_that_averaging_gives(blind):
    """(j/2ω) f'* e^{j(Dt + β)}: of that size, whatever β in each run, and as much again from the frame
    that this board reads over one period; the steps are those of eight samples."""
    doings = flatten_rows(blind.series, blind.flow.whiten_read_out(_moved(blind, np.array([BEAT]))))
    steps = np.zeros((len(doings), 2 * PARTS))
    for k, (rows, _, _) in enumerate(blind.design.own):
        steps[rows, k * PARTS : (k + 1) * PARTS] = doings[rows]
    together = np.concatenate([steps, blind.design.to_matrix()], axis=1)
    size = np.linalg.lstsq(together, blind.residual, rcond=1e-9)[0][: 2 * PARTS].reshape(2, PARTS)
    cos, quarter_cos, read_cos, sin, quarter_sin, read_sin = size.T
    # e^{jβ}(A + j·jA) of cosine and sine
    held = np.hypot(cos + quarter_sin, quarter_cos - sin) / 2
    assert held == pytest.approx(1.0, abs=0.2)
    assert np.all(np.hypot(read_cos, read_sin) < 2)


def test_their_beat_is_found_and_leaves_noise(blind):
    assert blind.chi2 / blind.dof > 2.0
    fit = fitted(BEAT)
    assert abs(fit.series.held_beat_rad_s) == pytest.approx(abs(BEAT), abs=0.1)
    assert 0.7 < fit.chi2 / fit.dof < 1.1


def test_what_a_read_out_leaves_is_not_taken_for_steps():
    fit = fitted(60.0, effects={"gain_mismatch": {"gain": 2e-4}})
    assert fit.chi2 / fit.dof > 1.5
    assert fit.series.held_beat_rad_s is None
