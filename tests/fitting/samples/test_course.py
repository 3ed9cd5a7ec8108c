"""A log between its rows: smooth courses by the cubic, everything else by straight lines, integrals
exact for cubics."""

import numpy as np
import pytest

from hrg_cli.fitting.samples.course import (
    average_over_windows,
    build_course,
    build_from_means,
    estimate_means,
    integrate_means,
)

Q = np.linspace(0.0, 3.0, 4001)


def rows(seed: int = 1) -> np.ndarray:
    """Rows every 20 ms with jitter, not beginning or ending with the run."""
    return np.sort(np.arange(0.004, 3.0, 0.02) + np.random.default_rng(seed).uniform(0, 0.004, 150))


@pytest.mark.parametrize(
    "f",
    [lambda t: 3 * np.sin(9 * t), lambda t: np.exp(-8 * t), lambda t: 1 + t - t**2 + t**3 / 3],
    ids=["sine", "decay", "cubic"],
)
def test_a_smooth_course_is_followed_far_better_than_by_lines(f) -> None:
    t = rows()
    assert (
        np.abs(build_course(t, f(t)).interpolate(Q) - f(Q)).max()
        < 0.1 * np.abs(np.interp(Q, t, f(t)) - f(Q)).max()
    )


def test_the_integral_is_that_of_the_cubic() -> None:
    t = rows()
    whole = t + t**2 / 2 - t**3 / 3 + t**4 / 12
    assert build_course(t, 1 + t - t**2 + t**3 / 3).integrate() == pytest.approx(
        whole - whole[0], abs=1e-11
    )


@pytest.mark.parametrize("turn", [0.2, 0.4, 0.6])
def test_the_integral_through_six_rows_keeps_the_size_of_a_quick_swing(turn: float) -> None:
    """Of a swing that turns by x a row the cubics' integral misses 11x⁴/720 of itself, the quintics'
    191x⁶/60480; at steps the lines stay."""
    t = np.arange(400) * turn
    both = np.stack([np.sin(t), np.cos(t), np.ones_like(t)], 1)
    off = build_course(t, np.cos(t + 0.3)).integrate() - np.sin(t + 0.3)
    lost = float(np.hypot(*np.linalg.lstsq(both, off, rcond=None)[0][:2]))
    assert lost < 1.2 * 191 * turn**6 / 60480
    steps = np.where(np.sin(t / 5 + 1) > 0, 1.0, -1.0)
    lines = np.concatenate([[0.0], np.cumsum((steps[1:] + steps[:-1]) / 2 * turn)])
    assert np.allclose(build_course(t, steps).integrate(), lines, atol=1e-12 * t[-1])


def test_a_cubic_is_met_between_uneven_rows_exactly() -> None:
    t = np.cumsum(np.random.default_rng(4).uniform(0.2, 0.6, 8))

    def cubic(x: np.ndarray) -> np.ndarray:
        return 1 + x - x**2 + x**3 / 3

    inside = np.linspace(t[0], t[-1], 300)
    assert build_course(t, cubic(t)).interpolate(inside) == pytest.approx(cubic(inside), abs=1e-11)


def test_jumps_and_converter_steps_stay_lines() -> None:
    t = rows()
    for values in (np.where(t > 1.234, 2.0, -1.0), np.round(20 + 3 * t)):
        assert build_course(t, values).interpolate(t[0] + (t[-1] - t[0]) * Q / 3) == pytest.approx(
            np.interp(t[0] + (t[-1] - t[0]) * Q / 3, t, values)
        )


@pytest.mark.parametrize("knees", [(2.6, 2.66), (2.6, 2.62), (2.5805, 2.63), (2.59, 2.64)])
def test_a_ramp_between_rests_has_no_overshoot(knees) -> None:
    """Rows 43 ms apart and one at each corner: between them the table's rate is a straight line."""
    t = np.unique(np.concatenate([np.arange(0, 5, 0.043), knees]))
    rate = np.interp(t, knees, (0, 4.6))
    at = np.linspace(0, 5, 5000)
    assert np.allclose(build_course(t, rate).interpolate(at), np.interp(at, t, rate), atol=1e-12)


def test_noise_is_not_made_worse() -> None:
    t, rng = rows(), np.random.default_rng(2)
    noise = rng.standard_normal(len(t))
    assert np.std(build_course(t, noise).interpolate(Q)) < 1.1 * np.std(np.interp(Q, t, noise))


def test_few_rows_and_the_ends() -> None:
    assert build_course(np.array([1.0]), np.array([5.0])).interpolate(Q) == pytest.approx(5.0)
    assert build_course(np.array([1.0, 2.0]), np.array([5.0, 6.0])).interpolate(
        np.array([0.0, 1.5, 3.0])
    ) == pytest.approx([5.0, 5.5, 6.0])
    t = np.arange(3.0)
    assert build_course(t, 2 * t).interpolate(np.array([-0.5, 2.5, 30.0])) == pytest.approx(
        [-1.0, 5.0, 6.0]
    )
    t = np.arange(10.0)
    assert build_course(t, 2 * t).interpolate(np.array([-5.0, -0.5, 9.5, 30.0])) == pytest.approx(
        [-2.0, -1.0, 19.0, 20.0]
    )


def test_a_log_of_means_keeps_every_row_however_rough() -> None:
    step, random = 0.01, np.random.default_rng(8)
    t = (np.arange(300) + 0.5) * step
    means = 1 + random.normal(size=300)
    log = integrate_means(t, means)
    three = average_over_windows(log, t[1:-1:3], 3 * step)
    np.testing.assert_allclose(
        three, means[: 3 * len(three)].reshape(-1, 3).mean(axis=1), atol=1e-12
    )
    # values between the rows, as a log of single values would have them, miss their own scatter
    assert np.std(build_course(t, means).interpolate(t[1:-1:3]) - three) > 0.5


def test_a_command_goes_on_where_its_log_has_ended() -> None:
    """A log may end within a last window, or begin within a first: the command does not stop there,
    as its integral would if that were held."""
    t = 0.5 + np.arange(40) * 0.1
    means = 3.0 + 0.01 * t
    windows = np.array([0.2, 0.4, 4.4, 4.65])
    got = average_over_windows(integrate_means(t, means), windows, 0.4)
    np.testing.assert_allclose(got, 3.0 + 0.01 * windows, atol=4e-3)
    alone = average_over_windows(integrate_means(t[:1], means[:1]), windows, 0.4)
    np.testing.assert_allclose(alone, means[0], rtol=1e-12)


def test_a_log_of_single_values_of_a_smooth_command_gives_its_means() -> None:
    """Loops that settle as e^{−8t} beside twenty rows per second: taken for means, the values would
    miss h²·64/24 = 0.7 %."""
    t, step = np.arange(0.0, 2.0, 0.05), 0.05
    means = estimate_means(t, np.exp(-8 * t))
    exact = (np.exp(-8 * (t - step / 2)) - np.exp(-8 * (t + step / 2))) / (8 * step)
    plain = np.abs(np.exp(-8 * t) / exact - 1)[1:-1]
    assert plain.min() > 5e-3 and np.abs(means / exact - 1)[1:-1].max() < 8e-4
    noise = np.random.default_rng(3).normal(size=300)
    np.testing.assert_allclose(estimate_means(np.arange(300.0), noise), noise, atol=0.3)


def test_values_at_uneven_instants_give_the_means_of_their_surroundings() -> None:
    """Rows after 9/16 and 7/16 of a period by turns stand off the centre of what they stand for,
    which a row's own value misses by (c − t) ẏ, in noise as well as along a smooth course."""
    t = (np.arange(100)[:, None] + [3.5 / 16, 12.5 / 16]).ravel() * 0.015
    border = np.concatenate([[t[0] - 3.28125e-3], (t[1:] + t[:-1]) / 2, [t[-1] + 3.28125e-3]])
    exact = -np.diff(np.exp(-20 * border)) / 20 / np.diff(border)
    means = estimate_means(t, np.exp(-20 * t))
    assert np.abs(np.exp(-20 * t) / exact - 1)[1:-1].min() > 8e-3
    assert np.abs(means / exact - 1)[1:-1].max() < 5e-4
    noisy = np.exp(-20 * t) + 1e-3 * np.random.default_rng(4).normal(size=len(t))
    left = np.sum(np.abs(estimate_means(t, noisy) - noisy - exact + np.exp(-20 * t))[1:30])
    assert left < 0.3 * np.sum(np.abs(exact - np.exp(-20 * t))[1:30])


def test_means_of_a_smooth_quantity_are_its_integral() -> None:
    step = 0.01
    t = (np.arange(300) + 0.5) * step
    means = (np.cos(9 * (t - step / 2)) - np.cos(9 * (t + step / 2))) / (9 * step)
    windows = np.linspace(0.2, 2.8, 37)
    exact = (np.cos(9 * (windows - 0.0137)) - np.cos(9 * (windows + 0.0137))) / (9 * 0.0274)
    np.testing.assert_allclose(
        average_over_windows(integrate_means(t, means), windows, 0.0274), exact, atol=1e-5
    )
    through = build_from_means(t, means, step)
    inside = slice(4, -4)
    np.testing.assert_allclose(through.value[inside], np.sin(9 * t)[inside], atol=2e-6)


@pytest.mark.parametrize("place", np.linspace(0.0, 1.0, 7))
@pytest.mark.parametrize("width", [0.8, 1.3, 2.0])
def test_a_step_over_a_row_or_two_turns_by_the_integral_of_its_means(width, place) -> None:
    """∫(1 + tanh(x/w)) = x + w ln cosh(x/w), wherever between two rows the step stands."""
    t = np.arange(-20.0, 21.0)

    def integral(x):
        return x + width * np.log(np.cosh((x - place) / width))

    means = integral(t + 0.5) - integral(t - 0.5)
    through = build_from_means(t, means, 1.0)
    turned = np.diff(through.integrate_to(np.array([-12.5, 12.5])))
    assert abs(turned - np.diff(integral(np.array([-12.5, 12.5])))) < 1e-6
