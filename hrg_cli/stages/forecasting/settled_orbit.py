"""The motion of a driven wave at a constant rate once its quadrature has settled: one closed orbit.

At a constant rate nothing but the wave angle tells the moments apart. The quadrature settles, at
rest or in a turning wave, on a curve r(θ) of period π/m, with dr/dθ · dθ/dt = dr/dt, and leaves
θ alone to follow: dθ/dt = w(θ). Where w has no zero the wave turns by π/m in one and the same time
again and again, and any number of turns is one division; where it has, the wave comes to rest.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from ...fourier import build_harmonic_basis
from ...physics import drift as law
from ...physics.resonator import Mechanics

Array = np.ndarray
HARMONICS = (16, 32, 64, 128)
"""Of the Fourier series in 2mθ, as many as are needed."""
RESOLVED = 1e-11
"""Upper quarter of a series' coefficients against the largest from which it has enough of them."""
NEWTON_STEPS = 12
SETTLED = 1e-12
"""Of r, at which these end."""
NUDGE = 1e-5
"""Of r for its derivatives, by differences to both sides: their error is its square."""
TOLERANCE = 1e-10
"""Of a wave on its way to rest, against its travel."""


@dataclass(frozen=True)
class SettledOrbit:
    """One gyro's orbit: Fourier coefficients in 2mθ, (1 + 2K,) each, of r, of w [rad/s], and of 1/w
    [s/rad] where the wave turns on and on (else None); and the slowest rate at which a quadrature
    beside it settles on it."""

    mode_number: int
    settling_1_s: float
    ratio: Array
    speed: Array
    slowness: Array | None

    @property
    def largest_ratio(self) -> float:
        """Of |r| over the orbit."""
        return float(np.abs(self._evaluate(self.ratio, _list_nodes(self.mode_number, 128))).max())

    def find_ratio(self, angle: Array) -> Array:
        """r on the orbit.

        Parameters
        ----------
        angle
            θ [rad], (n,).

        Returns
        -------
        ndarray
            (n,).

        Examples
        --------
        >>> import numpy as np
        >>> from hrg_cli.stages.forecasting.settled_orbit import SettledOrbit
        >>> orbit = SettledOrbit(2, 1.0, np.array([0.0, 0.1, 0.0]), np.zeros(3), None)
        >>> orbit.find_ratio(np.array([0.0, np.pi / 4])).round(9).tolist()
        [0.1, -0.1]
        """
        return self._evaluate(self.ratio, angle)

    def follow(self, start: Array, times: Array) -> Array:
        """The wave angle after some times.

        Parameters
        ----------
        start
            θ(0) [rad], (n,), with the quadrature of the orbit.
        times
            [s], (t,), rising from above 0.

        Returns
        -------
        ndarray
            θ [rad], (t, n).

        Examples
        --------
        A wave that turns evenly by 0.1 rad/s, for eleven days:

        >>> import numpy as np
        >>> from hrg_cli.stages.forecasting.settled_orbit import SettledOrbit
        >>> speed, slowness = np.array([0.1, 0, 0]), np.array([10.0, 0, 0])
        >>> even = SettledOrbit(2, 1.0, np.zeros(3), speed, slowness)
        >>> even.follow(np.array([0.5]), np.array([1e6])).round(6).tolist()
        [[100000.5]]
        """
        if self.slowness is None:
            return self._come_to_rest(start, times)
        mean, period = self.slowness[0], np.pi / self.mode_number
        even = _integrate(self.slowness / mean, self.mode_number)

        def pass_time(angle: Array) -> Array:  # in the mean turn's angle
            return np.asarray(angle + self._evaluate(even, angle))

        wanted = pass_time(start) + times[:, None] / mean
        grid = np.linspace(0.0, period, 4 * len(even) + 1)
        passed = pass_time(grid)
        turns = np.floor((wanted - passed[0]) / period)
        angle = np.interp(wanted - turns * period, passed, grid)
        for _ in range(NEWTON_STEPS):
            slope = self._evaluate(self.slowness / mean, angle)
            angle = angle - (pass_time(angle) - (wanted - turns * period)) / slope
        return np.asarray(angle + turns * period)

    def _come_to_rest(self, start: Array, times: Array) -> Array:
        """The steps grow without end as the wave comes to rest."""
        travel = float(np.abs(self.speed).sum() * times[0])
        found = solve_ivp(
            lambda _, moved: self._evaluate(self.speed, start + moved),
            (0.0, float(times[-1])), np.zeros(len(start)), "LSODA", times,
            rtol=TOLERANCE, atol=max(TOLERANCE * travel, 1e-15), lband=0, uband=0,
        )  # fmt: skip
        return np.asarray(start + found.y.T)

    def _evaluate(self, coefficients: Array, angle: Array) -> Array:
        basis = build_harmonic_basis(np.ravel(angle), len(coefficients) // 2, self.mode_number)
        return np.asarray(basis @ coefficients).reshape(np.shape(angle))


def find_orbits(
    gyros: Mechanics, rate_rad_s: float, drive: str, quadrature_gain_1_s: float
) -> list[SettledOrbit] | None:
    """The orbit of every gyro.

    Parameters
    ----------
    gyros
        The resonator (1 + 2k, 1) with its spread, as `spread_points` has it.
    rate_rad_s
        Ω, constant.
    drive
        "force" or "parametric".
    quadrature_gain_1_s
        k_q of the quadrature loop.

    Returns
    -------
    list of SettledOrbit or None
        None where one of them has none that a Fourier series tells: nothing settles.

    Examples
    --------
    At rest r = δω sin ζ/ν:

    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.forecasting.settled_orbit import find_orbits
    >>> gyro = Mechanics(1000.0, 0.2, frequency_split_rad_s=0.001)
    >>> (orbit,) = find_orbits(gyro, 0.0, "force", 0.0)
    >>> round(float(orbit.find_ratio(np.array([np.pi / 8]))[0]), 6), orbit.slowness is None
    (0.005, True)
    """
    values = {name: value for name, value in vars(gyros).items() if name != "mode_number"}
    rows = np.stack([np.ravel(v) for v in np.broadcast_arrays(*values.values())], axis=-1)
    found = []
    for row in rows:
        own: dict[str, Any] = dict(zip(values, map(float, row), strict=True))
        gyro = replace(gyros, **own)
        orbit = _find_orbit(gyro, rate_rad_s, drive, quadrature_gain_1_s)
        if orbit is None:
            return None
        found.append(orbit)
    return found


def _find_orbit(gyro: Mechanics, rate: float, drive: str, gain: float) -> SettledOrbit | None:
    """With as many harmonics as suffice."""
    m = gyro.mode_number
    turning = gyro.scale_factor * rate
    for harmonics in HARMONICS:
        nodes = _list_nodes(m, harmonics)
        basis = build_harmonic_basis(nodes, harmonics, m)
        ratio, settling = _settle(gyro, nodes, basis, turning, (drive, gain))
        if not settling > 0:
            return None
        if not _is_resolved(ratio):
            continue
        speed = (law.compute_drift(gyro, nodes, basis @ ratio) - turning) / m
        turns = bool(np.all(speed > 0) or np.all(speed < 0))
        slowness = np.linalg.solve(basis, 1 / speed) if turns else None
        if slowness is None or _is_resolved(slowness):
            return SettledOrbit(m, settling, ratio, np.linalg.solve(basis, speed), slowness)
    return None


def _settle(
    gyro: Mechanics, nodes: Array, basis: Array, turning: float, how: tuple[str, float]
) -> tuple[Array, float]:
    """The coefficients of r(θ) with w·dr/dθ = dr/dt at the nodes, by Newton's steps, and the
    slowest rate at which r returns to it; that is 0 where there is no such curve."""
    slopes = _differentiate(basis, gyro.mode_number)

    def move(r: Array) -> tuple[Array, Array]:
        speed = (law.compute_drift(gyro, nodes, r) - turning) / gyro.mode_number
        return speed, law.compute_quadrature_rate(gyro, nodes, r, *how)

    found = np.zeros(len(nodes))
    for _ in range(NEWTON_STEPS):
        r, along = basis @ found, slopes @ found
        (speed, growth), (up, faster), (down, slower) = map(move, (r, r + NUDGE, r - NUDGE))
        back = (along * (up - down) - (faster - slower)) / (2 * NUDGE)
        step = np.linalg.solve(
            speed[:, None] * slopes + back[:, None] * basis, growth - speed * along
        )
        found = found + step
        if not np.max(np.abs(basis @ found)) < 1:
            break
        if np.max(np.abs(step)) < SETTLED:
            return found, float(back.min())
    return found, 0.0


def _list_nodes(mode_number: int, harmonics: int) -> Array:
    """As many wave angles over π/m as a series has coefficients."""
    count = 1 + 2 * harmonics
    return np.arange(count) * np.pi / mode_number / count


def _differentiate(basis: Array, mode_number: int) -> Array:
    """The basis along θ, from 1, cos 2mθ, sin 2mθ and so on."""
    out = np.zeros_like(basis)
    wave_number = 2 * mode_number * np.arange(1, 1 + basis.shape[1] // 2)
    out[:, 1::2], out[:, 2::2] = -wave_number * basis[:, 2::2], wave_number * basis[:, 1::2]
    return out


def _integrate(coefficients: Array, mode_number: int) -> Array:
    """The periodic part of the integral over θ, as coefficients of the same series."""
    out = np.zeros_like(coefficients)
    wave_number = 2 * mode_number * np.arange(1, 1 + len(coefficients) // 2)
    out[1::2], out[2::2] = -coefficients[2::2] / wave_number, coefficients[1::2] / wave_number
    return out


def _is_resolved(coefficients: Array) -> bool:
    upper = np.abs(coefficients[-(len(coefficients) // 4) :]).max()
    return bool(upper <= RESOLVED * np.abs(coefficients).max() + 1e-14)
