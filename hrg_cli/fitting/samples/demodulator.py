"""The part of demodulation that even and uneven sampling share: local frequency, reference phase,
rows with standard deviations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...errors import HrgError
from ...records import FLAG_CLIPPED, Recording
from ..medians import find_known_median, find_median
from ..noise.window_scatter import estimate_scattered_variance, settle_by_scatter
from .basis import WindowBasis, build_columns, build_window_basis
from .frequency import list_bands, list_nuisances
from .gaps import Gaps
from .signal_rows import Rows, Variances, make_rows, write_signals
from .spectrum import Colour, estimate_colour
from .still_envelopes import MotionWithin, Still
from .survey import Survey
from .windows import Fits, pool_variance, sum_energy

Array = np.ndarray

CHUNK_SAMPLES, CHUNK_WINDOWS = (1 << 18, 1 << 20), 256
"""Samples, at least and at most, and windows in between, that share one local basis frequency."""

DRIFT_RAD = 0.03
"""Most that the envelope may turn within a window for the local frequency's error at a chunk's
ends."""

FREQUENCY_STEP = 3e-5
"""The local frequency is rounded to this part of 1/window, so that a steady run keeps its basis;
the amplitude errs by less than 1e-9."""

UNHELD_NOISE, UNHELD = 4.0, 0.01
"""Variance over the samples' noise, and rms over the wave's, above which what windows leave is a
motion that they do not hold: a beat of whole turns a window looks still from one to the next."""

MOVING_PERIODS = 3.0
"""From so many periods per window the basis holds t·cos, t·sin, which then cost no precision."""


@dataclass
class Demodulator:
    """One recording on its way through; `window_s` is set by the sampling's own module before the
    first row."""

    recording: Recording
    survey: Survey
    name: str
    periods_asked: float
    moving_asked: bool | None
    window_s: float = 0.0
    notes: list[str] = field(default_factory=list)
    judged_s: tuple[float, float] = (-np.inf, np.inf)
    """Times between which the envelope's motion is judged: of a struck body, its run-down."""
    every_harmonic: bool = False
    """Whether even windows fit the first harmonics though no spectrum was asked for them."""

    def __post_init__(self) -> None:
        carrier = self.survey.carrier_hz
        self.reference_hz = self.survey.reference_hz
        self.sign = np.array([1.0]) if carrier is None else np.array([-1.0, 1.0])
        self.reference = np.array(list_bands(self.reference_hz, carrier))
        self.nuisance = list_nuisances(carrier)
        self.moving = (
            self.periods_asked >= MOVING_PERIODS if self.moving_asked is None else self.moving_asked
        )
        self.apart = False
        """Whether the residual of windows without t·cos, t·sin is taken without the slope all the
        same."""
        self.calm: tuple[float, float] = (np.inf, np.inf)
        """Median over the looks of a window's residual variance, both channels summed, and of that
        over the wave's power."""
        self.bent, self.bent_by = 0, 0.0
        """Channel windows whose envelope moves too much for the window, and by how many standard
        deviations."""
        self.still, self.still_since_s = 0, np.nan
        """Windows so far in which both channels stand still, and the first of them."""
        self.unheld = 0.0
        """Rms that windows leave beside the noise and beside what their neighbours foretell, over
        the wave's, median over the looks; 0 where that is none."""
        self.gaps: Gaps | None = None
        """Of uneven sampling."""
        self._ahead_hz = 0.0
        self._basis: tuple[float, WindowBasis] | None = None
        self._course = np.zeros((0, 1), complex)
        self._colour: Colour | None = None

    def count_windows(self, window_samples: float, pool: int) -> int:
        """Windows that share one basis: a multiple of `pool`, so few that the frequency's drift
        turns none by `DRIFT_RAD`.

        Parameters
        ----------
        window_samples
            Of one window, a mean where they differ.
        pool
            Windows whose noise is pooled.

        Returns
        -------
        int
            `pool` at least.
        """
        windows = max(
            1,
            int(
                min(max(CHUNK_SAMPLES[0], CHUNK_WINDOWS * window_samples), CHUNK_SAMPLES[1])
                / window_samples
            ),
        )
        track_s, track_hz = self.survey.track_s, self.survey.track_hz
        if len(track_s) > 1:
            drift = float(np.abs(np.diff(track_hz) / np.diff(track_s)).max())
            windows = min(
                windows, max(8, int(DRIFT_RAD / (np.pi * max(drift, 1e-30) * self.window_s**2)))
            )
        return pool * max(1, windows // pool)

    def fit_beside(self, tone_hz: tuple[float, ...]) -> None:
        """Give tones columns of their own in every window, beside the signals.

        Parameters
        ----------
        tone_hz
            Their frequencies.
        """
        if tone_hz:  # the basis without them serves on where there are none
            self.nuisance, self._basis = (*self.nuisance, *tone_hz), None

    @property
    def takes_bends_off(self) -> bool:
        """Whether every window's bend is taken off; of shorter ones only where it counts."""
        return self.periods_asked >= MOVING_PERIODS

    def make_block(self, rows: int) -> Rows:
        """A block's columns, to be filled.

        Parameters
        ----------
        rows
            Windows of the block.

        Returns
        -------
        dict of ndarray
            As `make_rows` makes them.
        """
        return make_rows(rows, len(self.reference))

    def count_columns(self) -> int:
        """Unknowns of a window.

        Returns
        -------
        int
            Of wanted signals, constant, nuisances and their motion.
        """
        return build_columns(np.zeros(1), tuple(self.reference), self.nuisance, self.moving).shape[
            1
        ]

    def count_spent(self) -> int:
        """Degrees of freedom of a window that its residual does not have.

        Returns
        -------
        int
            Its unknowns, and two a tone more where the slope is taken out of the residual.
        """
        return self.count_columns() + (2 * len(self.reference) if self.apart else 0)

    def find_scale(self, k: int) -> float:
        """Unit of a channel a raw count.

        Parameters
        ----------
        k
            0 or 1.

        Returns
        -------
        float
            1 of values that are recorded as they are.
        """
        return float(self.recording.c_scale_factor if k == 0 else self.recording.s_scale_factor)

    def find_least_variance(self, k: int) -> float:
        """Least variance a sample: a converter's rounding, 1/12 of a count squared; for floats
        their own rounding.

        Parameters
        ----------
        k
            Channel, 0 or 1.

        Returns
        -------
        float
            Unit of the signals squared.
        """
        dtype = (self.recording.c if k == 0 else self.recording.s).dtype
        least = self.survey.least_count[k] ** 2 / 12
        if np.issubdtype(dtype, np.integer):
            return max(least, self.find_scale(k) ** 2 / 12)
        return max(least, self.survey.strength2 * float(np.finfo(dtype).eps) ** 2, 1e-300)

    def find_least_count(self) -> float | None:
        """The coarser channel's least count.

        Returns
        -------
        float or None
            Unit of the signals; None where the values are a continuum.
        """
        return max(self.survey.least_count) or None

    def estimate_quantisation_share(self) -> float | None:
        """Part of the residual variance (median over the looks) that rounding makes: Σ least
        count²/12 over both channels'.

        Returns
        -------
        float or None
            From 0 to 1; None where the values are a continuum or the residual is not known.
        """
        power = self.calm[0]
        if not max(self.survey.least_count) or not np.isfinite(power):
            return None
        samples = self.window_s / self.survey.step_s
        power *= samples / max(1.0, samples - self.count_spent())
        rounding = sum(step**2 for step in self.survey.least_count) / 12
        return float(min(1.0, rounding / max(power, 1e-300)))

    def tell_too_short(self) -> HrgError:
        """Tell that a recording holds no window.

        Returns
        -------
        HrgError
            To be raised.
        """
        return HrgError(
            f"{self.name}: its {len(self.recording.c)} samples do not hold one window of"
            f" {self.periods_asked:g} periods at {self.reference_hz:.6g} Hz; record longer or set"
            " periods_per_window lower"
        )

    def find_hz(self, time_s: float) -> float:
        """Frequency of the basis at a time: the survey's course, corrected by what the chunk before
        has shown.

        Parameters
        ----------
        time_s
            On the samples' clock.

        Returns
        -------
        float
            Hz, a multiple of `FREQUENCY_STEP` over the window's length.
        """
        step = FREQUENCY_STEP / self.window_s
        return float(round((self.survey.interpolate_hz(time_s) + self._ahead_hz) / step) * step)

    def list_bands(self, local_hz: float) -> tuple[float, ...]:
        """Frequencies of the signals where the oscillation is at a local frequency.

        Parameters
        ----------
        local_hz
            Of the oscillation.

        Returns
        -------
        tuple of float
            One or two, Hz.
        """
        return list_bands(local_hz, self.survey.carrier_hz)

    def follow(self, u: Array, time_s: float) -> None:
        """Learn from a chunk's envelopes by how much the frequency differs from the survey's
        course.

        The phase from row to row, each weighted by its power, is (f − f_r)·2πT.

        Parameters
        ----------
        u
            Envelopes (channels, rows, F) in reference phase.
        time_s
            Middle of the chunk.
        """
        if u.shape[1] <= 8:
            return
        # Phase from row to row, each weighted by its power.
        cross = np.einsum("kra,kra->a", u[:, :-1].conj(), u[:, 1:])
        total = complex(np.where(self.sign < 0, cross.conj(), cross).sum())
        # Below 0.9 noise or a beat turns the envelope, not its frequency.
        if np.isfinite(total) and abs(total) > 0.9 * sum_energy(u):
            seen = self.reference_hz + float(np.angle(total)) / (2 * np.pi * self.window_s)
            self._ahead_hz = seen - self.survey.interpolate_hz(time_s)

    def build_basis(self, samples: int, rate_hz: float, local_hz: float) -> WindowBasis:
        """The shared basis of even windows at a local frequency, kept while that stays the same.

        Parameters
        ----------
        samples
            Of a window.
        rate_hz
            Of the samples.
        local_hz
            Of the oscillation.

        Returns
        -------
        WindowBasis
            Of all windows of the chunk.

        Raises
        ------
        HrgError
            A window of that length does not tell its unknowns apart.
        """
        if self._basis is None or self._basis[0] != local_hz:
            basis = build_window_basis(
                samples, rate_hz, self.list_bands(local_hz), self.nuisance, self.moving
            )
            if basis is None:
                raise self.tell_too_short()
            self._basis = (local_hz, basis)
        return self._basis[1]

    def learn_colour(self, basis: WindowBasis, rate_hz: float) -> None:
        """Take the residual's spectrum into the standard deviations, where it is not white.

        Parameters
        ----------
        basis
            Of a window, or of one alike.
        rate_hz
            Of the samples.
        """
        found = self.survey
        if found.spectrum_segments == 0 or len(found.spectrum_hz) < 16:
            return
        noise = estimate_colour(
            found.spectrum_hz,
            found.spectrum_density,
            found.spectrum_segments,
            basis,
            rate_hz,
            found.blind_hz,
            self.apart,
        )
        if not noise.is_white:
            self._colour = noise
            worst = np.sqrt(noise.whole.mean(1))
            self.notes.append(
                "the residual is not white; standard deviations follow its spectrum "
                f"({worst[0]:.2g} and {worst[1]:.2g} times those of white noise, C and S)"
            )

    def compute_turns(self, start_s: float, rows: int) -> Array:
        """Turns e^{−jω_r t} of windows one after another; the course within a chunk is computed
        once.

        Parameters
        ----------
        start_s
            Centre of the first window.
        rows
            Of them.

        Returns
        -------
        ndarray
            (rows, F), complex.
        """
        if len(self._course) < rows:
            self._course = np.exp(
                -2j
                * np.pi
                * np.fmod(np.arange(rows)[:, None] * self.window_s * self.reference, 1.0)
            )
        return self._course[:rows] * np.exp(-2j * np.pi * np.fmod(start_s * self.reference, 1.0))

    def learn_calm(self, seen: Sequence[tuple[Fits, Array, float, Array]]) -> None:
        """Learn what windows leave at each look.

        Parameters
        ----------
        seen
            Of each look: its fits, their centres (n,) in s, the local frequency in Hz, and the
            variance of the samples' own noise there (channels,).
        """
        levels = []
        for fits, times, local_hz, noise2 in seen:
            left2 = fits.residual2.sum(0) / np.maximum(fits.samples, 1)
            wave2 = (np.abs(fits.envelope) ** 2).sum((0, 2)) / 2
            if np.isfinite(left2).any():
                relative = find_known_median(left2 / np.maximum(wave2, 1e-300))
                unheld = self._measure_unheld(fits, times, local_hz, noise2)
                levels.append((find_known_median(left2), relative, unheld))
        if levels:
            power, relative, self.unheld = (float(x) for x in find_median(levels, axis=0))
            self.calm = power, relative

    def _measure_unheld(self, fits: Fits, times: Array, local_hz: float, noise2: Array) -> float:
        """Rms over the wave's of what windows of one look leave beside its noise (channels,), the
        motion that their neighbours foretell taken off."""
        turn = self.compute_turns(float(times[0]), len(times))
        still = self._take_motion_off(fits, turn, times, local_hz)
        known = 0.0 if still.known_residual2 is None else still.known_residual2
        each = (fits.residual2 - known) / np.maximum(fits.freedom, 1)
        left2 = np.array([find_known_median(one) for one in each])
        wave2 = find_known_median((np.abs(fits.envelope) ** 2).sum((0, 2)) / 2)
        if left2.sum() <= UNHELD_NOISE * noise2.sum():
            return 0.0
        return float(np.sqrt((left2 - noise2).sum() / max(wave2, 1e-300)))

    def _take_motion_off(self, fits: Fits, turn: Array, times: Array, local_hz: float) -> Still:
        """The windows' envelopes at the reference phase without their motion's pull."""
        offset = 2 * np.pi * (local_hz - self.reference_hz) * self.sign
        within = MotionWithin(self.window_s, self.moving, self.takes_bends_off, self.judged_s)
        return within.take_off(fits, fits.envelope * turn, turn, times, offset)

    def note_still(self, times: Array, still: Array) -> None:
        """Keep count of the windows in which both channels repeat one value.

        Parameters
        ----------
        times
            Centres of a chunk's own windows (n,), s.
        still
            Which of them are such (n,), bool.
        """
        if still.any():
            self.still_since_s = times[still][0] if self.still == 0 else self.still_since_s
            self.still += int(np.count_nonzero(still))

    def _count_bent(self, doubt: Array, std: Array) -> None:
        """Keep count of windows in which what the envelope's motion leaves uncorrected exceeds half
        the noise."""
        bent = doubt > std / 2
        self.bent += int(np.count_nonzero(bent))
        if bent.any():
            self.bent_by = max(self.bent_by, float(find_median(doubt[bent] / std[bent])))

    def fill(
        self, fits: Fits, times: Array, local_hz: float, keep: slice, out: Rows, rows: slice
    ) -> None:
        """Fill rows of a block from a chunk: reference phase, standard deviations.

        Parameters
        ----------
        fits
            Of the chunk's windows and of neighbours.
        times
            Their centres (n,), s.
        local_hz
            Of the oscillation in the basis.
        keep
            The chunk's own windows among them; the others are fitted only for the slopes.
        out
            The block's columns.
        rows
            Those of the chunk in the block.
        """
        turn = self.compute_turns(float(times[0]), len(times))
        still = self._take_motion_off(fits, turn, times, local_hz)
        self.follow(still.envelope[:, keep], float(times[0] + times[-1]) / 2)
        clipped = out["flags"][rows] & FLAG_CLIPPED != 0
        for k in range(2):
            sample2 = self._pool_sample_variance(fits, still, k, keep)
            own = self._compute_own_variance(fits, still, k, keep, sample2, clipped)
            unsure = 0.0 if still.doubt2 is None else still.doubt2[k, keep]
            write_signals(
                out, rows, k, still.envelope[k, keep], turn[keep], Variances(sample2, own, unsure)
            )
            samples = (
                fits.samples if np.ndim(fits.samples) == 0 else np.maximum(fits.samples[keep], 1)
            )
            np.sqrt(fits.residual2[k, keep] / samples, out=out["residual_rms"][rows, k])
            if still.doubt2 is not None:
                judged = (times[keep] > self.judged_s[0]) & (times[keep] < self.judged_s[1])
                std = np.sqrt(np.broadcast_to(sample2[:, 0] * own[:, 0], len(turn[keep])))
                self._count_bent(np.sqrt(unsure).max(-1)[judged], std[judged])
        out["time_s"][rows] = times[keep]

    def _pool_sample_variance(self, fits: Fits, still: Still, k: int, keep: slice) -> Array:
        """Variance (windows, 1) of a channel's samples: pooled over windows, and no less than the
        least count leaves."""
        freedom = fits.freedom if np.ndim(fits.freedom) == 0 else fits.freedom[keep]
        known = None if still.known_residual2 is None else still.known_residual2[k, keep]
        pooled = pool_variance(fits.residual2[k, keep], freedom, known)
        if known is not None:
            own = (fits.variance if len(fits.variance) == 1 else fits.variance[keep]).mean(1)
            seen = estimate_scattered_variance(still.envelope[k, keep], own * still.noisier**2)
            pooled = settle_by_scatter(pooled, known / np.maximum(freedom, 1), freedom, seen)
        return np.asarray(np.maximum(pooled, self.find_least_variance(k))[:, None])

    def _compute_own_variance(
        self, fits: Fits, still: Still, k: int, keep: slice, sample2: Array, clipped: Array
    ) -> Array:
        """Variance (windows, 2 tones) of a channel's coefficients in that of one sample: by the
        fit, by what was taken off, by the noise's colour."""
        variance = fits.variance if len(fits.variance) == 1 else fits.variance[keep]
        own = variance * still.noisier**2
        if self._colour is None:
            return np.asarray(own)
        # rounding to the least count is white whatever the noise's colour: the colour does not take
        # it below that
        white = (
            self.find_least_variance(k) / np.nanmean(sample2) if np.isfinite(sample2).any() else 0.0
        )
        coloured = np.maximum(self._colour.take_windows(k, sample2), white)
        # a clipped top bends the signal itself, not its harmonics alone: the colour takes nothing
        # off
        return np.asarray(own * np.where(clipped[:, None], np.maximum(coloured, 1.0), coloured))
