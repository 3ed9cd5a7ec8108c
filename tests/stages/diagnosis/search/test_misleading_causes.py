"""A cause beside a gross misfit that takes χ² where the windows weigh most, and adds to what is left
of the wave itself."""

from functools import partial

from hrg_cli.effects import find
from hrg_cli.formats import import_log
from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.fits.refits import adopt
from hrg_cli.stages.diagnosis.fits.scoring import is_gross, score_effects
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.search.forecast import drop_misleading
from hrg_cli.stages.diagnosis.search.gain import measure_left
from hrg_cli.stages.diagnosis.search.inquiry import Inquiry
from hrg_cli.stages.diagnosis.search.search_case import Case
from hrg_cli.stages.diagnosis.search.selection import Found, Search
from hrg_cli.stages.estimate import estimate

FITTED = partial(fit_base, scale_factor=None, blocks=120, free_phase=False)


def test_a_bell_keeps_no_cause_that_leaves_more_of_its_wave(measured_data):
    """Its σ falls twenty times from the first windows to the last: χ² falls by a seventh with a
    cubic stiffness, and the rms that it leaves grows by as much."""
    log = import_log(
        measured_data / "bell" / "perc_bell.flac", c="1", s="2", nominal_frequency_hz=3618.0,
        constant_rate_rad_s=0.0, from_s=0.3,
    )  # fmt: skip
    wave = collect(estimate(collect(demodulate(collect(log), periods_per_window=20))))
    base = FITTED([wave])
    candidates = list_variants([find("cubic_stiffness")], base)
    score, variant = score_effects(base, candidates)[0]
    final = adopt(base, score, variant)
    assert is_gross(final) and final.chi2 < 0.9 * base.chi2
    assert measure_left(final) > 1.1 * measure_left(base)

    found = (Found(variant, score, 30, base.chi2 - final.chi2, ()),)
    case = Case(Inquiry(tuple(candidates), 1), Search(base, final, found, (score,), (score,)))
    assert drop_misleading(case).search.found == ()
