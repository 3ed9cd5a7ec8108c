"""The device of a twin: a result's own values, and for what the result leaves out the values that
the fit held it at, or that the runs tell.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting.envelopes.base_freedom import choose_scale_factor
from ...physics.resonator import Mechanics
from ...records import Calibration, Resonator
from ..earth_rate import read_earth_rate
from ..rate_table import is_rate_table
from . import twin_mode
from .twin_physical import Identified, is_physical
from .twin_run import Measured

NEEDED = (
    "frequency_hz",
    "damping_split_1_s",
    "damping_axis_rad",
    "frequency_split_rad_s",
    "stiffness_axis_rad",
)
"""Parameters without which a resonator file describes no device."""


def build_resonator(
    truth: Resonator, settings: Mapping[str, Any], inputs: Sequence[Measured]
) -> Mechanics:
    """The device of a resonator file.

    What was held, or is not told by such runs, has the value that the fit held it at.

    Parameters
    ----------
    truth
        The file.
    settings
        Of its identification.
    inputs
        Its runs, whose decay stands for a ν that the file does not hold; else none are needed.

    Returns
    -------
    Mechanics
        The twin's resonator.

    Raises
    ------
    HrgError
        The file holds no whole resonator.

    Examples
    --------
    K was held at its nominal value:

    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.physics.resonator import PARAMETERS
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_device import build_resonator
    >>> names, units = map(np.array, zip(*PARAMETERS[:-1]))
    >>> value, std = np.array([5e3, 2e-3, 1e-4, 0.0, 0.02, 0.1]), np.full(6, 1e-6)
    >>> told = dict(name=names, units=units, covariance=np.diag(std**2), details="{}")
    >>> resonator = Resonator(value=value, std=std, **told)
    >>> build_resonator(resonator, {}, [draw_input()]).scale_factor
    0.55
    """
    if twin_mode.is_modes(truth):
        return twin_mode.make_device(truth)
    values = {name: value for name, (value, _, _) in truth.parameters().items()}
    for name in ("scale_factor", "damping_axis_rad", "stiffness_axis_rad"):
        if settings.get(name) is not None:
            values.setdefault(name, float(settings[name]))
    lacking = [name for name in NEEDED if name not in values]
    if lacking:
        raise HrgError(
            f"holds no {lacking[0]}: these are modes, not a whole resonator; a twin cannot be made"
            " of them"
        )
    values.setdefault("scale_factor", choose_scale_factor(truth.mode_number))
    if "damping_rate_1_s" not in values:
        values["damping_rate_1_s"] = max(_find_decay(inputs), abs(values["damping_split_1_s"]))
    return Mechanics(**values, mode_number=truth.mode_number)


def build_carrier_of_tables(
    truth: Calibration, inputs: Sequence[Measured], identified: Sequence[Identified]
) -> Mechanics:
    """A device without splits: drift and scale factor are the tables' or the resonator files'.

    The twin's own effect gives them to it.

    Parameters
    ----------
    truth
        The tables.
    inputs
        Their runs, of which frequency and decay are taken.
    identified
        The resonator files that tables of `--model physical` were made of.

    Returns
    -------
    Mechanics
        K is the tables' mean.

    Raises
    ------
    HrgError
        A foreign table, or resonator files that are not at hand.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_device import build_carrier_of_tables
    >>> tables = Told(
    ...     details="{}", mode_number=2, scale_factor_harmonics=np.array([[0.54], [0.56]])
    ... )
    >>> device = build_carrier_of_tables(tables, [draw_input()], [])
    >>> round(device.frequency_hz, 2), round(device.scale_factor, 9), device.damping_split_1_s
    (500.0, 0.55, 0.0)
    """
    if is_rate_table(truth):
        raise HrgError("was made of a foreign table of dwells; there are no runs to rehearse")
    if is_physical(truth) and not identified:
        raise HrgError(
            "has the coefficients of resonator files (model physical), which every rehearsal"
            " identifies again; name the resonator files it was made of beside it"
        )
    frequency = float(np.median([np.nanmedian(m.wave.frequency_hz) for m in inputs]))
    return Mechanics(
        frequency,
        _find_decay(inputs),
        0.0,
        0.0,
        0.0,
        0.0,
        float(np.mean(truth.scale_factor_harmonics[:, 0])),
        truth.mode_number,
    )


def _find_decay(inputs: Sequence[Measured]) -> float:
    """ν that the drive has to make up for, a_ΦA/a_A, 1/s; where no drive is logged one decay in the
    longest run."""
    found = []
    for wave in (m.wave for m in inputs):
        if wave.drive_main is not None:
            ratio = np.asarray(wave.drive_main, float) / np.asarray(wave.main_amplitude, float)
            found.append(float(np.median(ratio[wave.good() & np.isfinite(ratio)])))
    if found and np.median(found) > 0:
        return float(np.median(found))
    return 1.0 / max(float(m.wave.time_s[-1] - m.wave.time_s[0]) for m in inputs)


def find_hidden_rate(truth: Resonator, settings: Mapping[str, Any]) -> float:
    """Rate about the axis that the logs leave out: Earth's, and the unknown one that was fitted.

    Parameters
    ----------
    truth
        The resonator file.
    settings
        Of its identification.

    Returns
    -------
    float
        Rate [rad/s].

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_device import find_hidden_rate
    >>> find_hidden_rate(Told(details='{"rate_rad_s": {"value": 0.02}}'), {"fit_rate": True})
    0.02
    """
    return read_earth_rate(settings) + float(
        json.loads(truth.details).get("rate_rad_s", {}).get("value", 0.0)
        if settings.get("fit_rate")
        else 0.0
    )
