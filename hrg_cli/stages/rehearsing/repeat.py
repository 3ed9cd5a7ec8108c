"""A twin's programme run again with other noise: raw samples, demodulate, estimate and the result's
own stage.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

from ... import settings as checking
from ...effects.effect import no_term
from ...errors import HrgError
from ...records import Diagnosis, Record, Wave, collect
from ..calibrate import calibrate
from ..demodulate import demodulate
from ..diagnose import diagnose
from ..estimate import estimate
from ..identify import identify
from ..simulate import simulate_run
from ..simulation_file import list_runs
from .channel_shares import add_noise
from .rehearsed_figures import Rehearsed, compare_figures
from .twin import Twin
from .twin_diagnosis import list_causes
from .twin_effects import make_effects

STREAMS = 1_000_003
"""Rehearsal k of a seed draws from the stream seed·STREAMS + k."""
MOST_NODES = 100_000
"""Of a run's motion, some 20 MB, up to which it is kept for the next rehearsal: its noise alone is
another."""
STAGES: Mapping[str, Callable[..., Any]] = {
    "identify": identify,
    "calibrate": calibrate,
    "diagnose": diagnose,
}
"""The stages whose results are rehearsed."""
Work = tuple[Twin, int]


def rehearse_once(work: Work) -> Rehearsed:
    """One rehearsal: the twin's runs through raw samples, demodulate, estimate and the result's
    stage.

    Parameters
    ----------
    work
        The twin, and the seed of this rehearsal's noise.

    Returns
    -------
    Rehearsed
        Figures and status; "failed" with the reason where a stage could not go on.

    Examples
    --------
    >>> from hrg_cli import identify
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.repeat import rehearse_once
    >>> from hrg_cli.stages.rehearsing.twin import make_twin
    >>> run = draw_input(rate_rad_s=6.0)
    >>> found = rehearse_once((make_twin(identify([run.wave]), [run], {}), 1))
    >>> found.status != "failed", abs(found.figures["scale_factor"].compute_t()) < 5
    (True, True)
    """
    twin, seed = work
    try:
        record = _repeat_stage(twin, seed)
    except HrgError as error:
        return Rehearsed(reason=str(error))
    return Rehearsed(
        compare_figures(record, twin),
        record.status,
        record.status_reasons[0] if record.status_reasons else "",
        tuple(list_causes(record)) if isinstance(record, Diagnosis) else (),
    )


def _repeat_stage(twin: Twin, seed: int) -> Record:
    """The result of a twin's own stage on its runs, and on the resonator files that were made
    again."""
    waves = [make_wave(twin, number, seed) for number in range(len(twin.runs))]
    stage = STAGES[twin.stage]
    beside = [
        _repeat_stage(one, seed + number * STREAMS**2)
        for number, one in enumerate(twin.resonators, start=1)
    ]
    given = {"resonator": beside} if beside else {}
    record: Record = stage(waves, **given, **checking.check_settings(stage, twin.settings))
    return record


def make_wave(twin: Twin, number: int, seed: int) -> Wave:
    """A run of the twin as the chain sees it.

    Parameters
    ----------
    twin
        That is simulated.
    number
        Of the run, from 0.
    seed
        Of its noise.

    Returns
    -------
    Wave
        With the measured run's name and without the logs that it lacks.

    Examples
    --------
    >>> from hrg_cli import identify
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.repeat import make_wave
    >>> from hrg_cli.stages.rehearsing.twin import make_twin
    >>> run = draw_input()
    >>> wave = make_wave(make_twin(identify([run.wave]), [run], {}), 0, 1)
    >>> len(wave), wave.run_id == run.wave.run_id
    (50, True)
    """
    run, config = twin.runs[number], dict(twin.config)
    extra = make_effects(twin, number, seed)
    model: Literal["fast", "slow"] = "slow" if any(e.slow is not no_term for e in extra) else "fast"
    config["effects"] = {**config.get("effects", {}), **{effect.name: {} for effect in extra}}
    alike, more = run.channels
    readout = config["run"][number]["readout"]
    quiet = {**config["run"][number], "readout": {**readout, "noise": alike * readout["noise"]}}
    (settings,) = (one for one in list_runs({**config, "run": [quiet]}) if one.run_id == run.name)
    paths = twin.motions.setdefault(number, [])
    recording = collect(simulate_run(settings, extra, model=model, seed=seed, followed=paths))
    recording = add_noise(recording, readout["noise"], more, seed)
    if sum(len(path.time_s) for path in paths) > MOST_NODES:
        del twin.motions[number]
    periods = collect(demodulate(recording, **checking.check_settings(demodulate, run.demodulate)))
    wave = collect(estimate(periods, **checking.check_settings(estimate, run.estimate)))
    return wave.replace(**run.carried, **dict.fromkeys(run.missing))
