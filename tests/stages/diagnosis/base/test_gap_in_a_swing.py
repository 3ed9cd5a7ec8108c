"""What a log says of the table and the temperature goes on where windows are lost."""

import numpy as np
from synthetic_waves import programme

from hrg_cli.stages.diagnosis.base.data import prepare
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base


def swing(t):
    return 2 * np.sin(3 * t) + 1


def with_gap(seed):
    """Three runs, of which a swinging one has lost 0.4 s, a fifth of a swing."""
    swinging, *others = programme(
        std=1e-3, seed=seed, window=1e-3, runs=[(0.1, swing), (0.5, -2.0), (0.9, 0.0)]
    )
    flags = np.zeros(len(swinging), "u1")
    flags[700:1100] = 2
    return [swinging.replace(flags=flags), *others]


def test_a_gap_in_a_swing_leaves_noise():
    """The table was taken to go straight on from the gap's one end to the other: χ² 1.9, and a
    knock of 42 σ named for it."""
    fit = fit_base(with_gap(8), scale_factor=None, blocks=300, free_phase=False)
    assert fit.chi2 / fit.dof < 1 + 4 * np.sqrt(2 / fit.dof)


def test_empty_rows_stand_where_the_logs_say():
    waves = with_gap(8)
    warm = [25 + np.sin(3 * wave.time_s) for wave in waves]
    waves = [w.replace(temperature_degc=degc) for w, degc in zip(waves, warm, strict=True)]
    series = prepare(waves, None, 300)[0]
    t = series.time_s[0]
    lost = (series.weight[0] == 0) & (t > 0.7) & (t < 1.1)
    turned = 2 / 3 * (1 - np.cos(3 * t)) + t
    assert np.count_nonzero(lost) > 10
    assert np.allclose(series.table_angle_rad[0][lost] - turned[lost], 0, atol=2e-3)
    assert np.allclose(series.temperature_degc[0][lost], 25 + np.sin(3 * t[lost]), atol=2e-3)
