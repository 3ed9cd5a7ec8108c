"""Programmes over the whole range of gyros, tables and laboratories: no quiet answer is wrong."""

import numpy as np
import pytest

from hrg_cli.stages.identification.methods import ALL
from hrg_cli.studies import programmes, run_downs
from hrg_cli.studies.programmes import (
    UNKNOWN_RATE,
    WRONG,
    assemble,
    draw_figure,
    programmes_study,
    tabulate,
)
from hrg_cli.studies.run_downs import draw, make_envelope


def test_no_quiet_answer_is_wrong_over_the_range():
    study = programmes_study(programmes=6, raw=0.34, seed=1)
    assert study["wrong"] == []
    rows = {row["method"]: row for row in study["rows"]}
    assert {"likelihood", *ALL} <= set(rows)
    assert rows["likelihood"]["quiet"] >= 4 and rows["likelihood"]["worst"] < WRONG
    assert rows["likelihood"]["std_over_bound"] < 1.05
    assert len(tabulate(study)[1]) == len(rows) and draw_figure(study).axes


def test_draws_reach_the_whole_range():
    """Modes, splits that are not there, rests, changing rates, near circles, Earth's rate told and
    not; the same draw twice is the same."""
    drawn = [draw(seed) for seed in range(60)]
    assert {d.gyro.mode_number for d in drawn} == {1, 2, 3}
    tau = [1 / d.gyro.damping_rate_1_s for d in drawn]
    assert min(tau) < 1 and max(tau) > 300
    assert any(d.gyro.frequency_split_rad_s == 0 for d in drawn)
    assert any(not d.earth_told and d.earth_rad_s for d in drawn)
    swing = [max(float(np.ptp(w.rate_rad_s)) for w in d.waves) for d in drawn]
    assert 0.1 < np.mean(np.array(swing) > 0) < 0.6
    round_ = [
        max(abs(w.quadrature_amplitude[0] / w.main_amplitude[0]) for w in d.waves) for d in drawn
    ]
    assert max(round_) > 0.8
    again = draw(7).waves[0]
    assert np.array_equal(again.wave_angle_rad, drawn[7].waves[0].wave_angle_rad)


@pytest.mark.parametrize("kind", ["steady", "sine", "ramp"])
def test_envelopes_of_a_changing_rate_are_those_of_the_samples(kind):
    """The waves' closed form against the second-order equations of motion, sample by sample."""
    random = np.random.default_rng(4)
    gyro = run_downs._gyro(random, True)
    course = run_downs._course(kind, 0.8, 4.0, random)
    (wave,) = run_downs._simulate_samples(gyro, [course], [(0.3, 0.1)], 0.01, 4.0, 1e-7, random)
    first = run_downs.ellipse.compute_envelopes(1.0, 0.1, 0.3, 0.0, gyro.mode_number)
    u = make_envelope(gyro, course, 0.01, np.asarray(wave.time_s), first)
    angle, _ = run_downs.ellipse.unwrap(
        *run_downs.ellipse.find_wave(u, gyro.mode_number)[2:], gyro.mode_number
    )
    off = wave.wave_angle_rad - angle
    period = np.pi / gyro.mode_number
    off -= period * np.round(off / period)
    assert np.abs(off).max() < 1e-4 < 0.05 < np.ptp(angle)


@pytest.mark.parametrize("kind", ["sine", "ramp"])
def test_a_changing_rate_is_marched_finer_than_the_faintest_noise(kind, monkeypatch):
    """To the fourth order of the step: at the second, 2e-5 off, the simulator was 5 σ wrong
    where noise goes down to 1e-6, and hrg was blamed for it."""
    random = np.random.default_rng(4)
    gyro = run_downs._gyro(random, True)
    course = run_downs._course(kind, 0.8, 20.0, random)
    times = (np.arange(100) + 0.5) * 0.2
    begin = (gyro, course, 0.01, times, np.array([1.0, 0.1j]))
    marched = {}
    for substeps in (1, 2, 4, 64):
        monkeypatch.setattr(run_downs, "SUBSTEPS", substeps)
        marched[substeps] = make_envelope(*begin)
    off = {n: np.abs(marched[n] - marched[64]).max() for n in (1, 2, 4)}
    assert off[1] > 12 * off[2]
    assert off[4] < 1e-9


def test_a_wrong_quiet_answer_is_counted_and_a_doubted_one_is_not():
    answer = {"programme": 3, "raw": False, "method": "stokes", "errors": {"scale_factor": -7.0}}
    study = assemble(
        [
            {**answer, "said": "quiet", "over_bound": {}},
            {**answer, "said": "doubted", "over_bound": {}},
        ]
    )
    assert [w["parameter"] for w in study["wrong"]] == ["scale_factor"]
    assert study["rows"][0]["beyond_5"] == 1 and study["rows"][0]["doubted"] == 1


@pytest.mark.slow
def test_five_hundred_programmes_have_no_quiet_answer_beyond_five_sigma():
    study = programmes_study()
    assert study["wrong"] == []
    rows = {row["method"]: row for row in study["rows"]}
    assert 65 < rows["likelihood"]["coverage_68"] < 71
    assert 93 < rows["likelihood"]["coverage_95"] < 97
    assert rows["likelihood"]["std_over_bound"] < 1.05
    assert rows[UNKNOWN_RATE]["quiet"] > 0


def test_a_stopped_study_goes_on_where_it_was(tmp_path, monkeypatch, hrg):
    """Stopped after its first answers were kept, and given the same folder again: only what is
    missing is drawn, the figures are those of a study that was not stopped, and more programmes
    can be added to it; other settings begin anew."""
    drawn = []

    def answer(task):
        drawn.append(task[0])
        if len(drawn) == 7 and not (tmp_path / "stopped").exists():
            (tmp_path / "stopped").touch()
            raise KeyboardInterrupt
        errors = {"scale_factor": float("nan") if task[0] == 2 else 0.1 * task[0]}
        own = {"said": "quiet", "errors": errors, "over_bound": {"scale_factor": 1.0}, "why": ""}
        return [{"programme": task[0], "raw": task[1], "method": "likelihood", **own}]

    monkeypatch.setattr(programmes, "_answers_of", answer)
    folder = tmp_path / "study"
    asked = ["study", "programmes", "-o", folder, "--set", "raw=0.2", "--set"]
    assert hrg(*asked, "programmes=10").status != 0
    assert (folder / "programmes.unfinished.json").is_file() and drawn == list(range(7))
    drawn.clear()
    done = hrg(*asked, "programmes=12", "--json")
    assert done.status == 0, done.err
    assert drawn == list(range(4, 12))
    assert not (folder / "programmes.unfinished.json").exists()
    whole = programmes_study(programmes=12, raw=0.2)
    assert done.json["result"]["rows"][0]["quiet"] == 12
    assert done.json["result"]["rows"][0]["beyond_5"] == whole["rows"][0]["beyond_5"] == 1
    assert done.json["result"]["wrong"][0]["programme"] == 2
