"""estimate: the standing wave {A, B, θ, φ, ψ} of every period, from the demodulated signals (seed
B).

Direct read-out has four signals for four unknowns; carrier read-out eight for five (seed B (1)).
The direct signals are the carrier's with equal sidebands and ψ = 0, so that both go through the
same solvers.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import Array, Periods, Wave
from .estimation.channel_carriers import align_channels, measure_phase_difference
from .estimation.continuity import make_continuous
from .estimation.late_rate import read_rate_in_time
from .estimation.solution import LastSolution, SolverSettings, solve_block
from .estimation.tally import Tally
from .estimation.wave_block import add_frequency, write_block

BLOCK_ROWS = 1 << 15


def estimate(
    periods: Periods,
    *,
    solver: Annotated[
        Literal["closed-form", "gauss-newton", "levenberg-marquardt"],
        Field(description="how the equations of a window are solved"),
    ] = "closed-form",
    start: Annotated[
        Literal["previous", "closed-form", "fixed"],
        Field(description="where an iterating solver starts each window"),
    ] = "previous",
    carrier_phase_rad: Annotated[
        float | None,
        Field(description="carrier phase where it is known; estimated where it is not given"),
    ] = None,
    tolerance: Annotated[
        float,
        Field(
            gt=0,
            lt=0.1,
            description="step of an iterating solver, relative to the signals, at which it ends",
        ),
    ] = 1e-10,
    max_iterations: Annotated[
        int,
        Field(
            ge=1,
            le=10000,
            description="residual evaluations after which a window counts as not converged",
        ),
    ] = 60,
    frequency_windows: Annotated[
        int,
        Field(ge=1, le=1000, description="windows on each side whose phases give the frequency"),
    ] = 16,
    rate_late_s: Annotated[
        float,
        Field(
            allow_inf_nan=False,
            description="by how much the rate log comes late, to be taken off it; negative: early",
        ),
    ] = 0.0,
) -> Iterator[Wave]:
    """The standing wave of every window: amplitude, quadrature, angle and phases.

    C0 = e^{jφ}(a_A cos mθ + j a_B sin mθ), S0 = e^{jφ}(a_A sin mθ − j a_B cos mθ) (PHYSICS §1),
    solved by the iteration (2) of seed B or in closed form, and mapped to a_A ≥ |a_B| with θ, φ, ψ
    continuous through the run. `start`: the solution of the window before; the window's own closed
    form; or seed B's (A₀, 0, 0, φ₋₁, ψ₋₁).

    Parameters
    ----------
    periods
        Signals (n, 4), of a carrier (n, 8), with standard deviations; it may be open on disk.

    Returns
    -------
    Iterator[Wave]
        Blocks of windows (n,): amplitudes in the signals' unit, angles and phases [rad], frequency
        [Hz], their standard deviations; the last block holds the status.

    Raises
    ------
    HrgError
        The number of signals does not fit the read-out, there are no rows, or a rate log is to be
        moved that is none.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate, estimate
    >>> t = np.arange(8000) / 8000
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> c, s = np.cos(2 * np.pi * 1000 * t) + noise
    >>> recording = Recording(c=c, s=s, sample_rate_hz=8000.0, mode="free")  # mθ = 45°, m = 2
    >>> wave = collect(estimate(collect(demodulate(recording, periods_per_window=20))))
    >>> float(wave.main_amplitude[0].round(3)), float(np.degrees(wave.wave_angle_rad[0]).round(2))
    (1.414, 22.5)
    """
    _check_periods(periods, carrier_phase_rad)
    how = SolverSettings(
        solver,
        start,
        0.0 if periods.readout == "direct" else carrier_phase_rad,
        tolerance,
        max_iterations,
    )
    tally = Tally()
    last: LastSolution | None = None
    context: Array | None = None
    emitted: Wave | None = None
    waiting: Wave | None = None
    rate = read_rate_in_time(periods, rate_late_s) if rate_late_s else None
    direct = periods.readout == "direct"
    apart = None if direct else measure_phase_difference(periods, BLOCK_ROWS)
    rows = 0
    for block in periods.blocks(BLOCK_ROWS):
        signals = np.asarray(block.signals, float)
        if apart is not None and apart.stands_out:
            signals = align_channels(signals, apart.value)
        x, misfit, iterations, last = solve_block(signals, direct, how, last)
        context = make_continuous(x, block, context)
        wave = write_block(block, x, misfit, iterations, how.carrier_phase_rad is not None)
        if apart is not None:
            wave = wave.replace(
                carrier_phase_difference_rad=apart.value, carrier_phase_difference_std=apart.std
            )
        if rate is not None:
            wave = wave.replace(rate_rad_s=rate[rows : rows + len(wave)])
        rows += len(wave)
        tally.add(wave)
        if waiting is not None:
            # A block waits for the next one, whose first phases its last slopes need.
            emitted = add_frequency(emitted, waiting, wave, frequency_windows)
            yield emitted
        waiting = wave
    assert waiting is not None
    yield tally.judge(add_frequency(emitted, waiting, None, frequency_windows), solver)


def _check_periods(periods: Periods, carrier_phase_rad: float | None) -> None:
    run = periods.run_id or "this run"
    expected = {"direct": 4, "carrier": 8}.get(periods.readout)
    if expected is None:
        raise HrgError(
            f'{run}: readout is {periods.readout!r}, expected "direct" or "carrier"; demodulate the'
            " recording again"
        )
    if len(periods) == 0:
        raise HrgError(f"{run}: the periods file has no window; demodulate a longer recording")
    if periods.signals.ndim != 2 or periods.signals.shape[1] != expected:
        raise HrgError(
            f"{run}: signals have shape {tuple(periods.signals.shape)}, {expected} a window were"
            f" expected with {periods.readout} read-out; demodulate the recording again"
        )
    if carrier_phase_rad is not None and periods.readout == "direct":
        raise HrgError(
            f"{run}: carrier_phase_rad was given, but the read-out is direct and has no carrier;"
            " leave it out"
        )


SUMMARY_ROWS = 1 << 17
_SUMMARISED = (
    "main_amplitude",
    "quadrature_amplitude",
    "wave_angle_rad",
    "wave_angle_rad_std",
    "frequency_hz",
    "residual_rms",
)


def summarise(wave: Wave) -> dict[str, Any]:
    """Figures of a wave record for the JSON.

    Parameters
    ----------
    wave
        Made by `estimate`.

    Returns
    -------
    dict
        Windows and how many can be used; where one can, the ends of amplitude [its unit] and wave
        angle [rad], the quadrature's rms over the amplitude, the medians of frequency and angle
        noise, and of a carrier by how much its phase in S is ahead of that in C.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate, estimate
    >>> from hrg_cli.stages.estimate import summarise
    >>> t = np.arange(8000) / 8000
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> c, s = np.cos(2 * np.pi * 1000 * t) + noise
    >>> recording = Recording(c=c, s=s, sample_rate_hz=8000.0, mode="free")  # mθ = 45°, m = 2
    >>> found = summarise(collect(estimate(collect(demodulate(recording, periods_per_window=20)))))
    >>> found["usable"], round(float(np.degrees(found["wave_angle_rad"]["last"])), 2)
    (50, 22.5)
    """
    out: dict[str, Any] = {"windows": len(wave), "usable": 0, "flagged": 0, "not_converged": 0}
    every = max(1, len(wave) // SUMMARY_ROWS)
    kept: list[list[Array]] = []
    for start in range(0, len(wave), SUMMARY_ROWS):
        part = slice(start, start + SUMMARY_ROWS)
        columns = [np.asarray(getattr(wave, name)[part]) for name in _SUMMARISED]
        amplitude, flags, iterations = (
            columns[0],
            np.asarray(wave.flags[part]),
            np.asarray(wave.iterations[part]),
        )
        good = (flags == 0) & (iterations >= 0) & np.isfinite(columns[2]) & (amplitude > 0)
        out["usable"] += int(good.sum())
        out["flagged"] += int((flags != 0).sum())
        out["not_converged"] += int((np.isfinite(amplitude) & (iterations < 0)).sum())
        rows = np.flatnonzero(good)
        chosen = np.unique(np.concatenate([rows[:1], rows[::every], rows[-1:]]))
        kept.append([column[chosen] for column in columns])
    if not out["usable"]:
        return out
    amplitude, quadrature, angle, std, frequency, residual = (
        np.concatenate(parts) for parts in zip(*kept, strict=True)
    )
    out["main_amplitude"] = {
        "first": float(amplitude[0]),
        "last": float(amplitude[-1]),
        "units": wave.units,
    }
    out["quadrature_ratio_rms"] = float(np.sqrt(np.mean((quadrature / amplitude) ** 2)))
    out["wave_angle_rad"] = {"first": float(angle[0]), "last": float(angle[-1])}
    out["wave_angle_std_rad"] = _finite_or_none(np.median(std))
    out["frequency_hz"] = (
        _finite_or_none(np.median(frequency[np.isfinite(frequency)]))
        if np.isfinite(frequency).any()
        else None
    )
    out["residual_rms"] = float(np.sqrt(np.mean(residual**2)))
    if wave.carrier_phase_difference_rad is not None:
        out["carrier_phase_difference_rad"] = {
            "value": wave.carrier_phase_difference_rad,
            "std": wave.carrier_phase_difference_std,
        }
    return out


def _finite_or_none(value: Any) -> float | None:
    """A float for JSON, which knows no NaN."""
    return float(value) if np.isfinite(value) else None
