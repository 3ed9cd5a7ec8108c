"""Rows from even sampling: windows of a fixed number of samples, one shared basis and one matrix
product a chunk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ...records import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE
from .basis import WindowBasis, build_window_basis
from .demodulator import Demodulator
from .envelope_motion import NEIGHBOURS, does_motion_count, estimate_curvatures, estimate_slopes
from .harmonic_leaks import find_leaking_harmonics, list_harmonics
from .looks import Look
from .signal_rows import Rows
from .stillness import count_least, find_still, mark_stretches
from .windows import Fits, count_pooled_rows, fit_even

Array = np.ndarray

SLOPING = 0.05
"""Part of the residual that the envelope's slope makes, or its curvature where the slope is fitted,
from which it is taken out."""
CONDITION, CONDITION_SHORT = 5.0, 1e3
"""Highest condition of a window's basis; windows asked to be shorter than a period may be worse."""


def make_even_rows(run: Demodulator, block_samples: int) -> Iterator[Rows]:
    """Blocks of rows from even sampling, in the order of time.

    Parameters
    ----------
    run
        The recording on its way through; its window is set here.
    block_samples
        Samples, about, that a block is made of.

    Returns
    -------
    Iterator of dict
        Columns by name, as `make_rows` makes them.

    Raises
    ------
    HrgError
        The recording is too short for one window.

    Examples
    --------
    Five periods a window:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.demodulator import Demodulator
    >>> from hrg_cli.fitting.samples.even import make_even_rows
    >>> from hrg_cli.fitting.samples.survey import survey
    >>> c = np.cos(2 * np.pi * 1000 * np.arange(60_000) / 20e3)
    >>> c = c + 1e-3 * np.random.default_rng(0).standard_normal((2, 60_000))
    >>> one = Recording(c=c[0], s=0.5 * c[1], sample_rate_hz=20e3, mode="free")
    >>> run = Demodulator(one, survey(one, "run"), "run", 5.0, None)
    >>> (block,) = make_even_rows(run, 1 << 20)
    >>> block["signals"].shape, block["signals"].mean(0).round(3).tolist()
    ((600, 4), [1.0, 0.0, 0.5, 0.0])
    """
    recording, rate = run.recording, float(run.recording.sample_rate_hz or 0)
    samples = _choose_window(run, rate)
    run.window_s = samples / rate
    total = len(recording.c) // samples
    basis = run.build_basis(samples, rate, run.reference_hz)
    run.fit_beside(_choose_harmonics(run, basis, samples, total))
    _learn(run, samples, rate)
    pool = count_pooled_rows(samples - run.count_spent())
    chunk = run.count_windows(samples, pool)
    step = chunk * max(1, block_samples // (chunk * samples))
    for first in range(0, total, step):
        last = min(first + step, total)
        # Slopes and bends come from neighbours: each block reads some windows more on both sides,
        # so that rows do not depend on where blocks begin.
        lead = max(0, first - NEIGHBOURS)
        raw = [
            np.asarray(channel[lead * samples : min(last + NEIGHBOURS, total) * samples])
            for channel in (recording.c, recording.s)
        ]
        touching = [_does_touch(raw[k], run.survey.rails[k]) for k in range(2)]
        block = run.make_block(last - first)
        for start in range(first, last, chunk):
            stop = min(start + chunk, last)
            low, high = max(0, start - NEIGHBOURS), min(stop + NEIGHBOURS, total)
            times = (
                recording.first_sample + np.arange(low, high) * samples + (samples - 1) / 2
            ) / rate
            local = run.find_hz((recording.first_sample + (start + chunk / 2) * samples) / rate)
            basis = run.build_basis(samples, rate, local)
            keep, rows = slice(start - low, stop - low), slice(start - first, stop - first)
            pieces = [
                channel[(low - lead) * samples : (high - lead) * samples].reshape(-1, samples)
                for channel in raw
            ]
            envelope, residual2 = _fit_channels(run, pieces, basis)
            still = _find_still_rows(pieces, count_least(rate / run.reference_hz))
            own = [piece[keep] for piece in pieces]
            _flag(block["flags"][rows], run, own, residual2[:, keep], still[keep], touching)
            run.note_still(times[keep], still[keep])
            envelope[:, still], residual2[:, still] = np.nan, np.nan
            fits = _make_fits(run, envelope, residual2, basis, samples)
            run.fill(fits, times, local, keep, block, rows)
        yield block


def _flag(
    flags: Array,
    run: Demodulator,
    pieces: list[Array],
    residual2: Array,
    still: Array,
    touching: Sequence[bool],
) -> None:
    """Set the flags (n,) of windows by their raw samples and their residuals."""
    flags[~np.isfinite(residual2).all(0)] |= FLAG_NOT_FINITE
    flags[still] |= FLAG_GAP
    for k in np.flatnonzero(touching):
        lowest, highest = run.survey.rails[k]
        piece = pieces[k]
        flags[(piece >= highest).any(1) | (piece <= lowest).any(1)] |= FLAG_CLIPPED


def _choose_harmonics(
    run: Demodulator, basis: WindowBasis, samples: int, windows: int
) -> tuple[float, ...]:
    """Folded harmonics [Hz] that get columns of their own beside the signals."""
    if run.every_harmonic:
        return list_harmonics(run.survey, basis, samples, run.moving)
    return find_leaking_harmonics(run.survey, basis, samples, windows, run.moving)


def _make_fits(
    run: Demodulator, envelope: Array, residual2: Array, basis: WindowBasis, samples: int
) -> Fits:
    """Windows of so many samples fitted by one basis."""
    return Fits(
        envelope,
        residual2,
        np.asarray(samples - run.count_spent()),
        np.asarray(samples),
        basis.variance[None],
        basis.slope,
        basis.bent if run.apart else basis.curvature,
        run.apart,
    )


def _fit_channels(run: Demodulator, pieces: list[Array], basis: WindowBasis) -> tuple[Array, Array]:
    """Envelopes (2, windows, tones) and sums of squared residuals (2, windows) of raw windows, in
    the channels' unit; NaN where a sample is not finite."""
    envelope = np.empty((2, len(pieces[0]), len(run.reference)), complex)
    residual2 = np.empty((2, len(pieces[0])))
    for k, piece in enumerate(pieces):
        fitted, left = fit_even(piece, basis, run.apart)
        # raw values are fitted as they are: a factor on a few coefficients is cheaper than on all
        # samples
        np.multiply(fitted, run.find_scale(k), out=envelope[k])
        np.multiply(left, run.find_scale(k) ** 2, out=residual2[k])
        if not np.isfinite(left.sum()):
            bad = ~np.isfinite(left)
            envelope[k, bad] = np.nan
            residual2[k, bad] = np.nan
    return envelope, residual2


def _find_still_rows(pieces: Sequence[Array], least: int) -> Array:
    """Rows (n,) of which both channels repeat one value for a while."""
    count, samples = pieces[0].shape
    still = find_still(pieces[0].ravel(), pieces[1].ravel(), least)
    return mark_stretches(still // samples, count)


def _does_touch(raw: Array, rail: tuple[float, float]) -> bool:
    """Whether any sample of a block touches a rail (one fast pass, so that clean blocks cost no
    more)."""
    if not np.isfinite(rail[0]) and not np.isfinite(rail[1]):
        return False
    highest, lowest = raw.max(), raw.min()
    return not np.isfinite(highest) or bool(highest >= rail[1] or lowest <= rail[0])


def _choose_window(run: Demodulator, rate: float) -> int:
    """Samples a window: those asked for, or as many more as the basis needs to be regular with two
    degrees of freedom to spare."""
    n = len(run.recording.c)
    asked = max(1, round(run.periods_asked * rate / run.reference_hz))
    if run.moving and run.moving_asked is None and asked < 3 * run.count_columns():
        run.moving = False
    worst = CONDITION if run.periods_asked >= 0.9 and not run.moving_asked else CONDITION_SHORT
    samples = asked
    while samples <= n:
        basis = build_window_basis(samples, rate, tuple(run.reference), run.nuisance, run.moving)
        if basis is not None and basis.freedom >= 2 and basis.condition <= worst:
            if samples > asked:
                run.notes.append(
                    f"windows of {samples} samples ({samples * run.reference_hz / rate:.3g}"
                    f" periods) are used: {asked} ({run.periods_asked:g} periods) are too few for"
                    " the fit"
                )
            return samples
        samples += max(1, samples // 16)
    raise run.tell_too_short()


def _learn(run: Demodulator, samples: int, rate: float) -> None:
    """What windows of this length leave at each look: the calm level that a settling start stands
    out of, and the noise's colour."""
    found = list(zip(run.survey.looks, run.survey.look_noise2, strict=True))
    found = [(look, noise2) for look, noise2 in found[1:] or found if look.y.shape[1] >= samples]
    looks = [look for look, _ in found]
    bases = [run.build_basis(samples, rate, run.find_hz(float(x.time_s.mean()))) for x in looks]
    run.apart = _does_motion_count(run, looks, bases, samples)
    seen = []
    for (look, noise2), basis in zip(found, bases, strict=True):
        count = look.y.shape[1] // samples
        pieces = look.y[:, : count * samples].reshape(2, count, samples)
        envelope, left = zip(*(fit_even(piece, basis, run.apart) for piece in pieces), strict=True)
        fits = _make_fits(run, np.stack(envelope), np.stack(left), basis, samples)
        centres = look.time_s[0] + ((samples - 1) / 2 + np.arange(count) * samples) / rate
        seen.append((fits, centres, run.find_hz(float(look.time_s.mean())), noise2))
    run.learn_calm(seen)
    run.learn_colour(
        run.build_basis(samples, rate, run.find_hz(float(run.survey.looks[0].time_s.mean()))), rate
    )


def _does_motion_count(
    run: Demodulator, looks: Sequence[Look], bases: Sequence[WindowBasis], samples: int
) -> bool:
    """Whether the envelopes' slopes from window to window, or their curvatures where the windows
    fit the slopes, put more than a part of it into the residuals of the looks, and the windows hold
    samples enough to take it out."""
    still = np.zeros(len(run.reference))
    for look, basis in zip(looks, bases, strict=True):
        if not basis.sloping.shape[1]:
            return False
        count = look.y.shape[1] // samples
        turn = run.compute_turns(float(look.time_s[0]) + run.window_s / 2, count)
        for y in look.y[:, : count * samples].reshape(2, count, samples):
            envelope, left = fit_even(y, basis)
            u = (envelope * turn)[None]
            if run.moving:
                motion, pull = (
                    (estimate_curvatures(u, still, run.window_s) or (None,))[0],
                    basis.curvature,
                )
            else:
                motion, pull = estimate_slopes(u, still, run.window_s), basis.slope
            if motion is not None and does_motion_count(left[None], motion, pull, SLOPING):
                return True
    return False
