"""Natural sizes of an effect's parameters in a run's own units: the same run in milliseconds or in
pixels gets the same steps.

The catalogue states typical sizes for a shell of 5 kHz at unit amplitude. A parameter in s⁻ᵏ scales
with the oscillation's frequency to the k-th power, one in amplitudeᵏ with the data's amplitude;
what is dimensionless, or in kelvin, stays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...effects.effect import Effect, Parameter, no_term, same_signal, same_state
from ...physics.plant import SlowState
from .measured_runs import MeasuredRuns

Array = np.ndarray
CATALOGUE_HZ = 5000.0
"""Oscillation frequency for which the catalogue states its typical sizes."""
SMALL_PART = 1e-2
"""Difference step as a part of the typical size."""


def count_seconds(units: str) -> int:
    """Power of the second in a unit.

    Parameters
    ----------
    units
        Such as "rad s-1", "s-2", "s K-1" or "Hz".

    Returns
    -------
    int
        0 where there is none.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.scales import count_seconds
    >>> [count_seconds(units) for units in ("rad s-1", "s-2", "s K-1", "Hz", "1")]
    [-1, -2, 1, -1, 0]
    """
    power = 0
    for factor in units.split():
        if factor == "Hz":
            power -= 1
        elif factor == "s" or (factor[1:].lstrip("-").isdigit() and factor[0] == "s"):
            power += int(factor[1:] or 1)
    return power


def find_typical_size(parameter: Parameter, amplitude: float, frequency_hz: float) -> float:
    """Typical size of a parameter for data of this amplitude and frequency.

    The catalogue states it for a shell of 5 kHz at unit amplitude. A parameter in s⁻ᵏ scales with
    the oscillation's frequency to the k-th power, one in amplitudeᵏ with the data's amplitude.

    Parameters
    ----------
    parameter
        Of an effect.
    amplitude
        Of the data, in their unit.
    frequency_hz
        Of the oscillation.

    Returns
    -------
    float
        In the parameter's unit.

    Examples
    --------
    A rate in s⁻¹ is ten times smaller for a resonator that is ten times slower:

    >>> from hrg_cli.fitting.causes.scales import find_typical_size
    >>> from types import SimpleNamespace
    >>> rate = SimpleNamespace(units="s-1", typical=1e-3, amplitude_power=0)
    >>> round(find_typical_size(rate, 1.0, 500.0), 9)
    0.0001
    """
    in_time = (frequency_hz / CATALOGUE_HZ) ** -count_seconds(parameter.units)
    return parameter.typical * amplitude**parameter.amplitude_power * in_time


def measure_amplitude(series: MeasuredRuns) -> float:
    """Root mean square amplitude of the data.

    Parameters
    ----------
    series
        The runs; rows without weight do not count.

    Returns
    -------
    float
        In the data's unit.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.scales import measure_amplitude
    >>> u = np.array([[[3.0, 4.0], [30.0, 40.0]]])
    >>> measure_amplitude(SimpleNamespace(envelope=u, weight=np.array([[1.0, 0.0]])))
    5.0
    """
    power = np.sum(np.abs(series.envelope) ** 2, axis=-1)
    return float(np.sqrt(power[series.weight > 0].mean()))


def list_steps(effect: Effect, series: MeasuredRuns) -> dict[str, float]:
    """Difference steps of an effect's fitted parameters for these data.

    Parameters
    ----------
    effect
        Of the catalogue.
    series
        The runs, with their reference frequency.

    Returns
    -------
    dict
        Parameter -> step: `SMALL_PART` of its typical size.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.scales import list_steps
    >>> rate = SimpleNamespace(name="rate", units="s-1", typical=1e-3, amplitude_power=0)
    >>> data = SimpleNamespace(
    ...     envelope=np.ones((1, 1, 2)), weight=np.ones((1, 1)), reference_frequency_hz=5000.0
    ... )
    >>> {
    ...     n: round(s, 9)
    ...     for n, s in list_steps(SimpleNamespace(fitted=lambda: [rate]), data).items()
    ... }
    {'rate': 1e-05}
    """
    amplitude = measure_amplitude(series)
    return {
        p.name: SMALL_PART * find_typical_size(p, amplitude, series.reference_frequency_hz)
        for p in effect.fitted()
    }


def measure_strength(
    effect: Effect, values: Mapping[str, float], u: Array, state: SlowState
) -> tuple[float, float]:
    """How strongly an effect acts on the motion, and on what is seen of it.

    Pure numbers, so that "small beside the oscillation" means the same in every unit. What an
    effect does to the environment counts by the turn it makes of the motion (rate) and by the part
    of the logged range it moves the temperature.

    Parameters
    ----------
    effect
        Of the catalogue.
    values
        Its parameters.
    u
        (..., 2): envelopes along the runs.
    state
        The environment there.

    Returns
    -------
    tuple of float
        |du/dt| that it adds over ω|u|, and |change of what is seen| over |u|, root mean squares.

    Examples
    --------
    A read-out one per cent too strong does nothing to the motion:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.effects.effect import no_term, same_state
    >>> from hrg_cli.fitting.causes.scales import measure_strength
    >>> too_strong = SimpleNamespace(
    ...     slow=no_term,
    ...     slow_readout=lambda values, u, state: (1 + values["part"]) * u,
    ...     slow_environment=same_state,
    ... )
    >>> motion, seen = measure_strength(too_strong, {"part": 0.01}, np.ones((5, 2), complex), None)
    >>> motion, round(seen, 9)
    (0.0, 0.01)
    """
    size = float(np.sqrt(np.mean(np.abs(u) ** 2)))
    if not size > 0:
        return 0.0, 0.0
    motion = seen = 0.0
    if effect.slow is not no_term:
        motion = (
            float(np.sqrt(np.mean(np.abs(effect.slow(values, u, state)) ** 2)))
            / size
            / state.omega_r_rad_s
        )
    if effect.slow_readout is not same_signal:
        seen = (
            float(np.sqrt(np.mean(np.abs(effect.slow_readout(values, u, state) - u) ** 2))) / size
        )
    if effect.slow_environment is not same_state:
        moved = effect.slow_environment(values, state)
        # another rate moves the envelopes by KΔΩ, which compares with a slow term's change over ω
        turn = np.sqrt(np.mean((moved.rate_rad_s - state.rate_rad_s) ** 2)) * abs(
            state.mechanics.scale_factor
        )
        motion = max(motion, float(turn) / state.omega_r_rad_s)
        span = float(np.ptp(state.temperature_degc))
        change = float(np.sqrt(np.mean((moved.temperature_degc - state.temperature_degc) ** 2)))
        seen = max(seen, change / span if span > 0 else 0.0)
    return motion, seen
