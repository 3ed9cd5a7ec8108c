"""The chain as a literal table, and the one way a stage is run on files: read, call, judge, write,
remember where it came from."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from . import settings, store
from .errors import HrgError
from .records import KINDS, Provenance, Record, Recording, Source, list_doubts, name_record
from .sources import Sources
from .store import AnyRecord
from .version import __version__

Progress = Callable[[float | None], None]
"""Called with the share done (0…1), or None where it is unknown."""


@dataclass(frozen=True)
class Stage:
    """One step: where its function lives, what it reads and writes, whether it takes many records
    and whether it streams."""

    name: str
    takes: str
    gives: str
    many: bool = False
    lazy: bool = False
    """Of many records: rows are read when sliced, so that memory does not grow with the runs'
    length."""
    beside: Mapping[str, str] = field(default_factory=dict)
    """Further records by argument name -> kind."""
    many_beside: tuple[str, ...] = ()
    """Names of the further records of which there may be several."""

    def load_function(self) -> Callable[..., Any]:
        """The stage's function, imported now."""
        return getattr(import_module(f"hrg_cli.stages.{self.name}"), self.name)

    def summarise(self, record: Record) -> dict[str, Any]:
        """The stage's part of the JSON, by the `summarise` that every stage's module has."""
        figures: dict[str, Any] = import_module(f"hrg_cli.stages.{self.name}").summarise(record)
        return figures


STAGES = {
    stage.name: stage
    for stage in (
        Stage("inject", "recording", "recording", beside={"resonator": "resonator"}),
        Stage("demodulate", "recording", "periods"),
        Stage("estimate", "periods", "wave"),
        Stage("identify", "wave", "resonator", many=True, lazy=True),
        Stage(
            "calibrate",
            "wave",
            "calibration",
            many=True,
            lazy=True,
            beside={"resonator": "resonator"},
            many_beside=("resonator",),
        ),
        Stage("diagnose", "wave", "diagnosis", many=True, beside={"resonator": "resonator"}),
        Stage(
            "rate",
            "wave",
            "compensated",
            beside={"resonator": "resonator", "calibration": "calibration"},
        ),
        Stage(
            "update",
            "calibration",
            "calibration",
            beside={"resonator": "resonator", "reference": "resonator"},
        ),
        Stage("compensate", "wave", "compensated", beside={"calibration": "calibration"}),
    )
}
"""Every stage that makes a file from files, in the order of the work."""

_KIND = {cls.kind: cls for cls in KINDS}


@dataclass(frozen=True)
class Outcome:
    """What a command has to report: the record without its rows' story, and the JSON."""

    record: Record
    json: dict[str, Any]


def run_stage(
    name: str,
    inputs: Sequence[Path],
    output: Path,
    values: Mapping[str, Any],
    *,
    beside: Mapping[str, Path | Sequence[Path]] | None = None,
    further: Mapping[str, Any] | None = None,
    force: bool = False,
    command_line: str = "",
    progress: Progress | None = None,
) -> Outcome:
    """Run one stage on files: records in, one record out, whole or not at all.

    Parameters
    ----------
    name
        Of the stage, a key of `STAGES`.
    inputs
        Files of the kind that it takes.
    output
        The file to write.
    values
        The stage's resolved settings.
    beside
        Argument's name -> file of a further record, a list where the stage takes several.
    further
        Arguments that are no file.
    force
        The output may be replaced.
    command_line
        Of the history.
    progress
        Called with the share done.

    Returns
    -------
    Outcome
        The record that was written, and the command's JSON.

    Raises
    ------
    HrgError
        An input is of the wrong kind, damaged or changed while it was read, or holds samples that
        another input holds; the output exists.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import Recording, demodulate, store
    >>> from hrg_cli.pipeline import run_stage
    >>> from hrg_cli.settings import resolve
    >>> t = np.arange(4000) / 1e4
    >>> c, s = np.cos(2e3 * np.pi * t), 0.5 * np.cos(2e3 * np.pi * t)
    >>> with TemporaryDirectory() as folder:
    ...     run, periods = Path(folder) / "run.h5", Path(folder) / "run.periods.h5"
    ...     _ = store.write(run, Recording(c=c, s=s, sample_rate_hz=1e4, mode="free"))
    ...     outcome = run_stage("demodulate", [run], periods, resolve(demodulate))
    >>> outcome.record.kind, round(outcome.json["reference_frequency_hz"], 6)
    ('periods', 1000.0)
    """
    stage = STAGES[name]
    started = time.monotonic()
    store.check_output(output, force)
    paths_beside = {
        key: [given] if isinstance(given, Path) else list(given)
        for key, given in (beside or {}).items()
    }
    all_beside = [path for paths in paths_beside.values() for path in paths]
    store.need_no_input(output, (*inputs, *all_beside))
    text = settings.to_toml({name: values})
    with store.keep_whole_or_none([output]):
        with ExitStack() as open_files, Sources([*inputs, *all_beside], taken=values) as sources:
            read = {
                key: [store.read(path, _KIND[stage.beside[key]]) for path in paths]
                for key, paths in paths_beside.items()
            }
            arguments = {
                **{key: r if key in stage.many_beside else r[0] for key, r in read.items()},
                **(further or {}),
                **values,
            }
            on_files = _run_on_all if stage.many else _run_on_one
            result, parents = on_files(stage, inputs, arguments, open_files, progress)
            parents += [record for records in read.values() for record in records]
            written = store.write(
                output,
                result,
                force,
                finish=lambda last: _with_provenance(
                    last, parents, sources.finish(), text, command_line or f"hrg {name}"
                ),
            )
        if isinstance(result, Record):
            return Outcome(written, report(written, output, started, stage.summarise(written)))
        # `written` is only the stream's last block
        with store.open_record(output, type(written)) as whole:
            return Outcome(written, report(written, output, started, stage.summarise(whole)))


def _run_on_all(
    stage: Stage,
    inputs: Sequence[Path],
    arguments: Mapping[str, Any],
    open_files: ExitStack,
    _: Progress | None,
) -> tuple[Record, list[Record]]:
    """The result of a stage that takes all inputs together, and what it was made of."""
    kind = _KIND[stage.takes]
    records: list[Record] = [
        (
            open_files.enter_context(store.open_record(path, kind))
            if stage.lazy
            else store.read(path, kind)
        )
        for path in inputs
    ]
    with _naming(None):
        result = stage.load_function()(records, **arguments)
    return _by_files(result, inputs, records), records


def _run_on_one(
    stage: Stage,
    inputs: Sequence[Path],
    arguments: Mapping[str, Any],
    open_files: ExitStack,
    progress: Progress | None,
) -> tuple[Record | Iterator[Record], list[Record]]:
    """The result of a stage that takes one input, or its stream of blocks, and what it is made
    of."""
    record = open_files.enter_context(store.open_record(inputs[0], _KIND[stage.takes]))
    with _naming(inputs[0]):
        result = stage.load_function()(record, **arguments)
    if not isinstance(result, Record):
        result = _watched(result, record, inputs[0], progress)
    return result, [record]


def write_first(
    output: Path,
    stream: AnyRecord | Iterable[AnyRecord],
    values: Mapping[str, Any],
    table: str,
    sources: Sequence[Path],
    *,
    force: bool,
    command_line: str,
) -> AnyRecord:
    """Write the record of a command that starts a chain (import, simulate, calibrate on a foreign
    table).

    Parameters
    ----------
    output
        The file to write.
    stream
        The record, or its blocks.
    values
        The command's settings.
    table
        Their name in the file's provenance.
    sources
        Files that it was made of.
    force
        The output may be replaced.
    command_line
        Of the history.

    Returns
    -------
    Record
        That was written; of a stream its last block.

    Raises
    ------
    HrgError
        A source changed while it was read, or the output exists.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.pipeline import write_first
    >>> run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.h5"
    ...     told = dict(force=False, command_line="hrg simulate gyro.toml")
    ...     written = write_first(file, run, {"seed": 1}, "simulate", [], **told)
    >>> print(written.provenance.settings, end="")
    [simulate]
    seed = 1
    """
    with Sources(sources) as hashed:
        text = settings.to_toml({table: values})
        return store.write(
            output,
            stream,
            force,
            finish=lambda last: _with_provenance(last, [], hashed.finish(), text, command_line),
        )


def make_common_keys(
    kind: str, status: str, reasons: Iterable[str], output: Path | None, started: float
) -> dict[str, Any]:
    """The keys that the JSON of every command has.

    Parameters
    ----------
    kind
        Of the result, or the command's name.
    status
        "valid", "suspect" or "refused".
    reasons
        Sentences.
    output
        The file; None: there is none.
    started
        `time.monotonic()` at the command's beginning [s].

    Returns
    -------
    dict
        As JSON has it.

    Examples
    --------
    >>> import time
    >>> from hrg_cli.pipeline import make_common_keys
    >>> list(make_common_keys("wave", "valid", (), None, time.monotonic()))
    ['kind', 'status', 'status_reasons', 'output', 'elapsed_s']
    """
    return {
        "kind": kind,
        "status": status,
        "status_reasons": list(reasons),
        "output": None if output is None else str(output),
        "elapsed_s": round(time.monotonic() - started, 3),
    }


def report(
    record: Record, output: Path | None, started: float, extra: Mapping[str, Any]
) -> dict[str, Any]:
    """The JSON of a command that wrote a record: the common keys, then the stage's own.

    Parameters
    ----------
    record
        The result.
    output
        Its file; None: there is none.
    started
        `time.monotonic()` at the command's beginning [s].
    extra
        The stage's own keys.

    Returns
    -------
    dict
        As JSON has it.

    Examples
    --------
    >>> import time
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.pipeline import report
    >>> run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    >>> told = report(run, None, time.monotonic(), {"samples": 2})
    >>> told["kind"], told["status"], told["samples"]
    ('recording', 'valid', 2)
    """
    return make_common_keys(
        record.kind, record.status, record.status_reasons, output, started
    ) | dict(extra)


def _by_files(result: Record, inputs: Sequence[Path], records: Sequence[Record]) -> Record:
    """The result with what it inherits from its inputs told by their files, which a stage does not
    know; a stage leaves refused runs out and repeats no reason of theirs, so it is added."""
    files = list(zip((path.name for path in inputs), records, strict=True))
    suspect = [(name, record) for name, record in files if record.status == "suspect"]
    by_file: dict[str, list[str]] = {}
    for told, named in zip(
        list_doubts((name_record(record), record) for _, record in suspect),
        list_doubts(suspect),
        strict=True,
    ):
        by_file.setdefault(told, []).append(named)
    reasons = tuple(
        by_file[reason].pop(0) if by_file.get(reason) else reason
        for reason in result.status_reasons
    )
    refused = [(name, record) for name, record in files if record.status == "refused"]
    return replace(result, status_reasons=reasons).judged(list_doubts(refused))


@contextmanager
def _naming(path: Path | None) -> Iterator[None]:
    """Put the file's name before a stage's sentence that lacks it (None: of several inputs the
    stage names the run itself)."""
    try:
        yield
    except HrgError as error:
        if error.args and path is not None and path.name not in str(error):
            error.args = (f"{path}: {error}",)
        raise
    except np.linalg.LinAlgError as error:
        raise HrgError(
            f"{path or 'the runs'}: the numbers give equations without a solution ({error}); look"
            " for values out of proportion"
        ) from error


def _watched(
    stream: Iterable[Record], source: Record, path: Path, progress: Progress | None
) -> Iterator[Record]:
    """The stream, its errors naming the file, its progress reported by the samples of each block,
    or by the time of its last row."""
    samples = len(source) if isinstance(source, Recording) else 0
    end = (
        float(source.times(samples - 1)[-1])
        if isinstance(source, Recording)
        else float(source.time_s[-1])  # type: ignore[attr-defined]
    )
    done = 0
    with _naming(path):
        for block in stream:
            yield block
            done += len(block)
            if progress is None or not len(block):
                continue
            if isinstance(block, Recording):
                progress(min(1.0, done / samples))
            else:
                progress(min(1.0, float(block.time_s[-1]) / end) if end > 0 else None)  # type: ignore[attr-defined]


def _with_provenance(
    record: AnyRecord,
    parents: Sequence[Record],
    sources: tuple[Source, ...],
    text: str,
    command_line: str,
) -> AnyRecord:
    history: dict[str, None] = {}
    for parent in parents:
        history.update(dict.fromkeys(parent.provenance.history))
    now = store.stamp_now()
    history[f"{now} hrg {__version__} {command_line}"] = None
    provenance = Provenance(tuple(history), text, sources, now, f"hrg {__version__}")
    return replace(record, provenance=provenance)
