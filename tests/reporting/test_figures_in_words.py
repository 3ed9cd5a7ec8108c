"""What a person reads of a file's or a command's figures: words and units, nothing that is not
there, each reason once."""

import pytest
import records_by_hand as by_hand

from hrg_cli import store
from hrg_cli.reporting.console import NUMERAL
from hrg_cli.reporting.figures_in_words import list_told

TWO_LINES = 200
"""Characters."""


@pytest.mark.parametrize(
    ("key", "value", "words", "said"),
    [
        ("window_s", 0.01, "window", "10 ms"),
        ("reference_frequency_hz", 1003.7895, "reference frequency", "1003.79 Hz"),
        ("wave_angle_std_rad", 3.5e-4, "wave angle σ", "350 µrad"),
        ("chi2_per_dof", 1.5, "χ² per dof", "1.5"),
        ("rate_min_rad_s", -4.0, "rate min", "−229.183 °/s"),
        ("usable", 0, "usable", "0"),
        ("wave_angle_std_rad", 2.32675e-4, "wave angle σ", "233 µrad"),
        ("error_over_std_rms", 13.8456, "error over σ rms", "13.8"),
        ("least_count", 3.66211e-5, "least count", "3.66×10⁻⁵"),
        ("node_min", 0.0, "node min", "0"),
        ("run_ids", ["a", "b"], "run ids", "a, b"),
        ("gyro_id", "[7]-G", "gyro id", "[7]-G"),
    ],
)
def test_a_figure_has_words_and_its_unit(key, value, words, said):
    assert list_told({key: value}) == [(words, said)]


def test_what_is_not_there_is_not_told():
    nothing = {
        "details": '{"a": 1}',
        "flagged_gap": 0,
        "lot_id": "",
        "rate": None,
        "elapsed_s": 2.0,
    }
    assert list_told(nothing) == [] == list_told({"residual_rms": 0.0})


@pytest.mark.parametrize("text", ["10.01", "−1.7", "3.66×10⁻⁵", "4.1(3)", "–", ""])
def test_numbers_stand_right(text):
    assert NUMERAL.fullmatch(text)


@pytest.mark.parametrize("text", ["10 ms", "1 constant scale factor", "2(1) °/h", "x"])
def test_words_stand_left(text):
    assert not NUMERAL.fullmatch(text)


def test_info_says_a_reason_and_a_parameter_once_in_short_lines(tmp_path, hrg):
    path = tmp_path / "resonator.h5"
    reason = "χ²/dof = 21.1: the linear resonator leaves more than the noise"
    store.write(path, by_hand.resonator().judged([reason]))
    shown = hrg("info", path).out
    assert shown.count(reason) == 1 and shown.count("stiffness axis") == 1
    assert "frequency_hz" not in shown and max(map(len, shown.splitlines())) <= TWO_LINES
