"""A recording's survey where samples are missing."""

import numpy as np
from conftest import ringing

from hrg_cli.fitting.samples.survey import survey
from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate


def test_samples_that_are_not_finite_do_not_colour_the_noise() -> None:
    """Every look holds a few; the standard deviations stay those of the recording without them."""
    whole = ringing(seconds=3.0, sample_rate_hz=9700.0)
    clean = whole.replace(
        c=whole.c * whole.c_scale_factor,
        s=whole.s * whole.s_scale_factor,
        c_scale_factor=1.0,
        s_scale_factor=1.0,
    )
    holed = clean.replace(c=clean.c.copy(), s=clean.s.copy())
    holed.c[3000:3200] = np.nan
    holed.s[20_000] = np.inf
    holed.s[9000] = np.nan
    assert all(np.isfinite(look.y).all() for look in survey(holed, "r").looks)
    stds = [
        np.nanmedian(collect(demodulate(r, periods_per_window=2.0)).signals_std, axis=0)
        for r in (clean, holed)
    ]
    np.testing.assert_allclose(stds[1], stds[0], rtol=0.08)
