"""Wrong runs against one law: mistakes are each run's own, and follow neither the rate nor the
temperature nor the amplitude of the runs; what does is physics, though no catalogue holds it.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ..search.inquiry import STATED
from ..search.remainder import select_terms
from ..thresholds import CLEARLY, SIGNIFICANT


def is_one_law(
    before: ExtendedFit,
    left: float,
    numbers: int,
    price: float,
    margin: float = 0.0,
    terms: int = 1,
    others: ExtendedFit | None = None,
) -> bool:
    """Whether one open term beside the runs as they are serves as well as the mistakes of some.

    Parameters
    ----------
    before
        The fit of the runs as they are.
    left
        χ² per degree of freedom once the mistakes are undone.
    numbers
        Free in the mistakes.
    price
        Δ(χ² + k ln N), at the noise that is left, of one number.
    margin
        By how much the open term must be the better one.
    terms
        That it may take: what bends about another place than the runs' mean has a slope there.
    others
        The fit of the runs that are not doubted, whose causes a law has to leave as they are:
        what stands in their place is none beside them.

    Returns
    -------
    bool
        False where no open term stands out.

    Examples
    --------
    Runs that agree follow no law:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.suspects.laws import is_one_law
    >>> is_one_law(draw_fit(), left=1.0, numbers=1, price=20.0)
    False
    """
    # what stands otherwise in every run is no law
    law = select_terms(before, STATED, terms, SIGNIFICANT, by_run=False)
    if not law.terms or (others is not None and _denies_causes(law.fit, others)):
        return False
    own = law.chi2 / law.fit.dof
    noise = max(1.0, min(left, own))
    each = float(np.log(len(before.residual))) + price
    of_law, of_mistakes = (
        excess * before.dof / noise + count * each
        for excess, count in ((own, law.rank), (left, numbers))
    )
    return of_law + margin < of_mistakes


def _denies_causes(fit: ExtendedFit, others: ExtendedFit) -> bool:
    """Whether a fit has a cause of another size than other runs show it to have."""
    for effect, _ in others.point.active:
        for one in effect.fitted():
            sizes = [run.values(effect.name)[one.name] for run in (fit, others)]
            stds = [run.parameter_std(effect.name, one.name) for run in (fit, others)]
            if (sizes[1] - sizes[0]) ** 2 > CLEARLY * (stds[0] ** 2 + stds[1] ** 2):
                return True
    return False
