"""A production made by hand: resonator files of gyros with known spreads, stations and repeats."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from hrg_cli import store
from hrg_cli.ledger import database
from hrg_cli.ledger.entry import Entry, Figure
from hrg_cli.records import Provenance, Resonator, Source

BEGIN = datetime(2026, 3, 1, 8, tzinfo=UTC)
NOMINAL = {
    "frequency_hz": (5000.0, 1e-5, "Hz"),
    "damping_rate_1_s": (0.01, 1e-7, "s-1"),
    "damping_split_1_s": (2e-4, 1e-7, "s-1"),
    "damping_axis_rad": (0.35, 1e-4, "rad"),
    "frequency_split_rad_s": (0.1, 1e-4, "rad s-1"),
    "stiffness_axis_rad": (0.9, 1e-4, "rad"),
    "scale_factor": (0.554, 1e-5, "1"),
}


def resonator(
    gyro: str, day: float = 0.0, samples: str = "", status="valid", **values
) -> Resonator:
    """A resonator of a gyro; values by name, σ those of `NOMINAL`."""
    names = list(NOMINAL)
    value = np.array([values.get(name, NOMINAL[name][0]) for name in names], float)
    std = np.array([NOMINAL[name][1] for name in names])
    fingerprint = samples or f"{gyro} {day!r}"
    source = Source("free.wave.h5", "wave", "0" * 64, (fingerprint,))
    created = (BEGIN + timedelta(days=day)).strftime("%Y-%m-%dT%H:%M:%SZ")
    return Resonator(
        name=np.array(names, object),
        value=value,
        std=std,
        units=np.array([NOMINAL[name][2] for name in names], object),
        covariance=np.diag(std**2),
        gyro_id=gyro,
        lot_id="L7",
        status=status,
        status_reasons=() if status == "valid" else ("made by hand",),
        provenance=Provenance(created=created, generated_by="hrg 0.1.0", sources=(source,)),
    )


def write(path: Path, *arguments, **values) -> Path:
    """Such a resonator as a file."""
    store.write(path, resonator(*arguments, **values), force=True)
    return path


def entry(
    gyro: str, day: float, value: float, std: float = 1e-4, name="frequency_split_rad_s", **more
) -> Entry:
    """An entry with one figure, without a file."""
    processed = (BEGIN + timedelta(days=day)).strftime("%Y-%m-%dT%H:%M:%SZ")
    given = {
        "sha256": f"{gyro} {day!r} {value!r}",
        "file": "resonator.h5",
        "kind": "resonator",
        "gyro_id": gyro,
        "processed": processed,
        "status": "valid",
        "samples": (f"{gyro} {day!r} {value!r}",),
        "figures": {name: Figure(value, std, "rad s-1")},
    }
    return Entry(**(given | more))


def production(
    ledger: Path, gyros: int = 30, seed: int = 1, station_shift: float = 3e-4
) -> list[Entry]:
    """Enter a month: so many gyros (spread 5e-3 rad/s), every third measured on both stations and
    repeated; the golden unit G-000 once a day on each; station 2 reads more and drifts."""
    rng = np.random.default_rng(seed)
    rows = []
    for number in range(1, gyros + 1):
        true = 0.1 + 5e-3 * rng.standard_normal()
        for repeat in range(4 if number % 3 == 0 else 1):
            station = 1 + (number + repeat) % 2
            value = true + station_shift * (station == 2) + 1e-4 * rng.standard_normal()
            day = number + repeat / 10
            rows.append(entry(f"SN-{number:03d}", day, value, station=str(station)))
    for day in range(gyros):
        for station in (1, 2):
            drift = station_shift * (station == 2) * (1 + day / 10)
            value = 0.1 + drift + 1e-4 * rng.standard_normal()
            rows.append(entry("G-000", day + 0.5 + 0.01 * station, value, station=str(station)))
    database.add_entries(ledger, sorted(rows, key=lambda e: e.processed))
    return rows
