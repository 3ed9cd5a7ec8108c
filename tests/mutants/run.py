"""Mutation score: each change of `mutations.py` is made in a copy of the package and its tests run;
a change that no test sees survives.

`make mutants` runs all; `--only PART` those of files whose name contains PART, `--of TEXT` those
whose old text contains TEXT, `--sample N` so many drawn by `--seed`. What came of each is kept in
build/faults/mutants.json; `--resume` runs what was not yet run on the files as they are now.
"""

from __future__ import annotations

import argparse
import ast
import functools
import hashlib
import importlib
import json
import os
import random
import re
import shlex
import shutil
import signal
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import hypothesis
import pytest

from mutants.mutations import MUTATIONS

ROOT = Path(__file__).parents[2]
KEPT = Path("build/faults/mutants.json")
LONGEST_S = 900.0
WARM = (
    *("numpy", "scipy.linalg", "scipy.optimize", "scipy.signal", "scipy.special", "scipy.stats"),
    *("h5py", "numba", "pandas", "pydantic", "rich.console", "soundfile", "typer"),
)
"""Imported once: the tests of each change run in a process forked from this one."""
NOT_A_VERDICT = (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED)
WRONG_COPY = 99


@dataclass(frozen=True)
class Mutation:
    """One change: file below hrg_cli, tests that should notice, old and new text."""

    file: str
    tests: tuple[str, ...]
    old: str
    new: str

    def key(self) -> str:
        """Digest of the change and of the file: what a verdict was passed on."""
        return _digest(self.old, self.new, _text(ROOT / "hrg_cli" / self.file))

    def seen_by(self, by: str) -> str:
        """Digest of what a verdict rests on: the test that saw the change, or all of them where
        none did. It holds while that stays."""
        seen = source_of(by)
        return _digest(seen or "\0".join(_text(ROOT / test) for test in self.tests))

    def still(self, row: dict) -> bool:
        """Whether a verdict on this change still holds."""
        return row["key"] == self.key() and row["seen_by"] == self.seen_by(row["by"])


@functools.cache
def _text(path: Path) -> str:
    return path.read_text()


def _digest(*texts: str) -> str:
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


@functools.cache
def source_of(test: str) -> str:
    """The text of a test function by its name (FILE::NAME[PARAMETERS]); empty where there is
    none."""
    place, _, name = test.partition("[")[0].partition("::")
    path = ROOT / place
    if not name or not path.is_file():
        return ""
    text = path.read_text()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef) and node.name == name.rpartition("::")[2]:
            first = min([node.lineno, *(one.lineno for one in node.decorator_list)])
            return "\n".join(text.splitlines()[first - 1 : node.end_lineno])
    return ""


@dataclass
class FailedFirst:
    """A pytest plugin: tests that saw earlier changes run first; which test failed is written
    down."""

    first: list[str]
    failed: Path

    def pytest_sessionstart(self) -> None:
        """A drawn example that fails is enough: nobody reads the smallest one."""
        phases = [hypothesis.Phase.explicit, hypothesis.Phase.generate]
        hypothesis.settings.register_profile("mutants", hypothesis.settings.default, phases=phases)
        hypothesis.settings.load_profile("mutants")

    def pytest_collection_modifyitems(self, items: list) -> None:
        """Earlier killers to the front, the latest first."""
        place = {name: n for n, name in enumerate(self.first)}
        items.sort(key=lambda item: place.get(item.nodeid, len(place)))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep the name of a test that failed."""
        if report.failed:
            self.failed.write_text(report.nodeid)


@dataclass
class Runner:
    """A copy of the package, and the tests run on it in forked processes."""

    folder: Path
    killers: dict[str, list[str]] = field(default_factory=dict)
    sound_s: dict[tuple[str, ...], float | None] = field(default_factory=dict)
    """Seconds that tests take without any change; None where they fail as it is: those notice
    nothing."""

    def tests_pass(self, file: str, tests: tuple[str, ...], longest_s: float) -> tuple[bool, str]:
        """Whether the tests pass with the copy as it is now, and the name of one that does not."""
        failed = self.folder / "failed"
        failed.unlink(missing_ok=True)
        first = self.killers.setdefault(file, [])
        child = os.fork()
        if child == 0:
            _in_child(self.folder, tests, FailedFirst(first[::-1], failed))
        status = _waited(child, longest_s)
        if status in (*NOT_A_VERDICT, WRONG_COPY):
            raise SystemExit(
                f"the tests of {file} did not run: {(self.folder / 'log').read_text()}"
            )
        if failed.exists():
            by = failed.read_text()
        else:
            by = "" if status == 0 else "not imported" if status > 0 else "no end"
        if by in first:
            first.remove(by)
        if failed.exists():
            first.append(by)
        return status == 0, by

    def noticed(self, change: Mutation) -> dict[str, object] | None:
        """What came of one change; None where its tests fail without it."""
        if change.tests not in self.sound_s:
            started = time.monotonic()
            sound, by = self.tests_pass("", change.tests, LONGEST_S)
            self.sound_s[change.tests] = time.monotonic() - started if sound else None
            if not sound:
                print(f"fails as it is: {' '.join(change.tests)}: {by}", flush=True)
        sound_s = self.sound_s[change.tests]
        if sound_s is None:
            return None
        path = self.folder / "hrg_cli" / change.file
        text, started = path.read_text(), time.monotonic()
        path.write_text(changed(text, change.old, change.new) or text)
        survived, by = self.tests_pass(change.file, change.tests, min(LONGEST_S, 60 + 5 * sound_s))
        path.write_text(text)
        verdict = "survived" if survived else "killed"
        return {"verdict": verdict, "by": by, "seconds": round(time.monotonic() - started, 1)}


def _in_child(folder: Path, tests: tuple[str, ...], plugin: FailedFirst) -> None:
    os.setsid()
    log = os.open(folder / "log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(log, 1)
    os.dup2(log, 2)
    os.environ |= {
        "PYTHONPATH": str(folder),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    os.chdir(folder)
    sys.dont_write_bytecode = True
    imported_from = (
        folder,
        *(ROOT / place for place in ("", "tests", "tests/helpers", "benchmarks")),
    )
    words = ["-x", "-q", "-m", "not slow and not browser", "-c", str(ROOT / "pyproject.toml")]
    words += ["-o", f"pythonpath={shlex.join(map(str, imported_from))}"]
    paths = [str(ROOT / test) for test in tests]
    status = int(pytest.main([*words, "--rootdir", str(ROOT), *paths], plugins=[plugin]))
    loaded = getattr(sys.modules.get("hrg_cli"), "__file__", None)
    if loaded is not None and folder not in Path(loaded).parents:
        print(f"tests imported {loaded}, not the changed copy")
        status = WRONG_COPY
    sys.stdout.flush()
    os._exit(status)


def _waited(child: int, longest_s: float) -> int:
    """Exit status of the child; negative where it was ended for taking too long."""
    deadline = time.monotonic() + longest_s
    while True:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        if time.monotonic() > deadline:
            os.killpg(child, signal.SIGKILL)
        time.sleep(0.02)


def chosen(only: str, of: str, sample: int, seed: int) -> list[Mutation]:
    """Every change asked for."""
    changes = [
        Mutation(name, tuple(tests.split()), old, new)
        for name, (tests, pairs) in MUTATIONS.items()
        if only in name
        for old, new in pairs
        if of in old
    ]
    return (
        changes if sample <= 0 else random.Random(seed).sample(changes, min(sample, len(changes)))
    )


def changed(text: str, old: str, new: str) -> str | None:
    """The text with the first `old` made `new`, however its lines are broken; None where it is not
    there."""
    if old in text:
        return text.replace(old, new, 1)
    words = re.findall(r"\w+|\S", old)
    found = re.search(r"\s*".join(map(re.escape, words)), text)
    return None if found is None else text[: found.start()] + new + text[found.end() :]


def stale() -> list[str]:
    """Changes whose old text is no longer in its file, and tests that are no longer there: the list
    must follow the code."""
    out = []
    for name, (tests, pairs) in MUTATIONS.items():
        path = ROOT / "hrg_cli" / name
        text = path.read_text() if path.exists() else ""
        out += [f"{name}: {old!r}" for old, new in pairs if changed(text, old, new) is None]
        out += [f"{name}: {test}" for test in tests.split() if not (ROOT / test).exists()]
    return out


def kept() -> dict[str, dict]:
    """What came of earlier runs, by key."""
    rows = json.loads(KEPT.read_text())["changes"] if KEPT.exists() else []
    return {row["key"]: row for row in rows}


def keep(rows: dict[str, dict]) -> None:
    """Write down what came of every change of today's list that was run."""
    changes = [(change, rows.get(change.key())) for change in chosen("", "", 0, 0)]
    KEPT.parent.mkdir(parents=True, exist_ok=True)
    held = [row for change, row in changes if row is not None and change.still(row)]
    told = {"listed": len(changes), "changes": held}
    KEPT.write_text(json.dumps(told, indent=1) + "\n")


def run(changes: list[Mutation], before: dict[str, dict]) -> tuple[dict[str, dict], bool]:
    """What came of each change, those known before included, and whether all tests were sound."""
    for name in WARM:
        importlib.import_module(name)
    folder = Path(tempfile.mkdtemp(prefix="hrg-mutants-"))
    rows = dict(before)
    try:
        shutil.copytree(
            ROOT / "hrg_cli", folder / "hrg_cli", ignore=shutil.ignore_patterns("__pycache__")
        )
        runner = Runner(folder)
        for change in changes:
            key = change.key()
            if key in before and change.still(before[key]):
                continue
            found = runner.noticed(change)
            if found is None:
                continue
            row = {"key": key, "file": change.file, "old": change.old, "new": change.new}
            rows[key] = row | found | {"seen_by": change.seen_by(str(found["by"]))}
            keep(rows)
            print(
                f"{found['verdict']:8} {found['seconds']:6} s {change.file}: {change.old[:60]!r} →"
                f" {change.new[:60]!r}  [{found['by']}]",
                flush=True,
            )
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return rows, None not in runner.sound_s.values()


def main() -> int:
    """Command line: the survivors and the score; status 1 where a tenth or more survive, the
    list is stale, or tests fail without a change."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--of", default="")
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--seed", type=int, default=int(os.environ.get("HRG_TEST_SEED") or 1))
    parser.add_argument("--resume", action="store_true")
    asked = parser.parse_args()
    old_texts = stale()
    for text in old_texts:
        print(f"stale: {text}")
    gone = {text.partition(": ")[0] for text in old_texts}
    changes = [
        change
        for change in chosen(asked.only, asked.of, asked.sample, asked.seed)
        if change.file not in gone
    ]
    started = time.monotonic()
    rows, sound = run(changes, kept() if asked.resume else {})
    told = [rows[change.key()] for change in changes if change.key() in rows]
    survivors = [
        f"{row['file']}: {row['old']!r} → {row['new']!r}"
        for row in told
        if row["verdict"] == "survived"
    ]
    print(
        f"{len(told) - len(survivors)} of {len(told)} changes were seen by a test"
        f" ({time.monotonic() - started:.0f} s); survivors:"
    )
    print("\n".join(survivors) or "none")
    return 1 if old_texts or not sound or (told and len(survivors) >= 0.1 * len(told)) else 0


if __name__ == "__main__":
    sys.exit(main())
