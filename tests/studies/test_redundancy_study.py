"""What the redundant equations reveal: residuals by theory, and exactly nothing for what acts
before the carrier."""

import json

import numpy as np
import pytest

from hrg_cli.studies.redundancy import draw_figure, redundancy_study


@pytest.fixture(scope="module")
def study():
    return redundancy_study(vectors=20_000, seed=1)


@pytest.fixture(scope="module")
def rows(study):
    return {row["defect"]: row for row in study["defects"]}


def test_visible_defects_leave_the_residual_of_theory(rows):
    generator = np.random.default_rng(2)
    A, B = generator.uniform(-1, 1, (2, 20_000))
    theta = generator.uniform(0, 2 * np.pi, 20_000)
    c, s = (
        A**2 * np.cos(theta) ** 2 + B**2 * np.sin(theta) ** 2,
        A**2 * np.sin(theta) ** 2 + B**2 * np.cos(theta) ** 2,
    )
    expected = {
        "sideband_gain": np.sqrt(2 / 3) / 4,
        "carrier_phase_mismatch": np.sqrt(np.mean(c * s / (c + s))) / 2,
        "signal_offset": np.sqrt(3 / 64),
    }
    for name, value in expected.items():
        assert rows[name]["visible"]
        assert rows[name]["residual_rms_per_unit"] == pytest.approx(value, rel=0.03), name


@pytest.mark.parametrize(
    "name",
    [
        "gain_mismatch",
        "phase_mismatch",
        "electrode_nonorthogonality",
        "quadrature_crosstalk",
        "envelope_cubic",
    ],
)
def test_defects_before_the_carrier_are_invisible_but_do_harm(rows, name):
    assert not rows[name]["visible"]
    assert rows[name]["residual_rms_per_unit"] < 1e-11
    assert rows[name]["wave_angle_error_rms_per_unit"] > 0.03


def test_angle_errors_are_those_of_the_catalogue(rows):
    """R1 and R2: δθ = −(g/4) sin 4θ and (ε/4) cos 4θ physical, twice that electrical, rms over θ; ±
    0.1 of quadrature adds 1 %."""
    assert rows["gain_mismatch"]["wave_angle_error_rms_per_unit"] == pytest.approx(
        1 / np.sqrt(8), rel=0.03
    )
    assert rows["electrode_nonorthogonality"]["wave_angle_error_rms_per_unit"] == pytest.approx(
        1 / np.sqrt(8), rel=0.03
    )
    assert rows["carrier_phase_mismatch"]["wave_angle_error_rms_per_unit"] < 1e-3


def test_the_figure_and_the_table_can_be_written(study, tmp_path):
    json.dumps(study, allow_nan=False)
    draw_figure(study).savefig(tmp_path / "study.png")
    assert (tmp_path / "study.png").stat().st_size > 10_000
