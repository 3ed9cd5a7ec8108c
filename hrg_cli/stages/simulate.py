"""simulate: from a simulation file's tables to a recording, by the second-order equations (fast) or
the envelopes (slow)."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from .. import effects as catalogue
from ..effects.effect import no_term, same_signal, same_state
from ..errors import HrgError, name_some
from ..extras import warn_of_plain_python
from ..physics import fast_engine, slow_engine, slow_motion
from ..physics.plant import Block, Environment, Plant, Readout, make_linear_plant
from ..physics.slow_engine import EnvelopePath
from ..records import Recording
from .simulation.blocks import record_blocks
from .simulation.simulated_gyro import (
    add_spring,
    make_control,
    make_courses,
    make_electronics,
    make_mechanics,
    make_noise,
    make_readout,
    make_start,
)
from .simulation.world import make_environment
from .simulation_file import SimulationFile, list_runs

Array = np.ndarray
Active = Sequence[tuple[Any, dict[str, Any]]]
"""Effects with their parameters' values, in the file's order."""


def simulate(
    config: Mapping[str, Any],
    extra_effects: Sequence[Any] = (),
    *,
    model: Annotated[
        Literal["fast", "slow"], Field(description="fast: second-order equations; slow: envelopes")
    ] = "fast",
    run: Annotated[
        str | None,
        Field(description="simulate this run of the file alone, by its run_id"),
    ] = None,
    seed: Annotated[
        int, Field(ge=0, description="seed of the noise; each run has its own stream")
    ] = 0,
    block_samples: Annotated[
        int, Field(ge=1, description="samples per block of the stream; they do not depend on it")
    ] = 1_000_000,
) -> Iterator[Recording]:
    """One run of a simulation file as a stream of recording blocks.

    The fast model integrates z'' + 2(N − KΩJ)z' + Wz = drive (PHYSICS §0) with exact propagators
    between the samples; the slow model integrates the envelopes. Memory does not grow with the
    run's length.

    Parameters
    ----------
    config
        The file's tables, e.g. from `settings.load_toml`; all frequencies in Hz, times in s, angles
        in rad.
    extra_effects
        `Effect` objects beside the catalogue's.

    Returns
    -------
    Iterator[Recording]
        Blocks of samples (n,) of both channels, with the truth; `collect` joins them.

    Raises
    ------
    HrgError
        A wrong file, an unknown run.

    Examples
    --------
    >>> from hrg_cli import collect, simulate
    >>> config = {
    ...     "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
    ...     "recording": {"sample_rate_hz": 8000.0, "duration_s": 0.5},
    ... }
    >>> recording = collect(simulate(config, model="slow"))
    >>> len(recording), recording.sample_rate_hz
    (4000, 8000.0)
    """
    runs = {settings.run_id: settings for settings in list_runs(config)}
    if run is None and len(runs) > 1:
        raise HrgError(
            f"simulation: holds {len(runs)} runs; choose one by --run, e.g. --run"
            f" {next(iter(runs))}, or simulate them all"
        )
    if run is not None and run not in runs:
        raise HrgError(f"simulation: there is no run {run}; it has {name_some(runs)}")
    settings = next(iter(runs.values())) if run is None else runs[run]
    return simulate_run(
        settings, extra_effects, model=model, seed=seed, block_samples=block_samples
    )


def list_run_ids(config: Mapping[str, Any]) -> list[str]:
    """The runs of a simulation file, in its order; the whole file is checked.

    Parameters
    ----------
    config
        The file's tables.

    Returns
    -------
    list of str
        Runs without a name are numbered.

    Examples
    --------
    >>> from hrg_cli.stages.simulate import list_run_ids
    >>> config = {
    ...     "device": {"frequency_hz": 5000.0, "quality_factor": 1e6},
    ...     "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ...     "run": [{"run_id": "still"}, {"environment": {"rate_rad_s": 1.0}}],
    ... }
    >>> list_run_ids(config)
    ['still', 'run2']
    """
    return [settings.run_id for settings in list_runs(config)]


def compute_size_bytes(settings: SimulationFile) -> int:
    """Bytes of a run's samples of both channels, before they are compressed.

    Parameters
    ----------
    settings
        The run.

    Returns
    -------
    int
        Two bytes a sample up to 16 bits of the converter, four above.

    Examples
    --------
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> from hrg_cli.stages.simulate import compute_size_bytes
    >>> base = {
    ...     "device": {"frequency_hz": 5000.0, "quality_factor": 1e6},
    ...     "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ... }
    >>> (run,) = list_runs(base | {"readout": {"adc_bits": 16}})
    >>> compute_size_bytes(run)
    240000
    """
    bits = settings.readout.adc_bits
    each = np.dtype(settings.recording.samples).itemsize if bits == 0 else 2 if bits <= 16 else 4
    return 2 * each * _count(settings)


def summarise(record: Recording) -> dict[str, Any]:
    """What a simulated recording says of itself, for the JSON.

    Parameters
    ----------
    record
        Made by `simulate`.

    Returns
    -------
    dict
        Run, gyro, mode, read-out, sampling rate [Hz] and mode number.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.stages.simulate import summarise
    >>> made = Recording(c=np.zeros(8), s=np.zeros(8), sample_rate_hz=8000.0, mode="free")
    >>> summarise(made)["sample_rate_hz"], summarise(made)["readout"]
    (8000.0, 'direct')
    """
    return {
        name: getattr(record, name)
        for name in (
            "run_id",
            "gyro_id",
            "mode",
            "readout",
            "carrier_hz",
            "sample_rate_hz",
            "mode_number",
        )
    }


def simulate_run(
    settings: SimulationFile,
    extra_effects: Sequence[Any] = (),
    *,
    model: str = "fast",
    seed: int = 0,
    block_samples: int = 1_000_000,
    followed: list[EnvelopePath] | None = None,
) -> Iterator[Recording]:
    """One checked run as a stream of recording blocks.

    Parameters
    ----------
    settings
        The run.
    extra_effects
        Effects beside the catalogue's that its tables may name.
    model
        "fast": sample by sample; "slow": by the envelopes' equations, as a device whose `equation`
        is averaged always is.
    seed
        Of the noise; each run of a file has noise of its own.
    block_samples
        Samples (n,) in a block.
    followed
        Of the slow model: the motion's paths, kept by the caller for the same run with other noise;
        an empty list is filled with them.

    Returns
    -------
    iterator of Recording
        The blocks.

    Raises
    ------
    HrgError
        An effect that is not known, or whose values are wrong.

    Examples
    --------
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> from hrg_cli.stages.simulate import simulate_run
    >>> (run,) = list_runs(
    ...     {
    ...         "device": {"frequency_hz": 1000.0, "quality_factor": 1e5},
    ...         "recording": {"sample_rate_hz": 8000.0, "duration_s": 0.5},
    ...     }
    ... )
    >>> [len(block) for block in simulate_run(run, model="slow", block_samples=3000)]
    [3000, 1000]
    """
    active = _active(settings, extra_effects)
    run_number = zlib.crc32(settings.run_id.encode())
    # A generator would report a wrong environment or effect only when its first block is asked for.
    if model == "fast" and not settings.device.averaged:
        made, pickoff, logged = _fast(
            settings, active, np.random.default_rng([seed, run_number, 1])
        )
    else:
        made, pickoff, logged = _slow(settings, active, followed)
    return record_blocks(
        settings, made, pickoff, logged, np.random.default_rng([seed, run_number]), block_samples
    )


def _active(settings: SimulationFile, extra_effects: Sequence[Any]) -> Active:
    known = (*extra_effects, *catalogue.EFFECTS)
    found = [(catalogue.find(name, known), given) for name, given in settings.effects.items()]
    return [
        (effect, effect.values(given) if hasattr(effect, "values") else dict(given))
        for effect, given in found
    ]


def _fast(
    settings: SimulationFile, active: Active, random: np.random.Generator
) -> tuple[Iterator[Block], Readout, Environment]:
    mechanics, courses, control, pickoff = (
        make_mechanics(settings),
        make_courses(settings),
        make_control(settings),
        make_readout(settings),
    )
    world = make_environment(settings, bool(active))
    for effect, p in active:
        _call(effect, "environment", p, world)
    plant = add_spring(settings, make_linear_plant(mechanics, courses, world))
    for effect, p in active:
        _call(effect, "plant", p, plant, world)
        _call(effect, "control", p, control)
        _call(effect, "readout", p, pickoff)
    step = (1 + pickoff.clock_error) / settings.recording.sample_rate_hz
    start, angle = make_start(settings)
    warn_of_plain_python()
    made = fast_engine.run(
        world, plant, control, start, step, _count(settings), angle,
        electronics=make_electronics(settings, pickoff), noise=make_noise(settings, pickoff),
        random=random,
    )  # fmt: skip
    return made, pickoff, world


def _slow_terms(active: Active) -> slow_motion.SlowTerms:
    """The terms that the active effects have in the slow model; most have one or two of the
    four."""

    def of(name: str, none: Any) -> list[Any]:
        return [
            partial(getattr(effect, name), p)
            for effect, p in active
            if getattr(effect, name, none) is not none
        ]

    return slow_motion.SlowTerms(
        of("slow_environment", same_state),
        of("slow", no_term),
        of("slow_readout", same_signal),
        of("slow_jump", None),
    )


def _slow_worlds(settings: SimulationFile, active: Active) -> tuple[Environment, Environment]:
    """The world that the slow terms start from, and the one that is logged."""
    world, logged = (
        make_environment(settings, bool(active)),
        make_environment(settings, bool(active)),
    )
    for effect, p in active:
        _call(effect, "environment", p, logged)
        if (
            getattr(effect, "slow_environment", same_state) is same_state
            and getattr(effect, "slow", no_term) is no_term
        ):
            _call(effect, "environment", p, world)
    # slow terms tell what is true from what is logged, so they start from the log
    world.temperature_degc = (
        world.temperature_degc + logged.logged_temperature_degc - world.logged_temperature_degc
    )
    world.rate_rad_s = world.rate_rad_s + logged.logged_rate_rad_s - world.logged_rate_rad_s
    return world, logged


def _slow(
    settings: SimulationFile, active: Active, followed: list[EnvelopePath] | None
) -> tuple[Iterator[Block], Readout, Environment]:
    mechanics, courses, pickoff = (
        make_mechanics(settings),
        make_courses(settings),
        make_readout(settings),
    )
    if settings.electronics is not None or not make_noise(settings, pickoff).silent:
        raise HrgError(
            "simulation: [electronics] and [noise] act on samples; simulate with --model fast, and"
            ' a device whose equation is "resonator"'
        )
    world, logged = _slow_worlds(settings, active)
    terms = _slow_terms(active)
    step = (1 + pickoff.clock_error) / settings.recording.sample_rate_hz

    def plant_at(world: Environment) -> Plant:
        return add_spring(settings, make_linear_plant(mechanics, courses, world))

    start, angle = make_start(settings)
    return (
        slow_engine.run(
            world,
            plant_at,
            make_control(settings),
            terms,
            start,
            step,
            _count(settings),
            angle,
            averaged=settings.device.averaged,
            followed=followed,
        ),
        pickoff,
        logged,
    )


def _call(effect: Any, place: str, *arguments: Any) -> None:
    if hasattr(effect, place):
        getattr(effect, place)(*arguments)


def _count(settings: SimulationFile) -> int:
    return max(1, round(settings.recording.duration_s * settings.recording.sample_rate_hz))
