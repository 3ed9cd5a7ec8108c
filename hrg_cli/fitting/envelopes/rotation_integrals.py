"""Identification of a uniformly turned gyro by integrals over full turns of 2mθ (seed A after (16),
corrected).

ν = −⟨d ln a_A/dt⟩, νδμ_c = −(1/π)∮(d ln a_A/dt) cos 2mθ d(2mθ), and for the quadrature wave y =
(ȧ_B + νa_B)/a_A: δω_c = (1/π)∮ y sin 2mθ d(2mθ), δω_s = −(1/π)∮ y cos 2mθ d(2mθ); K = −mΔθ/∫Ω dt.
The paper prints −2∫ and half a turn, which is 3.14 times too large and leaks a constant error δν as
4δν/π (PHYSICS §4); a_A is divided out first because it is not constant. The terms in a_B/a_A of
(15) and the drift in K are put back from the estimates themselves, three times over.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..noise import noise_propagation
from .coordinates import COUNT, SCALE_FACTOR
from .envelope_runs import EnvelopeRun
from .equations import Ellipse, build_ellipse
from .method_ranges import USES_AXES, find_refusal, measure_quadrature_significance
from .regressions import CORRECTIONS, Noiseless, Regression

Array = np.ndarray
METHOD = "rotation-integrals"
assert METHOD in USES_AXES


def solve(
    runs: Sequence[EnvelopeRun], model: Noiseless | None = None, start: Array | None = None
) -> Regression:
    """All runs that make at least one full turn of 2mθ, weighted by their turns.

    Parameters
    ----------
    runs
        Free ones.
    model
        Noiseless rows for any coordinates (7,), by which the differences' truncation is taken off.
    start
        The first coordinates (7,) for it.

    Returns
    -------
    Regression
        Coordinates and covariance; refused when no run makes a full turn.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rotation_integrals import solve
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 20.0, 0.02), np.array([0.1, 0.02, 0.01, 0.03, 0.02, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 1.0, 3e4), t) @ [1.0, 0.0]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-5, t, None, 5e3, 2, 0.02)
    >>> solve([run]).p[:6].round(4).tolist()
    [0.1, 0.02, 0.01, 0.03, 0.02, 0.5]
    >>> solve([run.select_rows(slice(0, 100))]).refused[:50]
    'rotation-integrals needs a run that turns through '
    """
    refusal = find_refusal(runs, METHOD)
    found = [
        None
        if refusal
        else integrate_run(run, None if model is None else partial(_of_run, model, i), start)
        for i, run in enumerate(runs)
    ]
    turning = [one for one in found if one is not None]
    if not turning:
        nan = np.full(COUNT, np.nan)
        refusal = (
            refusal
            or f"{METHOD} needs a run that turns through a full period of 2mθ; rotate the gyro"
            " uniformly for longer"
        )
        return Regression(nan, np.full((COUNT, COUNT), np.nan), refused=refusal)
    weights = [one.turns for one in turning]
    share = np.array(weights) / np.sum(weights)
    warnings = []
    if measure_quadrature_significance(runs) < 3:
        warnings.append("the quadrature is lost in the noise: the frequency split is skipped")
    return Regression(
        np.tensordot(share, np.array([one.p for one in turning]), 1),
        np.tensordot(share**2, np.array([one.covariance for one in turning]), 1),
        warnings,
        run_chi2=np.array([np.nan if one is None else one.chi2 for one in found]),
        run_rows=np.array([0 if one is None else one.rows for one in found]),
        unsettled=max(one.unsettled for one in turning),
    )


def _of_run(model: Noiseless, number: int, p: Array) -> EnvelopeRun:
    """One run of a model's."""
    return model(p)[number]


@dataclass(frozen=True)
class OneRun:
    """Coordinates (7,), covariance (7, 7), number of full turns, χ² and equations, and the last
    correction's change in σ."""

    p: Array
    covariance: Array
    turns: float
    chi2: float
    rows: int
    unsettled: float


def _integrals(weight: Array, angle: Array) -> Array:
    """What growth, quadrature and turning of n rows (3n) count in each of the six integrals over
    full turns: ν, (νδμ cos, sin), (δω cos, sin), K; angle: mθ."""
    c, s, n = np.cos(2 * angle), np.sin(2 * angle), len(weight)
    influence = np.zeros((6, 3 * n))
    influence[:3, :n] = weight * np.stack([np.ones(n), 2 * c, 2 * s])
    influence[3:5, n : 2 * n] = 2 * weight * np.stack([-s, c])
    influence[5, 2 * n :] = 1.0
    return influence


def _rates_less(w: Ellipse, rows: slice, p: Array) -> tuple[Array, Array, Array]:
    """(d ln a_A/dt, ȧ_B/a_A) less what p says of them, and the drift of mθ that p makes: seed A
    (15) with r = a_B/a_A kept."""
    c, s, r = np.cos(2 * w.angle[rows]), np.sin(2 * w.angle[rows]), w.b[rows] / w.a[rows]
    nu, nu_cos, nu_sin, split_cos, split_sin, _ = p
    split, damping = split_cos * s - split_sin * c, nu_cos * c + nu_sin * s
    along = split_cos * c + split_sin * s
    growth = w.a_dot[rows] / w.a[rows] + split * r + nu + damping
    quadrature = w.b_dot[rows] / w.a[rows] + (nu - damping) * r - split
    drift = ((nu_cos * s - nu_sin * c) * (1 + r**2) - 2 * r * along) / (1 - r**2)
    return growth, quadrature, drift


@dataclass(frozen=True)
class _FullTurns:
    """The rows of a run over a whole number of periods of 2mθ, and what their misfit counts in each
    integral."""

    wave: Ellipse
    rows: slice
    time_s: Array
    turned: float
    """Turn of the table over the rows, rad."""
    turns: int
    influence: Array
    """(6, 3n), see `_integrals`."""

    @classmethod
    def from_run(cls, run: EnvelopeRun) -> _FullTurns | None:
        """None without a full turn or when the wave does not turn one way."""
        w = build_ellipse(run)
        alpha = 2 * w.angle * np.sign(w.angle[-1] - w.angle[0])
        turns = int((alpha[-1] - alpha[0]) / (2 * np.pi))
        # Integrals over 2mθ want it to rise: a wave that swings back would count an angle twice.
        if turns < 1 or np.any(np.diff(alpha) <= 0):
            return None
        last = int(np.searchsorted(alpha, alpha[0] + 2 * np.pi * turns))
        rows = slice(0, min(last + 1, len(alpha)))
        weight = _trapezium(alpha[rows], 2 * np.pi * turns) / (2 * np.pi * turns)
        turned = float(run.turn_rad[len(weight) - 1] - run.turn_rad[0])
        influence = _integrals(weight, w.angle[rows])
        return cls(w, rows, run.time_s[rows], turned, turns, influence)

    def __len__(self) -> int:
        return len(self.time_s)

    def compute_misfit(self, moved: Ellipse, p: Array) -> Array:
        """Growth and quadrature (n each) less what p says of them, row by row, and the turning less
        drift and −KΩ, in n pieces that sum to it."""
        n, step, angle = len(self), np.diff(self.time_s), self.wave.angle
        growth, quadrature, drift = _rates_less(moved, self.rows, p)
        scale_factor = p[SCALE_FACTOR]
        turning = np.full(n, scale_factor * self.turned / n)
        turning[:-1] -= drift[:-1] * step / 2
        turning[1:] -= drift[1:] * step / 2
        turning[-1] += moved.angle[n - 1] - angle[0]
        turning[0] += angle[0] - moved.angle[0]
        return np.concatenate([growth, quadrature, turning])


@dataclass(frozen=True)
class _Solved:
    """Where the six integrals vanish: p (6,), p one correction earlier, the integrals' slope by p
    (6, 6), and what differences leave out (3n,)."""

    p: Array
    before: Array
    slope: Array
    left_out: Array | float


def _solve_integrals(
    data: _FullTurns, model: Callable[[Array], EnvelopeRun] | None, start: Array | None
) -> _Solved:
    """Newton's method on the six integrals, with the terms in a_B/a_A put back from the estimates
    themselves; a model's own misfit at its own p is what central differences leave out.

    As many equations as unknowns, weighted by the influence of the rows: a root, no minimum, so
    that there is no χ² to go down along.
    """
    p, before, slope = np.zeros(6), np.zeros(6), np.eye(6)
    left_out: Array | float = 0.0
    for trial in range(CORRECTIONS):
        before = p
        if model is not None and start is not None:
            at = np.append(p, 0.0) if trial else start
            left_out = data.compute_misfit(build_ellipse(model(at)), at[:6])
        here = data.compute_misfit(data.wave, p) - left_out
        slope = np.stack(
            [
                data.influence @ (data.compute_misfit(data.wave, p + e) - here - left_out)
                for e in np.eye(6)
            ],
            axis=1,
        )
        if not data.turned:
            # Without a rate K has no equation: the matrix is made regular, and K is left out at the
            # end.
            slope[5, 5] = 1.0
        p = p - np.linalg.solve(slope, data.influence @ here)
    return _Solved(p, before, slope, left_out)


def integrate_run(
    run: EnvelopeRun,
    model: Callable[[Array], EnvelopeRun] | None = None,
    start: Array | None = None,
) -> OneRun | None:
    """What one run says by its integrals over full turns of 2mθ.

    Parameters
    ----------
    run
        Envelopes, σ and table turn.
    model
        Its noiseless rows for any coordinates (7,).
    start
        The first coordinates (7,) for it.

    Returns
    -------
    OneRun or None
        None without a full turn or when the wave does not turn one way.

    Examples
    --------
    A wave that turns by 0.5 rad of mθ, and by 6 of it, which are 12 of 2mθ:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rotation_integrals import integrate_run
    >>> t = np.arange(0.0, 12.0, 0.02)
    >>> u = np.stack([np.cos(0.5 * t), -np.sin(0.5 * t)], axis=1) * np.exp((0j - 0.1) * t)[:, None]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-5, t, None, 5e3, 2, 0.02)
    >>> integrate_run(run.select_rows(slice(0, 50))) is None
    True
    >>> found = integrate_run(run)
    >>> found.turns, round(float(found.p[5]), 6)
    (1.0, 0.5)
    """
    data = _FullTurns.from_run(run)
    if data is None:
        return None
    solved, n = _solve_integrals(data, model, start), len(data)
    left = data.compute_misfit(data.wave, solved.p) - solved.left_out
    covariance, variance = noise_propagation.propagate_noise(
        run,
        lambda moved: data.compute_misfit(build_ellipse(moved), solved.p),
        np.tile(np.arange(n) - 1, 3),
        3,
        -np.linalg.solve(solved.slope, data.influence),
    )
    chi2 = float(np.sum(left[: 2 * n] ** 2 / variance[: 2 * n]))
    # By what growth and quadrature scatter beyond the noise; never below it, since a small χ² is
    # luck.
    covariance *= max(1.0, chi2 / (2 * n))
    std = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    change = float(np.max(np.abs(solved.p - solved.before) / std)) if model is not None else 0.0
    full, whole = np.zeros((COUNT, COUNT)), np.append(solved.p, 0.0)
    full[:6, :6] = covariance
    if not data.turned:
        whole[5] = np.nan
    return OneRun(whole, full, float(data.turns), chi2, 2 * n, change)


def _trapezium(x: Array, length: float) -> Array:
    """Weights of ∫ over [x₀, x₀ + length] by the trapezium rule, the last step cut where it
    overshoots."""
    weight = np.zeros(len(x))
    step = np.diff(x)
    weight[:-1] += step / 2
    weight[1:] += step / 2
    over = x[-1] - x[0] - length
    if over > 0:
        part = over / step[-1]
        weight[-1] -= step[-1] * part * (1 - part / 2)
        weight[-2] -= step[-1] * part * part / 2
    return weight
