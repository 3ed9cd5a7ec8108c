"""The verdict of runs that show modes without axes: their weighted means, errors by their own σ or
their scatter, and in words what was seen.

Two modes of exponents −ν ± (Δν + jδω): f, ν, δω and half the difference of the decays; one mode: f,
ν and the laws by which decay and frequency follow the amplitude.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...fitting import checks
from ...fitting.envelopes import one_mode
from . import closing
from .decay_modes import Seen
from .outcome import Verdict
from .verdict import ORDER
from .window_band import compute_band_hz, describe_aliases, describe_band, find_aliases

Array = np.ndarray


def _read_run(seen: Seen) -> tuple[list[float], list[float]]:
    """(mean frequency, mean decay, half the frequency difference, half the decay difference) of a
    run, with standard deviations."""
    reference = 2 * np.pi * seen.run.reference_frequency_hz
    wider = float(np.sqrt(checks.measure_slow_part([seen.compute_residual()])))
    if seen.two is not None:
        high, low = seen.two.exponent
        half = wider * float(np.hypot(*seen.two.std)) / 2
        return [
            (reference + (high.imag + low.imag) / 2) / (2 * np.pi),
            -(high.real + low.real) / 2,
            (high.imag - low.imag) / 2,
            -(high.real - low.real) / 2,
        ], [half / (2 * np.pi), half, half, half]
    laws = seen.mode
    nu = laws.decay.find_coefficient("viscous_1_s")
    if not seen.run.phase_known:
        return [seen.run.reference_frequency_hz, nu[0]], [
            compute_band_hz(seen.spacing_s),
            wider * nu[1],
        ]
    omega = laws.frequency.find_coefficient("zero_amplitude_rad_s")
    return [(reference + omega[0]) / (2 * np.pi), nu[0]], [
        wider * omega[1] / (2 * np.pi),
        wider * nu[1],
    ]


def judge_modes(found: Sequence[Seen], reason: str) -> Verdict:
    """The verdict of modes without axes: the runs' weighted mean, errors their own or their
    scatter.

    Parameters
    ----------
    found
        What each run shows; where they disagree on two modes or one, one is taken.
    reason
        Why no axes are given, with a place {what} for what is.

    Returns
    -------
    Verdict
        Frequency [Hz] and ν [1/s], of two modes δω [rad/s] too; always suspect, for the reason.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.decay_modes import find_modes
    >>> from hrg_cli.stages.identification.modes_verdict import judge_modes
    >>> run = draw_run_down(0.0)
    >>> seen = find_modes(run, run, run.envelope[:, :1])
    >>> judge_modes([seen], "one channel is dead: {what}").suspect
    ['one channel is dead: one mode is seen; its frequency and decay are given']
    """
    found = _agree_on_modes(found)
    mean, std = _average_runs(found)
    measured = any(s.run.phase_known for s in found)
    verdict = _open_verdict(found, mean, std, reason.format(what=_tell_given(found, measured)))
    _tell_modes(verdict, found, mean, std)
    verdict.suspect += [sentence for s in found if (sentence := _tell_cut(s))]
    refusing, doubting = closing.check_bounds(verdict)
    settled = bool(np.all(np.isfinite(mean))) and all(
        s.two is None or s.two.converged for s in found
    )
    return closing.close_verdict(
        verdict,
        [*checks.check_fit(verdict.covariance, settled), *refusing],
        [*_check_residuals(found), *doubting],
    )


def _open_verdict(found: Sequence[Seen], mean: Array, std: Array, reason: str) -> Verdict:
    """The figures as a verdict, suspect for one reason: what is not given has no axes to stand
    on."""
    names = ("frequency_hz", "damping_rate_1_s", "frequency_split_rad_s")[: len(mean)]
    covariance = np.zeros((7, 7))
    for name, error in zip(names, std, strict=False):
        covariance[ORDER.index(name), ORDER.index(name)] = error**2
    each = np.array([s.chi2 / s.dof for s in found])
    return Verdict(
        values=dict(zip(names, map(float, mean), strict=False)),
        std=dict(zip(names, map(float, std), strict=False)),
        order=list(ORDER),
        covariance=covariance,
        chi2_per_dof=sum(s.chi2 for s in found) / sum(s.dof for s in found),
        condition=float("nan"),
        run_chi2_per_dof=each,
        run_residual_rms=np.array(
            [float(s.run.std.mean() * np.sqrt(c)) for s, c in zip(found, each, strict=True)]
        ),
        run_rows=np.array([len(s.run) for s in found]),
        flat=[reason],
        suspect=[reason],
        mode_number=found[0].run.mode_number,
    )


def _check_residuals(found: Sequence[Seen]) -> list[checks.Check]:
    """Whether the modes leave no more than white noise."""
    chi2, dof = sum(s.chi2 for s in found), sum(s.dof for s in found)
    model = "two modes leave" if found[0].two is not None else "one mode leaves"
    return checks.check_statistics(
        chi2,
        dof,
        [s.compute_residual() for s in found],
        sentence=f"χ²/dof = {chi2 / dof:.3g}: {model} more than the noise; the errors are inflated",
        coloured=f"what {model} is coloured; the errors are inflated by that",
    )


def _agree_on_modes(found: Sequence[Seen]) -> Sequence[Seen]:
    """The runs with as many modes each: where they disagree on what they are, one mode is what all
    of them show."""
    if len({s.two is None for s in found}) == 1:
        return found
    return [
        s
        if s.two is None
        else Seen(s.run, s.whole, s.spacing_s, one_mode.identify(s.run, s.run.envelope[:, 0]), None)
        for s in found
    ]


def _average_runs(found: Sequence[Seen]) -> tuple[Array, Array]:
    """Means of the runs' figures and their standard deviations; the frequency is that of the runs
    with a phase, where there are any."""
    rows, stds = (np.array(v) for v in zip(*(_read_run(s) for s in found), strict=True))
    mean, std = _average(rows, stds)
    phased = np.array([s.run.phase_known for s in found])
    if phased.any():
        mean[:1], std[:1] = _average(rows[phased, :1], stds[phased, :1])
    else:  # bands about one reference are no independent errors
        std[0] = stds[:, 0].max()
    return mean, std


def _tell_given(found: Sequence[Seen], measured: bool) -> str:
    """What of the modes is given, in words; `measured`: a phase tells the frequency."""
    if found[0].two is not None:
        return "the split and both decays are given"
    return (
        f"one mode is seen{_describe_laws(found)}; its {'frequency and ' * measured}decay"
        f" {'are' if measured else 'is'} given"
    )


def _tell_modes(verdict: Verdict, found: Sequence[Seen], mean: Array, std: Array) -> None:
    """Each mode in the verdict's details, and what its frequency may be instead: another alias, or
    anywhere in the windows' band where no phase was measured."""
    measured = any(s.run.phase_known for s in found)
    error = float(std[1])
    if found[0].two is not None:
        half = mean[2] / (2 * np.pi)
        shown = [(mean[0] + half, mean[1] + mean[3]), (mean[0] - half, mean[1] - mean[3])]
        error *= float(np.sqrt(2))
    else:
        shown = [(mean[0], mean[1])]
        verdict.details["amplitude_dependence"] = _average_laws(found)
    spacing = float(np.median([s.spacing_s for s in found]))
    verdict.details["modes"] = [
        {
            "frequency_hz": float(f),
            "damping_rate_1_s": float(d),
            "std_1_s": error,
            "aliases_hz": find_aliases(float(f), spacing) if measured else [],
        }
        for f, d in shown
    ]
    if measured:
        verdict.flat.append(describe_aliases(verdict.details["modes"], spacing))
    else:
        verdict.details["assumed"] = ["frequency_hz"]
        verdict.flat.append(describe_band(float(mean[0]), float(std[0])))
        verdict.suspect.append(verdict.flat[-1])


def _average(table: Array, errors: Array) -> tuple[Array, Array]:
    """Weighted mean over the runs (first axis), and its standard deviation by their errors or their
    scatter, whichever is larger."""
    weight = np.maximum(errors, 1e-300) ** -2.0
    total = np.sum(weight, axis=0)
    mean, std = np.sum(weight * table, axis=0) / total, 1 / np.sqrt(total)
    if len(table) > 1:
        std = np.maximum(std, np.std(table, axis=0, ddof=1) / np.sqrt(len(table)))
    return mean, std


def _average_laws(found: Sequence[Seen]) -> dict[str, dict[str, float]]:
    """Coefficients of the laws of one mode with standard deviations, the mean over the runs."""
    out: dict[str, dict[str, float]] = {}
    reference = np.array([2 * np.pi * s.run.reference_frequency_hz for s in found])
    wider = np.array([np.sqrt(checks.measure_slow_part([s.compute_residual()])) for s in found])
    for law, powers in (("frequency", one_mode.FREQUENCY_POWERS), ("decay", one_mode.DECAY_POWERS)):
        for name in powers:
            table = np.array([getattr(s.mode, law).find_coefficient(name) for s in found])
            if not np.any(table[:, 1] > 0):
                continue
            shift = reference if name == "zero_amplitude_rad_s" else 0.0
            taken = table[:, 1] > 0  # a run that does not show a term says nothing about it
            value, std = _average((table[:, 0] + shift)[taken], (wider * table[:, 1])[taken])
            out[f"{law}_{name}"] = {"value": float(value), "std": float(std)}
    return out


def _describe_laws(found: Sequence[Seen]) -> str:
    """What follows the amplitude, in words."""
    out = []
    dependence = _average_laws(found)
    if (k := dependence.get("frequency_per_amplitude2_rad_s")) is not None:
        out.append(
            f"its frequency follows the amplitude (dω/da² = {k['value']:.4g} ± {k['std']:.1g}"
            " rad/s for an amplitude of 1)"
        )
    if any(len(s.mode.decay.names) > 1 for s in found):
        out.append("its decay is not exponential")
    return f", {' and '.join(out)}" if out else ""


def _tell_cut(seen: Seen) -> str:
    """What of the record is no part of the decay; empty: nothing."""
    first, last = seen.run.time_s[[0, -1]]
    before, after = first - seen.whole.time_s[0], seen.whole.time_s[-1] - last
    parts = [f"the first {before:.3g} s (a strike)"] if before > 0 else []
    parts += [f"the last {after:.3g} s (another sound, or silence)"] if after > 0 else []
    if not parts:
        return ""
    return (
        f"{seen.run.run_id or 'the run'}: {' and '.join(parts)} are no part of the decay and left"
        f" out; it is fitted from {first:.4g} to {last:.4g} s"
    )
