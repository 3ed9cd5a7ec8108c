"""Several wrong runs against one law: mistakes are each run's own, and follow neither the rate nor
the temperature nor the amplitude of the runs; what does is physics, though no catalogue holds it.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ..search.inquiry import STATED
from ..search.remainder import select_terms
from ..thresholds import SIGNIFICANT


def is_one_law(before: ExtendedFit, left: float, numbers: int, price: float) -> bool:
    """Whether one open term beside the runs as they are serves as well as mistakes of several runs.

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
    law = select_terms(before, STATED, 1, SIGNIFICANT, by_run=False)
    if not law.terms:
        return False
    own = law.chi2 / law.fit.dof
    noise = max(1.0, min(left, own))
    each = float(np.log(len(before.residual))) + price
    return own * before.dof / noise + law.rank * each < left * before.dof / noise + numbers * each
