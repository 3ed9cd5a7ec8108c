"""Exactly eight samples a period: rounding repeats with the wave, and odd multiples of the
oscillation fold onto one another."""

from functools import partial

import numpy as np
from wrong_runs import estimated, recordings, table_of

from hrg_cli.effects import EFFECTS
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.samples.waveform import find_waveform_causes
from hrg_cli.stages.diagnosis.suspects import suspect_runs

FITTED = partial(fit_base, scale_factor=None, blocks=120, free_phase=False)


def eight_a_period(seed, spoil):
    """Waves of five runs whose samples are spoilt."""
    table = table_of(seed, runs=5, noise=2e-5, duration_s=1.0, turning=0)
    table["recording"]["sample_rate_hz"] = 8 * table["device"]["frequency_hz"]
    records = recordings(table, seed)
    return estimated([r.replace(c=spoil(r.c), s=spoil(r.s)) for r in records], 20.0)


def test_what_a_dead_zone_makes_of_two_multiples_is_no_tone():
    """Larger than any cubic that the motion allows, the line at 3f is the fifth's as well."""
    waves = eight_a_period(2, lambda y: np.where(np.abs(y) < 0.01, 0.0, np.asarray(y)))
    hz = waves[0].reference_frequency_hz
    shown, lines = find_waveform_causes(waves, [], [], hz, [], 0.0, lambda: 1e-6)
    assert shown == []
    meanings = [one["meaning"] for one in lines if abs(one["frequency_hz"] / hz - 3) < 1e-2]
    assert meanings and all("multiples 3 and 5" in one for one in meanings)


def test_no_run_of_few_codes_is_blamed_for_what_rounding_leaves():
    """A gain of its own took all but 356 of χ² = 8.7e5 a degree of freedom."""
    waves = eight_a_period(4, lambda y: 0.01 * np.round(np.asarray(y) / 0.01))
    base = FITTED(waves)
    assert base.chi2 / base.dof > 1e5
    dynamics = [effect for effect in EFFECTS if effect.seen_in == "dynamics"]
    assert suspect_runs(waves, FITTED, base, list_variants(dynamics, base)) == []
