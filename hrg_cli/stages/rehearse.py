"""rehearse: the programme behind a result, measured again on its simulated twin: are its errors the
errors it makes?

The twin has the result's own values for truth and the measured runs' starts, lengths, sampling,
windows, logs and noise; it goes through raw samples and the same stages with the same settings.
What comes out is held against what was put in: t = (estimate − truth)/σ.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import Diagnosis, Record
from .rehearsing.rehearsals import FEWEST, Rehearsal, summarise
from .rehearsing.rehearsed_figures import Rehearsed
from .rehearsing.repeat import STREAMS, Work, rehearse_once
from .rehearsing.twin import Twin, make_twin
from .rehearsing.twin_diagnosis import make_twin_of_diagnosis
from .rehearsing.twin_noise import match_noise
from .rehearsing.twin_physical import Identified
from .rehearsing.twin_run import Measured

Array = np.ndarray


def rehearse(
    truth: Record,
    inputs: Sequence[Measured],
    own_settings: Mapping[str, Any],
    share: Callable[[Sequence[Work]], Sequence[Rehearsed | None]] | None = None,
    identified: Sequence[Identified] = (),
    *,
    times: Annotated[int, Field(ge=2, le=100_000, description="rehearsals")] = 30,
    samples_a_period: Annotated[
        float | None,
        Field(
            gt=2.2,
            description=(
                "samples a period of the simulated recordings; none: as the measured ones, or 8"
            ),
        ),
    ] = None,
    most_samples: Annotated[
        float, Field(gt=0, description="pairs of samples that all rehearsals together may simulate")
    ] = 2e9,
    most_samples_a_run: Annotated[
        float, Field(gt=0, description="pairs of samples that one run may hold in memory")
    ] = 1e8,
    seed: Annotated[int, Field(ge=0, description="seed of the noise")] = 0,
) -> Rehearsal:
    """Rehearse a result: its programme measured again and again on a simulated twin, and what comes
    out held against what was put in.

    Of every figure t = (estimate − truth)/σ; a right σ leaves t with mean 0 and standard deviation
    1, and 68 % and 95 % of the truths within 1 and 1.96 σ.

    Parameters
    ----------
    truth
        The result: a resonator, a calibration or a diagnosis.
    inputs
        The runs that it was made of, each with its wave, sampling rate [Hz] and settings.
    own_settings
        Those of the stage that gave the result.
    share
        What does the work, in other processes for instance; one after the other where not given.
    identified
        The resonator files that tables of `--model physical` were made of, identified again too.

    Returns
    -------
    Rehearsal
        Of each figure the bias, the scatter and the coverage in units of its σ, and the verdict.

    Raises
    ------
    HrgError
        No input, no twin can be made, too much work, too few rehearsals succeeded.

    Examples
    --------
    >>> from hrg_cli import collect, demodulate, estimate, identify, settings, simulate
    >>> from hrg_cli.stages.rehearse import rehearse
    >>> from hrg_cli.stages.rehearsing.twin_run import Measured
    >>> config = {
    ...     "device": {"frequency_hz": 500.0, "time_constant_s": 2.0},
    ...     "readout": {"noise": 1e-3},
    ...     "recording": {"sample_rate_hz": 2000.0, "duration_s": 1.0},
    ... }
    >>> recording = collect(simulate(config, model="slow"))
    >>> wave = collect(estimate(collect(demodulate(recording, periods_per_window=10))))
    >>> run = Measured(wave, sample_rate_hz=2000.0, demodulate={"periods_per_window": 10.0})
    >>> told = rehearse(identify([wave]), [run], settings.check_settings(identify, {}), times=3)
    >>> frequency = told.to_json()["figures"][0]
    >>> frequency["name"], frequency["error_over_std_rms"] < 5
    ('frequency_hz', True)
    """
    if not inputs:
        raise HrgError(
            "there is no wave to rehearse with; name the wave files the result was made of"
        )
    twin = (
        make_twin_of_diagnosis(truth, inputs, own_settings, samples_a_period)
        if isinstance(truth, Diagnosis)
        else make_twin(truth, inputs, own_settings, samples_a_period, identified)
    )
    _need_affordable(twin, times, most_samples, most_samples_a_run)
    twin = match_noise(twin, inputs, seed)
    twin = replace(
        twin,
        resonators=[
            match_noise(beside, one.inputs, seed)
            for beside, one in zip(twin.resonators, identified, strict=True)
        ],
    )
    works = [(twin, seed * STREAMS + k) for k in range(times)]
    done = share(works) if share is not None else [rehearse_once(work) for work in works]
    return summarise(
        twin, [Rehearsed(reason="its process was killed") if one is None else one for one in done]
    )


def _need_affordable(twin: Twin, times: int, most: float, most_a_run: float) -> None:
    """HrgError: more samples than the limits, and what would fit."""
    if twin.longest > most_a_run:
        raise HrgError(
            f"its longest run has {twin.longest:.3g} pairs of samples, {most_a_run:.3g} fit into"
            " memory; sample the twin more coarsely with --set samples_a_period=4, or raise"
            " most_samples_a_run"
        )
    if times * twin.samples > most:
        fit = int(most // twin.samples)
        advice = (
            f"give --times {fit}"
            if fit >= FEWEST
            else "sample the twin more coarsely with --set samples_a_period=4"
        )
        raise HrgError(
            f"{times} rehearsals of {twin.samples:.3g} pairs of samples are more than {most:.3g};"
            f" {advice}, or raise --set most_samples"
        )
