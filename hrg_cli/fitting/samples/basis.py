"""Least-squares bases of a demodulation window: cos, sin of the wanted frequencies, nuisance terms,
and t·cos, t·sin where asked.

y(τ) = Σ_a [p_a cos ω_a τ + q_a sin ω_a τ] + constant + nuisance tones (+ τ·(…)), τ from the
window's centre; envelope U_a = p_a − j q_a. A window without the τ terms is pulled by the
envelope's slope U1: ΔU = α U1 + β U1*, of the order U1/2ω whatever its length; every window by the
curvature U2, about U2·T²/24. `Pull` holds these and what slope or curvature leave in the residual.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Pull:
    """What an unmodelled motion M (slope U1 or curvature U2) does to a window: ΔU = α M + β M*, and
    (p, q)ᵀ·left·(p, q) with M = p − jq to the residual's sum of squares. alpha, beta (rows or 1, F,
    F); left (rows or 1, 2F, 2F)."""

    alpha: Array
    beta: Array
    left: Array


@dataclass(frozen=True)
class WindowBasis:
    """The basis of one evenly sampled window, orthonormal: q = y @ `orthonormal` (n, k),
    coefficients p, q = q @ `triangle` (k, 2F).

    `sloping` (n, 2F): what t·cos, t·sin add to it, where they stand in it already what t²·cos,
    t²·sin do; empty where the samples are too few. `bent`: the curvature's pull, its residual taken
    off `sloping` too.
    `variance` (2F,): of p_0, q_0, p_1, … for unit sample noise; `slope` and `curvature`: their
    pulls. `condition`: of the basis with its columns scaled to one.
    """

    orthonormal: Array
    sloping: Array
    triangle: Array
    variance: Array
    slope: Pull
    curvature: Pull
    bent: Pull
    condition: float

    @property
    def freedom(self) -> int:
        """Degrees of freedom left in a window."""
        return self.orthonormal.shape[0] - self.orthonormal.shape[1]


def build_columns(
    tau_s: Array,
    frequency_hz: tuple[float, ...],
    nuisance_hz: tuple[float, ...] = (),
    moving: bool = False,
    scale_s: float = 1.0,
) -> Array:
    """Columns of a window's least squares at times from its centre: the wanted pairs, a constant,
    nuisance pairs, and where asked (τ/scale)·the wanted pairs.

    Parameters
    ----------
    tau_s
        Times (n,) from the window's centre, s.
    frequency_hz
        Of the wanted signals, F of them.
    nuisance_hz
        Of what is fitted beside them.
    moving
        Whether the wanted envelopes may be straight lines of time.
    scale_s
        Time at which the factor τ/scale of those columns is one, s.

    Returns
    -------
    ndarray
        (n, k), k = 2F + 1 + 2·nuisances, 2F more where `moving`.

    Examples
    --------
    A quarter of a period before and behind the centre:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import build_columns
    >>> build_columns(np.array([-0.25, 0.0, 0.25]), (1.0,), moving=True).round(12).tolist()
    [[0.0, -1.0, 1.0, -0.0, 0.25], [1.0, 0.0, 1.0, 0.0, 0.0], [0.0, 1.0, 1.0, 0.0, 0.25]]
    """
    wanted = build_pairs(tau_s, frequency_hz)
    parts = [wanted, np.ones((len(tau_s), 1)), build_pairs(tau_s, nuisance_hz)]
    if moving:
        parts.append(tau_s[:, None] / scale_s * wanted)
    return np.concatenate(parts, -1)


def build_pairs(tau_s: Array, frequency_hz: tuple[float, ...]) -> Array:
    """Values of cos ωτ and sin ωτ of each frequency in turn.

    Parameters
    ----------
    tau_s
        Times (n,), s.
    frequency_hz
        ω/2π of each, F of them.

    Returns
    -------
    ndarray
        (n, 2F): cos, sin of the first, of the second, …

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import build_pairs
    >>> build_pairs(np.array([0.0, 0.25]), (1.0, 2.0)).round(12).tolist()
    [[1.0, 0.0, 1.0, 0.0], [0.0, 1.0, -1.0, 0.0]]
    """
    phase = 2 * np.pi * np.multiply.outer(tau_s, np.asarray(frequency_hz, float))
    return np.stack([np.cos(phase), np.sin(phase)], -1).reshape(len(tau_s), 2 * len(frequency_hz))


def build_rotations(time_s: Array, frequency_hz: Array) -> Array:
    """Rotations e^{2πjft} on an even grid of frequencies, by doubling: one product a value instead
    of a sine and a cosine.

    Parameters
    ----------
    time_s
        Times (n,), s.
    frequency_hz
        The grid (k,), rising by equal steps.

    Returns
    -------
    ndarray
        (k, n), complex.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import build_rotations
    >>> t, hz = np.linspace(0, 2, 50), np.arange(100.0, 140.0, 0.5)
    >>> bool(np.abs(build_rotations(t, hz) - np.exp(2j * np.pi * np.outer(hz, t))).max() < 1e-11)
    True
    """
    out = np.empty((len(frequency_hz), len(time_s)), complex)
    out[0] = np.exp(2j * np.pi * frequency_hz[0] * time_s)
    if len(frequency_hz) > 1:
        # The error of `jump` doubles with each doubling, no faster than that of the phase 2πft
        # itself.
        jump, filled = np.exp(2j * np.pi * (frequency_hz[1] - frequency_hz[0]) * time_s), 1
        while filled < len(out):
            more = min(filled, len(out) - filled)
            np.multiply(out[:more], jump, out=out[filled : filled + more])
            filled, jump = filled + more, jump * jump
    return out


def compute_pull(coefficients: Array, left: Array) -> Pull:
    """The pull of a motion from what its unit (p, q) puts into a window's coefficients and
    residual.

    With the fitted (p′, q′) = [[m00, m01], [m10, m11]]·(p, q), U = p − jq and M = p − jq of the
    motion, ΔU = α M + β M* has α = (m00 + m11 + j(m01 − m10))/2 and β = (m00 − m11 − j(m10 +
    m01))/2.

    Parameters
    ----------
    coefficients
        (rows or 1, 2F, 2F): coefficients p, q of each tone, for a unit p or q of each tone's
        motion.
    left
        (rows or 1, 2F, 2F): what these leave in the residual, as a quadratic form.

    Returns
    -------
    Pull
        Of every row.

    Examples
    --------
    A fit that gives the motion back as it is, and one that mirrors it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import compute_pull
    >>> for matrix in (np.eye(2), np.diag([1.0, -1.0])):
    ...     pull = compute_pull(matrix[None], np.zeros((1, 2, 2)))
    ...     print(pull.alpha[0, 0, 0].real, pull.beta[0, 0, 0].real)
    1.0 0.0
    0.0 1.0
    """
    # with p = (M + M*)/2 and q = j(M − M*)/2 a real map of (p, q) reads αM + βM*
    m00, m01 = coefficients[..., 0::2, 0::2], coefficients[..., 0::2, 1::2]
    m10, m11 = coefficients[..., 1::2, 0::2], coefficients[..., 1::2, 1::2]
    return Pull((m00 + m11 + 1j * (m01 - m10)) / 2, (m00 - m11 - 1j * (m10 + m01)) / 2, left)


def build_window_basis(
    samples: int,
    sample_rate_hz: float,
    frequency_hz: tuple[float, ...],
    nuisance_hz: tuple[float, ...] = (),
    moving: bool = False,
) -> WindowBasis | None:
    """The basis of a window of evenly spaced samples about its centre; None where it is singular or
    has more columns than samples.

    Parameters
    ----------
    samples
        Of a window.
    sample_rate_hz
        Of them.
    frequency_hz
        Of the wanted signals, F of them.
    nuisance_hz
        Of what is fitted beside them.
    moving
        Whether t·cos and t·sin of the wanted signals are fitted too.

    Returns
    -------
    WindowBasis or None
        Shared by all windows of that length.

    Examples
    --------
    Over whole periods a coefficient has the variance 2/N of N samples (Rife and Boorstyn 1974);
    half the sampling rate has no sine:

    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> basis = build_window_basis(100, 1000.0, (50.0,))
    >>> basis.variance.round(12).tolist(), basis.freedom
    ([0.02, 0.02], 97)
    >>> build_window_basis(100, 1000.0, (500.0,)) is None
    True
    """
    tau = (np.arange(samples) - (samples - 1) / 2) / sample_rate_hz
    matrix = build_columns(tau, frequency_hz, nuisance_hz, moving, samples / sample_rate_hz / 2)
    norm = np.sqrt((matrix**2).sum(0))
    if samples < matrix.shape[1] or norm.min() < 1e-9:
        return None
    singular = np.linalg.svd(matrix / norm, compute_uv=False)
    if singular[-1] < 1e-10 * singular[0]:
        return None
    q, r = np.linalg.qr(matrix)
    inverse = np.linalg.inv(r)[: 2 * len(frequency_hz)]
    tones = 2 * len(frequency_hz)

    # a slope and a curvature of 1: what each puts into the coefficients, and what of its square the
    # basis leaves over
    pulls = []
    for motion in (tau[:, None] * matrix[:, :tones], tau[:, None] ** 2 / 2 * matrix[:, :tones]):
        taken = q.T @ motion
        pulls.append(
            compute_pull((inverse @ taken)[None], (motion.T @ motion - taken.T @ taken)[None])
        )
    sloping = _build_sloping(q, motion if moving else tau[:, None] * matrix[:, :tones])
    taken = sloping.T @ motion
    return WindowBasis(
        np.ascontiguousarray(q),
        sloping,
        np.ascontiguousarray(inverse.T),
        (inverse**2).sum(1),
        pulls[0],
        pulls[1],
        replace(pulls[1], left=pulls[1].left - taken.T @ taken),
        float(singular[0] / singular[-1]),
    )


def _build_sloping(q: Array, motion: Array) -> Array:
    """Orthonormal columns (n, 2F) that span a motion off the basis q; none (n, 0) where less than
    two degrees of freedom would be left, or the motion is of the basis."""
    off = motion - q @ (q.T @ motion)
    size = np.linalg.norm(motion, axis=0)
    own, triangle = np.linalg.qr(off / np.where(size > 0, size, 1.0))
    # Columns that are 1e-3 apart from the basis would carry the noise a thousandfold.
    if len(q) < q.shape[1] + motion.shape[1] + 2 or np.abs(np.diag(triangle)).min() < 1e-3:
        return np.empty((len(q), 0))
    return np.ascontiguousarray(own)
