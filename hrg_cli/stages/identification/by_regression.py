"""One of seed A's methods as the answer: judged by its own misfit, by its distance from the
likelihood on the same rows, and by physics; and all of them beside each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting import checks
from ...fitting.envelopes.base_fit import fit_base_model
from ...fitting.envelopes.base_freedom import Known
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.likelihood import Fit
from ...fitting.envelopes.regressions import Regression
from ...fitting.least_squares import square_over_covariance
from . import closing
from .first_order_rows import PreparedRows, prepare_rows
from .methods import ALL, name_parameters, solve_method
from .outcome import Verdict
from .splits import state_splits
from .verdict import ORDER, judge_parameters

Array = np.ndarray


def identify_by_regression(
    runs: Sequence[EnvelopeRun], known: Known, method: str, eliminate_rate: bool, blocks: int
) -> Verdict:
    """One of seed A's methods, judged by its misfit, its distance from the likelihood, and physics.

    The likelihood is fitted to the same rows; the frequency is its own, as every method has to know
    it.

    Parameters
    ----------
    runs
        Free ones of one gyro.
    known
        What is held.
    method
        One of `methods.ALL`.
    eliminate_rate
        Of fixed-axes: the published elimination of the rate, which halves the damping split.
    blocks
        Rows to which each run is averaged at least.

    Returns
    -------
    Verdict
        The method's answer.

    Raises
    ------
    HrgError
        The method cannot be used on these runs.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.by_regression import identify_by_regression
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> verdict = identify_by_regression(runs, Known(), "stokes", False, 100)
    >>> round(verdict.values["scale_factor"], 3), verdict.refused
    (0.55, [])
    """
    best = fit_base_model(runs, known, blocks)
    ready = prepare_rows(runs, known, best)
    answer = solve_method(method, ready, best, eliminate_rate)
    if answer.refused:
        raise HrgError(answer.refused)
    return _judge_method(answer, ready, judge_parameters(best, runs, known), known, method)


def _judge_method(
    answer: Regression, ready: PreparedRows, likelihood: Verdict, known: Known, method: str
) -> Verdict:
    """A regression's verdict; the frequency is the likelihood's, which every method has to know."""
    mode = ready.rows[0].mode_number
    values, std, covariance = name_parameters(answer, mode, method, ready.rows, known)
    values["frequency_hz"], std["frequency_hz"] = (
        likelihood.values["frequency_hz"],
        likelihood.std["frequency_hz"],
    )
    covariance[0, 0] = std["frequency_hz"] ** 2
    rows = np.array([len(r) for r in ready.rows])
    chi2, dof, run_chi2 = _measure_misfit(answer, likelihood, rows)
    verdict = Verdict(
        values,
        std,
        list(ORDER),
        covariance,
        chi2 / max(1, dof),
        float("nan"),
        run_chi2,
        likelihood.run_residual_rms,
        rows,
        mode_number=mode,
    )
    verdict.details |= answer.details | state_splits(values, std, answer.p, answer.covariance)
    verdict.suspect = list(answer.warnings)
    refusing, doubting = closing.check_bounds(verdict)
    settled = checks.check_fit(
        covariance,
        answer.unsettled < closing.UNSETTLED,
        f"{method}: taking off the differences' truncation did not settle",
    )
    own = _check_answer(answer, likelihood, method, chi2, dof)
    closing.close_verdict(verdict, [*settled, *refusing], [*own, *doubting])
    if not next(c for c in likelihood.checks if c.name == "chi2_per_dof").passed:
        verdict.suspect.append(
            "no linear resonator describes these runs within their noise (χ²/dof"
            f" {likelihood.chi2_per_dof:.3g})"
        )
    return verdict


def _measure_misfit(
    answer: Regression, likelihood: Verdict, rows: Array
) -> tuple[float, int, Array]:
    """χ², degrees of freedom and χ² per degree of freedom of each run: the method's own where it
    has any, else the likelihood's on the same rows (runs,)."""
    if len(answer.run_chi2) > 0:
        run_chi2 = answer.run_chi2 / np.maximum(1, answer.run_rows)
        return float(np.nansum(answer.run_chi2)), int(answer.run_rows.sum()), run_chi2
    dof = 4 * int(rows.sum())
    return likelihood.chi2_per_dof * dof, dof, likelihood.run_chi2_per_dof


def _check_answer(
    answer: Regression, likelihood: Verdict, method: str, chi2: float, dof: int
) -> list[checks.Check]:
    """What makes a method's answer doubtful: its misfit, the length of its rows, its distance from
    the likelihood, and motion within a window."""
    assert likelihood.fit is not None
    truncation = max(answer.unsettled, likelihood.fit.truncation)
    apart = _measure_distance(answer, likelihood.fit)
    return [
        checks.check_goodness(
            chi2,
            dof,
            f"χ²/dof = {chi2 / max(1, dof):.3g}: {method} leaves more than the noise of its own"
            " rows; the errors are inflated",
        ),
        checks.check_at_most(
            "row_truncation",
            truncation,
            closing.SETTLED,
            f"the length of the rows still moves {method} by {truncation:.2g} σ",
        ),
        checks.check_at_most(
            "distance_from_likelihood",
            apart,
            closing.AGREES,
            f"{method} is {apart:.3g} of its own standard deviations away from what fits the"
            " same rows best; use likelihood",
        ),
        *(c for c in likelihood.checks if c.name == "motion_within_a_window"),
    ]


def _measure_distance(answer: Regression, best: Fit) -> float:
    """Largest distance of a method's coordinates from the likelihood's, in the standard deviations
    of their difference; of the splits that of the vectors, whatever way they lie.

    The likelihood is efficient, so the variance of the difference is the difference of the
    variances, at most the method's own.
    """
    distance = [0.0]
    for part in ([0], [1, 2], [3, 4], [5]):
        off, covariance = answer.p[part] - best.p[part], answer.covariance[np.ix_(part, part)]
        if np.all(np.isfinite(off)) and np.all(np.isfinite(covariance)):
            distance.append(float(np.sqrt(square_over_covariance(off, covariance))))
    return max(distance)


def compare_methods(
    runs: Sequence[EnvelopeRun], known: Known, best: Verdict, eliminate_rate: bool
) -> list[dict[str, Any]]:
    """Every method on the same inputs: parameters, and the difference from the likelihood in units
    of the method's own error.

    Parameters
    ----------
    runs
        Free ones of one gyro.
    known
        What is held.
    best
        The likelihood's verdict on them.
    eliminate_rate
        Of fixed-axes: the published elimination of the rate.

    Returns
    -------
    list of dict
        One row for each method, the likelihood first: `method`, `parameters` (value, σ,
        difference), `warnings`, why it `refused`, and its splits as vectors.

    Raises
    ------
    HrgError
        The runs show modes alone, so there is no fit of a resonator to compare with.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.by_likelihood import identify_by_likelihood
    >>> from hrg_cli.stages.identification.by_regression import compare_methods
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> best = identify_by_likelihood(runs, Known(), 100)
    >>> for row in compare_methods(runs, Known(), best, False)[:3]:
    ...     print(row["method"], round(row["parameters"]["scale_factor"]["value"], 3))
    likelihood 0.55
    propagator 0.55
    stokes 0.55
    """
    if best.fit is None:
        raise HrgError(
            "the methods of seed A need both channels of a resonator, these runs show modes alone;"
            " give --method likelihood for them"
        )
    ready = prepare_rows(runs, known, best.fit)
    table = [_compare_row("likelihood", best.values, best.std, best, [], "") | _tell_splits(best)]
    for method in ALL:
        answer = solve_method(method, ready, best.fit, eliminate_rate)
        if answer.refused:
            table.append(_compare_row(method, {}, {}, best, [], answer.refused))
            continue
        verdict = _judge_method(answer, ready, best, known, method)
        verdict.values.pop("frequency_hz", None)
        table.append(
            _compare_row(
                method, verdict.values, verdict.std, best, [*verdict.refused, *verdict.suspect], ""
            )
            | _tell_splits(verdict)
        )
    return table


def _tell_splits(verdict: Verdict) -> dict[str, Any]:
    """What a verdict says of its splits as vectors."""
    told = ("split_components", "split_slope_std", "weak_splits")
    return {key: verdict.details[key] for key in told}


def _compare_row(
    method: str,
    values: dict[str, float],
    std: dict[str, float],
    best: Verdict,
    warnings: list[str],
    refused: str,
) -> dict[str, Any]:
    """A method's row: value, σ and difference from `best`, an axis' modulo its period."""
    cells = {}
    for name, value in values.items():
        difference = value - best.values.get(name, value)
        if name.endswith("axis_rad"):
            period = np.pi / best.mode_number
            difference = float(np.mod(difference + period / 2, period) - period / 2)
        cells[name] = {"value": value, "std": std[name], "difference": difference}
    return {"method": method, "parameters": cells, "warnings": warnings, "refused": refused}
