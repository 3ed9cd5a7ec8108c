"""demodulate on even sampling: recovery and honest standard deviations, no leakage, drift, carrier,
streams, flags."""

import dataclasses
import tracemalloc
from importlib import import_module

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.physics import resonator
from hrg_cli.records import (
    FLAG_CLIPPED,
    FLAG_NOT_FINITE,
    FLAG_SETTLING,
    Periods,
    Recording,
    collect,
)
from hrg_cli.records.recording import ONE_CHANNEL
from hrg_cli.stages.demodulate import demodulate, summarise


def recording(c: np.ndarray, s: np.ndarray, rate: float, **more: object) -> Recording:
    return Recording(c=c, s=s, sample_rate_hz=rate, **({"mode": "free", "run_id": "run-1"} | more))


def truth(periods: Periods, frequency: float, u: np.ndarray, growth: float = 0.0) -> np.ndarray:
    """Signals of envelopes u (2,) at a frequency, growing as e^{growth·t}, against the
    reference."""
    turn = np.exp(
        (growth + 2j * np.pi * (frequency - periods.reference_frequency_hz)) * periods.time_s
    )
    return np.stack(
        [(u[0] * turn).real, -(u[0] * turn).imag, (u[1] * turn).real, -(u[1] * turn).imag], -1
    )


def test_errors_are_as_large_as_their_standard_deviations_say() -> None:
    """220 random recordings: frequency, sampling, window, offset, amplitude, decay, noise, integers
    or floats."""
    rng = np.random.default_rng(1)
    ratios, worst = [], []
    for _ in range(220):
        rate = 10 ** rng.uniform(1, 6)
        frequency = rate / rng.uniform(2.3, 40)
        n = int(rng.uniform(1500, 4000))
        time = np.arange(n) / rate
        u = rng.normal(size=2) + 1j * rng.normal(size=2)
        growth = -rng.uniform(0, 2) / time[-1]
        noise = 10 ** rng.uniform(-4, -1)
        z = (
            (u[:, None] * np.exp((growth + 2j * np.pi * frequency) * time)).real
            + noise * rng.normal(size=(2, n))
            + rng.normal(size=(2, 1))
        )
        more = {}
        if rng.uniform() < 0.4:
            quantum = noise * rng.uniform(0.1, 2)
            more = {"c_scale_factor": quantum, "s_scale_factor": quantum}
            z = np.rint(z / quantum).astype("i4")
        made = collect(
            demodulate(
                recording(z[0], z[1], rate, **more),
                periods_per_window=rng.choice([1.0, 1.0, rng.uniform(0.6, 12)]),
            )
        )
        z = (made.signals - truth(made, frequency, u, growth)) / made.signals_std
        ratios.append((z**2).mean())
        worst.append(np.abs(z.mean(0)).max() * np.sqrt(len(z)))
        assert made.status == "valid" and not made.flags.any()
    assert 0.8 < np.mean(ratios) < 1.25
    assert 0.8 < np.median(ratios) < 1.25
    assert np.mean(np.array(worst) < 4) > 0.97


def test_nothing_leaks_at_any_window_and_no_noise() -> None:
    rate, frequency = 48_000.0, 5_003.371
    time = np.arange(48_000) / rate
    u = np.array([1 + 0.3j, 0.4 - 0.2j])
    z = (u[:, None] * np.exp(2j * np.pi * frequency * time)).real + np.array([[3.0], [-7.0]])
    for periods in (1.0, 1.37, 2.5, 7.77, 50.0):
        made = collect(demodulate(recording(z[0], z[1], rate), periods_per_window=periods))
        assert np.abs(made.signals - truth(made, frequency, u)).max() < 3e-8
        assert made.periods_per_window == pytest.approx(periods, abs=frequency / rate)
        assert (made.signals_std > 0).all()


@pytest.mark.parametrize("periods", [1.0, 1.37, 7.3, 50.0])
def test_a_turning_decaying_split_resonator_is_seen_without_bias(periods: float) -> None:
    rng = np.random.default_rng(2)
    rate, n, noise = 100_000.0, 200_000, 1e-5
    mechanics = resonator.Mechanics(5000.0, 0.35, 0.02, 0.3, 0.4, 0.1, 0.55)
    generator = resonator.build_generator(mechanics, 3.0, 5000.0)
    start = np.array([1, 0.01j])

    def envelope(time: np.ndarray) -> np.ndarray:
        return resonator.exponentiate(generator, time) @ start

    time = np.arange(n) / rate
    z = (envelope(time) * np.exp(2j * np.pi * 5000.0 * time)[:, None]).real + noise * rng.normal(
        size=(n, 2)
    )
    made = collect(demodulate(recording(z[:, 0], z[:, 1], rate), periods_per_window=periods))
    u = (
        envelope(made.time_s)
        * np.exp(2j * np.pi * (5000.0 - made.reference_frequency_hz) * made.time_s)[:, None]
    )
    error = (
        made.signals - np.stack([u[:, 0].real, -u[:, 0].imag, u[:, 1].real, -u[:, 1].imag], -1)
    ) / made.signals_std
    assert (
        0.4 < (error**2).mean() < 1.4
    )  # σ may be cautious where the envelope's own motion dwarfs the noise
    assert np.abs(error.mean(0)).max() * np.sqrt(len(error)) < 4.5


@pytest.mark.parametrize("periods", [1.0, 50.0, 500.0])
def test_a_frequency_that_drifts_is_followed(periods: float) -> None:
    rng = np.random.default_rng(3)
    rate, n, noise = 40_000.0, 1_200_000, 1e-3
    time = np.arange(n) / rate
    cycles = 5000 * time + 0.05 * time**2  # 3 Hz in 30 s
    u = np.array([1.0, 0.5j])
    z = (u[:, None] * np.exp(2j * np.pi * cycles)).real + noise * rng.normal(size=(2, n))
    made = collect(
        demodulate(recording(z[0], z[1], rate, mode="forced"), periods_per_window=periods)
    )
    t = made.time_s
    turn = np.exp(2j * np.pi * (5000 * t + 0.05 * t**2 - made.reference_frequency_hz * t))
    error = (
        made.signals
        - np.stack([turn.real, -turn.imag, (0.5j * turn).real, -(0.5j * turn).imag], -1)
    ) / made.signals_std
    assert 0.85 < (error**2).mean() < 1.2
    assert np.abs(error.mean(0)).max() * np.sqrt(len(error)) < 4.5


def seed_b(main: float, quadrature: float, theta: float, phi: np.ndarray, psi: float) -> np.ndarray:
    """The eight signals of PHYSICS §3 (1), theta the electrical angle."""
    c, s = np.cos(theta), np.sin(theta)
    um, up = phi - psi, phi + psi
    a, b = main, quadrature
    return np.stack(
        [
            a * c * np.sin(um) + b * s * np.cos(um),
            -a * c * np.sin(up) - b * s * np.cos(up),
            -a * c * np.cos(um) + b * s * np.sin(um),
            -a * c * np.cos(up) + b * s * np.sin(up),
            a * s * np.sin(um) - b * c * np.cos(um),
            -a * s * np.sin(up) + b * c * np.cos(up),
            -a * s * np.cos(um) - b * c * np.sin(um),
            -a * s * np.cos(up) - b * c * np.sin(up),
        ],
        -1,
    )


@pytest.mark.parametrize(("carrier", "periods"), [(60_000.0, 1.0), (60_000.0, 2.7), (3_000.0, 4.0)])
def test_carrier_signals_are_those_of_seed_b(carrier: float, periods: float) -> None:
    """The samples are the sum over the side bands of a·cos + b·sin; at 3 kHz the difference
    frequency is negative."""
    rng = np.random.default_rng(4)
    rate, frequency, n, noise = 400_000.0, 5_003.37, 160_000, 1e-3
    main, quadrature, theta, phi, psi = 1.0, 0.05, 0.7, 0.3, 1.1
    time = np.arange(n) / rate
    eight = seed_b(main, quadrature, theta, np.array(phi), psi)
    low, high = 2 * np.pi * (carrier - frequency) * time, 2 * np.pi * (carrier + frequency) * time
    z = np.stack(
        [
            eight[k] * np.cos(low)
            + eight[k + 1] * np.cos(high)
            + eight[k + 2] * np.sin(low)
            + eight[k + 3] * np.sin(high)
            for k in (0, 4)
        ]
    )
    leak = 0.02 * np.cos(2 * np.pi * carrier * time + 2)
    z = z + leak + noise * rng.normal(size=(2, n)) + 0.1
    made = collect(
        demodulate(
            recording(z[0], z[1], rate, readout="carrier", carrier_hz=carrier),
            periods_per_window=periods,
        )
    )
    assert made.signals.shape[1] == 8 and made.readout == "carrier"
    moved = phi + 2 * np.pi * (frequency - made.reference_frequency_hz) * made.time_s
    error = (made.signals - seed_b(main, quadrature, theta, moved, psi)) / made.signals_std
    assert 0.85 < (error**2).mean() < 1.2
    assert np.abs(error.mean(0)).max() * np.sqrt(len(error)) < 4.5


def test_blocks_do_not_change_results_and_a_lazy_file_streams() -> None:
    rng = np.random.default_rng(5)
    time = np.arange(1_200_000) / 50_000
    z = np.rint(
        9000 * np.cos(2 * np.pi * 5003.3 * time) + 3 * rng.normal(size=(2, len(time)))
    ).astype("i2")
    whole = recording(z[0], z[1], 50_000.0)
    for periods in (1.0, 20.0):
        one = collect(demodulate(whole, periods_per_window=periods))
        blocks = list(demodulate(whole, periods_per_window=periods, block_samples=70_000))
        assert len(blocks) > 3
        many = collect(blocks)
        for name in ("time_s", "signals", "signals_std", "residual_rms", "flags"):
            np.testing.assert_array_equal(getattr(one, name), getattr(many, name))


def test_a_file_read_lazily_gives_the_same(tmp_path) -> None:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(6)
    time = np.arange(60_000) / 50_000
    z = np.rint(900 * np.cos(2 * np.pi * 3003.3 * time) + rng.normal(size=(2, len(time)))).astype(
        "i2"
    )
    whole = recording(
        z[0],
        z[1],
        50_000.0,
        gyro_id="g",
        lot_id="l",
        start_time="2026-01-01T00:00:00Z",
        mode_number=1,
    )
    store.write(tmp_path / "r.h5", whole)
    with store.open_record(tmp_path / "r.h5", Recording) as lazy:
        store.write(tmp_path / "p.h5", demodulate(lazy, block_samples=10_000))
    read, here = store.read(tmp_path / "p.h5", Periods), collect(demodulate(whole))
    np.testing.assert_array_equal(read.signals, here.signals)
    assert read.spectrum_density is not None and len(read.spectrum_density) > 100
    assert (read.gyro_id, read.lot_id, read.mode_number, read.start_time) == (
        "g",
        "l",
        1,
        "2026-01-01T00:00:00Z",
    )


class Generated:
    """A channel that is made when it is read: a long recording that needs no memory."""

    dtype = np.dtype("i2")

    def __init__(self, samples: int, amplitude: float) -> None:
        self.shape, self.amplitude = (samples,), amplitude

    def __len__(self) -> int:
        return self.shape[0]

    def __getitem__(self, rows: slice) -> np.ndarray:
        k = np.arange(*rows.indices(len(self)))
        return (self.amplitude * np.cos(k * (2 * np.pi / 12.8)) + (k * 7919 % 31) / 10).astype("i2")


def test_memory_does_not_grow_with_length() -> None:
    peaks = []
    for samples in (2_000_000, 6_000_000):
        made = recording(Generated(samples, 9000), Generated(samples, 4000), 64_000.0)  # type: ignore[arg-type]
        tracemalloc.start()
        rows = sum(len(block) for block in demodulate(made, block_samples=1 << 18))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert rows == samples // 13
    assert peaks[1] < 1.1 * peaks[0] < 100e6


def oscillation(n: int = 100_000, noise: float = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    time = np.arange(n) / 40_000
    u = np.exp((-0.1 + 2j * np.pi * 5000.3) * time)
    return u.real + noise * rng.normal(size=n), 0.5 * u.imag + noise * rng.normal(size=n)


def test_clipped_samples_are_flagged_at_integer_rails_and_at_others() -> None:
    c, s = oscillation()
    for top, made in (
        (
            32_767,
            recording(
                np.clip(np.rint(36_000 * c), -32_768, 32_767).astype("i2"),
                np.rint(36_000 * s).astype("i2"),
                40_000.0,
            ),
        ),
        (
            8_191,
            recording(
                np.clip(np.rint(9_000 * c), -8_192, 8_191).astype("i2"),
                np.rint(9_000 * s).astype("i2"),
                40_000.0,
            ),
        ),
        (0.9, recording(np.clip(c, -0.9, 0.9), s, 40_000.0)),
    ):
        periods = collect(demodulate(made))
        stuck = (np.asarray(made.c) >= top)[: len(periods) * 8].reshape(-1, 8).any(1)
        assert (periods.flags[stuck] & FLAG_CLIPPED).all() and (
            periods.flags & FLAG_CLIPPED != 0
        ).mean() < 2.5 * stuck.mean()
        assert periods.status == "suspect" and "clipped" in " ".join(periods.status_reasons)


@pytest.mark.parametrize(("rail", "suspect"), [(0.998, False), (0.98, True)])
def test_more_than_a_hundredth_of_clipped_windows_is_suspect(rail: float, suspect: bool) -> None:
    """A wave that decays from just above the rails: few clipped windows are noted, several in a
    hundred, though far from a fifth, bend what is made of them."""
    c, s = oscillation()
    made = recording(
        np.clip(np.rint(32_767 / rail * c), -32_768, 32_767).astype("i2"),
        np.rint(32_767 * s).astype("i2"),
        40_000.0,
    )
    periods = collect(demodulate(made))
    share = (periods.flags & FLAG_CLIPPED != 0).mean()
    assert 0.02 < share < 0.1 if suspect else 0 < share < 0.01
    assert any("clipped" in reason for reason in periods.status_reasons)
    assert periods.status == ("suspect" if suspect else "valid"), periods.status_reasons


def test_clean_recordings_are_not_called_clipped() -> None:
    k = np.arange(60_000)
    for samples_a_period in (8.0, 20.0, 12.34, 400.0):
        u = np.exp(2j * np.pi * k / samples_a_period + 0.1j)
        for c, s in (
            (u.real, u.imag),
            (np.rint(100 * u.real).astype("i2"), np.rint(60 * u.imag).astype("i2")),
        ):
            assert not (
                collect(demodulate(recording(c, s, 10_000.0, mode="forced"))).flags & FLAG_CLIPPED
            ).any()


def test_values_that_are_not_finite_are_flagged_and_kept() -> None:
    c, s = oscillation()
    c[1000:1100], c[50_000] = np.nan, np.inf
    made = collect(demodulate(recording(c, s, 40_000.0)))
    bad = (made.flags & FLAG_NOT_FINITE) != 0
    assert (
        bad.sum() == 14
        and np.isnan(made.signals[bad, 0]).all()
        and np.isfinite(made.signals[~bad]).all()
    )
    assert len(made) == 12_500 and np.isfinite(made.signals[:, 2]).all()


def test_a_recording_without_one_whole_window_is_refused() -> None:
    c, s = oscillation()
    c[::100] = np.nan
    made = collect(demodulate(recording(c, s, 40_000.0), periods_per_window=20.0))
    assert ((made.flags & FLAG_NOT_FINITE) != 0).all() and made.status == "refused"
    assert "no window holds finite samples only" in made.status_reasons


def test_a_settling_start_is_flagged_and_a_calm_one_is_not() -> None:
    c, s = oscillation()
    assert not collect(demodulate(recording(c, s, 40_000.0))).flags.any()
    time = np.arange(2000) / 40_000
    c[:2000] += np.exp(-300 * time) * np.cos(2 * np.pi * 7777 * time)
    flags = collect(demodulate(recording(c, s, 40_000.0))).flags
    stop = int((flags & FLAG_SETTLING != 0).sum())
    assert 20 < stop < 250 and (flags[:stop] & FLAG_SETTLING).all()


def test_lost_samples_show_in_the_residual() -> None:
    c, s = oscillation()
    lost = np.r_[0:50_003, 50_010 : len(c)]
    made = collect(demodulate(recording(c[lost], s[lost], 40_000.0)))
    assert np.argmax(made.residual_rms[:, 0]) == 50_003 // 8
    assert made.residual_rms[:, 0].max() > 50 * np.median(made.residual_rms[:, 0])
    row = 50_003 // 8
    assert made.signals_std[row, 0] > 30 * np.median(made.signals_std[:, 0]) and made.signals_std[
        row - 2, 0
    ] < 2 * np.median(made.signals_std[:, 0])


def test_harmonics_and_mains_are_kept_as_lines_and_do_not_spoil_the_standard_deviations() -> None:
    c, s = oscillation(200_000)
    time = np.arange(200_000) / 40_000
    c = c + 0.2 * np.cos(2 * np.pi * 10_000.6 * time) + 0.05 * np.cos(2 * np.pi * 50 * time)
    made = collect(demodulate(recording(c, s, 40_000.0)))
    assert made.spectrum_line_frequency_hz is not None and made.spectrum_line_amplitude is not None
    lines = dict(
        zip(
            made.spectrum_line_frequency_hz.round(), made.spectrum_line_amplitude[:, 0], strict=True
        )
    )
    assert lines[10_001.0] == pytest.approx(0.2, rel=0.02) and lines[50.0] == pytest.approx(
        0.05, rel=0.02
    )
    error = (made.signals - truth(made, 5000.3, np.array([1, -0.5j]), -0.1)) / made.signals_std
    ratios = (error**2).mean(0)
    assert (ratios > 0.8).all() and (ratios < 1.25).all()
    held = summarise(made)
    assert (
        held["windows"] == 25_000
        and held["residual_lines"][0]["power_ratio"] > 100
        and held["flagged"]["clipped"] == 0
    )


def test_the_summary_of_a_long_file_is_that_of_every_nth_row(monkeypatch) -> None:
    c, s = oscillation()
    made = collect(demodulate(recording(c, s, 40_000.0)))
    monkeypatch.setattr(import_module("hrg_cli.stages.demodulate"), "SUMMARY_ROWS", 100)
    every = len(made) // 100
    told = summarise(made)["residual_rms"]
    assert told == np.median(made.residual_rms[::every], axis=0).tolist()


def test_the_frequency_is_found_beside_larger_tones_with_a_hint() -> None:
    c, s = oscillation()
    time = np.arange(len(c)) / 40_000
    made = collect(
        demodulate(
            recording(
                c + 3 * np.cos(2 * np.pi * 50 * time), s, 40_000.0, nominal_frequency_hz=5050.0
            )
        )
    )
    assert made.reference_frequency_hz == pytest.approx(5000.3, abs=0.01) and made.status == "valid"


def test_a_converter_without_noise_never_gives_zero_standard_deviations() -> None:
    k = np.arange(20_000)
    c = np.rint(1000 * np.cos(2 * np.pi * k / 8)).astype("i2")
    made = collect(
        demodulate(
            recording(
                c, np.rint(c / 2).astype("i2"), 40_000.0, c_scale_factor=1e-3, s_scale_factor=1e-3
            )
        )
    )
    rounding = 1e-3 * np.sqrt(2 / 8 / 12)
    assert (made.signals_std >= 0.9 * rounding).all() and (made.signals_std < 1.1 * rounding).all()


@pytest.mark.parametrize("step", (1e-3, 1e-2))
def test_rounded_floats_state_their_rounding(step: float) -> None:
    turned = 2 * np.pi * np.arange(20_000) / 40.37
    c, s = (step * np.rint(f(turned) / step) for f in (np.cos, np.sin))
    made = collect(demodulate(recording(c, s, 40_000.0)))
    rounding = step * np.sqrt(2 / 40.37 / 12)
    assert (made.signals_std >= 0.9 * rounding).all() and (made.signals_std < 1.2 * rounding).all()


def test_the_log_is_interpolated_and_not_stretched() -> None:
    c, s = oscillation()
    log = np.arange(0, 2.01, 0.5)
    made = collect(
        demodulate(
            recording(
                c, s, 40_000.0, auxiliary_time_s=log, temperature_degc=20 + log, rate_rad_s=-log
            )
        )
    )
    assert made.temperature_degc is not None and made.rate_rad_s is not None
    within = made.time_s <= 2.5  # a steady course goes on for one step of the log
    np.testing.assert_allclose(made.temperature_degc[within], 20 + made.time_s[within])
    np.testing.assert_allclose(made.rate_rad_s[within], -made.time_s[within])
    short = recording(c, s, 40_000.0, auxiliary_time_s=log[:3], temperature_degc=20 + log[:3])
    late = collect(demodulate(short))
    assert (
        late.temperature_degc is not None
        and np.isnan(late.temperature_degc[-1])
        and "auxiliary log" in " ".join(late.status_reasons)
    )


def test_commands_are_means_over_the_windows() -> None:
    """Of t² over a window of length w about t₀ the mean is t₀² + w²/12; a temperature is that of the
    centre."""
    time, log = np.arange(40_000) / 40_000, np.arange(0, 1.0005, 1e-3)
    c = np.cos(2 * np.pi * 1000 * time) + 1e-4 * np.random.default_rng(2).normal(size=len(time))
    periods = collect(
        demodulate(
            recording(
                c,
                0.2 * c,
                40_000.0,
                auxiliary_time_s=log,
                drive_main=log**2,
                temperature_degc=log**2,
            ),
            periods_per_window=50,
        )
    )
    inner = slice(1, -1)
    mean = periods.time_s**2 + periods.window_s**2 / 12
    assert np.allclose(periods.drive_main[inner], mean[inner], atol=1e-7, rtol=0)
    centre = periods.temperature_degc - periods.time_s**2
    assert np.abs(centre[inner]).max() < 1e-7
    assert periods.window_s**2 / 12 > 1e-4


def test_few_samples_a_period_take_longer_windows_and_say_so() -> None:
    rng = np.random.default_rng(8)
    time = np.arange(50_000) / 40_000
    for frequency in (16_000.0, 19_500.0):
        z = np.stack(
            [np.cos(2 * np.pi * frequency * time), 0.4 * np.sin(2 * np.pi * frequency * time)]
        ) + 1e-3 * rng.normal(size=(2, len(time)))
        made = collect(demodulate(recording(z[0], z[1], 40_000.0)))
        assert (
            made.periods_per_window > 1.5
            and "too few" in " ".join(made.status_reasons)
            and made.status == "valid"
        )
        error = (made.signals - truth(made, frequency, np.array([1, -0.4j]))) / made.signals_std
        assert 0.85 < (error**2).mean() < 1.2


def test_noise_alone_is_refused_and_one_dead_channel_is_suspect() -> None:
    rng = np.random.default_rng(9)
    noise = collect(demodulate(recording(rng.normal(size=50_000), rng.normal(size=50_000), 1e4)))
    assert noise.status == "refused" and "no oscillation" in " ".join(noise.status_reasons)
    drifting = collect(demodulate(recording(*np.cumsum(rng.normal(size=(2, 50_000)), 1), 1e4)))
    assert drifting.status == "refused"
    c, s = oscillation()
    dead = collect(demodulate(recording(c, 0 * s, 40_000.0)))
    assert dead.status == "suspect" and "channel S" in dead.status_reasons[0]
    alone = recording(c, 0 * s, 40_000.0).judged([f"{ONE_CHANNEL}: no angle"], "suspect")
    assert not any("dead" in r for r in collect(demodulate(alone)).status_reasons)
    assert (dead.signals_std > 0).all() and dead.reference_frequency_hz == pytest.approx(
        5000.3, abs=0.01
    )


def test_scale_and_offset_only_change_the_unit() -> None:
    c, s = oscillation(20_000)
    raw = recording(np.rint(8000 * c), np.rint(8000 * s), 40_000.0)
    one = collect(demodulate(raw))
    other = collect(
        demodulate(
            dataclasses.replace(
                raw,
                c_scale_factor=2e-3,
                s_scale_factor=-2e-3,
                c_add_offset=5.0,
                c_units="V",
                s_units="V",
            )
        )
    )
    np.testing.assert_allclose(
        other.signals[:, :2], 2e-3 * one.signals[:, :2], rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(
        other.signals[:, 2:], -2e-3 * one.signals[:, 2:], rtol=1e-9, atol=1e-12
    )
    np.testing.assert_allclose(other.signals_std[:, 2:], 2e-3 * one.signals_std[:, 2:], rtol=1e-6)
    assert other.units == "V"


@pytest.mark.parametrize(
    ("periods", "samples_a_period"), [(1.0, 10.3), (2.0, 9.1), (1.0, 5.4), (1.0, 4.7)]
)
def test_short_windows_state_the_noise_of_a_wave_that_moves_within_them(periods, samples_a_period):
    """Two modes 12 rad/s apart that turn at 40 rad/s put 1e3 times the noise into a window's
    residual; stated are the noise alone and no error beside it. Of five samples a window the residual
    is its motion's whole: the standard deviations were 14 to 21 times too large."""
    frequency, noise = 2239.3, 3e-6
    rate = samples_a_period * frequency
    t = np.arange(int(0.12 * rate)) / rate
    modes = np.array([[1.0, 0.3j], [0.2j, 0.8]])
    own = np.array([-8.0 + 40.0j, -8.6 - 28.0j])

    def envelopes(at):
        return np.exp(np.multiply.outer(at, own)) @ modes

    c, s = np.real(envelopes(t) * np.exp(2j * np.pi * frequency * t)[:, None]).T
    random = np.random.default_rng(5)
    errors, stated = [], []
    for size in (0.0, noise):
        noisy = [x + size * random.standard_normal(len(t)) for x in (c, s)]
        record = Recording(
            c=noisy[0],
            s=noisy[1],
            sample_rate_hz=rate,
            nominal_frequency_hz=frequency,
            mode="free",
            readout="direct",
            mode_number=2,
            gyro_id="G",
            run_id="r",
        )
        made = collect(demodulate(record, periods_per_window=periods))
        at = np.asarray(made.time_s)
        signals = np.asarray(made.signals)
        seen = np.stack([signals[:, 0] - 1j * signals[:, 1], signals[:, 2] - 1j * signals[:, 3]], 1)
        seen *= np.exp(2j * np.pi * (made.reference_frequency_hz - frequency) * at)[:, None]
        # a window shows a mode's mean over it, sinc(x/2) of what it is in the middle
        x = own * made.window_s / 2
        mean = np.exp(np.multiply.outer(at, own)) @ (modes * (np.sinh(x) / x)[:, None])
        nearest = min(
            (seen - true for true in (mean, envelopes(at))), key=lambda d: np.median(np.abs(d))
        )
        errors.append(np.concatenate([nearest.real, nearest.imag], 1))
        stated.append(np.asarray(made.signals_std))
    # signals_std stands as c_cos, c_sin, s_cos, s_sin; the errors as the reals, then the imaginaries
    missed, scattered = (e[:, [0, 2, 1, 3]] / stated[1] for e in errors)
    assert np.sqrt(np.mean(missed**2)) < 0.35
    assert 0.88 < np.sqrt(np.mean(scattered**2)) < 1.2


@pytest.mark.parametrize("periods_per_window", (3.0, 4.0))
def test_the_noise_is_known_beside_what_a_quick_turn_bends_within_a_window(periods_per_window):
    """A turn of 5 rad/s bends the envelope of a window by ten times the noise of its samples: the
    standard deviations are the noise's, run after run."""
    rate, noise, told = 3729.3, 2e-6, []
    t = np.arange(int(0.6 * rate)) / rate
    wave = np.stack([np.cos(5 * t), np.sin(5 * t)]) * np.cos(2 * np.pi * 401.0 * t)
    for seed in range(6):
        c, s = wave + noise * np.random.default_rng([seed, 5]).standard_normal(wave.shape)
        recording = Recording(
            c=c, s=s, sample_rate_hz=rate, mode="free", readout="direct", mode_number=2
        )
        rows = collect(demodulate(recording, periods_per_window=periods_per_window))
        samples = round(rows.window_s * rate)
        told.append(np.median(np.asarray(rows.signals_std)) / noise / np.sqrt(2 / samples))
    assert np.ptp(told) < 0.15
    assert 0.93 < np.mean(told) < 1.2
