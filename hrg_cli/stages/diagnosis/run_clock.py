"""Diagnosis, clocks that do not begin with the run: a log's times may count from whenever its
instrument was switched on.

The model of a run begins with it, and so does what drifts in it. Runs are diagnosed by their own
time, and what the report says of instants is told by the recording's.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...effects.effect import INSTANT, RUN
from ...errors import name_some
from ...records import Diagnosis, Wave


@dataclass(frozen=True)
class RunClocks:
    """Runs by their own times, and what their recordings' clocks show [s] when each begins."""

    waves: list[Wave]
    begin_s: list[float]

    def list_notes(self) -> list[str]:
        """A sentence on the runs whose clocks do not begin with them."""
        late = {w.run_id or "a run": t for w, t in zip(self.waves, self.begin_s, strict=True) if t}
        if not late:
            return []
        first, last = (f"{t:.6g}" for t in (min(late.values()), max(late.values())))
        return [
            f"the times of {name_some(late)} begin at {first}"
            + (f" to {last}" if last != first else "")
            + " s: in sentences and in the extended model instants count from there"
        ]

    def restore(self, record: Diagnosis) -> Diagnosis:
        """The diagnosis of these runs with rows and instants by the recordings' clocks.

        Parameters
        ----------
        record
            By the runs' own times; a piece of a run is named after it.

        Returns
        -------
        Diagnosis
            The same where all clocks begin with the runs.
        """
        if not any(self.begin_s):
            return record
        names = json.loads(record.run_ids)
        late = np.array([self._tell_begin_s(name) for name in names])
        report = record.read_report()
        for entry in report["effects"]:
            values = {**entry.get("parameters", {}), **entry.get("held", {})}
            if INSTANT in values:
                (name, *_) = entry.get("runs") or [names[int(values[RUN]["value"])]]
                values[INSTANT]["value"] += self._tell_begin_s(name)
        for course in (report.get("forecast") or {}).get("course", []):
            begin = self._tell_begin_s(course["run"])
            course["time_s"] = [t + begin for t in course["time_s"]]
        return record.replace(
            time_s=record.time_s + late[record.run],
            report=json.dumps(report, ensure_ascii=False),
        )

    def _tell_begin_s(self, name: str) -> float:
        """Of the run of this name, or of which it is a piece: the longest name that it begins
        with."""
        own = [k for k, wave in enumerate(self.waves) if name.startswith(wave.run_id)]
        return self.begin_s[max(own, key=lambda k: len(self.waves[k].run_id))] if own else 0.0


def count_from_begin(waves: Sequence[Wave]) -> RunClocks:
    """Runs with times that count from their first samples.

    The wave stays: its phase goes on against e^{jωt} of the new time, φ + ω_r t₀ (PHYSICS §0).

    Parameters
    ----------
    waves
        Each (n,) rows; a run whose clock shows less than a window at its first sample keeps it.

    Returns
    -------
    RunClocks
        With what the clocks show then.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.run_clock import count_from_begin
    >>> wave = draw_waves()[0]
    >>> clocks = count_from_begin([wave, wave.replace(time_s=wave.time_s + 1234.0)])
    >>> [round(t, 2) for t in clocks.begin_s]
    [0.0, 1234.0]
    >>> bool(clocks.waves[1].time_s[0] < wave.window_s)
    True
    """
    begin_s = [_find_begin_s(wave) for wave in waves]
    own = [
        _count_from(wave, begin) if begin else wave
        for wave, begin in zip(waves, begin_s, strict=True)
    ]
    return RunClocks(own, begin_s)


def _find_begin_s(wave: Wave) -> float:
    """What a run's clock shows at its first sample; 0 where that is less than a window."""
    if not len(wave):
        return 0.0
    begin = float(wave.time_s[0]) - wave.window_s / 2
    return begin if abs(begin) >= wave.window_s else 0.0


def _count_from(wave: Wave, begin_s: float) -> Wave:
    turned = 2 * np.pi * np.mod(wave.reference_frequency_hz * begin_s, 1.0)
    return wave.replace(
        time_s=np.asarray(wave.time_s, float) - begin_s,
        phase_rad=np.asarray(wave.phase_rad, float) + turned,
    )
