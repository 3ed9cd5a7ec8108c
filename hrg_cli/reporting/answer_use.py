"""What to do with the answer: the equation it stands for, a few lines of C with the numbers in
them, and the commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import numpy as np

from ..effects import EFFECTS
from ..effects.effect import no_term, same_signal
from ..errors import HrgError
from ..records import Calibration, Diagnosis
from ..stages.calibration.interpolation import read_measured_part
from ..stages.planning.like_measured import make_menu_like
from ..stages.rate_table import is_rate_table
from .json_text import list_entries, read_float, take_child

Array = np.ndarray


LARGER = 2.0**40
"""Times the unit signal at which a linear read-out does the same: what leaves small signals alone
or takes them away (a dead zone of some counts) is none, in any unit."""
SINGULAR = 1e6
"""Condition of the channels' matrix from which it is not undone."""
MEASURED = {
    "quadrature": "D_r from the measured a_B/a_A",
    "phase": "D_r from the measured a_B/a_A and frequency",
}
"""What a drift model computes in operation, in words."""


def choose_equation(calibration: Calibration | None, causes: Sequence[str]) -> str:
    """The equation that a result gives the numbers of.

    Parameters
    ----------
    calibration
        Tables; None: of a resonator.
    causes
        Names of the effects found.

    Returns
    -------
    str
        In letters of the handbook.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_use import choose_equation
    >>> choose_equation(None, [])
    'm·dθ/dt = −K·Ω + D(θ), D(θ) = ν·δμ·sin 2m(θ − θ_μ)'
    """
    if calibration is not None and is_rate_table(calibration):
        return "Ω = (output/nominal_scale + D(T) − Σ c_p·Ω^p)/K(T)"
    if calibration is not None:
        part = read_measured_part(calibration)
        if part is None:
            return "m·dθ/dt = −K·Ω + D(T, θ), so Ω = (D − m·dθ/dt)/K"
        return (
            "m·dθ/dt = −K·Ω + D(T, θ) + D_r, so Ω = (D + D_r − m·dθ/dt)/K;"
            f" {MEASURED[part['kind']]}"
        )
    first = "m·dθ/dt = −K·Ω + D(θ), D(θ) = ν·δμ·sin 2m(θ − θ_μ)"
    seen = [name for name in causes if build_matrix({name: {}}) is not None]
    return f"{first}; channels first: (C, S) = (1 + E)⁻¹ (C, S) measured" if seen else first


def build_matrix(found: Mapping[str, Mapping[str, float]]) -> Array | None:
    """The matrix 1 + E of the causes that are linear in the read-out.

    Each column is what the effect's slow read-out makes of a unit signal, so that an effect of the
    catalogue needs no code here.

    Parameters
    ----------
    found
        Effect -> its parameters.

    Returns
    -------
    ndarray or None
        (2, 2) of (C, S); None where no cause is such.

    Examples
    --------
    A gain mismatch of 2 % is a per cent more in one channel and less in the other:

    >>> from hrg_cli.reporting.answer_use import build_matrix
    >>> build_matrix({"gain_mismatch": {"gain": 0.02}}).real.round(9).tolist()
    [[1.01, 0.0], [0.0, 0.99]]
    """
    total = np.eye(2, dtype=complex)
    linear = False
    for effect in EFFECTS:
        if (
            effect.name not in found
            or effect.slow_readout is same_signal
            or effect.slow is not no_term
        ):
            continue
        values = effect.values(
            {p.name: found[effect.name].get(p.name, p.typical) for p in effect.parameters}
        )
        columns = [
            _seen(effect, values, size * unit)
            for unit in np.eye(2, dtype=complex)
            for size in (1.0, LARGER, 1j)
        ]
        if any(c is None for c in columns):
            continue
        one, more, turned = (np.stack([columns[k], columns[k + 3]], axis=1) for k in range(3))  # type: ignore[list-item]
        if np.allclose(more, LARGER * one, rtol=1e-12, atol=1e-15) and np.allclose(
            turned, 1j * one, rtol=1e-12, atol=1e-15
        ):
            total, linear = one @ total, True
    return total if linear else None


def _seen(effect: Any, values: Mapping[str, float], u: Array) -> Array | None:
    """The effect's read-out of one signal; None where it asks for more than the signal."""
    try:
        return np.asarray(effect.slow_readout(values, u[None], SimpleNamespace())[0], complex)
    except AttributeError:
        return None


def write_snippet(
    report: Mapping[str, Any], calibration: Calibration | None, parameters: Sequence[Any]
) -> str:
    """A few lines of C with the numbers of a result in them.

    Parameters
    ----------
    report
        Of a diagnosis.
    calibration
        Tables; None: the resonator's own parameters.
    parameters
        Of the resonator.

    Returns
    -------
    str
        With tables, of channels as they are; else the channels put right, then the rate; empty
        where neither is known.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.reporting.answer_use import write_snippet
    >>> known = {"damping_split_1_s": 2e-3, "damping_axis_rad": 0.1, "scale_factor": 0.55}
    >>> print(write_snippet({}, None, [Told(name=n, value=v) for n, v in known.items()]))
    double drift = 0.002 * sin(4 * (theta - 0.1));  /* rad/s */
    double rate_rad_s = (drift - 2 * dtheta_dt) / 0.55;
    """
    if calibration is not None:
        return "" if is_rate_table(calibration) else _rate_by_tables(calibration)
    return "\n".join([*_channels_put_right(report), *_rate_by_drift(report, parameters)])


def _rate_by_tables(calibration: Calibration) -> str:
    """C that takes the rate from the exported tables."""
    lines = ['#include "calibration.h"  /* hrg export calibration.h5 -o calibration.h */']
    measured = "0.0"
    if read_measured_part(calibration) is not None:
        measured = "measured"
        lines.append(
            "double measured = hrg_measured_drift_rad_s(x, theta, ratio, frequency_hz);"
            "  /* ratio: a_B/a_A */"
        )
    lines.append(f"double rate_rad_s = hrg_rate_rad_s(x, theta, dtheta_dt, {measured});")
    return "\n".join(lines)


def _channels_put_right(report: Mapping[str, Any]) -> list[str]:
    """C that undoes a read-out's fault; nothing where none was found that a real matrix undoes."""
    found = {}
    for cause in list_entries(dict(report), "effects"):
        parameters = take_child(cause, "parameters").items()
        found[str(cause.get("name"))] = {
            name: read_float(p.get("value")) for name, p in parameters if isinstance(p, dict)
        }
    matrix = build_matrix(found)
    # a read-out that takes all of a channel away is not undone by a matrix
    if matrix is None or not np.linalg.cond(matrix) < SINGULAR:
        return []
    inverse = np.linalg.inv(matrix)
    if not np.abs(inverse.imag).max() < 1e-12:  # a phase is no matter of one instant's samples
        return []
    a = inverse.real
    return [
        "/* channels as they would be without the read-out's fault */",
        (
            f"double c1 = {a[0, 0]:.9g} * c + {a[0, 1]:.9g} * s, s1 = {a[1, 0]:.9g} * c +"
            f" {a[1, 1]:.9g} * s;"
        ),
    ]


def _rate_by_drift(report: Mapping[str, Any], parameters: Sequence[Any]) -> list[str]:
    """C that takes the rate from the wave's turn, less the drift of a damping split (seed A (8));
    nothing where the resonator is not known as far."""
    known = {p.name: p.value for p in parameters}
    if not {"damping_split_1_s", "damping_axis_rad", "scale_factor"} <= set(known):
        return []
    m = int(read_float(report.get("mode_number"))) if report.get("mode_number") else 2
    split, axis = known["damping_split_1_s"], known["damping_axis_rad"]
    return [
        f"double drift = {split:.9g} * sin({2 * m} * (theta - {axis:.9g}));  /* rad/s */",
        f"double rate_rad_s = (drift - {m} * dtheta_dt) / {known['scale_factor']:.9g};",
    ]


def list_commands(
    names: Mapping[str, str], diagnosis: Diagnosis | None, calibration: Calibration | None
) -> tuple[str, ...]:
    """What to type next; each command runs as it stands, beside the files.

    Parameters
    ----------
    names
        Kind -> name of its file.
    diagnosis, calibration
        Of the gyro; None: there is none.

    Returns
    -------
    tuple of str
        In the order of use.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_use import list_commands
    >>> list_commands({"resonator": "resonator.h5"}, None, None)
    ('hrg diagnose *.wave.h5 -o diagnosis.h5',)
    """
    found = []
    if calibration is not None:
        suffix = "json" if is_rate_table(calibration) else "h"
        file = names.get("calibration", "calibration.h5")
        found.append(f"hrg export {file} -o calibration.{suffix}")
    if diagnosis is not None:
        file = names.get("diagnosis", "diagnosis.h5")
        if diagnosis.extended_model:
            found.append(f"hrg simulate {file.removesuffix('.h5')}.extended.toml -o twin.h5")
        if _tells_runs(diagnosis):
            found.append(f"hrg plan {file} -o next.toml")
    elif "resonator" in names:
        found.append("hrg diagnose *.wave.h5 -o diagnosis.h5")
    return tuple(found)


def _tells_runs(diagnosis: Diagnosis) -> bool:
    """Whether the next runs can be planned without a menu."""
    with suppress(HrgError):  # a damaged model: `hrg plan` would say so
        return make_menu_like(diagnosis) is not None
    return False
