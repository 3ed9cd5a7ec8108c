"""The chain of one gyro, the same for `hrg run` and `hrg batch`: each recording to its wave, then
the waves to the gyro's results.

    recordings ── import, demodulate, estimate ──▶ waves ──┬ identify (free) ──▶ resonator
                                                           ├ diagnose (free, else forced) ──▶
                                                           diagnosis, extended model └ calibrate
                                                           (forced) ──▶ calibration ── compensate
                                                           ──▶ a file a forced run

Where it is asked for, the resonator and the calibration are rehearsed before anything is made of
them, so that what a rehearsal says of them is handed on.
Every step is told as a `Step`; one that fails ends its own branch and no other. What was done
before, unchanged, is not done again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import memory, pipeline, store
from .errors import DiskFullError, HrgError, UsageError
from .extended import find_extended_paths as extended_beside
from .extended import write_extended
from .records import Diagnosis, Record, Resonator, Wave

PER_RECORDING = ("demodulate", "estimate")
RESULTS = ("identify", "diagnose", "calibrate", "compensate")
"""Stages of a gyro's waves, in their order."""
REHEARSED = ("identify", "calibrate")
"""Those of them whose result is rehearsed where it is asked for."""
CommandLine = Callable[[str, Sequence[Path], Path], str]


@dataclass(frozen=True)
class Step:
    """One step of the chain: what it read and wrote, and how it ended ("valid", "suspect",
    "refused", "failed", "skipped")."""

    name: str
    inputs: tuple[str, ...]
    output: str
    status: str
    reasons: tuple[str, ...] = ()
    json: Mapping[str, Any] = field(default_factory=dict)
    checks: tuple[Mapping[str, Any], ...] = ()
    """Figures held against limits: {name, passed, sentence}."""


@dataclass(frozen=True)
class Work:
    """What both parts need: the gyro's folder, whole settings a stage, limits, what else decides
    whether work is the same as before."""

    folder: Path
    settings: Mapping[str, Mapping[str, Any]]
    limits: Mapping[str, Any] = field(default_factory=dict)
    same_if: Sequence[Any] = ()
    replace: bool = True
    """Replace outputs whatever they are; else only those that this chain made and nobody
    changed."""
    command_line: CommandLine | str = "hrg run"
    """The line of a step's history: the same for every step, or made for each."""
    rehearse: Mapping[str, Any] | None = None
    """Whole settings of the rehearsals of the resonator and the calibration; None: they are not
    rehearsed."""
    jobs: int = 1
    """Processes that share the rehearsals."""
    recordings: Sequence[Path] = ()
    """Where a rehearsal looks for the recordings, beside the gyro's folder."""


def _step_of_recording(
    work: Work, stage: str, read: Sequence[Path], output: Path, note: Path
) -> Step:
    """Import or a stage, and what it says; the last one tells whether the wave was free or
    driven."""
    record = (
        _import_logs(work, read, output, note)
        if stage == "import"
        else _run_noted_stage(work, stage, read, output, note).record
    )
    told = {"mode": str(getattr(record, "mode", "free"))} if stage == "estimate" else {}
    names = tuple(p.name for p in read)
    return Step(stage, names, output.name, record.status, record.status_reasons, told)


def recording_to_wave(
    work: Work, source: Path, name: str, logs: Sequence[Path] = (), identity: Sequence[Any] = ()
) -> Iterator[Step]:
    """Import a laboratory's logs, demodulate, estimate: NAME.periods.h5 and NAME.wave.h5.

    Parameters
    ----------
    work
        The gyro's folder, settings and limits.
    source
        The recording, or the log that is named.
    name
        NAME of the outputs.
    logs
        The files of a foreign log, first the one that is named; empty for an hrg recording.
    identity
        Gyro and lot, where they count.

    Returns
    -------
    iterator of Step
        As they are done; the mode of the wave is in the last one's JSON. A step that fails is told
        and ends them.

    Raises
    ------
    DiskFullError, UsageError
        What no further step could mend.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.chain import Work, recording_to_wave
    >>> with TemporaryDirectory() as folder:
    ...     steps = list(recording_to_wave(Work(Path(folder), {}), Path("nowhere.h5"), "run-1"))
    >>> [(step.name, step.status, step.reasons[0].split(";")[0]) for step in steps]
    [('demodulate', 'failed', 'nowhere.h5: no such file')]
    """
    note = work.folder / f"{name}.json"
    outputs = [work.folder / f"{name}.{kind}.h5" for kind in ("periods", "wave")]
    inputs = list(logs) or [source]
    steps = [(stage, output) for stage, output in zip(PER_RECORDING, outputs)]
    if logs:
        outputs = [work.folder / f"{name}.recording.h5", *outputs]
        steps.insert(0, ("import", outputs[0]))
    made: list[Step] = []
    first = steps[0]
    try:
        if not source.is_file():
            raise HrgError(f"{source}: no such file; name a recording or a laboratory's log")
        key = memory.make_key(
            [*work.same_if, {s: work.settings[s] for s, _ in steps}, *identity], inputs
        )
        done = memory.recall(note, key)
        if done is not None and done.get("steps"):
            yield from _list_steps(done["steps"])
            return
        _begin(work, note, outputs)
        read = inputs
        for stage, output in steps:
            first = (stage, output)
            made.append(_step_of_recording(work, stage, read, output, note))
            yield made[-1]
            read = [output]
        memory.remember(note, key, {"steps": [dataclasses.asdict(step) for step in made]}, outputs)
    except (DiskFullError, UsageError):
        raise
    except HrgError as error:
        if not any(output.exists() for output in outputs):  # nothing was made, nothing to remember
            note.unlink(missing_ok=True)
        yield Step(first[0], tuple(p.name for p in inputs), first[1].name, "failed", (str(error),))


def waves_to_results(
    work: Work, free: Sequence[Path], forced: Sequence[Path], stages: Sequence[str] = RESULTS
) -> Iterator[Step]:
    """Identify free runs, diagnose free ones (forced where there are none) with the identified
    resonator beside them, calibrate and compensate forced ones.

    Free runs show the resonator without a loop's answer and are diagnosed in seconds; forced ones
    beside them (twelve of 1200 rows) take more than thirty times as long.

    Parameters
    ----------
    work
        The gyro's folder, settings and limits.
    free, forced
        Waves.
    stages
        Those of `RESULTS` that are wanted.

    Returns
    -------
    iterator of Step
        As they are done, for each stage for which there are waves. A step that fails is told; what
        needs its result is not tried.

    Raises
    ------
    DiskFullError, UsageError
        What no further step could mend.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.chain import Work, waves_to_results
    >>> list(waves_to_results(Work(Path("results"), {}), [], []))
    []
    """
    resonator: Path | None = None
    calibration: Path | None = None
    modes_alone = False
    for stage in [s for s in RESULTS if s in stages]:
        waves = {
            "identify": free,
            "diagnose": free or forced,
            "calibrate": forced,
            "compensate": forced,
        }[stage]
        if not waves or (stage == "diagnose" and modes_alone):
            continue
        beside: dict[str, Path] = (
            {"resonator": resonator}
            if resonator is not None and "resonator" in pipeline.STAGES[stage].beside
            else {}
        )
        if stage == "compensate":
            if calibration is not None:
                for wave in waves:
                    output = work.folder / wave.name.replace(".wave.h5", ".compensated.h5")
                    yield from _result(work, stage, [wave], output, {"calibration": calibration})
            continue
        output = work.folder / f"{pipeline.STAGES[stage].gives}.h5"
        step, *rehearsed = _result(work, stage, waves, output, beside)
        yield from [step, *rehearsed]
        if step.status not in ("failed", "refused"):
            resonator = output if stage == "identify" else resonator
            modes_alone |= stage == "identify" and store.read(output, Resonator).modes_alone
            calibration = output if stage == "calibrate" else calibration


def list_undiagnosed(steps: Sequence[Step]) -> list[str]:
    """Waves that a result was made of and the diagnosis did not take: driven ones beside free ones.

    Parameters
    ----------
    steps
        Of the chain.

    Returns
    -------
    list of str
        Names of files; none where there is no diagnosis.

    Examples
    --------
    >>> from hrg_cli.chain import Step, list_undiagnosed
    >>> taken = {"diagnose": ("free.wave.h5",), "calibrate": ("slow.wave.h5", "fast.wave.h5")}
    >>> list_undiagnosed([Step(name, waves, "", "valid") for name, waves in taken.items()])
    ['slow.wave.h5', 'fast.wave.h5']
    """
    diagnosed = {wave for step in steps if step.name == "diagnose" for wave in step.inputs}
    others = [wave for step in steps if step.name == "calibrate" for wave in step.inputs]
    return [wave for wave in others if wave not in diagnosed] if diagnosed else []


def find_mode(wave: Path) -> str:
    """Whether a wave was free or driven.

    Parameters
    ----------
    wave
        Its file.

    Returns
    -------
    str
        "free" or "forced".

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli import store
    >>> from hrg_cli.chain import find_mode
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.wave.h5"
    ...     _ = store.write(file, draw_input().wave)
    ...     print(find_mode(file))
    free
    """
    with store.open_record(wave, Wave) as record:
        return str(record.mode)


def _result(
    work: Work, stage: str, inputs: Sequence[Path], output: Path, beside: Mapping[str, Path]
) -> list[Step]:
    """One stage on waves and, where it is asked for, its result's rehearsal, unless that was done
    before."""
    asked = work.rehearse if stage in REHEARSED else None
    note = output.with_suffix(".json")
    try:
        key = _key_of_result(work, stage, asked, [*inputs, *beside.values()])
        done = memory.recall(note, key)
        if done is not None and done.get("steps"):
            return list(_list_steps(done["steps"]))
        _begin(work, note, [output, *(extended_beside(output) if stage == "diagnose" else ())])
        outcome = _run_noted_stage(work, stage, inputs, output, note, beside)
        outputs = [output, *_write_extended_beside(work, outcome.record, output, note)]
        record, further = outcome.record, list[Step]()
        if asked is not None and record.status != "refused":
            further = [_rehearse_result(work, asked, inputs, output)]
            record = store.read(output, type(record))
        told = {k: v for k, v in outcome.json.items() if k not in ("elapsed_s", "output")}
        step = Step(
            stage,
            tuple(p.name for p in inputs),
            output.name,
            record.status,
            record.status_reasons,
            told,
            tuple(_check_against_limits(record, work.limits)),
        )
        steps = [step, *further]
        memory.remember(note, key, {"steps": [dataclasses.asdict(s) for s in steps]}, outputs)
        return steps
    except (DiskFullError, UsageError):
        raise
    except HrgError as error:
        return [Step(stage, tuple(p.name for p in inputs), output.name, "failed", (str(error),))]


def _key_of_result(
    work: Work, stage: str, rehearsed: Mapping[str, Any] | None, inputs: Sequence[Path]
) -> str:
    """What a result is remembered by: all that it depends on."""
    rehearsal = [] if rehearsed is None else [{"rehearse": rehearsed}]
    settings = [*work.same_if, stage, work.settings[stage], work.limits, *rehearsal]
    return memory.make_key(settings, inputs)


def _write_extended_beside(work: Work, record: Record, output: Path, note: Path) -> list[Path]:
    """The files of a diagnosis' extended model, written beside it over those of an earlier run
    alone; none of another result."""
    if not isinstance(record, Diagnosis):
        return []
    earlier = [path for path in extended_beside(output) if path.exists()]
    force = work.replace or all(memory.is_ours(note, path) for path in earlier)
    return list(write_extended(record, output, force))


def _rehearse_result(
    work: Work, values: Mapping[str, Any], inputs: Sequence[Path], output: Path
) -> Step:
    """The rehearsal of a result that was just made, its verdict written into the result's status;
    one that cannot be done is told."""
    from .rehearsal import rehearse_file

    typed = f"hrg rehearse {output.name} --times {values['times']}"
    try:
        beside = [*inputs, *work.recordings]
        _, told = rehearse_file(output, beside, values, work.jobs, lambda _: None, typed)
    except (DiskFullError, UsageError):
        raise
    except HrgError as error:
        return Step("rehearse", (output.name,), output.name, "failed", (str(error),))
    return Step("rehearse", (output.name,), output.name, told.status, told.reasons, told.to_json())


def _list_steps(steps: Sequence[Mapping[str, Any]]) -> Iterator[Step]:
    """Steps as they were noted."""
    for step in steps:
        lists = {key: tuple(step[key]) for key in ("inputs", "reasons", "checks")}
        yield Step(**{**step, **lists})


def _line(work: Work, name: str, inputs: Sequence[Path], output: Path) -> str:
    return (
        work.command_line
        if isinstance(work.command_line, str)
        else work.command_line(name, inputs, output)
    )


def _begin(work: Work, note: Path, outputs: Sequence[Path]) -> None:
    """Note what will be written, where a later run could not tell it from somebody else's."""
    if not work.replace:
        memory.begin(note, outputs)


def _may_replace(work: Work, note: Path, output: Path) -> bool:
    return work.replace or (output.exists() and memory.is_ours(note, output))


def _run_noted_stage(
    work: Work,
    stage: str,
    inputs: Sequence[Path],
    output: Path,
    note: Path,
    beside: Mapping[str, Path] | None = None,
) -> pipeline.Outcome:
    force, line = _may_replace(work, note, output), _line(work, stage, inputs, output)
    return pipeline.run_stage(
        stage,
        list(inputs),
        output,
        work.settings[stage],
        beside=beside,
        force=force,
        command_line=line,
    )


def _import_logs(work: Work, logs: Sequence[Path], output: Path, note: Path) -> Record:
    from .formats import import_log

    values = work.settings["import"]
    force, line = _may_replace(work, note, output), _line(work, "import", logs, output)
    return pipeline.write_first(
        output,
        import_log(logs[0], **values),
        values,
        "import",
        logs,
        force=force,
        command_line=line,
    )


def _check_against_limits(record: Record, limits: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The figures of a record against the limits of its kind, where there are some."""
    if record.kind not in limits:
        return []
    from .limits import check

    return [
        {"name": row.name, "passed": row.passed, "sentence": row.describe()}
        for row in check(record, limits)
    ]
