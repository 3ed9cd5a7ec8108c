"""The envelope's motion within a window, from its neighbours: slopes and bends, what they pull the fitted
coefficients by, what they put into the residual."""

from __future__ import annotations

import numpy as np

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
    """
    h = min(NEIGHBOURS, (u.shape[1] - 1) // 2)
    if h < 1:
        return None
    ahead = np.exp(-1j * local_less_reference_rad_s * h * window_s) / (2 * h * window_s)
    return _spread(
        u[:, 2 * h :] * ahead - u[:, : -2 * h] * ahead.conj(),
        h,
        np.exp(1j * local_less_reference_rad_s * window_s),
    )


def estimate_fine_slopes(
    u: Array, local_less_reference_rad_s: Array, window_s: float
) -> Array | None:
    """Slope of the envelopes u (channel, rows, F) in the local frame, that of the cubic nearest to
    2·`NEIGHBOURS` + 1 rows; at the ends of the quintic through the first and the last. None with
    fewer rows.

    Right to the order T⁴, where a difference of two rows h apart misses (hT)²/6 of the third
    derivative, at 0.114/T² of the rows' variance (Savitzky and Golay 1964).
    """
    n = 2 * NEIGHBOURS + 1
    if u.shape[1] < n:
        return None
    place = np.arange(n) - NEIGHBOURS
    weights, at_ends = (_derivative(place, degree) / window_s for degree in (3, 5))
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


def _derivative(place: Array, degree: int) -> Array:
    """Weights (n, n) of values at places whose polynomial of least squares has the derivative at
    each of them."""
    powers = place[:, None] ** np.arange(degree + 1)
    rise = powers[:, :-1] * np.arange(1, degree + 1)
    return np.asarray(rise @ np.linalg.pinv(powers)[1:])


def estimate_better_slopes(
    u: Array, local_less_reference_rad_s: Array, window_s: float
) -> Array | None:
    """Slopes of envelopes without the first ones' pull: fine ones, plain ones where rows are few;
    None where they are too few for any."""
    fine = estimate_fine_slopes(u, local_less_reference_rad_s, window_s)
    return estimate_slopes(u, local_less_reference_rad_s, window_s) if fine is None else fine


def estimate_curvatures(
    u: Array, local_less_reference_rad_s: Array, window_s: float
) -> tuple[Array, Array] | None:
    """Curvature of the envelopes in the local frame from rows ± `BEND`, and how far it may be wrong
    (channel, rows, F).

    U2 = D − (1/3 + 7/240)·T²·D²: D = (u_{k+h} e^{−jΔhT} − 2u_k + u_{k−h} e^{jΔhT})/(hT)² and D² the
    same of D, so that U − U2·T²/24 undoes the average over a window, sin(x/2)/(x/2) for a turn of x
    a window, but for a rest of the order x⁶. The ends are continued.
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
    fourth2, second2 = (np.median(np.abs(one) ** 2, axis=1) for one in (fourth, second))
    size = np.sqrt(fourth2 / np.maximum(second2, 1e-300))
    doubt = np.broadcast_to((4 * size * np.sqrt(fourth2))[:, None], u.shape).copy()
    second = second - fourth
    out = _spread(second, h, turn)
    for i in range(1, h + 1):  # the ends continue a parabola; a third of its bend is the doubt
        for end, near, back in ((h - i, 0, 1), (-h - 1 + i, -1, -1)):
            first, next_, third = (
                second[:, near + n * back] * turn ** (-(n + i) * back) for n in (0, 1, 2)
            )
            bent = i * (i + 1) / 2 * (first - 2 * next_ + third)
            usable = np.isfinite(bent)
            out[:, end] += np.where(usable, bent, 0.0)
            doubt[:, end] = np.where(usable, np.hypot(doubt[:, end], np.abs(bent) / 3), 0.0)
    doubt[~np.isfinite(doubt)] = 0.0
    return out, doubt


def compute_gain_at_middle(turns: Array | float) -> Array:
    """What taking the bend off makes of a motion that turns so often a window: 1 + (s/24)(1 + 0.36 s),
    s = (2/h)² sin² πhx, beside the sinc x of the mean itself (see `estimate_curvatures`).

    Of a slow motion it undoes the mean; what moves quickly, noise above all, it makes larger.
    """
    s = (2 / BEND * np.sin(np.pi * BEND * np.asarray(turns, float))) ** 2
    return np.asarray(1 + s / 24 * (1 + CURVED * s))


def measure_bend_power(
    u: Array, local_less_reference_rad_s: Array, window_s: float, every: int
) -> Array:
    """Mean square of the curvature's second difference D (channel,), see `estimate_curvatures`, at one row
    of `every`: enough to judge by."""
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
    for i in range(1, h + 1):
        if inner.shape[1] > h:
            out[:, h - i] = 2 * inner[:, 0] * turn**-i - inner[:, i] * turn ** (-2 * i)
            out[:, -h - 1 + i] = 2 * inner[:, -1] * turn**i - inner[:, -1 - i] * turn ** (2 * i)
        else:
            out[:, h - i], out[:, -h - 1 + i] = inner[:, 0] * turn**-i, inner[:, -1] * turn**i
    if not np.isfinite(out.sum()):
        out[~np.isfinite(out)] = 0.0
    return out


def take_off_pull(u: Array, motion: Array, turn: Array, by: Pull) -> Array:
    """The envelopes u without the pull of a motion M, all in reference phase: U − (α M + β M*) with
    U = u·conj(`turn`)."""
    if u.shape[2] == 1 and len(by.alpha) == 1:
        out = u - np.conj(motion) * (by.beta[0, 0, 0] * turn * turn)
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
    """Factor by which taking the pulls out raises the standard deviation: √(1 + 0.114 (|α1|² +
    |β1|²)/T²), times 1 + 2α2/(hT)²."""
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
    """Whether a motion puts more than a part into the residual's sums of squares (channel,
    rows)."""
    mean = float(np.trace(by.left.mean(0))) / by.left.shape[-1]
    for k in range(len(residual2)):
        total = float(residual2[k].sum())
        if not np.isfinite(total):
            total = float(np.nansum(residual2[k]))
        if sum_energy(motion[k]) * mean > part * total:
            return True
    return False


def compute_motion_residual(motion: Array, turn: Array, by: Pull) -> Array:
    """What a known motion puts into the residual's sums of squares (channel, rows)."""
    own = motion * turn.conj()
    parts = np.empty((*own.shape[:2], 2 * own.shape[2]))
    parts[..., 0::2], parts[..., 1::2] = own.real, -own.imag
    return np.asarray(((by.left[None] * parts[:, :, None, :]).sum(-1) * parts).sum(-1))
