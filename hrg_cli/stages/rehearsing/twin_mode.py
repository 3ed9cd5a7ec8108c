"""The twin of a resonator of which one mode is seen: its decay and frequency follow its amplitude as
the file says, and a channel that carried nothing carries nothing."""

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
    """Whether a resonator file holds modes without axes."""
    return bool(json.loads(truth.details).get("modes"))


def make_device(truth: Resonator) -> Mechanics:
    """The device of a file of one mode: no splits. HrgError: it holds two modes."""
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
    """The terms that follow the amplitude, as the file keeps them."""
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
    """Whether the run's second channel held exactly nothing."""
    good = wave.good()
    angle, quadrature = (
        np.asarray(column, float)[good]
        for column in (wave.wave_angle_rad, wave.quadrature_amplitude)
    )
    return not np.any(np.sin(wave.mode_number * angle)) and not np.any(quadrature)


def make_effect(laws: Laws, silent: bool) -> Effect:
    """−(ln a)' = ν + f/a + ν₁ a + ν₂ a² and φ' = δ + κ a² + κ₄ a⁴ beside ν and δ
    (`fitting.envelopes.one_mode`); silent: the second channel is empty."""

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
