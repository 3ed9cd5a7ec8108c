"""Diagnosis, what the next order of a named cause leaves unknown: a law that is fitted as a line
bends, and every number beside it goes with the bend.

An axis that turns by β a kelvin is a split along one line to first order; in second it is −β²/2 of
itself, which five σ of a split may be where the line alone leaves nothing but noise. The next order
q of a cause is therefore as unknown as it is likely and these runs allow. With sensitivities S⊥ off
the model's, and T the sizes that the cause's page has for q as prior (at most those at which the
next order does as much as the first),
    Σ = (S⊥ᵀS⊥ + T⁻²)⁻¹,    q̂ = Σ S⊥ᵀr.
The model refitted at √λ e of each eigenvalue λ and vector e of the mean square Σ + q̂q̂ᵀ shows by how
much each number may be off: the squares of what it moves add up to the mean square of that.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping

import numpy as np

from ....effects.effect import Effect
from ....fitting.causes import extended_fit, fit_point, scales
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.refits import free_also

Array = np.ndarray


def refit_next_orders(fit: ExtendedFit, inflation: float) -> dict[str, ExtendedFit]:
    """Refits of a model with the next order of each cause that has one, not fitted, as large as it
    may be.

    Parameters
    ----------
    fit
        The final one.
    inflation
        Of its variances.

    Returns
    -------
    dict
        By the cause's name and a number; none of a cause without a next order, or without such a
        fit.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.next_orders import refit_next_orders
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> refit_next_orders(draw_fit(), 1.0)
    {}
    """
    return {
        f"{effect.name}, order {number}": moved
        for effect, values in fit.point.active
        for number, orders in enumerate(_list_likely(fit, effect, values, inflation), 2)
        if (moved := _refit_with(fit, effect, {**values, **orders})) is not None
    }


def _list_likely(
    fit: ExtendedFit, effect: Effect, values: Mapping[str, float], inflation: float
) -> Iterator[dict[str, float]]:
    """Values of a cause's parameters of higher order, one set for each direction that they have."""
    mechanics = fit_point.make_mechanics(fit.point.p, fit.series)
    sized = effect.size_next_order(values, mechanics)
    held = [p.name for p in effect.parameters if not fit.frees(effect.name, p.name)]
    likely = {name: sized[name] for name in held if name in sized}
    if not any(likely.values()):
        return
    S, sizes = _scale(fit, effect, values, likely)
    free = fit.basis.project_out(fit.basis.project_out(S)) / inflation**0.5
    spread = np.linalg.inv(free.T @ free + np.eye(len(sizes)))
    best = spread @ (free.T @ fit.residual) / inflation**0.5
    power, vectors = np.linalg.eigh(spread + np.outer(best, best))
    for one in (vectors * np.sqrt(power)).T:
        yield dict(zip(likely, map(float, sizes * one), strict=True))


def _scale(
    fit: ExtendedFit, effect: Effect, values: Mapping[str, float], likely: Mapping[str, float]
) -> tuple[Array, Array]:
    """Sensitivities (N, k) to parameters of higher order at their likely sizes, and these (k,): no
    larger than those that do as much as the cause's first order."""
    steps = scales.list_steps(free_also(effect, set(likely)), fit.series)
    S = fit.find_sensitivities([(effect, values, steps)])[0]
    higher = np.isin(list(steps), list(likely))
    off = [values[p.name] - p.neutral for p in effect.parameters if p.name in steps]
    first = np.linalg.norm(S[:, ~higher] @ np.array(off)[~higher])
    each = np.maximum(np.linalg.norm(S[:, higher], axis=0), 1e-300)
    sizes = np.minimum([likely[name] for name in steps if name in likely], first / each)
    return S[:, higher] * sizes, sizes


def _refit_with(
    fit: ExtendedFit, effect: Effect, values: Mapping[str, float]
) -> ExtendedFit | None:
    """The model refitted with other values of what is held of a cause."""
    with contextlib.suppress(extended_fit.DivergedError):
        point = fit_point.add_effect(fit.point, effect, values)
        again = extended_fit.fit(fit.series, point, fit.freedom, near=fit.flow.near)
        return again if again.converged else None
    return None
