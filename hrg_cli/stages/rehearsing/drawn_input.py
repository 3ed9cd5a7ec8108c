"""A measured run drawn by simulation, for examples and trials by hand."""

from __future__ import annotations

from ...records import collect
from ..demodulate import demodulate
from ..estimate import estimate
from ..simulate import simulate
from .twin_run import Measured

SAMPLE_RATE_HZ = 2000.0


def draw_input(rate_rad_s: float = 0.0, seed: int = 0) -> Measured:
    """One second of a run-down of 500 Hz and ν = 0.5 1/s as the input of a result.

    Parameters
    ----------
    rate_rad_s
        Ω [rad/s].
    seed
        Of the samples' noise, 10⁻³ of the amplitude.

    Returns
    -------
    Measured
        Its wave of 50 windows, 20 ms each, with how it was made.

    Examples
    --------
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> run = draw_input(rate_rad_s=6.0)
    >>> len(run.wave), run.sample_rate_hz, round(float(run.wave.rate_rad_s[0]), 6)
    (50, 2000.0, 6.0)
    """
    config = {
        "device": {"frequency_hz": 500.0, "time_constant_s": 2.0},
        "readout": {"noise": 1e-3},
        "environment": {"rate_rad_s": rate_rad_s},
        "recording": {"sample_rate_hz": SAMPLE_RATE_HZ, "duration_s": 1.0},
    }
    periods = demodulate(collect(simulate(config, model="slow", seed=seed)), periods_per_window=10)
    wave = collect(estimate(collect(periods)))
    return Measured(wave, SAMPLE_RATE_HZ, demodulate={"periods_per_window": 10.0})
