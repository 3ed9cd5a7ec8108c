"""Coloured noise of the wave: what wanders beside any model, component by component.

Of each component x (relative amplitude, phase, angle, ellipticity) the noise is white n beside a
wander whose rate is correlated over τ,
    Cov(x_s, x_t) = (q/2)[2 min(s, t) − τ(1 − e^{−s/τ} − e^{−t/τ} + e^{−|t−s|/τ})] + w² σ² δ_st,
the integrated Ornstein–Uhlenbeck process: a random walk of q per second for τ → 0. q, τ and the
white level w are those of the largest restricted likelihood (Patterson and Thompson 1971): the
residual's polynomial in time is a fixed effect, so that a misfit of the model is not taken for
noise, and the wander at long times is what the quick wander makes it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..causes.wave_frame import find_directions, to_reals
from ..least_squares import fit_columns

Array = np.ndarray
COMPONENTS = ("amplitude", "phase", "angle", "ellipticity")
SMOOTH = 10
"""Degree of the polynomial in time up to which the residual may be the model's fault."""
SLOWEST = 20
"""Part of the run a wander's rate may stay correlated: what is slower cannot be told from a fault
of the model."""
FEWEST, MOST_ROWS = 40, 120
"""Rows from which a colour is estimated, and rows to which the residual is averaged for that."""
LEAST_WHITE = float(np.log(1e-6))
"""ln of the least white variance over the stated one: without any, C is no covariance where two
rows stand close."""
CLEAR, BESIDE = 30.0, 10.0
"""2 ln of the likelihood ratio from which noise counts as coloured, and a component does beside
another that clearly is.

By chance one of three others reaches the latter, two parameters each, in 3 e^{−5} = 2 % of cases;
taken for white, it would bias the fit.
"""


@dataclass(frozen=True)
class ColouredNoise:
    """One component: white level w over the stated σ, wander q [1/s], correlation time τ [s] of its
    rate; `clear`: 2 ln ratio to white."""

    white: float
    wander_1_s: float
    correlation_s: float
    clear: float

    def compute_std_after(self, time_s: float) -> float:
        """Standard deviation of the wander after a time from a start at which its rate is any."""
        return float(
            np.sqrt(
                max(
                    compute_wander(np.array([time_s]), self.wander_1_s, self.correlation_s)[0, 0],
                    0.0,
                )
            )
        )


def resolve_components(x: Array, along: Array) -> Array:
    """Reals turned into the wave's frame: along it, its phase, across it (angle), its quadrature.

    Parameters
    ----------
    x
        (R, n, 4, K) over reals (`to_reals`).
    along
        Envelopes (R, n, 2) of the wave.

    Returns
    -------
    ndarray
        (R, n, 4, K): an orthogonal turn, so that white noise stays white.

    Examples
    --------
    A change of the phase by 0.01 rad, of a wave at any angle and phase:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.colour import resolve_components
    >>> from hrg_cli.fitting.causes.wave_frame import to_reals
    >>> u = np.exp(0.7j) * np.array([[[np.cos(0.3), np.sin(0.3)]]])
    >>> resolve_components(to_reals(0.01j * u)[..., None], u)[0, 0, :, 0].round(9) + 0
    array([0.  , 0.01, 0.  , 0.  ])
    """
    return to_reals(find_directions(along)) @ x


def compute_wander(t: Array, q: float, tau: float) -> Array:
    """Covariance of the wander at times from its start, where its rate is any.

    Cov(x_s, x_t) = (q/2)[2 min(s, t) − τ(1 − e^{−s/τ} − e^{−t/τ} + e^{−|t−s|/τ})].

    Parameters
    ----------
    t
        (n,) s.
    q
        Wander: variance per second after times long beside τ.
    tau
        Correlation time τ of its rate [s]; 0: a random walk.

    Returns
    -------
    ndarray
        (n, n).

    Examples
    --------
    Beside a random walk of the same q, a quick one lags by τ; within τ it runs straight, at a rate
    of variance q/2τ:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.colour import compute_wander
    >>> t = np.array([0.001, 100.0])
    >>> np.diag(compute_wander(t, 2.0, 0.0)).round(6).tolist()
    [0.002, 200.0]
    >>> np.diag(compute_wander(t, 2.0, 1.0)).round(6).tolist()
    [1e-06, 198.0]
    """
    first, gap = np.minimum(t[:, None], t[None, :]), np.abs(t[:, None] - t[None, :])
    if tau <= 0:
        return q * first
    past = np.exp(-t / tau)
    return q / 2 * (2 * first - tau * (1 - past[:, None] - past[None, :] + np.exp(-gap / tau)))


def estimate(time_s: Array, values: Array, std: Array) -> ColouredNoise:
    """Noise of one component with stated white σ, its polynomial in time left free.

    Parameters
    ----------
    time_s
        (n,), rising [s].
    values
        (n,).
    std
        Stated σ of each, (n,).

    Returns
    -------
    ColouredNoise
        Without wander where 2 ln of the likelihood ratio to white noise alone is below `BESIDE`.

    Examples
    --------
    White noise twice as large as stated, and the same beside a random walk of 1 per second:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.colour import estimate
    >>> t, random = np.arange(120.0), np.random.default_rng(2)
    >>> white = 0.2 * random.standard_normal(120)
    >>> found = estimate(t, white, np.full(120, 0.1))
    >>> round(found.white), found.wander_1_s
    (2, 0.0)
    >>> walked = estimate(t, white + np.cumsum(random.standard_normal(120)), np.full(120, 0.1))
    >>> walked.clear > 30, 0.5 < walked.wander_1_s < 2
    (True, True)
    """
    course = WanderLikelihood.from_series(time_s, values, std)
    freedom = max(1, len(values) - course.fixed.shape[1])
    # the rival: white noise alone, of a level that has a closed form
    white = float(np.mean((course.smooth / std) ** 2)) * len(values) / freedom
    alone = course.compute_cost(max(white, 1e-6), 0.0, 0.0)
    # two starts: q and τ trade along a ridge (a short τ is a random walk, a long one a drift), and
    # one start stays on its side of it
    ends = [course.descend(tau) for tau in (course.step_s / 3, course.span_s / 40)]
    cost, (w2, q, tau) = min(ends, key=lambda end: end[0])
    clear = alone - cost
    if not np.isfinite(cost) or clear < BESIDE:
        return ColouredNoise(float(np.sqrt(white)), 0.0, 0.0, clear)
    return ColouredNoise(float(w2) ** 0.5, float(q), float(tau), clear)


@dataclass(frozen=True)
class WanderLikelihood:
    """The likelihood of a wander in one component of a residual (n,), at times from its start, with
    stated white σ (n,) and the polynomials in time (n, d) that may be the model's fault; `smooth`:
    the residual less these."""

    time_s: Array
    values: Array
    std: Array
    fixed: Array
    smooth: Array

    @classmethod
    def from_series(cls, time_s: Array, values: Array, std: Array) -> WanderLikelihood:
        """With the polynomials fitted at the stated σ."""
        t = time_s - time_s[0]
        fixed = np.polynomial.legendre.legvander(2 * t / float(t[-1]) - 1, SMOOTH)
        fitted = fit_columns(fixed / std[:, None], values / std)
        return cls(t, values, std, fixed, values - fixed @ fitted)

    @property
    def span_s(self) -> float:
        """Length of the run."""
        return float(self.time_s[-1])

    @property
    def step_s(self) -> float:
        """Usual time from row to row."""
        return float(np.median(np.diff(self.time_s)))

    def compute_cost(self, w2: float, q: float, tau: float) -> float:
        """−2 ln of the restricted likelihood, ln|C| + ln|XᵀC⁻¹X| + rᵀC⁻¹r (Patterson and Thompson
        1971); infinite where C is no covariance."""
        C = np.diag(w2 * self.std**2) + (compute_wander(self.time_s, q, tau) if q > 0 else 0.0)
        try:
            L = np.linalg.cholesky(C)
        except np.linalg.LinAlgError:
            return np.inf
        both = np.linalg.solve(L, np.column_stack([self.fixed, self.values]))
        Q, R = np.linalg.qr(both[:, :-1])
        left = both[:, -1] - Q @ (Q.T @ both[:, -1])
        # the middle term is what makes it the restricted one, and X = QR after whitening gives it
        # by R's diagonal
        return float(
            2 * np.log(np.diag(L)).sum() + 2 * np.log(np.abs(np.diag(R))).sum() + left @ left
        )

    def descend(self, tau: float) -> tuple[float, Array]:
        """(cost, (w², q, τ)) of the optimum that is reached from a τ, in logarithms of all
        three."""
        from scipy.optimize import minimize

        scale = float(np.median(self.std))
        # second differences (1, −2, 1) of white noise have 6 σ², of a slow wander nearly none: a
        # first white level that the wander does not lift
        rough = max(float(np.sqrt(np.mean(np.diff(self.values, n=2) ** 2) / 6)), 1e-3 * scale)
        power = float(np.mean(self.smooth**2)) / (self.span_s / SMOOTH)
        start = np.log([max((rough / scale) ** 2, 1e-4), max(power, 1e-30), tau])
        # below a tenth of a row τ is a random walk to these data; longer than the bound it is a
        # fault of the model: a quadratic wall turns the simplex back at both
        low = np.log(self.step_s / 10)
        high = np.log(max(self.span_s / SLOWEST, self.step_s))

        def bounded(x: Array) -> float:
            inside = np.clip(x[2], low, high)
            cost = self.compute_cost(*np.exp([max(x[0], LEAST_WHITE), x[1], inside]))
            return float(cost + (x[2] - inside) ** 2)

        found = minimize(
            bounded,
            start,
            method="Nelder-Mead",
            options={"xatol": 0.03, "fatol": 0.1, "maxfev": 150},
        )
        bounds = [LEAST_WHITE, -np.inf, low], [np.inf, np.inf, high]
        return float(found.fun), np.exp(np.clip(found.x, *bounds))


def estimate_noises(
    time_s: Array, weight: Array, envelope: Array, residual: Array
) -> tuple[ColouredNoise, ...]:
    """The noise of every component of the residuals, from the longest run.

    A component whose wander is not seen keeps its white level alone.

    Parameters
    ----------
    time_s, weight
        (R, n): s, and 1/σ, 0 where a row does not count.
    envelope
        Of the wave, (R, n, 2).
    residual
        (R, n, 4) over σ.

    Returns
    -------
    tuple of ColouredNoise
        Amplitude, phase, angle and ellipticity; none where all are white, or the run has fewer than
        `FEWEST` rows.

    Examples
    --------
    A phase that walks, beside white noise in all components:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.colour import estimate_noises
    >>> from hrg_cli.fitting.causes.wave_frame import to_reals
    >>> random, u = np.random.default_rng(2), np.ones((1, 120, 2)) / np.sqrt(2)
    >>> walk = np.cumsum(random.standard_normal(120))[None, :, None]
    >>> noise = random.standard_normal((1, 120, 4)) + to_reals(3j * walk * u)
    >>> found = estimate_noises(np.arange(120.0)[None], np.full((1, 120), 100.0), u, noise)
    >>> [one.wander_1_s > 0 for one in found]
    [False, True, False, False]
    """
    size = np.sqrt(np.sum(np.abs(envelope) ** 2, axis=-1))
    unit = np.divide(1.0, weight * size, out=np.zeros_like(size), where=(weight > 0) & (size > 0))
    own = resolve_components(residual[..., None], envelope)[..., 0] * unit[..., None]
    good = unit > 0
    longest = int(
        np.argmax([np.ptp(t[g]) if g.any() else 0.0 for t, g in zip(time_s, good, strict=True)])
    )
    rows = np.flatnonzero(good[longest])
    if len(rows) < FEWEST:
        return ()
    parts = np.array_split(rows, min(len(rows), MOST_ROWS))
    t = np.array([time_s[longest, p].mean() for p in parts])
    std = np.array([np.sqrt(np.mean(unit[longest, p] ** 2) / len(p)) for p in parts])
    found = []
    for k in range(4):
        y = np.array([own[longest, p, k].mean() for p in parts])
        # a component that is left out, as a free phase, has nothing in it
        found.append(
            estimate(t, y, std)
            if np.any(np.abs(y) > 1e-6 * std)
            else ColouredNoise(1.0, 0.0, 0.0, 0.0)
        )
    return tuple(found) if max(n.clear for n in found) >= CLEAR else ()
