"""Noise that physics asks for: the Brownian force of a damped resonator, and electronic noise with
a 1/f corner about the resonance.

Brownian force (fluctuation–dissipation): the acceleration of z'' = −2N z' − … is white with
two-sided density 4(k_B T/M)N, so that each mode keeps ½M⟨v²⟩ = ½k_B T; a force of density 4k_B TνM
(PHYSICS M18). In the envelopes it turns the wave, whatever the loops do:
    angle random walk = √(2νk_B T/M)/(ωaK),   rad/√s of input angle.
Electronic noise near the resonance has the one-sided density S₀(1 + f_c/|f − f₀|): each quadrature
of the demodulated signal has 2S₀(1 + f_c/f).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .resonator import Mechanics

Array = np.ndarray
BOLTZMANN_J_K = 1.380649e-23
_OCTAVE = float(np.log(2.0))
_ABOVE_CORNER, _BELOW_RUN = 10.0, 0.1
"""How far beyond the corner and below the run's own frequency the 1/f law is drawn."""
_KNOTS_A_TIME = 4.0


@dataclass(frozen=True)
class Noise:
    """What is noisy: resonator (k_B T/M in displacement units²/s²), read-out (σ a sample, corner),
    drive (density, corner)."""

    thermal_velocity2: float = 0.0
    """k_B T/M, (displacement unit/s)²."""
    readout: float = 0.0
    """Standard deviation of one recorded sample."""
    readout_corner_hz: float = 0.0
    drive_density: float = 0.0
    """One-sided density of the drive's envelope force, amplitude/s/√Hz a channel and quadrature."""
    drive_corner_hz: float = 0.0

    @property
    def silent(self) -> bool:
        """Whether nothing here is for the engine: the plain white noise of the read-out is added
        after it."""
        return not (
            self.thermal_velocity2 or self.readout_corner_hz * self.readout or self.drive_density
        )


def compute_thermal_velocity2(
    temperature_k: float, mass_kg: float, metres_per_unit: float = 1.0
) -> float:
    """k_B T/M, the mean square of a mode's velocity in one direction.

    Parameters
    ----------
    temperature_k
        T [K].
    mass_kg
        Effective mass M of the mode [kg].
    metres_per_unit
        One unit of displacement [m].

    Returns
    -------
    float
        In (displacement unit/s)².

    Examples
    --------
    >>> from hrg_cli.physics.noise import compute_thermal_velocity2
    >>> f"{compute_thermal_velocity2(300.0, 1e-3):.3e}"
    '4.142e-18'
    """
    return BOLTZMANN_J_K * temperature_k / (mass_kg * metres_per_unit**2)


def compute_thermal_kicks(mechanics: Mechanics, noise: Noise, h: float) -> Array:
    """R with R·(two standard normals) the change of the velocity in one step.

    R Rᵀ = 2(k_B T/M)(e^{2Nh} − 1) ≈ 4(k_B T/M) N h. The exponential keeps the energy exact at any
    step: what a kick adds before the samples' next look decays by e^{−2Nh} between two (PHYSICS
    M18).

    Parameters
    ----------
    mechanics
        The resonator, whose damping N it is.
    noise
        Its k_B T/M.
    h
        The step [s].

    Returns
    -------
    ndarray
        (2, 2), displacement unit/s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.noise import Noise, compute_thermal_kicks
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> R = compute_thermal_kicks(Mechanics(1000.0, 0.5), Noise(thermal_velocity2=1.0), 1e-4)
    >>> np.round(np.diag(R @ R.T), 7).tolist()
    [0.0002, 0.0002]
    """
    value, vector = np.linalg.eigh(mechanics.build_damping_matrix())
    return np.asarray(
        vector * np.sqrt(2 * noise.thermal_velocity2 * np.expm1(2 * np.maximum(value, 0.0) * h))
    )


def compute_angle_random_walk(mechanics: Mechanics, noise: Noise, amplitude: float) -> float:
    """Angle random walk of the input angle by Brownian force and white drive noise.

    d⟨(mθ)²⟩/dt = 2ν(k_B T/M)/(ωa)² + S_d/2a², S_d the one-sided density of the drive's force along
    the quadrature wave; over K it is that of the input angle (PHYSICS M18).

    Parameters
    ----------
    mechanics
        The resonator.
    noise
        Its k_B T/M and the drive's density.
    amplitude
        a, in displacement units.

    Returns
    -------
    float
        rad/√s.

    Examples
    --------
    >>> from hrg_cli.physics.noise import Noise, compute_angle_random_walk
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(1000.0, 0.5, scale_factor=0.5)
    >>> round(compute_angle_random_walk(gyro, Noise(drive_density=1e-4), 1.0), 8)
    0.00014142
    """
    thermal = (
        2
        * mechanics.damping_rate_1_s
        * noise.thermal_velocity2
        / (mechanics.omega_rad_s * amplitude) ** 2
    )
    return float(
        np.sqrt(thermal + noise.drive_density**2 / (2 * amplitude**2)) / mechanics.scale_factor
    )


class Flicker:
    """Real series (n, channels) of one-sided density h/f each, on knots of a spacing, drawn in
    order.

    A sum of first-order processes with time constants an octave apart and equal variances h·ln 2
    (van der Ziel).
    """

    def __init__(
        self, h: Array, corner_hz: float, duration_s: float, random: np.random.Generator
    ) -> None:
        slowest, fastest = _BELOW_RUN / max(duration_s, 1 / corner_hz), _ABOVE_CORNER * corner_hz
        self._tau = 1 / (
            2 * np.pi * slowest * 2.0 ** np.arange(int(np.ceil(np.log2(fastest / slowest))) + 1)
        )
        self._std = np.sqrt(np.asarray(h, float) * _OCTAVE)
        self._random = random
        self._state = random.standard_normal((len(self._tau), len(self._std)))

    def choose_knot_s(self) -> float:
        """Spacing of knots that draws the fastest process."""
        return float(self._tau[-1] / _KNOTS_A_TIME)

    def draw(self, count: int, spacing_s: float) -> Array:
        """The next `count` values, `spacing_s` apart, (count, channels)."""
        # Exact first-order processes at any spacing: x(t+s) = e^{−s/τ}x(t) + √(1 −
        # e^{−2s/τ})·normal.
        keep = np.exp(-spacing_s / self._tau)[:, None]
        fresh = np.sqrt(1 - keep**2)
        out = np.empty((count, len(self._std)))
        for k in range(count):
            out[k] = self._state.sum(axis=0)
            self._state = keep * self._state + fresh * self._random.standard_normal(
                self._state.shape
            )
        return np.asarray(out * self._std)


class FlickerSeries:
    """`Flicker` on knots at multiples of `stride` steps, handed out for ranges of steps that follow
    each other."""

    def __init__(self, source: Flicker, h: float) -> None:
        self.stride = max(1, int(source.choose_knot_s() / h))
        self._source, self._h = source, h
        self._knots = np.zeros((0, 0))
        self._first = 0

    def draw_over(self, first: int, steps: int) -> tuple[Array, int]:
        """Knots (k, channels) that enclose steps first … first + steps, and the step of the first
        of them."""
        begin, end = first // self.stride, (first + steps) // self.stride + 2
        fresh = end - self._first - len(self._knots)
        drawn = self._source.draw(fresh, self.stride * self._h)
        self._knots = (
            np.concatenate([self._knots, drawn])[begin - self._first :]
            if len(self._knots)
            else drawn
        )
        self._first = begin
        return self._knots[: end - begin], begin * self.stride
