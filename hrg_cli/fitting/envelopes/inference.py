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
    """How much more the residuals scatter than the stated noise, over ever longer blocks.

    Residuals are summed over blocks, where white noise would be 1. Parameters move with what is
    slow, so the factor is the level at the longest scale that still has a thousand sums, be it
    above or below the white one (windows that share samples anticorrelate); a level at a still
    longer scale counts when it exceeds that by 4 of its errors. Neighbours alone never make it less
    than the stated noise: behind a filter they scatter by less than what is slow, for which the
    noise is stated. Sums lost to the fitted parameters are allowed for.

    Parameters
    ----------
    fit
        The optimum.

    Returns
    -------
    tuple of float
        The variance factor over the nominal noise, and its part due to colour (1: white).

    Examples
    --------
    Noise held over four rows each, of the stated size, moves what is slow by four times its
    variance:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import estimate_variance_inflation
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t, random = np.arange(0.0, 20.0, 0.01), np.random.default_rng(1)
    >>> noise = 0.01 * np.repeat(random.standard_normal((500, 4)), 4, axis=0).view(complex)
    >>> u = np.outer(np.exp(-0.1 * t), [1, 0j]) + noise
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.01)
    >>> space = free_coordinates(["damping"], np.zeros(7))
    >>> best = fit(make_batch([run]), space, np.array([0.1]), u[:1], np.zeros((1, 1)))
    >>> np.round(estimate_variance_inflation(best)).tolist()
    [4.0, 4.0]
    """
    white = fit.chi2 / fit.dof
    residual = fit.response.compute_residual()
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
    """Size that a direction of z would have to be known to.

    ν for damping, the larger of δω, ν and 1/T for the split, K for K, at least 0.3.

    Parameters
    ----------
    fit
        The optimum.

    Returns
    -------
    ndarray
        (k,); 0: not judged.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import compute_natural_scales
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> u = np.outer(np.exp(-0.2 * t), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> space = free_coordinates(["damping", "split_sin", "second_order"], np.zeros(7))
    >>> best = fit(make_batch([run]), space, np.array([0.2, 0, 0]), u[:1], np.zeros((1, 1)))
    >>> compute_natural_scales(best).round(3).tolist()
    [0.2, 0.2, 0.0]
    """
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
    """What of z these runs do not fix, and how well the rest of it is conditioned.

    Parameters
    ----------
    fit
        The optimum.
    factor
        Variance of the noise over the stated one.

    Returns
    -------
    tuple of float and list of Flat
        Condition number of the Fisher information of the judged directions, scaled to a unit
        diagonal, and the flat ones; the rest is nuisance and keeps its prior.

    Examples
    --------
    A straight wave of one run that stands still decays by ν + νδμ cos 2mθ_μ alone:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import find_flat_directions
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> u = np.outer(np.exp(-0.2 * t), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> space = free_coordinates(["damping", "damping_cos"], np.zeros(7))
    >>> best = fit(make_batch([run]), space, np.array([0.2, 0.0]), u[:1], np.zeros((1, 1)))
    >>> condition, (flat,) = find_flat_directions(best, 1.0)
    >>> condition > 1e12, np.abs(flat.direction).round(3).tolist()
    (True, [0.707, 0.707])
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
    """Covariance of z with the data's information divided by a factor, priors kept.

    Parameters
    ----------
    fit
        The optimum.
    factor
        Variance of the noise over the stated one.

    Returns
    -------
    ndarray
        (k, k).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import compute_covariance_z
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> u = np.outer(np.exp(-0.2 * t), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> space = free_coordinates(["damping"], np.zeros(7))
    >>> best = fit(make_batch([run]), space, np.array([0.2]), u[:1], np.zeros((1, 1)))
    >>> bool(
    ...     np.isclose(compute_covariance_z(best, 4.0)[0, 0], 4 * best.compute_covariance_z()[0, 0])
    ... )
    True
    """
    prior = np.where(np.isfinite(fit.freedom.prior_std), fit.freedom.prior_std, np.inf) ** -2.0
    root = np.concatenate([fit.data_root / np.sqrt(factor), np.diag(np.sqrt(prior))])
    inverse = invert_scaled(root)
    return inverse @ inverse.T


def widen_axes(covariance: Array, cov_p: Array, p: Array, mode_number: int) -> None:
    """Give axes whose split is not clear of its noise the spread of their components, and sizes
    what an error across the split adds to them.

    The slope's would be too narrow or too wide there. One that is held stays so.

    Parameters
    ----------
    covariance
        Of (ν, νδμ, θ_μ, δω, θ_ω, K), (6, 6); changed in place, correlations kept.
    cov_p
        Of the coordinates, (7, 7).
    p
        Coordinates (7,).
    mode_number
        m.

    Examples
    --------
    A split that is as large as its noise has any axis: uniform over π/m, with (π/m)/√12.

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import to_parameters
    >>> from hrg_cli.fitting.envelopes.inference import widen_axes
    >>> p, cov_p = np.array([0.2, 0, 0, 0.01, 0, 0.5, 1]), np.diag([0, 0, 0, 1e-4, 1e-4, 0, 0])
    >>> slopes = to_parameters(p, 2)[1]
    >>> covariance = slopes @ cov_p @ slopes.T
    >>> widen_axes(covariance, cov_p, p, 2)
    >>> round(float(np.sqrt(covariance[4, 4])), 4), round(float(np.pi / 2 / np.sqrt(12)), 4)
    (0.4534, 0.4534)
    """
    for axis, first in ((2, 1), (4, 3)):
        split, part = p[first : first + 2], cov_p[first : first + 2, first : first + 2]
        std, size2 = np.sqrt(max(0.0, covariance[axis, axis])), float(split @ split)
        covariance[first, first] += _compute_bent_variance(split, part, covariance[first, first])
        if not np.any(part) or not np.isfinite(size2) or size2 > CLEAR**2 * np.trace(part):
            continue
        tangent = 2 * mode_number * np.sqrt(size2) * std
        if size2 > 0 and tangent < HELD * np.sqrt(np.trace(part)):
            continue
        spread = coordinates.compute_axis_spread(split, part, mode_number)
        wider = spread / std if np.isfinite(std) and std > 0 else 0.0
        covariance[axis] *= wider
        covariance[:, axis] *= wider
        covariance[axis, axis] = spread**2


def measure_along(split: Array, part: Array) -> float:
    """The standard deviation of a split's size by its slope alone.

    Parameters
    ----------
    split
        Components (2,).
    part
        Their covariance (2, 2).

    Returns
    -------
    float
        Along the split; without one, the root of the mean variance.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.inference import measure_along
    >>> measure_along(np.array([3.0, 0.0]), np.diag([0.01, 1.0]))
    0.1
    """
    size = float(np.hypot(*split))
    variance = split @ part @ split / size**2 if size > 0 else np.trace(part) / 2
    return float(np.sqrt(max(0.0, float(variance))))


def _compute_bent_variance(split: Array, part: Array, along: float) -> float:
    """What the second order adds to the variance of a split's size, beside that of its slope
    (`along`).

    An error t across a split of size r makes it longer by t²/2r: (σ_t²/2r)² of bias and twice that
    of scatter, no more than an error along it would be were it as large.
    """
    size = float(np.hypot(*split))
    if not size > 0 or not np.all(np.isfinite(part)):
        return 0.0
    across = np.array([-split[1], split[0]]) / size
    variance = float(across @ part @ across)
    return max(0.0, min(0.75 * (variance / size) ** 2, variance - along))


def differentiate_parameters(fit: Fit, mode_number: int) -> Array:
    """∂(ν, νδμ, θ_μ, δω, θ_ω, K)/∂z.

    Parameters
    ----------
    fit
        The optimum.
    mode_number
        m.

    Returns
    -------
    ndarray
        (6, k); what is held moves with nothing, not even by rounding.

    Examples
    --------
    A damping split held on the axis 2mθ_μ = 0.6 rad: its size is the coordinate along it, and the
    axis does not move.

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.inference import differentiate_parameters
    >>> from hrg_cli.fitting.envelopes.likelihood import Freedom
    >>> along = np.array([[0, np.cos(0.6), np.sin(0.6), 0, 0, 0, 0]]).T
    >>> space = Freedom(("damping_cos",), np.zeros(7), along, np.zeros(1), np.full(1, np.inf))
    >>> best = SimpleNamespace(p=0.01 * along[:, 0], freedom=space)
    >>> differentiate_parameters(best, 2)[:, 0].round(9).tolist()
    [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    """
    _, slopes = coordinates.to_parameters(fit.p, mode_number)
    through = slopes @ fit.freedom.directions
    return np.where(
        np.abs(through) > 1e-12 * (np.abs(slopes) @ np.abs(fit.freedom.directions)), through, 0.0
    )


def compute_parameter_covariance(
    fit: Fit, factor: float, mode_number: int, between: Array | None = None
) -> tuple[Array, Array]:
    """The resonator's parameters with their covariance.

    The data's information is scaled by 1/factor, priors are kept. The size of a split that is lost
    in noise keeps the standard deviation of a component; its axis has the spread of its
    components'.

    Parameters
    ----------
    fit
        The optimum.
    factor
        Variance of the noise over the stated one.
    mode_number
        m.
    between
        What the runs' disagreement adds to the covariance of z, (k, k).

    Returns
    -------
    tuple of ndarray
        Values (6,) and covariance (6, 6) of ν, νδμ, θ_μ, δω, θ_ω, K.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import compute_parameter_covariance
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> u = np.outer(np.exp(-0.2 * t), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> space = free_coordinates(["damping"], np.zeros(7))
    >>> best = fit(make_batch([run]), space, np.array([0.2]), u[:1], np.zeros((1, 1)))
    >>> values, covariance = compute_parameter_covariance(best, 1.0, 2, np.array([[0.03**2]]))
    >>> round(float(values[0]), 6), round(float(np.sqrt(covariance[0, 0])), 3)
    (0.2, 0.03)
    """
    values, _ = coordinates.to_parameters(fit.p, mode_number)
    cov_z = compute_covariance_z(fit, factor) + (0.0 if between is None else between)
    cov_p = fit.freedom.directions @ cov_z @ fit.freedom.directions.T
    through = differentiate_parameters(fit, mode_number)
    covariance = through @ cov_z @ through.T
    widen_axes(covariance, cov_p, fit.p, mode_number)
    return values, covariance


def measure_run_shifts(fit: Fit, factor: float) -> tuple[Array, Array]:
    """How far each run alone pulls z from what the other runs say.

    In directions of unit total information, the others having λ of it: (gradient of the run)²/λ(1 −
    λ), summed over those in which both a run and the others have something to say.

    Parameters
    ----------
    fit
        The optimum over R runs.
    factor
        Variance of the noise over the stated one.

    Returns
    -------
    tuple of ndarray
        χ² (R,), and of how many directions (R,): none where the others say nothing.

    Examples
    --------
    Four runs, of which the last decays faster by 20 of its standard deviations:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import measure_run_shifts
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t, runs = np.linspace(0.0, 10.0, 101), []
    >>> for damping in (0.1, 0.1, 0.1, 0.11):
    ...     u = np.outer(np.exp(-damping * t), [1, 0j])
    ...     runs.append(EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1))
    >>> start, space = np.array([[1, 0j]] * 4), free_coordinates(["damping"], np.zeros(7))
    >>> best = fit(make_batch(runs), space, np.array([0.1]), start, np.zeros((4, 1)))
    >>> shifts, directions = measure_run_shifts(best, 1.0)
    >>> int(np.argmax(shifts)), bool(shifts[3] > 20), bool(shifts[0] < shifts[3] / 5)
    (3, True, True)
    >>> directions.tolist()
    [1, 1, 1, 1]
    """
    parts = _run_information(fit)
    total = _prior_information(fit) + sum(information for information, _ in parts)
    out, directions = np.zeros(len(parts)), np.zeros(len(parts), int)
    size = np.sqrt(np.maximum(np.diag(total), 1e-300))
    value, vector = np.linalg.eigh(total / np.outer(size, size))
    if len(parts) < 2 or value[0] < 1e-12:  # a direction that no run knows has no others
        return out, directions
    whiten = vector / np.sqrt(value) / size[:, None]
    for i, (information, gradient) in enumerate(parts):
        share, direction = np.linalg.eigh(whiten.T @ information @ whiten)
        pull = direction.T @ whiten.T @ gradient
        # The gradients add up to zero at the optimum. So the run alone says pull/share and the rest
        # −pull/(1 − share); they differ by pull/share(1 − share), whose variance is 1/share + 1/(1
        # − share) = 1/share(1 − share).
        both = (share > LEAST_SHARE) & (share < 1 - LEAST_SHARE)
        directions[i] = int(both.sum())
        out[i] = float(np.sum(pull[both] ** 2 / (share * (1 - share))[both])) / factor
    return out, directions


def compute_between_runs(fit: Fit) -> Array:
    """Covariance of z by leaving out one run after another, (R − 1)/R·Σ d dᵀ (jackknife).

    Each d is one Gauss–Newton step. Where the model is wrong this is what the runs say about it; a
    run without which nothing is known moves z as if all were like it.

    Parameters
    ----------
    fit
        The optimum over R runs.

    Returns
    -------
    ndarray
        (k, k); zero for one run.

    Examples
    --------
    Runs whose dampings scatter by 1e-3 about 0.1: the mean's own deviation is 1e-3/√R.

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import compute_between_runs
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t, runs, dampings = np.linspace(0.0, 10.0, 101), [], [0.099, 0.101, 0.1, 0.0995, 0.1005]
    >>> for damping in dampings:
    ...     u = np.outer(np.exp(-damping * t), [1, 0j])
    ...     runs.append(EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1))
    >>> start, space = np.array([[1, 0j]] * 5), free_coordinates(["damping"], np.zeros(7))
    >>> best = fit(make_batch(runs), space, np.array([0.1]), start, np.zeros((5, 1)))
    >>> std = np.sqrt(compute_between_runs(best)[0, 0])
    >>> bool(np.isclose(std, np.std(dampings, ddof=1) / np.sqrt(5), rtol=0.02))
    True
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
        if value[0] < 1e-6 / count:  # this run alone knows a direction: all count as like it
            value, vector = np.linalg.eigh(total / np.outer(size, size) * (count - 1) / count)
        # without the run the gradient of the others is minus its own; the sign drops out in d dᵀ
        shift = vector @ ((vector.T @ (gradient / size)) / np.maximum(value, 1e-12)) / size
        out += (count - 1) / count * np.outer(shift, shift)
    return out


def widen_by_held(fit: Fit, coordinate: int, std: float) -> Array:
    """Covariance that z gains by a held coordinate which is known to a standard deviation only.

    It is how the fit would move with it, squared: dz/dh = −I_zz⁻¹ I_zh.

    Parameters
    ----------
    fit
        The optimum.
    coordinate
        Place of the held one.
    std
        Its standard deviation.

    Returns
    -------
    ndarray
        (k, k).

    Examples
    --------
    The rate that a turning wave shows is KΩ; in a run that stands, K moves nothing:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import DAMPING
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import widen_by_held
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> u = np.outer(np.exp(-0.1 * t), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> held = np.array([0.1, 0, 0, 0, 0, 0, 0])
    >>> space = free_coordinates(["damping_cos"], held)
    >>> best = fit(make_batch([run]), space, np.zeros(1), u[:1], np.zeros((1, 1)))
    >>> np.sqrt(widen_by_held(best, DAMPING, 1e-3)[0, 0]).round(9)
    np.float64(0.001)
    """
    response = fit.response
    over_noise = response.batch.whiten
    shared = over_noise(fit.freedom.project(response.find_coordinate_sensitivities()))
    held = over_noise(response.find_coordinate_sensitivities()[coordinate : coordinate + 1])
    own = over_noise(response.find_run_sensitivities())
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
    shared = response.batch.whiten(fit.freedom.project(response.find_coordinate_sensitivities()))
    own = response.batch.whiten(response.find_run_sensitivities())
    residual = response.compute_residual()
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
    """Mean frequencies of the runs, each its own nuisance, correlated through what they share.

    Parameters
    ----------
    fit
        The optimum over R runs.
    factor
        Variance of the noise over the stated one.

    Returns
    -------
    Frequencies
        In Hz, with covariance.

    Examples
    --------
    A wave 0.5·2π rad/s above a reference of 5 kHz:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.inference import estimate_run_frequencies
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> u = np.outer(np.exp((1j * np.pi - 0.1) * t), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> space, phase = free_coordinates(["damping"], np.zeros(7)), np.array([[31.0]])
    >>> best = fit(make_batch([run]), space, np.array([0.1]), u[:1], phase)
    >>> estimate_run_frequencies(best, 1.0).value.round(6).tolist()
    [5000.5]
    """
    response = fit.response
    span = response.batch.span_s
    frequency = np.array(
        [r.reference_frequency_hz for r in response.batch.runs]
    ) + response.state.compute_offsets_rad_s(span) / (2 * np.pi)
    covariance = compute_covariance_z(fit, factor)
    shared = response.batch.whiten(fit.freedom.project(response.find_coordinate_sensitivities()))
    own = response.batch.whiten(response.find_run_sensitivities())
    variance, through = np.zeros(len(frequency)), np.zeros((len(frequency), len(covariance)))
    for run, record in enumerate(response.batch.runs):
        n = len(record)
        Q, R = np.linalg.qr(stack_reals(own[:, run, :n]))
        # own: the start envelope's four reals, then the phase's orders, each in radians at the
        # run's end: their sum over 2π·span is what the mean frequency lies above the reference
        pick = np.concatenate([np.zeros(4), np.ones(len(own) - 4)]) / (2 * np.pi * span[run])
        # the run's own unknowns at a given z: R⁻¹Qᵀ(residual − design·z)
        back = pick @ invert_scaled(R)
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
