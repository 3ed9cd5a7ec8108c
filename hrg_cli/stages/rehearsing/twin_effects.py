"""What a twin's runs have beside its device: the tables of a calibration, the laws of one mode, the
colour of the noise, each as an effect of the simulation.
"""

from __future__ import annotations

import numpy as np

from ...effects.effect import Effect, Values, find_frame
from ...fourier import build_harmonic_basis, make_interpolant
from ...physics.plant import SlowState
from ...physics.resonator import J
from ...records import Calibration, Resonator
from . import twin_colour, twin_mode, twin_physical
from .twin import Twin
from .twin_physical import is_physical

Array = np.ndarray
COLOUR = 2
"""Number of the random stream of a run's coloured noise."""
TABLES = "calibrated_tables"
"""Name of the twin's own effect: drift and scale factor as a calibration file has them."""


def make_effects(twin: Twin, number: int, seed: int) -> tuple[Effect, ...]:
    """The twin's own effects in one of its runs.

    The tables of a calibration, what one mode's decay and frequency do with its amplitude, the
    colour of the noise.

    Parameters
    ----------
    twin
        Whose run it is.
    number
        Of the run, from 0.
    seed
        Of the coloured noise.

    Returns
    -------
    tuple of Effect
        Empty where the device and white noise are all there is.

    Examples
    --------
    >>> from hrg_cli import identify
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin import make_twin
    >>> from hrg_cli.stages.rehearsing.twin_effects import make_effects
    >>> run = draw_input()  # a wave along one pair of electrodes: one mode is seen
    >>> twin = make_twin(identify([run.wave]), [run], {})
    >>> [effect.name for effect in make_effects(twin, 0, 1)]
    ['one_mode']
    """
    run, table = twin.runs[number], twin.config["run"][number]
    out: list[Effect] = []
    if isinstance(twin.truth, Calibration):
        factor = twin.config["device"]["scale_factor"]
        out.append(
            twin_physical.make_effect(twin.truth, run.frequency)
            if is_physical(twin.truth)
            else _make_tables_effect(twin.truth, factor, run.frequency)
        )
    elif isinstance(twin.truth, Resonator) and twin_mode.is_modes(twin.truth):
        out.append(twin_mode.make_effect(twin_mode.read_laws(twin.truth), run.silent))
    if run.colour:
        length = float(table["recording"]["duration_s"])
        out.append(
            twin_colour.make_effect(
                run.colour, run.std, run.window_s, length, (seed, number, COLOUR)
            )
        )
    return tuple(out)


def _make_tables_effect(
    truth: Calibration,
    device_scale_factor: float,
    frequency: tuple[Array, Array] | None = None,
) -> Effect:
    """The effect that turns the wave as the tables say, mθ' = −K(x,θ)Ω + D(x,θ): what the device's
    constant K leaves of it.

    x: the temperature or, with the course `frequency` of a run, the frequency, which then follows
    the course.
    """
    nodes, mode = np.asarray(truth.node, float), truth.mode_number
    tables = [
        np.asarray(table, float) for table in (truth.drift_harmonics, truth.scale_factor_harmonics)
    ]
    columns = max(table.shape[1] for table in tables)
    both = [np.pad(table, ((0, 0), (0, columns - table.shape[1]))) for table in tables]
    interpolate = make_interpolant(nodes, np.concatenate(both, axis=1), truth.interpolation)

    def slow(_: Values, u: Array, state: SlowState) -> Array:
        e_A = find_frame(u, state.phase_rad)[1]
        angle = np.arctan2(e_A[..., 1], e_A[..., 0]).ravel() / mode
        x = state.temperature_degc if frequency is None else np.interp(state.time_s, *frequency)
        at = np.broadcast_to(x, u.shape[:-1]).ravel()
        basis = build_harmonic_basis(angle, (columns - 1) // 2, mode)
        D, K = (basis[:, None, :] * interpolate(at).reshape(-1, 2, columns)).sum(axis=2).T
        rate = np.broadcast_to(state.rate_rad_s, u.shape[:-1]).ravel()
        turning = ((K - device_scale_factor) * rate - D).reshape(u.shape[:-1])
        change = turning[..., None] * (u @ J.T)
        if frequency is not None:
            faster = 2j * np.pi * (np.asarray(x) - state.mechanics.frequency_hz)
            change = change + faster[..., None] * u
        return np.asarray(change)

    return Effect(
        TABLES,
        "bench",
        "Drift and scale factor as a calibration file has them, mθ' = −K(T,θ)Ω + D(T,θ).",
        (),
        slow=slow,
    )
