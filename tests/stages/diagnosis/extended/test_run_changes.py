"""The start of a run in the written file is the one that all pieces of the run ask for."""

import pytest
from diagnosis_statistics import hidden

from hrg_cli.stages.diagnose import diagnose, summarise


@pytest.mark.parametrize("seed", (1, pytest.param(2, marks=pytest.mark.slow)))
def test_a_run_cut_where_samples_were_lost_is_written_as_all_its_pieces_ask(seed):
    _, runs = hidden("dropped_samples", seed)
    out = summarise(diagnose(runs))
    assert out["verdict"] == "explained"
    written = out["written_model"]
    # moved to its first piece alone the file missed 1.2 times as much as the fit
    assert written["rms_over_noise"] < 1.03 * written["fitted_rms_over_noise"]
