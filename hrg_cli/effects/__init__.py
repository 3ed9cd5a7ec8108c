"""The catalogue of effects: one file each, one line here.

A user's own effects are `Effect` objects of a Python file, brought in by `load_effects`.
"""

from pathlib import Path

from ..errors import HrgError
from . import (
    ageing,
    anisotropic_cubic_stiffness,
    centrifugal_stiffness,
    clock_error,
    coherent_offset,
    cubic_stiffness,
    damping_drift,
    drive_feedthrough,
    drive_gain_mismatch,
    drive_nonorthogonality,
    drive_rotation,
    dropped_samples,
    electrode_nonorthogonality,
    finite_quadrature_gain,
    gain_mismatch,
    inertial_nonlinearity,
    mains_tone,
    nonlinear_damping,
    parasitic_force,
    phase_mismatch,
    pickoff_nonlinearity,
    quadrature_crosstalk,
    quadrature_drive_phase_error,
    rate_bias,
    saturation,
    split_temperature,
    table_rate_error,
    table_wobble,
    thermal_damping,
    thermal_frequency,
    thermal_gradient,
    thermal_hysteresis,
    thermal_lag,
)
from .effect import Effect, Parameter

EFFECTS: tuple[Effect, ...] = (
    gain_mismatch.EFFECT,
    electrode_nonorthogonality.EFFECT,
    phase_mismatch.EFFECT,
    quadrature_crosstalk.EFFECT,
    pickoff_nonlinearity.EFFECT,
    saturation.EFFECT,
    drive_feedthrough.EFFECT,
    coherent_offset.EFFECT,
    clock_error.EFFECT,
    dropped_samples.EFFECT,
    mains_tone.EFFECT,
    cubic_stiffness.EFFECT,
    inertial_nonlinearity.EFFECT,
    anisotropic_cubic_stiffness.EFFECT,
    nonlinear_damping.EFFECT,
    thermal_frequency.EFFECT,
    thermal_damping.EFFECT,
    split_temperature.EFFECT,
    damping_drift.EFFECT,
    centrifugal_stiffness.EFFECT,
    quadrature_drive_phase_error.EFFECT,
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
)
"""Every effect by family: read-out, resonator, control, bench."""


def find(name: str, effects: tuple[Effect, ...] = EFFECTS) -> Effect:
    """The effect of that name. HrgError: there is none; close names are offered."""
    for effect in effects:
        if effect.name == name:
            return effect
    import difflib

    close = difflib.get_close_matches(name, [e.name for e in effects], 3)
    hint = f"did you mean {' or '.join(close)}?" if close else "`hrg effects` lists them"
    raise HrgError(f"effects.{name}: no such effect; {hint}")


def page(name: str, effects: tuple[Effect, ...] = EFFECTS) -> str:
    """The page `hrg effects NAME` prints: the docstring, the parameters, and the experiment that separates it."""
    effect = find(name, effects)
    lines = [f"{effect.name} ({effect.family})", "", effect.page.strip(), "", f"Parameters of [effects.{effect.name}]:"]
    lines += [f"  {p.name} [{p.units}], typically {p.typical:g}: {p.meaning}" for p in effect.parameters]
    if effect.next_experiment:
        lines += ["", f"Next experiment: {effect.next_experiment}."]
    return "\n".join(lines)


def load_effects(path: str | Path) -> tuple[Effect, ...]:
    """The `Effect` objects at the top level of a Python file, which is executed. HrgError: the file fails or holds none."""
    import runpy

    path = Path(path)
    if not path.is_file():
        raise HrgError(f"{path}: no such file; name a Python file that defines Effect objects")
    try:
        names = runpy.run_path(str(path))
    except Exception as error:
        raise HrgError(f"{path}: fails to run ({type(error).__name__}: {error}); correct it") from error
    found = tuple({id(v): v for v in names.values() if isinstance(v, Effect)}.values())
    if not found:
        raise HrgError(f"{path}: holds no Effect; define one: from hrg_cli.effects import Effect, Parameter")
    return found


__all__ = ["EFFECTS", "Effect", "Parameter", "find", "load_effects", "page"]
