"""A run played backwards: its amplitude grows as the others' falls."""

import numpy as np
import pytest

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.diagnosis.suspects.backwards import find_backward_runs
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify

SAMPLING_HZ, FREQUENCY_HZ, DAMPING_1_S, LENGTH_S = 8123.0, 1000.3, 0.5, 2.0


def run(place, backwards=False, damping_1_s=DAMPING_1_S, course=None):
    """A wave that turns with the table and decays, or grows and falls as `course` says."""
    t = np.arange(0, LENGTH_S, 1 / SAMPLING_HZ)
    rate = (-1.0, 0.6, 1.3)[place]
    theta = 0.3 + place - 0.55 * rate * t / 2
    size = np.exp(-damping_1_s * t) if course is None else course(t)
    phase = 2 * np.pi * FREQUENCY_HZ * t
    wave = np.stack(
        [
            np.cos(2 * theta) * np.cos(phase) - 0.04 * np.sin(2 * theta) * np.sin(phase),
            np.sin(2 * theta) * np.cos(phase) + 0.04 * np.cos(2 * theta) * np.sin(phase),
        ]
    )
    samples = size * wave + 3e-4 * np.random.default_rng(place).standard_normal((2, len(t)))
    c, s = samples[:, ::-1] if backwards else samples
    recording = Recording(
        c=c, s=s, sample_rate_hz=SAMPLING_HZ, mode="free", gyro_id="G", run_id=f"r{place}",
        auxiliary_time_s=np.array([0.0, LENGTH_S]), rate_rad_s=np.array([rate, rate]),
    )  # fmt: skip
    return collect(estimate(collect(demodulate(recording, periods_per_window=12.0))))


def test_it_is_named_by_both_commands():
    waves = [run(0), run(1, backwards=True), run(2)]
    found = diagnose(waves)
    assert found.status == "refused"
    assert [one["run_id"] for one in found.told("suspect_runs")] == ["r1"]
    assert any(
        why.startswith("r1: samples run backwards (its amplitude grows")
        for why in identify(waves).status_reasons
    )


@pytest.mark.parametrize(
    "waves",
    [
        lambda: [run(place, damping_1_s=0.02, backwards=place == 1) for place in range(3)],
        lambda: [run(0), run(1, course=lambda t: np.where(t < 1, 0.3, np.exp(1 - t))), run(2)],
        lambda: [run(0), run(1, course=lambda t: 0.7 + 0.08 * t), run(2)],
        lambda: [run(0), run(1, course=lambda t: np.exp(2 * t - 4)), run(2)],
        lambda: [run(place, backwards=True) for place in range(3)],
    ],
    ids=["hardly falls", "struck half-way", "slower", "faster", "nothing tells"],
)
def test_what_is_none(waves):
    assert find_backward_runs(waves()) == []
