"""The envelope's motion within a window, from its neighbours: slopes and bends, what they pull the
fitted coefficients by, what they put into the residual."""

from __future__ import annotations

import numpy as np

from ..medians import find_median
from .basis import Pull
from .windows import sum_energy

Array = np.ndarray

NEIGHBOURS = 4
"""Windows on either side between which the envelope's slope is taken; it adds 0.07 % to the
variance at one period a window."""
SLOPE_NOISE = 0.1143
"""Variance of `estimate_fine_slopes` over that of a row, in 1/T²; plain ones have less."""
BEND = 2
"""Windows on either side between which the curvature is taken; it adds 4 % to the variance."""
CURVED = 1 / 3 + 7 / 240
"""h²/12 at h = 2 for the error of the second difference, and 24·7/5760 for the average over a
window to the next order, in T²."""


def estimate_slopes(u: Array, local_less_reference_rad_s: Array, window_s: float) -> Array | None:
    """Slope of the envelopes u (channel, rows, F) in the local frame, from rows ± `NEIGHBOURS`;
    None with fewer than three rows.

    U1 = (u_{k+h} e^{−jΔhT} − u_{k−h} e^{jΔhT})/2hT, Δ = ω_local − ω_r, in reference phase.
    Rows at the ends continue their neighbours'; 0 where unknown.

    Parameters
    ----------
    u
        Envelopes (channels, rows, F) in reference phase.
    local_less_reference_rad_s
        Δ of each tone (F,), or one, rad/s.
    window_s
        From row to row, T.

    Returns
    -------
    ndarray or None
        As u, its unit per second.

    Examples
    --------
    An envelope that turns by 0.1 rad a window, U̇ = 0.1j U; over h = 4 windows the difference shows
    sin(0.4)/0.4 of it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.envelope_motion import estimate_slopes
    >>> u = np.exp(0.1j * np.arange(30))[None, :, None]
    >>> slope = estimate_slopes(u, np.zeros(1), 1.0)
    >>> float((slope / u).imag[0, 15, 0].round(5)), float((0.1 * np.sin(0.4) / 0.4).round(5))
    (0.09735, 0.09735)
    """
    h = min(NEIGHBOURS, (u.shape[1] - 1) // 2)
    if h < 1:
        return None
    ahead = np.exp(-1j * local_less_reference_rad_s * h * window_s) / (2 * h * window_s)
    inner = u[:, 2 * h :] * ahead
    inner -= u[:, : -2 * h] * ahead.conj()
    return _spread(inner, h, np.exp(1j * local_less_reference_rad_s * window_s))


def estimate_fine_slopes(
    u: Array, local_less_reference_rad_s: Array, window_s: float
) -> Array | None:
    """Slope of the envelopes in the local frame, that of the cubic nearest to 2·`NEIGHBOURS` + 1
    rows; at the ends of the quintic through the first and the last.

    Right to the order T⁴, where a difference of two rows h apart misses (hT)²/6 of the third
    derivative, at 0.114/T² of the rows' variance (Savitzky and Golay 1964).

    Parameters
    ----------
    u, local_less_reference_rad_s, window_s
        As in `estimate_slopes`.

    Returns
    -------
    ndarray or None
        As u, its unit per second; None with fewer rows than 2·`NEIGHBOURS` + 1.

    Examples
    --------
    An envelope that turns by 0.1 rad a window:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.envelope_motion import estimate_fine_slopes
    >>> u = np.exp(0.1j * np.arange(30))[None, :, None]
    >>> float((estimate_fine_slopes(u, np.zeros(1), 1.0) / u).imag[0, 15, 0].round(5))
    0.09999
    """
    n = 2 * NEIGHBOURS + 1
    if u.shape[1] < n:
        return None
    place = np.arange(n) - NEIGHBOURS
    weights, at_ends = (_build_derivative(place, degree) / window_s for degree in (3, 5))
    turn = np.exp(1j * local_less_reference_rad_s * window_s)
    count = u.shape[1] - 2 * NEIGHBOURS
    out = np.empty(u.shape, complex)
    inner = np.zeros((u.shape[0], count, u.shape[2]), complex)
    for k, weight in enumerate(weights[NEIGHBOURS]):
        if weight:
            inner += u[:, k : k + count] * (weight * turn ** -place[k])
    out[:, NEIGHBOURS:-NEIGHBOURS] = inner
    # The ends have rows on one side only: a higher degree keeps the order of the error there.
    for i in range(NEIGHBOURS):
        for row, first, at in ((i, 0, i), (-1 - i, u.shape[1] - n, n - 1 - i)):
            frame = turn ** -(np.arange(n)[:, None] - at)
            out[:, row] = np.einsum("w,cwf->cf", at_ends[at], u[:, first : first + n] * frame)
    return out


def _build_derivative(place: Array, degree: int) -> Array:
    """Weights (n, n) of values at places whose polynomial of least squares has the derivative at
    each of them."""
    powers = place[:, None] ** np.arange(degree + 1)
    rise = powers[:, :-1] * np.arange(1, degree + 1)
    return np.asarray(rise @ np.linalg.pinv(powers)[1:])


def estimate_better_slopes(
    u: Array, local_less_reference_rad_s: Array, window_s: float
) -> Array | None:
    """Slopes of envelopes without the first ones' pull: fine ones, plain ones where rows are few.

    Parameters
    ----------
    u, local_less_reference_rad_s, window_s
        As in `estimate_slopes`.

    Returns
    -------
    ndarray or None
        As u, its unit per second; None where the rows are too few for any.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.envelope_motion import estimate_better_slopes
    >>> for rows in (2, 3, 30):
    ...     slope = estimate_better_slopes(2j * np.arange(rows)[None, :, None], np.zeros(1), 1.0)
    ...     print(rows, None if slope is None else slope[0, 1, 0].round(9).item())
    2 None
    3 2j
    30 2j
    """
    fine = estimate_fine_slopes(u, local_less_reference_rad_s, window_s)
    return estimate_slopes(u, local_less_reference_rad_s, window_s) if fine is None else fine


def estimate_curvatures(
    u: Array, local_less_reference_rad_s: Array, window_s: float
) -> tuple[Array, Array] | None:
    """Curvature of the envelopes in the local frame from rows ± `BEND`, and how far it may be
    wrong.

    U2 = D − (1/3 + 7/240)·T²·D²: D = (u_{k+h} e^{−jΔhT} − 2u_k + u_{k−h} e^{jΔhT})/(hT)² and D² the
    same of D, so that U − U2·T²/24 undoes the average over a window, sin(x/2)/(x/2) for a turn of x
    a window, but for a rest of the order x⁶. The ends are continued.

    Parameters
    ----------
    u, local_less_reference_rad_s, window_s
        As in `estimate_slopes`.

    Returns
    -------
    curvature : ndarray
        As u, its unit per second squared. In place of the pair None, with fewer than three rows.
    doubt : ndarray
        As u, real: how far the curvature may be wrong.

    Examples
    --------
    Means over windows of an envelope that turns by 0.4 rad a window are 0.7 % too small; its bend
    undoes that:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.envelope_motion import estimate_curvatures
    >>> true = np.exp(0.4j * np.arange(40))[None, :, None]
    >>> mean = true * np.sin(0.2) / 0.2
    >>> bend, doubt = estimate_curvatures(mean, np.zeros(1), 1.0)
    >>> [float(np.abs(x - true)[0, 20, 0].round(6)) for x in (mean, mean - bend / 24)]
    [0.006653, 3.2e-05]
    """
    h = min(BEND, (u.shape[1] - 1) // 2)
    if h < 1:
        return None
    ahead = np.exp(-1j * local_less_reference_rad_s * h * window_s) / (h * window_s) ** 2
    turn = np.exp(1j * local_less_reference_rad_s * window_s)

    def bend(values: Array) -> Array:
        return np.asarray(
            values[:, 2 * h :] * ahead
            - 2 * values[:, h:-h] / (h * window_s) ** 2
            + values[:, : -2 * h] * np.conj(ahead)
        )

    second = bend(u)
    if second.shape[1] <= 4 * h:
        return _spread(second, h, turn), np.zeros(u.shape)
    fourth = _spread(CURVED * window_s**2 * bend(second), h, turn)
    # medians: what a strike leaves at an end of the run is not in the other windows
    fourth2, second2 = (find_median(np.abs(one) ** 2, axis=1) for one in (fourth, second))
    size = np.sqrt(fourth2 / np.maximum(second2, 1e-300))
    doubt = np.broadcast_to((4 * size * np.sqrt(fourth2))[:, None], u.shape).copy()
    second = second - fourth
    out = _spread(second, h, turn)
    beyond = np.arange(1, h + 1)
    for ends, near, back in ((h - beyond, 0, 1), (beyond - h - 1, -1, -1)):
        # the ends continue a parabola; a third of its bend is the doubt
        first, next_, third = (second[:, near + n * back] * turn ** (-n * back) for n in (0, 1, 2))
        grown = (beyond * (beyond + 1) / 2)[:, None] * turn ** (-back * beyond[:, None])
        bent = (first - 2 * next_ + third)[:, None] * grown
        usable = np.isfinite(bent)
        out[:, ends] += np.where(usable, bent, 0.0)
        doubt[:, ends] = np.where(usable, np.hypot(doubt[:, ends], np.abs(bent) / 3), 0.0)
    doubt[~np.isfinite(doubt)] = 0.0
    return out, doubt


def compute_gain_at_middle(turns: Array | float) -> Array:
    """What taking the bend off makes of a motion that turns so often a window.

    It is 1 + (s/24)(1 + (1/3 + 7/240) s) with s = (2/h)² sin² πhx at x turns a window, h = `BEND`,
    beside the sinc x of the mean itself (see `estimate_curvatures`). Of a slow motion it undoes the
    mean; what moves quickly, noise above all, it makes larger.

    Parameters
    ----------
    turns
        Turns a window, x.

    Returns
    -------
    ndarray
        One or more, as many.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.envelope_motion import compute_gain_at_middle
    >>> turns = np.array([0.02, 0.05, 0.25])
    >>> compute_gain_at_middle(turns).round(5).tolist(), (1 / np.sinc(turns)).round(5).tolist()
    ([1.00066, 1.00412, 1.05677], [1.00066, 1.00412, 1.11072])
    """
    s = (2 / BEND * np.sin(np.pi * BEND * np.asarray(turns, float))) ** 2
    return np.asarray(1 + s / 24 * (1 + CURVED * s))


def measure_bend_power(
    u: Array, local_less_reference_rad_s: Array, window_s: float, every: int
) -> Array:
    """Mean square of the curvature's second difference D, enough to judge by.

    Parameters
    ----------
    u, local_less_reference_rad_s, window_s
        As in `estimate_slopes`; D as in `estimate_curvatures`.
    every
        One row of so many is taken.

    Returns
    -------
    ndarray
        (channels,), the envelopes' unit over s², squared; 0 with fewer than three rows.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.envelope_motion import measure_bend_power
    >>> u = 0.5 * np.arange(40.0)[None, :, None] ** 2 + 0j
    >>> measure_bend_power(u, np.zeros(1), 1.0, 4).tolist()
    [1.0]
    """
    h = min(BEND, (u.shape[1] - 1) // 2)
    if h < 1:
        return np.zeros(u.shape[0])
    ahead = np.exp(-1j * local_less_reference_rad_s * h * window_s)
    second = (
        u[:, 2 * h :: every] * ahead
        - 2 * u[:, h:-h:every]
        + u[:, : -2 * h : every] * np.conj(ahead)
    )
    second = np.where(np.isfinite(second), second, 0.0)
    return np.asarray((np.abs(second) ** 2).mean((1, 2)) / (h * window_s) ** 4)


def _spread(inner: Array, h: int, turn: Array) -> Array:
    """`inner` rows with h rows more at either end, continued linearly in the local frame (`turn` a
    row); what is not finite is 0."""
    out = np.empty((inner.shape[0], inner.shape[1] + 2 * h, inner.shape[2]), complex)
    out[:, h:-h] = inner
    beyond = np.arange(1, h + 1)
    ahead = turn ** beyond[:, None]
    first, last = inner[:, :1] * ahead.conj(), inner[:, -1:] * ahead
    if inner.shape[1] > h:
        first = 2 * first - inner[:, beyond] * (ahead * ahead).conj()
        last = 2 * last - inner[:, -1 - beyond] * (ahead * ahead)
    out[:, h - beyond], out[:, beyond - h - 1] = first, last
    if not np.isfinite(out.sum()):
        out[~np.isfinite(out)] = 0.0
    return out


def take_off_pull(u: Array, motion: Array, turn: Array, by: Pull) -> Array:
    """The envelopes without the pull of a motion.

    U − (α M + β M*) with U = u·conj(`turn`), the envelope in the window's own phase.

    Parameters
    ----------
    u
        Envelopes (channels, rows, F) in reference phase.
    motion
        Slope or curvature M in reference phase, as u.
    turn
        By what both were turned to the reference phase, (rows, F).
    by
        The pull of that motion.

    Returns
    -------
    ndarray
        As u.

    Examples
    --------
    One and a half periods a window: a slope U1 pulls the fitted envelope by about U1/2ω.

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.envelope_motion import take_off_pull
    >>> from hrg_cli.fitting.samples.windows import fit_even
    >>> tau = (np.arange(30) - 14.5) / 1000
    >>> basis = build_window_basis(30, 1000.0, (50.0,))
    >>> y = ((1 + 3 * tau) * np.exp(2j * np.pi * 50 * tau)).real
    >>> u = fit_even(y[None], basis)[0][None]
    >>> still = take_off_pull(u, np.full((1, 1, 1), 3.0), np.ones((1, 1)), basis.slope)
    >>> [float(np.abs(x - 1).max().round(6)) for x in (u, still)]
    [0.004854, 0.0]
    """
    if u.shape[2] == 1 and len(by.alpha) == 1:
        out = np.conj(motion) * (by.beta[0, 0, 0] * turn * turn)
        np.subtract(u, out, out=out)
        # About the middle of even samples the α of a slope is a sum of odd terms: rounding, not
        # worth a pass.
        if abs(by.alpha[0, 0, 0]) > 1e-6 * abs(by.beta[0, 0, 0]):
            out -= by.alpha[0, 0, 0] * motion
        return out
    own = motion * turn.conj()
    return u - turn * (
        (by.alpha[None] * own[:, :, None, :]).sum(-1)
        + (by.beta[None] * own.conj()[:, :, None, :]).sum(-1)
    )


def compute_pull_noise(slope: Pull, curvature: Pull | None, window_s: float) -> float:
    """Factor by which taking the pulls out raises the standard deviation.

    It is √(1 + 0.114 (|α1|² + |β1|²)/T²) by the slope, times 1 + 2|α2|/(hT)² by the curvature,
    h = `BEND`.

    Parameters
    ----------
    slope
        The slope's pull; one without elements takes nothing out.
    curvature
        The curvature's pull; None where it is not taken out.
    window_s
        From row to row, T.

    Returns
    -------
    float
        One at least.

    Examples
    --------
    Two periods a window: the slope pulls by T/(4·2π) or so.

    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.envelope_motion import compute_pull_noise
    >>> basis = build_window_basis(40, 1000.0, (50.0,))
    >>> [round(compute_pull_noise(basis.slope, bend, 0.04), 4) for bend in (None, basis.curvature)]
    [1.0001, 1.0209]
    """
    strength = (
        float((np.abs(slope.alpha) ** 2 + np.abs(slope.beta) ** 2).mean(0).sum(-1).max())
        if slope.alpha.size
        else 0.0
    )
    factor = float(np.sqrt(1 + SLOPE_NOISE * strength / window_s**2))
    if curvature is not None:
        factor *= 1 + 2 * float(np.abs(curvature.alpha).mean(0).max()) / (BEND * window_s) ** 2
    return factor


def does_motion_count(residual2: Array, motion: Array, by: Pull, part: float = 1e-3) -> bool:
    """Whether a motion puts more than a part into the residual's sums of squares of any channel.

    Parameters
    ----------
    residual2
        Sums of squares (channels, rows).
    motion
        Slopes or curvatures (channels, rows, F).
    by
        The pull of that motion.
    part
        Of the residual.

    Returns
    -------
    bool
        True where it counts.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.envelope_motion import does_motion_count
    >>> basis = build_window_basis(40, 1000.0, (50.0,))
    >>> slope, left = np.full((1, 100, 1), 1e-3 + 0j), np.full((1, 100), 1e-5)
    >>> [does_motion_count(left, size * slope, basis.slope) for size in (1, 100)]
    [False, True]
    """
    mean = float(np.trace(by.left.mean(0))) / by.left.shape[-1]
    for k in range(len(residual2)):
        total = float(residual2[k].sum())
        if not np.isfinite(total):
            total = float(np.nansum(residual2[k]))
        if sum_energy(motion[k]) * mean > part * total:
            return True
    return False


def compute_motion_residual(motion: Array, turn: Array, by: Pull) -> Array:
    """What a known motion puts into the residual's sums of squares.

    Parameters
    ----------
    motion
        Slopes or curvatures (channels, rows, F) in reference phase.
    turn
        By what they were turned to it, (rows, F).
    by
        The pull of that motion.

    Returns
    -------
    ndarray
        (channels, rows).

    Examples
    --------
    What a fit without t·cos and t·sin leaves of an envelope that rises by 3 per second:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.envelope_motion import compute_motion_residual
    >>> from hrg_cli.fitting.samples.windows import fit_even
    >>> tau = (np.arange(40) - 19.5) / 1000
    >>> basis = build_window_basis(40, 1000.0, (50.0,))
    >>> y = ((1 + 3 * tau) * np.exp(2j * np.pi * 50 * tau)).real
    >>> told = compute_motion_residual(np.full((1, 1, 1), 3.0 + 0j), np.ones((1, 1)), basis.slope)
    >>> told.round(9).tolist(), fit_even(y[None], basis)[1].round(9).tolist()
    ([[0.024410117]], [0.024410117])
    """
    own = motion * turn.conj()
    parts = np.empty((*own.shape[:2], 2 * own.shape[2]))
    parts[..., 0::2], parts[..., 1::2] = own.real, -own.imag
    return np.asarray(((by.left[None] * parts[:, :, None, :]).sum(-1) * parts).sum(-1))
