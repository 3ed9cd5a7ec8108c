"""import --envelope: demodulated signals become periods whose noise is right behind a lock-in's
filter; the chain goes on from there."""

import json

import numpy as np
import pytest
from scipy.signal import lfilter

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.formats import import_envelope
from hrg_cli.formats.row_noise import DELAY, estimate_row_noise
from hrg_cli.records import FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING, Periods, collect
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify

REFERENCE = 5000.0
TRUTH = {
    "damping_rate_1_s": 1 / 30,
    "damping_split_1_s": 0.05 / 30,
    "frequency_split_rad_s": 0.06,
    "frequency_hz": REFERENCE + 0.3,
}


def envelope(time_s, offset_hz=0.3):
    """The slow model's envelope (2, n) at rest: decay, splits, a wave at an angle."""
    spread = lambda a: np.array([[np.cos(a), np.sin(a)], [np.sin(a), -np.cos(a)]])  # noqa: E731
    nu, split, turn = (
        TRUTH["damping_rate_1_s"],
        TRUTH["damping_split_1_s"],
        TRUTH["frequency_split_rad_s"],
    )
    generator = (
        (2j * np.pi * offset_hz - nu) * np.eye(2) - split * spread(1.2) + 1j * turn * spread(2.8)
    )
    values, vectors = np.linalg.eig(generator)
    start = np.linalg.solve(vectors, np.array([0.9, 0.43]) * np.exp(0.5j))
    return vectors @ (start[:, None] * np.exp(values[:, None] * time_s))


def lock_in(
    poles=2,
    constant_s=0.02,
    row_rate_hz=100.0,
    seconds=60.0,
    noise=0.3,
    seed=0,
    offset_hz=0.3,
    settled=20.0,
):
    """Rows (time, u) of a lock-in of so many poles: mixed down, noise before the filter, decimated;
    the filter was switched on so many of its time constants before the first row."""
    rng = np.random.default_rng(seed)
    fast = 20 * row_rate_hz
    time = np.arange(int(seconds * fast)) / fast
    u = envelope(time, offset_hz) + noise * (
        rng.standard_normal((2, len(time))) + 1j * rng.standard_normal((2, len(time)))
    )
    keep = np.exp(-1 / (fast * constant_s))
    for _ in range(poles):
        u = lfilter([1 - keep], [1, -keep], u, axis=1)
    first = int(np.ceil(settled * constant_s * row_rate_hz))
    return time[::20][first:] - time[20 * first], u[:, ::20][:, first:]


def written(path, time, columns, title):
    path.write_text(
        title
        + "\n"
        + "\n".join(",".join(f"{v:.9g}" for v in row) for row in zip(time, *columns))
        + "\n"
    )
    return path


def iq_log(folder, time, u, title="time (s),x1 (V),y1 (V),x2 (V),y2 (V)"):
    return written(folder / "lock.csv", time, [u[0].real, u[0].imag, u[1].real, u[1].imag], title)


BY_NUMBER = {"c_in_phase": 2, "c_quadrature": 3, "s_in_phase": 4, "s_quadrature": 5}


def taken(path, **more):
    return collect(
        import_envelope(
            path, **{"reference_frequency_hz": REFERENCE, "constant_rate_rad_s": 0.0} | more
        )
    )


@pytest.mark.parametrize(
    "poles, constant_s, correlated", [(1, 0.04, 8), (2, 0.02, 8), (4, 0.01, 6.4)]
)
def test_noise_behind_a_filter(poles, constant_s, correlated):
    """κ is ∫ρ: 2τ, 4τ, 6.4τ for 1, 2, 4 poles; a long average has the density's variance; the delay
    is near DELAY·κ."""
    _, u = lock_in(poles, constant_s, seconds=200.0, noise=0.3)
    found = estimate_row_noise([u - u.mean(1, keepdims=True)])
    assert found.level and found.correlated_rows == pytest.approx(correlated, rel=0.2)
    np.testing.assert_allclose(
        found.density, 0.3**2 / 20, rtol=0.25
    )  # of one part, of the noise before the filter: 20 samples a row
    assert poles * constant_s * 100 == pytest.approx(DELAY * correlated, rel=0.2)


def test_white_rows_are_windows_as_they_are():
    rng = np.random.default_rng(0)
    time = np.arange(6000) / 100
    u = envelope(time) + 0.01 * (
        rng.standard_normal((2, 6000)) + 1j * rng.standard_normal((2, 6000))
    )
    found = estimate_row_noise([u])
    assert found.correlated_rows < 1.15
    np.testing.assert_allclose(found.density, 1e-4, rtol=0.2)


def closed_loop(folder, runs, **lock):
    """(error/σ (run, parameter), χ² (run)) of identify on logs of a lock-in."""
    z, chi2 = [], []
    for seed in range(runs):
        wave = collect(estimate(taken(iq_log(folder, *lock_in(seed=seed, **lock)))))
        resonator = identify([wave], scale_factor=0.554)
        found = resonator.parameters()
        z.append([(found[name][0] - value) / found[name][1] for name, value in TRUTH.items()])
        chi2.append(resonator.chi2_per_dof)
    return np.array(z), np.array(chi2)


def test_identified_errors_are_as_large_as_they_say(tmp_path):
    """Windows of correlated rows: error/σ is one. Rows taken as independent would make it √κ =
    2.8."""
    z, chi2 = closed_loop(tmp_path, 6)
    assert 0.65 < np.sqrt((z**2).mean()) < 1.4
    assert np.all((chi2 > 0.7) & (chi2 < 1.25))


@pytest.mark.slow
@pytest.mark.parametrize(
    "lock",
    [
        {"poles": 1, "constant_s": 0.04},
        {"poles": 4, "constant_s": 0.01},
        {"poles": 1, "constant_s": 1e-4},
    ],
)
def test_identified_errors_of_other_filters(tmp_path, lock):
    z, _ = closed_loop(tmp_path, 20, **lock)
    assert np.all(np.abs(np.sqrt((z**2).mean(0)) - 1) < 0.45) and np.all(np.abs(z.mean(0)) < 0.9)


@pytest.mark.parametrize(
    ("poles", "constant_s"),
    [(4, 0.08), (1, 0.25), pytest.param(2, 0.25, marks=pytest.mark.slow)],
)
def test_rows_of_a_slow_filter_are_no_colour(tmp_path, poles, constant_s):
    """60 s at 100 Hz are too few rows for windows that are independent: they state what is slow, and
    scatter by less. All of these were "suspect: coloured" before."""
    for seed in range(3):
        wave = collect(estimate(taken(iq_log(tmp_path, *lock_in(poles, constant_s, seed=seed)))))
        resonator = identify([wave], scale_factor=0.554)
        assert resonator.status == "valid" and resonator.chi2_per_dof < 0.8


def test_a_slow_filter_is_no_fault(tmp_path):
    """The neighbours' scatter was taken for the noise, and the slow part of the same noise for a
    misfit of 7 to 11 tenfold odds."""
    logs = [lock_in(4, 0.25, seed=seed) for seed in range(2)]
    waves = [
        collect(estimate(taken(iq_log(tmp_path, *log)))).replace(run_id=f"R{k}")
        for k, log in enumerate(logs)
    ]
    assert diagnose(waves).verdict == "adequate"


@pytest.mark.slow
def test_errors_behind_a_slow_filter_are_as_large_as_stated(tmp_path):
    """60 draws: error/σ was 1.14 rms, 1.33 for the damping, as long as neighbours alone could make
    the noise less than the stated one."""
    z, _ = closed_loop(tmp_path, 60, poles=2, constant_s=0.08)
    assert 0.85 < np.sqrt((z**2).mean()) < 1.15 and np.all(np.sqrt((z**2).mean(0)) < 1.3)


@pytest.mark.parametrize("settled", [0.0, 2.0])
@pytest.mark.parametrize(
    "lock",
    [
        {"poles": 1, "constant_s": 0.04, "noise": 0.01},
        {"poles": 2, "constant_s": 0.02, "noise": 0.03},
        {"poles": 4, "constant_s": 0.01, "noise": 1e-3},
        {"poles": 4, "constant_s": 0.1, "noise": 1e-3},
    ],
)
def test_a_filter_that_still_settles_is_flagged(tmp_path, lock, settled):
    """Of a lock-in switched on with the log, or shortly before, the first rows are no wave's:
    they are flagged until what is left is noise, and the rest identifies as it did settled."""
    seen = taken(iq_log(tmp_path, *lock_in(seed=3, settled=settled, **lock)))
    flagged = np.flatnonzero(seen.flags & FLAG_SETTLING)
    assert len(flagged) and np.array_equal(flagged, np.arange(len(flagged)))
    until = float(seen.time_s[len(flagged)])
    assert lock["poles"] < until / lock["constant_s"] + settled < 60
    assert any("settles until" in reason for reason in seen.status_reasons)
    resonator = identify([collect(estimate(seen))], scale_factor=0.554)
    assert resonator.chi2_per_dof < 1.5
    found = resonator.parameters()
    assert all(abs(found[k][0] - value) < 5 * found[k][1] for k, value in TRUTH.items())


@pytest.mark.parametrize("seed", range(2))
def test_a_motion_that_begins_with_the_log_settles_too(tmp_path, seed):
    """Held still until the first row and released there: behind a pole of 30 ms 0.4 % of the wave,
    which 15 σ of a row are, is on its way for 0.2 s."""
    held = envelope(np.zeros(1), 0.02)
    time = np.arange(-4000, 100_000) / 2000.0
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((2, 2, len(time))) * 2.5e-3
    u = np.where(time < 0, held, envelope(time, 0.02)) + noise[0] + 1j * noise[1]
    keep = np.exp(-1 / 60.0)
    u = lfilter([1 - keep], [1, -keep], u, axis=1)[:, 4000::20]
    seen = taken(iq_log(tmp_path, np.arange(u.shape[1]) / 100.0, u))
    flagged = int(np.count_nonzero(seen.flags & FLAG_SETTLING))
    assert 0.1 < flagged * seen.window_s < 1.0


@pytest.mark.parametrize("poles, constant_s", [(1, 0.04), (4, 0.01), (4, 0.1)])
@pytest.mark.parametrize("noise", [1e-5, 1e-2, 0.3])
def test_a_settled_filter_is_not_flagged(tmp_path, poles, constant_s, noise):
    log = lock_in(poles, constant_s, noise=noise, settled=40.0, seed=1)
    assert not np.any(taken(iq_log(tmp_path, *log)).flags & FLAG_SETTLING)


def test_a_window_lies_on_the_envelope(tmp_path):
    """C(t) = Re[C₀ e^{jωt}]: c_cos = I, c_sin = −Q; means of rows lie on the envelope at their
    time, told against the windows' own reference; Q of the other sign is turned."""
    time = np.arange(3000) / 100.0
    u = envelope(time, offset_hz=2.0)
    for rows, sign in ((1, 1), (20, 1), (20, -1)):
        made = taken(
            iq_log(tmp_path, time, u if sign == 1 else u.conj()),
            rows_per_window=rows,
            quadrature_sign=sign,
        )
        moved_hz = made.reference_frequency_hz - REFERENCE
        assert (moved_hz == 0) == (rows == 1)
        truth = envelope(made.time_s, offset_hz=2.0 - moved_hz)
        for k in range(2):
            np.testing.assert_allclose(
                made.signals[:, 2 * k] - 1j * made.signals[:, 2 * k + 1], truth[k], atol=3e-6 * rows
            )
        assert made.window_s == pytest.approx(rows / 100) and made.units == "V"
        assert made.periods_per_window == pytest.approx(rows / 100 * made.reference_frequency_hz)


def test_averaging_never_outruns_the_wave(tmp_path):
    """A beat of 5 Hz beside rows whose noise is correlated over 0.4 s: windows stay short against
    the beat."""
    time, u = lock_in(poles=1, constant_s=0.2, noise=0.05)
    u = u + 0.5 * np.exp(2j * np.pi * 5 * time)
    made = taken(iq_log(tmp_path, time, u))
    assert made.window_s < 0.05


@pytest.mark.parametrize("unit, factor", [("deg", 180 / np.pi), ("rad", 1.0)])
def test_amplitude_and_phase_of_one_channel(tmp_path, unit, factor):
    time = np.arange(2000) / 50.0
    u = envelope(time)[0]
    path = written(
        tmp_path / "a.csv", time, [np.abs(u), np.angle(u) * factor], f"t (s),R (mV),Theta ({unit})"
    )
    made = taken(path, amplitude=2, phase=3)
    np.testing.assert_allclose(made.signals[:, 0] - 1j * made.signals[:, 1], u, atol=1e-7)
    assert made.units == "mV" and not made.signals[:, 2:].any()
    assert made.status == "suspect" and "one channel" in " ".join(made.status_reasons)


def test_a_level_in_decibel(tmp_path, hrg):
    """dBV, 20 dB a decade; no phase: its standard deviation is that of an unknown one; the decay is
    found by estimate's amplitude."""
    time = np.arange(2000) / 50.0
    level = 20 * np.log10(0.02 * np.exp(-0.1 * time)) + 0.01 * np.random.default_rng(
        0
    ).standard_normal(2000)
    path = written(tmp_path / "level.csv", time, [level], "time (s),Level (dBV)")
    with pytest.raises(HrgError, match="is in dBV; add decibel"):
        taken(path)
    out = tmp_path / "p.h5"
    done = hrg(
        "import",
        "--envelope",
        path,
        "-o",
        out,
        "--amplitude",
        2,
        "--decibel",
        "--reference-frequency-hz",
        REFERENCE,
        "--json",
    )
    assert (
        done.status == 0
        and done.json["kind"] == "periods"
        and "only an amplitude" in " ".join(done.json["status_reasons"])
    )
    made = store.read(out, Periods)
    np.testing.assert_allclose(made.signals[:, 0], 0.02 * np.exp(-0.1 * made.time_s), rtol=0.01)
    assert made.units == "V" and (made.signals_std[:, 1] > made.signals[:, 0]).all()
    wave = collect(estimate(made))
    slope, start = np.polyfit(wave.time_s, np.log(wave.main_amplitude), 1)
    assert slope == pytest.approx(-0.1, abs=1e-4) and np.exp(start) == pytest.approx(0.02, rel=1e-3)
    assert wave.status == "suspect" and "only an amplitude" in " ".join(wave.status_reasons)


def test_gaps_bad_rows_logs_and_cut(tmp_path):
    time = np.arange(4000) / 100.0
    u = envelope(time)
    columns = [u[0].real.copy(), u[0].imag, u[1].real, u[1].imag, 20 + time]
    columns[0][1000] = np.nan
    keep = np.r_[0:2005, 2055:4000]
    title = "time (s),i1,q1,i2,q2,temperature (degC)"
    path = written(tmp_path / "g.csv", time[keep], [c[keep] for c in columns], title)
    made = taken(path, rows_per_window=10, from_s=5.0, to_s=35.0)
    assert made.time_s[0] == pytest.approx(0.045) and made.time_s[-1] < 30
    np.testing.assert_allclose(made.temperature_degc, 25 + made.time_s, atol=1e-6)
    assert np.flatnonzero(made.flags & FLAG_NOT_FINITE).tolist() == [50]
    assert np.flatnonzero(made.flags & FLAG_GAP).tolist() == [150]
    assert np.count_nonzero(taken(path).flags) >= 1, (
        "a row that is not finite does not stop the search for the rows a window"
    )
    facts = json.loads(made.details)
    assert (
        facts["gaps"]["count"] == 1
        and facts["not_finite"]["first"] == ["line 1002"]
        and facts["cut"]["from_s"] == 5.0
    )


def test_the_filters_loss_far_from_the_reference_is_told(tmp_path):
    """3 Hz beside the reference of a filter of 0.1 s the amplitude falls to 47 %: suspect; the
    parameters stay right."""
    time, u = lock_in(poles=1, constant_s=0.1, offset_hz=3.0, noise=0.1)
    made = taken(iq_log(tmp_path, time, u))
    assert json.loads(made.details)["noise"]["filter_passes"] == pytest.approx(
        1 / np.hypot(1, 2 * np.pi * 3 * 0.1), rel=0.15
    )
    assert made.status == "suspect" and "Hz from the reference" in " ".join(made.status_reasons)
    near = taken(iq_log(tmp_path, *lock_in(poles=1, constant_s=0.1, noise=0.1)))
    assert near.status == "valid" and "from the reference" not in " ".join(near.status_reasons)


@pytest.mark.parametrize("offset_hz", (-10.0, -3.1, 1.6, 3.1, 4.2))
@pytest.mark.parametrize("rows_per_window", (None, 17))
def test_windows_turn_no_further_than_they_can_follow(tmp_path, offset_hz, rows_per_window):
    """From half a turn from window to window on a frequency is that of the windows' rate beside it:
    at 3.1 Hz from the reference and 17 rows of 10 ms 5.88 Hz too low, and "valid"."""
    time, u = lock_in(poles=4, constant_s=0.006, offset_hz=offset_hz, noise=0.05)
    made = taken(iq_log(tmp_path, time, u), rows_per_window=rows_per_window)
    resonator = identify([collect(estimate(made))], scale_factor=0.554)
    value, std, _ = resonator.parameters()["frequency_hz"]
    assert abs(value - REFERENCE - offset_hz) < 4 * std < 1e-3


@pytest.mark.parametrize(
    "more, says",
    [
        ({"reference_frequency_hz": None}, "give reference_frequency_hz"),
        ({"c_in_phase": 2}, "c_in_phase is named without c_quadrature"),
        ({"s_in_phase": 2, "s_quadrature": 3}, "channel S is named without channel C"),
        ({"amplitude": 2, "phase": 3}, "unit of the phase .* is not told"),
        ({"amplitude": 2, "phase": 3, "phase_units": "parsec"}, "phase_units is 'parsec'"),
        ({"c_in_phase": 2, "c_quadrature": 2}, "named twice"),
        ({"c_in_phase": 2, "c_quadrature": 3, "amplitude": 4}, "both named"),
        ({"c_in_phase": 9, "c_quadrature": 3}, "it has 5 columns"),
        ({"from_s": 100.0}, "holds 0 rows between"),
    ],
)
def test_what_cannot_be_known_is_a_sentence(tmp_path, more, says):
    time = np.arange(300) / 100.0
    u = envelope(time)
    path = iq_log(
        tmp_path, time, u, "time (s),p,q1,r2,s2" if "from_s" not in more else "time (s),i1,q1,i2,q2"
    )
    with pytest.raises(HrgError, match=says):
        taken(path, **more)


def test_flags_of_the_other_kind_are_usage_errors(tmp_path, hrg):
    path = iq_log(tmp_path, np.arange(300) / 100.0, envelope(np.arange(300) / 100.0))
    assert (
        "--c is for samples"
        in hrg("import", "--envelope", path, "-o", tmp_path / "p.h5", "--c", 2).err
    )
    assert "add --envelope" in hrg("import", path, "-o", tmp_path / "p.h5", "--amplitude", 2).err


def test_a_stream_of_blocks_is_the_whole(tmp_path, monkeypatch):
    """Ten blocks, none a whole number of windows long, with a cut and a slow column, give the
    windows of one."""
    from hrg_cli.formats import text_logs

    time, u = lock_in(poles=1, constant_s=0.04)
    path = written(
        tmp_path / "l.csv",
        time,
        [u[0].real, u[0].imag, u[1].real, u[1].imag, 20 + time],
        "time (s),i1,q1,i2,q2,temp (degC)",
    )
    whole = taken(path, from_s=3.0, to_s=50.0)
    monkeypatch.setattr(text_logs, "BLOCK_BYTES", path.stat().st_size // 10)
    blocks = list(
        import_envelope(
            path, reference_frequency_hz=REFERENCE, constant_rate_rad_s=0.0, from_s=3.0, to_s=50.0
        )
    )
    assert len(blocks) > 5 and json.loads(blocks[-1].details)["rows"] == 4700
    many = collect(blocks)
    np.testing.assert_allclose(many.time_s, whole.time_s, atol=1e-9)
    np.testing.assert_allclose(many.temperature_degc, whole.temperature_degc, atol=1e-9)
    np.testing.assert_allclose(many.signals, whole.signals, atol=0.05 * whole.signals_std.min())
    assert many.window_s == whole.window_s and not many.flags.any()


@pytest.mark.parametrize("rows", [150, 600])
def test_white_rows_noise_is_as_well_known_as_their_number_allows(rows):
    """σ from 4·rows numbers: unbiased, and scattered like χ² of what the polynomials leave, though
    the wave turns by 2 rad/s."""
    rng = np.random.default_rng(rows)
    time = 3 * np.arange(rows) / rows
    u = np.exp((-0.4 + 4j) * time) * np.stack([np.cos(2 * time), np.sin(2 * time)])
    found = []
    for _ in range(40):
        noise = rng.normal(size=(2, 2, rows)) * 2e-4
        found.append(estimate_row_noise([u + noise[0] + 1j * noise[1]]))
    size = np.sqrt([one.density.mean() for one in found]) / 2e-4
    expected = 1 / np.sqrt(2 * 4 * rows * 26 / 32)
    assert abs(size.mean() - 1) < 4 * expected / np.sqrt(len(size)) + 0.01
    assert size.std() < 1.6 * expected
    assert np.mean([one.correlated_rows == 1 for one in found]) > 0.9


def noisy(kind, rows, rng, std=2e-4):
    """Rows of one wave that decays, as I and Q of two channels or as an amplitude alone."""
    time = np.arange(rows) / rows
    if kind == "amplitude":
        return np.array([np.exp(-0.9 * time) + std * rng.normal(size=rows), 0 * time]).astype(
            complex
        )
    noise = rng.normal(size=(2, 2, rows)) * std
    return np.exp((-0.9 + 1.2j) * time) * np.array([[0.9], [0.43j]]) + noise[0] + 1j * noise[1]


@pytest.mark.parametrize("kind", ["amplitude", "I and Q"])
@pytest.mark.parametrize("rows", [40, 64, 128, 1000])
def test_errors_of_few_rows_are_as_large_as_stated(kind, rows):
    """An amplitude has one quadrature, whose noise is known from half the numbers: error over σ,
    √⟨σ²/s²⟩ over draws of s (of k degrees of freedom it is √(k/(k − 2))), within 5 %."""
    rng = np.random.default_rng(rows)
    stated = [
        estimate_row_noise([noisy(kind, rows, rng)]).density[0, 0]
        for _ in range(1000 if rows < 1000 else 100)
    ]
    assert 0.95 < np.sqrt(np.mean(2e-4**2 / np.array(stated))) < 1.05


@pytest.mark.parametrize("rows", [12, 24])
def test_of_very_few_rows_the_differences_of_an_amplitude_are_of_one_quadrature(rows):
    rng = np.random.default_rng(rows)
    stated = [estimate_row_noise([noisy("amplitude", rows, rng)]) for _ in range(400)]
    assert np.median([one.density[0, 0] for one in stated]) == pytest.approx(2e-4**2, rel=0.2)
    assert not any(one.level for one in stated)


def test_forty_rows_of_an_amplitude_alone(tmp_path):
    """Through the import: what is left of the amplitude about its decay is as large as stated."""
    rng, z = np.random.default_rng(6), []
    for number in range(12):
        time = np.arange(40) / 50.0
        path = tmp_path / f"a{number}.csv"
        true = 0.02 * np.exp(-0.1 * time)
        written(path, time, [true + 3e-6 * rng.normal(size=40)], "time (s),amplitude (V)")
        made = taken(path)
        assert any("too few rows" in reason for reason in made.status_reasons)
        z.append((made.signals[:, 0] - true) / made.signals_std[:, 0])
    assert 0.9 < np.sqrt(np.mean(np.square(z))) < 1.1


@pytest.mark.parametrize("rows", [60, 400, 3000])
@pytest.mark.parametrize(("turn", "beat"), [(0.17, 0.0), (0.17, 0.1), (1.2, 0.3)])
def test_noise_of_a_wave_that_turns_fast_beside_its_rows(rows, turn, beat):
    """A lock-in at 1 Hz on a table at 10°/s: polynomials leave the wave's own turn, which was taken for
    noise 600 times as large as it is."""
    rng = np.random.default_rng(rows)
    generator = np.array([[0.5j * beat, -turn], [turn, -0.5j * beat]]) - 1e-4 * np.eye(2)
    values, vectors = np.linalg.eig(generator)
    start = np.linalg.solve(vectors, np.array([1.0, 0.02j]))
    u = (vectors * start) @ np.exp(np.multiply.outer(values, np.arange(rows)))
    for noise in (1e-6, 1e-3):
        white = rng.standard_normal((2, rows)) + 1j * rng.standard_normal((2, rows))
        found = estimate_row_noise([u + noise * white])
        assert found.density.mean() / noise**2 == pytest.approx(1.0, abs=0.4)
        assert found.variance.mean() / noise**2 == pytest.approx(1.0, abs=0.3)


def faint_decay(seed, noise=0.05, rate=0.2):
    """Phasors that sink from 20 times their noise to it."""
    rng, time = np.random.default_rng(seed), np.arange(4000) / 200.0
    n = rng.standard_normal((4000, 2)) @ [1, 1j]
    return time, np.exp(-rate * time + 3j * time) + noise * n


@pytest.mark.parametrize("kind", ["amplitude", "level", "amplitude and phase"])
def test_a_decay_into_the_noise_is_found_without_bias(tmp_path, kind):
    """Lengths of noisy phasors do not sink below their noise: 0.1945 for 0.2 in every draw, −5 σ,
    where an identification ended at all. Mean error of eight draws within 3.5/√8 σ."""
    errors = []
    for seed in range(8):
        time, u = faint_decay(seed)
        columns = {
            "amplitude": [np.abs(u)],
            "level": [20 * np.log10(np.abs(u))],
            "amplitude and phase": [np.abs(u), np.degrees(np.angle(u))],
        }[kind]
        path = written(
            tmp_path / f"{seed}.csv",
            time,
            columns,
            "time (s),R,Phase (deg)" if len(columns) > 1 else "time (s),R",
        )
        given = {"decibel": True} if kind == "level" else {}
        given |= {"phase": 3} if len(columns) > 1 else {}
        made = taken(path, amplitude=2, units="V", **given)
        found = identify([collect(estimate(made))]).parameters()["damping_rate_1_s"]
        errors.append((found[0] - 0.2) / found[1])
    assert abs(np.mean(errors)) < 3.5 / np.sqrt(8) and np.std(errors) < 2, errors


def test_noise_alone_is_no_decay(tmp_path):
    time, u = faint_decay(0)
    path = written(tmp_path / "n.csv", time, [np.abs(u - np.exp((-0.2 + 3j) * time))], "time (s),R")
    made = taken(path, amplitude=2, units="V")
    with pytest.raises(HrgError, match="above 6 standard deviations of its noise"):
        identify([collect(estimate(made))])


def test_columns_of_two_units_are_refused(tmp_path):
    """Both were taken in the first one's unit, and the rate's was blamed."""
    time = np.arange(400) / 100
    path = iq_log(tmp_path, time, envelope(time), "time (s),x1 (mV),y1 (mV),x2 (V),y2 (V)")
    with pytest.raises(HrgError, match="'x1' is in 'mV' and 'x2' in 'V'"):
        taken(path, **BY_NUMBER)


def test_rows_that_an_instrument_marks_as_none_are_left_out(tmp_path):
    """9.9E37 is what it writes of an overload: no fit began beside it."""
    rng = np.random.default_rng(5)
    time = np.arange(3000) / 100
    u = envelope(time) + 1e-3 * (
        rng.standard_normal((2, 3000)) + 1j * rng.standard_normal((2, 3000))
    )
    u[0, 700:710] = 9.9e37
    periods = taken(iq_log(tmp_path, time, u), **BY_NUMBER)
    assert np.count_nonzero(periods.flags & FLAG_NOT_FINITE) == 10
    resonator = identify([collect(estimate(periods))], scale_factor=0.554)
    for name, true in TRUTH.items():
        value, std, _ = resonator.parameters()[name]
        assert abs(value - true) < 4 * std, name
