"""Frequencies that go with the times at which the runs began, and stand still within the runs."""

from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.search.starts import tell_course


def test_a_frequency_that_creeps_between_runs_alone_is_told_with_its_rate():
    """1e-8 a second over five runs in two hours, none within them: it is no ageing, and "nothing in
    the catalogue follows it"."""
    table = programme(4, runs=5, duration_s=2.0)
    hz = table["device"]["frequency_hz"]
    for run, h in zip(table["run"], (0.0, 0.3, 0.9, 1.4, 2.0), strict=True):
        run["device"] = {"frequency_hz": hz * (1 + 1e-8 * 3600 * h)}
        run["recording"] = {"start_time": f"2026-05-04T0{int(h)}:{round(60 * (h % 1)):02}:00Z"}
    out = summarise(diagnose(waves(table)))
    told = out["frequencies"]["sentence"]
    assert out["effects"] == [] and "they go with the times at which the runs began" in told
    slope = float(told.split("by ")[2].split()[0])
    assert abs(slope / 1e-8 - 1) < 0.02


def test_frequencies_that_scatter_or_agree_are_told_as_they_were():
    times = [f"2026-05-04T0{h}:00:00Z" for h in range(5)]
    hz = [1e3 + d for d in (0.0, 3e-6, 1e-6, 4e-6, 2e-6)]
    said = {"hz": hz, "sigma": 50.0, "sentence": "they differ; repeat a run"}
    assert tell_course(said, times) == said
    creeping = said | {"hz": [1e3 + 1e-6 * k for k in range(5)]}
    assert tell_course(creeping, times) != creeping
    for odd in ("", "yesterday"):
        assert tell_course(creeping, [*times[:4], odd]) == creeping
    agreed = {"hz": [1e3 + 1e-9 * k for k in range(5)], "sigma": 1.0, "sentence": "they agree"}
    assert tell_course(agreed, times) == agreed
