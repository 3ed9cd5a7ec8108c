"""Result files to entries: figures with their σ, the recordings behind them, who made them
where."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field

from .. import store
from ..comparing import find_std, is_told_once
from ..errors import HrgError
from ..limit_values import find_unit
from ..limits import list_figures
from ..records import Calibration, Diagnosis, Record, Resonator, Wave
from ..records.time_origin import parse_time
from . import database
from .entry import KINDS, Entry, Figure
from .times import format_time


def enter(
    ledger: Path,
    files: Sequence[Path],
    *,
    station: Annotated[str, Field(description="test station that measured")] = "",
    operator: Annotated[str, Field(description="who measured")] = "",
    fixture: Annotated[str, Field(description="fixture that held the gyro")] = "",
    firmware: Annotated[str, Field(description="firmware of the gyro or station")] = "",
    order: Annotated[str, Field(description="work order; none: the files' lot")] = "",
    gyro_id: Annotated[str, Field(description="serial number where the files name none")] = "",
) -> list[tuple[Entry, bool]]:
    """Enter result files into a ledger, all or none.

    Parameters
    ----------
    ledger
        File of the ledger; it is made where there is none.
    files
        Of results.
    station, operator, fixture, firmware
        Under which circumstances was measured.
    order
        Work order; empty: the files' lot.
    gyro_id
        Where the files name none.

    Returns
    -------
    list of tuple
        Each entry, and whether it is new: a file is entered once, by its content.

    Raises
    ------
    HrgError
        A file that is no result, is damaged or names no gyro; as `database.add_entries`.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Resonator, store
    >>> from hrg_cli.ledger.entering import enter
    >>> found = Resonator(
    ...     name=np.array(["scale_factor"]), units=np.array(["1"]), value=np.array([0.55]),
    ...     std=np.array([1e-3]), covariance=np.array([[1e-6]]), gyro_id="SN-1",
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file, ledger = Path(folder) / "resonator.h5", Path(folder) / "ledger.db"
    ...     _ = store.write(file, found)
    ...     [enter(ledger, [file])[0][1] for _ in range(2)]
    [True, False]
    """
    given = {
        "station": station,
        "operator": operator,
        "fixture": fixture,
        "firmware": firmware,
        "order": order,
    }
    entries = [make_entry(path, gyro_id, given) for path in files]
    return list(zip(entries, database.add_entries(ledger, entries), strict=True))


def make_entry(path: Path, gyro_id: str, given: Mapping[str, str]) -> Entry:
    """The entry of a result file.

    Parameters
    ----------
    path
        The file.
    gyro_id
        Where it names none.
    given
        `CIRCUMSTANCES` that are known.

    Returns
    -------
    Entry
        With every finite figure that is told once, and the recordings behind it.

    Raises
    ------
    HrgError
        It is no result, is damaged, or names no gyro.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Resonator, store
    >>> from hrg_cli.ledger.entering import make_entry
    >>> found = Resonator(
    ...     name=np.array(["scale_factor"]), units=np.array(["1"]), value=np.array([0.55]),
    ...     std=np.array([1e-3]), covariance=np.array([[1e-6]]), gyro_id="SN-1",
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = store.write(Path(folder) / "resonator.h5", found)
    ...     entry = make_entry(Path(folder) / "resonator.h5", "", {"station": "north"})
    >>> entry.gyro_id, entry.station, entry.figures["scale_factor"]
    ('SN-1', 'north', Figure(value=0.55, std=0.001, units='1'))
    """
    digest = store.compute_sha256(path)
    kind = store.find_kind(path)
    if kind.kind not in KINDS:
        raise HrgError(
            f"{path}: is a {kind.kind} file; the ledger keeps a gyro's results, which are"
            f" {', '.join(KINDS)} files"
        )
    record = store.read(path, kind)
    gyro = str(getattr(record, "gyro_id", "")) or gyro_id
    if not gyro:
        raise HrgError(f"{path}: names no gyro; give its serial number with --gyro-id")
    try:
        figures = list_figures(record)
    except HrgError as error:
        raise HrgError(f"{path}: {error}") from error
    waves = _waves_of(path, record)
    lot = str(getattr(record, "lot_id", "")) or next((w.lot_id for w in waves if w.lot_id), "")
    begun = [_checked_time(path, w.start_time) for w in waves]
    now = time.time()
    return Entry(
        sha256=digest,
        file=path.name,
        kind=record.kind,
        gyro_id=gyro,
        processed=_checked_time(path, record.provenance.created) or format_time(now),
        measured=min(begun) if begun and all(begun) else "",
        added=format_time(now),
        station=given.get("station", ""),
        operator=given.get("operator", ""),
        fixture=given.get("fixture", ""),
        firmware=given.get("firmware", ""),
        order=given.get("order", "") or lot,
        software=record.provenance.generated_by,
        status=record.status,
        reasons=tuple(map(str, record.status_reasons)),
        verdict=record.verdict if isinstance(record, Diagnosis) else None,
        mode_number=int(getattr(record, "mode_number", figures.get("mode_number", 2))),
        samples=_samples(record),
        figures=_told_figures(record, figures),
    )


def _samples(record: Record) -> tuple[str, ...]:
    """Fingerprints of the recorded samples, those of the waves where no recording is known."""
    sources = record.provenance.sources
    known = {sample for source in sources for sample in source.samples}
    return tuple(sorted(known or {s.sha256 for s in sources if s.kind == "wave"}))


def _told_figures(record: Record, figures: dict[str, float]) -> dict[str, Figure]:
    """Every finite figure that is told once, with its σ where it has one."""
    units = (
        {n: u for n, (_, _, u) in record.parameters().items()}
        if isinstance(record, Resonator)
        else {}
    )
    return {
        name: Figure(float(value), find_std(name, figures), units.get(name, find_unit(name)))
        for name, value in figures.items()
        if math.isfinite(value) and is_told_once(name, figures)
    } | (_mean_coefficients(record) if isinstance(record, Calibration) else {})


def _mean_coefficients(calibration: Calibration) -> dict[str, Figure]:
    """The coefficients of D over the angle and the mean of K, each averaged over the nodes, with σ
    by their covariance: the figures of a table whose own σ is known."""
    nodes, drift = np.shape(calibration.drift_harmonics)
    scale = np.shape(calibration.scale_factor_harmonics)[1]
    covariance = np.asarray(calibration.covariance, float)
    if covariance.shape[0] != nodes * (drift + scale):
        return {}
    turns = [f"{wave}_{k}" for k in range(1, drift // 2 + 1) for wave in ("cos", "sin")]
    names = [f"mean_drift{part}_rad_s" for part in ("", *(f"_{turn}" for turn in turns))]
    found = {}
    for column, name in enumerate([*names, "mean_scale_factor"]):
        at = np.arange(nodes) * (drift + scale) + column
        value = np.column_stack([calibration.drift_harmonics, calibration.scale_factor_harmonics])
        variance = float(covariance[np.ix_(at, at)].mean())
        if np.isfinite(variance) and variance >= 0 and np.isfinite(value[:, column]).all():
            mean = float(value[:, column].mean())
            found[name] = Figure(mean, math.sqrt(variance), find_unit(name))
    return found


def _waves_of(path: Path, record: Record) -> list[Wave]:
    """The waves a result was made of, as far as they lie beside it unchanged (rows not read)."""
    found = []
    for source in record.provenance.sources:
        beside = path.parent / Path(source.name).name
        try:
            if source.kind == "wave" and store.compute_sha256(beside) == source.sha256:
                with store.open_record(beside, Wave) as wave:
                    found.append(wave)
        except HrgError:
            continue  # not there any more, or not readable: then its times are not known
    return found


def _checked_time(path: Path, text: str) -> str:
    """HrgError: a text that is no time."""
    try:
        return format_time(parse_time(text)) if text else ""
    except (ValueError, OverflowError) as error:
        raise HrgError(
            f"{path}: is of {text[:40]!r}, a time such as 2026-01-31T12:00:00Z was expected"
        ) from error
