"""Effects in the samples themselves, block by block: the motion's change, the read-out's steps in
the order of the chain, lost samples, the clock, and the recording's own integers again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...effects.effect import find_frame
from ...errors import HrgError
from ...physics.plant import Readout, Samples
from ...records import Recording, Wave
from .motion import Change
from .oscillation import Oscillation, interpolate_oscillation

Array = np.ndarray
NOTHING = 1e-12
"""Part of the signal below which an effect did nothing."""


class UnchangedError(HrgError):
    """The effects do nothing in this recording."""


@dataclass
class Injection:
    """What is done to every block of samples."""

    recording: Recording
    wave: Wave
    change: Change | None
    pickoff: Readout
    logs: Mapping[str, Array]
    moved: bool
    name: str
    why_nothing: str

    def make_blocks(self, rows: int) -> Iterator[Recording]:
        """The recording block by block."""
        source, oscillation = self.recording, interpolate_oscillation(self.wave)
        offset = self._mean_position(oscillation, rows)
        last, size, altered, clipped, removed = (
            None,
            0.0,
            bool(self.logs) or self.pickoff.clock_error != 0,
            0,
            0,
        )
        for first in range(0, len(source.c), rows):
            t = source.times(first, first + rows)
            y = np.stack(source.physical(first, first + rows)) - offset[:, None]
            seen = self._apply_effects(t, y, oscillation)
            size = max(size, float(np.nanmax(np.abs(y), initial=0.0)))
            altered = altered or bool(np.nanmax(np.abs(seen - y), initial=0.0) > NOTHING * size)
            raw, cut = self._raw(seen + offset[:, None])
            clipped += cut
            keep, shift = self._find_kept(t, first)
            removed += int(np.count_nonzero(~keep))
            if last is not None:
                yield last
            last = self._block(t + shift, raw, keep, first == 0)
        if last is None or not (altered or removed):
            raise UnchangedError(
                f"{self.name}: the effects do nothing in it ({self.why_nothing}); see `hrg effects`"
            )
        doubts = [] if self.change is None else self.change.list_doubts()
        if clipped:
            doubts.append(
                f"{clipped} samples lay beyond the range of {source.c.dtype} and were clipped to it"
            )
        yield last.judged(doubts)

    def _apply_effects(self, t: Array, y: Array, oscillation: Oscillation) -> Array:
        """Samples (2, n) about their mean position with the effects in them."""
        q = oscillation.interpolate(t)
        # the motion first: what a read-out does, it does to the motion as it then is
        if self.change is not None:
            moved = np.einsum("nij,nj->ni", self.change.at(t), q)
            # only the difference is added, so the recording keeps its noise and its harmonics
            y, q = y + np.real(moved - q).T, moved
        drive = self._drive(t, q)
        logs = [
            self._log(name, t, 25.0 if name == "temperature_degc" else 0.0)
            for name in ("temperature_degc", "rate_rad_s")
        ]
        block = Samples(t, q.real.T, -q.imag.T, drive, logs[0], logs[1])
        for step in (*self.pickoff.steps, *self.pickoff.after):
            y = step(block, y)
        return y

    def _drive(self, t: Array, q: Array) -> Array:
        """Commanded force on the envelopes turned to the instant, (2, n)."""
        turn, e_A, e_B, _ = find_frame(q, 0.0)
        main, quadrature = self._log("drive_main", t, 0.0), self._log("drive_quadrature", t, 0.0)
        return (turn[:, None] * (main[:, None] * e_A - 1j * quadrature[:, None] * e_B)).T

    def _log(self, name: str, t: Array, absent: float) -> Array:
        values = getattr(self.recording, name)
        if values is None or self.recording.auxiliary_time_s is None:
            return np.full(len(t), absent)
        at, values = np.asarray(self.recording.auxiliary_time_s, float), np.asarray(values, float)
        good = np.isfinite(at) & np.isfinite(values)
        return np.interp(t, at[good], values[good]) if good.any() else np.full(len(t), absent)

    def _mean_position(self, oscillation: Oscillation, rows: int) -> Array:
        """What stands beside the oscillation in each channel, (2,)."""
        total, count = np.zeros(2), np.zeros(2)
        for first in range(0, len(self.recording.c), rows):
            t = self.recording.times(first, first + rows)
            beside = (
                np.stack(self.recording.physical(first, first + rows))
                - oscillation.interpolate(t).real.T
            )
            total += np.nansum(beside, axis=1)
            count += np.count_nonzero(np.isfinite(beside), axis=1)
        return total / np.maximum(count, 1)

    def _raw(self, y: Array) -> tuple[list[Array], int]:
        """Both channels as the recording keeps them, and how many integers had to be clipped."""
        out, clipped = [], 0
        of = self.recording
        for values, channel, scale, offset in (
            (y[0], of.c, of.c_scale_factor, of.c_add_offset),
            (y[1], of.s, of.s_scale_factor, of.s_add_offset),
        ):
            raw = (values - offset) / scale
            dtype = channel.dtype
            if dtype.kind in "iu":
                limits = np.iinfo(dtype)
                # a converter saturates; without the clip integers would wrap to the other sign
                raw = np.rint(raw)
                clipped += int(np.count_nonzero((raw < limits.min) | (raw > limits.max)))
                raw = np.clip(raw, limits.min, limits.max)
            out.append(raw.astype(dtype))
        return out, clipped

    def _find_kept(self, t: Array, first: int) -> tuple[Array, Array]:
        """Which samples are not lost (n,), and by how much the times of those after a loss are
        moved, the gap being closed up."""
        keep, shift = np.ones(len(t), bool), np.zeros(len(t))
        rate = self.recording.sample_rate_hz
        for time_s, lost_s in self.pickoff.dropped:
            if self.recording.time_s is None:
                assert rate is not None
                number, begin = first + np.arange(len(t)), round(time_s * rate)
                keep &= ~((number >= begin) & (number < begin + round(lost_s * rate)))
            else:
                keep &= ~((t >= time_s) & (t < time_s + lost_s))
                shift -= lost_s * (t >= time_s + lost_s)
        return keep, shift

    def _block(self, t: Array, raw: Sequence[Array], keep: Array, first: bool) -> Recording:
        """The block as a record; the log's rows stand in the first one. The truth of a simulation
        is none for a changed motion."""
        of, clock = self.recording, 1 + self.pickoff.clock_error
        fields: dict[str, Any] = {
            "c": raw[0][keep],
            "s": raw[1][keep],
            "time_s": None if of.time_s is None else t[keep] / clock,
        }
        if of.sample_rate_hz is not None:
            fields["sample_rate_hz"] = of.sample_rate_hz * clock
        for name, spec in of.columns().items():
            if (
                spec.dims
                and spec.dims[0] in ("auxiliary_row", "truth_row")
                and getattr(of, name) is not None
            ):
                values = np.asarray(self.logs.get(name, getattr(of, name)))
                values = values / clock if name in ("auxiliary_time_s", "truth_time_s") else values
                fields[name] = values if first else values[:0]
                if spec.dims[0] == "truth_row" and self.moved:
                    fields[name] = None
        return of.replace(**fields)
