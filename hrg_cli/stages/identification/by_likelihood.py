"""The first way to answer: all runs together by maximum likelihood, or two modes without axes where
the record shows no more.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import HrgError
from ...fitting.envelopes.base_fit import fit_base_model
from ...fitting.envelopes.base_freedom import Known
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from .modes import identify_free_modes, identify_one_channel
from .outcome import Verdict
from .verdict import POOR_FIT, judge_fit, refuse_contradictions


def identify_by_likelihood(runs: Sequence[EnvelopeRun], known: Known, blocks: int) -> Verdict:
    """All runs together by maximum likelihood, judged; two modes without axes where the record
    shows no more.

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
        The resonator, or frequency and decay of its modes without axes.

    Raises
    ------
    HrgError
        Nothing can be fitted, neither a resonator nor two modes.

    Examples
    --------
    Two runs that turn against each other tell every parameter:

    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.by_likelihood import identify_by_likelihood
    >>> runs = [draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)]
    >>> verdict = identify_by_likelihood(runs, Known(), 100)
    >>> [round(verdict.values[name], 3) for name in ("damping_rate_1_s", "scale_factor")]
    [0.1, 0.55]
    """
    modes = identify_one_channel(runs)
    if modes is not None:
        return modes
    try:
        verdict = judge_fit(
            fit_base_model(runs, known, blocks),
            runs,
            known,
            lambda held: fit_base_model(runs, held, blocks),
        )
    except HrgError:
        modes = identify_free_modes(runs, np.inf)
        if modes is None:
            raise
        return modes
    if verdict.chi2_per_dof > POOR_FIT:
        impossible = (
            bool(verdict.refused)
            or verdict.values["damping_split_1_s"] > verdict.values["damping_rate_1_s"]
        )
        modes = identify_free_modes(runs, verdict.chi2_per_dof, impossible)
        refuse_contradictions(verdict, runs, lambda rest: fit_base_model(rest, known, blocks))
    return verdict if modes is None else modes
