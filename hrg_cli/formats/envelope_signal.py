"""Which columns of a log hold an envelope, and the envelope of their rows: I and Q, amplitude and
phase, or an amplitude alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HrgError
from ..records import Array, Status
from ..records.recording import ONE_CHANNEL
from .log import Log
from .log_columns import find_column_number, list_columns
from .unit_spellings import find_phase_factor, is_level, spell_channel_unit

ALIASES = {
    "c_in_phase": (
        "c_in_phase",
        "c_i",
        "ci",
        "i1",
        "x1",
        "x",
        "i",
        "in-phase",
        "in phase",
        "real",
        "re",
    ),
    "c_quadrature": ("c_quadrature", "c_q", "cq", "q1", "y1", "y", "q", "quadrature", "imag", "im"),
    "s_in_phase": ("s_in_phase", "s_i", "si", "i2", "x2"),
    "s_quadrature": ("s_quadrature", "s_q", "sq", "q2", "y2"),
    "amplitude": ("amplitude", "r", "magnitude", "mag", "level", "power", "ampl"),
    "phase": ("phase", "theta", "phi", "angle"),
}
"""Role -> titles it goes by where no column is named."""


@dataclass(frozen=True)
class EnvelopeSignal:
    """Which columns hold the envelope and how: role -> index."""

    columns: dict[str, int]
    decibel: bool
    phase_factor: float
    sign: int
    scale: tuple[float, ...]

    @classmethod
    def find(
        cls,
        log: Log,
        path: Path,
        named: dict[str, Any],
        decibel: bool,
        phase_units: str | None,
        sign: int,
    ) -> EnvelopeSignal:
        """The columns that were named, or those that their titles tell. HrgError: none, or half a
        pair."""
        columns = {
            role: find_column_number(log, str(path), role, wanted)
            for role, wanted in named.items()
            if wanted is not None
        }
        if not columns:
            columns = _told_by_titles(log)
        _need_whole_pairs(columns, log, path)
        _need_unit(columns, log, path, decibel)
        factor = 1.0
        if "phase" in columns:
            unit = phase_units or log.channels[columns["phase"]].units
            if not unit:
                raise HrgError(
                    f"{path}: the unit of the phase in column {columns['phase'] + 1} is not told;"
                    " give phase_units: deg or rad"
                )
            factor = find_phase_factor(unit)
        return cls(
            columns,
            decibel,
            factor,
            sign,
            tuple(log.channels[i].scale_factor for i in columns.values()),
        )

    def find_unit(self, log: Log) -> str:
        """Unit of the signals: the log's, or what its level is relative to."""
        told = log.channels[next(iter(self.columns.values()))].units
        if self.decibel:
            return {
                "dbv": "V",
                "dbmv": "mV",
                "dbuv": "µV",
                "dbµv": "µV",
                "dbvrms": "V",
                "dbm": "mW^0.5",
                "dbw": "W^0.5",
            }.get(told.lower(), "1")
        return spell_channel_unit(told)

    def compute_envelopes(self, columns: list[Array]) -> Array:
        """u = I + jQ (channel, n), channel S zero where there is none."""
        values = dict(
            zip(
                self.columns,
                (np.asarray(c, float) * k for c, k in zip(columns, self.scale, strict=True)),
                strict=True,
            )
        )
        u = np.zeros((2, len(columns[0])), complex)
        if "amplitude" in values:
            size = 10 ** (values["amplitude"] / 20) if self.decibel else values["amplitude"]
            u[0] = (
                size * np.exp(1j * self.sign * self.phase_factor * values["phase"])
                if "phase" in values
                else size
            )
        else:
            u[0] = values["c_in_phase"] + 1j * self.sign * values["c_quadrature"]
            if "s_in_phase" in values:
                u[1] = values["s_in_phase"] + 1j * self.sign * values["s_quadrature"]
        return u

    @property
    def phase_known(self) -> bool:
        """Whether there is more than an amplitude."""
        return "amplitude" not in self.columns or "phase" in self.columns

    def judge(self, reference_hz: float) -> list[tuple[Status, str]]:
        """What these columns cannot tell."""
        if not self.phase_known:
            return [
                (
                    "suspect",
                    (
                        "only an amplitude was recorded: its decay can be found; the frequency is"
                        f" {reference_hz:g} Hz as given, and wave angle, quadrature and splits"
                        " cannot be seen in this run"
                    ),
                )
            ]
        if "s_in_phase" not in self.columns:
            return [
                (
                    "suspect",
                    (
                        f"{ONE_CHANNEL}: wave angle, quadrature"
                        " and splits cannot be seen in this run"
                    ),
                )
            ]
        return []


def _told_by_titles(log: Log) -> dict[str, int]:
    """Role -> column of the first group of roles whose titles are all there."""
    names = {
        c.name.lower(): i for i, c in reversed(list(enumerate(log.channels))) if c.kind == "number"
    }
    told = {
        role: next((names[t] for t in titles if t in names), None)
        for role, titles in ALIASES.items()
    }
    groups = (
        ("c_in_phase", "c_quadrature", "s_in_phase", "s_quadrature"),
        ("c_in_phase", "c_quadrature"),
        ("amplitude", "phase"),
        ("amplitude",),
    )
    for group in groups:
        found = {role: index for role in group if (index := told[role]) is not None}
        if len(found) == len(group):
            return found
    return {}


NEEDS = {
    "c_in_phase": "c_quadrature",
    "c_quadrature": "c_in_phase",
    "s_in_phase": "s_quadrature",
    "s_quadrature": "s_in_phase",
    "phase": "amplitude",
}
"""Role -> the other half of its pair; an amplitude alone is enough."""


def _need_whole_pairs(columns: dict[str, int], log: Log, path: Path) -> None:
    """HrgError: no columns, one of them twice, or half a pair."""
    if "amplitude" in columns and len(set(columns) - {"amplitude", "phase"}):
        raise HrgError(
            f"{path}: amplitude and in-phase columns are both named; give I and Q, or amplitude"
            " and phase"
        )
    half = next((role for role in NEEDS if role in columns and NEEDS[role] not in columns), None)
    if half is not None:
        raise HrgError(
            f"{path}: {half} is named without {NEEDS[half]}; name both (its columns are"
            f" {list_columns(log)})"
        )
    if "s_in_phase" in columns and "c_in_phase" not in columns:
        raise HrgError(
            f"{path}: channel S is named without channel C; name a single pick-off's columns as"
            " c_in_phase and c_quadrature"
        )
    if not columns:
        raise HrgError(
            f"{path}: which columns hold the envelope? Its columns are {list_columns(log)}; name"
            " c_in_phase and c_quadrature (and those of s), or amplitude and phase"
        )
    if len(set(columns.values())) < len(columns):
        raise HrgError(
            f"{path}: one column is named twice for the envelope; its columns are"
            f" {list_columns(log)}"
        )


def _need_unit(columns: dict[str, int], log: Log, path: Path, decibel: bool) -> None:
    """HrgError: levels that were not said to be levels, I and Q that were, or columns of the
    signals in several units."""
    units = (log.channels[i].units for i in columns.values())
    level = next((unit for unit in units if is_level(unit)), None)
    if level is not None and not decibel:
        raise HrgError(
            f"{path}: a column of the envelope is in {level}; add decibel, or export it in its"
            " own unit"
        )
    if decibel and "amplitude" not in columns:
        raise HrgError(f"{path}: decibel is for an amplitude; I and Q are no levels")
    told: dict[str, str] = {}
    for role, i in columns.items():
        channel = log.channels[i]
        if role != "phase" and channel.units:
            told.setdefault(spell_channel_unit(channel.units), channel.name)
    if len(told) > 1:
        (unit, name), (other, another) = list(told.items())[:2]
        raise HrgError(
            f"{path}: column {name!r} is in {unit!r} and {another!r} in {other!r}; all columns of"
            " the signals in one unit were expected: write them so"
        )
