"""The identification methods of seed A as linear equations of one run, each by its physical name.

All are linear in the coordinates of `coordinates.py`. The published forms are corrected where
PHYSICS §4 shows an error: 1/π and a full turn in the rotation integrals, the true rate in fixed
axes (the elimination KΩ := −mθ̇ deletes half of the damping split and is an option), e^{+jωt}
throughout. Derivatives are central differences, each row for itself, as published; `increments` and
`stokes` integrate the right-hand side along the run instead, with a free first value, and so weigh
the rows as their noise asks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...physics import ellipse
from .envelope_runs import EnvelopeRun
from .equations import (
    Equations,
    build_ellipse,
    differentiate,
    find_gap_rows,
    find_table_rate,
    integrate_equations,
    join_equations,
    make_equations,
)

Array = np.ndarray


GROUP = 0.1
"""|sin Δφ| or |cos Δφ| up to which a row belongs to a group of seed A's second remark."""


def build_moving_axes(
    run: EnvelopeRun, eliminate_rate: bool = False, small: bool = False, frozen: bool = False
) -> Equations:
    """Seed A (15): amplitudes of the main and the quadrature wave, and K from mθ̇ = −KΩ + D.

    With ζ = 2mθ − 2mθ_ω, χ = 2mθ − 2mθ_μ and r = a_B/a_A:
    ȧ_A = −(ν + νδμ cos χ) a_A − δω sin ζ a_B, ȧ_B = −(ν − νδμ cos χ) a_B + δω sin ζ a_A,
    D = [νδμ sin χ (1 + r²) − 2rδω cos ζ]/(1 − r²) (PHYSICS §4 (8), exact).

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Changes nothing here: all methods are called alike.
    small
        (14), (16): products of the quadrature with a damping split, or in ȧ_A with the frequency
        split, are dropped.
    frozen
        The splits are taken at the run's mean angle.

    Returns
    -------
    Equations
        Three a row, two where the table stands, linear in the coordinates (7,).

    Examples
    --------
    The exact motion of a resonator solves them:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_moving_axes
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.01), np.array([0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.1j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.01)
    >>> found = build_moving_axes(run)
    >>> np.linalg.lstsq(found.columns, found.target, rcond=1e-9)[0].round(3).tolist()
    [0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0]
    """
    w = build_ellipse(run)
    angle = np.full_like(w.angle, w.angle.mean()) if frozen else w.angle
    c, s, zero = np.cos(2 * angle), np.sin(2 * angle), np.zeros_like(w.a)
    cross = 0.0 if small else 1.0
    first = make_equations(
        run,
        [w.a, w.a * c, w.a * s, cross * w.b * s, -cross * w.b * c, zero, zero],
        -w.a_dot,
        w.good,
    )
    second = make_equations(
        run,
        [w.b, -cross * w.b * c, -cross * w.b * s, -w.a * s, w.a * c, zero, zero],
        -w.b_dot,
        w.good,
    )
    r = w.b / w.a
    shape = (1 - r**2) * w.a
    third = make_equations(
        run,
        [
            zero,
            -s * (1 + cross * r**2) * w.a,
            c * (1 + cross * r**2) * w.a,
            -2 * r * c * w.a,
            -2 * r * s * w.a,
            -w.rate * (shape if not small else w.a),
            zero,
        ],
        w.angle_dot * (shape if not small else w.a),
        w.good & (w.rate != 0),
    )
    # D = νδμ sin χ (1 + r²) − 2rδω cos ζ over (1 − r²), χ = 2mθ − 2mθ_μ: sin χ = s·cos − c·sin of
    # the axis
    third = Equations(
        third.columns * np.array([1, -1, -1, 1, 1, 1, 1]),
        third.target,
        third.offset,
        third.weight,
        third.first,
    )
    return join_equations([first, second, third])


def build_moving_axes_small_quadrature(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A (14), (16): moving axes without the products of the quadrature.

    What they drop is of the size of a_B/a_A beside the splits.

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Changes nothing here: all methods are called alike.

    Returns
    -------
    Equations
        Three a row, two where the table stands, linear in the coordinates (7,).

    Examples
    --------
    At a_B/a_A of a tenth and more the splits are off:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_moving_axes_small_quadrature
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.01), np.array([0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.1j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.01)
    >>> found = build_moving_axes_small_quadrature(run)
    >>> np.linalg.lstsq(found.columns, found.target, rcond=1e-9)[0].round(3).tolist()
    [0.102, 0.024, 0.004, 0.047, 0.034, 0.5, 0.0]
    """
    return build_moving_axes(run, eliminate_rate, small=True)


def build_frozen_axes(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A, fourth remark after (17): axes frozen where a wave stands that hardly turns.

    The printed fourth equation drops the part of the drift; m·dθ/dt = −KΩ + D stands in its place,
    as in moving axes.

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Changes nothing here: all methods are called alike.

    Returns
    -------
    Equations
        Three a row, two where the table stands, linear in the coordinates (7,).

    Examples
    --------
    Within a second in which the wave turns by 1e-3 rad they are right to 1e-3 of what they say:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_frozen_axes
    >>> t, p = np.arange(0.0, 1.0, 0.01), np.array([0.1, 0.0, 0.0, 0.05, 0.0, 0.5, 0.0])
    >>> u = np.exp(np.outer(t, [-0.1 + 0.05j, -0.1 - 0.05j])) * [np.cos(0.3), np.sin(0.3)]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.01)
    >>> found = build_frozen_axes(run)
    >>> bool(np.ptp(found.columns @ p - found.target) < 1e-3 * np.ptp(found.target))
    True
    """
    return build_moving_axes(run, eliminate_rate, frozen=True)


def build_fixed_axes(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A (17) in the instrument axes with the true rate: amplitudes and phases of the channels.

    Of a channel u = a e^{jφ} the real and the imaginary part of u̇ e^{−jφ} are ȧ and aφ̇, and L
    gives them; K and the run's own frequency are among the unknowns.

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Whether KΩ is replaced by −mθ̇, as published, with K not among the unknowns.

    Returns
    -------
    Equations
        Four a row, linear in the coordinates (7,).

    Examples
    --------
    The exact motion of a resonator solves them:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_fixed_axes
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.01), np.array([0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.1j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.01)
    >>> found = build_fixed_axes(run)
    >>> np.linalg.lstsq(found.columns, found.target, rcond=1e-9)[0].round(3).tolist()
    [0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0]
    """
    u, dot = run.envelope, differentiate(run.envelope, run.time_s)
    keep = ~find_gap_rows(run.time_s)
    rate = find_table_rate(run)
    known = np.zeros_like(rate)
    if eliminate_rate:
        known, rate = -build_ellipse(run).angle_dot, np.zeros_like(rate)
    parts = []
    for this, other, sign in ((0, 1, 1.0), (1, 0, -1.0)):
        # turned back by the channel's own phase: the real part of u̇ is ȧ, the imaginary one a φ̇
        turn = np.exp(-1j * np.angle(u[:, this]))
        x, y = u[:, this] * turn, u[:, other] * turn
        terms = [-x, -sign * x, -y, 1j * sign * x, 1j * y, sign * rate * y, 0 * y]
        target = dot[:, this] * turn - sign * known * y
        for part in (np.real, np.imag):
            parts.append(
                make_equations(
                    run, [part(v) for v in terms], part(target), keep, offset=part(1j * x)
                )
            )
    return join_equations(parts)


def build_fixed_axes_weighted(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Amplitude equations of (17) and the weighted difference of its phase equations.

    It needs no mean frequency: a_C a_S Δφ̇ = 2δω_c a_C a_S + (δω_s cos Δφ − KΩ sin Δφ)(a_S² − a_C²)
    + Δν_s sin Δφ (a_C² + a_S²), with Δφ = φ_C − φ_S, Δν_s = νδμ sin 2mθ_μ.

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Whether KΩ is replaced by −mθ̇, as published, with K not among the unknowns.

    Returns
    -------
    Equations
        Three a row, linear in the coordinates (7,).

    Examples
    --------
    The exact motion of a resonator solves them:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_fixed_axes_weighted
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.01), np.array([0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.1j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.01)
    >>> found = build_fixed_axes_weighted(run)
    >>> np.linalg.lstsq(found.columns, found.target, rcond=1e-9)[0].round(3).tolist()
    [0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0]
    """
    return _fixed_axes(run, eliminate_rate)


def build_fixed_axes_groups(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A, second remark after (17): the weighted fixed axes in two groups of data.

    Main group, the wave between the electrodes' axes: sin Δφ → 0, cos Δφ → ±1. Further group, the
    wave on one of them: cos Δφ → 0, sin Δφ → ±1. Rows in between are left out; the printed
    a_C a_S Δφ̇ → 0 would leave the frequency split unknown and is kept.

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Whether KΩ is replaced by −mθ̇, as published, with K not among the unknowns.

    Returns
    -------
    Equations
        Three a row, linear in the coordinates (7,).

    Examples
    --------
    A turning wave with little quadrature is in either group nearly all the time:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_fixed_axes_groups
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.01), np.array([0.1, 0.0, 0.0, 0.002, 0.0, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.01j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.01)
    >>> phase = build_fixed_axes_groups(run).weight[-998:]
    >>> bool(np.mean(phase > 0) > 0.8)
    True
    """
    return _fixed_axes(run, eliminate_rate, grouped=True)


@dataclass(frozen=True)
class _Products:
    """The channels' products on the rows of a run, (n,) each: a_C², a_S² and x + jy = a_C a_S
    e^{jΔφ}, Δφ = φ_C − φ_S, with the rate."""

    run: EnvelopeRun
    x: Array
    y: Array
    c2: Array
    s2: Array
    rate: Array
    """Rate that K multiplies, rad/s; 0 where it is eliminated."""
    known: Array
    """KΩ where it is eliminated, else 0, rad/s."""
    size: Array
    """What a row's noise is proportional to; infinite for rows that are left out."""

    @classmethod
    def from_run(
        cls, run: EnvelopeRun, eliminate_rate: bool, noise2: Array | float = 0.0
    ) -> _Products:
        """The products, the noise's own power `noise2` taken off the squares."""
        cross = run.envelope[:, 0] * np.conj(run.envelope[:, 1])
        c2, s2 = (np.abs(run.envelope[:, k]) ** 2 - noise2 for k in (0, 1))
        rate = find_table_rate(run)
        known = -build_ellipse(run).angle_dot if eliminate_rate else np.zeros_like(rate)
        if eliminate_rate:
            rate = np.zeros_like(rate)
        size = np.sqrt(np.maximum(c2 + s2, 1e-300))
        return cls(run, cross.real, cross.imag, c2, s2, rate, known, size)

    def _rows(self, columns: list[Array], target: Array) -> Equations:
        return make_equations(self.run, columns, target, ~find_gap_rows(self.run.time_s), self.size)

    def make_amplitude_equations(self) -> list[Equations]:
        """½d(a_C²)/dt and ½d(a_S²)/dt."""
        x, y, c2, s2, t, zero = (
            self.x,
            self.y,
            self.c2,
            self.s2,
            self.run.time_s,
            np.zeros_like(self.x),
        )
        return [
            self._rows(
                [-c2, -c2, -x, zero, y, self.rate * x, zero],
                differentiate(c2, t) / 2 - self.known * x,
            ),
            self._rows(
                [-s2, s2, -x, zero, -y, -self.rate * x, zero],
                differentiate(s2, t) / 2 + self.known * x,
            ),
        ]

    def make_cross_product_equations(self) -> list[Equations]:
        """d(a_C a_S e^{jΔφ})/dt, real and imaginary part."""
        x, y, t, zero = self.x, self.y, self.run.time_s, np.zeros_like(self.x)
        total, difference = self.c2 + self.s2, self.s2 - self.c2
        return [
            self._rows(
                [-2 * x, zero, -total, -2 * y, zero, self.rate * difference, zero],
                differentiate(x, t) - self.known * difference,
            ),
            self._rows([-2 * y, zero, zero, 2 * x, difference, zero, zero], differentiate(y, t)),
        ]

    def make_phase_equations(self, grouped: bool) -> tuple[_Products, Equations]:
        """a_C a_S Δφ̇, and the products with Δφ as the equations take it.

        `grouped`: Δφ is rounded to a multiple of π/2 where it is within `GROUP` of one; the other
        rows weigh nothing.
        """
        x, y, t, zero = self.x, self.y, self.run.time_s, np.zeros_like(self.x)
        product = np.sqrt(np.maximum(x**2 + y**2, 1e-300))
        sin, cos = y / product, x / product
        # x + jy = a_C a_S e^{jΔφ}: turned back by Δφ, the imaginary part of its derivative
        left = cos * differentiate(y, t) - sin * differentiate(x, t)
        used = self
        if grouped:
            size = np.where(np.minimum(np.abs(sin), np.abs(cos)) < GROUP, self.size, np.inf)
            # Δφ near a multiple of π/2 is taken for it; rows between have an infinite size
            sin, cos = np.round(sin), np.round(cos)
            used = replace(self, x=product * cos, y=product * sin, size=size)
        total, difference = self.c2 + self.s2, self.s2 - self.c2
        columns = [zero, zero, sin * total, 2 * product, cos * difference]
        return used, used._rows(
            [*columns, -self.rate * sin * difference, zero],
            left + self.known * sin * difference,
        )


def _fixed_axes(run: EnvelopeRun, eliminate_rate: bool, grouped: bool = False) -> Equations:
    """Amplitudes and phase difference of the channels as they are, whole or in two groups."""
    used, phase = _Products.from_run(run, eliminate_rate).make_phase_equations(grouped)
    return join_equations([*used.make_amplitude_equations(), phase])


def build_products(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Fixed axes from the averages 2⟨C²⟩, 2⟨S²⟩, 2⟨CS⟩, −2⟨C·S(t − t₃)⟩; no A, B, θ is formed.

    The noise's own power is taken off the squares.

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Whether KΩ is replaced by −mθ̇, as published, with K not among the unknowns.

    Returns
    -------
    Equations
        Four a row, linear in the coordinates (7,).

    Examples
    --------
    The motion of a resonator solves them, but for the noise's power that this run has not:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_products
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.01), np.array([0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.1j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.01)
    >>> found = build_products(run)
    >>> np.linalg.lstsq(found.columns, found.target, rcond=1e-9)[0].round(3).tolist()
    [0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0]
    """
    these = _Products.from_run(run, eliminate_rate, 2 * run.std**2)
    return join_equations(
        [*these.make_amplitude_equations(), *these.make_cross_product_equations()]
    )


def build_increments(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """Seed A (15) integrated: increments of a_A, a_B and mθ instead of derivatives.

    The right-hand side is summed along the run, so that differences of neighbours do not magnify
    the noise.

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Changes nothing here: all methods are called alike.

    Returns
    -------
    Equations
        Three from row to row, linear in the coordinates (7,).

    Examples
    --------
    The exact motion of a resonator solves them:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_increments
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.01), np.array([0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 0.1j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.01)
    >>> found = build_increments(run)
    >>> np.linalg.lstsq(found.columns, found.target, rcond=1e-9)[0].round(3).tolist()
    [0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0]
    """
    w = build_ellipse(run)
    c, s, zero = np.cos(2 * w.angle), np.sin(2 * w.angle), np.zeros_like(w.a)
    r = w.b / w.a
    up, down = (1 + r**2) / (1 - r**2), 1 / (1 - r**2)
    return integrate_equations(
        run,
        [
            ([-w.a, -w.a * c, -w.a * s, -w.b * s, w.b * c, zero, zero], w.a, run.std),
            ([-w.b, w.b * c, w.b * s, w.a * s, -w.a * c, zero, zero], w.b, run.std),
            (
                [zero, s * up, -c * up, -2 * r * c * down, -2 * r * s * down, -w.rate, zero],
                w.angle,
                run.std * np.sqrt(w.a**2 + w.b**2) / np.abs(w.a**2 - w.b**2),
            ),
        ],
    )


def build_stokes(run: EnvelopeRun, eliminate_rate: bool = False) -> Equations:
    """The exact linear four-vector form Ṡ = M S (PHYSICS §0), integrated; circles do no harm.

    Ṡ₁ = −2νS₁ − 2νδμ_c S₀ + 2δω_s S₃ + 2KΩS₂, Ṡ₂ = −2νS₂ − 2νδμ_s S₀ − 2δω_c S₃ − 2KΩS₁,
    Ṡ₃ = −2νS₃ + 2δω_c S₂ − 2δω_s S₁; the noise's power is taken off S₀. S₀ = |(S₁, S₂, S₃)| of one
    wave, so its own equation says nothing new; the other three have independent noise 2σ√S₀.

    Parameters
    ----------
    run
        Envelopes and table turn.
    eliminate_rate
        Changes nothing here: all methods are called alike.

    Returns
    -------
    Equations
        Three from row to row, linear in the coordinates (7,).

    Examples
    --------
    A wave that is a circle to begin with has no axes, but solves them:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.seed_a_methods import build_stokes
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.01), np.array([0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0])
    >>> u = exponentiate(build_generator(p, 0.5, 3e4), t) @ [1.0, 1.0j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0.5 * t, None, 5e3, 2, 0.01)
    >>> found = build_stokes(run)
    >>> np.linalg.lstsq(found.columns, found.target, rcond=1e-9)[0].round(3).tolist()
    [0.1, 0.02, 0.01, 0.05, 0.03, 0.5, 0.0]
    """
    s0, s1, s2, s3 = np.moveaxis(ellipse.compute_stokes(run.envelope), -1, 0)
    # σ is of a real part: |C|² and |S|² hold 2σ² of noise each
    s0 = s0 - 4 * run.std**2
    rate, zero = find_table_rate(run), np.zeros_like(s0)
    std = 2 * run.std * np.sqrt(np.maximum(s0, 4 * run.std**2))
    return integrate_equations(
        run,
        [
            ([-2 * s1, -2 * s0, zero, zero, 2 * s3, 2 * rate * s2, zero], s1, std),
            ([-2 * s2, zero, -2 * s0, -2 * s3, zero, -2 * rate * s1, zero], s2, std),
            ([-2 * s3, zero, zero, 2 * s2, -2 * s1, zero, zero], s3, std),
        ],
    )


METHODS: dict[str, Callable[..., Equations]] = {
    "moving-axes": build_moving_axes,
    "moving-axes-small-quadrature": build_moving_axes_small_quadrature,
    "fixed-axes": build_fixed_axes,
    "fixed-axes-weighted": build_fixed_axes_weighted,
    "fixed-axes-groups": build_fixed_axes_groups,
    "frozen-axes": build_frozen_axes,
    "increments": build_increments,
    "products": build_products,
    "stokes": build_stokes,
}
EXACT = {
    "moving-axes-small-quadrature": "moving-axes",
    "fixed-axes-groups": "fixed-axes-weighted",
    "frozen-axes": "moving-axes",
}
"""Methods whose equations are approximate -> the exact ones with the same differences."""
