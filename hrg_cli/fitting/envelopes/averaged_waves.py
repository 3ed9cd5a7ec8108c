"""Averaged rows of runs as waves again, for what reads waves and needs no single window of a long
record."""

from __future__ import annotations

import numpy as np

from ...physics import ellipse
from ...records import Wave
from ...records.windowed import FLAG_GAP
from .envelope_runs import EnvelopeRun

Array = np.ndarray
DEGREE = 5
"""Of the spline whose slope is the rate: the course of a log is integrated as exactly."""


def to_wave(run: EnvelopeRun, record: Wave) -> Wave:
    """The wave whose windows are a free run's rows.

    Rows are values in their middles, as windows are: they keep the length of one. A rate stands in
    the record as the slope of the angle that the table has turned.

    Parameters
    ----------
    run
        Windows, or averages of them, at rising times; rows of infinite σ fill its gaps.
    record
        That they come from: what its windows stand for, and what their noise has in common.

    Returns
    -------
    Wave
        Of mode "free"; what fills a gap is flagged so, without an error.

    Examples
    --------
    A swing of the table is turned back into the angle that it came from:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.averaged_waves import to_wave
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun, from_wave
    >>> t = np.arange(200.0)
    >>> swing, u = np.sin(0.1 * t), np.outer(np.exp(-1e-3 * t), [1.0, 0.1j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, swing, None, 5e3, 2, 1.0)
    >>> record = SimpleNamespace(window_stands_for="mean", noise_correlation=None)
    >>> again = from_wave(to_wave(run, record))
    >>> bool(np.allclose(again.envelope, u)), bool(np.abs(again.turn_rad - swing).max() < 1e-6)
    (True, True)
    """
    count, zero = len(run), np.zeros(len(run))
    main, quadrature, angle, phase = ellipse.find_wave(run.envelope, run.mode_number)
    angle, phase = ellipse.unwrap(angle, phase, run.mode_number)
    filled = np.isinf(run.std)
    std = np.where(filled, 0.0, run.std)
    relative = std / main
    return Wave(
        time_s=run.time_s,
        main_amplitude=main,
        quadrature_amplitude=quadrature,
        wave_angle_rad=angle,
        phase_rad=phase,
        carrier_phase_rad=zero,
        main_amplitude_std=std,
        quadrature_amplitude_std=std,
        wave_angle_rad_std=relative / run.mode_number,
        phase_rad_std=relative if run.phase_known else np.full(count, np.inf),
        carrier_phase_rad_std=zero,
        residual_rms=zero,
        signal_std=std,
        channel_std=std[:, None] * np.sqrt(run.shares),
        iterations=np.zeros(count, "i2"),
        flags=np.where(filled, FLAG_GAP, 0).astype("u1"),
        temperature_degc=run.temperature_degc,
        rate_rad_s=_find_rate(run.time_s, run.turn_rad),
        frequency_hz=np.full(count, run.reference_frequency_hz),
        reference_frequency_hz=run.reference_frequency_hz,
        window_s=run.window_s,
        window_stands_for=record.window_stands_for,
        noise_correlation=record.noise_correlation,
        mode="free",
        mode_number=run.mode_number,
        run_id=run.run_id,
    )


def _find_rate(time_s: Array, turn_rad: Array) -> Array:
    """The slope of an angle at its own times."""
    from scipy.interpolate import make_interp_spline

    return np.asarray(make_interp_spline(time_s, turn_rad, k=DEGREE).derivative()(time_s))
