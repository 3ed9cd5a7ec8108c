"""What the variants that predict alike, or better, differ by, in the error of the one that is
written.

The covariance of a variant holds if that variant is the gyro's. Of several that pass their checks
each has a weight by how it predicts data left out,

    w_i ∝ exp(−χ²_i/2),   Σ w_i = 1,

and about the coefficients c that are written the mixture of all has the second moment

    C = Σ w_i [C_i + (c_i − c)(c_i − c)ᵀ]

(Hoeting et al., Statistical Science 14, 1999, with the held-out χ² for the evidence: Geisser and
Eddy, JASA 74, 1979). Where one variant is clearly best, its weight is 1 and C its own. The values
stay those of one variant: its measured part, its checks and its figures are of its tables.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...fitting.tables.table_layout import TableLayout
from .choice import TriedVariant

Array = np.ndarray


def weigh_variants(tried: Sequence[TriedVariant]) -> dict[str, float]:
    """How much each variant counts, by the data left out.

    Parameters
    ----------
    tried
        Variants of the same runs and folds.

    Returns
    -------
    dict
        Name -> weight, of those that were fitted to the runs and pass every check; their sum is 1.

    Examples
    --------
    A variant that predicts worse by 2 ln 3 of χ² counts a third as much; one that fails, nothing:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.variant_average import weigh_variants
    >>> own = Told(foreign=False)
    >>> tried = [
    ...     Told(name="table", fits=True, tried=own, held_out_chi2=1000.0 + 2 * np.log(3)),
    ...     Told(name="quadrature", fits=True, tried=own, held_out_chi2=1000.0),
    ...     Told(name="phase", fits=False, tried=own, held_out_chi2=900.0),
    ... ]
    >>> {name: round(weight, 6) for name, weight in weigh_variants(tried).items()}
    {'table': 0.25, 'quadrature': 0.75}
    """
    fitting = [one for one in tried if one.fits and not one.tried.foreign]
    if not fitting:
        return {}
    chi2 = np.array([one.held_out_chi2 for one in fitting])
    weights = np.exp(-(chi2 - chi2.min()) / 2)
    weights /= weights.sum()
    return {one.name: float(weight) for one, weight in zip(fitting, weights)}


def add_spread_of_variants(
    layout: TableLayout, answer: TriedVariant, tried: Sequence[TriedVariant]
) -> TriedVariant:
    """The answer with what the variants differ by in the covariance of its tables.

    Parameters
    ----------
    layout
        Of the tables and factors.
    answer
        The variant that is written.
    tried
        All variants of the same runs and folds, the answer among them.

    Returns
    -------
    TriedVariant
        With the same coefficients; as it is where it does not pass its checks, or its coefficients
        come from elsewhere and know what these runs do not.

    Examples
    --------
    Two variants of equal weight whose drifts are 2 apart, each known to 1: about either the square
    of the error is 1 + 2²/2:

    >>> from dataclasses import replace
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.normal_pieces import TableSolution
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.choice import TriedVariant
    >>> from hrg_cli.stages.calibration.guards import VariantSolution
    >>> from hrg_cli.stages.calibration.variant_average import add_spread_of_variants
    >>> def tell(name, drift):
    ...     found = TableSolution(np.array([drift, 0.55]), np.eye(2), 2.0)
    ...     return TriedVariant(name, VariantSolution(None, found, ()), (0, 0), (0, 0), (), (), 9.0)
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 0, 0)
    >>> tried = [tell("table", 0.0), tell("phase", 2.0)]
    >>> found = add_spread_of_variants(layout, tried[1], tried).tried.solution
    >>> found.coefficients.tolist(), found.covariance.tolist()
    ([2.0, 0.55], [[3.0, 0.0], [0.0, 1.0]])
    """
    weights, solution = weigh_variants(tried), answer.tried.solution
    if answer.name not in weights:
        return answer
    tables, rest = slice(layout.table_size), slice(layout.table_size, layout.size)
    mixed = weights[answer.name] * solution.covariance
    # the factors are one variant's own: what others say of the tables does not go with them
    mixed[rest, rest] = solution.covariance[rest, rest]
    for one in tried:
        if one.name in weights and one.name != answer.name:
            other = one.tried.solution
            step = (other.coefficients - solution.coefficients)[tables]
            moment = other.covariance[tables, tables] + np.outer(step, step)
            mixed[tables, tables] += weights[one.name] * moment
    mended = replace(answer.tried, solution=replace(solution, covariance=mixed))
    return replace(answer, tried=mended)
