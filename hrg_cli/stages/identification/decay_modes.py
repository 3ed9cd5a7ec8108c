"""One run's decay: the rows of the record that are one, and the one or two modes found in them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fitting import checks
from ...fitting.envelopes import one_mode, two_modes
from ...fitting.envelopes.decay_stretch import find_decay_stretch
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.one_mode import OneMode
from ...fitting.envelopes.two_modes import Modes

Array = np.ndarray


@dataclass(frozen=True)
class Seen:
    """One run's decay: its rows, the whole record they were cut from, the window's spacing, and the
    one or two modes found in them."""

    run: EnvelopeRun
    whole: EnvelopeRun
    spacing_s: float
    one: OneMode | None
    two: Modes | None

    @property
    def mode(self) -> OneMode:
        """The mode of a run that shows one."""
        assert self.one is not None
        return self.one

    @property
    def chi2(self) -> float:
        """χ² of the model that was chosen."""
        return self.two.chi2_per_dof * self.two.dof if self.two is not None else self.mode.chi2

    @property
    def dof(self) -> int:
        """Its degrees of freedom."""
        return self.two.dof if self.two is not None else self.mode.dof

    def compute_residual(self) -> Array:
        """Its misfit over the noise, row by row (n, k)."""
        if self.two is not None:
            return self.two.residual
        laws = (self.mode.decay, self.mode.frequency)
        return np.column_stack([law.residual for law in laws if law.names])


def find_modes(run: EnvelopeRun, thin: EnvelopeRun, u: Array) -> Seen:
    """The decay's rows and its modes: one whose decay and frequency follow its amplitude, or two.

    Two where they are apart and leave less than one; one where no phase tells them apart.

    Parameters
    ----------
    run
        All its windows.
    thin
        The same averaged to fewer rows (n,).
    u
        Its signals (n, k), complex.

    Returns
    -------
    Seen
        The rows and modes; of the stretches that either model finds, the one that fits better for
        its length.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.decay_modes import find_modes
    >>> run = draw_run_down(0.0)
    >>> seen = find_modes(run, run, run.envelope[:, :1])
    >>> seen.two is None, round(seen.mode.decay.find_coefficient("viscous_1_s")[0], 3)
    (True, 0.1)
    """
    from_one = find_decay_stretch(
        thin, u[:, 0], lambda rows: one_mode.measure_misfit(thin, u[:, 0], rows)
    )
    from_two = (
        find_decay_stretch(thin, u[:, 0], lambda rows: _misfit_of_two(thin, u, rows))
        if run.phase_known
        else from_one
    )
    both = [
        _fit_modes(thin, u, s, run)
        for s in dict.fromkeys(((from_one.start, from_one.stop), (from_two.start, from_two.stop)))
    ]
    return min(both, key=lambda s: (s.chi2 / s.dof) * (len(thin) / len(s.run)) ** 2)


def _fit_modes(thin: EnvelopeRun, u: Array, stretch: tuple[int, int], run: EnvelopeRun) -> Seen:
    rows = slice(*stretch)
    part, signal = thin.select_rows(rows), u[rows]
    one = one_mode.identify(part, signal[:, 0])
    spacing = float(np.median(np.diff(run.time_s)))
    if not run.phase_known:
        return Seen(part, thin, spacing, one, None)
    two, single = two_modes.identify(part, signal, 2), two_modes.identify(part, signal, 1)
    adequate = checks.check_goodness(one.chi2, one.dof).passed
    if (
        two_modes.are_resolved(two, single, run.rounding)
        and not adequate
        and two.chi2_per_dof < one.chi2 / one.dof
    ):
        return Seen(part, thin, spacing, None, two)
    return Seen(part, thin, spacing, one, None)


def _misfit_of_two(run: EnvelopeRun, u: Array, rows: slice) -> tuple[Array, Array]:
    """Squared misfit over the noise, and over the squared amplitude (n,), on every row of what two
    modes of some rows foretell."""
    modes = two_modes.identify(run.select_rows(rows), u[rows], 2)
    with np.errstate(over="ignore", invalid="ignore"):
        model = np.exp(np.outer(run.time_s - run.time_s[rows][0], modes.exponent)) @ modes.amplitude
        power = np.nan_to_num(np.sum(np.abs(u - model) ** 2, axis=1), nan=np.inf)
        size = np.maximum(
            np.sum(np.abs(u) ** 2, axis=1), np.sum(np.abs(modes.amplitude) ** 2) * 1e-12
        )
        larger = np.maximum(size, np.nan_to_num(np.sum(np.abs(model) ** 2, axis=1), nan=0.0))
    return power / (2 * u.shape[1] * run.std**2), power / larger
