"""A base value that is another beside a cause that cannot be told from the one named is not known
better than that: the frequency no less than the others."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hrg_cli.fitting.causes import extended_fit
from hrg_cli.stages.diagnosis.closing.sized import Sized
from hrg_cli.stages.diagnosis.drawn_case import draw_fit
from hrg_cli.stages.diagnosis.report.base_values import list_base_values
from hrg_cli.stages.diagnosis.report.shares import compute_base_covariance

SHIFT = 1e-3
"""In rad/s, of every run's frequency and of every coordinate."""


def test_what_a_rival_moves_is_in_every_sigma():
    fit = draw_fit()
    moved = replace(fit.point, p=fit.point.p + SHIFT, offset_rad_s=fit.point.offset_rad_s + SHIFT)
    rival = extended_fit.fit(fit.series, moved, fit.freedom, most=0)
    told = [
        {
            row["name"]: row
            for row in list_base_values(Sized(fit, fit, 1.0, in_place=near), None, {}, {})
        }
        for near in ((), (rival,))
    ]
    for name, by in (
        ("frequency_hz", SHIFT / (2 * np.pi)),
        ("damping_rate_1_s", SHIFT),
        ("scale_factor", SHIFT),
    ):
        alone, beside = (rows[name]["std"] for rows in told)
        assert beside == pytest.approx(np.hypot(alone, by), rel=1e-6)


def test_what_is_assumed_has_its_variance_too():
    """A bell's resonator had K 0.55 ± 0.55 beside a variance of 0, as if it were known exactly."""
    fit = draw_fit()
    known = fit.coordinate_covariance().copy()
    known[5] = known[:, 5] = 0.0
    held = SimpleNamespace(point=fit.point, series=fit.series, coordinate_covariance=lambda: known)
    std = np.array([1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 0.55])
    covariance = compute_base_covariance(held, std)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), std, rtol=1e-12)
    assert not covariance[-1, :-1].any()
