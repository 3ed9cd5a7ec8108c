"""Why effects do nothing in a recording, in words."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects.effect import IN_FREE_RUNS, INSTANT, Effect, Values
from ...records import Recording
from .motion import Change, Hidden


def explain_nothing(
    recording: Recording, hidden: Sequence[Hidden], change: Change | None = None
) -> str:
    """What each effect misses in a recording that it does not change.

    Parameters
    ----------
    recording
        The run.
    hidden
        Effects with all their parameters.
    change
        Of the run's motion; None where no effect moves it.

    Returns
    -------
    str
        A clause an effect.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.injection.nothing_done import explain_nothing
    >>> run = Recording(c=np.zeros(5), s=np.ones(5), sample_rate_hz=10.0, mode="free")
    >>> gain, step = find("drive_gain"), find("gain_step")
    >>> explain_nothing(run, [(gain, gain.values()), (step, step.values({"time_s": 9.0}))])
    'drive_gain: the run has no drive; gain_step: time_s = 9 is not within the run, 0 to 0.4 s'
    """
    return "; ".join(
        f"{effect.name}: {_explain(recording, effect, p, change)}" for effect, p in hidden
    )


def _explain(recording: Recording, effect: Effect, p: Values, change: Change | None) -> str:
    first, last = (float(recording.times(k, k + 1)[0]) for k in (0, len(recording.c) - 1))
    if INSTANT in p and not first < p[INSTANT] < last:
        return f"{INSTANT} = {p[INSTANT]:g} is not within the run, {first:g} to {last:g} s"
    if effect.slow_jump is not None and change is not None:
        # what jumps goes on from the wave as measured, which has windows on both sides there
        first, last = change.span_s
        if not first < p[INSTANT] < last:
            return (
                f"{INSTANT} = {p[INSTANT]:g} is not within the windows that show the motion,"
                f" {first:g} to {last:g} s of the run"
            )
    if effect.whole_samples:
        return "no sample lies within the time that it takes; make that longer than a sample"
    if "drive" in effect.shown_by:
        if _moves(recording, "drive_main") or _moves(recording, "drive_quadrature"):
            return "the run's drive is none that it acts on"
        without = f", without which it acts with {IN_FREE_RUNS} = 1" if IN_FREE_RUNS in p else ""
        return f"the run has no drive{without}"
    of_temperature = effect.follows_temperature or "temperature" in effect.needs
    if of_temperature and np.ptp(_read_log(recording, "temperature_degc")) == 0:
        return "the run's temperature is constant"
    if "rate steps" in effect.shown_by and not _moves(recording, "rate_rad_s"):
        return "the run is at rest"
    beside = effect.beside and f", and nothing without {effect.beside}"
    return f"it changes no sample by as much as rounding does{beside}"


def _moves(recording: Recording, log: str) -> bool:
    return bool(np.any(_read_log(recording, log) != 0))


def _read_log(recording: Recording, log: str) -> np.ndarray:
    """The log's finite values; one 0 where there is none."""
    values = getattr(recording, log)
    kept = np.zeros(0) if values is None else np.asarray(values, float)
    kept = kept[np.isfinite(kept)]
    return kept if len(kept) else np.zeros(1)
