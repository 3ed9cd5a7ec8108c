"""Windows that hold more than noise: told where nothing explains them, clipped tops where they are
those of the largest signal, and none in sound runs."""

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.effects import find
from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.samples.odd_windows import (
    are_at_top,
    find_odd_windows,
    say_odd_windows,
)
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import list_run_ids, simulate

NOISE = 3e-4


def damaged(table, damage, periods_per_window=10.0):
    """The programme's waves, every run's samples (n,) of both channels changed by damage(k, c, s,
    random)."""
    random, out = np.random.default_rng(4), []
    for k, run in enumerate(list_run_ids(table)):
        recording = collect(simulate(table, run=run))
        c, s = damage(k, np.array(recording.c), np.array(recording.s), random)
        recording = recording.replace(c=c, s=s)
        periods = collect(demodulate(recording, periods_per_window=periods_per_window))
        out.append(collect(estimate(periods)))
    return out


def clipped(level):
    """Tops cut before the noise comes on, so that no two samples are equal."""

    def damage(_, c, s, random):
        return tuple(
            np.clip(x, -level, level) + NOISE * random.standard_normal(len(x)) for x in (c, s)
        )

    return damage


def burst(k, c, s, random):
    """Thirty samples of ten times the noise in one run."""
    if k == 1:
        c[9000:9030] += 40 * NOISE * random.standard_normal(30)
    return c, s


@pytest.mark.parametrize("periods", (3.0, 10.0, 40.0))
def test_sound_runs_have_none(periods):
    table = programme(2, runs=4, noise=NOISE)
    table["run"][2]["environment"]["rate"] = {
        "kind": "steps",
        "levels_rad_s": [1.0, -1.0, 2.0],
        "dwell_s": 0.4,
    }
    table["run"][2]["environment"].pop("rate_rad_s")
    assert find_odd_windows(waves(table, periods_per_window=periods)) == []


def test_ends_of_a_run_that_turns_fast_within_a_window_are_none():
    """A split of 2 rad/s bends the envelopes by 0.08 rad a window, and at the ends the bend is
    continued: there σ holds that doubt, up to fourteen times the noise."""
    table = programme(1, runs=4, noise=1e-5)
    table["device"] |= {"frequency_hz": 1003.7, "frequency_split_rad_s": 2.0}
    seen = waves(table)
    assert max(w.signal_std[0] / np.median(w.signal_std) for w in seen) > 5
    assert find_odd_windows(seen) == []


def turning(quality, periods, turn_rad, noise=NOISE / 3):
    """A programme of three runs whose waves die with a Q and turn by mθ a window: not at all, by
    as much as is asked, and by 0.7 of it the other way."""
    table = programme(1, runs=3, noise=noise)
    hz = 1003.7
    window_s, life_s = periods / hz, quality / (np.pi * hz)
    table["device"] |= {
        "frequency_hz": hz,
        "damping_rate_1_s": 1 / life_s,
        "damping_split_1_s": 0.02 / life_s,
        "frequency_split_rad_s": 0.5,
    }
    table["recording"]["duration_s"] = max(60 * window_s, min(3.75 * life_s, 150 * window_s))
    for run, part in zip(table["run"], (0.0, 1.0, -0.7), strict=True):
        run["environment"]["rate_rad_s"] = part * turn_rad / window_s / 0.55
    return table


@pytest.mark.parametrize(
    ("quality", "periods"),
    ((300, 5.0), (300, 20.0), (1e3, 12.0), (3e3, 12.0), (3e3, 20.0), (1e4, 10.0)),
)
def test_waves_that_die_and_turn_within_a_window_have_none(quality, periods):
    """At the ends the bend is continued, up to 270 times the noise; that of 3e3 and 12 periods has
    a reference between its two lines."""
    for turn_rad in (0.05, 0.15, 0.3, 0.5):
        seen = waves(turning(quality, periods, turn_rad), periods_per_window=periods)
        assert find_odd_windows(seen) == []


@pytest.mark.parametrize(("quality", "periods", "row"), ((300, 5.0, 28), (1e3, 20.0, 24)))
def test_a_burst_in_a_wave_that_turns_within_a_window_is_odd(quality, periods, row):
    def damage(k, c, s, random):
        if k == 1:
            at = int(0.4 * len(c))
            c[at : at + 30] += 40 * NOISE / 3 * random.standard_normal(30)
        return c, s

    odd = find_odd_windows(damaged(turning(quality, periods, 0.15), damage, periods))
    assert {one.run for one in odd} == {1} and row in {one.row for one in odd}


def test_clipped_tops_of_a_wave_that_turns_within_a_window_are_odd():
    odd = find_odd_windows(damaged(turning(300, 20.0, 0.15, noise=0.0), clipped(0.96), 20.0))
    assert {one.run for one in odd} == {0} and {one.row for one in odd} <= {0, 1}


def test_a_whole_diagnosis_of_such_waves_is_adequate():
    seen = waves(turning(1e3, 12.0, 0.15), periods_per_window=12.0)
    assert summarise(diagnose(seen))["verdict"] == "adequate"


def test_harmonics_of_a_named_read_out_make_no_odd_window():
    """Seven samples and eight a period: what the third harmonic leaves in a window goes by where
    they fall."""
    table = programme(
        3, {"pickoff_nonlinearity": {"cubic": 3e-3}}, runs=3, noise=1e-4, duration_s=5.0
    )
    table["device"] |= {"frequency_hz": 1003.7, "damping_rate_1_s": 0.5}
    table["recording"]["sample_rate_hz"] = 8000.0
    for run in table["run"]:
        run["start"] |= {"amplitude": 1.0, "quadrature": 0.05}
    seen = waves(table, periods_per_window=1.0)
    assert len(find_odd_windows(seen)) >= 1
    out = summarise(diagnose(seen))
    assert out["verdict"] == "explained"
    assert [e["name"] for e in out["effects"]] == ["pickoff_nonlinearity"]


def test_a_burst_is_told_and_takes_the_word_away():
    diagnosis = diagnose(damaged(programme(2, runs=4, noise=NOISE), burst))
    out = summarise(diagnosis)
    assert out["effects"] == [] and out["verdict"] == "unexplained"
    failed = [check["name"] for check in out["checks"] if not check["passed"]]
    assert failed == ["windows_alike"] and "run1 at 0.4" in str(diagnosis.status_reasons)


def test_a_burst_beside_a_named_read_out_is_told():
    """In long windows harmonics hardly touch the fitted envelopes, whatever the read-out makes."""
    seen = damaged(programme(2, runs=4, noise=NOISE), burst)
    cubic = find("pickoff_nonlinearity")
    assert "run1" in say_odd_windows(seen, [], [cubic], [(cubic, {"cubic": 3e-3})])


def test_noisy_tops_that_were_clipped_are_saturation():
    """The first 8 ms of the runs that start at amplitude 1 and die within 200."""
    table = programme(2, runs=4, noise=0.0, duration_s=0.5)
    table["device"]["damping_rate_1_s"] = 5.0
    for run in table["run"]:
        run["start"]["wave_angle_rad"] = 0.02
    seen = damaged(table, clipped(0.96))
    assert len(odd := find_odd_windows(seen)) >= 3 and are_at_top(seen, odd)
    out = summarise(diagnose(seen))
    assert [e["name"] for e in out["effects"]] == ["saturation"]
    level = out["effects"][0]["parameters"]["inverse_level"]
    assert level["value"] == pytest.approx(1 / 0.96, rel=0.03)
    assert "windows_alike" not in [c["name"] for c in out["checks"] if not c["passed"]]
