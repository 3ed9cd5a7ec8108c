"""What a gyro in its working mode tells of its resonator, and its free windows beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...fitting.envelopes import axis_crossings, envelope_runs, propagator, working_mode
from ...fitting.envelopes.base_fit import check_runs
from ...fitting.envelopes.base_freedom import Known
from ...fitting.envelopes.coordinates import DAMPING
from ...fitting.envelopes.envelope_runs import EnvelopeRun
from ...fitting.envelopes.free_windows import split_driven_and_free
from ...fitting.envelopes.regressions import Regression
from ...records import Wave
from .methods import name_parameters
from .outcome import Verdict
from .verdict import ORDER

Array = np.ndarray
MISREAD = 5.0
"""Standard deviations below zero of the quadrature's own damping that a log of its drive leaves,
from which the log is not what it should be."""


def monitor_working_mode(waves: Sequence[Wave], rate_rad_s: float | None) -> Verdict:
    """Frequency and splits of a driven gyro, with the mean-frequency trap of the second in numbers.

    The frequency split is told by the quadrature, the damping split by the phase; the stiffness
    axis from the quadrature's course of the free windows too.

    Parameters
    ----------
    waves
        Driven throughout or in part, with the log of the drive where there is one.
    rate_rad_s
        Constant Ω instead of the waves' own.

    Returns
    -------
    Verdict
        Splits [1/s, rad/s] and axes [rad]; ν and K are no part of it.

    Raises
    ------
    HrgError
        No run, or mixed mode numbers.

    Examples
    --------
    A wave held at 1 that turns by mθ = 0.5t; its quadrature follows ṙ = −0.2r + 0.01 sin 2mθ, its
    phase φ̇ = (1 + r²)/(1 − r²)·0.01 cos 2mθ:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.stages.identification.monitored import monitor_working_mode
    >>> t, ones = np.arange(0.0, 100.0, 0.02), np.ones(5000)
    >>> r = np.imag(0.01 / (0.2 + 1j) * np.exp(1j * t)) + 0.05 * np.exp(-0.2 * t)
    >>> speed = (1 + r**2) / (1 - r**2) * 0.01 * np.cos(t)
    >>> wave = Wave(**{f.name: 1e-5 * ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, main_amplitude=ones, quadrature_amplitude=r, wave_angle_rad=0.25 * t,
    ...     phase_rad=np.append(0.0, np.cumsum(speed[1:] + speed[:-1]) * 0.01), mode="forced",
    ...     flags=np.zeros(5000, "u1"), iterations=np.zeros(5000, "i2"), window_s=0.02,
    ...     reference_frequency_hz=5e3,
    ... ))
    >>> verdict = monitor_working_mode([wave], 0.0)
    >>> round(verdict.values["frequency_split_rad_s"], 4)
    0.01
    """
    apart = [split_driven_and_free(w, envelope_runs.from_wave(w, rate_rad_s)) for w in waves]
    driven, free = ([run for pair in apart for run in pair[k]] for k in (0, 1))
    check_runs(driven or free)
    thin = _thin_out(driven or free)
    # a record whose drive was off in between has several driven stretches
    stretches = [len(pair[0 if driven else 1]) for pair in apart]
    of_wave = np.repeat(np.arange(len(waves)), stretches)
    pushed = _pushed(waves, thin, of_wave) if driven else None
    found = working_mode.monitor(thin, pushed)
    misread = pushed is not None and found.own_damping[0] < -MISREAD * found.own_damping[1]
    if misread:
        pushed, found = None, working_mode.monitor(thin)
    rows = np.bincount(of_wave, [len(r) for r in thin], len(waves)).astype(int)
    verdict = _open_verdict(found, thin, rows)
    damping, covariance = float(found.value[0]), found.covariance
    verdict.details = {
        "quadrature_damping_1_s": {"value": damping, "std": float(np.sqrt(covariance[0, 0]))},
        "quadrature_rms": found.quadrature_rms,
        "damping_split_per_mhz_1_s": found.trap_1_s_per_mhz,
        **_find_crossings(
            thin if driven else [], free, damping, verdict.values, verdict.mode_number
        ),
    }
    _say_limits(verdict, found)
    if driven and pushed is None:
        verdict.flat.append(
            "the quadrature's drive is not logged: a loop that acts late makes the frequency split"
            f" {1e-1 * damping:.2g} % too large per millisecond"
        )
    if misread:
        verdict.suspect.append(
            "with the logged drive_quadrature taken off, the quadrature would grow by itself: it is"
            " not in amplitude per second, or of wrong sign, and was left out"
        )
    return verdict


def _pushed(
    waves: Sequence[Wave], runs: Sequence[EnvelopeRun], of_wave: Array
) -> list[Array] | None:
    """∫a_ΦB dt (n,) of every run from its wave's log; None where a wave has none, or holes in
    it."""
    logs = [w.drive_quadrature for w in waves]
    if any(log is None or not np.isfinite(log[:]).all() for log in logs):
        return None
    pushed = []
    for run, place in zip(runs, of_wave, strict=True):
        time = np.asarray(waves[place].time_s, float)
        force = np.asarray(logs[place], float)
        area = np.cumsum((force[1:] + force[:-1]) / 2 * np.diff(time))
        pushed.append(np.interp(run.time_s, time, np.concatenate([[0.0], area])))
    return pushed


def _open_verdict(found: working_mode.Monitor, thin: Sequence[EnvelopeRun], rows: Array) -> Verdict:
    """What was monitored as a verdict; ν and K are no part of it. rows: windows of each wave."""
    mode, nan = thin[0].mode_number, float("nan")
    # (damping, δω cos, δω sin, νδμ cos, νδμ sin) of the monitor in the order of the coordinates
    order = [3, 4, 1, 2]
    vector = np.array([nan, *found.value[order], nan, 0.0])
    covariance = np.zeros((7, 7))
    covariance[1:5, 1:5] = found.covariance[np.ix_(order, order)]
    values, std, full = name_parameters(
        Regression(vector, covariance), mode, "working-mode", thin, Known()
    )
    frequency = np.array([r.reference_frequency_hz for r in thin])
    values["frequency_hz"] = float(frequency.mean())
    # the driven wave's frequency moves with its angle by the split itself
    std["frequency_hz"] = float(
        np.hypot(frequency.std(), np.hypot(found.value[1], found.value[2]) / (2 * np.pi))
    )
    full[0, 0] = std["frequency_hz"] ** 2
    return Verdict(
        values=values,
        std=std,
        order=list(ORDER),
        covariance=full,
        chi2_per_dof=nan,
        condition=nan,
        run_chi2_per_dof=np.full(len(rows), nan),
        run_residual_rms=np.full(len(rows), nan),
        run_rows=rows,
        mode_number=mode,
    )


def _say_limits(verdict: Verdict, found: working_mode.Monitor) -> None:
    """What a working mode cannot tell, in the numbers of these runs."""
    verdict.flat = [
        (
            f"the damping split enters the phase with 2·a_B/a_A = {2 * found.quadrature_rms:.2g}"
            f" only: 1 mHz of unnoticed frequency drift reads as {found.trap_1_s_per_mhz:.2g} 1/s"
            " of damping split"
        ),
        (
            "the drive hides the mean decay: the quadrature's own damping is ν with a force drive"
            " and about 2ν with a ring electrode"
        ),
    ]
    if verdict.std["damping_split_1_s"] > 0.3 * abs(found.value[0]):
        verdict.suspect.append(
            "damping_split_1_s is not determined in the working mode with so little quadrature; use"
            " a free run-down"
        )


def _thin_out(runs: Sequence[EnvelopeRun]) -> list[EnvelopeRun]:
    """Some two thousand rows a run against its own mean frequency, averaged along a first guess of
    its motion; nobody decays."""
    p, offsets = propagator.guess_roughly(runs)
    p[DAMPING] = 0.0
    return [
        envelope_runs.retune(r, o)
        for r, o in zip(propagator.thin_rows(runs, p, offsets, 2000), offsets)
    ]


def _find_crossings(
    driven: Sequence[EnvelopeRun],
    free: Sequence[EnvelopeRun],
    quadrature_damping_1_s: float,
    values: Mapping[str, float],
    mode: int,
) -> dict[str, Any]:
    """The stiffness axis where a_B of driven runs changes its sign and where a_B/a_A of free ones
    turns back, one by one and all together by inverse variance."""
    crossings = working_mode.find_stiffness_axes(driven, mode, quadrature_damping_1_s)
    period = np.pi / mode
    off = np.array([a - values["stiffness_axis_rad"] for a, _ in crossings])
    off = np.mod(off + period / 2, period) - period / 2
    scatter = float(np.sqrt(np.sum(off**2) / max(1, len(off))))
    several: list[dict[str, Any]] = [
        {"value": axis, "std": max(std, scatter)} for axis, std in crossings
    ]
    whole = working_mode.combine_axes(crossings, mode)
    if free:
        thin = _thin_out(free)
        found = axis_crossings.fit_crossings(thin)
        several += axis_crossings.list_axes(found, thin)
        turned = axis_crossings.combine_estimates(found, mode)
        both = [turned] if whole is None else [whole, turned]
        whole = working_mode.combine_axes([(b["value"], b["std"]) for b in both], mode)
        assert whole is not None
        whole["crossings"] = sum(int(b["crossings"]) for b in both)
    return {"stiffness_axes": several, "stiffness_axis_of_crossings": whole}
