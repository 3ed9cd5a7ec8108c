"""What is known before the next runs: the resonator, and what its file or diagnosis says of its
parameters as information."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...effects.effect import Effect
from ...errors import HrgError
from ...fitting.envelopes.base_freedom import choose_scale_factor
from ...fitting.envelopes.coordinates import COUNT, from_mechanics, to_parameters
from ...fitting.envelopes.resonator_spread import compute_slope_covariance
from ...fitting.envelopes.weak_priors import PLANNED
from ...fitting.least_squares import invert_information
from ...physics.resonator import PARAMETERS, Mechanics
from ...records import Diagnosis, Resonator, Wave
from ...settings import parse_toml
from .information import InformationColumns

Array = np.ndarray


def make_mechanics(known: Resonator | Diagnosis) -> Mechanics:
    """The resonator's parameters as a file or a diagnosis holds them.

    Parameters
    ----------
    known
        Identified or diagnosed.

    Returns
    -------
    Mechanics
        What was not identified is 0, the scale factor what is usual for its mode number.

    Raises
    ------
    HrgError
        Neither frequency nor damping among them.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.planning.known import make_mechanics
    >>> names = ("frequency_hz", "damping_rate_1_s")
    >>> resonator = Resonator(
    ...     name=np.array(names), units=np.array(["Hz", "s-1"]), value=np.array([5e3, 0.1]),
    ...     std=np.full(2, 1e-6), covariance=1e-12 * np.eye(2),
    ... )
    >>> found = make_mechanics(resonator)
    >>> found.frequency_hz, found.damping_rate_1_s, found.frequency_split_rad_s
    (5000.0, 0.1, 0.0)
    """
    if isinstance(known, Diagnosis):
        given = {row["name"]: float(row["value"]) for row in known.told("values")}
        mode_number = _mode_number(known.extended_model)
    else:
        given = {name: value for name, (value, _, _) in known.parameters().items()}
        mode_number = known.mode_number
    values = {name: given[name] for name, _ in PARAMETERS if name in given}
    if "frequency_hz" not in values or "damping_rate_1_s" not in values:
        raise HrgError("the resonator holds neither frequency nor damping; identify it first")
    values.setdefault("scale_factor", choose_scale_factor(mode_number))
    return Mechanics(**values, mode_number=mode_number)


def _mode_number(extended_model: str) -> int:
    """The angular mode number of a written model. HrgError: it holds none."""
    device = parse_toml(extended_model).get("device", {"mode_number": 2})
    found = device.get("mode_number", 2) if isinstance(device, dict) else None
    if not isinstance(found, int) or not 1 <= found <= 1000:
        raise HrgError("the extended model it keeps is damaged (mode_number); diagnose again")
    return found


def make_device_table(m: Mechanics) -> dict[str, Any]:
    """The resonator as the table [device] of a simulation file.

    Parameters
    ----------
    m
        Whose damping may be 0 or less within its error: no device has that.

    Returns
    -------
    dict
        The splits no larger than the damping.

    Examples
    --------
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.planning.known import make_device_table
    >>> m = Mechanics(frequency_hz=5e3, damping_rate_1_s=-1e-6, damping_split_1_s=1e-6)
    >>> table = make_device_table(m)
    >>> table["damping_rate_1_s"], table["damping_split_1_s"]
    (0.0, 0.0)
    """
    damping = max(m.damping_rate_1_s, 0.0)
    return {name: float(getattr(m, name)) for name, _ in PARAMETERS} | {
        "damping_rate_1_s": damping,
        "damping_split_1_s": float(np.clip(m.damping_split_1_s, -damping, damping)),
        "mode_number": m.mode_number,
    }


def find_reference_temperatures(
    waves: Sequence[Wave], effects: Sequence[Effect]
) -> dict[str, dict[str, float]]:
    """The temperature from which effects count: the mean of all runs.

    Parameters
    ----------
    waves
        The runs.
    effects
        That may act.

    Returns
    -------
    dict
        Effect -> its reference [°C], of those that have one; 25 °C where no run logs a temperature.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.stages.planning.known import find_reference_temperatures
    >>> waves = [
    ...     Told(temperature_degc=np.array([20.0, 30.0])),
    ...     Told(temperature_degc=np.array([41.0])),
    ... ]
    >>> found = find_reference_temperatures(waves, EFFECTS)
    >>> {one["reference_temperature_degc"] for one in found.values()}
    {33.0}
    """
    warm = [
        float(np.nanmean(w.temperature_degc))
        for w in waves
        if w.temperature_degc is not None and np.isfinite(w.temperature_degc).any()
    ]
    middle = float(np.mean(warm)) if warm else 25.0
    return {
        e.name: {"reference_temperature_degc": middle}
        for e in effects
        if "reference_temperature_degc" in e.values()
    }


def make_weak_prior(m: Mechanics, layout: InformationColumns) -> Array:
    """Weak information that keeps finite what nothing measures.

    Parameters
    ----------
    m
        Of whose sizes it is made, by the widths of `PLANNED`.
    layout
        Which columns there are.

    Returns
    -------
    ndarray
        (size, size), on the base model alone.

    Examples
    --------
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.planning.information import InformationColumns
    >>> from hrg_cli.stages.planning.known import make_weak_prior
    >>> m = Mechanics(frequency_hz=5e3, damping_rate_1_s=0.1)
    >>> prior = make_weak_prior(m, InformationColumns((), {}))
    >>> round(float(prior[0, 0] ** -0.5), 9), round(float(prior[5, 5] ** -0.5), 9)
    (1.0, 3.0)
    """
    damping = max(abs(m.damping_rate_1_s), 1e-9)
    split = max(abs(m.frequency_split_rad_s), damping)
    M = np.zeros((layout.size, layout.size))
    M[:COUNT, :COUNT] = np.diag(1 / PLANNED.scale_by(damping, split) ** 2)
    return M


def read_information(
    known: Resonator | Diagnosis, m: Mechanics, layout: InformationColumns
) -> Array:
    """The resonator's own covariance as information on the coordinates of the base model.

    Parameters
    ----------
    known
        A resonator; a diagnosis without its waves brings its standard deviations.
    m
        Its parameters.
    layout
        Which columns there are.

    Returns
    -------
    ndarray
        (size, size); 0 on what was not identified.

    Examples
    --------
    A damping known to 0.01 1/s:

    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.planning.information import InformationColumns
    >>> from hrg_cli.stages.planning.known import make_mechanics
    >>> from hrg_cli.stages.planning.known import read_information
    >>> names = ("frequency_hz", "damping_rate_1_s")
    >>> std = np.array([1e-6, 1e-2])
    >>> resonator = Resonator(
    ...     name=np.array(names), units=np.array(["Hz", "s-1"]), value=np.array([5e3, 0.1]),
    ...     std=std, covariance=np.diag(std**2),
    ... )
    >>> M = read_information(resonator, make_mechanics(resonator), InformationColumns((), {}))
    >>> round(float(M[0, 0])), float(M[5, 5])
    (10000, 0.0)
    """
    M = np.zeros((layout.size, layout.size))
    _, slopes = to_parameters(from_mechanics(m), m.mode_number)
    order = [name for name, _ in PARAMETERS][1:]
    if isinstance(known, Resonator):
        there = [
            k
            for k, name in enumerate(known.name)
            if str(name) in order and known.std[k] > 0 and np.isfinite(known.std[k])
        ]
        rows, covariance = (
            [order.index(str(known.name[k])) for k in there],
            compute_slope_covariance(known)[np.ix_(there, there)],
        )
    else:
        stds = {row["name"]: float(row["std"]) for row in known.told("values")}
        rows = [k for k, name in enumerate(order) if 0 < stds.get(name, 0.0) < np.inf]
        covariance = np.diag([stds[order[k]] ** 2 for k in rows])
    if rows:
        J = slopes[rows]
        M[:COUNT, :COUNT] = J.T @ invert_information(covariance) @ J
    return M
