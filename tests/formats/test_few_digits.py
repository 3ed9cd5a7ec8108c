"""Demodulated rows written with fewer digits than their noise has: what rounding makes is in σ, is
no second mode, no settling filter and no stuck channel."""

import numpy as np
import pytest
from test_envelope import REFERENCE, TRUTH, envelope, iq_log, lock_in, taken

from hrg_cli.formats import import_envelope
from hrg_cli.formats.row_noise import estimate_row_noise
from hrg_cli.records import FLAG_SETTLING, collect
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify

TIME_S = np.arange(1500) / 50


def noisy(u, noise, seed):
    random = np.random.default_rng(seed)
    return (
        u
        + noise
        * random.standard_normal((2, *u.shape)).transpose(1, 2, 0).copy().view(complex)[..., 0]
    )


def identified(path, columns, digits, **named):
    """What the chain tells of the columns, each written with so many digits."""
    rows = zip(TIME_S, *columns, strict=True)
    written = (",".join([f"{t:.2f}", *map("{:.{}f}".format, row, digits)]) for t, *row in rows)
    path.write_text("\n".join(["time [s]" + ",x" * len(columns), *written]) + "\n")
    periods = collect(import_envelope(path, reference_frequency_hz=REFERENCE, **named))
    return periods, identify([collect(estimate(periods))])


@pytest.mark.parametrize("offset_hz", [0.3, 0.0123])
@pytest.mark.parametrize("digits", [1, 2])
def test_a_phase_in_tenths_of_a_degree_makes_no_second_mode(offset_hz, digits, tmp_path):
    """The frequency was 3300 σ off, that of a line of the rounding, with a split of 31 rad/s."""
    decay = TRUTH["damping_rate_1_s"] + 0.1
    (u,) = noisy(np.exp((-decay + 2j * np.pi * offset_hz) * TIME_S + 0.7j)[None], 1e-4, digits)
    columns = [np.abs(u), np.degrees(np.angle(u))]
    named = {"amplitude": 2, "phase": 3, "phase_units": "deg"}
    periods, record = identified(tmp_path / "log.csv", columns, (9, digits), **named)
    assert periods.least_count == pytest.approx(np.radians(10.0**-digits), rel=0.01)
    found = record.parameters()
    assert "frequency_split_rad_s" not in found
    for name, true in (("frequency_hz", REFERENCE + offset_hz), ("damping_rate_1_s", decay)):
        value, std, _ = found[name]
        assert abs(value - true) < 4 * std, name
    assert not any("settles" in r or "strike" in r for r in record.status_reasons)


@pytest.mark.parametrize("digits", [3, 4])
def test_a_channel_that_stays_within_its_last_digit_is_not_stuck(digits, tmp_path):
    """Right results were refused: "channel S stuck, record the run again"."""
    u = noisy(envelope(TIME_S, 1e-3), 0.1 * 10.0**-digits, 7)
    columns = [part for one in u for part in (one.real, one.imag)]
    names = ("c_in_phase", "c_quadrature", "s_in_phase", "s_quadrature")
    named = {name: 2 + k for k, name in enumerate(names)}
    periods, record = identified(tmp_path / "log.csv", columns, (digits,) * 4, **named)
    assert periods.least_count == pytest.approx(10.0**-digits, rel=1e-6)
    assert record.status != "refused", record.status_reasons
    for name, true in (TRUTH | {"frequency_hz": REFERENCE + 1e-3}).items():
        value, std, _ = record.parameters()[name]
        assert abs(value - true) < 4 * std, name


def test_a_channel_that_does_hold_one_value_is_stuck(tmp_path):
    """Beside rounding, too: among values that change from row to row a hundred do not."""
    u = noisy(envelope(TIME_S), 1e-5, 7)
    u[1, 700:800] = u[1, 700]
    columns = [part for one in u for part in (one.real, one.imag)]
    names = ("c_in_phase", "c_quadrature", "s_in_phase", "s_quadrature")
    named = {name: 2 + k for k, name in enumerate(names)}
    _, record = identified(tmp_path / "log.csv", columns, (4,) * 4, **named)
    assert record.status == "refused"
    assert any("channel S stuck" in reason for reason in record.status_reasons)


def test_digits_below_the_noise_change_nothing(tmp_path):
    u = noisy(envelope(TIME_S), 1e-3, 7)
    columns = [part for one in u for part in (one.real, one.imag)]
    names = ("c_in_phase", "c_quadrature", "s_in_phase", "s_quadrature")
    named = {name: 2 + k for k, name in enumerate(names)}
    few, many = (identified(tmp_path / f"{d}.csv", columns, (d,) * 4, **named)[1] for d in (4, 12))
    np.testing.assert_allclose(few.std, many.std, rtol=0.02)


def test_a_filter_that_settles_is_seen_in_rows_as_coarse_as_their_noise(tmp_path):
    """Steps of one σ are spread by the noise: what stands out of both is the filter's."""
    time, u = lock_in(2, 0.02, settled=0.0)
    _, long_on = lock_in(2, 0.02, settled=20.0)
    flagged = []
    for step in (1e-9, 1.2 * estimate_row_noise([long_on]).variance.mean() ** 0.5):
        periods = taken(
            iq_log(
                tmp_path,
                time,
                step * np.round(np.ascontiguousarray(u).view(float) / step).view(complex),
            )
        )
        flagged.append(np.count_nonzero(periods.flags & FLAG_SETTLING))
    assert min(flagged) > 0, flagged
