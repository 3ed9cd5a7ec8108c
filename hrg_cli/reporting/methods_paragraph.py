"""A paragraph for a report: what was done to these data, with whose methods, in words that may be
copied."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..records import Calibration, Diagnosis, Record, Resonator
from ..stages.rate_table import is_rate_table
from ..version import __version__
from .json_text import list_entries, parse_list, parse_object

CITATIONS = (
    (
        "D. D. Lynch, Vibratory gyro analysis by the method of averaging, 2nd St. Petersburg Int."
        " Conf. on Gyroscopic Technology (1995)"
    ),
    (
        "K. V. Shishakov, Algorithmic enhancement of the accuracy of solid-state wave gyroscopes'"
        " signals (in Russian, 2022), doi:10.22213/2410-9304-2022-4-34-47"
    ),
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement, 7.2.2",
)
_MARK = re.compile(r"\[(\d)\]")


@dataclass(frozen=True)
class Methods:
    """The paragraph, and what it cites, in the order in which it does."""

    text: str
    citations: tuple[str, ...]


def write_methods(records: Sequence[Record], counts: Mapping[str, int]) -> Methods:
    """The paragraph of a paper's methods section, with what it cites.

    Parameters
    ----------
    records
        Results; only what they were made by is in it.
    counts
        Kind -> how many files.

    Returns
    -------
    methods.Methods
    -------
        Text, and citations in its order.

    Examples
    --------
    >>> from hrg_cli.reporting.methods_paragraph import write_methods
    >>> found = write_methods([], {"wave": 2})
    >>> found.text[:29], len(found.citations) > 0
    ('2 recordings were demodulated', True)
    """
    of = {record.kind: record for record in records}
    runs = counts.get("wave") or counts.get("recording") or 0
    said = []
    if runs:
        were = "recording was" if runs == 1 else "recordings were"
        said.append(
            f"{runs} {were} demodulated by least squares in windows at the oscillation frequency,"
            " and each window's envelopes resolved into the standing wave's main amplitude,"
            " quadrature, angle and phase with their standard deviations."
        )
    said += _of_resonator(of.get("resonator"))
    said += _of_diagnosis(of.get("diagnosis"))
    said += _of_calibration(of.get("calibration"))
    said.append(
        "Values are given with their standard deviation in the last digits [3]. Computed with hrg"
        f" {__version__}."
    )
    return _numbered(" ".join(said))


def _of_resonator(resonator: Record | None) -> list[str]:
    if not isinstance(resonator, Resonator):
        return []
    if resonator.modes_alone:
        return [
            "Frequencies and decays of one mode or two, as the data ask for, were fitted to the"
            " demodulated signals by maximum likelihood; without a pair of channels there are no"
            " axes."
        ]
    return [
        "Damping and frequency split, their axes and the scale factor were fitted to all free"
        " runs together by maximum likelihood on the averaged (slow) equations of motion [1]."
    ]


def _of_diagnosis(diagnosis: Record | None) -> list[str]:
    if not isinstance(diagnosis, Diagnosis):
        return []
    report = parse_object(diagnosis.report)
    tested, found = len(list_entries(report, "tested")), len(list_entries(report, "effects"))
    taken = len(parse_list(diagnosis.run_ids))
    held = f"The same model was held against {taken} run{'s' if taken != 1 else ''} for {tested}"
    if not found:
        return [
            f"{held} further effects, which would be taken in where they are significant after"
            " correction for the number tried and judged on data held out; none was."
        ]
    return [
        f"{held} further effects; {found} {'was' if found == 1 else 'were'} taken in, each"
        " significant after correction for the number tried and judged on data held out. A"
        " cause's share is the wave's difference between the fits with and without it,"
        " everything else fitted anew."
    ]


def _of_calibration(calibration: Record | None) -> list[str]:
    if not isinstance(calibration, Calibration):
        return []
    if is_rate_table(calibration):
        return [
            "Bias, scale factor and powers of the rate were fitted to the dwells over temperature;"
            " residuals are stated for dwells held out."
        ]
    return [
        "Drift and scale factor were tabulated as Fourier series of the wave angle over"
        " temperature from forced whole-angle runs; residuals are stated for data held out [2]."
    ]


def _numbered(text: str) -> Methods:
    """The marks of `CITATIONS` as numbers in the order of the text."""
    order = list(dict.fromkeys(_MARK.findall(text)))
    numbered = _MARK.sub(lambda mark: f"[{order.index(mark[1]) + 1}]", text)
    return Methods(numbered, tuple(CITATIONS[int(n) - 1] for n in order))
