"""A run of which no mistake is found is blamed on harder terms than one whose mistake is."""

from dataclasses import replace

import numpy as np
import pytest
from wrong_runs import estimated, recordings, table_of

from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.drawn_case import draw_fit
from hrg_cli.stages.diagnosis.suspects.cases import SuspectFound
from hrg_cli.stages.diagnosis.suspects.search import UNLIKE, _is_cleared
from hrg_cli.stages.suspicion import Suspicion


def found_with(what, left):
    return SuspectFound((Suspicion("run1", what, "", ""),), 1, draw_fit(), fit_at(left), left)


def fit_at(chi2_per_dof):
    fit = draw_fit()
    return replace(fit, residual=fit.residual * (chi2_per_dof * fit.dof / fit.chi2) ** 0.5)


@pytest.mark.parametrize(
    ("what", "left", "before", "physics", "cleared"),
    [
        ("channels swapped", 10.6, 2815.0, 54.0, False),
        ("channels swapped", 10.6, 2815.0, 30.0, True),
        # driven runs behind a turned drive: the catalogue's first causes left 54, all of them 0.92
        (UNLIKE, 10.6, 2815.0, 54.0, True),
        (UNLIKE, 1.0, 2815.0, 54.0, False),
        # a contact in every run: two of five sound ones were blamed, and χ² 168 was left
        (UNLIKE, 168.0, 2608.0, 2600.0, True),
        # another gyro's run beside a cause that the catalogue does not hold
        (UNLIKE, 168.0, 2e6, 1e6, False),
    ],
)
def test_what_clears_a_run(what, left, before, physics, cleared):
    assert _is_cleared(found_with(what, left), fit_at(before), (), physics) is cleared


def test_a_scale_factor_of_the_other_sign_is_no_other_gyros():
    """Beside a gain mismatch in all runs, which a run fitted alone takes up, a rate log of the
    wrong sign was "another gyro" with the same frequency, damping and split."""
    table = table_of(4, {"gain_mismatch": {"gain": 2e-3}}, turning=1, noise=1e-5)
    records = recordings(table, 4)
    records[2] = records[2].replace(rate_rad_s=-np.asarray(records[2].rate_rad_s))
    out = summarise(diagnose(estimated(records)))
    (one,) = out["suspect_runs"]
    assert one["run_id"] == "run2" and one["what"].startswith("rate log of wrong s")
    assert "sign" in one["correction"] or "by -1," in one["correction"]
