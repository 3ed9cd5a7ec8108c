"""The colour of a measured programme's noise, and the same noise in the samples of its twin.

What a resonator's runs leave, or a calibration's increments, is white noise as the windows state it
beside a wander of the wave (`fitting.noise.colour`): of its amplitude, phase, angle and
ellipticity. A twin with white noise alone would say of errors that hold it what it does not know.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...effects.effect import Effect, Values
from ...errors import HrgError
from ...fitting.causes.wave_frame import to_reals
from ...fitting.envelopes import condensed, free_windows
from ...fitting.envelopes.base_fit import fit_base_model
from ...fitting.envelopes.base_freedom import Known
from ...fitting.noise import channel_noise, colour
from ...fitting.noise.colour import ColouredNoise
from ...physics.plant import Readout, Samples
from ...records import Calibration, Diagnosis, Wave

Array = np.ndarray
NAME = "measured_colour"
"""Name of the twin's own effect: noise as coloured as the measured runs'."""
STEPS = 4
"""Steps of a wander's course within its correlation time."""
MOST_STEPS = 1_000_000
"""Steps of a wander's course at most."""
HOUR = 3600.0
WHITE = ColouredNoise(1.0, 0.0, 0.0, 0.0)
"""A component that is white as the windows state it."""
Colour = tuple[ColouredNoise, ...]
"""The noise of the four components, in the order of `colour.COMPONENTS`; empty: white as stated."""


def estimate_of_free_runs(
    waves: Sequence[Wave], settings: Mapping[str, Any], earth_rad_s: float
) -> Colour:
    """The wander that a resonator fitted to these runs leaves.

    A level above the windows' own is not taken for noise where nothing wanders: it may as well be
    the fit's fault, which a rehearsal is to find.

    Parameters
    ----------
    waves
        Of free runs, or of ones with free windows.
    settings
        Of the identification.
    earth_rad_s
        Rate about the axis that the logs leave out [rad/s].

    Returns
    -------
    tuple of ColouredNoise
        Of the four components; empty where all are white, or the runs show modes only.

    Examples
    --------
    White noise does not wander:

    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_colour import estimate_of_free_runs
    >>> estimate_of_free_runs([draw_input(rate_rad_s=6.0).wave], {}, 0.0)
    ()
    """
    known = Known(
        settings.get("scale_factor"),
        settings.get("damping_axis_rad"),
        settings.get("stiffness_axis_rad"),
    )
    blocks = int(settings.get("blocks", 300))
    try:
        if settings.get("window", "auto") == "auto":
            waves = [part for wave in waves for part in free_windows.cut_free_windows(wave)]
        runs = condensed.read_runs(waves, settings.get("rate_rad_s"), earth_rad_s, known, blocks)
        fit = fit_base_model(runs, known, blocks)
    except HrgError:
        return ()
    data, response = fit.response.batch, fit.response
    # in the wave's own phase, e^{2jφ} ∝ u·u: only there does the angle stand across the wave
    back = np.exp(-0.5j * np.angle(np.sum(data.envelope**2, axis=-1, keepdims=True)))
    residual = to_reals(response.compute_residual() * back)
    seen = channel_noise.whiten(data.whitening, data.envelope) * back
    found = colour.estimate_noises(data.time_s, data.weight, seen, residual)
    return tuple(n if n.wander_1_s > 0 else WHITE for n in found)


def read_calibration_noise(truth: Calibration) -> dict[str, Colour]:
    """The noise that a calibration found in its runs: white angles over what the windows state, a
    walk.

    Parameters
    ----------
    truth
        With its `noise` and `runs` in the details.

    Returns
    -------
    dict
        Run -> the noise of the four components, that of the angle alone coloured; without runs that
        are as quiet as they state.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_colour import read_calibration_noise
    >>> rows = '[{"run_id": "a", "walk_rad2_s": 1e-9}, {"run_id": "b", "walk_rad2_s": 0}]'
    >>> found = read_calibration_noise(Told(details=f'{{"runs": {rows}}}'))
    >>> list(found), [noise.wander_1_s for noise in found["a"]]
    (['a'], [0.0, 0.0, 1e-09, 0.0])
    """
    details = json.loads(truth.details)
    white = float((details.get("noise") or {}).get("white_over_stated") or 1.0)
    out: dict[str, Colour] = {}
    for run in details.get("runs", []):
        walk = float(run["walk_rad2_s"])
        if walk > 0 or white > 1:
            out[str(run["run_id"])] = (WHITE, WHITE, ColouredNoise(white, walk, 0.0, 0.0), WHITE)
    return out


def read_diagnosis_wander(truth: Diagnosis) -> Colour:
    """The wander that a diagnosis reports of its final residual.

    Parameters
    ----------
    truth
        With its `wander` in the report.

    Returns
    -------
    tuple of ColouredNoise
        Of the four components; empty where it reports none.

    Examples
    --------
    A walk of the angle that comes to 0.06 after an hour is one of 10⁻⁶ 1/s:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_colour import read_diagnosis_wander
    >>> row = dict(component="angle", after_one_hour=0.06, correlation_s=0.0)
    >>> row["white_over_stated"] = 1.0
    >>> found = read_diagnosis_wander(Told(read_report=lambda: {"wander": [row]}))
    >>> [round(noise.wander_1_s, 9) for noise in found]
    [0.0, 0.0, 1e-06, 0.0]
    """
    rows = {row["component"]: row for row in truth.read_report().get("wander") or []}
    if not rows:
        return ()
    return tuple(
        ColouredNoise(row["white_over_stated"], _density(row), row["correlation_s"], 0.0)
        if (row := rows.get(name)) is not None
        else WHITE
        for name in colour.COMPONENTS
    )


def _density(row: Mapping[str, Any]) -> float:
    """q of a wander whose standard deviation after an hour is told."""
    one = ColouredNoise(1.0, 1.0, row["correlation_s"], 0.0).compute_std_after(HOUR)
    return float((row["after_one_hour"] / one) ** 2)


def make_effect(
    noises: Colour, std: float, window_s: float, duration_s: float, seed: Sequence[int]
) -> Effect:
    """The effect that puts coloured noise into a run's samples.

    y + Re[(α + jφ) w + (β + jε) J w* e^{2jψ}], w = e^{jψ}(a_A e_A − j a_B e_B) the analytic signal
    (J w* e^{2jψ} = J w of a line). α, φ, β, ε: the wanders of relative amplitude, phase, angle mθ
    and ellipticity; to them, held over each window, what the scatter has above the windows' stated
    σ.

    Parameters
    ----------
    noises
        Of the four components.
    std
        σ of one real of the windows, in the amplitude's unit.
    window_s
        Length of a window [s].
    duration_s
        Of the run [s].
    seed
        Of the noise.

    Returns
    -------
    Effect
        Of the read-out, without parameters.

    Examples
    --------
    >>> from hrg_cli.stages.rehearsing.twin_colour import WHITE, make_effect
    >>> effect = make_effect((WHITE,) * 4, 1e-4, 0.02, 1.0, (1, 0))
    >>> effect.name, effect.family
    ('measured_colour', 'read-out')
    """
    random = np.random.default_rng(list(seed))
    wanders = [draw_course(noise, window_s, duration_s, random) for noise in noises]
    windows = int(np.ceil(duration_s / window_s)) + 1
    excess = np.sqrt(np.maximum(np.array([n.white for n in noises]) ** 2 - 1, 0.0)) * std
    held = excess[:, None] * random.standard_normal((len(noises), windows))

    def readout(_: Values, readout: Readout) -> None:
        def step(block: Samples, y: Array) -> Array:
            w = block.z - 1j * block.v_over_omega
            size = np.sqrt(np.sum(np.abs(w) ** 2, axis=0))
            window = np.clip((block.time_s / window_s).astype(int), 0, windows - 1)
            along, phase, across, ellipse = (
                np.interp(block.time_s, *wander) + np.where(size > 0, h[window], 0.0) / size
                for wander, h in zip(wanders, held, strict=True)
            )
            square = np.sum(w**2, axis=0)
            twice = square / np.maximum(np.abs(square), 1e-300)
            across_it = np.stack([-w[1].conj(), w[0].conj()]) * twice
            moved = (along + 1j * phase) * w + (across + 1j * ellipse) * across_it
            return np.asarray(y + moved.real)

        readout.steps.append(step)

    return Effect(NAME, "read-out", "Noise as coloured as a measured run's.", (), readout=readout)


def draw_course(
    noise: ColouredNoise, step_s: float, duration_s: float, random: np.random.Generator
) -> tuple[Array, Array]:
    """A wander's course from 0: an Ornstein–Uhlenbeck rate, integrated, or a random walk.

    The rate has ⟨v v'⟩ = (q/2τ) e^{−|t−t'|/τ}; where τ is shorter than a step it is a walk of q.

    Parameters
    ----------
    noise
        With q [1/s] and τ [s].
    step_s
        Steps at most so long [s], unless there would be more than `MOST_STEPS`.
    duration_s
        Length of the course [s].
    random
        What is drawn from.

    Returns
    -------
    tuple of ndarray
        Times (n,) [s] and values (n,).

    Examples
    --------
    A walk of q = 0.01 1/s over 100 s has the standard deviation 1 at its end:

    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.colour import ColouredNoise
    >>> from hrg_cli.stages.rehearsing.twin_colour import draw_course
    >>> walk, random = ColouredNoise(1.0, 0.01, 0.0, 0.0), np.random.default_rng(1)
    >>> ends = [np.interp(100.0, *draw_course(walk, 1.0, 100.0, random)) for _ in range(1000)]
    >>> bool(abs(np.std(ends) - 1) < 0.1)
    True
    """
    q, tau = noise.wander_1_s, noise.correlation_s
    if q <= 0:
        return np.array([0.0, duration_s]), np.zeros(2)
    h = max(min(step_s, tau / STEPS) if tau > step_s / STEPS else step_s, duration_s / MOST_STEPS)
    count = int(np.ceil(duration_s / h)) + 2
    times, kicks = h * np.arange(count), random.standard_normal(count)
    if tau <= h:
        return times, np.concatenate([[0.0], np.cumsum(np.sqrt(q * h) * kicks[1:])])
    from scipy.signal import lfilter

    kept = np.exp(-h / tau)
    kicks[1:] *= np.sqrt(1 - kept**2)
    rate = np.sqrt(q / (2 * tau)) * lfilter([1.0], [1.0, -kept], kicks)
    return times, np.concatenate([[0.0], np.cumsum(h * (rate[1:] + rate[:-1]) / 2)])


def describe_colour(noises: Sequence[Colour]) -> list[dict[str, Any]]:
    """The coloured components for the JSON, the strongest of the runs.

    Parameters
    ----------
    noises
        Of every run, the four components or none.

    Returns
    -------
    list of dict
        Component, wander [1/s], correlation time [s], white level over the stated σ; only
        components that wander in some run.

    Examples
    --------
    >>> from hrg_cli.fitting.noise.colour import ColouredNoise
    >>> from hrg_cli.stages.rehearsing.twin_colour import WHITE, describe_colour
    >>> walks = (WHITE, WHITE, ColouredNoise(1.0, 1e-9, 0.0, 0.0), WHITE)
    >>> [(row["component"], row["wander_1_s"]) for row in describe_colour([walks, ()])]
    [('angle', 1e-09)]
    """
    out = []
    for k, name in enumerate(colour.COMPONENTS):
        own = [n[k] for n in noises if n]
        if own and max(n.wander_1_s for n in own) > 0:
            worst = max(own, key=lambda n: n.wander_1_s)
            out.append(
                {
                    "component": name,
                    "wander_1_s": worst.wander_1_s,
                    "correlation_s": worst.correlation_s,
                    "white_over_stated": worst.white,
                }
            )
    return out
