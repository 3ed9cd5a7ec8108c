"""A written file is held against the measurement with few samples a period, where nothing in it
bends single ones: they tell as much of the oscillation as the file's own."""

from functools import lru_cache

from diagnosis_programme import programme, waves

from hrg_cli.effects import EFFECTS
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.drawn_case import draw_fit
from hrg_cli.stages.diagnosis.extended import written
from hrg_cli.stages.simulation_file import list_runs

DEVICE = {"frequency_hz": 1000.0, "damping_rate_1_s": 0.3}
RECORDING = {"sample_rate_hz": 8764.0, "duration_s": 1.0}


@lru_cache(maxsize=1)
def measured():
    return waves(programme(3, runs=3, duration_s=1.0))


def fit_measured():
    return fit_base(measured(), scale_factor=None, blocks=40, free_phase=False)


def runs_with(effects):
    return list_runs({"device": DEVICE, "recording": RECORDING, "effects": effects})


def test_few_samples_miss_what_the_files_own_do(monkeypatch):
    model, fit = diagnose(measured()).extended_model, fit_measured()
    few = written.hold_written(model, fit, [0, 1, 2], ())
    monkeypatch.setattr(written, "_choose_sampling", lambda *_: written.Sampling(written.PERIODS))
    own = written.hold_written(model, fit, [0, 1, 2], ())
    assert abs(few.rms_over_noise - own.rms_over_noise) < 1e-5
    assert few.fitted_rms_over_noise == own.fitted_rms_over_noise


def test_few_are_made_where_nothing_bends_or_loses_single_ones():
    choose = written._choose_sampling
    linear, fit = runs_with({"gain_mismatch": {"gain": 0.01}}), fit_measured()
    assert choose(fit, linear, EFFECTS).times < 0.4
    # rows of ten periods hold hardly one window of few samples
    assert choose(draw_fit(), linear, EFFECTS) == written.Sampling(written.PERIODS)
    for name, values in (
        ("pickoff_nonlinearity", {"cubic": 1e-3}),
        ("dropped_samples", {"time_s": 0.5, "lost_s": 0.01}),
        ("mains_tone", {"cos_c": 1e-3, "frequency_hz": 50.0}),
    ):
        kept = choose(fit, runs_with({name: values}), EFFECTS)
        assert kept == written.Sampling(written.PERIODS), name
