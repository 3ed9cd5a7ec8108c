"""Diagnosis, what causes that such runs hardly part from the base parameters may add to these
unnamed: they show the sum.

A force is known by its command alone. In driven runs a mismatch g of the forcers is a damping split
−gν/2, a common excess of both a damping −gν, a phase error of the quadrature's force a damping
split δωΔφ (PHYSICS C1, C3, C4, §2 (iii)): what such runs show is the sum, to a σ that says nothing
of the parts. Free runs beside them, and quadrature that moves under its own loop, tell the parts.
At one rate a constant matrix E of the read-out is the splits [E, L] (gauge theorem, PHYSICS §0): a
gain mismatch g is νδμ = KΩg. Other rates tell these parts; at one, the second order alone does.

A cause p that a typical size t of it would not make worth its price, t²|S⊥|² < WORTH + ln N with S⊥
its sensitivity off the model's, may therefore be there. Of each eigenvector of S⊥ᵀS⊥, eigenvalue λ,
in units of t, it is there by p with
    P(p | r) ∝ exp(pb − λp²/2)/(1 + p²),    b its part of S⊥ᵀr,
r the residual, in units of what the model leaves. The prior is Cauchy's, of median t: half of all
such causes are smaller, one in sixteen is ten times as large, and where the data ask for one of ten
times t at 2.4 σ it gives way to them, which a normal one does not. The middle of this density and
a quarter of the width of its middle 95 %, σ of a normal one, add up in square, and p moves the
coordinates by C Jᵀ S p.

One that would be named at its typical size may be there at a smaller one, and where the runs hardly
tell it from a coordinate that is enough: quiet driven runs know a frequency split to 4e-5 of it,
and a common excess of the forces, which is as much of it, to 1e-3. It counts where that width moves
a coordinate by more than `SHOWN_AS_SUM` times what the runs show that to.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.causes import scales
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.moves import move_coordinates
from ..fits.variants import Variant
from ..search.search_case import Case
from ..thresholds import MOST_TYPICAL, SHOWN_AS_SUM, WORTH

Array = np.ndarray
SUMMED = frozenset({"drive", "another rate"})
"""What runs must hold to show a cause whose sum with the base model all others show."""
MIDDLE_PART = (0.0228, 0.5, 0.9772)
"""Probabilities below −2σ, the middle and 2σ of a normal density."""
GRID = 1001
"""Places of a density, evenly spaced in arsinh."""


def estimate_moves_of_summed(case: Case) -> dict[str, Array]:
    """By how much the base model's coordinates may be moved by each cause of the drive, or of the
    read-out at one rate, that is not named and not excluded.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    dict
        By the cause's name, columns (7, k), whose squares add up to the mean square.

    Examples
    --------
    Runs at rates that differ, without a drive:

    >>> from hrg_cli.stages.diagnosis.closing.summed import estimate_moves_of_summed
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case
    >>> estimate_moves_of_summed(draw_case())
    {}
    """
    return find_moves_of_summed(case.search.final, case.inquiry.candidates)


def find_moves_of_summed(fit: ExtendedFit, candidates: Sequence[Variant]) -> dict[str, Array]:
    """The same of a fit and the causes that are looked for.

    Parameters
    ----------
    fit
        Of the runs.
    candidates
        All causes.

    Returns
    -------
    dict
        By the cause's name, columns (7, k); none of a cause that the fit holds.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.summed import find_moves_of_summed
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> find_moves_of_summed(draw_fit(), [])
    {}
    """
    active = {effect.name for effect, _ in fit.point.active}
    open_ones = [one for one in candidates if one.effect.name not in active]
    found = {
        one.effect.name: _moves(fit, one, of_drive="drive" in one.effect.shown_by)
        for one in open_ones
        if not SUMMED.isdisjoint(one.effect.shown_by)
    }
    return {name: moves for name, moves in found.items() if moves.any()}


def _moves(fit: ExtendedFit, variant: Variant, of_drive: bool) -> Array:
    """Columns (7, k) of one cause; none where it would have been named before it mattered."""
    # a difference step is a fixed part of the typical size in these runs' own units
    typical = np.array(list(variant.steps.values())) / scales.SMALL_PART
    misfit = max(fit.chi2 / fit.dof, 1.0) ** 0.5
    S = fit.find_sensitivities([variant.wanted])[0] * typical
    free = fit.basis.project_out(fit.basis.project_out(S)) / misfit
    hidden = np.sum(free**2, axis=0) < WORTH + np.log(len(fit.residual))
    unnoticed = _move_by_doubt(fit, S[:, hidden], free[:, hidden], misfit)
    small = _move_by_doubt(fit, S[:, ~hidden], free[:, ~hidden], misfit)
    both = np.concatenate([unnoticed, small], axis=1)
    shown = np.sqrt(np.diag(fit.coordinate_covariance()))
    if of_drive:
        return both if _matters(small, shown) else unnoticed
    # a read-out matters at one rate alone, and then by far
    return both if _matters(both, shown) else np.zeros((len(shown), 0))


def _matters(moves: Array, shown: Array) -> bool:
    """Whether the doubt in a cause moves a coordinate by far more than the runs show it to."""
    return bool(np.any(np.linalg.norm(moves[:, :-1], axis=1) > SHOWN_AS_SUM * shown))


def _move_by_doubt(fit: ExtendedFit, S: Array, free: Array, misfit: float) -> Array:
    """Columns (7, k + 1) of the widths and of the middle of causes whose sensitivities are S (N, k)
    per typical size, and off the model's `free`."""
    power, turn = np.linalg.eigh(free.T @ free)
    pull = turn.T @ (free.T @ fit.residual) / misfit
    # S is per typical size, so that the prior is alike in every direction
    likely = [size_doubt(max(one, 0.0), by) for one, by in zip(power, pull, strict=True)]
    middle, half = np.array(likely).reshape(-1, 2).T
    return move_coordinates(fit, S @ np.column_stack([turn * half, turn @ middle]))


def size_doubt(power: float, pull: float) -> tuple[float, float]:
    """How large a cause may be, in typical sizes, beside a Cauchy prior of one.

    Parameters
    ----------
    power
        λ: its χ² at its typical size.
    pull
        b: the data's pull at it, by which they alone would make it b/λ.

    Returns
    -------
    tuple of float
        Middle of the density, and a quarter of the width of its middle 95 %.

    Examples
    --------
    Of data that say nothing, that show none, and that ask for ten times as much at 2.4 σ:

    >>> from hrg_cli.stages.diagnosis.closing.summed import size_doubt
    >>> asked = (0.0, 0.0), (1e4, 0.0), (0.06, 0.6)
    >>> [tuple(abs(round(number, 1)) for number in size_doubt(*one)) for one in asked]
    [(0.0, 6.9), (0.0, 0.0), (2.8, 3.8)]
    """
    reach = np.arcsinh(MOST_TYPICAL)
    p = np.sinh(np.linspace(-reach, reach, GRID))
    if power > 0:  # as fine as the data's own σ where they are
        p = np.union1d(p, pull / power + np.linspace(-8, 8, GRID) / np.sqrt(power))
    exponent = pull * p - power * p**2 / 2 - np.log1p(p**2)
    density = np.exp(exponent - exponent.max())
    below = np.concatenate([[0.0], np.cumsum(np.diff(p) * (density[1:] + density[:-1]) / 2)])
    low, middle, high = np.interp(np.array(MIDDLE_PART) * below[-1], below, p)
    return float(middle), float(high - low) / 4
