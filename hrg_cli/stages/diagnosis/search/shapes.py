"""Diagnosis, the shapes a damping that changes with the amplitude may have, and a fit with the
damping in one of them.

−d ln a/dt = ν + ν_n (a/a₀)^n. The catalogue has n = 2. Free: n is fitted. Passive: n is fitted and
there is no linear part; what split of the damping is left is the nonlinear part's own. Supplied: ν
> 0 beside a regulated supply that no log tells of, ν_n < 0, which gives a constant power (n = −2)
or a constant push (n = −1).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ....effects import nonlinear_damping
from ....effects.effect import Effect, Parameter
from ....fitting.causes import extended_fit, fit_point, scales
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import DAMPING
from ....physics.plant import SlowState

Array = np.ndarray
NAME = nonlinear_damping.EFFECT.name
LEAST, MOST = -0.5, 8.0
"""Powers that are sought."""
STEPS = 40


@dataclass(frozen=True)
class DampingShape:
    """One shape: in words, its power (NaN: fitted), whether there is a linear part."""

    words: str
    power: float = np.nan
    linear: bool = True

    @property
    def supplied(self) -> bool:
        """Whether energy comes in."""
        return self.power < 0


FREE = DampingShape("a damping that follows a^n")
PASSIVE = DampingShape("a damping that follows a^n without a linear part", linear=False)
SUPPLIED = (
    DampingShape("a supply of constant power", -2.0),
    DampingShape("a supply by a constant push", -1.0),
)


def fit_shape(fit: ExtendedFit, shape: DampingShape) -> ExtendedFit | None:
    """A fit with the catalogue's damping, fitted again with that damping in another shape; None
    where it finds no such fit.

    Parameters
    ----------
    fit
        With the catalogue's damping.
    shape
        That it is to have.

    Returns
    -------
    ExtendedFit or None
        With the damping of that shape.

    Examples
    --------
    A damping of ν₂a² shows its power:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_nonlinear_fit
    >>> from hrg_cli.stages.diagnosis.search.shapes import FREE, fit_shape
    >>> again = fit_shape(draw_nonlinear_fit(), FREE)
    >>> off = again.values("nonlinear_damping")["power"] - 2
    >>> bool(abs(off) < 2 * again.parameter_std("nonlinear_damping", "power"))
    True
    """
    amplitude = scales.measure_amplitude(fit.series)
    level, power = _stands(fit, amplitude)
    p, std = fit.point.p.copy(), fit.freedom.std.copy()
    if not shape.linear:
        level, p[DAMPING], std[DAMPING] = level + p[DAMPING], 0.0, 0.0
    if shape.supplied:
        # the same damping and the same slope of it at the data's amplitude
        slope = level * power
        p[DAMPING], level, power = (
            p[DAMPING] + level - slope / shape.power,
            slope / shape.power,
            shape.power,
        )
    effect = _set_level(amplitude, fitted=not shape.supplied)
    point = fit_point.add_effect(
        replace(fit.point, p=p), effect, {"level_1_s": level, "power": power}
    )
    try:
        again = extended_fit.fit(
            fit.series, point, replace(fit.freedom, std=std, passive=shape.linear), most=STEPS
        )
    except extended_fit.DivergedError:
        return None
    found = read_damping_values(again)
    if not np.all(np.isfinite(again.prediction.seen)) or (
        shape.supplied and found["level_1_s"] > 0
    ):
        return None
    return again if shape.supplied or LEAST < found["power"] < MOST else None


def to_catalogue(fit: ExtendedFit, shape: DampingShape, amplitude: float) -> ExtendedFit:
    """The same fit with the damping in the catalogue's own parameters.

    Parameters
    ----------
    fit
        With a damping of the shape.
    shape
        Of the damping.
    amplitude
        Of the data, in their unit.

    Returns
    -------
    ExtendedFit
        The same motion.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.scales import measure_amplitude
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_nonlinear_fit
    >>> from hrg_cli.stages.diagnosis.search.shapes import FREE, fit_shape, to_catalogue
    >>> amplitude = measure_amplitude(draw_nonlinear_fit().series)
    >>> again = to_catalogue(fit_shape(draw_nonlinear_fit(), FREE), FREE, amplitude)
    >>> round(again.values("nonlinear_damping")["damping_1_s"], 2)
    0.05
    """
    now = read_damping_values(fit)
    own = {"damping_1_s": now["level_1_s"] * amplitude ** -now["power"], "power": now["power"]}
    # the same optimum, looked at in coordinates in which steps would be poor
    same = extended_fit.fit(
        fit.series,
        fit_point.add_effect(fit.point, make_damping_effect(shape), own),
        fit.freedom,
        most=0,
    )
    return replace(same, converged=fit.converged)


def make_damping_effect(shape: DampingShape) -> Effect:
    """The catalogue's effect, with the power fitted where the shape leaves it open.

    Parameters
    ----------
    shape
        Of the damping.

    Returns
    -------
    Effect
        Of the catalogue.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.search.shapes import FREE, SUPPLIED, make_damping_effect
    >>> [make_damping_effect(shape).parameters[1].fitted for shape in (FREE, SUPPLIED[0])]
    [True, False]
    """
    effect = nonlinear_damping.EFFECT
    return (
        effect
        if shape.supplied
        else replace(effect, parameters=tuple(replace(p, fitted=True) for p in effect.parameters))
    )


def read_damping_values(fit: ExtendedFit) -> dict[str, float]:
    """The damping's parameters.

    Parameters
    ----------
    fit
        With that cause.

    Returns
    -------
    dict
        By name.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_nonlinear_fit
    >>> from hrg_cli.stages.diagnosis.search.shapes import read_damping_values
    >>> read_damping_values(draw_nonlinear_fit())["power"]
    2.0
    """
    return fit.values(NAME)


def read_power(fit: ExtendedFit) -> tuple[float, float]:
    """The power and its σ, 0 where it is given.

    Parameters
    ----------
    fit
        With that cause.

    Returns
    -------
    tuple of float
        n and its σ.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_nonlinear_fit
    >>> from hrg_cli.stages.diagnosis.search.shapes import read_power
    >>> read_power(draw_nonlinear_fit())
    (2.0, 0.0)
    """
    return read_damping_values(fit)["power"], fit.parameter_std(NAME, "power")


def compute_level(fit: ExtendedFit, amplitude: float) -> tuple[float, float]:
    """ν_n at an amplitude and its σ, from the catalogue's parameters.

    Parameters
    ----------
    fit
        With the catalogue's parameters.
    amplitude
        In the unit of the envelopes.

    Returns
    -------
    tuple of float
        [1/s].

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_nonlinear_fit
    >>> from hrg_cli.stages.diagnosis.search.shapes import compute_level
    >>> [round(one, 3) for one in compute_level(draw_nonlinear_fit(), 1.0)]
    [0.05, 0.001]
    """
    now = read_damping_values(fit)
    level = now["damping_1_s"] * amplitude ** now["power"]
    slopes = {"damping_1_s": amplitude ** now["power"], "power": level * np.log(amplitude)}
    names = [name for name in slopes if name in fit.layout.parameters(NAME)]
    index = [fit.layout.parameter(NAME, name) for name in names]
    slope = np.array([slopes[name] for name in names])
    return float(level), float(
        np.sqrt(max(slope @ fit.covariance[np.ix_(index, index)] @ slope, 0.0))
    )


def measure_level_sigma(fit: ExtendedFit) -> float:
    """How many σ the level stands off zero, the power being what it is: of a power near 0 the level
    is hardly known beside the linear damping, and that there is one may be beyond doubt.

    Parameters
    ----------
    fit
        With the catalogue's parameters.

    Returns
    -------
    float
        With the level's sign.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_nonlinear_fit
    >>> from hrg_cli.stages.diagnosis.search.shapes import measure_level_sigma
    >>> bool(measure_level_sigma(draw_nonlinear_fit()) > 30)
    True
    """
    index = [fit.layout.parameter(NAME, name) for name in fit.layout.parameters(NAME)]
    precision = np.linalg.pinv(fit.covariance[np.ix_(index, index)])
    return float(read_damping_values(fit)["damping_1_s"] * np.sqrt(precision[0, 0]))


def _stands(fit: ExtendedFit, amplitude: float) -> tuple[float, float]:
    """(ν_n at the data's amplitude, n) as the damping stands, in whichever parameters."""
    now = read_damping_values(fit)
    power = now.get("power", 2.0)
    return (
        now["damping_1_s"] * amplitude**power if "damping_1_s" in now else now["level_1_s"]
    ), power


def _set_level(amplitude: float, fitted: bool) -> Effect:
    """The catalogue's effect with its level at the data's amplitude, which the power hardly
    moves."""

    def slow(p: Mapping[str, float], u: Array, state: SlowState) -> Array:
        power = p["power"] if not fitted else float(np.clip(p["power"], LEAST, MOST))
        return nonlinear_damping.slow(
            {"damping_1_s": p["level_1_s"] * amplitude**-power, "power": power}, u, state
        )

    level = Parameter("level_1_s", "s-1", 1e-5, "damping at the data's amplitude")
    return Effect(
        name=NAME,
        family="resonator",
        page="",
        parameters=(level, Parameter("power", "1", 1.0, "power", fitted=fitted)),
        slow=slow,
        acts_on=nonlinear_damping.EFFECT.acts_on,
        nonlinear_force=True,
    )
