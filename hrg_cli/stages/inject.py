"""inject: effects of the catalogue hidden in a recording, measured or simulated, to see whether a
diagnosis finds them there.

Of the read-out an effect acts on the samples themselves, by its own fast term; what it needs to
know of the oscillation (its quadrature, its phase) is the demodulated envelope's, at the
recording's own frequency, and displacements count from each channel's mean position. Of the motion
an effect acts through the slow model of the identified resonator, integrated along the run with and
without the effect from the same start: u₁ = T u₀, T (2, 2) complex as a function of time, by which
the analytic signal of the samples is multiplied. So noise, harmonics and all that the model does
not know stay as they were measured. What an effect does to the logs, it does to the recording's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from .. import effects as catalogue
from ..effects.effect import Effect, nothing
from ..errors import HrgError
from ..physics.plant import Environment, Readout
from ..records import Recording, Resonator, collect
from ..settings import parse_toml
from .demodulate import demodulate
from .estimate import estimate
from .injection.motion import Hidden, integrate_change
from .injection.nothing_done import explain_nothing
from .injection.samples import Injection

Array = np.ndarray


def inject(
    recording: Recording,
    resonator: Resonator | None = None,
    extra_effects: Sequence[Effect] = (),
    *,
    effects: Annotated[
        dict[str, dict[str, float]], Field(description="effects to hide, each with its parameters")
    ] = {},  # noqa: B006
    periods_per_window: Annotated[
        float, Field(gt=0, description="oscillation periods per window of the envelope")
    ] = 4.0,
    block_samples: Annotated[
        int, Field(ge=1, description="samples worked on at once; they do not depend on it")
    ] = 1 << 20,
) -> Iterator[Recording]:
    """The recording with effects hidden in it, as a stream of blocks; memory does not grow with the
    samples.

    A read-out effect acts on the samples by its own fast term; one of the motion multiplies their
    analytic signal by T(t), u₁ = T u₀: the slow model u' = L u (PHYSICS §0) integrated along the
    run with and without it, from one start.

    Parameters
    ----------
    recording
        Samples (n,) of both channels of a direct read-out; it may be open on disk.
    resonator
        That of the motion; fitted to this run where it is not given.
    extra_effects
        `Effect` objects beside the catalogue's.

    Returns
    -------
    Iterator[Recording]
        Blocks of samples (n,) in the recording's own number format; `collect` joins them.

    Raises
    ------
    HrgError
        No effect, an unknown effect or parameter, one that is missing, values that do nothing in
        this recording, a read-out by carrier, no temperature log for what follows it.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect
    >>> from hrg_cli.stages.inject import inject
    >>> t = np.arange(8000) / 8000
    >>> c = np.cos(2 * np.pi * 1000 * t)
    >>> recording = Recording(c=c, s=0.1 * c, sample_rate_hz=8000.0, mode="free")
    >>> hidden = collect(inject(recording, effects={"gain_mismatch": {"gain": 0.01}}))
    >>> print(
    ...     (hidden.c[::2000] / c[::2000]).round(4), (hidden.s[::2000] / 0.1 / c[::2000]).round(4)
    ... )
    [1.005 1.005 1.005 1.005] [0.995 0.995 0.995 0.995]
    """
    name = f"run {recording.run_id}" if recording.run_id else "the recording"
    hidden = _choose_effects(effects, extra_effects)
    if recording.readout != "direct":
        raise HrgError(
            f"{name}: its read-out is {recording.readout}, samples of a direct read-out were"
            " expected; demodulate the carrier first"
        )
    warm = [e.name for e, _ in hidden if e.follows_temperature or "temperature cycle" in e.shown_by]
    if warm and recording.temperature_degc is None:
        raise HrgError(
            f"{name}: has no temperature log, {', '.join(warm)} need{'s' * (len(warm) == 1)} one;"
            " add it at the import"
        )
    # The envelope of the samples as measured: an effect acts on what is there, not on a model of
    # it.
    wave = collect(estimate(collect(demodulate(recording, periods_per_window=periods_per_window))))
    moving = [(effect, p) for effect, p in hidden if _moves_wave(effect)]
    change = integrate_change(wave, moving, resonator) if moving else None
    pickoff = Readout()
    for effect, p in hidden:
        effect.readout(p, pickoff)
    return Injection(
        recording,
        wave,
        change,
        pickoff,
        _change_logs(recording, hidden),
        bool(moving),
        name,
        explain_nothing(recording, hidden, change),
    ).make_blocks(block_samples)


def summarise(record: Recording) -> dict[str, Any]:
    """What was hidden in a recording, for the JSON.

    Parameters
    ----------
    record
        Made by `inject`.

    Returns
    -------
    dict
        The run, its samples, and effect -> parameters.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect
    >>> from hrg_cli.stages.inject import inject, summarise
    >>> c = np.cos(np.pi / 4 * np.arange(8000))
    >>> recording = Recording(c=c, s=0.1 * c, sample_rate_hz=8000.0, mode="free", run_id="still")
    >>> summarise(collect(inject(recording, effects={"gain_mismatch": {"gain": 0.01}})))["samples"]
    8000
    """
    settings = (
        parse_toml(record.provenance.settings).get("inject", {})
        if record.provenance.settings
        else {}
    )
    return {
        "run_id": record.run_id,
        "gyro_id": record.gyro_id,
        "samples": len(record),
        "effects": settings.get("effects", {}),
    }


def _choose_effects(
    effects: Mapping[str, Mapping[str, float]], extra_effects: Sequence[Effect]
) -> list[Hidden]:
    """The effects with all their parameters; one that is given nothing but neutral values, or not
    what it cannot do without, is a mistake."""
    if not effects:
        raise HrgError(
            "no effect is named; `hrg effects` lists them, add --effect NAME --set PARAMETER=VALUE"
        )
    hidden = []
    for name, given in effects.items():
        effect = catalogue.find(name, (*extra_effects, *catalogue.EFFECTS))
        values = effect.values(given)
        if all(
            values[p.name] == p.neutral
            for p in effect.parameters
            if p.fitted or p.name not in given
        ):
            sizes = effect.fitted() or effect.parameters
            own = ", ".join(f"{p.name} [{p.units}]" for p in sizes)
            raise HrgError(f"effects.{name}: does nothing with the values given; set one of {own}")
        missing = [p for p in effect.parameters if p.required and p.name not in given]
        if missing:
            own = ", ".join(f"{p.name} [{p.units}], the {p.meaning}" for p in missing)
            raise HrgError(f"effects.{name}: {own}, is missing; set it")
        beyond = [p for p in effect.parameters if values[p.name] < p.minimum]
        if beyond:
            own = ", ".join(f"{p.name} = {values[p.name]:g}" for p in beyond)
            raise HrgError(
                f"effects.{name}: {own}, no such cause has less than {beyond[0].minimum:g}; set its"
                " size with the other sign"
            )
        hidden.append((effect, values))
    return hidden


def _moves_wave(effect: Effect) -> bool:
    """Whether it acts on the motion: it has a term there, or no fast term at all, so that its slow
    terms say all of it."""
    on_motion = any(
        term is not nothing for term in (effect.environment, effect.plant, effect.control)
    )
    return on_motion or effect.readout is nothing


def _change_logs(recording: Recording, hidden: Sequence[Hidden]) -> dict[str, Array]:
    """The logs as the effects leave them."""
    t = recording.auxiliary_time_s
    if t is None or len(t) < 2:
        return {}
    t = np.asarray(t, float)
    logs = {
        name: None if (log := getattr(recording, name)) is None else np.asarray(log, float)
        for name in ("temperature_degc", "rate_rad_s")
    }
    T, rate = (np.zeros(len(t)) if log is None else log for log in logs.values())
    world = Environment(t, T.copy(), rate.copy(), T.copy(), rate.copy())
    for effect, p in hidden:
        effect.environment(p, world)
    made = {
        "temperature_degc": world.logged_temperature_degc,
        "rate_rad_s": world.logged_rate_rad_s,
    }
    return {
        name: made[name]
        for name, log in logs.items()
        if log is not None and np.any(made[name] != log)
    }
