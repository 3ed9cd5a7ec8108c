"""Runs side by side as the extended model is held against them: measured envelopes, logs, commands,
and what nobody knows of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..envelopes.base_freedom import choose_scale_factor
from ..noise import channel_noise
from .designs import Basis, Softened
from .walks import Walk

Array = np.ndarray


@dataclass(frozen=True)
class MeasuredRuns:
    """Runs side by side (R, n), padded with weight 0: envelopes against one reference frequency and
    what the effects may look at.

    Examples
    --------
    A wave that turns at a rate which rises by 0.1 rad/s²; in the middle of a step it stands where
    the table's angle, its integral, says:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t = np.arange(4.0)[None]
    >>> series = MeasuredRuns(**dict.fromkeys(needed, 0 * t) | dict(
    ...     names=("left",), time_s=t, rate_rad_s=0.1 * t**2, table_angle_rad=0.1 * t**3 / 3,
    ...     reference_frequency_hz=5e3, mode_number=2,
    ... ))
    >>> series.middles.rate_rad_s.round(9).tolist()
    [[0.025, 0.225, 0.625]]
    """

    names: tuple[str, ...]
    time_s: Array
    envelope: Array
    weight: Array
    rate_rad_s: Array
    temperature_degc: Array
    temperature_rate_degc_s: Array
    branch: Array
    """Mean of the temperature's branch over the step that follows a row."""
    table_angle_rad: Array
    phase_rad: Array
    main_drive: Array
    quadrature_drive: Array
    main_impulse: Array
    quadrature_impulse: Array
    """∫ of the two commands from the run's start: within a row a loop that settles does not run
    straight."""
    forced: Array
    held_amplitude: Array
    """Main amplitude that a drive without a log keeps up; NaN where the command is logged or the
    run is free."""
    held_slope: Array
    turn_rad_s: Array
    """Mean turn of every run's phase (R,), which the steps take exactly."""
    reference_frequency_hz: float
    mode_number: int
    has_temperature: bool = True
    temperature_impulse: Array | None = None
    """∫ of the temperature from the run's start, the mean of every row; None: the temperature goes
    straight from row to row."""
    drive_late_s: float = 0.0
    """How much later than the log says the commands act; what stands here of them is so already."""
    whitening: Array | None = None
    """Of the channels' noise in every run (R, 2, 2); None: both have the same in all of them."""
    number: Array | None = None
    """Number of every run from 0 (R,), which it keeps where some are taken; None: as they stand."""
    begun_s: Array | None = None
    """How long after the first run each began (R,); None: not known."""
    free_phase: bool = False
    """Every row's phase is its own: what turns both channels together is neither fitted nor
    judged."""
    scatter: Softened | None = None
    """By what the waves may stand beside any prediction, since the drive's log does not hold all
    that the drive did."""
    walk: Walk | None = None
    """The likely part of what may scatter. The motion has it, so that what follows the motion
    follows the wave as it was; the residual has not, whose likelihood knows the scatter whole."""
    frame_turn: Array | None = None
    """By how much the frame of the commands stands beside the wave's angle and phase, rad (R, n,
    2); None: not at all."""
    scatter_part: float = 1.0
    """Part of the log's scatter from row to row that may be none of the drive's: all, before the
    waves were asked."""
    held_beat_rad_s: float | None = None
    """Beat with the oscillation of a board's steps from command to command; None where none is
    allowed for."""
    answers_1_s: tuple[float, float] | None = None
    """Standard deviations that `unsettled` gives the amplitude and the quadrature loop's answers to
    the oscillation's ripple; None: not judged."""
    phase_lead_rad: Array | None = None
    """By how much a row's phase, the mean of its windows', runs ahead of that in its middle; None:
    the rows are windows."""
    averaged_along: Array | None = None
    """Coordinates (7,) of the motion along which windows were averaged to rows; None: they were
    not."""
    coarse: tuple[int, ...] = ()
    """Numbers of the runs of so few codes that rounding is most of their noise, which is then none
    from row to row."""
    unsettled: Basis | None = None
    """What nobody knows of these runs, on the rows with weight: residuals and sensitivities are
    taken off it."""

    @property
    def step_s(self) -> Array:
        """(R, n − 1), 0 where padded."""
        return np.diff(self.time_s, axis=1)

    def select_runs(self, index: Sequence[int]) -> MeasuredRuns:
        """Some of the runs."""
        index = list(index)
        cut = self._cut(index)
        there = np.isin(np.arange(len(self.names)), index)[:, None]
        in_order = index == sorted(set(index))
        return replace(
            self.drop_shared_doubt(),
            names=tuple(self.names[i] for i in index),
            turn_rad_s=self.turn_rad_s[index],
            number=self.numbers[index],
            begun_s=None if self.begun_s is None else self.begun_s[index],
            whitening=None if self.whitening is None else self.whitening[index],
            unsettled=self._select_unsettled(there) if in_order else None,
            **cut,
        )

    def keep_rows(self, kept: Array) -> MeasuredRuns:
        """The runs with weight on the rows `kept` (R, n) alone."""
        return replace(
            self.drop_shared_doubt(),
            weight=np.where(kept, self.weight, 0.0),
            unsettled=self._select_unsettled(kept),
        )

    def _select_unsettled(self, kept: Array) -> Basis | None:
        """What is unsettled of some rows (R, n) or runs (R, 1); None where that is said of all rows
        together."""
        walks = self.walk is not None and bool(self.walk.parts)
        of_all = walks or self.scatter is not None or self.frame_turn is not None
        if self.unsettled is None or of_all:
            return None
        kept = np.broadcast_to(kept, self.weight.shape)
        return self.unsettled.select_rows(np.repeat(kept[self.weight > 0], 4))

    def drop_rows_before(self, first: int) -> MeasuredRuns:
        """The runs from one row on."""
        return replace(self.drop_shared_doubt(), **self._cut((slice(None), slice(first, None))))

    def _cut(self, part: Any) -> dict[str, Any]:
        """The arrays' part of these indices."""
        return {f: getattr(self, f)[part] for f in _ARRAYS if getattr(self, f) is not None}

    def drop_shared_doubt(self) -> MeasuredRuns:
        """The rows without what is said of all of them together: what is unsettled, and what may
        scatter."""
        return replace(
            self,
            unsettled=None,
            answers_1_s=None,
            scatter=None,
            walk=None,
            frame_turn=None,
        )

    def whiten(self, change: Array) -> Array:
        """Changes of the envelopes (R, n, 2) over their noise: of unit variance in either channel,
        and none in common."""
        return channel_noise.whiten(self.whitening, change) * self.weight[..., None]

    def whiten_reals(self, change: Array) -> Array:
        """The same of reals, (R, n, 4, K)."""
        weight = self.weight[..., None, None]
        return channel_noise.whiten_reals(self.whitening, change) * weight

    def to_units(self, over_noise: Array) -> Array:
        """Envelopes (R, n, 2) in the signals' unit from the same over their noise; 0 where a row
        has no weight."""
        weight = np.where(self.weight > 0, self.weight, np.inf)[..., None]
        return channel_noise.whiten(channel_noise.invert(self.whitening), over_noise / weight)

    @property
    def row_turn(self) -> Array:
        """What turns the envelopes (R, n, 2) in the middle of rows to those of rows, which are
        means of their windows: e^{jψ} by the phase's lead ψ, (R, n, 1)."""
        if self.phase_lead_rad is None:
            return np.ones((*self.time_s.shape, 1))
        return np.exp(1j * self.phase_lead_rad)[..., None]

    @property
    def table_turn_rad(self) -> Array:
        """By how much the logged rates alone turn mθ back from the runs' starts on, K∫Ω dt with the
        usual K (R, n)."""
        return choose_scale_factor(self.mode_number) * self.table_angle_rad

    @property
    def numbers(self) -> Array:
        """Number of every run from 0, (R,)."""
        return np.arange(len(self.names)) if self.number is None else self.number

    @property
    def run(self) -> Array:
        """The same beside the rows, (R, 1), as a state of the envelopes has it."""
        return self.numbers[:, None]

    @cached_property
    def middles(self) -> MeasuredRuns:
        """The same quantities in the middle of the steps, (R, n − 1)."""
        cut = {
            f: (getattr(self, f)[:, 1:] + getattr(self, f)[:, :-1]) / 2
            for f in _ARRAYS
            if f not in ("branch", "forced") and getattr(self, f) is not None
        }
        h = self.step_s
        for name, integral in _INTEGRALS.items():
            if getattr(self, integral) is None:
                continue
            ends = getattr(self, name)
            mean = np.divide(
                np.diff(getattr(self, integral), axis=1), h, out=cut[name].copy(), where=h > 0
            )
            # Simpson's rule then takes exactly the integral, however fast the quantity changes
            # within a step
            cut[name] = (6 * mean - ends[:, 1:] - ends[:, :-1]) / 4
        # likewise of the branch, which stands as its mean over the step that follows a row
        cut["branch"] = (5 * self.branch[:, :-1] - self.branch[:, 1:]) / 4
        return replace(self, forced=self.forced[:, :-1], **cut)


_ARRAYS = (
    "time_s",
    "envelope",
    "weight",
    "rate_rad_s",
    "temperature_degc",
    "temperature_rate_degc_s",
    "temperature_impulse",
    "branch",
    "table_angle_rad",
    "phase_rad",
    "main_drive",
    "quadrature_drive",
    "main_impulse",
    "quadrature_impulse",
    "forced",
    "held_amplitude",
    "held_slope",
    "frame_turn",
    "phase_lead_rad",
)

_INTEGRALS = {
    "temperature_degc": "temperature_impulse",
    "temperature_rate_degc_s": "temperature_degc",
    "rate_rad_s": "table_angle_rad",
    "main_drive": "main_impulse",
    "quadrature_drive": "quadrature_impulse",
}
