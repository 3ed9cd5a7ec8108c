"""`hrg compensate`: rate and angle of another run with the tables, Ω = (D − m·dθ/dt)/K, never
outside what they were made for."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.checks import list_failures
from ..fitting.tables.increments import AnglePath, build_path
from ..records import Calibration, Compensated, Wave
from .calibration.interpolation import (
    compute_standard_deviations,
    need_range,
    read_angle_random_walk,
)
from .compensation.angle_spread import AngleSpread
from .compensation.block_rates import find_block_rates
from .compensation.logged_run import LoggedRun
from .compensation.middles import Middles
from .compensation.run_sums import IncrementRates, RateErrors, RunSums
from .compensation.unlogged_temperature import HeldTemperature, fill_temperature
from .earth_rate import AxisAzimuth, AxisTilt, EarthRate, Latitude, find_earth_rate

Array = np.ndarray
CORRECTION = "rate = (D - m*dtheta/dt) / K; subtract drift first, then divide"
"""Sign and order this stage applies; a calibration that asks for another is refused."""


def compensate(
    wave: Wave,
    calibration: Calibration,
    *,
    windows_per_increment: Annotated[
        int,
        Field(
            ge=1,
            description=(
                "windows averaged to one end of an increment; more: less noise, coarser time"
            ),
        ),
    ] = 1,
    earth_rate_deg_h: EarthRate = None,
    latitude_deg: Latitude = None,
    axis_tilt_deg: AxisTilt = 0.0,
    axis_azimuth_deg: AxisAzimuth = 0.0,
) -> Iterator[Compensated]:
    """Rate of each increment and its integral with a calibration's tables.

    Ω_i = (∫w D dt − mΔθ_i)/∫w K dt, from m·dθ/dt = −KΩ + D (seed A after (7)), with its standard
    deviation by the noise of the angle and by the tables' own (`deviations`). Where the rate was
    logged, the residuals with a constant scale factor alone and with the tables are kept beside it.

    A gyro shows the rate against the stars; with the Earth's rate given the answer is the rate
    against the ground, as a table logs it.

    Parameters
    ----------
    wave
        A run of the gyro, (n,) rows; it may be open on disk.
    calibration
        The tables to apply.

    Returns
    -------
    Iterator[Compensated]
        Blocks of increments: time [s], rate with its standard deviation [rad/s], angle [rad].

    Raises
    ------
    HrgError
        Another gyro or mode number, refused tables, a temperature outside the tables, a run that
        was compensated before, a rate log of the wrong sign.

    Examples
    --------
    >>> from hrg_cli import calibrate, collect, compensate, demodulate, estimate, simulate
    >>> config = {
    ...     "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
    ...     "control": {"mode": "forced"},
    ...     "readout": {"noise": 1e-5},
    ...     "recording": {"sample_rate_hz": 8000.0, "duration_s": 8.0},
    ...     "run": [
    ...         {"run_id": "left", "environment": {"rate_rad_s": 2.0}},
    ...         {"run_id": "right", "environment": {"rate_rad_s": -2.0}},
    ...     ],
    ... }
    >>> samples = [collect(simulate(config, model="slow", run=run)) for run in ("left", "right")]
    >>> waves = [collect(estimate(collect(demodulate(r, periods_per_window=50)))) for r in samples]
    >>> tables = calibrate(waves, harmonics=1, scale_factor_harmonics=0, model="table")
    >>> rate = collect(compensate(waves[0], tables)).rate_estimate_rad_s
    >>> len(rate), float(rate.mean().round(4))
    (159, 2.0)
    """
    _guard(wave, calibration)
    filled, known = fill_temperature(wave)
    run, held = LoggedRun.from_wave(filled), HeldTemperature(calibration, known)
    earth = find_earth_rate(earth_rate_deg_h, latitude_deg, axis_tilt_deg, axis_azimuth_deg)
    return _compensate_pieces(run, held, windows_per_increment, earth)


def summarise(record: Compensated) -> dict[str, Any]:
    """Figures of a compensated run for the JSON.

    Parameters
    ----------
    record
        Made by `compensate`.

    Returns
    -------
    dict
        What its details hold.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.compensate import summarise
    >>> summarise(SimpleNamespace(details='{"rate_rms_rad_s": 0.25}'))
    {'rate_rms_rad_s': 0.25}
    """
    return dict(json.loads(record.details))


def _guard(wave: Wave, calibration: Calibration) -> None:
    """HrgError: these tables are not to be applied to this wave."""
    if isinstance(wave, Compensated):
        raise HrgError(
            "the input is compensated already; compensate the wave file it was made from"
        )
    name = f"run {wave.run_id or '?'}"
    if any(" compensate " in line for line in wave.provenance.history):
        raise HrgError(
            f"{name}: is compensated already (its history says so); compensate the wave file it was"
            " made from"
        )
    if wave.gyro_id and calibration.gyro_id and wave.gyro_id != calibration.gyro_id:
        raise HrgError(
            f"{name}: is of gyro {wave.gyro_id}, the tables are of gyro {calibration.gyro_id}; use"
            f" the tables of {wave.gyro_id}"
        )
    if wave.mode_number != calibration.mode_number:
        raise HrgError(
            f"{name}: has mode_number {wave.mode_number}, the tables have"
            f" {calibration.mode_number}; use tables of the same mode"
        )
    if calibration.correction != CORRECTION:
        raise HrgError(
            f'the calibration asks for the correction "{calibration.correction}", this hrg applies'
            f' "{CORRECTION}"; make the tables again'
        )
    if calibration.status == "refused":
        why = "; ".join(calibration.status_reasons) or "no reason is given"
        raise HrgError(
            f"the calibration is refused ({why}); complete its programme and calibrate again"
        )
    if len(wave) < 3:
        raise HrgError(f"{name}: has {len(wave)} windows, at least three are needed")


def _compensate_pieces(
    run: LoggedRun, held: HeldTemperature, windows: int, earth_rate: float
) -> Iterator[Compensated]:
    """The run in pieces that fit into memory, each with the figures of all so far."""
    calibration = held.calibration
    sums = RunSums(calibration, -(-len(run.wave) // windows), run.logged)
    for piece in run.split_pieces(windows):
        whole = build_path(
            piece.wave,
            harmonics=0,
            earth_rate_rad_s=earth_rate,
            per_block=windows,
            need_rate=False,
        )
        need_range(calibration, whole.find_abscissa(calibration.axis), run.name)
        rate, scale = find_block_rates(piece.wave, whole, calibration, windows)
        middles = Middles.from_path(whole)
        found = _judge_increments(whole, rate, scale, middles, piece.own, calibration, sums.angles)
        path = whole.select_rows(piece.own)
        known = run.find_known_rates(piece.stretch)[piece.own]
        sums.widen(path.rate_rad_s[known] if known.any() else _smooth(found.rate_rad_s))
        errors = _errors_of(path, found, known, calibration) if run.logged else None
        sums.add(path, found, errors)
        held.add(path, found.angle_std)
        record = _record_of(
            run,
            calibration,
            time_s=path.average_neighbours(path.time_s),
            rate_estimate_rad_s=found.rate_rad_s - earth_rate,
            rate_estimate_rad_s_std=found.std,
            angle_estimate_rad=sums.turn_on(
                rate - earth_rate, whole, middles, piece.own, found.angle_std
            ),
            angle_estimate_rad_std=found.angle_std,
            residual_before_rad_s=None if errors is None else errors.before_rad_s,
            residual_after_rad_s=None if errors is None else errors.after_rad_s,
            details=json.dumps(sums.compute_figures()),
        )
        judged = _judge_rates(record, calibration, sums, run)
        closing = [*sums.against.list_checks(), sums.check_truncation(), held.check(run.name)]
        yield judged.judged(list_failures(closing))
    if not np.isfinite(sums.slowest_rad_s):
        raise HrgError(f"{run.name}: has no good windows; see its flags, and demodulate again")


def _judge_increments(
    path: AnglePath,
    rate: Array,
    scale: Array,
    middles: Middles,
    own: slice,
    calibration: Calibration,
    angles: AngleSpread,
) -> IncrementRates:
    """The rates of a piece's `own` increments with what they are uncertain by; rate and scale (n,):
    Ω and K of all its increments."""
    blocks = path.find_abscissa(calibration.axis)
    noise, of_tables = _compute_rate_std(calibration, path, blocks, rate, scale)
    angle_std = angles.compute_std(path, middles, own, blocks, rate, scale)
    return IncrementRates(rate[own], noise[own], of_tables[own], angle_std)


def _errors_of(
    path: AnglePath, found: IncrementRates, known: Array, calibration: Calibration
) -> RateErrors:
    """The rates' errors against the log, where it is `known` (n,)."""
    true = np.where(known, path.rate_rad_s, np.nan)
    constant = -path.turn / path.interval_s / _mean_scale_factor(calibration)
    return RateErrors(constant - true, found.rate_rad_s - true)


def _mean_scale_factor(calibration: Calibration) -> float:
    return float(np.mean(np.asarray(calibration.scale_factor_harmonics)[:, 0]))


def _record_of(run: LoggedRun, calibration: Calibration, **columns: Any) -> Compensated:
    """The rates of a piece, named and judged as its wave."""
    wave = run.wave
    return Compensated(
        **columns,
        gyro_id=wave.gyro_id or calibration.gyro_id,
        run_id=wave.run_id,
        lot_id=wave.lot_id,
        mode_number=wave.mode_number,
        status=wave.status,
        status_reasons=(*wave.status_reasons, *run.list_doubts()),
    )


def _compute_rate_std(
    calibration: Calibration, path: AnglePath, blocks: Array, rate: Array, scale: Array
) -> tuple[Array, Array]:
    """Standard deviations (n,) of the increments' rates by noise, and by the tables, √(σ_D² +
    Ω²σ_K²)/|K|; NaN where it is not stated.

    Noise is that of the wave angle and the gyro's own walk N [rad/√s], as its calibration has found
    it: σ² = m²(σ²_i + σ²_{i+1})/(KΔt)² + N²(Δt − (w_i + w_{i+1})/6)/Δt² with blocks of width w.
    Neighbouring increments share a block's angle, so of the noise the first is anticorrelated, −½
    in even windows, and sums up to the noise of the first and the last angle; the walk grows as
    N√t, whatever is summed up. The tables' part is common to all
    increments at a temperature and an angle. What σ of a block moves the tables' place is
    D'Δt/2m ≪ 1 of the first part and left out.

    blocks (b,): temperature or frequency of the blocks; rate and scale (n,): Ω and K.
    """
    variance = np.where(path.angle_variance > 0, path.angle_variance, np.nan)
    gain = np.abs(scale)
    angle = path.mode_number * np.sqrt(variance[1:] + variance[:-1]) / gain
    walk = read_angle_random_walk(calibration) * np.sqrt(
        path.interval_s - path.average_neighbours(path.width_s) / 3
    )
    noise = np.hypot(angle, walk) / path.interval_s
    drift_std, scale_std = compute_standard_deviations(
        calibration, path.average_neighbours(blocks), path.average_neighbours(path.angle_rad)
    )
    return noise, np.hypot(drift_std, rate * scale_std) / gain


def _smooth(rate: Array, increments: int = 200) -> Array:
    """Means over stretches of increments, so that noise does not look like a rate."""
    size = min(increments, len(rate))
    return np.asarray(rate[: len(rate) // size * size].reshape(-1, size).mean(axis=1))


def _judge_rates(
    record: Compensated, calibration: Calibration, sums: RunSums, run: LoggedRun
) -> Compensated:
    """Refuse rates of the wrong sign, doubt rates outside those calibrated; a stream keeps the last
    record's verdict."""
    reasons = (
        [f"the tables are suspect: {reason}" for reason in calibration.status_reasons]
        if calibration.status == "suspect"
        else []
    )
    free = run.wave.mode == "free" and json.loads(calibration.details or "{}").get("driven")
    if free:
        reasons.append(
            f"{run.name} is free by its file and the tables are of driven runs: what the drive does"
            " to the drift is in them; import it with --mode forced, or take its rate by the"
            " resonator (hrg rate)"
        )
    totals, slowest, fastest = sums.totals, sums.slowest_rad_s, sums.fastest_rad_s
    scale_factor = _mean_scale_factor(calibration)
    # a free wave turns by its splits as well, which are none of the tables' scale factor
    if not free and totals is not None and np.isfinite(totals.scale_factor_seen):
        seen = totals.scale_factor_seen
        rms_rate = np.sqrt(totals.turned / max(totals.rows, 1)) / max(
            float(np.median(np.diff(record.time_s))) if len(record) > 1 else 1.0, 1e-12
        )
        strong = rms_rate > 20 * float(np.abs(calibration.drift_rad_s).max()) / abs(scale_factor)
        if strong and seen * scale_factor < 0:
            raise HrgError(
                f"{run.name}: the wave turns with the logged rate (K = {seen:.3g}), the tables have"
                f" K = {scale_factor:.3g}; the sign of the rate log or of a channel is reversed"
            )
        if strong and abs(seen / scale_factor - 1) > 0.05:
            reasons.append(
                f"the run's own scale factor {seen:.4g} differs from the tables' {scale_factor:.4g}"
                " by more than 5 %"
            )
    span = calibration.rate_max_rad_s - calibration.rate_min_rad_s
    if (
        fastest > calibration.rate_max_rad_s + 0.1 * span
        or slowest < calibration.rate_min_rad_s - 0.1 * span
    ):
        reasons.append(
            f"rates from {slowest:.4g} to {fastest:.4g} rad/s go beyond those calibrated,"
            f" {calibration.rate_min_rad_s:.4g} to {calibration.rate_max_rad_s:.4g} rad/s; the"
            " scale factor was not tested there"
        )
    return record.judged(reasons)
