"""A drift of more harmonics than the tables hold, and directions of temperature that are noise."""

from dataclasses import replace

import numpy as np
import pytest

from hrg_cli.fitting.tables.drawn_path import draw_path
from hrg_cli.fitting.tables.joint import fit
from hrg_cli.fitting.tables.table_layout import TableLayout
from hrg_cli.stages.calibration.repeatability import _label_programmes
from hrg_cli.stages.calibration.residual_checks import say_harmonics_above


@pytest.mark.parametrize("harmonic, told", [(2, ["8θ", "--harmonics 2"]), (0, [])])
def test_a_harmonic_above_the_limit_is_told_with_its_option(harmonic, told):
    random = np.random.default_rng(2)

    def turned(rate):
        path = draw_path(rate, random)
        drift = 1e-4 * np.cos(4 * harmonic * path.angle_rad) * bool(harmonic)
        steps = np.diff(path.time_s) * (drift[1:] + drift[:-1]) / 2 / path.mode_number
        angle = path.angle_rad + np.concatenate([[0.0], np.cumsum(steps)])
        return replace(path, angle_rad=angle)

    paths = [turned(rate) for rate in (-0.2, -0.1, 0.1, 0.2)]
    said = say_harmonics_above(fit(paths, TableLayout(np.array([20.0]), "temperature", 2, 1, 0)))
    assert len(said) == bool(told) and all(word in said[0] for word in told)


@pytest.mark.parametrize("slope, labels", [(0.0, {""}), (0.01, {"warming"}), (-0.01, {"cooling"})])
@pytest.mark.parametrize("rows", [1, 5, 20])
@pytest.mark.parametrize("averaged", [1, 3])
def test_a_dwell_s_noise_has_no_direction(slope, labels, rows, averaged):
    """Nor where a reading is had every so many rows and the rows between are drawn straight, as
    windows of 10 ms beside a thermometer read twenty times a second are."""
    random = np.random.default_rng(1)
    for _ in range(20):
        read = np.arange(0.0, 410.0 + rows, rows)
        noisy = 0.02 * random.standard_normal(len(read))
        between = np.interp(np.arange(400.0 + averaged - 1), read, noisy)
        noise = np.convolve(between, np.full(averaged, 1 / averaged), "valid")
        path = draw_path(blocks=400, temperature_degc=20 + slope * np.arange(400.0) + noise)
        found, told_by = _label_programmes([path], None)
        assert set(found.ravel()) == labels and told_by == "warming and cooling"


@pytest.mark.parametrize("rows", [1, 20])
def test_a_swinging_temperature_keeps_its_directions(rows):
    read = np.arange(0.0, 400.0 + rows, rows)
    degc = np.interp(np.arange(400.0), read, 20 - np.cos(2 * np.pi * read / 400.0))
    found, _ = _label_programmes([draw_path(blocks=400, temperature_degc=degc)], None)
    assert found[0, :2].tolist() == ["warming"] * 2 and found[0, 3:].tolist() == ["cooling"] * 2
