"""Windows with clipped samples: those of a level that all runs share count, since clipping is one
of the causes; those of one run's own level are left out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....records import FLAG_CLIPPED, FLAG_GAP, Wave
from ..base.data import MOST
from ..thresholds import UNCLIPPED
from .odd_windows import find_channel_amplitudes


def count_common_clipping(waves: Sequence[Wave]) -> tuple[list[Wave], tuple[str, ...]]:
    """The runs with windows that are flagged as clipped alone made to count, where the level can be
    that of all runs.

    Where another run passes that level unharmed the amplifier or range was this run's own: no
    cause of all runs clips it, and its clipped windows would be blamed on one.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    tuple
        The runs, and a sentence on each whose clipped windows stay left out.

    Examples
    --------
    One run clipped at half of what the others reach:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.own_clipping import count_common_clipping
    >>> waves = draw_waves()
    >>> low = waves[0].replace(
    ...     main_amplitude=0.5 * waves[0].main_amplitude, flags=np.ones(50, "u1")
    ... )
    >>> taken, told = count_common_clipping([low, *waves[1:]])
    >>> int(taken[0].flags.sum()), told[0].split(": ")[1][:44]
    (100, '50 windows are clipped at a level that other')
    """
    clipped = [np.asarray(w.flags) & FLAG_CLIPPED != 0 for w in waves]
    if not any(mask.any() for mask in clipped):
        return list(waves), ()
    free = [_find_largest_unclipped(wave) for wave in waves]
    taken, told = [], []
    for k, (wave, mask) in enumerate(zip(waves, clipped, strict=True)):
        level = float(np.min(find_channel_amplitudes(wave)[mask], initial=np.inf))
        passed = max([*free[:k], *free[k + 1 :]], default=0.0)
        if passed > UNCLIPPED * level:
            told.append(
                f"{wave.run_id}: {int(mask.sum())} windows are clipped at a level that other runs"
                f" pass unharmed ({level:.4g} against {passed:.4g}) and left out; look at this"
                " run's amplifier and range"
            )
            # as good as missing: they tell nothing of a level that all runs would share
            flags = np.where(mask, FLAG_GAP, wave.flags)
        else:
            flags = np.where(np.asarray(wave.flags) == FLAG_CLIPPED, 0, wave.flags)
        taken.append(wave.replace(flags=flags.astype(wave.flags.dtype)))
    return taken, tuple(told)


def count_blocks(blocks: int, waves: Sequence[Wave], taken: Sequence[Wave]) -> int:
    """Fewest averaged rows a run: the windows' own, as far as a fit goes, where clipped ones count.

    What a level takes of a channel goes with the depth below its top to the power 3/2: of the mean
    of a row's windows it takes less than the mean of what it takes of each, nothing where that mean
    lies below it.

    Parameters
    ----------
    blocks
        That were asked for.
    waves
        Of the runs, as they came.
    taken
        Of the same runs, with those windows made to count that a common level clips.

    Returns
    -------
    int
        The same where no clipped window counts.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.own_clipping import count_blocks
    >>> waves = draw_waves()
    >>> clipped = [waves[0].replace(flags=np.eye(1, 50, dtype="u1")[0]), *waves[1:]]
    >>> count_blocks(120, waves, waves), count_blocks(120, clipped, waves)
    (120, 1500)
    """
    count = any(
        np.any((np.asarray(before.flags) == FLAG_CLIPPED) & (np.asarray(after.flags) == 0))
        for before, after in zip(waves, taken, strict=True)
    )
    return MOST if count else blocks


def _find_largest_unclipped(wave: Wave) -> float:
    """The largest amplitude of either channel that a run shows in windows that nothing flags."""
    return float(np.max(find_channel_amplitudes(wave)[wave.good()], initial=0.0))
