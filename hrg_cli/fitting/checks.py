"""Closing checks: what a result must pass before it may be called valid, adequate or explained.

A check compares one figure of the *final* result with one limit and can fail. Every fit of the
project closes with the same ones: its χ² at the noise that the windows state, the whiteness of what
it leaves, convergence, a covariance that is one, physical bounds.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

Array = np.ndarray
CHANCE = 1e-4
"""Probability with which a right result fails one of the statistical checks."""
NOISE_KNOWN = 0.1
"""Part of the noise's variance to which the windows know it: χ² per degree of freedom cannot be
judged more sharply."""
NOISE_SHOWN = 0.5
"""Part of the stated variance that must be seen: standard deviations √2 too large are told."""
FEWEST_BLOCKS = 6
"""Blocks from which the scatter of block sums is judged."""
SLOW_BLOCKS = 16
"""Blocks from which the power of their sums says how much wider colour makes an error."""
LARGEST_CORRELATION = 1.0 + 1e-9
"""Correlation above which a covariance matrix is none (rounding allowed)."""


@dataclass(frozen=True)
class Check:
    """One figure of a result held against its limit; `sentence` says what a failure means and what
    to do."""

    name: str
    value: float
    limit: float
    passed: bool
    sentence: str = ""

    def to_json(self) -> dict[str, Any]:
        """The check as the JSON has it; a value that is not finite is null there."""
        entry = asdict(self)
        return entry | {
            key: entry[key] if np.isfinite(entry[key]) else None for key in ("value", "limit")
        }


def check_at_most(name: str, value: float, limit: float, sentence: str = "") -> Check:
    """A figure that must not exceed its limit; NaN fails.

    Parameters
    ----------
    name
        Key of the check.
    value
        The figure.
    limit
        Largest value that passes.
    sentence
        What is wrong where it fails, and what to do.

    Returns
    -------
    Check
        Passed or not.

    Examples
    --------
    >>> from hrg_cli.fitting.checks import check_at_most
    >>> (
    ...     check_at_most("residual", 1.2, 1.0).passed,
    ...     check_at_most("residual", float("nan"), 1.0).passed,
    ... )
    (False, False)
    """
    return Check(name, float(value), float(limit), bool(value <= limit), sentence)


def check_at_least(name: str, value: float, limit: float, sentence: str = "") -> Check:
    """A figure that must reach its limit; NaN fails.

    Parameters
    ----------
    name
        Key of the check.
    value
        The figure.
    limit
        Smallest value that passes.
    sentence
        What is wrong where it fails, and what to do.

    Returns
    -------
    Check
        Passed or not.

    Examples
    --------
    >>> from hrg_cli.fitting.checks import check_at_least
    >>> check_at_least("turns", 3, 1).passed
    True
    """
    return Check(name, float(value), float(limit), bool(value >= limit), sentence)


def check_holds(name: str, condition: bool, sentence: str = "") -> Check:
    """A yes or no as a check: value 1 for yes, limit 1.

    Parameters
    ----------
    name
        Key of the check.
    condition
        What must hold.
    sentence
        What is wrong where it does not, and what to do.

    Returns
    -------
    Check
        Passed or not.

    Examples
    --------
    >>> from hrg_cli.fitting.checks import check_holds
    >>> check = check_holds("converged", False, "the fit did not settle")
    >>> check.value, check.passed, check.sentence
    (0.0, False, 'the fit did not settle')
    """
    return Check(name, float(bool(condition)), 1.0, bool(condition), sentence)


def list_failures(checks: Iterable[Check]) -> list[str]:
    """Sentences of the checks that failed.

    Parameters
    ----------
    checks
        In the order in which they are told.

    Returns
    -------
    list of str
        A sentence each; its figures where a check has none.

    Examples
    --------
    >>> from hrg_cli.fitting.checks import check_at_most, list_failures
    >>> list_failures([check_at_most("residual", 1.2, 1.0), check_at_most("drift", 0.0, 1.0)])
    ['residual = 1.2 is beyond 1']
    """
    return [
        check.sentence or f"{check.name} = {check.value:.3g} is beyond {check.limit:.3g}"
        for check in checks
        if not check.passed
    ]


def compute_largest_chi2_per_dof(dof: int) -> float:
    """χ² per degree of freedom that a right model exceeds with probability `CHANCE`.

    Parameters
    ----------
    dof
        Degrees of freedom, 1 or more.

    Returns
    -------
    float
        The quantile of χ² over `dof`, and `NOISE_KNOWN` beside it: the noise is known to that part.

    Examples
    --------
    The more rows, the nearer to 1:

    >>> from hrg_cli.fitting.checks import compute_largest_chi2_per_dof
    >>> compute_largest_chi2_per_dof(10) > compute_largest_chi2_per_dof(1000) > 1
    True
    """
    from scipy.special import chdtri

    return float(chdtri(dof, CHANCE) / dof + NOISE_KNOWN)


def check_goodness(chi2: float, dof: int, sentence: str = "", name: str = "chi2_per_dof") -> Check:
    """χ² per degree of freedom at the *stated* noise, against what a right model leaves.

    Parameters
    ----------
    chi2
        Sum of squared residuals over the stated σ.
    dof
        Degrees of freedom.
    sentence
        What is wrong where it fails, and what to do.
    name
        Key of the check.

    Returns
    -------
    Check
        Passed or not.

    Examples
    --------
    >>> from hrg_cli.fitting.checks import check_goodness
    >>> check_goodness(1010.0, 1000).passed, check_goodness(2000.0, 1000).passed
    (True, False)
    """
    return check_at_most(
        name, chi2 / max(dof, 1), compute_largest_chi2_per_dof(max(dof, 1)), sentence
    )


def check_whiteness(
    residuals: Sequence[Array],
    sentence: str = "",
    name: str = "whiteness",
    allowed: float = 0.0,
    stated: float = 0.0,
) -> Check:
    """Whether the residuals' slow part may be chance under white noise.

    The sums over blocks of 2, 4, 8 … rows of white noise of variance σ² have variance mσ²; the
    largest excess of all lengths counts, for all of them tried. Held against `CHANCE` in −log₁₀.

    Parameters
    ----------
    residuals
        An array (n,) or (n, k) a run, in the order of time (or of whatever they are held against).
    sentence
        What is wrong where it fails, and what to do.
    name
        Key of the check.
    allowed
        Excess of the slow part that does no harm, as a part of the white level.
    stated
        Variance that every error already allows for; the level is that of the residuals where that
        is larger. Behind a lock-in's filter rows scatter by less than a long average of them needs,
        which is what they state, and their slow part is no more than that.

    Returns
    -------
    Check
        −log₁₀ of the chance, passed or not.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.checks import check_whiteness
    >>> white = np.random.default_rng(1).standard_normal(4000)
    >>> check_whiteness([white]).passed, check_whiteness([np.cumsum(white)]).passed
    (True, False)
    """
    from scipy.special import chdtrc

    level = (
        np.concatenate([np.asarray(r, float).ravel() for r in residuals])
        if residuals
        else np.zeros(0)
    )
    variance = max(float(np.mean(level**2)), stated) if len(level) else 0.0
    if not variance > 0:
        return Check(
            name, 0.0, -float(np.log10(CHANCE)), bool(np.all(np.isfinite(level))), sentence
        )
    # white noise: a sum of m rows has m σ². Lengths double, so that a slow part of any duration
    # fills some block; the smallest chance is multiplied by how many lengths were tried
    _, *longer = list_block_powers(residuals, FEWEST_BLOCKS)
    chances = [
        float(chdtrc(count, count * power / variance / (1 + allowed))) for power, count in longer
    ]
    chance = min(1.0, len(chances) * min(chances)) if chances else 1.0
    return check_at_most(
        name, -float(np.log10(max(chance, 1e-300))), -float(np.log10(CHANCE)), sentence
    )


def check_noise_shown(residuals: Sequence[Array], name: str = "noise_shown") -> Check:
    """Whether the rows, or long averages of them, show at least half of the variance they state.

    Behind a lock-in's filter rows scatter by less than a long average needs, which is what they
    state: only what no length of average shows is not there.

    Parameters
    ----------
    residuals
        Over the stated σ, an array (n,) or (n, k) a run, in the order of time.
    name
        Key of the check.

    Returns
    -------
    Check
        The largest variance over the stated one of 1, 2, 4, 8 … rows together.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.checks import check_noise_shown
    >>> white = np.random.default_rng(1).standard_normal(4000)
    >>> check_noise_shown([white]).passed, check_noise_shown([0.3 * white]).passed
    (True, False)
    """
    from scipy.special import chdtri

    count = sum(np.size(r) for r in residuals)
    # the largest of several scatters upwards: two standard deviations of each are taken off
    shown = max(
        (float(power / (1 + 2 * np.sqrt(2 / n))) for power, n in list_block_powers(residuals)),
        default=0.0,
    )
    limit = min(NOISE_SHOWN, float(chdtri(count, 1 - CHANCE)) / count) if count else 0.0
    return check_at_least(
        name,
        shown,
        limit,
        f"the windows state {shown**-0.5 if shown > 0 else np.inf:.2g} times the noise that is seen"
        " between them (a hum or a tone that each of them holds): the standard deviations are that"
        " much too large; take it out of the recording, or give windows of whole periods of it",
    )


def measure_slow_part(residuals: Sequence[Array]) -> float:
    """Power of the residuals' slow part over that of white noise of their own level: what colour
    does to a variance.

    Of sums over blocks of 2, 4, 8 … rows, the largest power that at least `SLOW_BLOCKS` blocks
    show.

    Parameters
    ----------
    residuals
        An array (n,) or (n, k) a run, in the order of time.

    Returns
    -------
    float
        At least 1.

    Examples
    --------
    Noise held for four rows moves what is slow by four times its variance, at least:

    >>> import numpy as np
    >>> from hrg_cli.fitting.checks import measure_slow_part
    >>> held = np.repeat(np.random.default_rng(1).standard_normal(20_000), 4)
    >>> measure_slow_part([held]) > 3.9
    True
    """
    (variance, _), *longer = list_block_powers(residuals) or [(0.0, 0)]
    return max([1.0, *(power / variance for power, _ in longer)]) if variance > 0 else 1.0


def list_block_powers(
    residuals: Sequence[Array], fewest: int = SLOW_BLOCKS
) -> list[tuple[float, int]]:
    """Mean squares of the sums over blocks of 1, 2, 4, 8 … rows, a row.

    Parameters
    ----------
    residuals
        An array (n,) or (n, k) a run, in the order of time.
    fewest
        Sums that a longer block must have.

    Returns
    -------
    list of tuple
        Mean square over the length, and the number of sums: of all lengths of which there are
        enough, the first of any.

    Examples
    --------
    Of white noise all are its variance; of a constant they grow as the length:

    >>> import numpy as np
    >>> from hrg_cli.fitting.checks import list_block_powers
    >>> list_block_powers([np.ones(64)])
    [(1.0, 64), (2.0, 32), (4.0, 16)]
    """
    rows = [np.asarray(r, float).reshape(len(r), -1) for r in residuals if len(r)]
    out, length = list[tuple[float, int]](), 1
    while rows:
        sums = np.concatenate(
            [
                r[: len(r) // length * length].reshape(-1, length, r.shape[1]).sum(axis=1).ravel()
                for r in rows
            ]
        )
        if length > 1 and len(sums) < fewest:
            break
        out.append((float(np.mean(sums**2)) / length, len(sums)))
        length *= 2
    return out


def check_covariance(covariance: Array, sentence: str = "", name: str = "covariance") -> Check:
    """Largest |correlation| of a covariance, against 1; NaN, infinity and a negative variance fail.

    Parameters
    ----------
    covariance
        Symmetric matrix (k, k).
    sentence
        What is wrong where it fails, and what to do.
    name
        Key of the check.

    Returns
    -------
    Check
        Passed or not.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.checks import check_covariance
    >>> [check_covariance(np.array([[1.0, c], [c, 1.0]])).passed for c in (0.5, 1.5)]
    [True, False]
    """
    matrix = np.asarray(covariance, float)
    variance = np.diag(matrix)
    if not np.all(np.isfinite(matrix)) or np.any(variance < 0):
        return Check(name, float("nan"), LARGEST_CORRELATION, False, sentence)
    std = np.sqrt(np.where(variance > 0, variance, 1.0))
    correlation = np.abs(matrix / np.outer(std, std) * (1 - np.eye(len(matrix))))
    return check_at_most(name, float(correlation.max(initial=0.0)), LARGEST_CORRELATION, sentence)


def check_statistics(
    chi2: float,
    dof: int,
    residuals: Sequence[Array] = (),
    *,
    sentence: str = "",
    coloured: str = "",
) -> list[Check]:
    """The statistical checks that close every fit: χ² at the stated noise, white residuals, and
    that the noise is there.

    Parameters
    ----------
    chi2, dof
        Sum of squared residuals over the stated σ, and its degrees of freedom.
    residuals
        Residuals over the stated σ run by run, in the order of time; none: only χ² is looked at.
    sentence
        What is said of a χ² that is too large.
    coloured
        What is said of residuals that are not white.

    Returns
    -------
    list of Check
        One or three.

    Examples
    --------
    A slow course within the stated noise is seen by the second:

    >>> import numpy as np
    >>> from hrg_cli.fitting.checks import check_statistics
    >>> slow = np.sin(np.linspace(0, 6.0, 2000))
    >>> [check.passed for check in check_statistics(float(slow @ slow), 2000, [slow])]
    [True, False, True]
    """
    checks = [check_goodness(chi2, dof, sentence)]
    if len(residuals):
        checks.append(check_whiteness(residuals, coloured, allowed=NOISE_KNOWN, stated=1.0))
        checks.append(check_noise_shown(residuals))
    return checks


def check_fit(covariance: Array, converged: bool, reason: str = "") -> list[Check]:
    """What a fit must be whatever it says: converged, with a covariance that is one.

    Parameters
    ----------
    covariance
        Of the answer, (k, k).
    converged
        Whether the iteration settled.
    reason
        What is said where it did not.

    Returns
    -------
    list of Check
        Two.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.checks import check_fit
    >>> [check.passed for check in check_fit(np.eye(2), converged=False)]
    [False, True]
    """
    return [
        check_holds(
            "converged", converged, reason or "the fit did not settle; look at the runs' residuals"
        ),
        check_covariance(
            covariance,
            "the covariance of the answer is none (a correlation beyond 1, or not finite): nothing"
            " it says of its errors holds",
        ),
    ]
