"""Defects put into the raw samples of recorded pendulums that the eye or a spectrum sees: each found
by the step that looks for it, beside a misfit that no cause explains, and nothing where there is
none.

What an ideal detector sees below five of its σ beside the pendulum's own misfit is left out (page
"verdict"): five milliseconds lost, a cubic of 0.5 %, an amplitude of −2 % quadratic in time.
"""

import os
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from hrg_cli.effects import EFFECTS
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.fits.refits import adopt
from hrg_cli.stages.diagnosis.fits.scoring import is_gross, score_effects
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.samples.lines import find_common_step
from hrg_cli.stages.diagnosis.samples.offered import measure_sigma
from hrg_cli.stages.diagnosis.samples.tone_search import widen_by_rest
from hrg_cli.stages.diagnosis.samples.tones import take_out_tones
from hrg_cli.stages.diagnosis.samples.waveform import find_waveform_causes
from hrg_cli.stages.diagnosis.search.inquiry import Inquiry
from hrg_cli.stages.diagnosis.search.instants import take_strikes
from hrg_cli.stages.diagnosis.search.remainder import search_rest
from hrg_cli.stages.diagnosis.search.search_case import Case
from hrg_cli.stages.diagnosis.search.selection import Search
from hrg_cli.stages.diagnosis.suspects.rivals import fit_nearest
from hrg_cli.stages.diagnosis.thresholds import GROSS
from hrg_cli.stages.estimate import estimate

pytestmark = pytest.mark.slow
PERIOD_S = {"florence": 2.809, "yverdon": 8.943}
RATE_RAD_S = {"florence": -5.047e-5, "yverdon": 5.31e-5}
IN_THE_LINES = {
    "cubic 2 %": "pickoff_nonlinearity",
    "clip": "saturation",
    "tone far": "mains_tone",
}
AT_AN_INSTANT = {
    "71 ms lost": "dropped_samples",
    "both gains": "gain_step",
    "one gain": "gain_step",
}


def samples(name):
    """Times, x and y about their means."""
    folder = os.environ.get("HRG_MEASURED_DATA")
    if not folder:
        pytest.skip("set HRG_MEASURED_DATA to the folder of measured data")
    if name == "florence":
        file = Path(folder) / "foucault_florence" / "2021_09_17_14_57_N.csv"
        t, x, y = np.loadtxt(file, delimiter=";", skiprows=1).T
    else:
        file = Path(folder) / "foucault_yverdon" / "oscillation4.csv"
        rows = [row.split(",") for row in file.read_text().split()]
        x, y = np.array([[float(a), float(b)] for a, b, _ in rows]).T
        clock = [[float(part) for part in row[2].split(":")] for row in rows]
        t = np.array(clock) @ (3600, 60, 1)
    keep = np.concatenate([[True], np.diff(t) > 0])
    t, y_ = t[keep] - t[keep][0], np.stack([x, y])[:, keep]
    return t, y_ - y_.mean(axis=1, keepdims=True)


def injected(kind, t, y, period_s):
    """The samples with one of the defects."""
    size, length = float(np.abs(y).max()), float(t[-1])
    late = t > 0.57 * length
    if kind.startswith("cubic"):
        return t, y + float(kind.split()[1]) / 100 * size * (y / size) ** 3
    if kind == "clip":
        return t, np.clip(y, -0.95 * size, 0.95 * size)
    if kind == "71 ms lost":
        lost_s, at = 0.071, 0.43 * length
        keep = ~((t >= at) & (t < at + lost_s))
        return np.where(t < at, t, t - lost_s)[keep], y[:, keep]
    if kind.startswith("tone"):
        hz = {"far": 2.37, "near": 1.03}[kind.split()[1]] / period_s
        phases = 2 * np.pi * hz * t + np.array([[0.3], [1.0]])
        return t, y + size * np.array([[0.005], [0.004]]) * np.cos(phases)
    return t, y * (1 + 0.01 * late * np.array([[1.0], [float(kind == "both gains")]]))


def wave_of(name, kind):
    """The wave of a pendulum with a defect, or as it is."""
    t, y = injected(kind, *samples(name), PERIOD_S[name]) if kind else samples(name)
    recording = Recording(
        c=y[0], s=y[1], time_s=t, mode="free", mode_number=1, run_id=name,
        auxiliary_time_s=t[[0, -1]], rate_rad_s=np.full(2, RATE_RAD_S[name]),
    )  # fmt: skip
    return collect(estimate(collect(demodulate(recording, periods_per_window=5.0))))


def dynamics(fit):
    return list_variants([effect for effect in EFFECTS if effect.seen_in == "dynamics"], fit)


def near(fit):
    """The few causes that leave least: the pendulum's own, as far as the catalogue has them."""
    return fit_nearest(fit, dynamics(fit), GROSS) if is_gross(fit) else fit


FITTED = partial(fit_base, scale_factor=None, blocks=120, free_phase=False)


OWN = {"florence": "cubic_stiffness", "yverdon": "damping_drift"}
"""The cause of the catalogue that leaves least of a pendulum as it is."""


def found_at_instants(name, wave):
    """What happens at an instant beside the misfit that the pendulum's own cause leaves."""
    base = FITTED([wave])
    own = next(pair for pair in score_effects(base, dynamics(base)) if pair[0].name == OWN[name])
    fit = adopt(base, *own)
    assert is_gross(fit)
    inquiry = Inquiry(tuple(dynamics(fit)), 3, sampling_step_s=find_common_step([wave]))
    left_over = search_rest(fit, inquiry.noise)
    case = Case(inquiry, Search(fit, fit, (), (), ()), left_over)
    return take_strikes(case).search.found


@pytest.mark.parametrize("kind", ["", *IN_THE_LINES])
@pytest.mark.parametrize("name", PERIOD_S)
def test_lines_of_the_samples_are_named_for_what_makes_them(name, kind):
    wave = wave_of(name, kind)
    shown, _ = find_waveform_causes([wave], [], [], wave.reference_frequency_hz, [])
    own = {"pickoff_nonlinearity"} if name == "yverdon" else set()  # its camera's third harmonic
    wanted = {IN_THE_LINES[kind]} if kind else set()
    assert wanted <= {e["name"] for e in shown} <= wanted | own


@pytest.mark.parametrize("kind", AT_AN_INSTANT)
@pytest.mark.parametrize("name", PERIOD_S)
def test_what_happens_at_an_instant_stands_out_of_a_slow_misfit(name, kind):
    found = found_at_instants(name, wave_of(name, kind))
    assert found
    group = [found[0].variant.effect.name, *found[0].rivals]
    assert AT_AN_INSTANT[kind] in group and len(group) <= 3
    true = {"lost_s": 0.071, "c_gain": 0.01, "s_gain": 0.01 * (kind == "both gains")}
    if group[0] == AT_AN_INSTANT[kind]:
        for parameter, (size, std) in found[0].sizes.items():
            assert abs(size - true[parameter]) < 5 * std + 0.03 * true[parameter]


@pytest.mark.parametrize("name", PERIOD_S)
def test_a_pendulum_as_it_is_shows_no_instant(name):
    assert not found_at_instants(name, wave_of(name, ""))


def test_a_tone_beside_a_gross_misfit_stands_alone():
    """Beside a misfit eighty times the tone's size; without one the misfit makes none."""
    for kind in ("", "tone near"):
        wave = wave_of("florence", kind)
        _, _, tones = take_out_tones(FITTED([wave]), [wave], FITTED, near)
        hz = [tone.frequency_hz for tone in tones if tone.standing]
        assert len(hz) == (kind != "")
        cell_hz = 1 / float(wave.time_s[-1])
        assert all(abs(one - 1.03 / PERIOD_S["florence"]) < 0.2 * cell_hz for one in hz)


@pytest.mark.parametrize("name", PERIOD_S)
def test_a_tone_is_known_to_what_the_pendulum_leaves_beside_it(name):
    """To the noise of the windows alone Florence's is 7 σ off in frequency and 3 in size."""
    wave = wave_of(name, "tone near")
    fit, left, tones = take_out_tones(FITTED([wave]), [wave], FITTED, near)
    wide = widen_by_rest(tones, near(fit), left)
    shown, _ = find_waveform_causes([wave], [], wide, wave.reference_frequency_hz, [])
    tone = next(one for one in shown if one["name"] == "mains_tone")
    assert tone["z"] == pytest.approx(measure_sigma(tone)) and tone["z"] > 10
    hz = tone["parameters"]["frequency_hz"]
    assert abs(hz["value"] - 1.03 / PERIOD_S[name]) < 4 * hz["std"]
    size = float(np.abs(samples(name)[1]).max())
    for channel, true in (("c", 0.005 * size), ("s", 0.004 * size)):
        assert abs(tone["magnitude"][channel] - true) < 4 * tone["magnitude_std"][channel]
