"""`hrg diagnose`: the model that the user believes, effects of the user's own, the
extended model beside the output."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from .. import pipeline, settings, store
from ..effects import load_effects
from ..errors import HrgError
from ..extended import find_extended_paths as beside_it
from ..extended import write_extended
from ..physics.resonator import PARAMETERS
from ..records import Diagnosis, Resonator, Wave
from ..reporting import console, tables
from ..reporting.answer import answer
from ..stages.diagnose import diagnose
from ..stages.simulation.simulated_gyro import make_courses, make_mechanics
from ..stages.simulation_file import list_runs
from .common import Common
from .frame import (
    NO_DRAWS,
    ONE_PROCESS,
    EffectsFrom,
    Files,
    make_command,
    need_inputs,
    read_command_line,
)
from .options import make_flags


@make_command(
    "diagnose",
    "hrg diagnose wave-*.h5 -o diagnosis.h5 --model resonator.h5",
    flags=make_flags(diagnose, "scale_factor", "free_phase"),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(
    run: Common,
    /,
    waves: Files = None,
    model: Annotated[
        Path | None,
        typer.Option(
            help="What you believe: a resonator file or a simulation's TOML.", show_default=False
        ),
    ] = None,
    effects_from: EffectsFrom = None,
    **flags: Any,
) -> None:
    """What the simulation gets wrong: the cause, its size, the extended model
    (OUTPUT.extended.toml) and the gain."""
    with console.show_progress("diagnose", run.quiet or run.json) as progress:
        outcome = _diagnose_files(waves or [], run, model, effects_from, flags, progress)
    run.finish(outcome.json, lambda: tables.show(outcome.record, outcome.json))


def _diagnose_files(
    waves: Sequence[Path],
    run: Common,
    model: Path | None,
    effects_from: Path | None,
    flags: dict[str, Any],
    progress: pipeline.Progress,
) -> pipeline.Outcome:
    """Diagnose wave files; writes the diagnosis and, beside it, the extended model as TOML and its
    resonator."""
    values = run.resolve_settings(diagnose, **flags)
    waves = need_inputs(waves, "wave files")
    output = run.need_output("diagnosis.h5")
    extended, resonator = beside_it(output)
    for path in (extended, resonator):
        store.check_output(path, run.force)
        store.need_no_input(path, [model] if model else [])
    beside: dict[str, Path] = {}
    further: dict[str, Any] = (
        {"extra_effects": load_effects(effects_from)} if effects_from is not None else {}
    )
    if model is not None and model.suffix == ".toml":
        further["resonator"] = _read_believed(model, _average_temperature(waves))
    elif model is not None:
        beside["resonator"] = model
    with store.keep_whole_or_none([output, extended, resonator]):
        outcome = pipeline.run_stage(
            "diagnose",
            waves,
            output,
            values,
            beside=beside,
            further=further,
            force=run.force,
            command_line=read_command_line(),
            progress=progress,
        )
        assert isinstance(outcome.record, Diagnosis)
        written = write_extended(outcome.record, output, run.force)
    told = answer([outcome.record], (), {"diagnosis": output.name})
    more = {
        "extended_model": str(extended) if extended in written else None,
        "extended_resonator": str(resonator) if resonator in written else None,
        "answer": told.to_json() if told else None,
    }
    return pipeline.Outcome(outcome.record, outcome.json | more)


def _average_temperature(waves: Sequence[Path]) -> float | None:
    """Mean of the runs' logged temperatures in °C; None where none is logged."""
    means = []
    for path in waves:
        with store.open_record(path, Wave) as wave:
            if (
                wave.temperature_degc is not None
                and np.isfinite(logged := wave.temperature_degc[:]).any()
            ):
                means.append(float(np.nanmean(logged)))
    return float(np.mean(means)) if means else None


def _read_believed(file: Path, temperature_degc: float | None) -> Resonator:
    """The resonator of a simulation file at the runs' temperature, without errors: values the user
    holds for true."""
    settings_of_run = list_runs(settings.load_toml(file), str(file))[0]
    mechanics = make_mechanics(settings_of_run)
    if temperature_degc is not None:
        mechanics = make_courses(settings_of_run).make_mechanics(mechanics, temperature_degc)
    names = [name for name, _ in PARAMETERS]
    values = np.array([getattr(mechanics, name) for name in names])
    if not np.all(np.isfinite(values)):
        raise HrgError(f"{file}: its [device] has values that are not finite; correct them")
    return Resonator(
        name=np.array(names, dtype=object),
        value=values,
        std=np.zeros(len(names)),
        units=np.array([unit for _, unit in PARAMETERS], dtype=object),
        covariance=np.zeros((len(names), len(names))),
        method="simulation file",
        mode_number=mechanics.mode_number,
    )
