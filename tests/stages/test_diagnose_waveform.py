"""The waveform view from raw samples: a tone's true size through the windows, harmonics that the sampling folds beside the resonance."""

import numpy as np
import pytest
from diagnosis_programme import programme, verdict, waves

from hrg_cli.stages.diagnose import diagnose, summary


@pytest.mark.parametrize("offset_hz", (32.0, 55.0))
def test_a_tone_keeps_its_size_where_the_windows_damp_it(offset_hz):
    """8 ms leave 0.89 of it at 32 Hz and 0.69 at 55 Hz, of which the curvature that demodulate puts back makes 5.6 % and 0.3 % more."""
    table = programme(5, runs=4)
    tone = {"c_cos": 4e-4, "c_sin": -2e-4, "s_cos": 1e-4, "s_sin": 3e-4}
    table["effects"] = {"mains_tone": {"frequency_hz": table["device"]["frequency_hz"] + offset_hz, **tone}}
    out = summary(diagnose(waves(table, periods_per_window=40.0)))
    assert [e["name"] for e in out["effects"]] == ["mains_tone"]
    for name, true in tone.items():
        found = out["effects"][0]["parameters"][name]
        assert abs(found["value"] - true) < 4 * found["std"]
        assert found["std"] < 1e-5
    frequency = out["effects"][0]["parameters"]["frequency_hz"]
    assert 0 < frequency["std"] < 0.02
    assert abs(frequency["value"] - table["effects"]["mains_tone"]["frequency_hz"]) < 4 * frequency["std"]


def test_the_size_of_a_far_tone_is_known_and_its_phase_is_not():
    table = programme(5, runs=4)
    table["effects"] = {"mains_tone": {"frequency_hz": 50.0, "c_cos": -2e-4, "s_sin": 1e-4}}
    _, out = verdict(table)
    assert [e["name"] for e in out["effects"]] == ["mains_tone"]
    one = out["effects"][0]
    assert one["magnitude"]["c"] == pytest.approx(2e-4, rel=0.2) and one["magnitude"]["s"] == pytest.approx(1e-4, rel=0.2)
    assert all(p["std"] >= 0.8e-4 for name, p in one["parameters"].items() if name != "frequency_hz")


def test_a_folded_harmonic_is_no_tone_from_outside():
    table = programme(1, {"pickoff_nonlinearity": {"cubic": 2e-3}}, runs=4)
    table["device"]["frequency_hz"] = 5011.8  # 20011 − 3·5011.8 lies 36 Hz beside the resonance
    _, out = verdict(table)
    assert [e["name"] for e in out["effects"]] == ["pickoff_nonlinearity"]
    found = out["effects"][0]["parameters"]["cubic"]
    assert abs(found["value"] - 2e-3) < 4 * found["std"]
    assert np.isfinite(found["std"]) and found["std"] < 2e-4
