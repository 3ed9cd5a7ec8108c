"""Records that show two modes but no axes: one channel, or two channels that are not an orthogonal pair."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...fitting.envelopes import two_modes
from ...fitting.envelopes.envelope_runs import EnvelopeRun, averaged
from .verdict import ORDER, Verdict

Array = np.ndarray
ROWS = 2000
BETTER = 3.0
"""Factor by which two free modes must beat the resonator's χ² before its axes are given up."""


def thinned(run: EnvelopeRun) -> EnvelopeRun:
    """At most 2000 rows by plain averages; a split turns little in one."""
    still, none = np.ones(1), np.zeros(1)
    return averaged(run, ROWS, lambda _dt, _turn: (still, none, none, still))


def one_channel(runs: Sequence[EnvelopeRun]) -> Verdict | None:
    """The verdict of runs at rest that are one signal each and hold two modes; None: they are ordinary runs."""
    if max(float(np.ptp(r.turn_rad)) for r in runs) > 0:
        return None
    found = []
    for run in map(thinned, runs):
        u, one = two_modes.channels(run)
        if not one:
            return None
        two, single = two_modes.identify(run, u, 2), two_modes.identify(run, u, 1)
        if not two_modes.resolved(two, single):
            return None
        found.append((run, two))
    return _verdict(found, "the channels carry one signal (one is dead or proportional): the split and both decays are given, no axes")


def free_modes(runs: Sequence[EnvelopeRun], chi2_per_dof: float, impossible: bool = False) -> Verdict | None:
    """The verdict of one run at rest that two unrelated modes describe far better than a resonator seen by an orthogonal pair.

    `impossible`: the resonator found is none (a damping split above the damping), so two modes need only be as good.
    """
    if len(runs) != 1 or float(np.ptp(runs[0].turn_rad)) > 0:
        return None
    run = thinned(runs[0])
    two, single = two_modes.identify(run, run.envelope, 2), two_modes.identify(run, run.envelope, 1)
    if not two_modes.resolved(two, single) or not two.chi2_per_dof * (0.5 if impossible else BETTER) < chi2_per_dof:
        return None
    than = (
        "a resonator before an orthogonal pair of channels, which would need an impossible damping split"
        if impossible
        else (f"a resonator before an orthogonal pair of channels (χ²/dof {chi2_per_dof:.3g})")
    )
    return _verdict(
        [(run, two)],
        f"two unrelated modes (χ²/dof {two.chi2_per_dof:.3g}) describe the run better than {than}: the split "
        "and both decays are given, no axes",
    )


def _verdict(found: Sequence[tuple[EnvelopeRun, two_modes.Modes]], reason: str) -> Verdict:
    """ν and δω from the mean and half difference of the modes; errors from the runs' own, or their scatter where it is larger."""
    rows, stds = [], []
    for run, modes in found:
        high, low = modes.exponent
        reference = 2 * np.pi * run.reference_frequency_hz
        rows.append(
            [
                (reference + (high.imag + low.imag) / 2) / (2 * np.pi),
                -(high.real + low.real) / 2,
                (high.imag - low.imag) / 2,
                -(high.real - low.real) / 2,
            ]
        )
        half = float(np.hypot(*modes.std)) / 2
        stds.append([half / (2 * np.pi), half, half, half])
    table, errors = np.array(rows), np.array(stds)
    weight = errors**-2.0 / np.sum(errors**-2.0, axis=0)
    mean = np.sum(weight * table, axis=0)
    std = 1 / np.sqrt(np.sum(errors**-2.0, axis=0))
    if len(rows) > 1:
        std = np.maximum(std, np.std(table, axis=0, ddof=1) / np.sqrt(len(rows)))
    names = ("frequency_hz", "damping_rate_1_s", "frequency_split_rad_s")
    covariance = np.zeros((7, 7))
    for name, error in zip(names, std[:3]):
        covariance[ORDER.index(name), ORDER.index(name)] = error**2
    chi2 = np.array([m.chi2_per_dof for _, m in found])
    verdict = Verdict(
        values=dict(zip(names, map(float, mean[:3]))),
        std=dict(zip(names, map(float, std[:3]))),
        order=list(ORDER),
        covariance=covariance,
        chi2_per_dof=float(chi2.mean()),
        condition=float("nan"),
        run_chi2_per_dof=chi2,
        run_residual_rms=np.array([float(r.std.mean() * np.sqrt(c)) for (r, _), c in zip(found, chi2)]),
        run_rows=np.array([len(r) for r, _ in found]),
        flat=[reason],
        suspect=[reason],
        mode_number=found[0][0].mode_number,
    )
    high, low = mean[0] + mean[2] / (2 * np.pi), mean[0] - mean[2] / (2 * np.pi)
    verdict.details["modes"] = [
        {"frequency_hz": float(high), "damping_rate_1_s": float(mean[1] + mean[3]), "std_1_s": float(std[1] * np.sqrt(2))},
        {"frequency_hz": float(low), "damping_rate_1_s": float(mean[1] - mean[3]), "std_1_s": float(std[1] * np.sqrt(2))},
    ]
    if verdict.chi2_per_dof > 1.5:
        verdict.suspect.append(f"χ²/dof = {verdict.chi2_per_dof:.3g}: two modes leave more than the noise; the errors are inflated")
    return verdict
