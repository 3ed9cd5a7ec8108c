"""What of the runs given to `calibrate` can make tables: usable windows, forced and free runs,
nodes, and what the programme lacks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ...fitting.tables.increments import AnglePath, build_path
from ...records import Calibration, Resonator, Wave
from ...units import KELVIN_DEGC
from ..kelvin_logs import average_log, find_kelvin_logs
from ..one_gyro import find_two_gyros, need_each_once, need_same_gyro
from ..shared_noise import need_own_noise
from ..usable import Usable, drop_refused, name_apart, restrict_to_known_rates
from .free_runs import tell_free_runs
from .programme import choose_nodes, examine

Array = np.ndarray


@dataclass(frozen=True)
class KnownRates:
    """Rates that no log holds: constant ones by run_id, one for all others, and the Earth's,
    rad/s."""

    of_runs: Mapping[str, float]
    of_all: float | None
    earth_rad_s: float

    def find_rate(self, wave: Wave) -> float | None:
        """The constant rate of a run; None where its log tells."""
        return self.of_runs.get(wave.run_id, self.of_all if wave.rate_rad_s is None else None)


@dataclass(frozen=True)
class PreparedRuns:
    """Runs as paths of the wave angle, the nodes, and what to say of the programme."""

    usable: Usable
    forced: list[AnglePath]
    """Those the tables are made from."""
    free: list[AnglePath]
    nodes: Array
    """(j,) of `axis`."""
    valid: tuple[float, float]
    """Range of the nodes' quantity."""
    notes: list[str]
    refusals: list[str]
    """Why the programme cannot give the tables."""
    remarks: list[str]

    def judge(
        self, record: Calibration, refusals: Sequence[str], remarks: Sequence[str]
    ) -> Calibration:
        """The record with everything there is to say in its status."""
        notes = [*self.usable.notes, *self.notes]
        noted = record.judged(notes, "valid").judged(self.usable.doubts, "suspect")
        judged = noted.judged(refusals, "refused").judged(remarks, "suspect")
        return judged.judged(self.usable.inherited, "suspect")


def prepare(
    waves: Sequence[Wave],
    rates: KnownRates,
    axis: str,
    nodes: list[float] | None,
    harmonics: int,
    needed: tuple[int, int],
) -> PreparedRuns:
    """Runs as paths of the wave angle, the nodes of their tables, and whether the programme gives
    them.

    Parameters
    ----------
    waves
        The runs.
    rates
        That no log holds.
    axis
        Quantity of the nodes: "temperature" or "frequency".
    nodes
        [°C or Hz]; None: from the runs.
    harmonics
        Of 2mθ in the paths.
    needed
        Of 2mθ that the drift and the scale factor shall have.

    Returns
    -------
    PreparedRuns
        With what to say of the programme.

    Raises
    ------
    HrgError
        No run that can be read as a path, or no nodes.

    Examples
    --------
    Two free runs at rest: the tables would be those of free runs, and there is no rate to tell K
    from.

    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.preparation import KnownRates
    >>> from hrg_cli.stages.calibration.preparation import prepare
    >>> from hrg_cli.stages.planning.information import make_wave
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> (run,) = list_runs(
    ...     {
    ...         "device": {"frequency_hz": 5000.0, "quality_factor": 1e6},
    ...         "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ...         "readout": {"noise": 1e-3},
    ...     }
    ... )
    >>> found = prepare(
    ...     [make_wave(run)], KnownRates({}, None, 0.0), "temperature", [25.0], 1, (1, 1)
    ... )
    >>> len(found.forced), len(found.refusals) > 0
    (1, True)
    """
    given = [wave.run_id for wave in waves if rates.find_rate(wave) is not None]
    usable = restrict_to_known_rates(drop_refused(waves), given)
    with usable.blame_refusals():
        paths = [
            build_path(
                named,
                harmonics=harmonics,
                rate_rad_s=rates.find_rate(wave),
                earth_rate_rad_s=rates.earth_rad_s,
            )
            for wave, named in zip(usable.waves, name_apart(usable.waves))
        ]
    forced, free, notes, remarks = _split_by_drive(paths)
    table_nodes, low, high, words = choose_nodes(forced, axis, nodes)
    findings = examine(forced, table_nodes, axis, *needed)
    kelvin, kelvin_alone = _find_kelvin(paths)
    if kelvin:  # what a programme with a node of its own for them lacks is no other fault
        findings = []
    return PreparedRuns(
        usable,
        forced,
        free,
        table_nodes,
        (low, high),
        notes,
        refusals=[
            *usable.refusals,
            *_refuse_two_gyros(paths),
            *kelvin,
            *(f.sentence for f in findings if f.refuses),
        ],
        remarks=[*remarks, *words, *kelvin_alone, *(f.sentence for f in findings if not f.refuses)],
    )


def _split_by_drive(
    paths: Sequence[AnglePath],
) -> tuple[list[AnglePath], list[AnglePath], list[str], list[str]]:
    """Forced runs, free runs, what to note and what to doubt: where no run is forced, the free ones
    take their place."""
    forced, free = [p for p in paths if p.forced], [p for p in paths if not p.forced]
    if forced:
        return forced, free, *tell_free_runs(free)
    return (
        free,
        [],
        [],
        ["no run is forced: the tables are those of free runs, without the drive's own errors"],
    )


def _refuse_two_gyros(paths: Sequence[AnglePath]) -> list[str]:
    """Why runs that oscillate too far apart give no tables, whatever their files say."""
    names = [path.run_id or f"number {i + 1}" for i, path in enumerate(paths)]
    two = find_two_gyros(names, np.array([np.median(path.frequency_hz) for path in paths]))
    if two is None:
        return []
    return [
        f"{two}, farther than any temperature moves it; calibrate them apart, or correct the"
        " sampling rate of the recording"
    ]


def _find_kelvin(paths: Sequence[AnglePath]) -> tuple[list[str], list[str]]:
    """Runs with thermometers in K: why there are no tables where others are in °C, since they would
    be a node apart, and a remark where all are as hot."""
    names = [path.run_id or f"number {i + 1}" for i, path in enumerate(paths)]
    levels = np.array([average_log(path.temperature_degc) for path in paths])
    hz = np.array([np.median(path.frequency_hz) for path in paths])
    said = [one.sentence for one in find_kelvin_logs(names, levels, hz)]
    return (said, []) if (levels <= KELVIN_DEGC).any() else ([], said[:1])


def need_one_gyro(waves: Sequence[Wave], resonators: Sequence[Resonator]) -> None:
    """Refuse runs and resonators that are not of one gyro.

    Parameters
    ----------
    waves
        The runs.
    resonators
        Whose coefficients are to be used beside them.

    Raises
    ------
    HrgError
        No run, or runs and resonators of several gyros or mode numbers.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.preparation import need_one_gyro
    >>> need_one_gyro([], [])
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: calibrate needs at least one wave file of a forced run; none was given
    """
    if not waves:
        raise HrgError("calibrate needs at least one wave file of a forced run; none was given")
    need_same_gyro(waves, "calibrate")
    need_each_once(waves)
    need_own_noise(waves)
    for resonator in resonators:
        need_same_gyro(waves, "calibrate", resonator)
    modes = sorted({w.mode_number for w in waves})
    if len(modes) > 1:
        raise HrgError(
            f"runs of mode numbers {modes} were given, one was expected; correct mode_number of the"
            " recordings"
        )
