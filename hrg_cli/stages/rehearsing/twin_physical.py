"""The twin of tables that were made of resonator files (`--model physical`): the resonators' own
coefficients move the wave, and the resonator files are identified anew in every rehearsal."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...effects.effect import Effect, Values
from ...errors import HrgError
from ...fourier import compute_node_weights
from ...physics.plant import SlowState
from ...physics.resonator import J
from ...records import Calibration, Resonator
from ..calibration.resonators import NAMES

Array = np.ndarray
PHYSICAL = "identified_resonators"
"""Name of the twin's own effect: the coefficients of the calibration's resonator files."""


@dataclass(frozen=True)
class Identified:
    """One resonator file of a calibration: what it says, what it was made of, how."""

    resonator: Resonator
    inputs: Sequence[Any]
    settings: Mapping[str, Any]


def is_physical(truth: object) -> bool:
    """Whether a result's drift is that of resonator files.

    Parameters
    ----------
    truth
        A result of any kind.

    Returns
    -------
    bool
        True for a calibration of `--model physical`.

    Examples
    --------
    >>> from hrg_cli.stages.rehearsing.twin_physical import is_physical
    >>> is_physical("no calibration")
    False
    """
    return isinstance(truth, Calibration) and truth.model == "physical"


def _read_coefficients(truth: Calibration) -> tuple[Array, Array]:
    """Places (J,) and the coefficients of `resonators.NAMES` there (J, 5). HrgError: the file does
    not keep them."""
    rows = json.loads(truth.details).get("resonator")
    if not rows:
        raise HrgError("keeps no coefficients of its resonator files; make it again")
    key = "temperature_degc" if truth.axis == "temperature" else "frequency_hz"
    places = np.array([np.nan if row[key] is None else float(row[key]) for row in rows])
    return places, np.array([[float(row[name]) for name in NAMES] for row in rows])


def make_effect(truth: Calibration, frequency: tuple[Array, Array] | None = None) -> Effect:
    """What the resonators' splits and K add to a device that has none.

    u' = … + (−Δν·R + jδω·R + KΩJ)u, all of them followed over temperature or the run's frequency.
    K_DC = −νδμ sin 2mθ_μ, K_DS = νδμ cos 2mθ_μ; the measured quadrature's are −2δω(cos, sin)2mθ_ω.

    Parameters
    ----------
    truth
        The calibration, which keeps the coefficients of its resonator files.
    frequency
        Times (k,) [s] and frequencies (k,) [Hz] of the run, where the tables are over frequency;
        the device's frequency then follows them.

    Returns
    -------
    Effect
        Of the bench, without parameters.

    Raises
    ------
    HrgError
        The file does not keep the coefficients.

    Examples
    --------
    Nothing but K, 0.05 above the device's 0.5, at 1 rad/s:

    >>> import json
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.resonators import NAMES
    >>> from hrg_cli.stages.rehearsing.twin_physical import make_effect
    >>> row = dict.fromkeys(NAMES, 0.0) | {NAMES[2]: 0.55, "temperature_degc": 20.0}
    >>> details = json.dumps({"resonator": [row]})
    >>> truth = Told(details=details, axis="temperature", interpolation="linear")
    >>> state = Told(temperature_degc=20.0, rate_rad_s=np.array(1.0))
    >>> state.mechanics = Told(scale_factor=0.5)
    >>> u = np.array([1.0 + 0j, 0.0])
    >>> make_effect(truth).slow({}, u, state).real.round(9).tolist()
    [0.0, -0.05]
    """
    places, values = _read_coefficients(truth)
    kind = "linear" if truth.interpolation in ("linear", "monotone") else "cubic"

    def slow(_: Values, u: Array, state: SlowState) -> Array:
        x = state.temperature_degc if frequency is None else np.interp(state.time_s, *frequency)
        at = np.broadcast_to(np.asarray(x, float), u.shape[:-1])
        k = (compute_node_weights(at.ravel(), places, kind) @ values).reshape(*at.shape, len(NAMES))
        damping_cos, damping_sin = k[..., 1], -k[..., 0]
        split_cos, split_sin = -k[..., 3] / 2, -k[..., 4] / 2
        along, across = -damping_cos + 1j * split_cos, -damping_sin + 1j * split_sin
        c, s = u[..., 0], u[..., 1]
        change = np.stack([along * c + across * s, across * c - along * s], axis=-1)
        change = change + ((k[..., 2] - state.mechanics.scale_factor) * state.rate_rad_s)[
            ..., None
        ] * (u @ J.T)
        if frequency is not None:
            change = change + (2j * np.pi * (at - state.mechanics.frequency_hz))[..., None] * u
        return np.asarray(change)

    return Effect(
        PHYSICAL,
        "bench",
        "Splits and scale factor as a calibration's resonator files have them.",
        (),
        slow=slow,
    )
