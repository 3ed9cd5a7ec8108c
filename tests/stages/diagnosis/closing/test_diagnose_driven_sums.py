"""What driven runs alone show of the damping is its sum with what the forcers do: a gain mismatch of
theirs is a damping split, a gain of both a damping (PHYSICS C3, §2 (iii))."""

import numpy as np
import pytest

from hrg_cli import collect, demodulate, estimate, simulate
from hrg_cli.effects import EFFECTS
from hrg_cli.fitting.envelopes.coordinates import COORDINATES
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.closing.sized import Sized
from hrg_cli.stages.diagnosis.closing.summed import estimate_moves_of_summed
from hrg_cli.stages.diagnosis.fits.scoring import score_effects
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.report.base_values import list_base_values
from hrg_cli.stages.diagnosis.search.inquiry import Inquiry
from hrg_cli.stages.diagnosis.search.search_case import Case
from hrg_cli.stages.diagnosis.search.selection import Search

NU, SPLIT, AXIS = 0.3, 0.01, 0.4
GAIN, MISMATCH = 0.005, 0.02
OF_DRIVE = [effect for effect in EFFECTS if effect.name in ("drive_gain", "drive_gain_mismatch")]
DEVICE = {
    "frequency_hz": 1000.0,
    "damping_rate_1_s": NU,
    "damping_split_1_s": SPLIT,
    "damping_axis_rad": AXIS,
    "frequency_split_rad_s": 0.05,
    "stiffness_axis_rad": 0.9,
    "scale_factor": 0.55,
}


def case_of(free):
    """Three driven runs of a gyro whose forcers differ, and as many free ones; the case without any
    cause."""
    config = {
        "device": DEVICE,
        "readout": {"noise": 5e-3},
        "effects": {"drive_gain": {"gain": GAIN}, "drive_gain_mismatch": {"gain": MISMATCH}},
        "recording": {"sample_rate_hz": 4501.0, "duration_s": 4.0},
        "run": [
            {
                "run_id": f"{mode}{rate:+g}",
                "start": {"wave_angle_rad": 0.3 * rate},
                "control": {"mode": mode, "quadrature_loop": "finite", "quadrature_gain_1_s": 100.0}
                if mode == "forced"
                else {"mode": mode},
                "environment": {"rate_rad_s": rate},
            }
            for mode in (("forced", "free") if free else ("forced",))
            for rate in (2.0, -2.0, 3.0)
        ],
    }
    waves = [
        collect(estimate(collect(demodulate(collect(simulate(config, run=run["run_id"]))))))
        for run in config["run"]
    ]
    fit = fit_base(waves, scale_factor=None, blocks=120, free_phase=False)
    candidates = tuple(list_variants(OF_DRIVE, fit))
    last = tuple(score for score, _ in score_effects(fit, candidates))
    return Case(Inquiry(candidates, 1), Search(fit, fit, (), last, last), None)


def told(case):
    sized = Sized(case.search.final, case.search.final, 1.0)
    return {
        row["name"]: row
        for row in list_base_values(sized, None, estimate_moves_of_summed(case), {})
    }


@pytest.fixture(scope="module")
def driven():
    return case_of(free=False)


def size_of(estimate, std, typical):
    """How large it may be: a Cauchy prior of its typical size times what the data say, its middle
    and a quarter of its middle 95 %."""
    size = np.linspace(-50, 50, 200_001) * max(std, typical)
    chance = np.exp(-(((size - estimate) / std) ** 2) / 2) / (1 + (size / typical) ** 2)
    below = np.cumsum(chance) / chance.sum()
    low, middle, high = np.interp([0.0228, 0.5, 0.9772], below, size)
    return np.hypot(middle, (high - low) / 4)


def test_driven_runs_alone_move_the_damping_by_what_the_forcers_do(driven):
    moved = estimate_moves_of_summed(driven)
    # −N u + (1 + g)F u/a: a common excess g of both forces is −gν, a mismatch g −(g/2)ν of the split
    at = COORDINATES.index
    slopes = {"drive_gain": ("damping", -NU), "drive_gain_mismatch": ("damping_cos", -NU / 2)}
    for score, variant in score_effects(driven.search.final, driven.inquiry.candidates):
        typical = variant.effect.parameters[0].typical
        name, slope = slopes[score.name]
        move = np.linalg.norm(moved[score.name], axis=1)
        assert move[at(name)] == pytest.approx(
            abs(slope) * size_of(score.estimate[0], score.std[0], typical), rel=0.05
        )
        assert move[at("scale_factor")] < 0.01 * move[at(name)]


def test_what_the_forcers_may_add_is_in_every_sigma_of_driven_runs(driven):
    row = told(driven)
    assert row["damping_rate_1_s"]["sum_with"] == ["drive_gain"]
    assert "drive_gain_mismatch" in row["damping_split_1_s"]["sum_with"]
    assert "sum_with" not in row["scale_factor"]
    for name, true in (
        ("damping_rate_1_s", NU), ("damping_split_1_s", SPLIT), ("damping_axis_rad", AXIS),
    ):  # fmt: skip
        # twice the typical mismatch, half the typical gain
        assert abs(row[name]["value"] - true) < 3 * row[name]["std"]
    split = SPLIT * np.array([np.cos(4 * AXIS), np.sin(4 * AXIS)])
    shown = np.hypot(split[0] - MISMATCH / 2 * NU, split[1])
    assert row["damping_split_1_s"]["value"] == pytest.approx(shown, rel=0.03)


def test_a_free_run_beside_them_parts_the_sum():
    case = case_of(free=True)
    assert estimate_moves_of_summed(case) == {}
    assert all("sum_with" not in row for row in told(case).values())
