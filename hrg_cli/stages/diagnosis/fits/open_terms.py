"""Diagnosis, the vocabulary of the open search: places of the envelope equation and of the
read-out, and functions of what is known.

u' += g·M u, u' += g·F of the drive's force F, or u_m = u + g·M u. M: damping −1, frequency j, their
splits −R, jR, turning J, circular jJ, one channel's gain or phase; g: powers of time, amplitude,
temperature, rate, harmonics of an angle, and in time a step, a tone or a decay e^{−t/τ} of free
shape.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import null_space

from ....effects.effect import Effect, Parameter
from ....fitting.causes.measured_runs import MeasuredRuns
from ....physics import ellipse

Array = np.ndarray
LEAST_KELVIN = 1e-6
"""Range of temperature below which it is constant but for rounding."""
HARMONICS = (1, 2, 3, 4, 6, 8)
"""Of mθ: the harmonic theorem's, those of two defects together, and 12θ, 16θ of an HRG's
electrodes."""
MOST_RUNS = 8
"""Runs up to which what differs from run to run is a term of its own: of more it has so many
numbers that it describes little."""
OF_EVERY_RUN = ("frequency", "damping", "turning")
"""Places at which what differs from run to run is asked otherwise: the first is free in every run,
the others are a run's own mistake (a leak, a rate that no log tells of)."""
STEPS, DECAYS = 15, 4
"""Instants of steps on the first grid, and decays from half the longest run downwards in factors of
two; then their shape is refined."""


@dataclass(frozen=True)
class Place:
    """Where a term acts: its columns M u, the symbol it changes and its unit; `readout`: on what is
    seen, not on the motion; `of_drive`: M acts on the drive's force instead of the envelopes."""

    name: str
    symbol: str
    units: str
    readout: bool
    columns: Callable[[Array], list[Array]]
    of_drive: bool = False

    def acts_in(self, series: MeasuredRuns) -> bool:
        """Whether any of the runs has what it acts on."""
        return not self.of_drive or bool(np.any(series.forced > 0))


def _mirror(u: Array) -> Array:
    """(uᵀu) u*/u†u: what every isotropic nonlinearity has beside the part along u (PHYSICS §7)."""
    size = np.sum(np.abs(u) ** 2, axis=-1, keepdims=True)
    return np.sum(u**2, axis=-1, keepdims=True) * np.conj(u) / np.where(size > 0, size, 1.0)


def _turned(u: Array) -> Array:
    """J u."""
    return np.stack([u[..., 1], -u[..., 0]], -1)


def _split(u: Array) -> list[Array]:
    """R(0) u and R(π/2) u."""
    c, s = u[..., 0], u[..., 1]
    return [np.stack([c, -s], -1), np.stack([s, c], -1)]


PLACES = (
    Place("damping", "ν", "s-1", False, lambda u: [-u]),
    Place("frequency", "φ̇", "rad s-1", False, lambda u: [1j * u]),
    Place("damping split", "νδμ", "s-1", False, lambda u: [-x for x in _split(u)]),
    Place("frequency split", "δω", "rad s-1", False, lambda u: [1j * x for x in _split(u)]),
    Place("turning", "−mθ̇", "rad s-1", False, lambda u: [_turned(u)]),
    Place("circular", "ṙ", "s-1", False, lambda u: [1j * _turned(u)]),
    Place(
        "precession with quadrature",
        "φ̇ and −mθ̇·a_A/2a_B",
        "rad s-1",
        False,
        lambda u: [1j * _mirror(u)],
    ),
    Place("gain", "a", "1", True, lambda u: [u]),
    Place("gain split", "g/2", "1", True, lambda u: _split(u)[:1]),
    Place("non-orthogonality", "ε/2", "1", True, lambda u: _split(u)[1:]),
    Place("gain of C", "g_C", "1", True, lambda u: [u * [1, 0]]),
    Place("gain of S", "g_S", "1", True, lambda u: [u * [0, 1]]),
    Place("phase", "φ", "rad", True, lambda u: [1j * u]),
    Place("phase split", "ψ/2", "rad", True, lambda u: [1j * _split(u)[0]]),
    Place("quadrature cross-talk", "ε_q/2", "rad", True, lambda u: [1j * _split(u)[1]]),
    Place("phase of C", "ψ_C", "rad", True, lambda u: [u * [1j, 0]]),
    Place("phase of S", "ψ_S", "rad", True, lambda u: [u * [0, 1j]]),
    Place("angle", "−mθ", "rad", True, lambda u: [_turned(u)]),
    Place("quadrature offset", "r", "1", True, lambda u: [1j * _turned(u)]),
    Place("drive gain", "F", "1", False, lambda force: [force], of_drive=True),
)
"""Of places that do the same in some runs the first is named."""

Function = Callable[[Array, Any], Array]
"""(u (..., 2), series or slow state) -> values (parts, ...)."""


@dataclass(frozen=True)
class Covariate:
    """A function of what is known along the runs, `parts` of it (two: cosine and sine), with its
    name and formula."""

    name: str
    formula: str
    function: Function
    parts: int = 1
    harmonic: int = 0
    """Of the wave angle θ, or of the table's angle."""
    shape: OpenShape | None = None
    places: tuple[str, ...] = ()
    """Names of the places it makes sense at; all where none is named."""
    contrasts: Array | None = None
    """Of the runs (parts, R), where the parts are these."""


@dataclass(frozen=True)
class OpenShape:
    """What is still free in a covariate's form: how it is made from the number, the number, and the
    first grid's spacing."""

    make: Callable[[MeasuredRuns, float], Covariate]
    value: float
    width: float


def list_covariates(
    series: MeasuredRuns, u: Array, cycles: Sequence[float] = ()
) -> Iterator[Covariate]:
    """The functions looked through.

    Parameters
    ----------
    series
        Of the runs.
    u
        Their motion (R, n, 2), from which the scales come.
    cycles
        Of tones in the longest run.

    Returns
    -------
    iterator of Covariate
        The constant first.

    Examples
    --------
    >>> from itertools import islice
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.open_terms import list_covariates
    >>> fit = draw_fit()
    >>> [one.formula for one in islice(list_covariates(fit.series, fit.prediction.motion), 6)]
    ['1', 'run by run', '√(t/T)', 't/T', '(t/T)²', 'a/a₀']
    """
    good = series.weight > 0
    a0 = float(np.sqrt((_amplitude(u)[good] ** 2).mean()))
    yield Covariate("none", "1", lambda u, s: np.ones((1, *u.shape[:-1])))
    yield from _of_runs(series)
    yield from _of_times(series)
    yield from _of_amplitudes(a0)
    yield from _of_temperatures(series)
    yield from _of_rates(series, a0)
    yield from _of_wave_angles(series, a0)
    for k in range(1, STEPS + 1):
        yield make_step(series, k / (STEPS + 1))
    for k in range(1, DECAYS + 1):
        yield make_decay(series, -k * np.log(2))
    for number in cycles:
        yield make_tone(series, number)


def _of_runs(series: MeasuredRuns) -> Iterator[Covariate]:
    """What stands otherwise in every run: contrasts of the runs, since what all have in common is a
    constant. A frequency, a damping and a turn of its own are asked of every run elsewhere; in
    driven runs boards and loops do what differs with the rate."""
    if goes_by_run(series):
        count = len(series.names)
        contrasts = np.zeros((count - 1, int(series.numbers.max()) + 1))
        contrasts[:, series.numbers] = null_space(np.ones((1, count))).T
        places = tuple(p.name for p in PLACES if p.name not in OF_EVERY_RUN)
        yield Covariate(
            "run", "run by run", _of_run(contrasts), count - 1, 0, None, places, contrasts
        )


def goes_by_run(series: MeasuredRuns) -> bool:
    """Whether what differs from run to run is asked of these runs.

    Parameters
    ----------
    series
        Of the runs.

    Returns
    -------
    bool
        Of two to eight free runs.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.open_terms import goes_by_run
    >>> goes_by_run(draw_fit().series)
    True
    """
    return 2 <= len(series.names) <= MOST_RUNS and not np.any(series.forced > 0)


def _of_run(contrasts: Array) -> Function:
    return lambda u, s: np.stack([np.broadcast_to(one[s.run], u.shape[:-1]) for one in contrasts])


def _of_times(series: MeasuredRuns) -> Iterator[Covariate]:
    span = _span(series)
    for power, formula in ((0.5, "√(t/T)"), (1, "t/T"), (2, "(t/T)²")):
        yield Covariate("time", formula, _of_time(power, span))


def _of_amplitudes(a0: float) -> Iterator[Covariate]:
    for power, formula in (
        (1, "a/a₀"),
        (2, "(a/a₀)²"),
        (3, "(a/a₀)³"),
        (4, "(a/a₀)⁴"),
        (-1, "a₀/a"),
    ):
        yield Covariate("amplitude", formula, _of_amplitude(power, a0))


def _warmth(series: MeasuredRuns) -> tuple[float, float] | None:
    """Mean and range of the temperature; None where it stands still."""
    warm = series.temperature_degc[series.weight > 0]
    scale = float(np.ptp(warm))
    return (float(warm.mean()), scale) if scale > LEAST_KELVIN else None


def _of_temperatures(series: MeasuredRuns) -> Iterator[Covariate]:
    warmth = _warmth(series)
    if warmth is None:
        return
    mean, scale = warmth
    yield Covariate(
        "temperature",
        "(T − T₀)/ΔT",
        lambda u, s: _spread_over_runs(u, (s.temperature_degc - mean) / scale),
    )
    yield Covariate(
        "temperature",
        "((T − T₀)/ΔT)²",
        lambda u, s: _spread_over_runs(u, ((s.temperature_degc - mean) / scale) ** 2),
    )
    top = _fastest_warming(series)
    if top is not None:
        yield Covariate(
            "temperature rate",
            "Ṫ/Ṫ₀",
            lambda u, s: _spread_over_runs(u, s.temperature_rate_degc_s / top),
        )


def _fastest_warming(series: MeasuredRuns) -> float | None:
    """The largest rate of the temperature; None where it does not change from row to row or run to
    run."""
    steep = series.temperature_rate_degc_s[series.weight > 0]
    top = float(np.abs(steep).max())
    if np.ptp(steep) > 1e-6 * top and top * _span(series) > LEAST_KELVIN:
        return top
    return None


def _of_rates(series: MeasuredRuns, a0: float) -> Iterator[Covariate]:
    """Of the table's rate, what a scale factor follows, and of the table's angle; none at rest."""
    good, span = series.weight > 0, _span(series)
    fastest = float(np.abs(series.rate_rad_s[good]).max())
    if fastest == 0:
        return
    yield Covariate("rate", "Ω/Ω₀", lambda u, s: _spread_over_runs(u, s.rate_rad_s / fastest))
    yield Covariate(
        "rate", "|Ω|/Ω₀", lambda u, s: _spread_over_runs(u, np.abs(s.rate_rad_s) / fastest)
    )
    yield Covariate(
        "rate", "(Ω/Ω₀)²", lambda u, s: _spread_over_runs(u, (s.rate_rad_s / fastest) ** 2)
    )
    yield Covariate(
        "rate", "(Ω/Ω₀)³", lambda u, s: _spread_over_runs(u, (s.rate_rad_s / fastest) ** 3)
    )
    yield _scale_factor("time", "t/T", lambda u, s: s.time_s / span, fastest)
    yield _scale_factor("amplitude", "(a/a₀)²", lambda u, s: (_amplitude(u) / a0) ** 2, fastest)
    warmth = _warmth(series)
    if warmth is not None:
        mean, scale = warmth
        yield _scale_factor(
            "temperature", "(T − T₀)/ΔT", lambda u, s: (s.temperature_degc - mean) / scale, fastest
        )
        yield _scale_factor(
            "temperature",
            "((T − T₀)/ΔT)²",
            lambda u, s: ((s.temperature_degc - mean) / scale) ** 2,
            fastest,
        )
    top = _fastest_warming(series)
    if top is not None:
        yield _scale_factor(
            "temperature rate", "Ṫ/Ṫ₀", lambda u, s: s.temperature_rate_degc_s / top, fastest
        )
    if np.ptp(series.table_angle_rad[good]) > 1:
        for n in (1, 2):
            yield Covariate(
                f"table angle × {n}", f"harmonic {n} of the table angle", _of_table(n), 2, n
            )


def _of_wave_angles(series: MeasuredRuns, a0: float) -> Iterator[Covariate]:
    for n in HARMONICS:
        harmonic = series.mode_number * n
        yield Covariate("wave angle", f"harmonic {harmonic}θ", _of_wave(n), 2, harmonic)
        if n in (2, 4):
            yield Covariate(
                "wave angle and amplitude",
                f"harmonic {harmonic}θ × (a/a₀)²",
                _of_wave(n, a0),
                2,
                harmonic,
            )


def _scale_factor(
    name: str, formula: str, follows: Callable[[Array, Any], Array], fastest: float
) -> Covariate:
    """What a scale factor does that follows something: the rate times that, at the turning
    alone."""
    return Covariate(
        f"rate and {name}",
        f"Ω/Ω₀ × {formula}",
        lambda u, s: _spread_over_runs(u, follows(u, s) * s.rate_rad_s / fastest),
        places=("turning",),
    )


def _of_time(power: float, span: float) -> Function:
    return lambda u, s: _spread_over_runs(u, np.maximum(s.time_s / span, 0.0) ** power)


def _of_amplitude(power: int, unit: float) -> Function:
    return lambda u, s: (_amplitude(u) / unit)[None] ** power


def _of_table(harmonic: int) -> Function:
    return lambda u, s: _pair(harmonic * s.table_angle_rad) * np.sign(np.abs(s.rate_rad_s))


def _of_wave(harmonic: int, unit: float | None = None) -> Function:
    """A harmonic of mθ, times (a/unit)² where a unit is given."""
    if unit is None:
        return lambda u, s: _pair(harmonic * _angle(u))
    return lambda u, s: _pair(harmonic * _angle(u)) * (_amplitude(u) / unit) ** 2


def _spread_over_runs(u: Array, values: Array) -> Array:
    return np.broadcast_to(values, u.shape[:-1])[None]


def _amplitude(u: Array) -> Array:
    return np.sqrt(np.sum(np.abs(u) ** 2, axis=-1))


def _angle(u: Array) -> Array:
    return ellipse.find_wave(u, 1)[2]


def _pair(phase: Array) -> Array:
    return np.stack([np.cos(phase), np.sin(phase)])


def _span(series: MeasuredRuns) -> float:
    return float(series.time_s[series.weight > 0].max())


def make_step(series: MeasuredRuns, share: float) -> Covariate:
    """0 before and 1 after an instant, the same in every run; within a row its share of it.

    Parameters
    ----------
    series
        Of the runs.
    share
        Instant over the longest run.

    Returns
    -------
    Covariate
        One part, and the instant free to be refined.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.open_terms import make_step
    >>> fit = draw_fit()
    >>> step = make_step(fit.series, 0.5)
    >>> step.formula, step.function(fit.prediction.motion, fit.series)[0, 0, ::16].tolist()
    ('step at t = 0.49488 s', [0.0, 0.0, 1.0, 1.0])
    """
    instant = share * _span(series)
    width = max(float(np.median(series.step_s[series.step_s > 0])), 1e-12)
    return Covariate(
        "time",
        f"step at t = {instant:.5g} s",
        lambda u, s: _spread_over_runs(u, np.clip((s.time_s - instant) / width + 0.5, 0, 1)),
        shape=OpenShape(make_step, share, 1 / (STEPS + 1)),
    )


def make_decay(series: MeasuredRuns, log_share: float) -> Covariate:
    """e^{−t/τ}, τ = e^log_share of the longest run: what settles after every run's start.

    Parameters
    ----------
    series
        Of the runs.
    log_share
        ln(τ/T), T the longest run.

    Returns
    -------
    Covariate
        One part, and ln(τ/T) free to be refined.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.open_terms import make_decay
    >>> make_decay(draw_fit().series, -np.log(2)).formula
    'e^(−t/0.4949 s)'
    """
    tau = float(np.exp(log_share)) * _span(series)
    return Covariate(
        "time",
        f"e^(−t/{tau:.4g} s)",
        lambda u, s: _spread_over_runs(u, np.exp(-s.time_s / tau)),
        shape=OpenShape(make_decay, log_share, float(np.log(2))),
    )


def make_tone(series: MeasuredRuns, cycles: float) -> Covariate:
    """Cosine and sine of so many cycles over the longest run.

    Parameters
    ----------
    series
        Of the runs.
    cycles
        Over the longest run.

    Returns
    -------
    Covariate
        Two parts, cosine and sine.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.open_terms import make_tone
    >>> tone = make_tone(draw_fit().series, 3.0)
    >>> tone.formula, tone.parts
    ('tone of 3.0311 Hz', 2)
    """
    span = _span(series)
    omega = 2 * np.pi * cycles / span
    return Covariate(
        "time",
        f"tone of {cycles / span:.5g} Hz",
        lambda u, s: _pair(np.broadcast_to(omega * s.time_s, u.shape[:-1])),
        2,
        shape=OpenShape(make_tone, cycles, 0.5),
    )


def make_open_effect(place: Place, covariate: Covariate, name: str) -> Effect:
    """An open term as an effect of its own, so that the model can be fitted with it.

    Parameters
    ----------
    place
        Where it acts.
    covariate
        What it follows.
    name
        Of the effect.

    Returns
    -------
    Effect
        Of the family "open", with a coefficient c0, c1, … of each part.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.open_terms import PLACES, make_open_effect, make_tone
    >>> damping = PLACES[0]
    >>> effect = make_open_effect(damping, make_tone(draw_fit().series, 3.0), "open_1")
    >>> [(one.name, one.units) for one in effect.parameters]
    [('c0', 's-1'), ('c1', 's-1')]
    """
    count = covariate.parts * len(place.columns(np.ones((1, 2), complex)))
    names = [f"c{k}" for k in range(count)]

    def change(p: Any, u: Array, state: Any) -> Array:
        columns = place.columns(state.drive if place.of_drive else u)
        parts = [g[..., None] * m for g in covariate.function(u, state) for m in columns]
        return sum(p[c] * part for c, part in zip(names, parts, strict=True))

    parameters = tuple(Parameter(c, place.units, 1e-3, "coefficient") for c in names)
    common: dict[str, Any] = {
        "name": name,
        "family": "open",
        "page": covariate.formula,
        "parameters": parameters,
    }
    if place.readout:
        return Effect(**common, slow_readout=lambda p, u, state: u + change(p, u, state))
    return Effect(**common, slow=change)
