"""Designs whose columns stand beside what is unknown, against the same as one matrix."""

from dataclasses import replace

import numpy as np
import pytest

from hrg_cli.fitting.causes import evidence
from hrg_cli.fitting.causes.designs import Basis, Design, factor_design


@pytest.mark.parametrize(
    "variance", [np.array([1e2, 0.5, 3.0]), np.array([1e2, np.inf, 3.0]), None]
)
def test_what_is_known_by_its_size_is_taken_off_by_that_alone(variance):
    random = np.random.default_rng(1)
    J = np.zeros((60, 6))
    J[:20, :2], J[20:, 2:4], J[:, 4:] = (random.normal(size=n) for n in ((20, 2), (40, 2), (60, 2)))
    unknown = Basis((), np.linalg.qr(random.normal(size=(60, 3)))[0], variance)
    blocks = [(slice(0, 20), slice(0, 2)), (slice(20, 60), slice(2, 4))]
    basis = factor_design(replace(Design.from_matrix(J, blocks), unknown=unknown)).basis
    # the same as one matrix
    Q = np.linalg.qr(unknown.project_out_shared(J))[0]
    S, r = (unknown.project_out_shared(random.normal(size=n)) for n in ((60, 2), 60))
    left = S - Q @ (Q.T @ S)
    assert basis.project_out(S) == pytest.approx(left, abs=1e-12)
    free = 0 if variance is None else np.isfinite(variance).sum()
    assert basis.shape[1] == 6 + 3 - free
    score = evidence.score("both", r - Q @ (Q.T @ r), S, basis)
    assert score.estimate == pytest.approx(np.linalg.lstsq(left, r, rcond=None)[0])
    assert score.std == pytest.approx(np.sqrt(np.diag(np.linalg.inv(left.T @ left))))
