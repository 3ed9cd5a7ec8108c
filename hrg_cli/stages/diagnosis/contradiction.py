"""Diagnosis, before any cause: what contradicts the motion grossly is no effect.

Runs at frequencies too far apart are of different gyros; runs whose logged rate is wrong (sign turned, log missing) are a fault of the log.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...fitting.causes import extended_fit
from ...fitting.causes.extended_fit import Fit
from ...records import Array, Wave

GROSS = 1e3
"""χ² a degree of freedom from which the logs themselves are doubted."""
FALL = 100.0
"""Times by which χ² must fall once the doubted rates are replaced."""
STEP = 1.4
"""Times by which replacing one more run's rate must lower it."""
LEAST_RAD_S = 0.05
"""Change of a rate that no drift of a gyro makes."""
APART = 0.02
"""Relative distance of two runs' frequencies that no temperature makes: fused silica's 90 ppm/K over 200 K."""


def strangers(base: Fit) -> str | None:
    """A sentence naming the runs on either side of the widest gap between the runs' frequencies, where no one gyro has both; else None."""
    if base.chi2 / base.dof < GROSS:
        return None
    order = np.argsort(base.frequency_hz)
    hz = base.frequency_hz[order]
    gaps = np.diff(hz) / hz[:-1]
    if not len(gaps) or gaps.max() < APART:
        return None
    first = int(np.argmax(gaps)) + 1
    low, high = ([base.series.names[i] for i in part] for part in (order[:first], order[first:]))
    return (
        f"the runs are not of one gyro: {', '.join(low)} at {hz[:first].mean():.6g} Hz, {', '.join(high)} at {hz[first:].mean():.6g} Hz, "
        f"and no model fits both (χ² a degree of freedom {base.chi2 / base.dof:.3g}); diagnose them apart"
    )


def contradicting_logs(waves: Sequence[Wave], base: Fit, fitted: Callable[[Sequence[Wave]], Fit]) -> str | None:
    """A sentence naming the fewer than half of the runs whose rates, turned or taken from the wave, let χ² fall `FALL` times; else None.

    The wave's own mean rate is −m·θ̇/K with K of the fit so far; the greatest fall is taken first.
    """
    level = base.chi2 / base.dof
    if level < GROSS or len(waves) < 3:
        return None
    changed: dict[int, tuple[float, float]] = {}
    best, trial_waves = base, list(waves)
    while len(changed) < (len(waves) - 1) // 2:
        trials = []
        for k, wave in enumerate(trial_waves):
            if k in changed or wave.mode != "free":
                continue
            logged = _logged(wave)
            for rate in {-logged, _shown(wave, best)}:
                if np.isfinite(rate) and abs(rate - logged) > max(LEAST_RAD_S, 0.1 * abs(logged)):
                    rates = np.full(len(wave), rate)
                    if wave.rate_rad_s is not None and rate == -logged:
                        rates = -np.asarray(wave.rate_rad_s, float)
                    trials.append((k, logged, rate, wave.replace(rate_rad_s=rates)))
        fits = []
        for k, logged, rate, wave in trials:
            try:
                fits.append((fitted([*trial_waves[:k], wave, *trial_waves[k + 1 :]]), k, logged, rate, wave))
            except extended_fit.DivergedError:
                continue
        if not fits:
            break
        found, k, logged, rate, wave = min(fits, key=lambda f: f[0].chi2)
        if found.chi2 > best.chi2 / STEP:
            break
        best, changed[k], trial_waves[k] = found, (logged, rate), wave
        if best.chi2 / best.dof < max(2.0, level / FALL**2):
            break
    if not changed or best.chi2 / best.dof > min(level / FALL, GROSS):
        return None
    runs = "; ".join(f"{waves[k].run_id}: {a:.4g} rad/s is logged, its wave turns as at {b:.4g}" for k, (a, b) in changed.items())
    return (
        f"the logged rate contradicts the motion ({runs}): with that replaced χ² a degree of freedom falls from {level:.3g} to "
        f"{best.chi2 / best.dof:.3g}; correct the log's sign or add the missing rate, or leave the run out"
    )


def _logged(wave: Wave) -> float:
    """Mean logged rate; 0 where none is logged."""
    rates = None if wave.rate_rad_s is None else np.asarray(wave.rate_rad_s, float)
    return 0.0 if rates is None or not np.isfinite(rates).any() else float(np.nanmean(rates))


def _shown(wave: Wave, fit: Fit) -> float:
    """Mean rate that the wave angle shows, −m·θ̇/K."""
    good: Array = wave.good()
    if np.count_nonzero(good) < 8:
        return float("nan")
    slope = float(np.polyfit(wave.time_s[good], wave.wave_angle_rad[good], 1)[0])
    return -wave.mode_number * slope / max(abs(float(fit.point.p[5])), 0.1)
