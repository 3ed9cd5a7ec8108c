"""One run on a table that turns, without its log, looks like two unrelated modes: both are said."""

from dataclasses import replace

import numpy as np

from hrg_cli.fitting.envelopes.base_freedom import Known
from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
from hrg_cli.stages.identification.by_likelihood import identify_by_likelihood

TOLD = "so would a resonator on a table that turns"


def test_a_rate_that_no_log_holds_is_a_table_that_turns():
    turned = draw_run_down(0.0, rate_rad_s=0.5)
    run = replace(turned, turn_rad=0 * turned.time_s)
    verdict = identify_by_likelihood([run], Known(), 300)
    (told,) = [reason for reason in verdict.suspect if TOLD in reason]
    assert "KΩ = 0.27" in told and "--fit-rate" in told  # 0.55 · 0.5 rad/s


def test_two_modes_of_any_shapes_are_no_table_that_turns():
    run = draw_run_down(0.0)
    other = np.exp((-0.12 - 4j) * run.time_s)[:, None] * [0.3j, 0.9]
    verdict = identify_by_likelihood([replace(run, envelope=run.envelope + other)], Known(), 300)
    assert "two unrelated modes" in " ".join(verdict.suspect)
    assert TOLD not in " ".join(verdict.suspect)
