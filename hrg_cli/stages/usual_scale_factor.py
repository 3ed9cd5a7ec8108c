"""Which scale factors K a resonator has: what a rate log in another unit, or of the other sign,
shows by itself, without any misfit.

|K| ≤ 1 for any two modes of one body: K = 2∫ρ(u_C × u_S)dV over ∫ρ(u_C² + u_S²)dV. Shells and rings
have 0.25 to 0.85, a Foucault pendulum 1.
"""

from __future__ import annotations

import numpy as np

from ..fitting.checks import Check, check_holds
from ..units import DEGREE, RATE_UNITS

Array = np.ndarray
LEAST, MOST = 0.1, 1.0
"""Least and largest K of a shell, ring or pendulum; a log in revolutions a minute shows 0.09 at
most."""
SURE = 3.0
"""Standard deviations by which K must be beyond them."""
USUAL = (0.22, 1.0)
"""K by which a unit is told: twice as narrow about 0.5 as the units' factors are apart."""
LOGGED_IN = RATE_UNITS | {"rad/s, read as °/s": 1 / DEGREE}
"""Unit of a rate log that was read as another -> what sets the rate right."""


def name_unit(scale_factor: float) -> tuple[str, float] | None:
    """The unit in which rates were logged, where it alone makes K what a resonator has.

    Parameters
    ----------
    scale_factor
        K as it came out.

    Returns
    -------
    tuple or None
        The unit, and K with the log in it; None where none is needed, or none helps.

    Examples
    --------
    A shell whose rates of °/s were read as rad/s:

    >>> from hrg_cli.stages.usual_scale_factor import name_unit
    >>> unit, right = name_unit(0.0096)
    >>> unit, round(right, 3)
    ('°/s', 0.55)
    >>> name_unit(0.5) is None, name_unit(0.02) is None
    (True, True)
    """
    least, most = USUAL
    if least <= scale_factor <= most:
        return None
    for unit, size in LOGGED_IN.items():
        if least <= scale_factor / size <= most:
            return unit, scale_factor / size
    return None


def check_scale_factor(scale_factor: float, std: float) -> Check:
    """Whether K is one of a shell, ring or pendulum.

    Parameters
    ----------
    scale_factor
        K.
    std
        Its standard deviation.

    Returns
    -------
    Check
        Passed or not; a failure names the log's unit, where one says it.

    Examples
    --------
    >>> from hrg_cli.stages.usual_scale_factor import check_scale_factor
    >>> check_scale_factor(0.55, 1e-4).passed, check_scale_factor(-0.55, 1e-4).passed
    (True, False)
    >>> check_scale_factor(0.00968, 1e-6).sentence.split(": ")[1]
    'with the rate log in °/s it is 0.5546; import the log with its unit'
    """
    found = name_unit(abs(scale_factor))
    cure = "check the sign and the unit of the rate log"
    if found is not None:
        turned = ", and its sign turned," if scale_factor < 0 else ""
        cure = (
            f"with the rate log in {found[0]}{turned} it is {found[1]:.4g}; import the log with its"
            " unit"
        )
    return check_holds(
        "scale_factor_is_plausible",
        LEAST - SURE * std <= scale_factor <= MOST + SURE * std,
        f"the scale factor {scale_factor:.4g} ± {std:.1g} is none of a shell, ring or pendulum"
        f" ({LEAST:g} to {MOST:g}): {cure}",
    )
