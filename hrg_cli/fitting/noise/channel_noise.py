"""Unequal and common noise of the two channels: the matrix of a run that makes its noise white.

The channels' noise n_C, n_S has the covariance σ²Σ with σ² the mean of both variances, which is
what a row's σ states, and so tr Σ = 2. A residual over σ times W = Σ^{−1/2} (symmetric, so that
either channel stays as near itself as can be) has noise of 1 in both channels and none in common,
and the sum of its squares is the likelihood's. Demodulation treats cosine and sine alike: W is real
and acts on envelopes as on samples. Channels turned by an angle afterwards turn Σ, and with it the
answer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Array = np.ndarray
ALIKE = 1.2
"""Ratio of the larger to the smaller variance up to which both channels have one noise: weighing
them alike costs less than a hundredth of a variance."""
DEAD = 1e-6
"""Ratio below which the quieter channel is none that was measured (a constant, an exact sum of
both), whose noise says nothing."""

FEWEST, MOVING, CONTRADICTED = 32, 1.5, 12.0
"""Rows from which their scatter is asked, variance over the stated one from which it is motion, and
√n times the logarithm of the ratio by which it contradicts what is stated: four σ."""


def compute_whitening(
    channel_std: Array | None, correlation: float | None, envelope: Array | None = None
) -> Array | None:
    """W of a run, which makes the noise of its channels white.

    Parameters
    ----------
    channel_std
        Standard deviations (n, 2) of either channel in the run's rows, in the envelopes' unit;
        their ratio counts, the median over the rows.
    correlation
        Of both channels' noise; None: not known, taken for 0.
    envelope
        The rows' envelopes (n, 2), whose scatter from row to row the ratio is held against.

    Returns
    -------
    ndarray or None
        (2, 2); None: both channels have the same noise, or it is not known.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.channel_noise import compute_whitening
    >>> W = compute_whitening(np.array([[3.0, 1.0]]), None)  # variances 9 and 1, 5 in the mean
    >>> np.round(np.diag(W) ** -2, 6).tolist()
    [1.8, 0.2]
    """
    if channel_std is None or not len(channel_std):
        return None
    variance = np.asarray(channel_std, float) ** 2
    known = np.isfinite(variance).all(axis=-1) & (variance > 0).all(axis=-1)
    if not known.any():
        return None
    ratio = float(np.median(variance[known, 0] / variance[known, 1]))
    if envelope is not None:
        ratio = _unless_spoilt(ratio, np.median(variance[known], axis=0), envelope)
    # Σ with tr Σ = 2: a row's σ² is the mean of both variances
    of_c, of_s = 2 * ratio / (1 + ratio), 2 / (1 + ratio)
    common = (correlation or 0.0) * np.sqrt(of_c * of_s)
    level, axes = np.linalg.eigh(np.array([[of_c, common], [common, of_s]]))
    if level[1] < ALIKE * level[0] or level[0] < DEAD * level[1]:
        return None
    return np.asarray((axes / np.sqrt(level)) @ axes.T)


def find_shares(channel_std: Array | None) -> tuple[float, float]:
    """Variance of the noise of C and of S over the mean of both, which is what a row's σ states.

    Parameters
    ----------
    channel_std
        Standard deviations (n, 2) of either channel in the run's rows; None: not known.

    Returns
    -------
    tuple of float
        Both, of sum 2; ones where they are not known.

    Examples
    --------
    A channel that was set to zero leaves twice the mean to the other:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.channel_noise import find_shares
    >>> find_shares(np.array([[3.0, 0.0], [3.0, 0.0]]))
    (2.0, 0.0)
    """
    if channel_std is None or not len(channel_std):
        return 1.0, 1.0
    variance = np.asarray(channel_std, float) ** 2
    variance = variance[np.isfinite(variance).all(axis=-1)]
    middle = np.median(variance, axis=0) if len(variance) else np.ones(2)
    if not middle.sum() > 0:
        return 1.0, 1.0
    of_c, of_s = 2 * middle / middle.sum()
    return float(of_c), float(of_s)


def _unless_spoilt(ratio: float, stated: Array, u: Array) -> float:
    """The ratio of the channels' variances as it is `stated` (2,), or as rows scatter that
    contradict it.

    What jumps in one window (lost samples, a knock) leaks into the spectrum by which all windows'
    noise is stated, of either channel as its signal is. Third differences of rows have 20 times the
    variance of one and, their median taken, know of no single window; where they are larger than
    stated in a channel it is the motion that they show. The logarithm of two medians' ratio
    scatters by 3.1/√n, neighbours sharing rows.
    """
    if len(u) < FEWEST:
        return ratio
    # third differences have 1² + 3² + 3² + 1² = 20 times the variance; |n|² of complex noise, σ² in
    # either part, is exponential with the median 2σ² ln 2
    rough = np.median(np.abs(np.diff(u, n=3, axis=0)) ** 2, axis=0) / (20 * 2 * np.log(2))
    if (rough > MOVING * stated).any() or not (rough > 0).all():
        return ratio
    seen = float(rough[0] / rough[1])
    return seen if abs(np.log(seen / ratio)) > CONTRADICTED / np.sqrt(len(u)) else ratio


def stack_matrices(matrices: Sequence[Array | None]) -> Array | None:
    """The matrices of several runs, the unit matrix for a run without.

    Parameters
    ----------
    matrices
        One a run, or None.

    Returns
    -------
    ndarray or None
        (R, 2, 2); None where no run has one.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.channel_noise import stack_matrices
    >>> stack_matrices([None, np.diag([2.0, 1.0])])[:, 0, 0].tolist()
    [1.0, 2.0]
    """
    if all(one is None for one in matrices):
        return None
    return np.stack([np.eye(2) if one is None else one for one in matrices])


def whiten(matrices: Array | None, u: Array) -> Array:
    """Envelopes of runs, each by its own matrix.

    Parameters
    ----------
    matrices
        (R, 2, 2), or None for none.
    u
        (..., R, n, 2), complex.

    Returns
    -------
    ndarray
        The same shape.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.channel_noise import whiten
    >>> whiten(np.diag([2.0, 1.0])[None], np.array([[[1.0, 1j]]])).tolist()
    [[[(2+0j), 1j]]]
    """
    if matrices is None:
        return u
    of_c, of_s = np.moveaxis(matrices[:, None], -1, 0)
    return np.asarray(of_c * u[..., :1] + of_s * u[..., 1:])


def whiten_reals(matrices: Array | None, x: Array) -> Array:
    """What `whiten` does, of reals.

    Parameters
    ----------
    matrices
        (R, 2, 2), or None for none.
    x
        (R, n, 4, K): Re C, Re S, Im C, Im S.

    Returns
    -------
    ndarray
        The same shape.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.channel_noise import whiten_reals
    >>> whiten_reals(np.diag([2.0, 1.0])[None], np.ones((1, 1, 4, 1))).ravel().tolist()
    [2.0, 1.0, 2.0, 1.0]
    """
    if matrices is None:
        return x
    parts = x.reshape(*x.shape[:2], 2, 2, -1)
    of_c, of_s = np.moveaxis(matrices[:, None, None, ..., None], -2, 0)
    return np.asarray((of_c * parts[..., :1, :] + of_s * parts[..., 1:, :]).reshape(x.shape))


def invert(matrices: Array | None) -> Array | None:
    """What undoes the matrices of several runs.

    Parameters
    ----------
    matrices
        (R, 2, 2), or None for none.

    Returns
    -------
    ndarray or None
        Their inverses.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.channel_noise import invert
    >>> invert(np.diag([2.0, 1.0])[None]).tolist()
    [[[0.5, 0.0], [0.0, 1.0]]]
    """
    return None if matrices is None else np.asarray(np.linalg.inv(matrices))


def compute_spread(matrices: Array | None) -> Array:
    """σ of either channel over that of both in the mean.

    Parameters
    ----------
    matrices
        (R, 2, 2), or None where all channels are alike.

    Returns
    -------
    ndarray
        (R, 2), or (1, 2) of all runs alike.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.channel_noise import compute_spread
    >>> compute_spread(np.diag([2.0, 1.0])[None]).tolist(), compute_spread(None).tolist()
    ([[0.5, 1.0]], [[1.0, 1.0]])
    """
    if matrices is None:
        return np.ones((1, 2))
    # W⁻¹ is the root of Σ, whose rows have the length √Σ_kk
    return np.asarray(np.linalg.norm(np.linalg.inv(matrices), axis=-1))
