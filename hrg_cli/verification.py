"""Files held against what was written: their own checksums, the sources they were made from, and
what a lot noted of its outputs.

It tells that something was changed and what; by whom it cannot tell: whoever can write a file can
write its checksums.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from . import settings, store
from .errors import HrgError, name_some
from .records import Provenance, Record, Recording

RESULTS = ("whole", "without checksums", "changed", "damaged")
"""From best to worst."""
LARGEST_NOTE = 4 << 20
"""Bytes; a lot's notes are far smaller."""


@dataclass
class FileState:
    """One file: what it is, how it stands (one of `RESULTS`), what was changed, and what else is
    worth knowing."""

    name: str
    kind: str
    result: str = "whole"
    findings: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    not_followed: list[str] = field(default_factory=list)
    """Sources that do not lie in the folder."""

    def worsen(self, result: str, finding: str) -> None:
        """Add a finding that makes the result at least this bad."""
        self.result = max(self.result, result, key=RESULTS.index)
        self.findings.append(finding)


def verify(paths: Sequence[Path]) -> list[FileState]:
    """Hold files, the hrg files of folders and every source of theirs in the same folders against
    what was written.

    Parameters
    ----------
    paths
        Files and folders.

    Returns
    -------
    list of FileState
        One a file, in the order in which they were looked at.

    Raises
    ------
    HrgError
        A path is not there, or there is nothing to verify.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.verification import verify
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.h5"
    ...     run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    ...     _ = store.write(file, run)
    ...     [state.result for state in verify([file])]
    ['whole']
    """
    given: list[Path] = []
    for path in paths:
        if not path.exists():
            raise HrgError(
                f"{path}: no such file or folder; name files that hrg wrote, or their folder"
            )
        given += _files_of(path) if path.is_dir() else [path]
    if not given:
        raise HrgError(f"{paths[0]}: holds no hrg files; name a folder of a chain or of a lot")
    work = _Verification()
    for path in given:
        work.verify_file(path)
    for path in paths:
        for note in sorted(path.rglob("*.json")) if path.is_dir() else []:
            work.verify_note(note)
    return list(work.verdicts.values())


def report(verdicts: Sequence[FileState]) -> dict[str, Any]:
    """The JSON of files' states.

    Parameters
    ----------
    verdicts
        One a file.

    Returns
    -------
    dict
        Refused where anything was changed, suspect where a file keeps no checksums, else valid.

    Examples
    --------
    >>> from hrg_cli.verification import FileState, report
    >>> changed = FileState("wave.h5", "wave", "changed", ["frequency_hz is another"])
    >>> told = report([FileState("run.h5", "recording"), changed])
    >>> told["status"], told["status_reasons"]
    ('refused', ['wave.h5: frequency_hz is another'])
    """
    worst = max((verdict.result for verdict in verdicts), key=RESULTS.index)
    status = {"whole": "valid", "without checksums": "suspect"}.get(worst, "refused")
    reasons = [f"{v.name}: {sentence}" for v in verdicts for sentence in v.findings]
    return {
        "kind": "verify",
        "status": status,
        "status_reasons": reasons,
        "files": [asdict(v) for v in verdicts],
    }


def _files_of(folder: Path) -> list[Path]:
    """The hrg files of a folder and those below it."""
    return [
        path
        for path in sorted(folder.rglob("*.h5"))
        if path.is_file() and not path.name.startswith(".")
    ]


class _Verification:
    """The verdicts so far, and what is known of every file that was looked at."""

    def __init__(self) -> None:
        self.verdicts: dict[Path, FileState] = {}
        self._digests: dict[Path, str | None] = {}
        self._beside: dict[Path, list[Path]] = {}

    def verify_file(self, path: Path) -> None:
        """Verify a file, then the sources of it that are found, and theirs."""
        waiting = [path]
        while waiting:
            path = waiting.pop(0)
            place = path.resolve()
            if place in self.verdicts:
                continue
            verdict = self.verdicts[place] = FileState(str(path), path.suffix.lstrip(".") or "file")
            record = self._own(path, verdict)
            if record is not None:
                waiting += self._sources(path, record, verdict)

    def _own(self, path: Path, verdict: FileState) -> Record | None:
        """The file's values against its own checksums; its record where it can be read."""
        try:
            verdict.kind = store.find_kind(path).kind
            changed = store.find_changes(path)
            if changed is None:
                verdict.worsen(
                    "without checksums",
                    "keeps no checksums (a laboratory's file, or an older hrg's); changes would not"
                    " show",
                )
                for sentence in store.find_unreadable(path):
                    verdict.worsen("damaged", sentence)
            for sentence in changed or []:
                verdict.worsen("changed", sentence)
            with store.open_record(path, store.find_kind(path)) as record:
                return record
        except HrgError as error:
            verdict.worsen("damaged", str(error).removeprefix(f"{path}: "))
            return None

    def _sources(self, path: Path, record: Record, verdict: FileState) -> list[Path]:
        """Hold the file's sources against what lies in the folder now; the hrg files among those
        that are right."""
        found: list[Path] = []
        others: list[str] = []
        if not record.provenance.sources and record.kind != Recording.kind:
            verdict.notes.append("names no sources: what it was made from cannot be looked at")
        for source in record.provenance.sources:
            named = path.parent / Path(source.name).name
            match = next(
                (
                    p
                    for p in [named, *self._in_folder(path.parent)]
                    if p.is_file() and self._digest(p) == source.sha256
                ),
                None,
            )
            if match is not None and match != named and named.is_file():
                verdict.notes.append(f"its source {source.name} lies here as {match.name}")
            if match is None and named.is_file() and self._digest(named) is None:
                verdict.worsen("damaged", f"its source {source.name} cannot be read")
            elif match is None and named.is_file():
                others.append(source.name)
            elif match is None:
                verdict.not_followed.append(source.name)
            elif store.is_hdf5(match) and _is_ours(match):
                found.append(match)
        if others:
            verdict.worsen(
                "changed",
                f"was made from another {name_some(others)} than lies here; that was changed or"
                " made again",
            )
        self._compare(record, found, verdict)
        return found

    def _compare(self, record: Record, sources: Iterable[Path], verdict: FileState) -> None:
        """Find lines of history that are gone; note where versions differ along the chain, times go
        back, or settings differ between the sources of one file."""
        by_kind: dict[str, dict[str, list[str]]] = {}
        for source in sources:
            kind = store.find_kind(source)
            with store.open_record(source, kind) as parent:
                made = parent.provenance
            self._lineage(record.provenance, made, source.name, verdict)
            if made.generated_by != record.provenance.generated_by:
                by = made.generated_by or "another program"
                verdict.notes.append(
                    f"made by {record.provenance.generated_by}, its source {source.name} by {by}"
                )
            by_kind.setdefault(kind.kind, {}).setdefault(made.settings, []).append(source.name)
        for kind_name, by_settings in by_kind.items():
            if len(by_settings) > 1:
                groups = "; ".join(name_some(names) for names in by_settings.values())
                keys = ", ".join(_different(list(by_settings))) or "their text"
                verdict.notes.append(
                    f"its {kind_name} files were made with different settings ({keys}): {groups}"
                )

    @staticmethod
    def _lineage(own: Provenance, made: Provenance, source: str, verdict: FileState) -> None:
        """Hold history and time of writing against those of a source: hrg hands on every line, and
        writes what it made after what it was made from."""
        gone = [line for line in made.history if line not in own.history]
        if gone:
            verdict.worsen(
                "changed",
                f"its history lacks {len(gone)} of {len(made.history)} lines of its source {source}"
                f" ({name_some(gone)}); it was shortened, or the file was made from another",
            )
        if own.created and made.created and own.created < made.created:
            verdict.notes.append(
                f"was written {own.created}, its source {source} later ({made.created}); a clock"
                " was wrong, or a time was changed"
            )

    def verify_note(self, path: Path) -> None:
        """A lot's note of what it made: every output it names must be there as it was noted."""
        try:
            noted = (
                json.loads(path.read_text(encoding="utf-8"))
                if path.is_file() and path.stat().st_size < LARGEST_NOTE
                else None
            )
            outputs = (
                dict(noted["outputs"])
                if isinstance(noted, dict) and {"key", "outputs", "result"} <= set(noted)
                else None
            )
        except (OSError, ValueError, TypeError, RecursionError):
            return
        for name, digest in (outputs or {}).items():
            output = path.parent / Path(str(name)).name
            if problem := self._unlike(output, digest, path.name):
                state = FileState(str(output), output.suffix.lstrip("."))
                self.verdicts.setdefault(output.resolve(), state).worsen(*problem)

    def _unlike(self, output: Path, digest: object, note: str) -> tuple[str, str] | None:
        """(result, finding) where an output of a lot is not as its note says."""
        if not output.is_file():
            return "changed", f"was removed; {note} notes it"
        found = self._digest(output)
        if found is None:
            return "damaged", f"cannot be read; {note} notes it"
        if found != digest:
            return "changed", f"is not what the lot wrote ({note} notes another SHA-256)"
        return None

    def _in_folder(self, folder: Path) -> list[Path]:
        if folder not in self._beside:
            self._beside[folder] = [
                p for p in sorted(folder.iterdir()) if p.is_file() and not p.name.startswith(".")
            ]
        return self._beside[folder]

    def _digest(self, path: Path) -> str | None:
        """SHA-256 of a file; None where it cannot be read, which its own verdict tells."""
        place = path.resolve()
        if place not in self._digests:
            try:
                self._digests[place] = store.compute_sha256(path)
            except HrgError:
                self._digests[place] = None
        return self._digests[place]


def _is_ours(path: Path) -> bool:
    try:
        store.find_kind(path)
    except HrgError:
        return False
    return True


def _different(texts: Sequence[str]) -> list[str]:
    """The keys in which settings (TOML texts) differ."""
    trees = []
    for text in texts:
        try:
            trees.append(settings.flatten(settings.parse_toml(text)))
        except HrgError:
            return []
    keys = sorted({key for tree in trees for key in tree})
    return [key for key in keys if len({repr(tree.get(key)) for tree in trees}) > 1][:6]
