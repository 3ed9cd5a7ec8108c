"""hrg: calibration of solid-state wave (hemispherical resonator) gyroscopes, from recorded samples
to correction tables.

Conventions, the same in memory, files, settings and flags:

* SI units, angles in radians; a name that carries a unit ends in it (`time_s`, `rate_rad_s`,
  `temperature_degc`).
* The channels C and S see the displacement W = C cos mθ + S sin mθ, m = mode_number.
* Envelopes with e^{+jωt}: C = Re[C0 e^{jωt}], C0 = e^{jφ}(a_A cos mθ + j a_B sin mθ), S0 =
  e^{jφ}(a_A sin mθ − j a_B cos mθ).
* Output equation: m·dθ/dt = −K·Ω + D(T, θ).
* ν = 1/τ; δω = (ω_p − ω_q)/2; axes θ_μ (damping) and θ_ω (stiffness) are physical angles in [0,
  π/m).

As a library:

    from hrg_cli import store, Wave, calibrate
    waves = [store.read(path, Wave) for path in paths]
    table = calibrate(waves, harmonics=2)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .version import __version__ as __version__

# what a type checker and an editor see; the names load on first use (PEP 562), a test holds both
# lists together
if TYPE_CHECKING:
    from . import store as store
    from .errors import HrgError as HrgError
    from .records import Calibration as Calibration
    from .records import Compensated as Compensated
    from .records import Diagnosis as Diagnosis
    from .records import Periods as Periods
    from .records import Recording as Recording
    from .records import Resonator as Resonator
    from .records import Wave as Wave
    from .records import collect as collect
    from .reporting.answer import answer as answer
    from .stages.calibrate import calibrate as calibrate
    from .stages.compensate import compensate as compensate
    from .stages.demodulate import demodulate as demodulate
    from .stages.diagnose import diagnose as diagnose
    from .stages.estimate import estimate as estimate
    from .stages.identify import identify as identify
    from .stages.plan import plan as plan
    from .stages.simulate import simulate as simulate

_PUBLIC = {
    "store": ("hrg_cli.store", None),
    "HrgError": ("hrg_cli.errors", "HrgError"),
    "answer": ("hrg_cli.reporting.answer", "answer"),
    **{
        name: ("hrg_cli.records", name)
        for name in (
            "Recording",
            "Periods",
            "Wave",
            "Resonator",
            "Calibration",
            "Compensated",
            "Diagnosis",
            "collect",
        )
    },
    **{
        name: (f"hrg_cli.stages.{name}", name)
        for name in (
            "simulate",
            "demodulate",
            "estimate",
            "identify",
            "calibrate",
            "compensate",
            "diagnose",
            "plan",
        )
    },
}


__all__ = [
    "Calibration",
    "Compensated",
    "Diagnosis",
    "HrgError",
    "Periods",
    "Recording",
    "Resonator",
    "Wave",
    "answer",
    "calibrate",
    "collect",
    "compensate",
    "demodulate",
    "diagnose",
    "estimate",
    "identify",
    "plan",
    "simulate",
    "store",
]


def __getattr__(name: str) -> Any:
    """Public names load on first use, so that `hrg --help` stays fast."""
    if name in _PUBLIC:
        module, attribute = _PUBLIC[name]
        loaded = import_module(module)
        return loaded if attribute is None else getattr(loaded, attribute)
    raise AttributeError(f"module 'hrg_cli' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_PUBLIC])
