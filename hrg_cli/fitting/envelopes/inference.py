"""What a likelihood fit is worth: coloured-noise inflation, covariance of the parameters, flat
directions, runs that disagree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..least_squares import invert_information, invert_scaled
from . import coordinates
from .coordinates import DAMPING, FREQUENCY_SPLIT, SCALE_FACTOR
from .likelihood import Fit, triangularise
from .response import stack_reals

Array = np.ndarray
FLAT_FRACTION = 0.3
"""A direction known no better than this part of its natural scale is flat."""
CLEAR = 8.0
"""Size of a split over its standard deviation from which its axis moves with its components as the
slope says."""
HELD = 1e-6
"""Part of a split's noise that its tangent has by rounding alone where the axis is held."""
LEAST_SHARE = 0.01
"""Part of the information on a direction that a run and the others must have for the one to
contradict the others in it."""
MIN_BLOCKS = 24
"""Fewest blocks of residuals from which a noise level at that scale is believed."""
MANY_BLOCKS = 1000
"""Sums of residuals from which their level is known well enough (3 % of a standard deviation) to be
taken in any case."""


APART = 4
"""Rows of a sum from which its level may be less than the stated noise's."""


@dataclass(frozen=True)
class Flat:
    """A direction of z these runs do not fix: unit vector in natural scales, and its standard
    deviation in them."""

    direction: Array
    std: float


def estimate_variance_inflation(fit: Fit) -> tuple[float, float]:
    """(variance factor over the nominal noise, its part due to colour): residuals summed over ever
    longer blocks, as white noise would be 1.

    Parameters move with what is slow, so the factor is the level at the longest scale that still
    has a thousand sums, be it above or below the white one (windows that share samples
    anticorrelate); a level at a still longer scale counts when it exceeds that by 4 of its errors.
    Neighbours alone never make it less than the stated noise: behind a filter they scatter by less
    than what is slow, for which the noise is stated. Sums lost to the fitted parameters are allowed
    for.
    """
    white = fit.chi2 / fit.dof
    residual = fit.response.residual()
    own = 4 + fit.response.state.phase.shape[1]
    worst, size = max(white, 1.0), 2
    while True:
        sums, lost = [], len(fit.freedom.names)
        for run, record in enumerate(fit.response.batch.runs):
            n = len(record) // size * size
            if n:
                # a sum of `size` white residuals has `size` times the variance of one
                blocks = residual[run, :n].reshape(-1, size, 2).sum(axis=1)
                sums.append(np.concatenate([blocks.real.ravel(), blocks.imag.ravel()]))
                lost += own
        joined = np.concatenate(sums) if sums else np.zeros(0)
        left = len(joined) - lost
        if left < 3 * MIN_BLOCKS or len(joined) < 4 * MIN_BLOCKS:
            break
        level = float(np.sum(joined**2) / size / left)
        # χ²/dof of `left` sums scatters by √(2/left)
        if left > MANY_BLOCKS or level > worst * (1 + 4 * np.sqrt(2 / left)):
            worst = level if size >= APART else max(level, 1.0)
        size *= 2
    return worst, max(1.0, worst / white) if white > 0 else 1.0


def compute_natural_scales(fit: Fit) -> Array:
    """Size a direction of z would have to be known to: ν for damping, the larger of δω, ν, 1/T for
    the split, K for K; 0: not judged."""
    p = fit.p
    span = float(fit.response.batch.span_s.max())
    split = max(float(np.hypot(*p[FREQUENCY_SPLIT])), abs(p[DAMPING]), 1 / span)
    by_coordinate = np.array(
        [
            abs(p[DAMPING]),
            abs(p[DAMPING]),
            abs(p[DAMPING]),
            split,
            split,
            max(abs(p[SCALE_FACTOR]), 0.3),
            0.0,
        ]
    )
    return np.abs(fit.freedom.directions.T) @ by_coordinate


def find_flat_directions(fit: Fit, factor: float) -> tuple[float, list[Flat]]:
    """Condition number of the scaled Fisher information (unit diagonal) of the judged directions,
    and the flat ones; the rest is nuisance.
    """
    scales = compute_natural_scales(fit)
    judged = scales > 0
    order = np.concatenate([np.flatnonzero(~judged), np.flatnonzero(judged)])
    nuisance = int((~judged).sum())
    root = fit.data_root[:, order]
    if nuisance:
        kept = fit.root[:, order]  # a nuisance keeps its prior
        root = triangularise(kept)[nuisance:, nuisance:]
    norms = np.linalg.norm(root, axis=0)
    unit = np.asarray(root / np.where(norms > 0, norms, 1.0))
    size = np.linalg.svd(unit, compute_uv=False)
    condition = float((size[0] / size[-1]) ** 2) if size[-1] > 0 else float("inf")
    _, strength, Vt = np.linalg.svd(root * scales[judged])
    flat = []
    for s, v in zip(strength, Vt):
        std = np.sqrt(factor) / s if s > 0 else np.inf
        if std > FLAT_FRACTION:
            full = np.zeros(len(scales))
            full[judged] = v
            flat.append(Flat(full, float(std)))
    return condition, flat


def compute_covariance_z(fit: Fit, factor: float) -> Array:
    """Covariance of z with the data's information divided by `factor`, priors kept."""
    prior = np.where(np.isfinite(fit.freedom.prior_std), fit.freedom.prior_std, np.inf) ** -2.0
    root = np.concatenate([fit.data_root / np.sqrt(factor), np.diag(np.sqrt(prior))])
    inverse = invert_scaled(root)
    return inverse @ inverse.T


def widen_axes(covariance: Array, cov_p: Array, p: Array, mode_number: int) -> None:
    """Give axes whose split is not clear of its noise the spread of their components instead of the
    slope's, in the covariance (6, 6) in place; one that is held stays so."""
    for axis, first in ((2, 1), (4, 3)):
        split, part = p[first : first + 2], cov_p[first : first + 2, first : first + 2]
        std, size2 = np.sqrt(max(0.0, covariance[axis, axis])), float(split @ split)
        if not np.any(part) or not np.isfinite(size2) or size2 > CLEAR**2 * np.trace(part):
            continue
        tangent = 2 * mode_number * np.sqrt(size2) * std
        if size2 > 0 and tangent < HELD * np.sqrt(np.trace(part)):
            continue
        spread = coordinates.axis_spread(split, part, mode_number)
        wider = spread / std if np.isfinite(std) and std > 0 else 0.0
        covariance[axis] *= wider
        covariance[:, axis] *= wider
        covariance[axis, axis] = spread**2


def differentiate_parameters(fit: Fit, mode_number: int) -> Array:
    """∂(ν, νδμ, θ_μ, δω, θ_ω, K)/∂z (6, k); what is held moves with nothing, not even by
    rounding."""
    _, slopes = coordinates.to_parameters(fit.p, mode_number)
    through = slopes @ fit.freedom.directions
    return np.where(
        np.abs(through) > 1e-12 * (np.abs(slopes) @ np.abs(fit.freedom.directions)), through, 0.0
    )


def compute_parameter_covariance(
    fit: Fit, factor: float, mode_number: int, between: Array | None = None
) -> tuple[Array, Array]:
    """(values (6,), covariance (6, 6)) of ν, νδμ, θ_μ, δω, θ_ω, K; data information scaled by
    1/factor, priors kept.

    `between` (k, k): what the runs' disagreement adds to the covariance of z.

    The size of a split that is lost in noise keeps the standard deviation of a component; its axis
    has the spread of its components'.
    """
    values, _ = coordinates.to_parameters(fit.p, mode_number)
    cov_z = compute_covariance_z(fit, factor) + (0.0 if between is None else between)
    cov_p = fit.freedom.directions @ cov_z @ fit.freedom.directions.T
    through = differentiate_parameters(fit, mode_number)
    covariance = through @ cov_z @ through.T
    widen_axes(covariance, cov_p, fit.p, mode_number)
    return values, covariance


def measure_run_shifts(fit: Fit, factor: float) -> Array:
    """How far each run alone pulls z from what the other runs say, as a χ² a direction; 0 where the
    others say nothing.

    In directions of unit total information, the others having λ of it: (gradient of the run)²/λ(1 −
    λ).
    """
    parts = _run_information(fit)
    total = _prior_information(fit) + sum(information for information, _ in parts)
    out = np.zeros(len(parts))
    size = np.sqrt(np.maximum(np.diag(total), 1e-300))
    value, vector = np.linalg.eigh(total / np.outer(size, size))
    if len(parts) < 2 or value[0] < 1e-12:
        return out
    whiten = vector / np.sqrt(value) / size[:, None]
    for i, (information, gradient) in enumerate(parts):
        share, direction = np.linalg.eigh(whiten.T @ information @ whiten)
        pull = direction.T @ whiten.T @ gradient
        # The gradients add up to zero at the optimum. So the run alone says pull/share and the rest
        # −pull/(1 − share); they differ by pull/share(1 − share), whose variance is 1/share + 1/(1 −
        # share) = 1/share(1 − share).
        both = (share > LEAST_SHARE) & (share < 1 - LEAST_SHARE)
        if both.any():
            out[i] = float(np.mean(pull[both] ** 2 / (share * (1 - share))[both])) / factor
    return out


def compute_between_runs(fit: Fit) -> Array:
    """Covariance of z (k, k) by leaving out one run after another, (R − 1)/R·Σ d dᵀ, each d one
    Gauss–Newton step; zero for one run.

    Where the model is wrong this is what the runs say about it; a run without which nothing is
    known moves z as if all were like it.
    """
    parts = _run_information(fit)
    total = _prior_information(fit) + sum(information for information, _ in parts)
    count = len(parts)
    out = np.zeros(total.shape)
    if count < 2:
        return out
    size = np.sqrt(np.diag(total))
    size[size == 0] = 1.0
    for information, gradient in parts:
        rest = (total - information) / np.outer(size, size)
        value, vector = np.linalg.eigh(rest)
        if value[0] < 1e-6 / count:
            value, vector = np.linalg.eigh(total / np.outer(size, size) * (count - 1) / count)
        # without the run the gradient of the others is minus its own; the sign drops out in d dᵀ
        shift = vector @ ((vector.T @ (gradient / size)) / np.maximum(value, 1e-12)) / size
        out += (count - 1) / count * np.outer(shift, shift)
    return out


def widen_by_held(fit: Fit, coordinate: int, std: float) -> Array:
    """Covariance of z (k, k) by a held coordinate that is known to `std` only: how the fit would
    move with it, squared."""
    response = fit.response
    over_noise = response.batch.over_noise
    shared = over_noise(fit.freedom.along(response.coordinate_sensitivities()))
    held = over_noise(response.coordinate_sensitivities()[coordinate : coordinate + 1])
    own = over_noise(response.run_sensitivities())
    k = len(shared)
    total = np.zeros((k + 1, k + 1))
    total[:k, :k] = _prior_information(fit)
    for run, record in enumerate(response.batch.runs):
        n = len(record)
        Q, _ = np.linalg.qr(stack_reals(own[:, run, :n]))
        design = stack_reals(np.concatenate([shared, held])[:, run, :n])
        design = design - Q @ (Q.T @ design)
        total += design.T @ design
    # dz/dh = −I_zz⁻¹·I_zh of the joint information: z follows the held coordinate h
    shift = invert_information(total[:k, :k]) @ total[:k, k] * std
    return np.outer(shift, shift)


def _prior_information(fit: Fit) -> Array:
    """Information of the priors on z, (k, k)."""
    std = fit.freedom.prior_std
    return np.asarray(np.diag(np.where(np.isfinite(std), std, np.inf) ** -2.0))


def _run_information(fit: Fit) -> list[tuple[Array, Array]]:
    """Information and gradient (Jᵀr) of each run on z, its own nuisances eliminated."""
    response = fit.response
    shared = response.batch.over_noise(fit.freedom.along(response.coordinate_sensitivities()))
    own = response.batch.over_noise(response.run_sensitivities())
    residual = response.residual()
    parts = []
    for run, record in enumerate(response.batch.runs):
        n = len(record)
        Q, _ = np.linalg.qr(stack_reals(own[:, run, :n]))
        design = stack_reals(shared[:, run, :n])
        design = design - Q @ (Q.T @ design)
        r = residual[run, :n].ravel()
        parts.append((design.T @ design, design.T @ np.concatenate([r.real, r.imag])))
    return parts


@dataclass(frozen=True)
class Frequencies:
    """Mean frequency of each run, Hz: values (R,), covariance (R, R), change with z (R, k) and what
    is its own beside z (R,)."""

    value: Array
    covariance: Array
    by_z: Array
    own_variance: Array
    drift_hz: Array
    """Range of the frequency within each run, (R,)."""


def estimate_run_frequencies(fit: Fit, factor: float) -> Frequencies:
    """Mean frequencies of the runs, each its own nuisance, correlated through what they share."""
    response = fit.response
    span = response.batch.span_s
    frequency = np.array(
        [r.reference_frequency_hz for r in response.batch.runs]
    ) + response.state.offsets_rad_s(span) / (2 * np.pi)
    covariance = compute_covariance_z(fit, factor)
    shared = response.batch.over_noise(fit.freedom.along(response.coordinate_sensitivities()))
    own = response.batch.over_noise(response.run_sensitivities())
    variance, through = np.zeros(len(frequency)), np.zeros((len(frequency), len(covariance)))
    for run, record in enumerate(response.batch.runs):
        n = len(record)
        Q, R = np.linalg.qr(stack_reals(own[:, run, :n]))
        # own: the start envelope's four reals, then the phase's orders, each in radians at the run's
        # end: their sum over 2π·span is what the mean frequency lies above the reference
        pick = np.concatenate([np.zeros(4), np.ones(len(own) - 4)]) / (2 * np.pi * span[run])
        # the run's own unknowns at a given z: R⁻¹Qᵀ(residual − design·z)
        back = pick @ np.linalg.pinv(R)
        variance[run] = factor * back @ back
        through[run] = -back @ (Q.T @ stack_reals(shared[:, run, :n]))
    x = np.linspace(0.0, 1.0, 65)
    orders = np.arange(1, response.state.phase.shape[1] + 1)
    # d/dt of Σ c_k x^k, x = t/span, k = 1, 2, …
    course = (response.state.phase[:, :, None] * orders[:, None] * x ** (orders[:, None] - 1)).sum(
        axis=1
    ) / (2 * np.pi * span[:, None])
    return Frequencies(
        frequency,
        np.diag(variance) + through @ covariance @ through.T,
        through,
        variance,
        np.ptp(course, axis=1),
    )
