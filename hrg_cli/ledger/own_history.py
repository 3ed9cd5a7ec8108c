"""Whether a gyro is still what its own history says: a figure against all results that agreed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..reporting.figure_names import name_figure
from .series import FigureSeries

FAR_SIGMA = 5.0
"""A distance from the gyro's own history beyond which a result is in doubt: that of `check`."""


@dataclass(frozen=True)
class HistoryDistance:
    """The newest result less the mean of the earlier ones that agreed with each other, in σ of
    both; how many these are; and the time of processing since which no result agrees with them
    (None: the newest does)."""

    change: float
    sigma: float
    agreed: int
    since: str | None

    def describe(self, name: str) -> str:
        """The doubt in a sentence.

        Parameters
        ----------
        name
            Of the figure.

        Returns
        -------
        str
            What differs, since when, and what ends the doubt.

        Examples
        --------
        >>> from hrg_cli.ledger.own_history import HistoryDistance
        >>> said = HistoryDistance(2e-4, 23.0, 2, "2026-05-01T00:00:00Z").describe("scale_factor")
        >>> said.partition(", ")[0]
        'scale factor K is +23 σ from the mean of the 2 earlier results that agreed'
        """
        of = "the earlier result" if self.agreed == 1 else "the mean of the "
        of += "" if self.agreed == 1 else f"{self.agreed} earlier results that agreed"
        return (
            f"{name_figure(name)} is {self.sigma:+.3g} σ from {of}, since the one processed"
            f" {self.since}; {FAR_SIGMA:g} σ at most were expected; measure again, or for a known"
            f" change begin with it (--since {self.since})"
        )


def find_departure(series: FigureSeries) -> HistoryDistance | None:
    """How far the newest result of a gyro is from its history.

    The history begins with the first result, and a later one that agrees with the mean of those in
    it joins it. A changed gyro that is measured once more has the same change again: its results
    agree with each other and not with the history, however many there are. One that returns is in
    doubt no more.

    Parameters
    ----------
    series
        Of one gyro, in the order of time.

    Returns
    -------
    HistoryDistance or None
        None for fewer than two results, or where one has no σ.

    Examples
    --------
    A step at the third of four results, each of σ 0.1:

    >>> import numpy as np
    >>> from hrg_cli.ledger.own_history import find_departure
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.series import FigureSeries
    >>> entries = tuple(
    ...     Entry(str(day), "r.h5", "resonator", "SN-1", f"2026-01-0{day}", "valid")
    ...     for day in (1, 2, 3, 4)
    ... )
    >>> values, days = np.array([0.0, 0.0, 1.0, 1.0]), np.arange(4.0)
    >>> found = find_departure(FigureSeries("", "1", values, np.full(4, 0.1), days, entries))
    >>> found.agreed, found.since, round(found.sigma, 2)
    (2, '2026-01-03', 8.16)
    """
    if len(series) < 2 or not np.all(series.stds > 0):
        return None
    weight = 1 / np.square(series.stds)
    agrees = np.zeros(len(series), bool)
    agrees[0] = True
    change = sigma = 0.0
    for k in range(1, len(series)):
        mean = float(np.average(series.values[agrees], weights=weight[agrees]))
        change = float(series.values[k]) - mean
        sigma = change / math.sqrt(float(1 / weight[k] + 1 / weight[agrees].sum()))
        agrees[k] = abs(sigma) <= FAR_SIGMA
    last = int(np.flatnonzero(agrees)[-1])
    back = last == len(series) - 1
    return HistoryDistance(
        change,
        sigma,
        int(agrees[:-1].sum()),
        None if back else series.entries[last + 1].processed,
    )
