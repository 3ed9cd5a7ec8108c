"""Records that show modes but no axes: one channel, or two channels that are not an orthogonal
pair; one mode or two, as the data say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import HrgError
from ...fitting.checks import check_goodness
from ...fitting.envelopes import two_modes
from ...fitting.envelopes.base_fit import fit_base_model
from ...fitting.envelopes.coordinates import SCALE_FACTOR
from ...fitting.envelopes.envelope_runs import EnvelopeRun, average_rows
from .decay_modes import Seen, find_modes
from .modes_verdict import judge_modes
from .outcome import Verdict

Array = np.ndarray
ROWS = 2000
BETTER = 3.0
"""Factor by which two free modes must beat the resonator's χ² before its axes are given up."""
AS_GOOD = 1.1
"""Factor within which the χ² of a table that turns is that of two modes."""
DEAD = 1e-6
"""Part of the signal's energy below which a channel carries none, if it is not within its noise
anyway."""


def thin_run(run: EnvelopeRun) -> EnvelopeRun:
    """A run averaged to at most 2000 rows about its own mean frequency; a split turns little in
    one.

    Parameters
    ----------
    run
        All its windows.

    Returns
    -------
    EnvelopeRun
        The same where it has fewer.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.stages.identification.modes import thin_run
    >>> t = 0.01 * np.arange(10_000)
    >>> u = np.exp(2j * t)[:, None] * [1.0, 0.5]
    >>> thin = thin_run(EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.01))
    >>> len(thin) <= 2000, bool(np.allclose(np.abs(thin.envelope), [1.0, 0.5]))
    (True, True)
    """
    turn = np.sum(run.envelope[1:] * np.conj(run.envelope[:-1]))
    offset = float(np.angle(turn)) / float(np.median(np.diff(run.time_s)))
    none = np.zeros(1)

    def carry(dt: Array, _turn: Array) -> tuple[Array, Array, Array, Array]:
        factor = np.exp(1j * offset * dt)
        return factor, none, none, factor

    return average_rows(run, ROWS, carry)


def identify_one_channel(runs: Sequence[EnvelopeRun]) -> Verdict | None:
    """The verdict of runs at rest that are one signal each, with one mode or two.

    Two live channels that are proportional show a line that does not turn: that is an ordinary
    run-down unless it holds two modes.

    Parameters
    ----------
    runs
        Free ones of one gyro.

    Returns
    -------
    Verdict or None
        None: they are ordinary runs.

    Examples
    --------
    A wave along one pair of electrodes leaves the other dead:

    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.modes import identify_one_channel
    >>> found = identify_one_channel([draw_run_down(0.0)])
    >>> sorted(found.values), round(found.values["damping_rate_1_s"], 3)
    (['damping_rate_1_s', 'frequency_hz'], 0.1)
    >>> identify_one_channel([draw_run_down(0.0, rate_rad_s=0.5)]) is None
    True
    """
    if max(float(np.ptp(r.turn_rad)) for r in runs) > 0:
        return None
    signals, dead = [], True
    for run in runs:
        thin = thin_run(run)
        merged = two_modes.merge_channels(thin)
        if merged is None:
            return None
        dead &= has_dead_channel(thin)
        u, std = merged
        signals.append((run, replace(thin, std=std), u))
    found = [find_modes(run, thin, u) for run, thin, u in signals]
    if not dead and not all(s.two is not None for s in found):
        return None
    return judge_modes(
        found, "the channels carry one signal (one is dead or proportional): {what}, no axes"
    )


def has_dead_channel(run: EnvelopeRun) -> bool:
    """Whether one of two channels holds no more than noise, and the other a signal.

    Parameters
    ----------
    run
        Its windows.

    Returns
    -------
    bool
        False where both are noise.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.stages.identification.modes import has_dead_channel
    >>> t = np.arange(100.0)
    >>> u = np.ones((100, 2)) * [1.0, 0.0]
    >>> has_dead_channel(EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0))
    True
    """
    power = np.sum(np.abs(run.envelope / run.std[:, None]) ** 2, axis=0)
    noise = 2 * len(run) * (1 + 6 / np.sqrt(len(run)))
    return bool(power.max() > noise and power.min() < max(DEAD * power.max(), noise))


def identify_free_modes(
    runs: Sequence[EnvelopeRun], chi2_per_dof: float, impossible: bool = False
) -> Verdict | None:
    """The verdict of one run at rest that two unrelated modes describe far better than a resonator.

    A resonator is seen by an orthogonal pair of channels; two modes whose shapes are any are more.

    Parameters
    ----------
    runs
        One, at rest; of more nothing is said.
    chi2_per_dof
        What the resonator leaves, over the noise.
    impossible
        The resonator found is none (a damping split above the damping), so two modes need only be
        as good.

    Returns
    -------
    Verdict or None
        None: the resonator holds.

    Examples
    --------
    Two modes 4 rad/s apart, each seen by both channels:

    >>> from dataclasses import replace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.modes import identify_free_modes
    >>> run = draw_run_down(0.0)
    >>> other = np.exp((-0.12 - 4j) * run.time_s)[:, None] * [0.3j, 0.9]
    >>> found = identify_free_modes([replace(run, envelope=run.envelope + other)], 100.0)
    >>> round(found.values["frequency_split_rad_s"], 3), round(found.values["damping_rate_1_s"], 3)
    (2.0, 0.11)
    """
    if len(runs) != 1 or float(np.ptp(runs[0].turn_rad)) > 0:
        return None
    run = thin_run(runs[0])
    two, single = two_modes.identify(run, run.envelope, 2), two_modes.identify(run, run.envelope, 1)
    if (
        not two_modes.are_resolved(two, single)
        or not two.chi2_per_dof * (0.5 if impossible else BETTER) < chi2_per_dof
    ):
        return None
    than = (
        "a resonator before an orthogonal pair of channels, which would need an impossible damping"
        " split"
        if impossible
        else (f"a resonator before an orthogonal pair of channels (χ²/dof {chi2_per_dof:.3g})")
    )
    spacing = float(np.median(np.diff(runs[0].time_s)))
    verdict = judge_modes(
        [Seen(run, run, spacing, None, two)],
        f"two unrelated modes (χ²/dof {two.chi2_per_dof:.3g}) describe the run better than {than}:"
        " {what}, no axes",
    )
    verdict.suspect += _tell_unlogged_rate(runs[0], two.chi2_per_dof)
    return verdict


def _tell_unlogged_rate(run: EnvelopeRun, chi2_per_dof: float) -> list[str]:
    """That a resonator on a table that turns evenly, which no log says, describes a run as well as
    what leaves this χ²."""
    turning = replace(run, turn_rad=run.time_s - run.time_s[0])
    try:
        fit = fit_base_model([turning])
    except HrgError:
        return []
    left = fit.chi2 / fit.dof
    # a bell's two modes leave more than the noise, and so would any table
    if not (left < AS_GOOD * chi2_per_dof and check_goodness(fit.chi2, fit.dof).passed):
        return []
    return [
        f"so would a resonator on a table that turns (χ²/dof {left:.3g}, KΩ ="
        f" {fit.p[SCALE_FACTOR]:.4g} rad/s), and no rate is logged: give it (--rate-rad-s), or fit"
        " it (--fit-rate)"
    ]
