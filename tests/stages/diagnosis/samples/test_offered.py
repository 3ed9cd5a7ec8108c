"""What the samples show is asked as every cause is: its size off nought by its own σ, all parts
together."""

import dataclasses

import numpy as np
import pytest

from hrg_cli.effects import find
from hrg_cli.stages.diagnosis.closing.closing_checks import make_closing_checks
from hrg_cli.stages.diagnosis.closing.sized import Sized
from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_waves
from hrg_cli.stages.diagnosis.samples.lines import Line
from hrg_cli.stages.diagnosis.samples.offered import make_entry, measure_sigma
from hrg_cli.stages.diagnosis.samples.tone import Tone
from hrg_cli.stages.diagnosis.samples.waveform import find_waveform_causes

FREQUENCY = {"frequency_hz": (510.0, 1e-3, "Hz")}


def failures(entry):
    case = draw_case()
    checks = make_closing_checks(case, Sized.from_case(case), None, [entry])
    return [check.name for check in checks if not check.passed and check.name != "written_model"]


def tone_of(size, std, parts=("c_cos", "c_sin")):
    parameters = {part: (size, std, "amplitude") for part in parts} | FREQUENCY
    return make_entry(find("mains_tone"), 114.0, parameters, 13e3)


@pytest.mark.parametrize(("times", "stands"), [(1.0, False), (2.0, False), (2.2, True)])
def test_both_parts_of_a_tone_are_asked_together(times, stands):
    entry = tone_of(times * 1e-5, 1e-5)
    assert measure_sigma(entry) == pytest.approx(times * np.sqrt(2))
    assert failures(entry) == [] if stands else ["mains_tone_stands_off_zero"]


def test_a_size_without_a_deviation_and_one_larger_than_the_wave_do_not_pass():
    assert failures(tone_of(1e-4, 0.0)) == ["mains_tone_stands_off_zero"]
    assert failures(tone_of(9.0, 1e-4)) == ["mains_tone_is_possible"]


def test_a_tone_tells_as_many_sigma_as_its_size_has():
    waves, vector = draw_waves(), np.full((3, 2), 3e-4 + 1e-4j)
    for excess in (1.0, 25.0):
        std = np.full((3, 2), 1e-5 * np.sqrt(excess))
        gain = float(np.sum(np.abs(vector) ** 2 / std**2))
        shown, _ = find_waveform_causes(waves, [], [Tone(510.0, vector, std, gain)], 500.0, [])
        (entry,) = shown
        assert entry["z"] == pytest.approx(measure_sigma(entry), rel=1e-9)
        assert entry["z"] == pytest.approx(np.sqrt(gain), rel=0.02)


def test_the_smaller_amplitude_of_a_line_is_known_no_better_than_the_larger():
    line = Line(1234.0, np.array([1e-3, 1e-5]), 50.0, 3, np.ones((3, 2)))
    assert line.std == pytest.approx([1e-4, 1e-4])
    twice = dataclasses.replace(line, ratio=200.0)
    assert twice.std == pytest.approx([5e-5, 5e-5])
