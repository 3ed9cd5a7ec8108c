"""demodulate --from-s, --to-s and --nominal-frequency-hz: rows of a part are those of the whole, at
the whole's times."""

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate

RATE, HZ = 20_000.0, 1003.7


def made_recording(uneven=False, seed=0, **more):
    """2 s of a decaying wave whose log of temperature is 20 + t."""
    rng = np.random.default_rng(seed)
    t = np.arange(40_000) / RATE
    if uneven:
        t = t + 0.2 / RATE * rng.uniform(-1, 1, len(t))
    u = np.exp(-0.4 * t + 2j * np.pi * HZ * t)
    c, s = (g * u.real + 1e-3 * rng.standard_normal(len(t)) for g in (0.8, 0.5))
    axis = {"time_s": t} if uneven else {"sample_rate_hz": RATE}
    log = np.linspace(0, 2, 41)
    return Recording(
        c=c,
        s=s,
        mode="free",
        run_id="r",
        auxiliary_time_s=log,
        temperature_degc=20 + log,
        **axis,
        **more,
    )


@pytest.mark.parametrize("uneven", [False, True])
def test_a_part_has_the_wholes_times_phases_and_log(uneven):
    recording = made_recording(uneven)
    part = collect(demodulate(recording, from_s=0.5, to_s=1.25, periods_per_window=5))
    assert 0.5 <= part.time_s[0] < 0.51 and 1.24 < part.time_s[-1] <= 1.25
    truth = np.exp((-0.4 + 2j * np.pi * (HZ - part.reference_frequency_hz)) * part.time_s)
    for k, g in ((0, 0.8), (2, 0.5)):
        error = part.signals[:, k] - 1j * part.signals[:, k + 1] - g * truth
        assert np.abs(error).max() < 6 * part.signals_std[:, k].max()
    np.testing.assert_allclose(part.temperature_degc, 20 + part.time_s, atol=1e-9)
    assert (
        any("of 40000 were taken: 0.5 s to 1.25 s" in reason for reason in part.status_reasons)
        and part.status == "valid"
    )


def test_a_part_of_a_file_is_read_where_it_lies(tmp_path, hrg):
    """A file's part equals the same part in memory, and the cut stands in the settings."""
    path, out = tmp_path / "r.h5", tmp_path / "p.h5"
    store.write(path, made_recording())
    assert hrg("demodulate", path, "-o", out, "--from-s", 0.5, "--to-s", 1.25, "--json").status == 0
    from_file = store.read_any(out)
    np.testing.assert_array_equal(
        from_file.signals, collect(demodulate(made_recording(), from_s=0.5, to_s=1.25)).signals
    )
    assert "from_s = 0.5" in from_file.provenance.settings


def test_what_lies_outside_cannot_spoil_the_part():
    """Other sounds before and behind, 100 times as strong and at another frequency, leave the part
    as it is."""
    recording = made_recording()
    t = np.arange(40_000) / RATE
    noisy = np.where((t < 0.5) | (t >= 1.25), 100 * np.cos(2 * np.pi * 3210 * t), 0)
    disturbed = recording.replace(c=recording.c + noisy, s=recording.s + noisy)
    a, b = (collect(demodulate(r, from_s=0.5, to_s=1.25)) for r in (recording, disturbed))
    np.testing.assert_array_equal(a.signals, b.signals)


@pytest.mark.parametrize(
    "flags, says",
    [
        ({"from_s": 1.0, "to_s": 0.5}, "from_s = 1 is not before to_s = 0.5"),
        ({"from_s": 5.0}, "from_s = 5 lies behind its end; it is 1.99995 s long"),
        ({"from_s": 1.0, "to_s": 1.0001}, "cannot be found in fewer than 6"),
    ],
)
@pytest.mark.parametrize("uneven", [False, True])
def test_empty_parts_are_sentences(flags, says, uneven):
    with pytest.raises(
        HrgError, match=says if not (uneven and "behind" in says) else "lies behind its end"
    ):
        list(demodulate(made_recording(uneven), **flags))


def test_an_end_behind_the_recording_is_told():
    assert any(
        "to_s = 9 lies behind" in reason
        for reason in collect(demodulate(made_recording(), to_s=9.0)).status_reasons
    )


def test_a_nominal_frequency_chooses_between_two_oscillations(tmp_path, hrg):
    recording = made_recording()
    t = np.arange(40_000) / RATE
    path = tmp_path / "r.h5"
    store.write(path, recording.replace(c=recording.c + 3 * np.cos(2 * np.pi * 3210.0 * t)))
    for asked, expected in ((None, 3210.0), (1000.0, HZ)):
        flags = () if asked is None else ("--nominal-frequency-hz", asked)
        done = hrg("demodulate", path, "-o", tmp_path / "p.h5", "--force", "--json", *flags)
        assert done.status == 0 and done.json["reference_frequency_hz"] == pytest.approx(
            expected, abs=0.1
        )


def test_run_takes_a_part_of_each_recording(tmp_path, hrg):
    path = tmp_path / "r.h5"
    store.write(path, made_recording())
    hrg(
        "run",
        path,
        "-o",
        tmp_path / "out",
        "--from-s",
        0.5,
        "--to-s",
        1.25,
        "--json",
        "--set",
        "demodulate.periods_per_window=20",
    )
    periods = store.read_any(tmp_path / "out" / "r.periods.h5")
    assert 0.5 < periods.time_s[0] < 0.53 and periods.time_s[-1] < 1.25
