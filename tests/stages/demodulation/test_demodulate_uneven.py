"""demodulate on uneven sampling: true times, gaps, the recorded pendulum; and the sentences for
inputs that cannot be demodulated."""

import dataclasses
import json
import os
from pathlib import Path

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.records import FLAG_GAP, FLAG_NOT_FINITE, Recording, collect
from hrg_cli.stages.demodulate import demodulate


def pendulum(
    time: np.ndarray, frequency: float = 0.1118, noise: float = 1e-3, **more: object
) -> tuple[Recording, np.ndarray]:
    """A slowly decaying oscillation at given times, and its envelopes (2,) and growth."""
    rng = np.random.default_rng(1)
    u = np.array([1 + 0.3j, 0.4 - 0.2j])
    z = (
        (u[:, None] * np.exp((-2e-5 + 2j * np.pi * frequency) * time)).real
        + noise * rng.normal(size=(2, len(time)))
        + 5
    )
    return Recording(
        c=z[0], s=z[1], time_s=time, **({"mode": "free", "mode_number": 1, "run_id": "p"} | more)
    ), u  # type: ignore[arg-type]


def errors(made, u: np.ndarray, frequency: float = 0.1118) -> np.ndarray:  # type: ignore[no-untyped-def]
    turn = np.exp((-2e-5 + 2j * np.pi * (frequency - made.reference_frequency_hz)) * made.time_s)
    true = np.stack(
        [(u[0] * turn).real, -(u[0] * turn).imag, (u[1] * turn).real, -(u[1] * turn).imag], -1
    )
    return (made.signals - true) / made.signals_std


def camera_times(n: int, begin: float = 0.0) -> np.ndarray:
    return begin + np.cumsum(np.random.default_rng(2).choice([0.243, 0.314], n))


@pytest.mark.parametrize(
    ("periods", "begin"), [(0.6, 0.0), (1.0, -1000.0), (3.3, 1e4), (20.0, 0.0)]
)
def test_errors_are_as_large_as_their_standard_deviations_say(periods: float, begin: float) -> None:
    made_from, u = pendulum(camera_times(12_000, begin))
    made = collect(demodulate(made_from, periods_per_window=periods))
    error = errors(made, u)
    assert not made.flags.any() and made.status == "valid"
    assert 0.75 < (error**2).mean() < 1.3
    assert np.abs(error.mean(0)).max() * np.sqrt(len(error)) < 4.5
    assert made.periods_per_window == pytest.approx(periods, rel=1e-3)


def test_even_times_given_one_by_one_agree_with_even_sampling() -> None:
    time = np.arange(20_000) / 20.0
    one, _ = pendulum(time, 1.2345)
    other = dataclasses.replace(one, time_s=None, sample_rate_hz=20.0)
    a, b = (
        collect(demodulate(one, periods_per_window=10.0)),
        collect(demodulate(other, periods_per_window=10.0)),
    )
    turn = np.exp(2j * np.pi * (a.reference_frequency_hz - b.reference_frequency_hz) * a.time_s)
    c = (a.signals[:, 0] - 1j * a.signals[:, 1]) * turn
    assert (
        np.abs(np.interp(a.time_s, b.time_s, b.signals[:, 0]) - c.real)[1:-1].max()
        < 6 * a.signals_std[:, 0].max()
    )
    assert a.signals_std[:, 0].mean() == pytest.approx(b.signals_std[:, 0].mean(), rel=0.1)


def test_gaps_are_flagged_and_no_row_is_dropped() -> None:
    time = camera_times(12_000)
    whole, u = pendulum(time)
    kept = ~((time > 300) & (time < 317)) & ~((time > 900) & (time < 977))
    made = collect(
        demodulate(dataclasses.replace(whole, c=whole.c[kept], s=whole.s[kept], time_s=time[kept]))
    )
    gap = made.flags & FLAG_GAP != 0
    width = made.window_s
    touched = ((made.time_s + width / 2 > 300) & (made.time_s - width / 2 < 317)) | (
        (made.time_s + width / 2 > 900) & (made.time_s - width / 2 < 977)
    )
    np.testing.assert_array_equal(gap, touched)
    np.testing.assert_allclose(np.diff(made.time_s), width)
    empty = (made.time_s - width / 2 > 901) & (made.time_s + width / 2 < 976)
    assert empty.sum() >= 6 and np.isnan(made.signals[empty]).all()
    error = errors(made, u)[~gap]
    assert 0.75 < (error**2).mean() < 1.3 and np.isfinite(made.signals[~gap]).all()


@pytest.mark.parametrize(("lost_s", "status"), ((40.0, "valid"), (1500.0, "suspect")))
def test_more_than_a_tenth_of_windows_in_gaps_is_suspect(lost_s: float, status: str) -> None:
    time = camera_times(12_000)
    whole, _ = pendulum(time)
    kept = ~((time > 300) & (time < 300 + lost_s))
    made = collect(
        demodulate(dataclasses.replace(whole, c=whole.c[kept], s=whole.s[kept], time_s=time[kept]))
    )
    part = ((made.flags & FLAG_GAP) != 0).mean()
    assert made.status == status and (part > 0.1) == (status == "suspect")
    assert "gaps of the sampling" in " ".join(made.status_reasons)


def test_blocks_do_not_change_results() -> None:
    made_from, _ = pendulum(camera_times(9_000))
    for periods in (1.0, 5.0):
        one, many = (
            collect(demodulate(made_from, periods_per_window=periods, block_samples=size))
            for size in (1 << 20, 500)
        )
        np.testing.assert_array_equal(one.signals, many.signals)
        np.testing.assert_array_equal(one.signals_std, many.signals_std)


def test_values_that_are_not_finite_are_flagged() -> None:
    made_from, _ = pendulum(camera_times(9_000))
    c = made_from.c.copy()
    c[4000:4003] = np.nan
    made = collect(demodulate(dataclasses.replace(made_from, c=c)))
    bad = made.flags & FLAG_NOT_FINITE != 0
    assert (
        1 <= bad.sum() <= 2
        and np.isnan(made.signals[bad, 0]).all()
        and np.isfinite(made.signals[~bad]).all()
    )


def changed(**changes: object) -> Recording:
    time = np.arange(4000) / 1000
    c = np.cos(2 * np.pi * 100.3 * time)
    base = Recording(c=c, s=0.5 * c, sample_rate_hz=1000.0, mode="free", run_id="r7")
    return dataclasses.replace(base, **changes)  # type: ignore[arg-type]


def uneven(**changes: object) -> Recording:
    return changed(**({"sample_rate_hz": None, "time_s": at(0, 0.0)} | changes))


def at(row: int, value: float) -> np.ndarray:
    time = np.arange(4000) / 1000 + 1e-4 * (np.arange(4000) % 3)
    time[row:] += value
    return time


@pytest.mark.parametrize(
    ("made_from", "words"),
    [
        (changed(c=np.zeros(0), s=np.zeros(0)), "has 0 samples"),
        (changed(c=np.ones(1), s=np.ones(1)), "has 1 samples"),
        (changed(c=np.zeros(4000), s=np.zeros(4000)), "all zero"),
        (changed(c=np.full(4000, 3.0), s=np.full(4000, 2.0)), "constant"),
        (changed(c=np.full(4000, np.nan), s=np.full(4000, np.nan)), "finite"),
        (changed(s=np.zeros(3999)), "equal lengths"),
        (changed(nominal_frequency_hz=700.0), "half the sampling rate"),
        (changed(nominal_frequency_hz=-5.0), "between 0 and half"),
        (changed(sample_rate_hz=-1.0), "positive"),
        (changed(sample_rate_hz=None), "positive"),
        (changed(sample_rate_hz=float("nan")), "positive"),
        (changed(readout="carrier"), "carrier_hz is missing"),
        (changed(readout="carrier", carrier_hz=600.0), "above half"),
        (
            changed(readout="carrier", carrier_hz=450.0, nominal_frequency_hz=100.0),
            "the sum of its carrier",
        ),
        (changed(readout="radio"), "direct or carrier"),
        (
            changed(auxiliary_time_s=np.array([0.0, 0.0]), temperature_degc=np.array([1.0, 2.0])),
            "auxiliary log",
        ),
        (uneven(time_s=at(2000, -0.0011)), "strictly increasing"),
        (uneven(time_s=at(2000, -1.0)), "strictly increasing"),
        (uneven(time_s=at(2000, 1e6)), "clock jumps"),
        (uneven(time_s=at(2000, np.nan)), "increasing"),
        (uneven(time_s=np.arange(10.0)), "one time a sample"),
    ],
)
def test_what_cannot_be_demodulated_gets_one_sentence(made_from: Recording, words: str) -> None:
    with pytest.raises(HrgError, match=words) as caught:
        collect(demodulate(made_from))
    assert str(caught.value).startswith("run r7: ") and "\n" not in str(caught.value)


def test_a_window_longer_than_the_run_is_an_error() -> None:
    for made_from in (changed(), uneven()):
        with pytest.raises(HrgError, match=r"do not hold one window of 1e\+06 periods"):
            collect(demodulate(made_from, periods_per_window=1e6))


@pytest.fixture
def measured() -> Path:
    folder = os.environ.get("HRG_MEASURED_DATA", "")
    if not folder or not Path(folder).is_dir():
        pytest.skip("HRG_MEASURED_DATA names no folder of measured data")
    return Path(folder)


def test_the_recorded_pendulum(measured: Path) -> None:
    """Published 8.94 s a period; two gaps near the start; neighbouring windows scatter as their
    standard deviations say."""
    rows = [
        line.split(",")
        for line in (measured / "foucault_yverdon/oscillation4.csv").read_text().splitlines()
        if line.strip()
    ]
    time = np.array(
        [
            sum(
                float(part) * unit
                for part, unit in zip(row[2].split(":"), (3600, 60, 1), strict=True)
            )
            for row in rows
        ]
    )
    made_from = Recording(
        c=np.array([float(row[0]) for row in rows]),
        s=np.array([float(row[1]) for row in rows]),
        time_s=time - time[0],
        mode="free",
        mode_number=1,
    )
    made = collect(demodulate(made_from))
    assert 1 / made.reference_frequency_hz == pytest.approx(8.942, abs=0.003)
    assert made.status == "valid" and 5 <= (made.flags & FLAG_GAP != 0).sum() <= 20
    assert len(made) == pytest.approx((time[-1] - time[0]) / 8.942, abs=2)
    good = made.flags == 0
    size = np.hypot(*made.signals[good, :2].T)
    scatter = np.median(np.abs(np.diff(size, 2))) / 0.6745 / np.sqrt(6)
    assert 0.5 < scatter / np.median(made.signals_std[good, 0]) < 2
    assert made.spectrum_line_frequency_hz is not None
    harmonics = made.spectrum_line_frequency_hz / made.reference_frequency_hz
    assert any(abs(h - 2) < 0.02 for h in harmonics)


def test_the_recorded_bell(measured: Path) -> None:
    soundfile = pytest.importorskip("soundfile")
    data, rate = soundfile.read(measured / "bell/perc_bell.flac", dtype="int16")
    made = collect(
        demodulate(
            Recording(
                c=data[:, 0],
                s=data[:, 1],
                sample_rate_hz=float(rate),
                mode="free",
                nominal_frequency_hz=3618.0,
            )
        )
    )
    assert 3610 < made.reference_frequency_hz < 3626
    assert np.isfinite(made.signals).all() and made.status != "refused"


POSIX = 1.7e9


def gyro_on_a_clock(offset_s: float, **more: object) -> Recording:
    """A 1 kHz wave whose stamps are rounded as doubles of seconds since 1970 are; the clock is
    `offset_s` behind 1970's."""
    rng = np.random.default_rng(11)
    time = np.arange(8000) / 8000 + POSIX
    z = np.exp((-0.5 + 2j * np.pi * 1000.3) * np.arange(8000) / 8000)
    c, s = (part + 1e-3 * rng.normal(size=8000) for part in (z.real, 0.3 * z.imag))
    log = POSIX - offset_s + np.arange(5) / 4
    return Recording(
        c=c,
        s=s,
        time_s=time - offset_s,
        auxiliary_time_s=log,
        temperature_degc=20 + np.arange(5.0),
        mode="free",
        nominal_frequency_hz=1000.0,
        **more,  # type: ignore[arg-type]
    )


def test_seconds_since_1970_lose_nothing() -> None:
    """The same samples and stamps on a clock from 1970 and from the first sample: same rows."""
    absolute, own = (
        collect(demodulate(gyro_on_a_clock(offset), periods_per_window=20.0))
        for offset in (0.0, POSIX)
    )
    np.testing.assert_array_equal(absolute.signals, own.signals)
    np.testing.assert_array_equal(absolute.time_s, own.time_s)
    np.testing.assert_array_equal(absolute.temperature_degc, own.temperature_degc)
    assert json.loads(absolute.details) == {"clock_origin_s": POSIX}
    assert json.loads(own.details) == {}
    assert absolute.status == "valid" and any("1700000000 s" in r for r in absolute.status_reasons)


@pytest.mark.parametrize(
    ("start", "expected"),
    [
        ("1970-01-01T00:00:00Z", "2023-11-14T22:13:20Z"),
        ("2023-11-14T22:13:20Z", "2023-11-14T22:13:20Z"),
        ("", ""),
    ],
)
def test_start_time_is_that_of_the_first_sample(start: str, expected: str) -> None:
    """ISO time of t = 0: of the clock's beginning, or the first stamp's own moment."""
    made = collect(demodulate(gyro_on_a_clock(0.0, start_time=start), periods_per_window=20.0))
    assert made.start_time == expected


def test_times_that_doubles_hold_stay_as_they_are() -> None:
    made = collect(demodulate(pendulum(camera_times(1200, 1e4))[0]))
    assert made.time_s[0] > 1e4 and json.loads(made.details) == {}


@pytest.mark.parametrize(("kind", "periods"), [("lost", 20.0), ("poisson", 20.0), ("lost", 1.0)])
def test_samples_lost_at_random_are_no_gap(kind: str, periods: float) -> None:
    """A fifth of the samples lost, or times drawn at random: windows are full of samples, and
    their errors as large as their standard deviations say."""
    rng = np.random.default_rng(5)
    time = np.arange(12_000) / 8000
    if kind == "lost":
        time = time[rng.uniform(size=len(time)) > 0.2]
    else:
        time = np.sort(rng.uniform(0, 1.5, len(time)))
    made_from, u = pendulum(time, 1000.3, nominal_frequency_hz=1000.0)
    made = collect(demodulate(made_from, periods_per_window=periods))
    gap = made.flags & FLAG_GAP != 0
    assert made.status == "valid" and gap.mean() < 0.1
    error = errors(made, u, 1000.3)[~gap]
    assert 0.85 < (error**2).mean() < 1.15


@pytest.mark.parametrize("periods", [1.0, 20.0])
def test_long_gaps_stay_flagged_in_longer_windows(periods: float) -> None:
    time = camera_times(6_000)
    whole, _ = pendulum(time, nominal_frequency_hz=0.11)
    kept = ~((time > 300) & (time < 316)) & ~((time > 900) & (time < 976))
    made = collect(
        demodulate(
            dataclasses.replace(whole, c=whole.c[kept], s=whole.s[kept], time_s=time[kept]),
            periods_per_window=periods,
        )
    )
    for middle in (308.0, 938.0):
        at = np.argmin(np.abs(made.time_s - middle))
        assert made.flags[at] & FLAG_GAP


def test_gaps_that_shorter_windows_avoid_are_said() -> None:
    time = camera_times(6_000)
    whole, _ = pendulum(time, nominal_frequency_hz=0.11)
    kept = time % 400 > 15
    broken = dataclasses.replace(whole, c=whole.c[kept], s=whole.s[kept], time_s=time[kept])
    long = collect(demodulate(broken, periods_per_window=20.0))
    said = [r for r in long.status_reasons if "gaps of the sampling" in r]
    assert long.status == "suspect" and len(said) == 1
    shorter = float(said[0].split("at most ")[1])
    assert 1 <= shorter < 20
    assert collect(demodulate(broken, periods_per_window=shorter)).status == "valid"
