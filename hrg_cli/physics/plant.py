"""What a simulated gyro is made of: one plain description that both engines integrate and that
effects change.

A simulation file becomes an `Environment` (what the world does), a `Plant` (resonator), a `Control`
(loops and drive) and a `Readout` (pick-off, converter). The fast engine integrates the second-order
equations from them sample by sample, the slow engine the envelopes; an effect adds its fast term
through `Plant`, `Control`, `Readout`, `Environment` and its slow term by its own formula, so that
one mistake cannot hide in both.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from .resonator import IDENTITY, Mechanics, make_reflection

Array = np.ndarray

POLYNOMIAL = (
    "r2_z",  # |z|² z: cubic spring
    "r4_z",  # |z|⁴ z: quintic spring
    "v2_z",  # |v|² z
    "zv_v",  # (z·v) v
    "zv_z",  # (z·v) z
    "r2_v",  # |z|² v: damping that grows with displacement
    "v2_v",  # |v|² v: damping that grows with speed
    "quartic_c",  # ∇ Re(x + jy)⁴ / 4 = (x³ − 3xy², y³ − 3x²y): anisotropic cubic spring
    "quartic_s",  # ∇ Im(x + jy)⁴ / 4 = (3x²y − y³, x³ − 3xy²)
)
"""Names of the polynomial accelerations, in the order of `Plant.polynomial`: z'' = … + Σ
coefficient × term."""

Acceleration = Callable[[float, float, float, float, float], tuple[float, float]]
"""(t, x, y, vx, vy) -> (ax, ay): a further acceleration, compiled with numba where it is there."""


@dataclass
class Environment:
    """The world on one time grid (k rows, linear in between): true temperature of the resonator,
    true rate, and what is logged."""

    time_s: Array
    temperature_degc: Array
    rate_rad_s: Array
    logged_temperature_degc: Array
    logged_rate_rad_s: Array
    begun_s: float = 0.0
    """How long after the first run of its programme this one began."""


@dataclass
class Plant:
    """The resonator on the environment's grid: z'' = −2(N − KΩJ) z' − (W − KΩ'J) z + polynomial +
    extra + drive.

    damping N (k, 2, 2) [1/s]; stiffness W (k, 2, 2) [rad²/s²], neither need be symmetric;
    scale_factor K (k,); polynomial (9,) as `POLYNOMIAL`, in the displacement's unit. `mechanics` is
    the linear resonator at the reference temperature.
    """

    mechanics: Mechanics
    damping: Array
    stiffness: Array
    scale_factor: Array
    polynomial: Array = field(default_factory=lambda: np.zeros(len(POLYNOMIAL)))
    extra: Acceleration | None = None
    kicks: list[tuple[float, Array]] = field(default_factory=list)
    """(time_s, Δz' (2,)): instants at which the velocity jumps."""

    def accelerate(self, further: Acceleration) -> None:
        """Add a further acceleration to what is there."""
        self.extra = further if self.extra is None else add_accelerations(self.extra, further)

    def retune_stiffness(self, relative: Array) -> Array:
        """W of a frequency higher by a part `relative` (k,) of the linear resonator's, the split in
        rad/s as it was (so measured over temperature, PHYSICS M9).

        W = ω²I + 2ωδω R, so the part common to both axes goes with the factor's square and their
        difference with the factor. Parts of one frequency add up: what several effects do to it
        does not depend on their order.
        """
        common = np.trace(self.stiffness, axis1=1, axis2=2) / 2
        # A part of the linear ω, over the ω that other effects have left: so two of them add.
        factor = 1 + np.asarray(relative) * self.mechanics.omega_rad_s / np.sqrt(common)
        alike = common[:, None, None] * IDENTITY
        split = self.stiffness - alike
        return alike * factor[:, None, None] ** 2 + split * factor[:, None, None]


@functools.lru_cache(maxsize=16)
def add_accelerations(first: Acceleration, second: Acceleration) -> Acceleration:
    """The sum of two accelerations, compiled where numba is installed.

    Kept by its arguments, so that one pair is compiled once.

    Parameters
    ----------
    first, second
        Each (t, x, y, vx, vy) -> (ax, ay), times in s and displacements in their unit.

    Returns
    -------
    callable
        Of the same form.

    Examples
    --------
    >>> from hrg_cli.physics.plant import add_accelerations
    >>> def pull(t, x, y, vx, vy):
    ...     return -x, -y
    >>> def push(t, x, y, vx, vy):
    ...     return 0.5, 0.0
    >>> add_accelerations(pull, push)(0.0, 1.0, 2.0, 0.0, 0.0)
    (-0.5, -2.0)
    """
    try:
        from numba import njit
    except ImportError:
        pass
    else:
        first, second = (one if hasattr(one, "py_func") else njit(one) for one in (first, second))

    def both(t: float, x: float, y: float, vx: float, vy: float) -> tuple[float, float]:
        ax, ay = first(t, x, y, vx, vy)
        bx, by = second(t, x, y, vx, vy)
        return ax + bx, ay + by

    return both


@dataclass(frozen=True)
class ThermalCourses:
    """Relative changes with temperature about `reference_degc`: value(T) = value·(1 + c₁ΔT + c₂ΔT²
    + …), c as given a quantity."""

    reference_degc: float = 20.0
    frequency: tuple[float, ...] = ()
    damping_rate: tuple[float, ...] = ()
    damping_split: tuple[float, ...] = ()
    frequency_split: tuple[float, ...] = ()
    scale_factor: tuple[float, ...] = ()

    def compute_factor(self, course: tuple[float, ...], temperature_degc: Array) -> Array:
        """1 + c₁ΔT + c₂ΔT² + … of a course."""
        change = np.asarray(temperature_degc, float) - self.reference_degc
        return 1 + sum((c * change ** (k + 1) for k, c in enumerate(course)), np.zeros_like(change))

    def make_mechanics(self, mechanics: Mechanics, temperature_degc: float) -> Mechanics:
        """The resonator as it is at a temperature."""
        T = np.array(temperature_degc)
        return replace(
            mechanics,
            frequency_hz=float(mechanics.frequency_hz * self.compute_factor(self.frequency, T)),
            damping_rate_1_s=float(
                mechanics.damping_rate_1_s * self.compute_factor(self.damping_rate, T)
            ),
            damping_split_1_s=float(
                mechanics.damping_split_1_s * self.compute_factor(self.damping_split, T)
            ),
            frequency_split_rad_s=float(
                mechanics.frequency_split_rad_s * self.compute_factor(self.frequency_split, T)
            ),
            scale_factor=float(mechanics.scale_factor * self.compute_factor(self.scale_factor, T)),
        )


def make_linear_plant(
    mechanics: Mechanics, courses: ThermalCourses, environment: Environment
) -> Plant:
    """The linear resonator on the environment's grid, at its true temperature.

    N = ν I + νδμ R(2mθ_μ), W = (ω² + δω²) I + 2ωδω R(2mθ_ω) (PHYSICS §0), each parameter times its
    own course over temperature.

    Parameters
    ----------
    mechanics
        The resonator at the courses' reference temperature.
    courses
        How its parameters follow temperature.
    environment
        The grid and the true temperature.

    Returns
    -------
    Plant
        N [1/s] and W [rad²/s²] (k, 2, 2) and K (k,), without nonlinear terms.

    Examples
    --------
    >>> from hrg_cli.physics.environment import hold_value, make_environment
    >>> from hrg_cli.physics.plant import ThermalCourses, make_linear_plant
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> warm = make_environment(hold_value(30.0), hold_value(0.0), 0.0, 1.0, 0.001)
    >>> courses = ThermalCourses(reference_degc=20.0, damping_rate=(0.01,))
    >>> make_linear_plant(Mechanics(1000.0, 0.5), courses, warm).damping[0].round(6).tolist()
    [[0.55, 0.0], [0.0, 0.55]]
    """
    T = environment.temperature_degc
    omega = (mechanics.omega_rad_s * courses.compute_factor(courses.frequency, T))[:, None, None]
    split = (mechanics.frequency_split_rad_s * courses.compute_factor(courses.frequency_split, T))[
        :, None, None
    ]
    damping = (mechanics.damping_rate_1_s * courses.compute_factor(courses.damping_rate, T))[
        :, None, None
    ]
    damping_split = (
        mechanics.damping_split_1_s * courses.compute_factor(courses.damping_split, T)
    )[:, None, None]
    m = mechanics.mode_number
    return Plant(
        mechanics,
        damping * IDENTITY + damping_split * make_reflection(2 * m * mechanics.damping_axis_rad),
        (omega**2 + split**2) * IDENTITY
        + 2 * omega * split * make_reflection(2 * m * mechanics.stiffness_axis_rad),
        mechanics.scale_factor * courses.compute_factor(courses.scale_factor, T),
    )


@dataclass
class Control:
    """Drive and loops; nothing acts in a free run, nor while the drive is off.

    Force on the envelope, per second (PHYSICS §1(c); u = e^{jφ}(a_A e_A − j a_B e_B)):
        f = D e^{jφ}(a_ΦA e^{−jΔφ_A} e_A − j a_ΦB e^{−jΔφ_B} e_B) + f_parasitic e^{jφ}, D =
        `drive_matrix`
    so ȧ_A = a_ΦA − …, ȧ_B = a_ΦB − …. The amplitude loop makes a_ΦA (proportional and integral, the
    loss at the reference temperature fed forward); the finite quadrature loop a_ΦB = −k_q a_B (and
    its integral); the spring loop adds jσR to the slow generator instead, σ = k_q r (and its
    integral), its axis 45° (electrical 90°) from the wave. The parametric drive pumps with one ring
    electrode, f = D p e^{−jΔφ_A} e^{2jφ} u*, p = a_ΦA/a_A: it feeds a_A and damps a_B alike. With
    a `log` no loop acts: its a_ΦA and a_ΦB drive the wave in the same ways.
    """

    forced: bool = False
    main_amplitude: float = 1.0
    amplitude_gain_1_s: float = 5.0
    amplitude_integral_1_s2: float = 0.0
    quadrature_loop: str = "off"  # off | finite | spring
    quadrature_gain_1_s: float = 0.0
    quadrature_integral_1_s2: float = 0.0
    drive: str = "force"  # force | parametric
    drive_matrix: Array = field(default_factory=lambda: np.eye(2))
    main_phase_error_rad: float = 0.0
    quadrature_phase_error_rad: float = 0.0
    parasitic_force: Array = field(default_factory=lambda: np.zeros(2, complex))
    on_off: Array = field(default_factory=lambda: np.zeros((0, 2)))
    """Intervals (start_s, stop_s) in which the drive is off; none: always on."""
    log: Array = field(default_factory=lambda: np.zeros((0, 3)))
    """Rows (time_s, a_ΦA, a_ΦB) of a drive that is replayed along straight lines, constant before
    the first and after the last; none: the loops act."""

    def interpolate_log(self, time_s: Array) -> Array:
        """a_ΦA and a_ΦB (n, 2) of the log at any times; (0, 2) where the loops act."""
        if not len(self.log):
            return np.zeros((0, 2))
        t = self.log[:, 0]
        return np.column_stack([np.interp(time_s, t, self.log[:, k]) for k in (1, 2)])


@dataclass
class Samples:
    """A block of samples on its way through the read-out; the analytic signal u e^{jω_r t} is z −
    j·v_over_omega."""

    time_s: Array
    """(n,) true time."""
    z: Array
    """(2, n) displacement."""
    v_over_omega: Array
    """(2, n) velocity over ω, seen from axes that turn with the wave's own rotation KΩ: what goes
    with the analytic signal, to the order of δω/ω."""
    drive: Array
    """(2, n) complex: the force on the envelopes (before `drive_matrix`) turned to the instant, f
    e^{jω_r t}, amplitude per second."""
    temperature_degc: Array
    rate_rad_s: Array
    velocity: Callable[[], Array] | None = None
    """() -> (2, n): the displacement's derivative over the reference's ω, for electrodes that read
    it."""
    noise: Array | None = None
    """(2, n) read-out noise where the engine drew it (the loops saw the same); None: the pick-off
    chain draws its own."""


@dataclass
class Block:
    """What an engine makes of a stretch of time: samples, the loops' commands (a_ΦA, a_ΦB) (2, n),
    and the truth."""

    samples: Samples
    command: Array
    envelopes: Callable[[Array], Array]
    """Positions in the block (k,) -> true envelopes (k, 2) against the plant's mean frequency."""


ReadoutStep = Callable[[Samples, Array], Array]
"""(block, y (2, n)) -> y (2, n): one step of the pick-off chain, in order."""


@dataclass
class Readout:
    """Pick-off chain: steps applied to the displacement, then carrier, noise, converter."""

    kind: str = "direct"  # direct | carrier
    carrier_hz: float = 0.0
    carrier_phase_rad: float = 0.0
    model: str = "linear"  # linear | full (seed B's electrodes)
    gap: float = 1.0
    law: str = "alternating"
    gaps: Array = field(default_factory=lambda: np.ones(8))
    gains: Array = field(default_factory=lambda: np.ones(8))
    steps: list[ReadoutStep] = field(default_factory=list)
    after: list[ReadoutStep] = field(default_factory=list)
    """Steps after the carrier and noise (converter side: saturation, dropped samples)."""
    noise: float = 0.0
    adc_bits: int = 0
    full_scale: float = 1.0
    clock_error: float = 0.0
    dropped: list[tuple[float, float]] = field(default_factory=list)
    """(time_s, lost_s): whole samples of that total length are lost there; those after it are of
    later instants, closed up."""


@dataclass
class SlowState:
    """What an effect's slow term may look at, beside the envelopes u (..., 2): all of shape (...)
    that broadcasts with u's.

    `slow_environment(p, state) -> SlowState` may return a changed copy (true temperature and rate
    from the logged ones); `slow(p, u, state) -> du/dt (..., 2)` adds to the envelope equation;
    `slow_readout(p, u, state) -> u` is the static read-out; `slow_jump(p, state) -> (time_s, jump
    of u)` is what happens at one instant.
    """

    mechanics: Mechanics
    time_s: Array
    temperature_degc: Array
    temperature_rate_degc_s: Array
    branch: Array
    """Sign of the last temperature change: +1 rising, −1 falling, 0 before any."""
    rate_rad_s: Array
    table_angle_rad: Array
    """∫Ω dt of the run, from 0."""
    drive: Array
    """Commanded force on the envelopes (..., 2) complex, amplitude per second, before any drive
    defect; zero in a free run."""
    forced: Array
    """1 where the drive is on, else 0."""
    phase_rad: Array
    """Phase φ of the main wave near which u's own φ is to be taken: (mθ, φ) and (mθ + π, φ + π) are
    the same wave."""
    omega_r_rad_s: float
    """Reference frequency of the envelopes."""
    run: Array | None = None
    """Number of every run from 0, where several stand side by side."""
    displacement: Array | None = None
    """Envelopes (..., 2) of the displacement, where an effect that acts on the velocity is given
    that one's; None: both are the same."""
    begun_s: Array | float = 0.0
    """How long after the first run of its programme each run began."""
