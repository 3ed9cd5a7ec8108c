"""The catalogue of effects: one file each, one line here.

A user's own effects are `Effect` objects of a Python file, brought in by `load_effects`.
"""

from pathlib import Path

import numpy as np

from ..errors import HrgError
from ..physics.plant import SlowState
from ..physics.resonator import Mechanics
from . import (
    ageing,
    anisotropic_cubic_stiffness,
    centrifugal_stiffness,
    clock_error,
    coherent_offset,
    converter_nonlinearity,
    cubic_stiffness,
    damping_drift,
    damping_split_temperature,
    drive_feedthrough,
    drive_gain,
    drive_gain_mismatch,
    drive_nonorthogonality,
    drive_rotation,
    dropped_samples,
    dry_friction,
    electrode_nonorthogonality,
    finite_quadrature_gain,
    gain_drift,
    gain_mismatch,
    gain_step,
    gain_temperature,
    inertial_nonlinearity,
    mains_tone,
    mismatch_temperature,
    momentum_kick,
    nonlinear_damping,
    parasitic_force,
    phase_drift,
    phase_mismatch,
    pickoff_nonlinearity,
    quadrature_crosstalk,
    quadrature_drive_phase_error,
    rate_bias,
    saturation,
    scale_factor_temperature,
    split_temperature,
    table_rate_error,
    table_wobble,
    thermal_damping,
    thermal_frequency,
    thermal_frequency_curvature,
    thermal_gradient,
    thermal_hysteresis,
    thermal_lag,
)
from .effect import Effect, Parameter

EFFECTS: tuple[Effect, ...] = (
    gain_mismatch.EFFECT,
    gain_temperature.EFFECT,
    gain_drift.EFFECT,
    gain_step.EFFECT,
    mismatch_temperature.EFFECT,
    electrode_nonorthogonality.EFFECT,
    phase_mismatch.EFFECT,
    phase_drift.EFFECT,
    quadrature_crosstalk.EFFECT,
    pickoff_nonlinearity.EFFECT,
    saturation.EFFECT,
    converter_nonlinearity.EFFECT,
    drive_feedthrough.EFFECT,
    coherent_offset.EFFECT,
    clock_error.EFFECT,
    dropped_samples.EFFECT,
    mains_tone.EFFECT,
    cubic_stiffness.EFFECT,
    inertial_nonlinearity.EFFECT,
    anisotropic_cubic_stiffness.EFFECT,
    nonlinear_damping.EFFECT,
    dry_friction.EFFECT,
    thermal_frequency.EFFECT,
    thermal_frequency_curvature.EFFECT,
    thermal_damping.EFFECT,
    split_temperature.EFFECT,
    damping_split_temperature.EFFECT,
    scale_factor_temperature.EFFECT,
    damping_drift.EFFECT,
    centrifugal_stiffness.EFFECT,
    quadrature_drive_phase_error.EFFECT,
    drive_gain.EFFECT,
    drive_gain_mismatch.EFFECT,
    drive_nonorthogonality.EFFECT,
    drive_rotation.EFFECT,
    finite_quadrature_gain.EFFECT,
    parasitic_force.EFFECT,
    rate_bias.EFFECT,
    table_rate_error.EFFECT,
    table_wobble.EFFECT,
    thermal_lag.EFFECT,
    thermal_gradient.EFFECT,
    thermal_hysteresis.EFFECT,
    ageing.EFFECT,
    momentum_kick.EFFECT,
)
"""Every effect by family: read-out, resonator, control, bench."""


def find(name: str, effects: tuple[Effect, ...] = EFFECTS) -> Effect:
    """The effect of that name.

    Parameters
    ----------
    name
        Its name.
    effects
        Among which it is looked for.

    Returns
    -------
    Effect
        The effect.

    Raises
    ------
    HrgError
        There is none; close names are offered.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> find("gain_mismatch").family
    'read-out'
    >>> find("table_wobbel")
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: effects.table_wobbel: no such effect; did you mean table_wobble?
    """
    for effect in effects:
        if effect.name == name:
            return effect
    import difflib

    close = difflib.get_close_matches(name, [e.name for e in effects], 3)
    hint = f"did you mean {' or '.join(close)}?" if close else "`hrg effects` lists them"
    raise HrgError(f"effects.{name}: no such effect; {hint}")


def format_page(name: str, effects: tuple[Effect, ...] = EFFECTS) -> str:
    """The page `hrg effects NAME` prints: physics, parameters, the experiment that separates it.

    Parameters
    ----------
    name
        Of the effect.
    effects
        Among which it is looked for.

    Returns
    -------
    str
        Lines of text.

    Raises
    ------
    HrgError
        There is no such effect.

    Examples
    --------
    >>> from hrg_cli.effects import format_page
    >>> format_page("gain_mismatch").splitlines()[0]
    'gain_mismatch (read-out)'
    """
    effect = find(name, effects)
    lines = [
        f"{effect.name} ({effect.family})",
        "",
        effect.page.strip(),
        "",
        f"Parameters of [effects.{effect.name}]:",
    ]
    lines += [
        f"  {p.name} [{p.units}], typically {p.typical:g}: {p.meaning}" for p in effect.parameters
    ]
    if effect.next_experiment:
        lines += ["", f"Next experiment: {effect.next_experiment}."]
    return "\n".join(lines)


def load_effects(path: str | Path) -> tuple[Effect, ...]:
    """The `Effect` objects at the top level of a Python file, which is executed.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    tuple of Effect
        In the order in which the file defines them.

    Raises
    ------
    HrgError
        No such file, it fails to run or holds no effect, or one that is no effect: a name of the
        catalogue, nothing to fit, a slow term that fails.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.effects import load_effects
    >>> text = '''
    ... from hrg_cli.effects import Effect, Parameter
    ... loss = Parameter("loss_1_s", "s-1", 1e-3, "damping rate")
    ... def slow(p, u, state):
    ...     return -p["loss_1_s"] * u
    ... own = Effect("own_loss", "resonator", "A loss.", (loss,), slow=slow)
    ... '''
    >>> with TemporaryDirectory() as name:
    ...     file = Path(name) / "own.py"
    ...     _ = file.write_text(text)
    ...     print([effect.name for effect in load_effects(file)])
    ['own_loss']
    """
    import runpy

    path = Path(path)
    if not path.is_file():
        raise HrgError(f"{path}: no such file; name a Python file that defines Effect objects")
    try:
        names = runpy.run_path(str(path))
    except Exception as error:
        raise HrgError(
            f"{path}: fails to run ({type(error).__name__}: {error}); correct it"
        ) from error
    found = tuple({id(v): v for v in names.values() if isinstance(v, Effect)}.values())
    if not found:
        raise HrgError(
            f"{path}: holds no Effect; define one: from hrg_cli.effects import Effect, Parameter"
        )
    for effect in found:
        _check(effect, path)
    return found


def _check(effect: Effect, path: Path) -> None:
    """HrgError: a name of the catalogue, nothing to fit, or a slow term that fails or is not of the
    shape of u."""
    if any(effect.name == known.name for known in EFFECTS):
        raise HrgError(
            f"{path}: {effect.name} is an effect of the catalogue already; give yours another name"
        )
    if not effect.fitted():
        raise HrgError(f"{path}: {effect.name} has no parameter that a fit may move; give it one")
    rows = (2, 3)
    one = np.ones(rows)
    state = SlowState(
        mechanics=Mechanics(5000.0, 0.3, 0.01, 0.3, 0.1, 0.9, 0.55),
        time_s=np.broadcast_to(np.arange(3.0), rows),
        temperature_degc=25 * one,
        temperature_rate_degc_s=one,
        branch=one,
        rate_rad_s=one,
        table_angle_rad=one,
        drive=np.zeros((*rows, 2), complex),
        forced=0 * one,
        phase_rad=0 * one,
        omega_r_rad_s=2 * np.pi * 5000.0,
    )
    u = np.ones((*rows, 2)) * np.array([1 + 0.1j, 0.5])
    values = {p.name: p.neutral + p.typical for p in effect.parameters}
    try:
        seen = effect.slow_environment(values, state)
        for name, term in (("slow", effect.slow), ("slow_readout", effect.slow_readout)):
            shape, finite = np.shape(out := term(values, u, seen)), bool(np.all(np.isfinite(out)))
            if shape != u.shape or not finite:
                found = f"of shape {shape}" if finite else "not finite"
                raise HrgError(
                    f"{path}: {effect.name}.{name} gives a result {found} for u of shape {u.shape};"
                    " as many finite values were expected"
                )
    except HrgError:
        raise
    except Exception as error:
        raise HrgError(
            f"{path}: the slow terms of {effect.name} fail ({type(error).__name__}: {error});"
            " correct them"
        ) from error


__all__ = ["EFFECTS", "Effect", "Parameter", "find", "format_page", "load_effects"]
