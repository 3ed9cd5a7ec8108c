"""The phase of the wave followed sample by sample, at any sampling rate above twice the
frequency."""

import numpy as np
import pytest

from hrg_cli.effects.effect import follow_phase
from hrg_cli.physics import ellipse


@pytest.mark.parametrize("samples_a_period", (2.2, 3.79, 8.02, 40.0))
def test_the_phase_is_continuous_through_blocks_and_turns_of_the_wave(samples_a_period):
    n = np.arange(9000)
    angle, phase = 0.4 + 3e-4 * n, 1.1 - 2e-4 * n  # two and a half half-turns of the wave
    u = ellipse.compute_envelopes(np.full(len(n), 1.0), np.full(len(n), 0.05), angle, phase)
    w = u * np.exp(2j * np.pi * n / samples_a_period)[:, None]
    last = []
    found = np.concatenate([follow_phase(part, last) for part in np.split(w, (1, 5, 4000, 4001))])
    assert np.exp(1j * (found - phase - 2 * np.pi * n / samples_a_period)) == pytest.approx(
        1, abs=1e-6
    )
