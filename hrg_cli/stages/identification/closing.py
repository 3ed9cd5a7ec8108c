"""The one rule by which every way of identifying ends: its checks, what they mean, and the status
they give."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from ...fitting.checks import Check, check_at_least, check_at_most, list_failures
from ...fitting.envelopes import rows
from ...fitting.envelopes.coordinates import DAMPING, SCALE_FACTOR
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.likelihood import Fit
from ..usual_scale_factor import check_scale_factor
from .outcome import Verdict

Array = np.ndarray
SURE = 3.0
"""Standard deviations by which a figure must miss a physical bound to be called impossible."""
AGREES = 4.0
"""Largest distance of a method from the likelihood on the same rows, in the method's own standard
deviations."""
SETTLED = 0.1
"""Part of a standard deviation that averaging or differencing may leave."""
UNSETTLED = 1.0
"""The same from which a method's own iteration is said not to have converged."""
ALIKE_TURNS = 0.1
"""Spread, in half turns a window, up to which another scale factor turns every window alike."""
BLURRED_RAD = 1.0
"""Motion of the wave within one window (turning and beat) from which the windows themselves blur
it."""


def close_verdict(
    verdict: Verdict, impossible: Iterable[Check] = (), doubtful: Iterable[Check] = ()
) -> Verdict:
    """A verdict with its closing checks.

    Parameters
    ----------
    verdict
        That is filled.
    impossible
        Checks of which a failure refuses it.
    doubtful
        Checks of which a failure makes it suspect.

    Returns
    -------
    Verdict
        The same.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.fitting.checks import check_holds
    >>> from hrg_cli.stages.identification.closing import close_verdict
    >>> verdict = Told(checks=[], refused=[], suspect=[])
    >>> _ = close_verdict(verdict, doubtful=[check_holds("white", False, "the residual is slow")])
    >>> verdict.refused, verdict.suspect
    ([], ['the residual is slow'])
    """
    impossible, doubtful = list(impossible), list(doubtful)
    verdict.checks += [*impossible, *doubtful]
    verdict.refused += list_failures(impossible)
    verdict.suspect += list_failures(doubtful)
    return verdict


def check_bounds(verdict: Verdict) -> tuple[list[Check], list[Check]]:
    """Bounds that no passive resonator leaves by more than its errors.

    Parameters
    ----------
    verdict
        With values and standard deviations by name.

    Returns
    -------
    tuple of list
        Checks that refuse the fit where they fail, and those that put it in doubt.

    Examples
    --------
    A wave that grows is no run-down:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.identification.closing import check_bounds
    >>> given = Told(values={"damping_rate_1_s": -0.1}, std={"damping_rate_1_s": 0.01})
    >>> refusing, doubting = check_bounds(given)
    >>> [(check.name, check.passed) for check in refusing]
    [('damping_is_positive', False)]
    """
    value, std = verdict.values, verdict.std
    refusing: list[Check] = []
    doubting: list[Check] = []
    if "damping_rate_1_s" in value:
        nu, error = value["damping_rate_1_s"], std["damping_rate_1_s"]
        refusing.append(
            check_at_least(
                "damping_is_positive",
                nu,
                -SURE * error,
                f"damping_rate_1_s = {nu:.3g} ± {error:.1g}: the wave grows, so these are not free"
                " run-downs; use runs with the drive off",
            )
        )
        if "damping_split_1_s" in value:
            split = value["damping_split_1_s"]
            doubting.append(
                check_at_most(
                    "split_within_damping",
                    split - 2 * std["damping_split_1_s"],
                    abs(nu),
                    f"damping_split_1_s = {split:.3g} is above damping_rate_1_s = {nu:.3g}: no"
                    " passive resonator does that",
                )
            )
    if std.get("scale_factor", 0.0) > 0 and "scale_factor" in value:
        doubting.append(check_scale_factor(value["scale_factor"], std["scale_factor"]))
    return refusing, doubting


def _find_alike_scale_factors(fit: Fit, runs: Sequence[EnvelopeRun]) -> list[float]:
    """The fitted K and every other of a shell, ring or pendulum (0 to 1) that windows so long
    cannot tell from it: each turns the wave by half turns more within a window, the same ellipse
    again."""
    here = float(fit.p[SCALE_FACTOR])
    if "scale_factor" not in fit.freedom.names:
        return [here]
    a_window = [
        np.diff(r.turn_rad) / np.diff(r.time_s) * r.window_s for r in runs if np.ptp(r.turn_rad) > 0
    ]
    if not a_window:
        return [here]
    turns = np.concatenate(a_window) / np.pi  # half turns a window for each unit of K
    fastest = float(np.quantile(np.abs(turns), rows.FAST))
    most = int(np.ceil((1.0 + abs(here)) * fastest))
    others = here + np.delete(np.arange(-most, most + 1), most) / max(fastest, 1e-300)
    return [here] + [
        float(k)
        for k in others
        if 0.0 <= k <= 1.0 and np.ptp(((k - here) * turns + 0.5) % 1.0) < ALIKE_TURNS
    ]


def blur(fit: Fit, runs: Sequence[EnvelopeRun]) -> Check:
    """The closing check of the wave's motion within one window, which blurs what moves in it.

    It is blurred alike throughout a steady run, but the signal is lost. The scale factor that moves
    it most counts among those that the windows cannot tell apart.

    Parameters
    ----------
    fit
        Whose generator moves the wave, but for its damping.
    runs
        Its runs.

    Returns
    -------
    Check
        Of the run that moves most [rad]; a failure says how short windows should be.

    Examples
    --------
    K·Ω of 0.55 · 0.5 rad/s over 50 ms:

    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.closing import blur
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> check = blur(fit_base_model(runs), runs)
    >>> round(check.value, 4), check.limit, check.passed
    (0.0138, 1.0, True)
    """
    most = max(_find_alike_scale_factors(fit, runs), key=abs)
    p = fit.p.copy()
    p[DAMPING], p[SCALE_FACTOR] = 0.0, most
    moving = [rows.estimate_speed(r, p) * r.window_s for r in runs]
    worst = int(np.argmax(moving))
    run, moved = runs[worst], moving[worst]
    shorter = run.window_s * BLURRED_RAD / max(moved, 1e-300) / 4
    return check_at_most(
        "motion_within_a_window",
        moved,
        BLURRED_RAD,
        f"{run.run_id or 'the run'}: the wave moves by {moved:.2g} rad within one window of"
        f" {run.window_s:.3g} s, so it is blurred and its turns may be lost; demodulate with"
        f" windows of at most {shorter:.2g} s",
    )
