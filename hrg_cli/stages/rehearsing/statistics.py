"""How the errors of one figure, and the naming of one cause, compare over all rehearsals with what
a right result's would: limits that chance exceeds at a known small rate.

Σt² of n Gaussian errors is χ² of n, their mean has the standard deviation 1/√n; k times named of n
is binomial.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...records import REHEARSAL as PREFIX

Array = np.ndarray
LARGEST_RATIO = 1.3
"""Factor by which a σ may miss the error it stands for."""
LARGEST_BIAS = 1.0
"""Bias in standard deviations that a result may have."""
CHANCE = 0.01
"""Probability with which one of all the figures of a right result is blamed."""
WITHIN_68, WITHIN_95 = 1.0, 1.959964
"""Standard deviations within which a Gaussian error lies in 68.3 and 95 % of the cases."""
LEAST_NAMED, MOST_STRANGE = 0.5, 0.1
"""Part of the rehearsals in which a cause of a diagnosis must be named again, and in which another
cause may be."""


@dataclass(frozen=True)
class FigureStatistics:
    """How one figure's errors compare with its σ over all rehearsals, and the limits that both were
    held against."""

    name: str
    bias_over_std: float
    error_over_std_rms: float
    coverage_68: float
    coverage_95: float
    count: int
    bias_limit: float
    rms_limit: float
    rms_least: float

    def describe_fault(self) -> str:
        """What is wrong with the figure's error, or nothing."""
        if not abs(self.bias_over_std) <= self.bias_limit:
            return (
                f"{PREFIX}{self.name} comes out {self.bias_over_std:+.2g} of its own standard"
                f" deviations from the truth of a simulated twin on average ({self.count} times),"
                f" at most {LARGEST_BIAS:g} was expected"
            )
        if not self.error_over_std_rms <= self.rms_limit:
            return (
                f"{PREFIX}the errors of {self.name} on a simulated twin are"
                f" {self.error_over_std_rms:.3g} times its standard deviation ({self.count} times),"
                f" at most {LARGEST_RATIO:g} was expected"
            )
        if not self.error_over_std_rms >= self.rms_least:
            return (
                f"{PREFIX}the errors of {self.name} on a simulated twin are only"
                f" {self.error_over_std_rms:.3g} of its standard deviation ({self.count} times), at"
                f" least {1 / LARGEST_RATIO:.2f} was expected"
            )
        return ""


@dataclass(frozen=True)
class Named:
    """How often a cause was named in `times` diagnoses of a twin, which holds it or does not."""

    name: str
    held: bool
    named: int
    times: int

    def describe_fault(self, causes: int) -> str:
        """What is wrong with that, or nothing; `causes`: how many are looked at."""
        from scipy.special import bdtr, bdtrc

        tail = CHANCE / causes
        if self.held and bdtr(self.named, self.times, LEAST_NAMED) < tail:
            return (
                f"{PREFIX}{self.name} is named in {self.named} of {self.times} diagnoses of a"
                " simulated twin that holds it as large as the file says"
            )
        if not self.held and bdtrc(self.named - 1, self.times, MOST_STRANGE) < tail:
            return (
                f"{PREFIX}{self.name} is named in {self.named} of {self.times} diagnoses of a"
                " simulated twin that does not hold it"
            )
        return ""


def judge_figure(
    name: str, t: Array, figures: int = 1, *, doubted: bool = False
) -> FigureStatistics:
    """Statistics of a figure's errors over all rehearsals, and the limits that a right figure
    keeps.

    Chance exceeds one of the limits of `figures` right figures with the probability `CHANCE` only:
    Σt² of n Gaussian errors is χ² of n, their mean has the standard deviation 1/√n.

    Parameters
    ----------
    name
        Of the figure.
    t
        Errors (n,) in σ.
    figures
        Among how many it is judged.
    doubted
        Its σ holds more than repeats scatter by, so that it is never too wide.

    Returns
    -------
    FigureStatistics
        All in σ of the figure, coverages as parts of 1.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.rehearsing.statistics import judge_figure
    >>> told = judge_figure("scale_factor", np.resize([3.0, -3.0], 30))
    >>> told.bias_over_std, told.error_over_std_rms, told.coverage_95
    (0.0, 3.0, 0.0)
    >>> told.rms_limit < 1.5
    True
    """
    from scipy.special import chdtri, ndtri

    n, tail = len(t), CHANCE / 3 / figures  # too far to one side, too wide, too narrow
    return FigureStatistics(
        name,
        float(np.mean(t)),
        float(np.sqrt(np.mean(t**2))),
        float(np.mean(np.abs(t) < WITHIN_68)),
        float(np.mean(np.abs(t) < WITHIN_95)),
        n,
        max(LARGEST_BIAS, float(-ndtri(tail / 2) / np.sqrt(n))),
        max(LARGEST_RATIO, float(np.sqrt(chdtri(n, tail) / n))),
        0.0 if doubted else min(1 / LARGEST_RATIO, float(np.sqrt(chdtri(n, 1 - tail) / n))),
    )
