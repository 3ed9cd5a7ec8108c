"""The temperature's course in the file that a diagnosis writes."""

from dataclasses import replace

import numpy as np
from synthetic_waves import GYRO, programme

from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.extended.written_run import Way, run_table


def test_a_slow_swing_of_the_temperature_is_written_with_its_integral():
    """Rows a hundredth of the swing apart: chords between their means missed its integral by a part
    in 1300, which turned a phase by several σ of quiet windows ("partly explained")."""
    swing = 2 * np.pi / 500

    def warm(t):
        return 25 + 2 * np.sin(swing * t)

    waves = [
        wave.replace(temperature_degc=warm(wave.time_s))
        for wave in programme(
            replace(GYRO, frequency_hz=50.0, damping_rate_1_s=1e-4, frequency_split_rad_s=1e-4),
            runs=((0.1, 0.0), (0.6, 1e-3)),
            seconds=4000.0,
            window=1.0,
        )
    ]
    fit = fit_base(waves, scale_factor=None, blocks=320, free_phase=False)
    table = run_table(fit, [0], waves[0], waves[0], 400.0, np.zeros(5), Way())
    course = table["environment"]["temperature"]
    t = np.linspace(0.0, 4000.0, 400_001)
    turned = np.cumsum(np.interp(t, course["time_s"], course["temperature_degc"]) - warm(t)) * 0.01
    assert len(course["time_s"]) < 2 * fit.series.time_s.shape[1]
    assert np.ptp(turned) < 1e-4 * 2 / swing
