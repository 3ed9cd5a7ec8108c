"""Runs cut where their logged rate steps: how far the table turned meanwhile the log does not tell
to the waves' noise, so that both sides are as good as two runs, each with a start of its own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...fitting.envelopes.base_freedom import choose_scale_factor
from ...fitting.samples.rate_log import restrict_to_log
from ...fitting.samples.rate_steps import find_steps
from ...records import Wave
from ..usable import LEAST_STRETCH, Usable

Array = np.ndarray
COLUMNS = ("time_s", "rate_rad_s", "wave_angle_rad", "wave_angle_rad_std", "flags", "iterations")
ROWS_AT_ONCE = 1 << 14
BLOCKS = 500
"""Means of a run's rows, at least half as many, among which steps are looked for."""


def cut_at_rate_steps(usable: Usable) -> Usable:
    """The runs, those whose logged rate steps as several.

    Parameters
    ----------
    usable
        The runs, each with one stretch of its rate log.

    Returns
    -------
    Usable
        With a note on each run that was cut.

    Examples
    --------
    A rate that turns round half-way:

    >>> import numpy as np
    >>> from hrg_cli.stages.identification.rate_cuts import cut_at_rate_steps
    >>> from hrg_cli.stages.planning.information import make_wave
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> from hrg_cli.stages.usable import Usable
    >>> (run,) = list_runs(
    ...     {
    ...         "device": {"frequency_hz": 5000.0, "quality_factor": 1e6},
    ...         "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ...         "readout": {"noise": 1e-3},
    ...     }
    ... )
    >>> wave = make_wave(run).replace(rate_rad_s=np.where(np.arange(1500) < 750, 0.5, -0.5))
    >>> [int(part.good().sum()) for part in cut_at_rate_steps(Usable([wave])).waves]
    [747, 747]
    """
    waves, notes = list[Wave](), list(usable.notes)
    for wave in usable.waves:
        parts = _list_parts(wave)
        if len(parts) < 2:
            waves.append(wave)
            continue
        waves += [restrict_to_log(wave, part) for part in parts]
        notes.append(
            f"run {wave.run_id or '?'}: its logged rate steps, and how far it turned meanwhile"
            f" is not known; its {len(parts)} parts are taken as runs of their own"
        )
    return replace(usable, waves=waves, notes=tuple(notes))


def _list_parts(wave: Wave) -> list[Array]:
    """Windows (n,) of each part between two steps that is long enough; none where there is no
    step."""
    if wave.rate_rad_s is None or len(wave) < 2 * LEAST_STRETCH:
        return []
    # a log may be coarser than the rows, so that its step takes many of them
    each = -(-len(wave) // BLOCKS)
    time, rate, std, good = _average_blocks(wave, each)
    known = np.isfinite(rate)
    if np.count_nonzero(known) < 2:
        return []
    rate = np.interp(time, time[known], rate[known])
    per_rad_s = choose_scale_factor(wave.mode_number) / wave.mode_number / max(std, 1e-300)
    steps = find_steps(rate, good > 0, per_rad_s * np.sqrt(each) * np.diff(time) / 2)
    parts, start, rows = list[Array](), 0, np.arange(len(wave))
    for first, last in [*steps, (len(time), 0)] if steps else []:
        if good[start:first].sum() >= LEAST_STRETCH:
            parts.append((rows >= start * each) & (rows < first * each))
        start = last + 2
    return parts


def _average_blocks(wave: Wave, each: int) -> tuple[Array, Array, float, Array]:
    """Of every `each` rows the mean time (b,), the mean rate (b,) that is logged, and how many are
    good (b,); beside them the rows' σ of the angle. Of a file a stretch of rows is held at once."""
    made = []
    for piece in wave.only(COLUMNS).blocks(max(each, ROWS_AT_ONCE // each * each)):
        starts = np.arange(0, len(piece), each)
        rate, good = np.asarray(piece.rate_rad_s, float), np.asarray(piece.good())
        known = np.isfinite(rate)
        values = [
            np.ones(len(piece)),
            np.asarray(piece.time_s, float),
            known,
            np.where(known, rate, 0.0),
            good & known,
            np.where(good, np.asarray(piece.wave_angle_rad_std, float) ** 2, 0.0),
            good,
        ]
        made.append(np.add.reduceat(np.array(values, float), starts, axis=1))
    rows, time, known, rate, used, variance, good = np.concatenate(made, axis=1)
    mean = np.divide(rate, known, out=np.full(len(rate), np.nan), where=known > 0)
    return time / rows, mean, float(np.sqrt(variance.sum() / max(good.sum(), 1.0))), used
