"""Records that show modes but no axes: one channel, or two channels that are not an orthogonal
pair; one mode or two, as the data say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...fitting import checks
from ...fitting.envelopes import one_mode, two_modes
from ...fitting.envelopes.decay_stretch import decay_stretch
from ...fitting.envelopes.envelope_runs import EnvelopeRun, average_rows
from ...fitting.envelopes.one_mode import OneMode
from ...fitting.envelopes.two_modes import Modes
from . import closing
from .outcome import Verdict
from .verdict import ORDER
from .window_band import alias_sentence, aliases, band_hz, band_sentence

Array = np.ndarray
ROWS = 2000
BETTER = 3.0
"""Factor by which two free modes must beat the resonator's χ² before its axes are given up."""
DEAD = 1e-6
"""Part of the signal's energy below which a channel carries none, if it is not within its noise
anyway."""


@dataclass(frozen=True)
class Seen:
    """One run's decay: its rows, the whole record they were cut from, the window's spacing, and the
    one or two modes found in them."""

    run: EnvelopeRun
    whole: EnvelopeRun
    spacing_s: float
    one: OneMode | None
    two: Modes | None

    @property
    def chi2(self) -> float:
        """χ² of the model that was chosen."""
        return self.two.chi2_per_dof * self.two.dof if self.two is not None else _of(self.one).chi2

    @property
    def dof(self) -> int:
        """Its degrees of freedom."""
        return self.two.dof if self.two is not None else _of(self.one).dof

    def residual(self) -> Array:
        """Its misfit over the noise, row by row (n, k)."""
        if self.two is not None:
            return self.two.residual
        laws = (_of(self.one).decay, _of(self.one).frequency)
        return np.column_stack([law.residual for law in laws if law.names])


def _of(one: OneMode | None) -> OneMode:
    assert one is not None
    return one


def thin_run(run: EnvelopeRun) -> EnvelopeRun:
    """At most 2000 rows by averages about the run's own mean frequency; a split turns little in
    one."""
    turn = np.sum(run.envelope[1:] * np.conj(run.envelope[:-1]))
    offset = float(np.angle(turn)) / float(np.median(np.diff(run.time_s)))
    none = np.zeros(1)

    def carry(dt: Array, _turn: Array) -> tuple[Array, Array, Array, Array]:
        factor = np.exp(1j * offset * dt)
        return factor, none, none, factor

    return average_rows(run, ROWS, carry)


def one_channel(runs: Sequence[EnvelopeRun]) -> Verdict | None:
    """The verdict of runs at rest that are one signal each, with one mode or two; None: they are
    ordinary runs.

    Two live channels that are proportional show a line that does not turn: that is an ordinary
    run-down unless it holds two modes.
    """
    if max(float(np.ptp(r.turn_rad)) for r in runs) > 0:
        return None
    signals, dead = [], True
    for run in runs:
        thin = thin_run(run)
        u, one = two_modes.channels(thin)
        if not one:
            return None
        dead &= has_dead_channel(thin)
        signals.append((run, thin, u))
    found = [_seen(run, thin, u) for run, thin, u in signals]
    if not dead and not all(s.two is not None for s in found):
        return None
    return _verdict(
        found, "the channels carry one signal (one is dead or proportional): {what}, no axes"
    )


def has_dead_channel(run: EnvelopeRun) -> bool:
    """Whether one of the two channels holds no more than noise, and the other a signal."""
    power = np.sum(np.abs(run.envelope / run.std[:, None]) ** 2, axis=0)
    noise = 2 * len(run) * (1 + 6 / np.sqrt(len(run)))
    return bool(power.max() > noise and power.min() < max(DEAD * power.max(), noise))


def _seen(run: EnvelopeRun, thin: EnvelopeRun, u: Array) -> Seen:
    """The decay's rows and its modes: two where they are apart and leave less than one whose decay
    and frequency follow its amplitude; one where no phase tells them apart."""
    from_one = decay_stretch(thin, u[:, 0], lambda rows: one_mode.misfit(thin, u[:, 0], rows))
    from_two = (
        decay_stretch(thin, u[:, 0], lambda rows: _misfit_of_two(thin, u, rows))
        if run.phase_known
        else from_one
    )
    both = [
        _fit_modes(thin, u, s, run)
        for s in dict.fromkeys(((from_one.start, from_one.stop), (from_two.start, from_two.stop)))
    ]
    return min(both, key=lambda s: (s.chi2 / s.dof) * (len(thin) / len(s.run)) ** 2)


def _fit_modes(thin: EnvelopeRun, u: Array, stretch: tuple[int, int], run: EnvelopeRun) -> Seen:
    rows = slice(*stretch)
    part, signal = thin.rows(rows), u[rows]
    one = one_mode.identify(part, signal[:, 0])
    spacing = float(np.median(np.diff(run.time_s)))
    if not run.phase_known:
        return Seen(part, thin, spacing, one, None)
    two, single = two_modes.identify(part, signal, 2), two_modes.identify(part, signal, 1)
    adequate = checks.goodness(one.chi2, one.dof).passed
    if (
        two_modes.are_resolved(two, single)
        and not adequate
        and two.chi2_per_dof < one.chi2 / one.dof
    ):
        return Seen(part, thin, spacing, None, two)
    return Seen(part, thin, spacing, one, None)


def _misfit_of_two(run: EnvelopeRun, u: Array, rows: slice) -> tuple[Array, Array]:
    """Squared misfit over the noise, and over the squared amplitude (n,), on every row of what two
    modes of some rows foretell."""
    modes = two_modes.identify(run.rows(rows), u[rows], 2)
    with np.errstate(over="ignore", invalid="ignore"):
        model = np.exp(np.outer(run.time_s - run.time_s[rows][0], modes.exponent)) @ modes.amplitude
        power = np.nan_to_num(np.sum(np.abs(u - model) ** 2, axis=1), nan=np.inf)
        size = np.maximum(
            np.sum(np.abs(u) ** 2, axis=1), np.sum(np.abs(modes.amplitude) ** 2) * 1e-12
        )
        larger = np.maximum(size, np.nan_to_num(np.sum(np.abs(model) ** 2, axis=1), nan=0.0))
    return power / (2 * u.shape[1] * run.std**2), power / larger


def free_modes(
    runs: Sequence[EnvelopeRun], chi2_per_dof: float, impossible: bool = False
) -> Verdict | None:
    """The verdict of one run at rest that two unrelated modes describe far better than a resonator
    seen by an orthogonal pair.

    `impossible`: the resonator found is none (a damping split above the damping), so two modes need
    only be as good.
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
    return _verdict(
        [Seen(run, run, spacing, None, two)],
        f"two unrelated modes (χ²/dof {two.chi2_per_dof:.3g}) describe the run better than {than}:"
        " {what}, no axes",
    )


def _row(seen: Seen) -> tuple[list[float], list[float]]:
    """(mean frequency, mean decay, half the frequency difference, half the decay difference) of a
    run, with standard deviations."""
    reference = 2 * np.pi * seen.run.reference_frequency_hz
    wider = float(np.sqrt(checks.slow_part([seen.residual()])))
    if seen.two is not None:
        high, low = seen.two.exponent
        half = wider * float(np.hypot(*seen.two.std)) / 2
        return [
            (reference + (high.imag + low.imag) / 2) / (2 * np.pi),
            -(high.real + low.real) / 2,
            (high.imag - low.imag) / 2,
            -(high.real - low.real) / 2,
        ], [half / (2 * np.pi), half, half, half]
    laws = _of(seen.one)
    nu = laws.decay.of("viscous_1_s")
    if not seen.run.phase_known:
        return [seen.run.reference_frequency_hz, nu[0]], [band_hz(seen.spacing_s), wider * nu[1]]
    omega = laws.frequency.of("zero_amplitude_rad_s")
    return [(reference + omega[0]) / (2 * np.pi), nu[0]], [
        wider * omega[1] / (2 * np.pi),
        wider * nu[1],
    ]


def _verdict(found: Sequence[Seen], reason: str) -> Verdict:
    """ν and δω (two modes), or ν and the laws of the amplitude (one): the runs' weighted mean,
    errors their own or their scatter."""
    pair = all(s.two is not None for s in found)
    if not pair and any(
        s.two is not None for s in found
    ):  # they disagree on what they are: one mode is what all of them show
        found = [
            (
                s
                if s.two is None
                else Seen(
                    s.run,
                    s.whole,
                    s.spacing_s,
                    one_mode.identify(s.run, s.run.envelope[:, 0]),
                    None,
                )
            )
            for s in found
        ]
    rows, stds = (np.array(v) for v in zip(*(_row(s) for s in found), strict=True))
    mean, std = _mean(rows, stds)
    phased = np.array([s.run.phase_known for s in found])
    measured = bool(phased.any())
    if measured:
        mean[:1], std[:1] = _mean(rows[phased, :1], stds[phased, :1])
    else:  # bands about one reference are no independent errors
        std[0] = stds[:, 0].max()
    names = ("frequency_hz", "damping_rate_1_s", "frequency_split_rad_s")[: 3 if pair else 2]
    covariance = np.zeros((7, 7))
    for name, error in zip(names, std, strict=False):
        covariance[ORDER.index(name), ORDER.index(name)] = error**2
    chi2, dof = sum(s.chi2 for s in found), sum(s.dof for s in found)
    each = np.array([s.chi2 / s.dof for s in found])
    laws = "" if pair else _laws(found)
    reason = reason.format(
        what=(
            "the split and both decays are given"
            if pair
            else f"one mode is seen{laws}; its {'frequency and ' * measured}decay"
            f" {'are' if measured else 'is'} given"
        )
    )
    verdict = Verdict(
        values=dict(zip(names, map(float, mean), strict=False)),
        std=dict(zip(names, map(float, std), strict=False)),
        order=list(ORDER),
        covariance=covariance,
        chi2_per_dof=chi2 / dof,
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
    if pair:
        half = mean[2] / (2 * np.pi)
        shown = [(mean[0] + half, mean[1] + mean[3]), (mean[0] - half, mean[1] - mean[3])]
    else:
        shown = [(mean[0], mean[1])]
        verdict.details["amplitude_dependence"] = _dependence(found)
    error = float(std[1] * np.sqrt(2)) if pair else float(std[1])
    spacing = float(np.median([s.spacing_s for s in found]))
    verdict.details["modes"] = [
        {
            "frequency_hz": float(f),
            "damping_rate_1_s": float(d),
            "std_1_s": error,
            "aliases_hz": aliases(float(f), spacing) if measured else [],
        }
        for f, d in shown
    ]
    if measured:
        verdict.flat.append(alias_sentence(verdict.details["modes"], spacing))
    else:
        verdict.details["assumed"] = ["frequency_hz"]
        verdict.flat.append(band_sentence(float(mean[0]), float(std[0])))
        verdict.suspect.append(verdict.flat[-1])
    verdict.suspect += [sentence for s in found if (sentence := _cut_sentence(s))]
    refusing, doubting = closing.check_bounds(verdict)
    model = "two modes leave" if pair else "one mode leaves"
    return closing.close_verdict(
        verdict,
        [*checks.check_fit(covariance, bool(np.all(np.isfinite(mean)))), *refusing],
        [
            *checks.check_statistics(
                chi2,
                dof,
                [s.residual() for s in found],
                sentence=(
                    f"χ²/dof = {chi2 / dof:.3g}: {model} more than the noise; the errors are"
                    " inflated"
                ),
                coloured=f"what {model} is coloured; the errors are inflated by that",
            ),
            *doubting,
        ],
    )


def _mean(table: Array, errors: Array) -> tuple[Array, Array]:
    """Weighted mean over the runs (first axis), and its standard deviation by their errors or their
    scatter, whichever is larger."""
    weight = np.maximum(errors, 1e-300) ** -2.0
    total = np.sum(weight, axis=0)
    mean, std = np.sum(weight * table, axis=0) / total, 1 / np.sqrt(total)
    if len(table) > 1:
        std = np.maximum(std, np.std(table, axis=0, ddof=1) / np.sqrt(len(table)))
    return mean, std


def _dependence(found: Sequence[Seen]) -> dict[str, dict[str, float]]:
    """Coefficients of the laws of one mode with standard deviations, the mean over the runs."""
    out: dict[str, dict[str, float]] = {}
    reference = np.array([2 * np.pi * s.run.reference_frequency_hz for s in found])
    wider = np.array([np.sqrt(checks.slow_part([s.residual()])) for s in found])
    for law, powers in (("frequency", one_mode.FREQUENCY_POWERS), ("decay", one_mode.DECAY_POWERS)):
        for name in powers:
            table = np.array([getattr(_of(s.one), law).of(name) for s in found])
            if not np.any(table[:, 1] > 0):
                continue
            shift = reference if name == "zero_amplitude_rad_s" else 0.0
            taken = table[:, 1] > 0  # a run that does not show a term says nothing about it
            value, std = _mean((table[:, 0] + shift)[taken], (wider * table[:, 1])[taken])
            out[f"{law}_{name}"] = {"value": float(value), "std": float(std)}
    return out


def _laws(found: Sequence[Seen]) -> str:
    """What follows the amplitude, in words."""
    out = []
    dependence = _dependence(found)
    if (k := dependence.get("frequency_per_amplitude2_rad_s")) is not None:
        out.append(
            f"its frequency follows the amplitude (dω/da² = {k['value']:.4g} ± {k['std']:.1g}"
            " rad/s for an amplitude of 1)"
        )
    if any(len(_of(s.one).decay.names) > 1 for s in found):
        out.append("its decay is not exponential")
    return f", {' and '.join(out)}" if out else ""


def _cut_sentence(seen: Seen) -> str:
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
