"""All rehearsals of a result together: their statistics, the sentences that make the result
suspect, and its record with both.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...errors import HrgError
from ...records import REHEARSAL as PREFIX
from ...records import Calibration, Diagnosis, Record, Resonator
from . import twin_colour
from .rehearsed_figures import Rehearsed, RehearsedFigure
from .statistics import FigureStatistics, Named, judge_figure
from .twin import Twin
from .twin_diagnosis import list_causes, list_held_causes

FEWEST = 2
"""Rehearsals that must succeed for anything to be said."""
FAILING = 0.1
"""Part of the rehearsals that may fail."""


@dataclass(frozen=True)
class Rehearsal:
    """All rehearsals of a result: the figures, the sentences that make it suspect, and how many
    failed."""

    times: int
    figures: Sequence[FigureStatistics]
    reasons: tuple[str, ...]
    failed: int
    statuses: Mapping[str, int]
    truth: str
    causes: Sequence[Named] = ()
    colour: Sequence[Mapping[str, Any]] = ()

    @property
    def status(self) -> str:
        """Whether the result's errors hold."""
        return "suspect" if self.reasons else "valid"

    def to_json(self) -> dict[str, Any]:
        """The rehearsal as the JSON has it."""
        return {
            "times": self.times,
            "figures": [asdict(figure) for figure in self.figures],
            "failed": self.failed,
            "statuses": dict(self.statuses),
            "truth": self.truth,
            "causes": [asdict(cause) for cause in self.causes],
            "colour": [dict(component) for component in self.colour],
        }


def _count_names(twin: Twin, good: Sequence[Rehearsed]) -> list[Named]:
    """How often each cause was named: those of the truth (or one that cannot be told from it), then
    any other."""
    if not isinstance(twin.truth, Diagnosis):
        return []
    true = list_held_causes(twin)
    alike = {name: {name} | rivals for name, (_, rivals) in true.items()}
    known = set().union(*alike.values()) if alike else set()
    # what the file names and the twin cannot hold is neither expected of it nor strange to it
    known |= set(list_causes(twin.truth))
    out = [
        Named(name, True, sum(bool(own & set(one.named)) for one in good), len(good))
        for name, own in alike.items()
    ]
    others = sorted({name for one in good for name in one.named} - known)
    return out + [
        Named(name, False, sum(name in one.named for one in good), len(good)) for name in others
    ]


def summarise(twin: Twin, done: Sequence[Rehearsed]) -> Rehearsal:
    """The rehearsals' statistics and verdict.

    Parameters
    ----------
    twin
        That was rehearsed.
    done
        What each rehearsal found.

    Returns
    -------
    Rehearsal
        Every figure that was estimated, and the sentences that make the result suspect.

    Raises
    ------
    HrgError
        Fewer than `FEWEST` of the rehearsals gave a result.

    Examples
    --------
    Errors of ±0.9 σ are right ones:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.rehearsing.rehearsed_figures import Rehearsed, RehearsedFigure
    >>> from hrg_cli.stages.rehearsing.rehearsals import summarise
    >>> one = np.ones(1)
    >>> truth = Resonator(
    ...     name=np.array(["scale_factor"]), units=np.array(["1"]), value=one, std=one,
    ...     covariance=np.eye(1),
    ... )
    >>> done = [
    ...     Rehearsed({"scale_factor": RehearsedFigure(0.55 + off, 1e-3, 0.55)}, "valid")
    ...     for off in 0.9e-3 * np.resize([1, -1], 20)
    ... ]
    >>> told = summarise(Told(truth=truth, runs=[]), done)
    >>> told.status, round(told.figures[0].error_over_std_rms, 6), told.failed
    ('valid', 0.9, 0)
    """
    good = [one for one in done if one.status != "failed"]
    failed = [one for one in done if one.status == "failed"]
    if len(good) < FEWEST:
        raise HrgError(
            f"{len(failed)} of {len(done)} rehearsals failed; the first: {failed[0].reason}"
        )
    figures = _judge_figures(good)
    named = _count_names(twin, good)
    reasons = [sentence for sentence in (f.describe_fault() for f in figures) if sentence]
    reasons += [s for s in (cause.describe_fault(len(named)) for cause in named) if s]
    if len(failed) > FAILING * len(done):
        reasons.append(
            f"{PREFIX}{len(failed)} of {len(done)} simulated twins gave no result; the first:"
            f" {failed[0].reason}"
        )
    refused = sum(one.status == "refused" for one in good)
    if refused > FAILING * len(done):
        first = next(one.reason for one in good if one.status == "refused")
        reasons.append(
            f"{PREFIX}{refused} of {len(done)} results of simulated twins were refused; the first:"
            f" {first}"
        )
    statuses = {
        status: sum(one.status == status for one in good)
        for status in ("valid", "suspect", "refused")
    }
    what = {
        Resonator: "the file's parameters",
        Calibration: "the file's tables",
        Diagnosis: "the file's extended model",
    }[type(twin.truth)]
    colour = twin_colour.describe_colour([run.colour for run in twin.runs])
    return Rehearsal(len(done), figures, tuple(reasons), len(failed), statuses, what, named, colour)


def _judge_figures(good: Sequence[Rehearsed]) -> list[FigureStatistics]:
    """The statistics of every figure that was estimated."""
    by_name: dict[str, list[RehearsedFigure]] = {}
    for one in good:
        for name, figure in one.figures.items():
            by_name.setdefault(name, []).append(figure)
    estimated = {
        name: found
        for name, found in by_name.items()
        if _is_estimated([figure.value for figure in found])
    }
    return [
        judge_figure(
            name,
            np.array([figure.compute_t() for figure in found]),
            len(estimated),
            doubted=any(figure.doubted for figure in found),
            stated=float(np.median([figure.stated for figure in found])),
            std=np.array([figure.std for figure in found]),
        )
        for name, found in estimated.items()
    ]


def _is_estimated(values: Sequence[float]) -> bool:
    """Whether a figure was estimated at all: what a model holds comes out the same every time."""
    return len(values) >= FEWEST and float(np.ptp(values)) > 0


def judge_by_rehearsal(record: Record, rehearsal: Rehearsal) -> Record:
    """The record with the rehearsal's verdict in its status and its figures in its details.

    Parameters
    ----------
    record
        The result; what an earlier rehearsal said of it is replaced.
    rehearsal
        Of it.

    Returns
    -------
    Record
        Suspect for the rehearsal's reasons, beside those that it had of its own.

    Examples
    --------
    >>> import json
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.rehearsing.rehearsals import Rehearsal, judge_by_rehearsal
    >>> one = np.ones(1)
    >>> found = Resonator(
    ...     name=np.array(["scale_factor"]), units=np.array(["1"]), value=one, std=one,
    ...     covariance=np.eye(1), details="{}",
    ... )
    >>> judged = judge_by_rehearsal(found, Rehearsal(30, [], (), 0, {"valid": 30}, "the file's"))
    >>> judged.status, json.loads(judged.details)["rehearsal"]["times"]
    ('valid', 30)
    """
    others = tuple(reason for reason in record.status_reasons if not reason.startswith(PREFIX))
    status = (
        "valid"
        if record.status == "suspect" and record.status_reasons and not others
        else record.status
    )
    place = "report" if isinstance(record, Diagnosis) else "details"
    told = json.loads(getattr(record, place)) | {"rehearsal": rehearsal.to_json()}
    return record.replace(
        status=status,
        status_reasons=others,
        **{place: json.dumps(told, ensure_ascii=False)},
    ).judged(rehearsal.reasons)
