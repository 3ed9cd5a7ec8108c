"""Monitoring a driven gyro: the frequency split from the quadrature equation, the damping split
from the phase equation.

Quadrature, seed A (15) with one electrode:

    ȧ_B + λ a_B − νδμ cos χ a_B = a_A (δω_c sin 2mθ − δω_s cos 2mθ),

λ = ν with a force drive, ν + p ≈ 2ν with a ring electrode's parametric drive, which pumps energy
out of the quadrature (PHYSICS M3p): λ is fitted. A loop −k a_B(t − τ) adds k to λ and takes kτ of
ȧ_B off: λ and δω then come out 1/(1 − kτ) too large. Where its force a_ΦB is logged, it stands on
the left with ȧ_B, and δω is free of it.
Phase, seed A (7) solved exactly:   φ̇ = ω̄ + [(1 + r²) δω cos ζ − 2r νδμ sin χ]/(1 − r²).
The second is weak: νδμ enters with 2r, and ω̄ is the *mean* frequency, so every drift of it is read
as damping split (PHYSICS §4 (12)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...physics import ellipse
from ..least_squares import solve
from .envelope_runs import EnvelopeRun
from .equations import differentiate

Array = np.ndarray
BLOCK_ROWS = 8
NAMES = ("damping_rate_of_quadrature_1_s", "split_cos", "split_sin", "damping_cos", "damping_sin")


@dataclass(frozen=True)
class Monitor:
    """Quadrature damping λ with its loop, (δω cos, sin), (νδμ cos, sin): values (5,), covariance
    (5, 5); rms of r, and νδμ read per mHz of frequency drift; λ without a loop that is logged, its
    standard deviation.
    """

    value: Array
    covariance: Array
    quadrature_rms: float
    trap_1_s_per_mhz: float
    own_damping: tuple[float, float]


def monitor(runs: Sequence[EnvelopeRun], pushed: Sequence[Array] | None = None) -> Monitor:
    """The frequency split by the quadrature and the damping split by the phase, over all runs.

    Each run has its own mean frequency and linear drift of it.

    Parameters
    ----------
    runs
        Driven ones.
    pushed
        ∫a_ΦB dt (n,) of every run, where the quadrature's drive is logged.

    Returns
    -------
    Monitor
        λ and the components of both splits, with their covariance.

    Examples
    --------
    A wave held at a_A = 1 that turns by mθ = 0.5t; its quadrature follows ṙ = −λr + δω sin 2mθ
    with λ = 0.2 1/s and δω = 0.01 rad/s, its phase φ̇ = (1 + r²)/(1 − r²) δω cos 2mθ:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.working_mode import monitor
    >>> from hrg_cli.physics.ellipse import compute_envelopes
    >>> t = np.arange(0.0, 100.0, 0.02)
    >>> r = np.imag(0.01 / (0.2 + 1j) * np.exp(1j * t)) + 0.05 * np.exp(-0.2 * t)
    >>> speed = (1 + r**2) / (1 - r**2) * 0.01 * np.cos(t)
    >>> phase = np.append(0.0, np.cumsum(speed[1:] + speed[:-1]) * 0.01)
    >>> u = compute_envelopes(1 + 0 * t, r, 0.25 * t, phase, 2)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-5, 0 * t, None, 5e3, 2, 0.02)
    >>> monitor([run]).value.round(4) + 0
    array([0.2 , 0.01, 0.  , 0.  , 0.  ])
    """
    response = _regression([_quadrature_rows(r, np.zeros(len(r))) for r in runs])
    first = (
        response
        if pushed is None
        else _regression([_quadrature_rows(r, p) for r, p in zip(runs, pushed, strict=True)])
    )
    second = _regression([_phase_rows(r, len(runs), i) for i, r in enumerate(runs)])
    ratios = np.concatenate([_ratio(r) for r in runs])
    rms = float(np.sqrt(np.mean(ratios**2)))
    value, covariance = np.zeros(5), np.zeros((5, 5))
    value[:3], covariance[:3, :3] = first[0][:3], first[1][:3, :3]
    own = float(value[0]), float(np.sqrt(covariance[0, 0]))
    if pushed is not None:
        value[0], covariance[0, :3], covariance[:3, 0] = response[0][0], 0.0, 0.0
        covariance[0, 0] = response[1][0, 0]
    value[3:], covariance[3:, 3:] = second[0][2:4], second[1][2:4, 2:4]
    return Monitor(value, covariance, rms, 2 * np.pi * 1e-3 / max(2 * rms, 1e-300), own)


def _ratio(run: EnvelopeRun) -> Array:
    a, b, _, _ = ellipse.find_wave(run.envelope, 1)
    return b / a


def _quadrature_rows(run: EnvelopeRun, pushed: Array) -> tuple[Array, Array]:
    """Increments of a_B over 8 rows, less what was pushed, against the integrals of −a_B, a_A sin
    2mθ, −a_A cos 2mθ and, for the damping split, a_B cos, a_B sin.
    """
    a, b, angle, phase = ellipse.find_wave(run.envelope, 1)
    angle, _ = ellipse.unwrap(angle, phase, 1)
    c, s = np.cos(2 * angle), np.sin(2 * angle)
    columns = np.stack([-b, a * s, -a * c, b * c, b * s], axis=-1)
    return _increments(columns, b - pushed, run)


def _phase_rows(run: EnvelopeRun, count: int, number: int) -> tuple[Array, Array]:
    """Increments of φ against δω cos, δω sin, νδμ cos, νδμ sin, and this run's mean frequency and
    its drift."""
    a, b, angle, phase = ellipse.find_wave(run.envelope, 1)
    angle, phase = ellipse.unwrap(angle, phase, 1)
    r = b / a
    up, down = (1 + r**2) / (1 - r**2), -2 * r / (1 - r**2)
    c, s = np.cos(2 * angle), np.sin(2 * angle)
    own = np.zeros((len(a), 2 * count))
    own[:, 2 * number] = 1.0
    own[:, 2 * number + 1] = (run.time_s - run.time_s.mean()) / max(run.duration_s, 1e-300)
    columns = np.column_stack([up * c, up * s, down * s, -down * c, own])
    x, y = _increments(columns, phase, run)
    scale = float(a.mean())
    return x * scale, y * scale


def _increments(columns: Array, quantity: Array, run: EnvelopeRun) -> tuple[Array, Array]:
    step = np.diff(run.time_s)[:, None]
    slope = differentiate(columns, run.time_s)
    # the trapezium rule with the slopes at both ends (Euler and Maclaurin), of fourth order
    pieces = (columns[1:] + columns[:-1]) / 2 * step - np.diff(slope, axis=0) * step**2 / 12
    area = np.concatenate([np.zeros((1, columns.shape[1])), np.cumsum(pieces, axis=0)])
    picked = np.arange(0, len(quantity), BLOCK_ROWS)
    weight = 1 / run.std[picked[1:]]
    return np.diff(area[picked], axis=0) * weight[:, None], np.diff(quantity[picked]) * weight


def _regression(parts: Sequence[tuple[Array, Array]]) -> tuple[Array, Array]:
    x, y = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    value, covariance = solve(x, y, 1e-10)
    # the weights hold the envelopes' noise alone; what the loops do beside it shows in the scatter
    residual = y - x @ value
    return value, covariance * float(residual @ residual) / max(1, len(y) - len(value))


STRAIGHT = 0.25
"""Turn of mθ to either side of a crossing over which sin ζ is as good as straight: its cube is left
out alike on both sides."""


def find_stiffness_axes(
    runs: Sequence[EnvelopeRun], mode_number: int, quadrature_damping_1_s: float = np.inf
) -> list[tuple[float, float]]:
    """The stiffness axis at every sign change of a_B as the wave passes it slowly.

    The quadrature follows a_B = (δω/λ) a_A sin(2mθ − 2mθ_ω) (seed A, remark 2) through
    ṙ = −λr + δω sin ζ, so while the wave turns evenly it stands arctan(2mθ'/λ) of ζ behind: given
    λ, that is taken off. Rising with θ is θ_ω, falling θ_ω + π/2m; + to − and − to + alike.

    Parameters
    ----------
    runs
        Driven ones.
    mode_number
        m.
    quadrature_damping_1_s
        λ; infinite: the lag is left in.

    Returns
    -------
    list of tuple of float
        (θ_ω [rad] in [0, π/m), its standard deviation) of each crossing clear of the noise.

    Examples
    --------
    An axis at θ = 0.3 rad, m = 2, passed four times by a wave that the quadrature follows at once:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.working_mode import find_stiffness_axes
    >>> from hrg_cli.physics.ellipse import compute_envelopes
    >>> t = np.arange(0.0, 120.0, 0.05)
    >>> angle = 0.025 * t
    >>> u = compute_envelopes(1 + 0 * t, 0.01 * np.sin(4 * (angle - 0.3)), angle, 0 * t, 2)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-5, 0 * t, None, 5e3, 2, 0.05)
    >>> [round(axis, 3) for axis, _ in find_stiffness_axes([run], 2)]
    [0.3, 0.3, 0.3, 0.3]
    """
    out = []
    for run in runs:
        a, b, angle, phase = ellipse.find_wave(run.envelope, 1)
        angle, _ = ellipse.unwrap(angle, phase, 1)
        ratio = b / a
        speed = differentiate(angle, run.time_s)
        step = np.median(np.abs(speed)) * np.median(np.diff(run.time_s))
        width = max(3, min(len(ratio) // 40, int(STRAIGHT / 2 / max(step, 1e-12))))
        half = width // 2
        for i in (
            np.flatnonzero(
                np.diff(np.sign(np.convolve(ratio, np.ones(width) / width, "valid"))) != 0
            )
            + half
        ):
            rows = slice(max(0, i - 2 * width), i + 2 * width)
            x, y = angle[rows] - angle[i], ratio[rows]
            if np.ptp(x) < 1e-6:
                continue
            fit, covariance = np.polyfit(x, y, 1, cov="unscaled")
            noise = float((run.std[rows] / a[rows]).mean())
            if abs(fit[0]) < 5 * noise * np.sqrt(covariance[0, 0]):
                continue
            lag = float(np.arctan(2 * speed[rows].mean() / quadrature_damping_1_s)) / 2
            axis = (angle[i] - fit[1] / fit[0] - lag) / mode_number
            axis -= 0.0 if fit[0] > 0 else np.pi / (2 * mode_number)
            std = noise * np.sqrt(covariance[1, 1]) / abs(fit[0]) / mode_number
            out.append((float(np.mod(axis, np.pi / mode_number)), float(std)))
    return out


def combine_axes(
    crossings: Sequence[tuple[float, float]], mode_number: int
) -> dict[str, float] | None:
    """One axis from all crossings.

    It is the mean on the circle of 2mθ weighted by inverse variance; its deviation holds the
    crossings' scatter whole, which is the same at every turn of the wave: the quadrature's damping
    itself moves with the angle by the damping split.

    Parameters
    ----------
    crossings
        (axis, standard deviation) of each [rad].
    mode_number
        m.

    Returns
    -------
    dict or None
        `value` [rad] in [0, π/m), `std`, the number of `crossings` and `chi2_per_dof`; None without
        a crossing.

    Examples
    --------
    Two on either side of 0, which is π/2 as well for m = 2:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.working_mode import combine_axes
    >>> found = combine_axes([(0.02, 0.01), (np.pi / 2 - 0.01, 0.01)], 2)
    >>> round(found["value"], 9), round(found["chi2_per_dof"], 6)
    (0.005, 4.5)
    """
    if not crossings:
        return None
    axes, stds = np.array(crossings).T
    weight = 1 / np.maximum(stds, 1e-12) ** 2
    # axes that differ by π/m are one: 2mθ is averaged, as a direction
    m2 = 2 * mode_number
    axis = float(np.angle(np.sum(weight * np.exp(1j * m2 * axes)))) / m2
    off = np.angle(np.exp(1j * m2 * (axes - axis))) / m2
    chi2 = float(np.sum(weight * off**2) / max(len(axes) - 1, 1))
    std = float(np.sqrt(1 / np.sum(weight) + np.sum(weight * off**2) / np.sum(weight)))
    return {
        "value": float(np.mod(axis, 2 * np.pi / m2)),
        "std": std,
        "crossings": len(axes),
        "chi2_per_dof": chi2,
    }
