"""Free runs whose files say that they are driven: told by their decay, before any drive is blamed."""

import numpy as np
import pytest

from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.diagnosis.suspects.mislabelled import find_mislabelled
from hrg_cli.stages.estimate import estimate

SAMPLING_HZ, FREQUENCY_HZ, LENGTH_S = 8123.0, 1000.3, 2.0
SAID = "its mode is forced, and its wave is a free one's"


def run(place, course=lambda t: np.exp(-0.5 * t), mode="forced", **logged):
    """A wave that turns with the table, of any course of its amplitude."""
    t = np.arange(0, LENGTH_S, 1 / SAMPLING_HZ)
    rate = (-1.0, 0.6, 1.3)[place]
    theta, phase = 0.3 + place - 0.55 * rate * t / 2, 2 * np.pi * FREQUENCY_HZ * t
    wave = course(t) * np.stack([np.cos(2 * theta), np.sin(2 * theta)]) * np.cos(phase)
    c, s = wave + 3e-4 * np.random.default_rng(place).standard_normal((2, len(t)))
    ends = np.array([0.0, LENGTH_S])
    recording = Recording(
        c=c, s=s, sample_rate_hz=SAMPLING_HZ, mode=mode, gyro_id="G", run_id=f"r{place}",
        auxiliary_time_s=ends, rate_rad_s=0 * ends + rate,
        **{name: 0 * ends + value for name, value in logged.items()},
    )  # fmt: skip
    return collect(estimate(collect(demodulate(recording, periods_per_window=12.0))))


def test_no_drive_is_blamed_for_them():
    waves = [run(place) for place in range(3)]
    found = diagnose(waves)
    assert found.status == "refused"
    assert [one["run_id"] for one in found.told("suspect_runs")] == ["r0", "r1", "r2"]
    assert all(why.startswith(f"r{k}: {SAID}") for k, why in enumerate(found.status_reasons))
    assert "--mode free" in found.status_reasons[0]


def test_one_that_no_log_drives_is_named_among_others():
    waves = [run(0, mode="free"), run(1, drive_main=0.0, drive_quadrature=0.0), run(2, mode="free")]
    assert [one.run_id for one in find_mislabelled(waves)] == ["r1"]


@pytest.mark.parametrize(
    "wave",
    [
        lambda: run(0, mode="free"),
        lambda: run(0, course=lambda t: 1 + 0 * t),
        lambda: run(0, course=lambda t: 0.8 + 0.2 * np.exp(-5 * t)),
        lambda: run(0, course=lambda t: np.where(t < 1, 1.0, np.exp(0.5 - 0.5 * t))),
        lambda: run(0, drive_main=0.1, drive_quadrature=0.0),
    ],
    ids=["free", "held", "settles", "let go half-way", "logged"],
)
def test_what_is_none(wave):
    assert find_mislabelled([wave()]) == []
