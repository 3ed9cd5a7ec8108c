"""What an effect is: a page of physics, its parameters, its fast terms and, written separately, its
slow terms.

Fast terms change the simulated gyro in place: `environment(p, env)`, `plant(p, plant, env)`,
`control(p, control)`, `readout(p, readout)` (see physics/plant.py). Slow terms act on the complex
envelopes u (..., 2), vectorised over any leading shape: `slow_environment(p, state) -> state`,
`slow(p, u, state) -> du/dt`, `slow_rate(p, u, state) -> d/dt` of that where u stands and a spring
moves, `slow_readout(p, u, state) -> u`. `slow_jump(p, state) -> (time_s,
jump of u)` is what happens at one instant. `p` maps each parameter's name to its value; at all
parameters' `neutral` value an effect does nothing.

What the diagnosis, the plan and the studies need to know of an effect stands on its page, too:
where it is seen, what shows it, from which values it is tried. No other module knows an effect by
its name for that, so that a user's own effect is treated as well.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np

from ..errors import HrgError, name_some
from ..physics import ellipse
from ..physics.plant import Control, Environment, Plant, Readout, SlowState
from ..physics.resonator import Mechanics

Array = np.ndarray
ROUNDING = 1e-9
"""Part of a temperature's range below which a change from row to row is none."""
Values = Mapping[str, float]
Need = Literal["temperature", "half a turn"]
"""What runs must hold for an effect to be asked for: a temperature that is logged and moves, a
table that turns by half a turn."""
Condition = Literal[
    "drive", "temperature cycle", "rate steps", "known scale factor", "another rate"
]
"""What a programme of runs must hold for some effects to show at all."""
REFERENCE_TEMPERATURE = "reference_temperature_degc"
"""Name of the parameter of every effect that counts from a temperature at which the base model
holds."""
RELATIVE_TO_TEMPERATURE = "relative_1_k"
"""Name of the parameter by which an effect that `scales` a parameter does so, a part per kelvin."""
INSTANT = "time_s"
"""Name of the parameter of every effect that happens at one instant."""
IN_FREE_RUNS = "in_free_runs"
"""Name of the parameter by which an effect of the drive acts without one, too: 1, else 0."""
RUN, OF_EVERY_RUN = "run", -1.0
"""Name of the parameter of every effect that happens in one run of several, the runs' number from
0, and its value for all of them."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes
    ----------
    name
        It ends in its unit, where it has one.
    units
        As files have them.
    typical
        A size at unit amplitude.
    meaning
        In words.
    neutral
        The value at which it does nothing.
    amplitude_power
        The value scales as amplitude^power when the amplitude's unit changes.
    fitted
        False for a reference that only says where another parameter counts from.
    minimum
        The least value that physics allows.
    sets_in
        Up to a level it does nothing, so that there is no slope at its neutral value and a score is
        that of the secant to a value tried.
    fitted_then
        It changes what others do and nothing else, so that it is fitted once these are found.
    higher_order
        The next order of what the effect does: held at its neutral value until the effect stands and
        the data ask for it more than for any other cause.
    required
        No value is the usual one, so that whoever asks for the effect must give it: the instant of
        what happens once, the frequency of a tone.
    """

    name: str
    units: str
    typical: float
    meaning: str
    neutral: float = 0.0
    amplitude_power: int = 0
    fitted: bool = True
    minimum: float = -np.inf
    sets_in: bool = False
    fitted_then: bool = False
    higher_order: bool = False
    required: bool = False


def make_reference_temperature(
    meaning: str = "temperature at which the base model holds",
) -> Parameter:
    """The parameter that says from which temperature an effect counts.

    Parameters
    ----------
    meaning
        In words.

    Returns
    -------
    Parameter
        In °C, held by every fit.

    Examples
    --------
    >>> from hrg_cli.effects.effect import make_reference_temperature
    >>> make_reference_temperature().neutral, make_reference_temperature().fitted
    (25.0, False)
    """
    return Parameter(REFERENCE_TEMPERATURE, "degC", 25.0, meaning, neutral=25.0, fitted=False)


class Runs(Protocol):
    """What an effect may look at to say from which values it is to be tried: measured runs side by
    side (R, n), padded with weight 0."""

    @property
    def time_s(self) -> Array:
        """Times of the rows, each run from 0."""

    @property
    def envelope(self) -> Array:
        """Measured envelopes (R, n, 2)."""

    @property
    def weight(self) -> Array:
        """1/σ of one real of the envelopes, 0 where there is no row."""

    @property
    def reference_frequency_hz(self) -> float:
        """Frequency against which the envelopes stand."""

    @property
    def begun_s(self) -> Array | None:
        """How long after the first run each began (R,); None: not known."""

    @property
    def table_turn_rad(self) -> Array:
        """By how much the logged rates alone turn mθ back from the runs' starts on, K∫Ω dt with the
        usual K (R, n)."""


def nothing(*_: Any) -> None:
    """The fast term of an effect that has none at this place.

    Parameters
    ----------
    *_
        Whatever that place takes.

    Examples
    --------
    >>> from hrg_cli.effects.effect import nothing
    >>> nothing({}, "a plant")
    """


def same_state(_: Values, state: SlowState) -> SlowState:
    """The slow environment of an effect that does not change it.

    Parameters
    ----------
    _
        Values of its parameters.
    state
        What is logged.

    Returns
    -------
    SlowState
        The same.

    Examples
    --------
    >>> from hrg_cli.effects.effect import same_state
    >>> same_state({}, "as logged")
    'as logged'
    """
    return state


def size_no_order(_: Values, __: Mechanics) -> Mapping[str, float]:
    """The sizes of the next order of an effect that has none, or of which none is known.

    Parameters
    ----------
    _, __
        Values of its parameters, and the linear resonator.

    Returns
    -------
    dict
        Empty.

    Examples
    --------
    >>> from hrg_cli.effects.effect import size_no_order
    >>> size_no_order({"gain": 0.01}, None)
    {}
    """
    return {}


def no_term(_: Values, u: Array, __: SlowState) -> Array:
    """The slow term of an effect that has none.

    Parameters
    ----------
    _, __
        Values of its parameters, and the state.
    u
        Envelopes (..., 2).

    Returns
    -------
    ndarray
        Zeros (..., 2).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects.effect import no_term
    >>> no_term({}, np.array([1.0, 2.0]), None).tolist()
    [0.0, 0.0]
    """
    return np.zeros_like(u)


def same_signal(_: Values, u: Array, __: SlowState) -> Array:
    """The read-out of an effect that does not change it.

    Parameters
    ----------
    _, __
        Values of its parameters, and the state.
    u
        Envelopes (..., 2).

    Returns
    -------
    ndarray
        The same.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects.effect import same_signal
    >>> same_signal({}, np.array([1.0, 2.0]), None).tolist()
    [1.0, 2.0]
    """
    return u


def only_neutral(_: Runs) -> Sequence[Values]:
    """The starts of an effect that is tried from its neutral values.

    Parameters
    ----------
    _
        The measured runs.

    Returns
    -------
    tuple of dict
        One start, at which no parameter is given.

    Examples
    --------
    >>> from hrg_cli.effects.effect import only_neutral
    >>> only_neutral(None)
    ({},)
    """
    return ({},)


@dataclass(frozen=True)
class Effect:
    """An effect of the catalogue: its page, its terms, and what others need to know of it.

    A term takes `p`, the value of every parameter by name; with all at their neutral values it
    changes nothing. u: envelopes (..., 2) in the amplitude's unit, over any leading shape; a
    state's arrays have that leading shape.

    Attributes
    ----------
    name
        In files and commands.
    family
        "read-out", "resonator", "control" or "bench".
    page
        Its module's docstring, which `hrg effects NAME` prints.
    parameters
        In the order in which they are told.
    mistaken_for
        Effects that look alike.
    next_experiment
        That separates it from these, in words.
    environment
        `environment(p, env)`: changes the simulated bench in place, its temperature [°C] and rate
        [rad/s] and what is logged of them.
    plant
        `plant(p, plant, env)`: changes the simulated resonator in place, its matrices, forces and
        kicks.
    control
        `control(p, control)`: changes the simulated loops in place.
    readout
        `readout(p, readout)`: adds steps to the simulated read-out, each of samples (channels, n),
        block by block: the two of a gyro, or one for each of many amplitudes where a diagnosis asks
        what harmonics it makes. What a step remembers has a place for each channel.
    slow_environment
        `slow_environment(p, state) -> state`: true temperature and rate from the logged ones.
    slow
        `slow(p, u, state) -> (..., 2)`: what it adds to du/dt [amplitude/s].
    slow_rate
        `slow_rate(p, u, state) -> (..., 2)`: d/dt of that where u stands and a spring moves.
    slow_readout
        `slow_readout(p, u, state) -> (..., 2)`: what is read of u.
    slow_jump
        `slow_jump(p, state) -> (time_s, (..., 2))`: the jump of u at an instant.
    seen_in
        "dynamics" where the motion of the envelopes shows it, "waveform" where only the samples do.
    coherent
        Its vector stands with the wave's phase φ, so that its sign is nobody's to know: (mθ, φ) and
        (mθ + π, φ + π) are one wave.
    same_as_base
        What of the base model it cannot be told from in any run, in words; empty: nothing.
    in_the_log
        The logged command (field of the runs) that holds all it does, beside which it is no
        candidate; empty: none.
    shown_by
        What a programme of runs must hold for it to show.
    needs
        What the runs at hand must hold; without it a fit could give the effect any size.
    beside
        The effect that must stand beside it for it to do anything, as a thermometer's lag needs
        something that follows temperature.
    bends
        The effect whose slope it bends: about another reference its bend is a bend and a slope, so
        that what neither does alone is asked of both together.
    part_of
        Effects of which it is a part: while the misfit is gross one of them must stand first, or it
        must take the misfit away itself.
    whole_samples
        Its size comes in samples only, so that it has no small one.
    makes_harmonics
        A read-out that puts multiples of the oscillation into the samples.
    makes_tone
        It puts a line of its own there.
    scales
        The resonator's parameter that follows the temperature by it.
    same_as_parameter
        The one that it changes, exactly, in every run.
    acts_on
        "velocity" where its force follows the motion's velocity, whose envelopes turn beside those
        of the displacement by KΩ/ω, so that its slow term is given these.
    nonlinear_force
        Its force is no linear one of the motion, so that to second order it changes with what
        split, damping and rate do to that.
    size_next_order
        `size_next_order(p, mechanics) -> sizes`: how large its parameters of higher order are likely
        to be beside its others, by their names. What grows by the part δ of a value D a unit of x is
        D exp(δx/D) as well as D + δx (`size_bend`).
    starts
        `starts(runs) -> values`: from which it is tried beside these runs, as instants at which a
        parameter that is not fitted is held, or levels of one that sets in.

    Examples
    --------
    A gain mismatch of 1 % reads a line at 45° as one that leans towards C:

    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> effect = find("gain_mismatch")
    >>> effect.slow_readout(effect.values({"gain": 0.01}), np.array([1.0, 1.0]), None).tolist()
    [1.005, 0.995]
    """

    name: str
    family: str
    page: str
    parameters: tuple[Parameter, ...]
    mistaken_for: tuple[str, ...] = ()
    next_experiment: str = ""
    environment: Callable[[Values, Environment], None] = nothing
    plant: Callable[[Values, Plant, Environment], None] = nothing
    control: Callable[[Values, Control], None] = nothing
    readout: Callable[[Values, Readout], None] = nothing
    slow_environment: Callable[[Values, SlowState], SlowState] = same_state
    slow: Callable[[Values, Array, SlowState], Array] = no_term
    slow_rate: Callable[[Values, Array, SlowState], Array] = no_term
    slow_readout: Callable[[Values, Array, SlowState], Array] = same_signal
    slow_jump: Callable[[Values, SlowState], tuple[float, Array]] | None = None
    seen_in: Literal["dynamics", "waveform"] = "dynamics"
    coherent: bool = False
    same_as_base: str = ""
    in_the_log: str = ""
    shown_by: tuple[Condition, ...] = ()
    needs: tuple[Need, ...] = ()
    beside: str = ""
    bends: str = ""
    part_of: tuple[str, ...] = ()
    whole_samples: bool = False
    makes_harmonics: bool = False
    makes_tone: bool = False
    scales: str = ""
    same_as_parameter: str = ""
    acts_on: Literal["displacement", "velocity"] = "displacement"
    nonlinear_force: bool = False
    size_next_order: Callable[[Values, Mechanics], Mapping[str, float]] = size_no_order
    starts: Callable[[Runs], Sequence[Values]] = only_neutral

    def values(self, given: Mapping[str, Any] | None = None) -> dict[str, float]:
        """Every parameter's value: as given, else neutral.

        Parameters
        ----------
        given
            Values by name, in the parameters' units.

        Returns
        -------
        dict
            Of all parameters.

        Raises
        ------
        HrgError
            An unknown name, or something that is not a finite number.

        Examples
        --------
        >>> from hrg_cli.effects import find
        >>> find("gain_mismatch").values({"gain": 0.01})
        {'gain': 0.01}
        """
        given = dict(given or {})
        known = [p.name for p in self.parameters]
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise HrgError(
                f"effects.{self.name}: unknown parameter {name_some(unknown)}; it has"
                f" {', '.join(known)}"
            )
        for name, value in given.items():
            if (
                isinstance(value, bool)
                or not isinstance(value, int | float)
                or not np.isfinite(value)
            ):
                raise HrgError(
                    f"effects.{self.name}.{name} = {value!r}: a finite number was expected"
                )
        return {p.name: float(given.get(p.name, p.neutral)) for p in self.parameters}

    def fitted(self) -> tuple[Parameter, ...]:
        """The parameters a fit may move.

        Returns
        -------
        tuple of Parameter
            Without those that say where others count from.

        Examples
        --------
        >>> from hrg_cli.effects import find
        >>> [parameter.name for parameter in find("gain_temperature").fitted()]
        ['relative_1_k']
        """
        return tuple(p for p in self.parameters if p.fitted)

    @property
    def needs_one_sign(self) -> bool:
        """Whether physics forbids a fitted parameter the values on one side of its neutral one."""
        return any(p.minimum >= p.neutral for p in self.fitted())

    @property
    def makes_lines(self) -> bool:
        """Whether it puts lines into the spectrum of the samples, beside the oscillation."""
        return self.makes_harmonics or self.makes_tone

    @property
    def follows_temperature(self) -> bool:
        """Whether it counts from a reference temperature: an error of the thermometer shows through
        such effects only."""
        return any(p.name == REFERENCE_TEMPERATURE for p in self.parameters)

    @property
    def of_one_run(self) -> bool:
        """Whether it happens in one run of several, named by its parameter `run`."""
        return any(p.name == RUN for p in self.parameters)

    @property
    def strikes(self) -> bool:
        """Whether it happens at an instant of one run and may do so by any small amount."""
        named = {p.name for p in self.parameters}
        return {INSTANT, RUN} <= named and not (self.whole_samples or self.sets_in)

    @property
    def sets_in(self) -> bool:
        """Whether a fitted parameter does nothing at all up to a level, so that the effect has no
        small size that grows in proportion."""
        return any(p.sets_in for p in self.fitted())


def size_bend(slope: float, value: float) -> float:
    """How far a law of this slope may bend: δ²/2D, by which D exp(δx/D) and D + δx part in x².

    Parameters
    ----------
    slope
        δ, the size of a change a unit of x.
    value
        D, the size of what changes.

    Returns
    -------
    float
        In the value's unit per square of x's; infinite of a value of zero.

    Examples
    --------
    >>> from hrg_cli.effects.effect import size_bend
    >>> size_bend(0.01, 0.1), size_bend(0.01, 0.0)
    (0.0005, inf)
    """
    return slope**2 / (2 * abs(value)) if value else float("inf")


def find_invariants(u: Array) -> tuple[Array, Array]:
    """u†u and uᵀu (..., 1), of which every isotropic force is made.

    Parameters
    ----------
    u
        Envelopes (..., 2).

    Returns
    -------
    tuple of ndarray
        Real and complex (..., 1), in squares of the amplitude's unit.

    Examples
    --------
    Of a circular wave the second vanishes:

    >>> import numpy as np
    >>> from hrg_cli.effects.effect import find_invariants
    >>> [value.item() for value in find_invariants(np.array([1.0, 1j]))]
    [2.0, 0j]
    """
    return np.sum(np.abs(u) ** 2, axis=-1, keepdims=True), np.sum(u**2, axis=-1, keepdims=True)


def find_displacement(u: Array, state: SlowState | None) -> Array:
    """The displacement's envelopes beside those that an effect which acts on the velocity is given.

    Parameters
    ----------
    u
        Envelopes (..., 2) that its slow term is given.
    state
        That holds the displacement's, where they differ; None: they do not.

    Returns
    -------
    ndarray
        (..., 2).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects.effect import find_displacement
    >>> find_displacement(np.array([1.0, 0.0]), None).tolist()
    [1.0, 0.0]
    """
    return u if state is None or state.displacement is None else state.displacement


def find_frame(u: Array, phase_rad: Array | float) -> tuple[Array, Array, Array, Array]:
    """(e^{jφ}, e_A, e_B, a_A) of envelopes u, φ taken within ±π/2 of a phase that is about known.

    e_A = (cos mθ, sin mθ), e_B = (−sin mθ, cos mθ), e_A·u = a_A e^{jφ}.

    Parameters
    ----------
    u
        (..., 2) complex.
    phase_rad
        (...) or one [rad]: (mθ, φ) and (mθ + π, φ + π) are the same wave.

    Returns
    -------
    tuple of ndarray
        Complex (...), real (..., 2) twice, and real (...) in the amplitude's unit.

    Examples
    --------
    A line at mθ = 90°:

    >>> import numpy as np
    >>> from hrg_cli.effects.effect import find_frame
    >>> turn, e_A, e_B, a_A = find_frame(np.array([0.0, 2.0]), 0.0)
    >>> e_A.round(9).tolist(), float(a_A), complex(turn.round(9))
    ([0.0, 1.0], 2.0, (1+0j))
    >>> find_frame(np.array([0.0, 2.0]), np.pi)[1].round(9).tolist()
    [-0.0, -1.0]
    """
    return find_frame_about(u, np.exp(1j * np.asarray(phase_rad)))


def find_frame_about(u: Array, known: Array) -> tuple[Array, Array, Array, Array]:
    """The same about a phase that is known as e^{jφ}.

    cos 2mθ and sin 2mθ are (|C|² − |S|², 2 Re CS*) over their size, and half angles are roots.

    Parameters
    ----------
    u
        (..., 2) complex.
    known
        (...) complex, e^{jφ}.

    Returns
    -------
    tuple of ndarray
        As of `find_frame`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects.effect import find_frame_about
    >>> find_frame_about(np.array([0.0, 2.0]), np.array(-1.0))[1].round(9).tolist()
    [-0.0, -1.0]
    """
    c, s = u[..., 0], u[..., 1]
    less = c.real**2 + c.imag**2 - s.real**2 - s.imag**2
    cross = 2 * (c.real * s.real + c.imag * s.imag)
    size = np.sqrt(less**2 + cross**2)
    # the larger of cosine and sine by a sum, the other by it: neither is a small difference
    scale = np.where(size > 0, size, 1.0)
    larger = np.sqrt(np.where(size > 0, (1 + np.abs(less) / scale) / 2, 1.0))
    smaller = np.abs(cross) / (2 * scale * larger)
    along_c = less >= 0
    cos = np.where(along_c, larger, smaller)
    sin = np.copysign(np.where(along_c, smaller, larger), cross)
    main = cos * c + sin * s
    sign = np.where(main.real * known.real + main.imag * known.imag < 0, -1.0, 1.0)
    a_A = np.abs(main)
    cos, sin, turn = cos * sign, sin * sign, main * (sign / np.where(a_A > 0, a_A, 1.0))
    e_A, e_B = np.empty((*cos.shape, 2)), np.empty((*cos.shape, 2))
    e_A[..., 0] = e_B[..., 1] = cos
    e_A[..., 1] = sin
    e_B[..., 0] = -sin
    return turn, e_A, e_B, a_A


def follow_phase(w: Array, last: list[Array]) -> Array:
    """Phase φ + ωt of analytic signals a sample apart, continuous from block to block.

    (mθ, φ) and (mθ + π, φ + π) are one wave, so the phase is continued by its mean advance, which
    may be most of half a turn per sample.

    Parameters
    ----------
    w
        (n, 2) complex, of both channels.
    last
        Signal and phase of the block before, empty at the first; it is renewed.

    Returns
    -------
    ndarray
        (n,) [rad].

    Examples
    --------
    Two blocks of eight samples at 1 rad per sample:

    >>> import numpy as np
    >>> from hrg_cli.effects.effect import follow_phase
    >>> w, last = np.exp(1j * np.arange(16))[:, None] * [1.0, 0.0], []
    >>> phase = np.concatenate([follow_phase(w[:8], last), follow_phase(w[8:], last)])
    >>> np.diff(phase).round(9).tolist() == [1.0] * 15
    True
    """
    whole = np.concatenate([last[0], w]) if last else w
    phase = ellipse.find_wave(whole, 1)[3]
    advance = np.angle(np.sum(np.conj(whole[:-1]) * whole[1:])) * np.arange(len(whole))
    phase = np.unwrap(phase - advance, period=np.pi) + advance
    if last:
        phase = phase[1:] + np.pi * np.round((last[1][0] - phase[0]) / np.pi)
    last[:] = [w[-1:], phase[-1:]]
    return phase


def project(vector: Array, direction: Array) -> Array:
    """Component of a complex vector along a real unit vector, without conjugation.

    Parameters
    ----------
    vector
        (..., 2) complex.
    direction
        (..., 2) real.

    Returns
    -------
    ndarray
        (..., 1).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects.effect import project
    >>> project(np.array([1j, 2.0]), np.array([1.0, 0.0])).tolist()
    [1j]
    """
    return np.sum(vector * direction, axis=-1, keepdims=True)


def find_branch(temperature: Array) -> Array:
    """Sign of the last temperature change of a series; rounding is no change.

    Parameters
    ----------
    temperature
        (n,), in any unit.

    Returns
    -------
    ndarray
        (n,): +1 rising, −1 falling, 0 before any change.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects.effect import find_branch
    >>> find_branch(np.array([20.0, 20.0, 21.0, 21.0, 20.5])).tolist()
    [0.0, 0.0, 1.0, 1.0, -1.0]
    """
    steps = np.diff(temperature)
    steps = np.where(np.abs(steps) > ROUNDING * np.ptp(temperature), steps, 0.0)
    sign = np.sign(np.concatenate([steps[:1], steps]))
    last = np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), 0))
    return sign[last]
