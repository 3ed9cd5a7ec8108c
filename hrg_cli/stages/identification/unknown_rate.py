"""One unknown constant rate beside the resonator: fitted with it, and refused where a damping split
imitates it.

mθ' = −KΩ + νδμ·sin 2m(θ − θ_μ) (PHYSICS §4): over a part of a turn of 2mθ a steady rate and a
damping split turn the wave alike.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ...fitting import checks
from ...fitting.envelopes import envelope_runs, inference, rate_offset
from ...fitting.envelopes.base_fit import fit_base_model
from ...fitting.envelopes.base_freedom import Known, choose_scale_factor
from ...fitting.envelopes.coordinates import DAMPING, SCALE_FACTOR
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...physics import ellipse
from . import closing
from .outcome import Verdict
from .verdict import is_one_rate, judge_parameters

UNCLEAR = 0.3
"""Error of the rate, as a part of what turns the wave, above which it is not told."""


def identify_with_unknown_rate(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Verdict:
    """One unknown constant rate beside the resonator, added to the logged rates.

    Refused where a damping split imitates it. K is fitted where the logs hold different rates and
    none is given; else it is held, for K·Ω alone is seen.

    Parameters
    ----------
    runs
        Free ones of one gyro.
    known
        What is held.
    blocks
        Rows to which each run is averaged at least.

    Returns
    -------
    Verdict
        The resonator; the rate [rad/s] is in the details as `rate_rad_s`.

    Raises
    ------
    HrgError
        Nothing can be fitted.

    Examples
    --------
    Both logs read 0.01 rad/s too little:

    >>> from dataclasses import replace
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.unknown_rate import identify_with_unknown_rate
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> read = [replace(run, turn_rad=run.turn_rad - 0.01 * run.time_s) for run in runs]
    >>> verdict = identify_with_unknown_rate(read, Known(), 100)
    >>> round(verdict.details["rate_rad_s"]["value"], 4), round(verdict.values["scale_factor"], 3)
    (0.01, 0.55)
    """
    mode = runs[0].mode_number
    told = known.scale_factor is not None
    if not told and not _rates_differ(runs):
        known = dataclasses.replace(known, scale_factor=choose_scale_factor(mode))
    found = rate_offset.fit_rate_offset(runs, known, blocks, _start(runs, known, blocks))
    noise = inference.estimate_variance_inflation(found.fit)[0]
    turned = [envelope_runs.turn_table(r, found.value) for r in runs]
    verdict = judge_parameters(found.fit, turned, known, noise * found.beside)

    std = found.std * float(np.sqrt(verdict.details["variance_factor"]))
    held = known.scale_factor is not None
    _add_closing_checks(verdict, found, _is_unclear(found, std, held))
    logged = max(float(np.ptp(r.turn_rad)) for r in runs) > 0
    verdict.details["rate_rad_s"] = {
        "value": found.value,
        "std": std,
        "scale_factor": float(found.fit.p[SCALE_FACTOR]),
        "of": "common offset of the logged rates" if logged else "constant rate of all runs",
        "logged_mean_rad_s": [float((r.turn_rad[-1] - r.turn_rad[0]) / r.duration_s) for r in runs],
    }
    if not told and known.scale_factor is not None:
        verdict.values.pop("scale_factor", None)
    return verdict


def _start(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> float:
    """The rate from which the fit starts: without a log, K·Ω at unit rate over K."""
    if max(float(np.ptp(r.turn_rad)) for r in runs) > 0:
        return 0.0
    mode = runs[0].mode_number
    turning = [dataclasses.replace(r, turn_rad=r.time_s - r.time_s[0]) for r in runs]
    fit = fit_base_model(turning, dataclasses.replace(known, scale_factor=None), blocks)
    nominal = choose_scale_factor(mode)
    return float(fit.p[SCALE_FACTOR]) / (
        nominal if known.scale_factor is None else known.scale_factor
    )


def _is_unclear(found: rate_offset.RateOffset, std: float, held: bool) -> bool:
    """Whether rate and damping split are one to these runs: an error beyond a third of what turns
    the wave, or a residual that forbids telling them where K is held."""
    by_split = abs(found.fit.p[DAMPING] / float(found.fit.p[SCALE_FACTOR]))
    seen = max(abs(found.value), by_split)
    return bool(not std < UNCLEAR * seen or (held and is_one_rate(found.fit)))


def _add_closing_checks(verdict: Verdict, found: rate_offset.RateOffset, unclear: bool) -> None:
    """The closing checks of the rate into the verdict."""
    span = 2 * max(
        float(np.ptp(ellipse.unwrap(*ellipse.find_wave(r.envelope, 1)[2:], 1)[0]))
        for r in found.fit.response.batch.runs
    )
    closing.close_verdict(
        verdict,
        [
            checks.check_holds(
                "rate_offset_converged",
                found.converged,
                "the unknown rate did not settle; give the rate, or runs at several angles",
            ),
            checks.check_holds(
                "rate_is_distinct",
                not unclear,
                f"an unknown rate is ill-conditioned (condition number {verdict.condition:.3g}),"
                f" like a damping split where the wave passes {np.degrees(span):.0f}° of the"
                " 360° of 2mθ; give the rate, or runs at several angles",
            ),
        ],
    )


def _rates_differ(runs: Sequence[EnvelopeRun]) -> bool:
    """Whether the runs' logged rates differ enough between or within them for K to be seen beside a
    common offset."""
    rate = np.concatenate([np.diff(r.turn_rad) / np.diff(r.time_s) for r in runs])
    low, high = np.quantile(rate, [0.01, 0.99])
    return bool(high - low > 0.1 * max(abs(low), abs(high)) > 0)
