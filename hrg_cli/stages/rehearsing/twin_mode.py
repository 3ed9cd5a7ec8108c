"""The twin of a resonator of which one mode is seen: its decay and frequency follow its amplitude
as the file says, and a channel that carried nothing carries nothing."""

from __future__ import annotations

import json

import numpy as np

from ...effects.effect import Effect, Values
from ...errors import HrgError
from ...fitting.envelopes.base_freedom import choose_scale_factor
from ...fitting.envelopes.one_mode import DECAY_POWERS, FREQUENCY_POWERS
from ...physics.plant import Readout, Samples, SlowState
from ...physics.resonator import Mechanics
from ...records import Resonator, Wave

Array = np.ndarray
NAME = "one_mode"
"""Name of the twin's own effect: the laws of one mode."""
Laws = dict[str, tuple[tuple[int, float], ...]]
"""Of "decay" and "frequency", the powers of the amplitude and their coefficients, beside the
constant ones."""


def is_modes(truth: Resonator) -> bool:
    """Whether a resonator file holds modes without axes.

    Parameters
    ----------
    truth
        The resonator file.

    Returns
    -------
    bool
        False for a whole resonator.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_mode import is_modes
    >>> is_modes(Told(details='{"modes": [{"frequency_hz": 5e3}]}')), is_modes(Told(details="{}"))
    (True, False)
    """
    return bool(json.loads(truth.details).get("modes"))


def make_device(truth: Resonator) -> Mechanics:
    """The device of a file of one mode: no splits.

    Parameters
    ----------
    truth
        The resonator file.

    Returns
    -------
    Mechanics
        Its frequency is the undamped one, ω² = ω_seen² + ν².

    Raises
    ------
    HrgError
        The file holds two modes.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_mode import make_device
    >>> values = {"frequency_hz": (1.5, 0.0, "Hz"), "damping_rate_1_s": (12.566370614, 0.0, "s-1")}
    >>> mode = Told(details='{"modes": [{}]}', parameters=lambda: values, mode_number=2)
    >>> round(make_device(mode).frequency_hz, 6)
    2.5
    """
    if len(json.loads(truth.details)["modes"]) > 1:
        raise HrgError(
            "holds two modes without axes: how much of each stands in which channel is not in the"
            " file, so that a twin cannot be made of them"
        )
    values = {name: value for name, (value, _, _) in truth.parameters().items()}
    seen, damping = values["frequency_hz"], values["damping_rate_1_s"]
    return Mechanics(
        float(np.hypot(seen, damping / (2 * np.pi))),  # ω² = ω_seen² + ν²
        damping,
        0.0,
        0.0,
        0.0,
        0.0,
        choose_scale_factor(truth.mode_number),
        truth.mode_number,
    )


def read_laws(truth: Resonator) -> Laws:
    """The terms that follow the amplitude, as the file keeps them.

    Parameters
    ----------
    truth
        The resonator file.

    Returns
    -------
    dict
        Of "decay" and "frequency" the powers of the amplitude and their coefficients, without the
        constant ones; empty where nothing follows the amplitude.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_mode import read_laws
    >>> found = '{"frequency_per_amplitude2_rad_s": {"value": 0.02, "std": 0.001}}'
    >>> read_laws(Told(details=f'{{"amplitude_dependence": {found}}}'))
    {'decay': (), 'frequency': ((2, 0.02),)}
    """
    found = json.loads(truth.details).get("amplitude_dependence") or {}
    return {
        law: tuple(
            (power, float(found[key]["value"]))
            for name, power in powers.items()
            if power != 0 and (key := f"{law}_{name}") in found
        )
        for law, powers in (("decay", DECAY_POWERS), ("frequency", FREQUENCY_POWERS))
    }


def has_one_signal(wave: Wave) -> bool:
    """Whether the run's second channel held exactly nothing.

    Parameters
    ----------
    wave
        The measured run.

    Returns
    -------
    bool
        Of the windows without a flag: whether they all lie on C's axis, to the last bit.

    Examples
    --------
    Noise is something:

    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_mode import has_one_signal
    >>> has_one_signal(draw_input().wave)
    False
    """
    good = wave.good()
    angle, quadrature = (
        np.asarray(column, float)[good]
        for column in (wave.wave_angle_rad, wave.quadrature_amplitude)
    )
    return not np.any(np.sin(wave.mode_number * angle)) and not np.any(quadrature)


def make_effect(laws: Laws, silent: bool) -> Effect:
    """The effect by which decay and frequency of one mode follow its amplitude.

    −(ln a)' = ν + f/a + ν₁ a + ν₂ a² and φ' = δ + κ a² + κ₄ a⁴ beside ν and δ
    (`fitting.envelopes.one_mode`).

    Parameters
    ----------
    laws
        Powers of the amplitude and their coefficients.
    silent
        The second channel is empty.

    Returns
    -------
    Effect
        Of the resonator, without parameters.

    Examples
    --------
    κ = 0.02 rad/s per squared amplitude, at a = 2:

    >>> import numpy as np
    >>> from hrg_cli.stages.rehearsing.twin_mode import make_effect
    >>> effect = make_effect({"decay": (), "frequency": ((2, 0.02),)}, silent=False)
    >>> effect.slow({}, np.array([2.0 + 0j, 0.0]), None).round(9).tolist()
    [0.16j, 0j]
    """

    def slow(_: Values, u: Array, _state: SlowState) -> Array:
        a = np.sqrt(np.sum(np.abs(u) ** 2, axis=-1, keepdims=True))
        with np.errstate(divide="ignore"):
            loss, faster = (
                sum((c * a**power for power, c in laws[law]), np.zeros_like(a))
                for law in ("decay", "frequency")
            )
        return np.where(a > 0, (1j * faster - np.where(a > 0, loss, 0.0)) * u, 0.0)

    def readout(_: Values, readout: Readout) -> None:
        def step(_block: Samples, y: Array) -> Array:
            return np.stack([y[0], np.zeros_like(y[1])])

        if silent:
            readout.after.append(step)

    return Effect(
        NAME,
        "resonator",
        "One mode as a resonator file has it.",
        (),
        readout=readout,
        slow=slow,
    )
