"""Diagnosis, loops that look at the oscillation itself: its ripple at 2ω in what they command makes
a slow force that no log of their slow commands holds.

What oscillates under slow forces G (u̇ = G) ripples beside its mean v, u = v − (j/2ω)G* e^{−2jωt},
since u̇ = G − G* e^{−2jωt} for z = Re u e^{jωt}, ż = −ω Im u e^{jωt}. A force F(u) that turns with
the instant state answers with its part A = ∂F/∂u, and the mean of the product is −(j/2ω) A*G
(averaging to second order; direct integration agrees to a thousandth).

- The direction: with F = e^{jφ}(f_A e_A − j f_B e_B), A = (P + jQJ)/2(a² − b²), P = a f_A − b f_B,
  Q = a f_B − b f_A: of a held amplitude that is ν/4ω of the wave's own motion. Loops that look at
  demodulated envelopes have none of it, so it is as uncertain as it is large.
- The sizes: a loop of gain k that holds a_A answers the ripple of a_A by q e_A e_Aᵀ v̇/4ω, one that
  nulls a_B likewise by q e_B e_Bᵀ v̇/4ω, |q| ≤ k, with a phase that its delay, its filter and its
  sampling make and nobody knows. Of the second q the imaginary part makes quadrature, which the
  waves show; the real part turns the wave in proportion to its rate, as the scale factor does, and
  may be as large.
- To a loop that takes its frequency for another, ω', the oscillation is an ellipse of z and ż/ω': a
  ripple of (ω − ω')/2ω of the amplitude, answered by q (ω − ω')a/4ω along the wave, that looks as
  damping of driven runs alone; the force itself is off by (ω − ω')/2ω. Nobody says which ω' a loop
  takes: one within what the split does to the run's own frequency.
- A board that multiplies the signals by a reference of a fixed frequency and takes means of its
  whole periods sees v + jG/2ω + x, x = (c/2ω) G* and c = j: of u* e^{−2jωt} what u moves within a
  block is left. That is as large as the ripple and stands still in the reference, where the ripple
  turns with 2φ. The frame is off by Re x_B/a in angle and Im x_A/a in phase, x turned by e^{−2jφ}
  to the wave's own axes: by KΩ/2ω of either sign from run to run, as φ is at their starts. Filters
  of the signals make c smaller and turn it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ....effects.effect import find_frame
from ....fitting.causes import whitened_rows
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.sensitivities import Propagation, gather_base_in_steps
from ....fitting.causes.slow_equation import (
    RungeKuttaStage,
    apply_generators,
    build_generators,
    build_mean_turns,
)
from ....fitting.causes.wave_frame import to_reals
from ....fitting.envelopes import coordinates
from ..fits.scoring import is_gross
from .command_frame import are_all_driven
from .loop_gain import bound_gains

Array = np.ndarray
ANY_PHASE = 2.0
"""Size that either part of an answer of unknown phase may have, over what is seen of one part."""
FASTEST = 0.1
"""Greatest gain of a loop over the oscillation's frequency: one that settles within ten periods,
which its electronics need to see an amplitude."""
OF_FORCE = 2.0
"""Part of its force, over (ω − ω')/4ω, that a drive answers another frequency by without any gain:
once by its direction, once by the amplitude that its loop sees beside the displacement's."""
DIRECTION, QUADRATURE = 0, 2


@dataclass(frozen=True)
class Ripple:
    """What a ripple's answers do to the waves over σ (N, 10): of the direction, of the quadrature
    loop and of the amplitude loop in two parts each, of the amplitude loop to the frequency that it
    takes the wave's for, in all runs and from run to run, and of the force's direction to that; of
    a frame that is seen in blocks of a fixed reference, in two parts; of the loops for 1/s; and how
    large the answers of the loops may be, 1/s."""

    doings: Array
    apart: Array
    """The same less what coordinates of the base model do of it, where no run is free."""
    shares: Array | None
    """Of these, what one of each answer is like (6, 10); None: a run is free."""
    jumps: Array
    """What the part apart adds at the end of every step, (R, n − 1, 4, 10)."""
    amplitude_1_s: float
    quadrature_1_s: float

    @classmethod
    def from_fit(cls, fit: ExtendedFit) -> Ripple:
        """Beside a fit, from its residual and from the loops' own gains; without a quadrature loop
        nothing is seen, and nothing answers.

        Any gross misfit might be taken for an answer: beside one the gains alone tell. What was
        judged once stays: fits of the same runs are compared at the same doubt.
        """
        jumps, doings = _carry(fit, gather_answers(fit, fit.flow))
        sizes = 0.0, 0.0
        if fit.series.quadrature_drive.any():
            sizes = fit.series.answers_1_s or _judge_answers(fit, doings)
        if not are_all_driven(fit.series):
            return cls(doings, doings, None, jumps, *sizes)
        base, shared = _carry(fit, _gather_coordinates(fit.flow))
        shares = np.linalg.lstsq(shared, doings, rcond=None)[0]
        return cls(doings, doings - shared @ shares, shares, jumps - base @ shares, *sizes)

    def gather_along(self, fit: ExtendedFit, flow: Propagation) -> Array:
        """What the answers add at the end of every step (R, n − 1, 4, 10) of another motion, less
        what the same shares of the coordinates do."""
        answers = gather_answers(fit, flow)
        return answers if self.shares is None else answers - _gather_coordinates(flow) @ self.shares

    @property
    def spread(self) -> Array:
        """What one standard deviation of each does, over σ (N, 10)."""
        return self.doings * self.std

    @property
    def spread_apart(self) -> Array:
        """The same less what coordinates of the base model do, where no run is free."""
        return self.apart * self.std

    @property
    def std(self) -> Array:
        """Standard deviations of the ten."""
        sizes = [self.quadrature_1_s] * 2 + [self.amplitude_1_s] * 4
        return np.array([1.0, *sizes, 1.0, 1.0, 1.0])


def _judge_answers(fit: ExtendedFit, doings: Array) -> tuple[float, float]:
    """How large the answers of the amplitude loop and of the quadrature loop may be, 1/s."""
    fastest = FASTEST * fit.series.reference_frequency_hz
    amplitude, quadrature = (min(gain, fastest) for gain in bound_gains(fit.series))
    seen = quadrature if is_gross(fit) else min(_find_seen_size(fit, doings), quadrature)
    return min(ANY_PHASE * seen, amplitude), min(ANY_PHASE * seen, quadrature)


def _find_seen_size(fit: ExtendedFit, doings: Array) -> float:
    """Size, with its σ, of the part that makes quadrature: the larger, with or without that of the
    direction, which does nearly the same and may hide it."""
    column = fit.basis.project_out(doings[:, QUADRATURE])
    size = max(float(column @ column), np.finfo(float).tiny)
    left = (fit.residual, fit.residual - doings[:, DIRECTION])
    seen = max(abs(float(column @ residual)) / size for residual in left)
    return float(np.hypot(seen, size**-0.5))


def _carry(fit: ExtendedFit, jumps: Array) -> tuple[Array, Array]:
    """Jumps in the steps (R, n − 1, 4, k), and what they do to the waves over σ (N, k)."""
    moved = fit.flow.whiten_read_out(fit.flow.carry_jumps(jumps))
    return jumps, whitened_rows.flatten_own(fit.series, moved)


def _gather_coordinates(flow: Propagation) -> Array:
    """What the base model's coordinates add at the end of every step, (R, n − 1, 4, 6)."""
    return gather_base_in_steps(flow)[..., : coordinates.SECOND_ORDER]


def gather_answers(fit: ExtendedFit, flow: Propagation) -> Array:
    """What the direction's answer adds at the end of every step, and of the sizes' q = 1 and q = j
    1/s.

    Parameters
    ----------
    fit
        Of the runs.
    flow
        Along their motion.

    Returns
    -------
    ndarray
        (R, n − 1, 4, 10)

    Examples
    --------
    No loop holds a free run:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.ripple import gather_answers
    >>> added = gather_answers(draw_fit(), draw_fit().flow)
    >>> added.shape, bool(added.any())
    ((3, 49, 4, 10), False)
    """
    series, point = fit.series, fit.point
    turn, apart = build_mean_turns(series)[:, None], _find_references(fit)
    at_rows = _forces(
        flow.rows, build_generators(series, point) - turn, flow.prediction.motion, apart
    )
    between = _forces(flow.halves, build_generators(flow.centre, point) - turn, flow.middle, apart)
    return flow.gather_in_steps(at_rows, between)


def _find_references(fit: ExtendedFit) -> tuple[float, Array]:
    """By how much the oscillation may be beside the frequency that loops take it for, in all runs
    and in every single one (R, 1), rad/s: by what the split does, since a frequency that follows
    the temperature is followed."""
    by_split = fit.series.turn_rad_s - fit.point.offset_rad_s
    driven = by_split[fit.series.forced.any(axis=1)]
    split = float(np.linalg.norm(fit.point.p[coordinates.FREQUENCY_SPLIT]))
    # a fit that is far off knows a run's frequency no better than that
    mean = driven.mean() if driven.size else 0.0
    return split, np.clip(by_split - mean, -split, split)[:, None]


def _forces(stage: RungeKuttaStage, L: Array, v: Array, apart: tuple[float, Array]) -> Array:
    """The ten forces on the envelopes v, of references so far `apart`, as reals (R, n, 4, 10)."""
    G = apply_generators(L, v) + stage.compute_source(v)
    turn, e_A, e_B, _ = find_frame(v, stage.state.phase_rad)
    seen = [np.conj(turn) * np.sum(axis * w, axis=-1) for w in (v, G) for axis in (e_A, e_B)]
    a, b, G_A, G_B = seen[0].real, -seen[1].imag, seen[2], seen[3]
    # −(j/2ω)A*G = (−jP − QJ)G/4ω(a² − b²) in the wave's own axes, where (JG)_A = G_B, (JG)_B =
    # −G_A; `unit` holds the divisor
    over = stage.state.forced / (4 * stage.state.omega_r_rad_s)
    unit = over / np.maximum(a**2 - b**2, np.finfo(float).tiny)
    f_A, f_B = stage.main, stage.quadrature
    P, Q = (a * f_A - b * f_B) * unit, (a * f_B - b * f_A) * unit
    # the axis and the phase of v less those of the displacement that demodulation shows
    axis, phase = (
        2 * (a * G_B.imag + b * G_A.real) * unit,
        -2 * (a * G_A.real + b * G_B.imag) * unit,
    )
    still = [2 * unit * np.conj(turn) ** 2 * np.conj(part) for part in (G_A, G_B)]
    answers = np.stack(
        [
            [
                -1j * P * G_A - Q * G_B + 1j * (phase * f_A + axis * f_B),
                -1j * P * G_B + Q * G_A + axis * f_A + phase * f_B,
            ],
            [0 * G_B, over * G_B],
            [0 * G_B, 1j * over * G_B],
            [over * G_A, 0 * G_A],
            [1j * over * G_A, 0 * G_A],
            *([-over * difference * a, 0 * G_A] for difference in apart),
            [over * OF_FORCE * apart[0] * f_A, -1j * over * OF_FORCE * apart[0] * f_B],
            *(_turn_by_blocks((a, b), (f_A, f_B), (c * x for x in still)) for c in (1, 1j)),
        ],
        axis=-1,
    )
    answers = turn[..., None] * answers
    commands = answers[0][..., None, :] * e_A[..., None] + answers[1][..., None, :] * e_B[..., None]
    forces = [stage.pass_forcers(v, command) for command in np.moveaxis(commands, -1, 0)]
    return np.stack([to_reals(force) for force in forces], axis=-1)


def _turn_by_blocks(
    wave: tuple[Array, Array], force: tuple[Array, Array], missed: Iterable[Array]
) -> list[Array]:
    """The force, in the wave's own axes, of a frame that is seen beside a wave of amplitudes a, b
    by what its blocks miss, over a² − b²."""
    (a, b), (f_A, f_B), (x_A, x_B) = wave, force, missed
    axis, phase = a * x_B.real - b * x_A.imag, a * x_A.imag - b * x_B.real
    return [1j * (phase * f_A + axis * f_B), axis * f_A + phase * f_B]
