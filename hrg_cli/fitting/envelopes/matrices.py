"""Many 2 × 2 matrices as four arrays (m₀₀, m₀₁, m₁₀, m₁₁) and vectors as two: several times faster
than (..., 2, 2) on long arrays."""

from __future__ import annotations

import numpy as np

Array = np.ndarray
Matrix = tuple[Array, Array, Array, Array]
Vector = tuple[Array, Array]
SERIES = 1e-3
"""|x| below which sinh(x)/x is taken from its series: (1 − e^{−2x}) would lose digits."""
SLOPE_SERIES = 0.05
"""|x| below which the derivative of sinh(x)/x is taken from its series."""


def multiply(a: Matrix, b: Matrix) -> Matrix:
    """Products of matrices.

    Parameters
    ----------
    a, b
        Four entries each, (...).

    Returns
    -------
    tuple of ndarray
        a·b.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.matrices import multiply
    >>> multiply((1.0, 2.0, 0.0, 1.0), (1.0, 0.0, 3.0, 1.0))
    (7.0, 2.0, 3.0, 1.0)
    """
    return (
        a[0] * b[0] + a[1] * b[2],
        a[0] * b[1] + a[1] * b[3],
        a[2] * b[0] + a[3] * b[2],
        a[2] * b[1] + a[3] * b[3],
    )


def apply(m: Matrix, v: Vector) -> Vector:
    """Matrices times vectors.

    Parameters
    ----------
    m
        Four entries, (...).
    v
        Two entries, (...).

    Returns
    -------
    tuple of ndarray
        m·v.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.matrices import apply
    >>> apply((1.0, 2.0, 0.0, 1.0), (1.0, 1.0))
    (3.0, 1.0)
    """
    return m[0] * v[0] + m[1] * v[1], m[2] * v[0] + m[3] * v[1]


def take_columns(m: Matrix, part: slice) -> Matrix:
    """Some of the columns of matrices that stand in rows.

    Parameters
    ----------
    m
        Four entries, (R, n).
    part
        Which of the n.

    Returns
    -------
    tuple of ndarray
        Four entries, (R, k).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.matrices import take_columns
    >>> take_columns((np.arange(6).reshape(2, 3),) * 4, slice(1, 2))[0].tolist()
    [[1], [4]]
    """
    return m[0][:, part], m[1][:, part], m[2][:, part], m[3][:, part]


def invert_unimodular(m: Matrix) -> Matrix:
    """Inverses of matrices of determinant 1, as the exponentials of traceless ones are.

    Parameters
    ----------
    m
        Four entries, (...).

    Returns
    -------
    tuple of ndarray
        m⁻¹.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.matrices import invert_unimodular, multiply
    >>> multiply(invert_unimodular((1.0, 2.0, 0.0, 1.0)), (1.0, 2.0, 0.0, 1.0))
    (1.0, 0.0, 0.0, 1.0)
    """
    return m[3], -m[1], -m[2], m[0]


def reflect_and_pull(m: Matrix, v: Vector) -> tuple[Vector, Vector, Vector]:
    """m⁻¹ R_c v, m⁻¹ R_s v and m⁻¹ J v for matrices of determinant 1.

    Parameters
    ----------
    m
        Four entries, (...).
    v
        Two entries, (...).

    Returns
    -------
    tuple of tuple
        The three vectors.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.matrices import reflect_and_pull
    >>> reflect_and_pull((1.0, 0.0, 0.0, 1.0), (1.0, 2.0))
    ((1.0, -2.0), (2.0, 1.0), (2.0, -1.0))
    """
    x, y = v
    ax, ay, bx, by = m[0] * x, m[0] * y, m[1] * x, m[1] * y
    cx, cy, dx, dy = m[2] * x, m[2] * y, m[3] * x, m[3] * y
    return (dx + by, -cx - ay), (dy - bx, ax - cy), (dy + bx, -cy - ax)


def split_trace(m: Matrix) -> tuple[Array, Matrix]:
    """Half the trace of matrices, and what is left of them without it.

    Parameters
    ----------
    m
        Four entries, (...).

    Returns
    -------
    tuple
        The mean of the diagonal, and the matrix less that.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.matrices import split_trace
    >>> split_trace((3.0, 2.0, 0.0, 1.0))
    (2.0, (1.0, 2.0, 0.0, -1.0))
    """
    mean = (m[0] + m[3]) / 2
    half = (m[0] - m[3]) / 2
    return mean, (half, m[1], m[2], -half)


def exponentiate(m: Matrix, time_s: Array) -> Matrix:
    """exp(m·t) = cosh(dt) I + t·sinhc(dt) m of traceless m, d² = −det m, through equal eigenvalues
    too.

    Parameters
    ----------
    m
        Four entries, (...), 1/s.
    time_s
        t, (...).

    Returns
    -------
    tuple of ndarray
        Four entries, complex.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.matrices import exponentiate
    >>> turned = exponentiate(
    ...     (np.zeros(1), np.ones(1), -np.ones(1), np.zeros(1)), np.array([np.pi])
    ... )
    >>> [float(part[0].real.round(9)) for part in turned]
    [-1.0, 0.0, -0.0, -1.0]
    """
    d = np.sqrt(m[0] ** 2 + m[1] * m[2] + 0j)
    x = d * time_s
    up = np.exp(x)
    down = 1 / up
    small = np.abs(x) < SERIES
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = (up - down) / (2 * d)
    if small.any():
        slope = np.where(small, time_s * (1 + x**2 / 6 + x**4 / 120), slope)
    even = (up + down) / 2
    return even + slope * m[0], slope * m[1], slope * m[2], even - slope * m[0]


def compute_exponential_slopes(m: Matrix, time_s: Array) -> tuple[Matrix, Array, Array, Array]:
    """exp(m·t) of traceless m, and what its exact derivative along any traceless E is made of.

    The derivative is (f I + g m)·tr(mE) + s E. exp(mt) = c I + s m with d² = tr(m²)/2, so ∂d²/∂E =
    tr(mE), ∂c/∂d² = ts/2 = f, ∂s/∂d² = (tc − s)/2d² = g: no integral is needed, however far the
    motion turns in t.

    Parameters
    ----------
    m
        Four entries, (...), 1/s.
    time_s
        t, (...).

    Returns
    -------
    tuple
        exp(m·t), then f, g and s, (...).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.matrices import exponentiate, compute_exponential_slopes
    >>> m, t = (
    ...     (np.array([0.3]), np.array([1.0]), np.array([0.5]), np.array([-0.3])),
    ...     np.array([1.0]),
    ... )
    >>> whole, f, g, s = compute_exponential_slopes(m, t)
    >>> bool(np.allclose(whole, exponentiate(m, t)))
    True
    """
    d2 = m[0] ** 2 + m[1] * m[2] + 0j
    x2 = d2 * time_s**2
    small = np.abs(x2) < SLOPE_SERIES**2
    safe = np.where(small, 1.0, d2)
    d = np.sqrt(safe)
    x = np.where(small, 0.0, d * time_s)  # the series stands there, in any unit of time
    even = np.where(small, 1 + x2 / 2 + x2**2 / 24, np.cosh(x))
    slope = np.where(small, time_s * (1 + x2 / 6 + x2**2 / 120), np.sinh(x) / d)
    # t(cosh x − sinh x/x)/2d², in whose series the ones cancel
    third = np.where(
        small, time_s**3 * (1 / 6 + x2 / 60 + x2**2 / 1680), (time_s * even - slope) / (2 * safe)
    )
    whole = (even + slope * m[0], slope * m[1], slope * m[2], even - slope * m[0])
    return whole, time_s * slope / 2, third, slope


def chain(steps: Matrix) -> Matrix:
    """Running products of steps, by about 2√n batched multiplications.

    Parameters
    ----------
    steps
        Four entries, (R, n − 1), complex: of each row the way to the next.

    Returns
    -------
    tuple of ndarray
        Four entries, (R, n): from the first row to each, the identity first.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.matrices import chain
    >>> one, none = np.ones((1, 4), complex), np.zeros((1, 4), complex)
    >>> chain((one, 2 * one, none, one))[1].real.tolist()
    [[0.0, 2.0, 4.0, 6.0, 8.0]]
    """
    runs, count = steps[0].shape
    size = max(1, int(np.sqrt(count)))
    blocks = -(-count // size)

    # blocks of √n steps side by side: the products within all of them at once; what fills up the
    # last block are unit matrices
    inner = np.zeros((4, size, runs, blocks), complex)
    inner[0], inner[3] = 1.0, 1.0
    for part, values in zip(inner, steps, strict=True):
        whole, rest = np.divmod(count, size)
        part[:, :, :whole] = values[:, : whole * size].reshape(runs, whole, size).transpose(2, 0, 1)
        part[:rest, :, whole:] = values[:, whole * size :].T[:, :, None]
    for i in range(1, size):
        inner[:, i] = multiply(tuple(inner[:, i]), tuple(inner[:, i - 1]))

    # then each block behind the product of all blocks before it
    before = np.empty((4, runs, blocks), complex)
    before[:, :, 0] = np.array([1, 0, 0, 1])[:, None]
    for i in range(1, blocks):
        before[:, :, i] = multiply(tuple(inner[:, -1, :, i - 1]), tuple(before[:, :, i - 1]))
    out = []
    for part, first in zip(
        multiply(tuple(inner), tuple(before)), (1.0, 0.0, 0.0, 1.0), strict=True
    ):
        flat = part.transpose(1, 2, 0).reshape(runs, -1)[:, :count]
        out.append(np.concatenate([np.full((runs, 1), first, complex), flat], axis=1))
    return out[0], out[1], out[2], out[3]
