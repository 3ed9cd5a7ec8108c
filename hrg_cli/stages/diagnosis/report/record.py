"""Diagnosis, the record: the series before and after, and what is said of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.wave_frame import to_reals
from ....physics import ellipse
from ....records import Diagnosis, Wave
from ..drive.scatter import describe_scatter
from ..search.damping_form import Form
from ..search.selection import Search
from .report import describe_in_words
from .shares import Shares


def make_diagnosis_record(
    search: Search, waves: Sequence[Wave], verdict: str, report: dict[str, Any], model: str
) -> Diagnosis:
    """The record of a diagnosis: measured and simulated rows of the fits before and after, the
    words and the file.

    Parameters
    ----------
    search
        With its first and its last fit.
    waves
        Of the runs.
    verdict
        The word.
    report
        As JSON has it.
    model
        The extended model's simulation file.

    Returns
    -------
    Diagnosis
        Rows of all runs one after another, without those of no weight.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_waves
    >>> from hrg_cli.stages.diagnosis.report.record import make_diagnosis_record
    >>> record = make_diagnosis_record(draw_case().search, draw_waves(), "adequate", {}, "")
    >>> record.verdict, len(record)
    ('adequate', 150)
    """
    series = search.base.series
    good = series.weight > 0
    run = np.broadcast_to(np.arange(len(series.names))[:, None], good.shape)[good]
    measured = series.envelope[good]
    before, after = (f.prediction.compute_residual()[good] for f in (search.base, search.final))
    a_A, _, angle, phase = ellipse.find_wave(measured, series.mode_number)
    for k in range(len(series.names)):
        angle[run == k], _ = ellipse.unwrap(angle[run == k], phase[run == k], series.mode_number)
    return Diagnosis(
        run=run.astype("i4"),
        time_s=series.time_s[good],
        wave_angle_rad=angle,
        main_amplitude=a_A,
        temperature_degc=series.temperature_degc[good] if series.has_temperature else None,
        rate_rad_s=series.rate_rad_s[good],
        measured=to_reals(measured),
        simulated_before=to_reals(search.base.prediction.by_log[good]),
        simulated_after=to_reals(search.final.prediction.by_log[good]),
        residual_before=before,
        residual_after=after,
        series=json.dumps(["C0 real", "S0 real", "C0 imaginary", "S0 imaginary"]),
        run_ids=json.dumps(list(series.names), ensure_ascii=False),
        gyro_id=waves[0].gyro_id,
        verdict=verdict,
        report=json.dumps(report, ensure_ascii=False),
        extended_model=model,
    )


def add_shares(record: Diagnosis, shares: Shares) -> Diagnosis:
    """The record with the rows of the models without some of the causes.

    Parameters
    ----------
    record
        A diagnosis.
    shares
        Of its causes.

    Returns
    -------
    Diagnosis
        The same where there are no causes.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.report.record import add_shares
    >>> from hrg_cli.stages.diagnosis.report.shares import Shares
    >>> add_shares(None, Shares((), np.zeros((0, 4, 0)), {})) is None
    True
    """
    if not shares.left_out:
        return record
    return record.replace(simulated_without=shares.rows, left_out=json.dumps(shares.left_out))


def take_form(effect: dict[str, Any], form: Form | None) -> dict[str, Any]:
    """The report's entry of a cause, in the better form where there is one.

    Parameters
    ----------
    effect
        The entry.
    form
        The better form; None: there is none.

    Returns
    -------
    dict
        As JSON has it.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.report.record import take_form
    >>> take_form({"name": "ageing"}, None)
    {'name': 'ageing'}
    """
    return form.amend(effect) if form is not None else effect


def describe_left_over(
    remainder: dict[str, Any] | None, form: Form | None, failed: Sequence[str]
) -> dict[str, Any] | None:
    """The report's remainder: open terms, what the catalogue's form leaves, else the sentences of
    the checks that failed.

    Parameters
    ----------
    remainder
        Open terms as JSON has them; None: there are none.
    form
        A better form than the catalogue's; None: there is none.
    failed
        Sentences of closing checks.

    Returns
    -------
    dict or None
        As JSON has it; None where nothing is left over.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.report.record import describe_left_over
    >>> describe_left_over(None, None, ()) is None
    True
    >>> describe_left_over(None, None, ["the residual is not white"])["description"]
    'the residual is not white'
    """
    if form is not None and not (form.catalogued and remainder is None and not failed):
        return form.complete(remainder)
    return describe_in_words("; ".join(failed)) if failed and remainder is None else remainder


def list_diagnosis_doubts(verdict: str, failed: Sequence[str], final: ExtendedFit) -> list[str]:
    """What makes a diagnosis suspect: a word that could not be given, and a drive's log that may be
    why.

    Parameters
    ----------
    verdict
        The word.
    failed
        Sentences of closing checks.
    final
        The last fit.

    Returns
    -------
    list of str
        Sentences.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.report.record import list_diagnosis_doubts
    >>> list_diagnosis_doubts("unexplained", ["the residual is not white"], draw_fit())
    ['the verdict is "unexplained": the residual is not white']
    """
    if verdict in ("adequate", "explained"):
        return []
    scatter = describe_scatter(final)
    open_ = [f'the verdict is "{verdict}": {"; ".join(failed[:3])}'] if failed else []
    return open_ + ([scatter] if scatter else [])
