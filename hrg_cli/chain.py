"""The whole chain on one gyro: demodulate and estimate each recording, identify and diagnose free runs, calibrate forced ones."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from . import pipeline, settings, store
from .errors import DiskFullError, HrgError
from .executors import local_processes
from .records import Wave

Say = Callable[[str], None]


@dataclass(frozen=True)
class Step:
    """One step of the chain: what it read and wrote, and how it ended ("valid", "suspect", "refused", "failed", "skipped")."""

    name: str
    inputs: tuple[str, ...]
    output: str
    status: str
    reasons: tuple[str, ...] = ()
    json: Mapping[str, Any] = field(default_factory=dict)


def run_chain(
    inputs: Sequence[Path],
    folder: Path,
    tables: Mapping[str, Mapping[str, Any]] | None = None,
    *,
    force: bool = False,
    command_line: str = "",
    say: Say = print,
    jobs: int = 1,
) -> list[Step]:
    """Run every step that the inputs allow; a step that fails is recorded and those that need it are skipped.

    inputs: recordings, or foreign logs (imported first); tables: settings a stage, e.g. {"demodulate": {"periods_per_window": 20}};
    jobs: processes that share the recordings up to their waves (the same results for any number).
    HrgError: two inputs would write the same file; an output exists (unless `force`).
    """
    tables = tables or {}
    inputs = _without_second_files(inputs, tables.get("import", {}).get("s_file"))
    stems = [path.name.removesuffix(".h5") if path.suffix == ".h5" else path.stem for path in inputs]
    if len(set(stems)) < len(stems):
        raise HrgError(
            f"{inputs[0]}: two inputs are called {next(s for s in stems if stems.count(s) > 1)}; rename one, their outputs would collide"
        )
    steps: list[Step] = []
    chain = _Chain(folder, tables, force, command_line or "hrg run", say, steps)
    alone = replace(chain, steps=[], say=_silent)
    waves: list[Path] = []
    for wave, made in _shared([(alone, path, stem) for path, stem in zip(inputs, stems)], jobs):
        waves += [] if wave is None else [wave]
        for step in made:
            chain.end(step)
    modes = {wave: store.read(wave, Wave).mode for wave in waves}
    free, forced = [w for w in waves if modes[w] == "free"], [w for w in waves if modes[w] == "forced"]
    resonator = chain.stage("identify", free, folder / "resonator.h5") if free else None
    if free:
        chain.stage("diagnose", free, folder / "diagnosis.h5", needs=resonator)
    if forced:
        calibration = chain.stage("calibrate", forced, folder / "calibration.h5")
        for wave in forced if calibration else []:
            chain.stage(
                "compensate", [wave], folder / wave.name.replace(".wave.h5", ".compensated.h5"), beside={"calibration": calibration}
            )
    return steps


def _without_second_files(inputs: Sequence[Path], s_file: str | None) -> list[Path]:
    """The inputs, without those that hold the channel S of another one."""
    if s_file is None:
        return list(inputs)
    from .formats import partners

    second = partners(inputs, lambda path: s_file)
    return [path for path in inputs if path not in second]


def _silent(text: str) -> None:
    """Says nothing: steps made in another process are told by this one."""


_Work = tuple["_Chain", Path, str]


def _to_wave(work: _Work) -> tuple[Path | None, list[Step]]:
    chain, path, stem = work
    own = replace(chain, steps=[])
    return own.to_wave(path, stem), own.steps


def _shared(works: Sequence[_Work], jobs: int) -> Iterator[tuple[Path | None, list[Step]]]:
    """Every recording's wave and steps, in the recordings' order. HrgError: a process was killed."""
    if min(jobs, len(works)) < 2:
        yield from map(_to_wave, works)
        return
    with local_processes(min(jobs, len(works))) as executor:
        try:
            yield from executor.map(_to_wave, works)
        except BrokenExecutor as error:
            raise HrgError("a process of --jobs was killed; it needs more memory than there is, use fewer --jobs") from error


@dataclass(frozen=True)
class _Chain:
    folder: Path
    tables: Mapping[str, Mapping[str, Any]]
    force: bool
    command_line: str
    say: Say
    steps: list[Step]

    def line(self, name: str, inputs: Sequence[Path], output: Path) -> str:
        """The line of `history`: the step as a command of its own, and the command that ran it."""
        return f"hrg {name} {shlex.join(p.name for p in inputs)} -o {shlex.quote(output.name)} (in: {self.command_line})"

    def to_wave(self, path: Path, stem: str) -> Path | None:
        """import (a foreign log), demodulate, estimate; None where one of them fails."""
        if path.exists() and not store.is_hdf5(path):
            path_or_none = self._import(path, self.folder / f"{stem}.h5")
            if path_or_none is None:
                return None
            path = path_or_none
        periods = self.stage("demodulate", [path], self.folder / f"{stem}.periods.h5")
        return None if periods is None else self.stage("estimate", [periods], self.folder / f"{stem}.wave.h5")

    def _import(self, log: Path, output: Path) -> Path | None:
        from .formats import import_log, second_file

        def work() -> tuple[str, tuple[str, ...], Mapping[str, Any]]:
            values = settings.checked(import_log, self.tables.get("import", {}))
            sources = [log] if values["s_file"] is None else [log, second_file(log, values["s_file"])]
            record = pipeline.write_first(
                output,
                import_log(log, **values),
                values,
                "import",
                sources,
                force=self.force,
                command_line=self.line("import", [log], output),
            )
            return record.status, record.status_reasons, {}

        return self._step("import", [log], output, work)

    def stage(
        self,
        name: str,
        inputs: Sequence[Path],
        output: Path,
        *,
        beside: Mapping[str, Path | None] | None = None,
        needs: Path | bool | None = True,
    ) -> Path | None:
        """Run a stage as a step; its output, or None when it failed."""
        if needs is None:
            self.end(Step(name, tuple(p.name for p in inputs), output.name, "skipped", ("the step before it failed",)))
            return None

        def work() -> tuple[str, tuple[str, ...], Mapping[str, Any]]:
            values = settings.checked(pipeline.STAGES[name].function(), self.tables.get(name, {}))
            with_it = {key: path for key, path in (beside or {}).items() if path is not None}
            outcome = pipeline.run_stage(
                name, inputs, output, values, beside=with_it, force=self.force, command_line=self.line(name, inputs, output)
            )
            return outcome.record.status, outcome.record.status_reasons, outcome.json

        return self._step(name, inputs, output, work)

    def _step(
        self, name: str, inputs: Sequence[Path], output: Path, work: Callable[[], tuple[str, tuple[str, ...], Mapping[str, Any]]]
    ) -> Path | None:
        read = tuple(p.name for p in inputs)
        try:
            status, reasons, json = work()
        except DiskFullError:
            raise
        except HrgError as error:
            self.end(Step(name, read, output.name, "failed", (str(error),)))
            return None
        self.end(Step(name, read, output.name, status, reasons, json))
        return output

    def end(self, step: Step) -> None:
        """Keep a step and say how it ended."""
        self.steps.append(step)
        self.say(
            f"{step.name} → {step.output}: {step.status}" + (f" ({step.reasons[0]})" if step.reasons and step.status != "valid" else "")
        )
