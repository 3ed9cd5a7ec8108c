"""The pick-off chain of a simulated gyro: displacement -> steps of the effects -> electrodes ->
carrier -> noise -> converter.

Electrodes: `electrodes.pick_off`. Carrier: y·(−2 sin(ω_c t + ψ)), so that the coefficients at
ω_c ∓ ω are exactly those of PHYSICS §3 (1) with A the displacement's amplitude.
"""

from __future__ import annotations

import numpy as np

from .electrodes import pick_off
from .plant import Readout, Samples

Array = np.ndarray


def measure(readout: Readout, samples: Samples, random: np.random.Generator) -> Array:
    """What the converter sees of a block, in displacement units.

    Parameters
    ----------
    readout
        The pick-off chain.
    samples
        A block of the engine's samples.
    random
        Draws of the noise, unless the engine drew it (its loops saw the same).

    Returns
    -------
    ndarray
        (2, n), fewer where a step loses samples.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.plant import Readout, Samples
    >>> from hrg_cli.physics.readout import measure
    >>> t, z = np.array([0.0, 0.25]), np.array([[1.0, 1.0], [0.0, 0.0]])
    >>> samples = Samples(t, z, 0 * z, 0j * z, 20 + 0 * t, 0 * t)
    >>> carried = Readout(kind="carrier", carrier_hz=1.0)
    >>> measure(carried, samples, np.random.default_rng(0))[0].round(9).tolist()
    [-0.0, -2.0]
    """
    y = samples.z
    for step in readout.steps:
        y = step(samples, y)
    if readout.model == "full":
        moved = y
        if readout.law == "constant-voltage":
            assert samples.velocity is not None, "an engine's samples know their velocity"
            moved = samples.velocity()
        y = pick_off(readout.law, readout.gap, readout.gaps, readout.gains, y, moved)
    if readout.kind == "carrier":
        turns = np.mod(
            readout.carrier_hz / (1 + readout.clock_error) * samples.time_s, 1.0
        )  # carrier and converter share a clock
        y = y * (-2 * np.sin(2 * np.pi * turns + readout.carrier_phase_rad))
    if samples.noise is not None:
        y = y + samples.noise
    elif readout.noise > 0:
        y = y + readout.noise * random.standard_normal((y.shape[1], 2)).T
    for step in readout.after:
        y = step(samples, y)
    return y


def convert(readout: Readout, y: Array) -> Array:
    """Raw numbers of a converter that clips at ± full scale.

    Parameters
    ----------
    readout
        The pick-off chain, of which `adc_bits` and `full_scale` count.
    y
        In displacement units, (2, n).

    Returns
    -------
    ndarray
        Counts (2, n), int16 up to 16 bits and int32 above; the values themselves with 0 bits.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.plant import Readout
    >>> from hrg_cli.physics.readout import convert
    >>> convert(Readout(adc_bits=8), np.array([0.5, 3.0, -3.0])).tolist()
    [64, 127, -128]
    """
    if readout.adc_bits == 0:
        return y
    top = 2 ** (readout.adc_bits - 1)
    # Two's complement has one more count below zero than above.
    counts = np.clip(np.rint(y / compute_least_count(readout)), -top, top - 1)
    return counts.astype(np.int16 if readout.adc_bits <= 16 else np.int32)


def compute_least_count(readout: Readout) -> float:
    """Unit of a raw count: 2·full_scale/2^bits.

    Parameters
    ----------
    readout
        The pick-off chain.

    Returns
    -------
    float
        In displacement units; 1 without a converter.

    Examples
    --------
    >>> from hrg_cli.physics.plant import Readout
    >>> from hrg_cli.physics.readout import compute_least_count
    >>> compute_least_count(Readout(adc_bits=8)), compute_least_count(Readout())
    (0.0078125, 1.0)
    """
    return 2 * readout.full_scale / 2**readout.adc_bits if readout.adc_bits else 1.0


def find_kept_samples(
    readout: Readout, first: int, count: int, sample_rate_hz: float
) -> Array | None:
    """Which samples are not lost (`Readout.dropped`).

    Parameters
    ----------
    readout
        The pick-off chain.
    first, count
        The samples first … first + count − 1 since t = 0.
    sample_rate_hz
        Their rate.

    Returns
    -------
    ndarray or None
        (count,) bool; None: all are kept.

    Examples
    --------
    >>> from hrg_cli.physics.plant import Readout
    >>> from hrg_cli.physics.readout import find_kept_samples
    >>> find_kept_samples(Readout(dropped=[(0.2, 0.1)]), 0, 5, 10.0).tolist()
    [True, True, False, True, True]
    """
    if not readout.dropped:
        return None
    number = np.arange(first, first + count)
    keep = np.ones(count, bool)
    for time_s, lost_s in readout.dropped:
        begin = round(time_s * sample_rate_hz)
        keep &= ~((number >= begin) & (number < begin + round(lost_s * sample_rate_hz)))
    return keep
