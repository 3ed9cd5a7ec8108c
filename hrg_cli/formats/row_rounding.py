"""Demodulated rows written with few digits: what rounding does to them that their scatter does not
show.

A value on a lattice of step q is off by up to q/2, σ = q/√12. Where the noise spreads the values
over several codes that error is new in every row, and stands in the scatter. Where it does not, the
error follows the signal: it is the same as long as the signal stays on one code, and repeats where
the signal steps evenly, so that the spectrum shows lines in the place of noise. There σ is that of
the lattice, whatever the scatter: q²/12 a row, and where a code lasts d of N rows, so that few
codes are seen at all, a density of q²/12·d²/N: the mean of all rows is then off by (q/√12)·d/N.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..least_count import SPREAD_SHARE, SPREAD_VARIANCE, find_least_count
from .row_noise import RowNoise

Array = np.ndarray
DECIBEL = np.log(10) / 20
FIRST = 64
"""Rows that are the begin of a log."""


@dataclass(frozen=True)
class RowRounding:
    """Steps q of the columns that hold an envelope, by role, in the log's unit scaled to the
    signals'; 0 where values lie on no lattice."""

    steps: dict[str, float]
    decibel: bool = False
    phase_factor: float = 1.0

    @classmethod
    def of_columns(
        cls, columns: dict[str, Array], decibel: bool = False, phase_factor: float = 1.0
    ) -> RowRounding:
        """The lattices of some rows' columns, each (n,), by role."""
        found = {role: find_least_count([values]) for role, values in columns.items()}
        return cls(found, decibel, phase_factor)

    def find_steps(self, size: Array | float, channel: int = 0) -> Array:
        """Steps (..., 2) along a phasor of these lengths (...,) and across it, in their unit."""
        step, size = self.steps.get, np.asarray(size, float)
        if "amplitude" in self.steps:
            along = self.steps["amplitude"] * (DECIBEL * size if self.decibel else 1.0 + 0 * size)
            across = size * abs(self.phase_factor) * step("phase", 0.0)
            return (channel == 0) * np.stack([along, across], axis=-1)
        parts = (f"{'cs'[channel]}_{part}" for part in ("in_phase", "quadrature"))
        return np.full((*size.shape, 2), max(step(part, 0.0) for part in parts))

    def hold(self, density: Array, size: Array, channel: int) -> Array:
        """Density (n, 2) along and across phasors of these lengths (n,), of one (2,) for all, no
        less than the lattice's where the noise does not spread its codes."""
        steps = self.find_steps(size, channel)
        spread = density >= SPREAD_VARIANCE * steps**2
        return np.where(spread, density, np.maximum(density, steps**2 / 12))

    def count_codes(self, look: Array) -> Array:
        """Codes (channel, 2) that a row is away from the one before it, on average, along the
        phasors and across; envelopes (channel, n)."""
        size = np.abs(look)
        if "amplitude" in self.steps:
            turned = np.abs(np.angle(look[:, 1:] * np.conj(look[:, :-1]))) * size[:, 1:]
            moved = np.stack([np.abs(np.diff(size, axis=1)), turned], axis=1)
        else:
            change = np.diff(look, axis=1)
            moved = np.stack([np.abs(change.real) + np.abs(change.imag)] * 2, axis=1) / 2
        steps = np.stack([self.find_steps(np.nanmedian(size[k]), k) for k in range(2)])
        mean = np.nanmean(np.where(np.isfinite(moved), moved, np.nan), axis=-1)
        return np.divide(mean, steps, out=np.full((2, 2), np.inf), where=steps > 0)

    def makes_most(self, noise: RowNoise, start: Array) -> bool:
        """Whether the first of some envelopes (channel, n) scatter by a rounding that noise, as all
        show it, does not spread: a phase written to 0.1° errs by more where the amplitude is
        larger."""
        first = np.abs(start[:, :FIRST])
        steps = [self.find_steps(np.nanmax(size), k) for k, size in enumerate(first)]
        return bool(np.sum(np.square(steps)) / 12 > SPREAD_SHARE * noise.variance.sum())


@dataclass(frozen=True)
class Rounded:
    """The noise of rows with what rounding adds, the largest step among them in the signals' unit
    (0: there is none), and the part of the usual row's variance that rounding makes."""

    noise: RowNoise
    least_count: float = 0.0
    share: float = 0.0


def hold_rounding(noise: RowNoise, looks: Sequence[Array], rounding: RowRounding | None) -> Rounded:
    """Noise that is no smaller than what rounding to the rows' lattices leaves unknown.

    Parameters
    ----------
    noise
        By the rows' scatter.
    looks
        The rows, (channel, n) of the signals' unit.
    rounding
        Their lattices; None: nothing is known of them.

    Returns
    -------
    Rounded
        With σ² of at least q²/12 where the scatter is below `SPREAD_VARIANCE`.

    Examples
    --------
    A slow phasor written with three decimals and hardly any noise:

    >>> import numpy as np
    >>> from hrg_cli.formats.row_noise import RowNoise
    >>> from hrg_cli.formats.row_rounding import RowRounding, hold_rounding
    >>> u = np.round(np.exp(1e-3j * np.arange(2000)).view(float), 3).view(complex)
    >>> parts = {"c_in_phase": u.real, "c_quadrature": u.imag}
    >>> quiet = RowNoise(np.full((2, 2), 1e-10), np.full((2, 2), 1e-10), True)
    >>> held = hold_rounding(quiet, [np.stack([u, 0 * u])], RowRounding.of_columns(parts))
    >>> round(held.least_count, 9), round(float(np.sqrt(12 * held.noise.variance[0, 0])), 6)
    (0.001, 0.001)
    """
    if rounding is None:
        return Rounded(noise)
    size = np.concatenate([np.abs(look) for look in looks], axis=1)
    steps, most = (
        np.stack([rounding.find_steps(part(size[k]), k) for k in range(2)])
        for part in (np.nanmedian, np.nanmax)
    )
    if not steps.max() > 0:
        return Rounded(noise)
    codes = np.mean([rounding.count_codes(look) for look in looks if look.shape[1] > 1], axis=0)
    rows = sum(look.shape[1] for look in looks)
    lasting = 1 / np.clip(codes, 1 / rows, 1.0)
    coarse, least = noise.variance < SPREAD_VARIANCE * steps**2, steps**2 / 12
    slow = least * np.maximum(1.0, lasting**2 / rows)
    held = replace(
        noise,
        variance=np.where(coarse, np.maximum(noise.variance, least), noise.variance),
        density=np.where(coarse, np.maximum(noise.density, slow), noise.density),
    )
    share = float(least.sum() / held.variance.sum())
    return Rounded(held, float(most.max()), min(1.0, share))
