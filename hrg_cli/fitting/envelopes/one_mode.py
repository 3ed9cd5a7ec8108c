"""One mode seen in one channel, whose decay and frequency may follow its amplitude: z = a e^{jφ}.

    −(ln a)' = ν + f/a + ν₁ a + ν₂ a²
    (dry friction f, drag ∝ speed² ν₁, and damping ∝ a² ν₂ beside the viscous ν)
    φ'       = δ + κ a² + κ₄ a⁴            a pendulum's own law: κ = −ω/16
Both are linear in their coefficients once integrated along the measured amplitude from the run's
first row, so there is no start to guess; terms are taken in one by one as long as χ² asks for them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ..least_squares import invert_scaled
from .envelope_runs import EnvelopeRun
from .trapezium import integrate

Array = np.ndarray
DECAY_POWERS = {"viscous_1_s": 0, "dry": -1, "per_amplitude": 1, "per_amplitude2": 2}
FREQUENCY_POWERS = {"zero_amplitude_rad_s": 0, "per_amplitude2_rad_s": 2, "per_amplitude4_rad_s": 4}
GAIN = 30.0
"""Fall of χ², in units of χ² per degree of freedom, for which a further term is taken in."""
CLEAR = 6.0
"""Amplitude over its noise below which a row's logarithm and phase are no longer Gaussian."""
FEWEST_ROWS = 4
"""Such rows that a decay is found from at least."""
SMOOTH_ROWS = 25
"""Rows whose mean says how large the amplitude is about one of them."""


@dataclass(frozen=True)
class Law:
    """Coefficients by name with standard deviations, powers of the amplitude they go with, their
    covariance, and what is left."""

    names: tuple[str, ...]
    value: Array
    covariance: Array
    chi2: float
    dof: int
    residual: Array

    def find_coefficient(self, name: str) -> tuple[float, float]:
        """(value, standard deviation) of a coefficient; zeros where the term is not taken in."""
        if name not in self.names:
            return 0.0, 0.0
        i = self.names.index(name)
        return float(self.value[i]), float(np.sqrt(self.covariance[i, i]))


NO_LAW = Law((), np.zeros(0), np.zeros((0, 0)), 0.0, 0, np.zeros(0))
"""The law of what was not measured."""


@dataclass(frozen=True)
class OneMode:
    """The two laws of one mode, of ln a and of φ, and the rows (n,) they were fitted to; χ² a
    degree of freedom of both."""

    decay: Law
    frequency: Law
    rows: Array

    @property
    def chi2(self) -> float:
        """Σ of both laws' squared misfits over the stated noise."""
        return self.decay.chi2 + self.frequency.chi2

    @property
    def dof(self) -> int:
        """Degrees of freedom of both."""
        return self.decay.dof + self.frequency.dof


def identify(run: EnvelopeRun, z: Array, nonlinear: bool = True) -> OneMode:
    """The laws of one mode from its envelope: how it decays, and how its frequency follows its
    amplitude.

    −(ln a)' = ν + f/a + ν₁a + ν₂a² and φ' = δ + κa² + κ₄a⁴, each term beside the first only where
    χ² asks for it.

    Parameters
    ----------
    run
        Times and σ of the rows.
    z
        Envelope (n,) in any unit; rows lost in noise are left out.
    nonlinear
        False: ν and δ alone.

    Returns
    -------
    OneMode
        ν and f in 1/s and unit/s, δ in rad/s; a run without phases has no law of its frequency,
        `NO_LAW`.

    Raises
    ------
    HrgError
        Fewer than four windows stand clear of the noise.

    Examples
    --------
    A pendulum without friction but for the air's, whose frequency falls with the square of the
    swing:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.one_mode import identify
    >>> t = np.linspace(0.0, 20.0, 401)
    >>> z = np.exp(-0.1 * t - 0.5j * (1 - np.exp(-0.2 * t)) / 0.2)
    >>> u = np.stack([z, 0 * z], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-3, 0 * t, None, 5e3, 2, 0.05)
    >>> found = identify(run, z)
    >>> found.decay.names, round(found.decay.find_coefficient("viscous_1_s")[0], 6)
    (('viscous_1_s',), 0.1)
    >>> round(found.frequency.find_coefficient("per_amplitude2_rad_s")[0], 3)
    -0.5
    """
    a = np.abs(z)
    level = _smooth_level(a, run.std)
    clear = level > CLEAR * run.std
    # a run-down that has sunk into its noise does not rise again: all rows before the first that is
    # not clear; where these are few, every clear one
    last = len(a) if clear.all() else int(np.argmin(clear)) if clear[0] else 0
    rows = np.arange(last) if last >= max(8, len(a) // 4) else np.flatnonzero(clear)
    if len(rows) < FEWEST_ROWS:
        raise HrgError(
            f"{run.run_id or 'the run'}: in {len(rows)} of {len(a)} windows the amplitude is above"
            f" {CLEAR:g} standard deviations of its noise, at least {FEWEST_ROWS} were expected;"
            " average over longer windows"
        )
    t, a, std = run.time_s[rows], a[rows], run.std[rows]
    phase = np.unwrap(np.angle(z[rows]))
    # ln a and φ of a row both have the standard deviation σ/a
    weight = level[rows] / std
    decay = _law(-np.log(a), t, a, weight, DECAY_POWERS, nonlinear)
    frequency = (
        _law(phase, t, a, weight, FREQUENCY_POWERS, nonlinear) if run.phase_known else NO_LAW
    )
    return OneMode(decay, frequency, rows)


def _smooth_level(a: Array, std: Array) -> Array:
    """The amplitude about each row by its neighbours' mean square, noise taken off, (n,).

    It chooses and weighs the rows: by their own amplitude those count more which noise has made
    larger, 2σ²/a² in ln a, and a decay seems slower by a whole standard deviation.
    """
    width = min(SMOOTH_ROWS, len(a) // 20) | 1
    padded = np.pad(a**2 - 2 * std**2, width // 2, mode="reflect")
    power = np.convolve(padded, np.full(width, 1 / width), mode="valid")
    return np.sqrt(np.maximum(power, 0.0))


def measure_misfit(run: EnvelopeRun, z: Array, rows: slice) -> tuple[Array, Array]:
    """Squared misfit, on every row, of what the laws of some rows foretell.

    Parameters
    ----------
    run
        Times and σ (n,).
    z
        Envelope (n,).
    rows
        Those that the laws are fitted to.

    Returns
    -------
    tuple of ndarray
        (n,) over the noise, and (n,) over the squared amplitude.

    Examples
    --------
    A blow that halves the amplitude after 10 s is not foretold by what came before:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.one_mode import measure_misfit
    >>> t = np.linspace(0.0, 20.0, 401)
    >>> z = np.exp(-0.1 * t) * np.where(t > 10.0, 0.5, 1.0) + 0j
    >>> u = np.stack([z, 0 * z], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-3, 0 * t, None, 5e3, 2, 0.05)
    >>> _, relative = measure_misfit(run, z, slice(0, 200))
    >>> bool(relative[199] < 1e-6), round(float(relative[-1]), 2)  # ln² 2
    (True, 0.48)
    """
    found = identify(run.select_rows(rows), z[rows])
    a = np.maximum(np.abs(z), run.std)
    inside = np.arange(len(z))[rows][found.rows]
    left = []
    for law, target, powers in (
        (found.decay, -np.log(a), DECAY_POWERS),
        (found.frequency, np.unwrap(np.angle(z)), FREQUENCY_POWERS),
    ):
        model = sum(
            value * integrate(a ** powers[name], run.time_s)
            for name, value in zip(law.names, law.value, strict=True)
        )
        # the law's free constant, as the rows that it was fitted to have it
        apart = target - model
        left.append(apart - np.average(apart[inside], weights=(a / run.std)[inside] ** 2))
    larger = a * np.exp(
        np.clip(left[0], 0.0, 50.0)
    )  # the foretold amplitude where it is above the measured one
    lost = a < 3 * run.std
    relative = np.minimum(left[0] ** 2 + np.where(lost, 0.0, left[1] ** 2), 4.0)
    return relative * (larger / run.std) ** 2 / 2, relative


def _law(
    target: Array, time_s: Array, a: Array, weight: Array, powers: dict[str, int], nonlinear: bool
) -> Law:
    """Forward selection of terms: the first always, then the one that lowers χ² most, as long as it
    does by `GAIN` of its unit."""
    columns = {name: integrate(a**power, time_s) for name, power in powers.items()}
    names = [next(iter(powers))]
    best = _fit(target, [columns[n] for n in names], weight, names)
    while nonlinear and len(names) < len(powers):
        trials = [
            _fit(target, [columns[n] for n in (*names, extra)], weight, [*names, extra])
            for extra in powers
            if extra not in names
        ]
        law = min(trials, key=lambda trial: trial.chi2)
        if best.chi2 - law.chi2 < GAIN * max(1.0, law.chi2 / law.dof):
            break
        best, names = law, list(law.names)
    return best


def _fit(target: Array, columns: list[Array], weight: Array, names: list[str]) -> Law:
    design = np.column_stack([*columns, np.ones(len(target))]) * weight[:, None]
    inverse = invert_scaled(design)
    value = inverse @ (target * weight)
    residual = target * weight - design @ value
    dof = max(1, len(target) - len(value))
    chi2 = float(residual @ residual)
    covariance = inverse @ inverse.T * max(1.0, chi2 / dof)
    k = len(names)
    return Law(tuple(names), value[:k], covariance[:k, :k], chi2, dof, residual)
