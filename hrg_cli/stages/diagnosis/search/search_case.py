"""Diagnosis, the case: what the steps of a search pass on, each giving the next one a new one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.refits import compute_bic
from .damping_form import Form
from .inquiry import Inquiry
from .remainder import Remainder, search_rest
from .selection import Found, Search


@dataclass(frozen=True)
class Case:
    """The causes found, what they leave over (None: nothing), what is said of the runs'
    frequencies, a damping's better form, if any, and an open description that does better than
    the causes and not so much better that they give way to it, in words."""

    inquiry: Inquiry
    search: Search
    remainder: Remainder | None = None
    frequencies: Mapping[str, Any] = field(default_factory=dict)
    form: Form | None = None
    outdone: str = ""

    @property
    def criterion(self) -> float:
        """χ² + rank·ln N of the causes with the open terms beside them."""
        return compute_criterion(self.search.final, self.remainder)

    def give_up(self, cause: Found, fit: ExtendedFit) -> Case:
        """The case in which a cause is given up; `fit`: the fit without it, whose rest is sought
        again."""
        search = self.search.give_up(cause, fit, self.inquiry.candidates)
        rest = search_rest(fit, self.inquiry.noise)
        return replace(self, search=search, remainder=rest, outdone="")


def compute_criterion(fit: ExtendedFit, beside: Remainder | None) -> float:
    """χ² + rank·ln N of a fit with open terms beside it.

    Parameters
    ----------
    fit
        Of the runs.
    beside
        The open terms; None: there are none.

    Returns
    -------
    float
        Lower is better.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.search_case import compute_criterion
    >>> final = draw_found_case().search.final
    >>> compute_criterion(final, None) < compute_criterion(draw_mismatched_fit(), None) - 500
    True
    """
    if beside is None:
        return compute_bic(fit)
    rank = fit.basis.shape[1] + beside.rank
    return beside.chi2 + rank * float(np.log(len(fit.residual)))
