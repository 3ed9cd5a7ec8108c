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
"""Factor by which a σ may miss the error it stands for, and the σ that the twins state."""
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
    std_ratio: float | None = None
    """The file's own σ over the median of those that the twins' results state; None where it states
    none of the same figure."""
    std_limit: float | None = None

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
        return self._describe_stated()

    def _describe_stated(self) -> str:
        """What is wrong with the σ that the file states, or nothing."""
        if self.std_ratio is None or self.std_limit is None:
            return ""
        if 1 / self.std_limit <= self.std_ratio <= self.std_limit:
            return ""
        return (
            f"{PREFIX}the standard deviation that the file states of {self.name} is"
            f" {self.std_ratio:.3g} times the one that the same programme on a simulated twin"
            f" states ({self.count} times), a factor of {LARGEST_RATIO:g} at most was expected:"
            " make the file again"
        )


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
    name: str,
    t: Array,
    figures: int = 1,
    *,
    doubted: bool = False,
    stated: float = 0.0,
    std: Array | None = None,
) -> FigureStatistics:
    """Statistics of a figure's errors over all rehearsals, and the limits that a right figure
    keeps.

    Chance exceeds one of the limits of `figures` right figures with the probability `CHANCE` only:
    Σt² of n Gaussian errors is χ² of n, their mean has the standard deviation 1/√n, and the
    logarithm of one more σ lies about theirs by Student's t of n − 1 times their scatter √(1 + 1/n)
    (e.g. ISO 16269-8).

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
    stated
        The file's own σ of it; 0: it states none.
    std
        The σ (n,) that the rehearsals state of it, in the same unit.

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
    >>> told = judge_figure("K", np.resize([1.0, -1.0], 30), stated=0.2, std=np.full(30, 1.0))
    >>> told.std_ratio, told.std_limit
    (0.2, 1.3)
    """
    from scipy.special import chdtri, ndtri

    n, tail = len(t), CHANCE / 4 / figures  # too far to one side, too wide, too narrow, misstated
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
        *_compare_stated(stated, std, tail),
    )


def _compare_stated(
    stated: float, std: Array | None, tail: float
) -> tuple[float, float] | tuple[None, None]:
    """A stated σ over the median of those (n,) that rehearsals state, and the factor either way
    that chance exceeds with the probability `tail`; nothing where there is nothing to compare."""
    from scipy.special import stdtrit

    if std is None or not (np.isfinite(stated) and stated > 0):
        return None, None
    logs = np.log(std)
    n = len(logs)
    reach = -stdtrit(n - 1, tail / 2) * np.std(logs, ddof=1) * np.sqrt(1 + 1 / n)
    largest = np.log(np.finfo(float).max) / 2
    limit = max(LARGEST_RATIO, float(np.exp(min(reach, largest))))
    return float(np.exp(np.log(stated) - np.median(logs))), limit
