"""The noise of a twin's samples, matched to what the measured windows state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .repeat import STREAMS, make_wave
from .twin import Twin
from .twin_run import Measured

MATCHED = (0.2, 5.0)
"""Factors by which the noise of the twin's samples is changed at most to match the measured
windows'."""
TRIAL_SAMPLES, MOST_TRIALS = 16_000, 8
"""Samples of a run's trials, whose windows' stated noise is matched, and trials at most: the median
over some hundred windows of few samples scatters by 2 % from draw to draw."""


def match_noise(twin: Twin, inputs: Sequence[Measured], seed: int) -> Twin:
    """The twin, its samples' noise scaled so that its windows state the noise of the measured ones.

    How a window's noise follows from a sample's depends on what else its fit holds; trials of each
    run tell, several of a short one.

    Parameters
    ----------
    twin
        Made of the inputs.
    inputs
        The measured runs, in its order.
    seed
        Of the trials.

    Returns
    -------
    Twin
        Each run's `readout.noise` changed by a factor within `MATCHED`.

    Examples
    --------
    >>> from hrg_cli import identify
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_noise import match_noise
    >>> from hrg_cli.stages.rehearsing.twin import make_twin
    >>> run = draw_input()
    >>> twin = match_noise(make_twin(identify([run.wave]), [run], {}), [run], 0)
    >>> round(twin.config["run"][0]["readout"]["noise"], 4)
    0.001
    """
    runs = []
    for number, (run, measured) in enumerate(zip(twin.config["run"], inputs, strict=True)):
        noise = run["readout"]["noise"]
        trials = int(np.clip(np.ceil(TRIAL_SAMPLES / twin.count_samples(run)), 1, MOST_TRIALS))
        found = float(
            np.mean(
                [
                    np.nanmedian(make_wave(twin, number, seed * STREAMS + k).signal_std)
                    for k in range(trials)
                ]
            )
        )
        wanted = float(np.nanmedian(measured.wave.signal_std))
        ratio = wanted / found if noise > 0 and found > 0 and wanted > 0 else 1.0
        runs.append(
            {**run, "readout": {**run["readout"], "noise": noise * float(np.clip(ratio, *MATCHED))}}
        )
    return replace(twin, config={**twin.config, "run": runs})
