"""Diagnosis, places: before which row of which run something may have struck, beside a fit.

What strikes at an instant is seen in all that follows and not only in the rows next to it, which
`effects.envelope_jumps` looks at: from there on the run moves as from another start, u(t) = Φ(t, 0)
u₀ with another u₀. With a run's own columns S_i of row i (those of its start; of a read-out, what
it does from the start on), what happens before row k has the columns S_i of i ≥ k and none before.
Beside the model's basis Q and with the residual r perpendicular to it
    S⊥ᵀ S⊥ = Σ S_iᵀ S_i − Bᵀ B,   B = Σ Q_iᵀ S_i,   S⊥ᵀ r = Σ S_iᵀ r_i,   sums over i ≥ k,
so that all rows of a run cost as much as one. Where the chance, for all rows, is small the cause is
scored as any other. A final model beside which a run still moves on as from another start is none,
whatever it was that struck.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....effects.effect import INSTANT, RUN, Values, no_term, same_signal
from ....effects.envelope_jumps import FEWEST
from ....fitting.causes import evidence
from ....fitting.causes.extended_fit import ExtendedFit
from ..thresholds import SIGNIFICANT
from .variants import Variant

Array = np.ndarray
START = slice(0, 4)
"""Columns of a run's start among its own."""
PHASES = 4
"""Parts of half a period at which a jump of the motion is tried: it is a velocity at one phase of
the oscillation, which is fitted from the nearest."""


@dataclass(frozen=True)
class StrikePlace:
    """Before which row of which run, that row's time, by how much χ² falls with what happens there,
    and the chance, for all rows of all runs, of as much."""

    run: int
    row: int
    time_s: float
    gain: float
    chance: float


def place_cause(variant: Variant, fit: ExtendedFit) -> list[Variant]:
    """A cause that may strike anywhere, at the place that stands out of a fit's residual, at some
    phases of the oscillation; none where no place does.

    Parameters
    ----------
    variant
        Of the cause that strikes, its instant still to be found.
    fit
        Beside which it is looked for.

    Returns
    -------
    list of Variant
        The cause at the place, one of each phase.

    Examples
    --------
    The second run was knocked at 0.5 s:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_knocked_fit
    >>> from hrg_cli.stages.diagnosis.fits.places import place_cause
    >>> from hrg_cli.stages.diagnosis.fits.variants import list_variants
    >>> *_, anywhere = list_variants([find("momentum_kick")], draw_knocked_fit())
    >>> placed = place_cause(anywhere, draw_knocked_fit())
    >>> [(one.values["run"], round(one.values["time_s"], 4)) for one in placed[:2]]
    [(1.0, 0.4998), (1.0, 0.5)]
    """
    series, effect = fit.series, variant.effect
    place: StrikePlace | None = fit.recall(("place", effect.name), lambda: _place(variant, fit))
    if place is None:
        return []
    t = _times(fit, place.run)
    at = {
        INSTANT: float(t[place.row - 1] + t[place.row]) / 2,
        RUN: float(series.numbers[place.run]),
    }
    step = 1 / series.reference_frequency_hz / (2 * PHASES)
    shifts = step * np.arange(PHASES if effect.slow_jump is not None else 1)
    return [
        replace(
            variant,
            values={**variant.values, **at, INSTANT: at[INSTANT] + float(shift)},
            anywhere=False,
        )
        for shift in shifts
    ]


def find_another_start(fit: ExtendedFit, slow: float) -> StrikePlace | None:
    """Where a run moves on as from another start with the least chance; None where all have too few
    rows.

    Parameters
    ----------
    fit
        Of the runs.
    slow
        Variance of the noise over the stated one.

    Returns
    -------
    StrikePlace or None
        Its chance is that for all rows of all runs.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_knocked_fit
    >>> from hrg_cli.stages.diagnosis.fits.places import find_another_start
    >>> knocked = find_another_start(draw_knocked_fit(), slow=1.0)
    >>> knocked.run, knocked.row, bool(knocked.chance < 1e-9)
    (1, 25, True)
    >>> bool(find_another_start(draw_fit(), slow=1.0).chance > 0.05)
    True
    """
    found = [
        _clearest(own[:, START], fit, run, slow) for run, (_, _, own) in enumerate(fit.design.own)
    ]
    return min((one for one in found if one), key=lambda one: (one.chance, -one.gain), default=None)


def find_place_beside_strike(values: Values, fit: ExtendedFit, slow: float) -> StrikePlace | None:
    """The same at the row before which a cause of the fit strikes, which may not be all that struck
    there.

    The chance is that row's alone. None where the cause is of every run.

    Parameters
    ----------
    values
        Of the cause's parameters, its instant and its run.
    fit
        With that cause.
    slow
        Variance of the noise over the stated one.

    Returns
    -------
    StrikePlace or None
        Of that row.

    Examples
    --------
    Beside a cause that strikes at 0.5 s and does nothing, the knock there is all left:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_knocked_fit
    >>> from hrg_cli.stages.diagnosis.fits.places import find_place_beside_strike
    >>> at = {"time_s": 0.5, "run": 1.0}
    >>> found = find_place_beside_strike(at, draw_knocked_fit(), slow=1.0)
    >>> found.row, bool(found.chance < 1e-9)
    (25, True)
    """
    if values[RUN] not in fit.series.numbers:
        return None
    run = int(np.flatnonzero(fit.series.numbers == values[RUN])[0])
    row = int(np.searchsorted(_times(fit, run), values[INSTANT]))
    return _clearest(fit.design.own[run][2][:, START], fit, run, slow, row)


def _times(fit: ExtendedFit, run: int) -> Array:
    """Times of a run's rows with weight."""
    return np.asarray(fit.series.time_s[run][fit.series.weight[run] > 0])


def _place(variant: Variant, fit: ExtendedFit) -> StrikePlace | None:
    """The clearest place of all runs, where chance makes none; None where the other runs together
    show as much: what strikes does so in one of them, what all of them show is no strike."""
    series = fit.series
    # what few codes leave of a run moves from row to row as though something had struck
    runs = [k for k, number in enumerate(series.numbers) if number not in series.coarse]
    found = [_clearest(_own_columns(variant, fit, run), fit, run) for run in runs]
    clear = [one for one in found if one is not None and one.chance < SIGNIFICANT]
    best = max(clear, key=lambda one: one.gain, default=None)
    if best is None or 2 * best.gain <= sum(one.gain for one in clear):
        return None
    return best


def _clearest(
    S: Array, fit: ExtendedFit, run: int, slow: float = 1.0, only: int | None = None
) -> StrikePlace | None:
    """The place of a run from which on the columns (4n, m) lower χ² least by chance; `only`: that
    row alone."""
    gain, rank = compute_place_gains(S, fit, run)
    p = evidence.compute_chances(gain / slow, rank)
    # nearer to an end another start of the few rows there does the same
    rows = np.arange(len(p))[FEWEST:-FEWEST]
    tried = float(np.count_nonzero(fit.series.weight))
    if only is not None:
        rows, tried = rows[rows == only], 1.0
    if len(rows) == 0:
        return None
    # a strong one's chance is too small for a number, at many rows: of these the one that gains
    # most
    row = int(rows[np.lexsort((-gain[rows], p[rows]))[0]])
    chance = evidence.correct_for_tries(float(p[row]), tried)
    return StrikePlace(run, row, float(_times(fit, run)[row]), float(gain[row]), chance)


def compute_place_gains(S: Array, fit: ExtendedFit, run: int) -> tuple[Array, Array]:
    """By how much χ² falls (n,), for how many parameters (n,), with the columns S (4n, m) of a run
    from each of its rows on.

    Parameters
    ----------
    S
        Of the cause's columns in the run (4n, m), over σ.
    fit
        Beside which it is looked for.
    run
        Its number.

    Returns
    -------
    tuple of ndarray
        (n,) each.

    Examples
    --------
    With another start from each row of the knocked run:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_knocked_fit
    >>> from hrg_cli.stages.diagnosis.fits.places import START, compute_place_gains
    >>> fit = draw_knocked_fit()
    >>> gain, numbers = compute_place_gains(fit.design.own[1][2][:, START], fit, run=1)
    >>> int(gain.argmax()), int(numbers[25]), bool(gain[25] > 200)
    (25, 4, True)
    """
    rows, own = fit.basis.own[run]
    Q = np.concatenate([own, fit.basis.shared[rows]], axis=1)
    left = fit.basis.project_out(fit.residual)[rows]
    by_row = (len(S) // 4, 4)
    S, Q = S.reshape(*by_row, -1), Q.reshape(*by_row, -1)
    size = np.sqrt(_from_row_on(np.sum(S**2, axis=1)))
    B = _from_row_on(np.einsum("niq,nim->nqm", Q, S))
    M = fit.basis.select_beside(run).T @ B
    beside = np.swapaxes(B, 1, 2) @ B - np.swapaxes(M, 1, 2) @ M
    square = _from_row_on(np.einsum("nij,nik->njk", S, S)) - beside
    along = _from_row_on(np.einsum("nim,ni->nm", S, left.reshape(by_row)))
    unit = np.where(size > 0, size, 1.0)
    return evidence.compute_gains(square / unit[:, :, None] / unit[:, None, :], along / unit)


def _from_row_on(values: Array) -> Array:
    """Sums over each row and all that follow."""
    return np.asarray(np.cumsum(values[::-1], axis=0)[::-1])


def _own_columns(variant: Variant, fit: ExtendedFit, run: int) -> Array:
    """What a cause that strikes before a run's first row may do to it, over σ, (4n, m)."""
    effect, series = variant.effect, fit.series
    rows, _, own = fit.design.own[run]
    moves = effect.slow is not no_term
    columns = [own[:, START]] if moves or effect.slow_jump is not None else []
    if moves or effect.slow_readout is not same_signal:
        t = series.time_s[run]
        before = {INSTANT: float(2 * t[0] - t.max()), RUN: float(series.numbers[run])}
        wanted = effect, {**variant.values, **before}, variant.steps
        columns.append(fit.find_sensitivities([wanted])[0][rows])
    return np.concatenate(columns, axis=1)
