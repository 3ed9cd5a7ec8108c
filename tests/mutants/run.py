"""Mutation score: each change of `mutations.py` is made in a copy of the package and its tests run;
a change that no test sees survives.

`make mutants` runs all; `--only PART` those of files whose name contains PART, `--of TEXT` those
whose old text contains TEXT, `--sample N` so many drawn by `--seed`.
"""

from __future__ import annotations

import argparse
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent)]
from mutations import MUTATIONS  # noqa: E402

ROOT = Path(__file__).parents[2]
LONGEST_S = 900


def run_tests(copy: Path, tests: list[str]) -> bool:
    """Whether the tests pass with the copy of the package."""
    environment = os.environ | {
        "PYTHONPATH": str(copy),
        "PYTHONDONTWRITEBYTECODE": "1",
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }
    paths = [str(ROOT / test) for test in tests if (ROOT / test).exists()]
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-x",
        "-q",
        "-m",
        "not slow and not browser",
        "-c",
        str(ROOT / "pyproject.toml"),
    ]
    try:
        done = subprocess.run(
            [*command, "--rootdir", str(ROOT), *paths],
            cwd=copy,
            env=environment,
            capture_output=True,
            timeout=LONGEST_S,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def chosen(only: str, of: str, sample: int, seed: int) -> list[tuple[str, list[str], str, str]]:
    """(file, tests, old, new) of every change asked for."""
    changes = [
        (name, tests.split(), old, new)
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


def main() -> int:
    """Command line: the survivors and the score; status 1 where a tenth or more survive, the
    list is stale, or tests fail without a change."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--of", default="")
    parser.add_argument("--sample", type=int, default=0)
    parser.add_argument("--seed", type=int, default=int(os.environ.get("HRG_TEST_SEED") or 1))
    asked = parser.parse_args()
    old_texts = stale()
    for text in old_texts:
        print(f"stale: {text}")
    folder = Path(tempfile.mkdtemp(prefix="hrg-mutants-"))
    shutil.copytree(
        ROOT / "hrg_cli", folder / "hrg_cli", ignore=shutil.ignore_patterns("__pycache__")
    )
    survivors, killed, started = [], 0, time.monotonic()
    sound: dict[tuple[str, ...], bool] = {}
    """Whether tests pass without any change: those that fail notice nothing."""
    for name, tests, old, new in chosen(asked.only, asked.of, asked.sample, asked.seed):
        path = folder / "hrg_cli" / name
        text = path.read_text()
        changed_text = changed(text, old, new)
        if changed_text is None:
            continue
        if tuple(tests) not in sound:
            sound[tuple(tests)] = run_tests(folder, tests)
            if not sound[tuple(tests)]:
                print(f"fails as it is: {' '.join(tests)}", flush=True)
        if not sound[tuple(tests)]:
            continue
        path.write_text(changed_text)
        survived = run_tests(folder, tests)
        path.write_text(text)
        killed += not survived
        if survived:
            survivors.append(f"{name}: {old!r} → {new!r}")
        print(
            f"{'SURVIVED' if survived else 'killed  '} {name}: {old[:60]!r} → {new[:60]!r}",
            flush=True,
        )
    shutil.rmtree(folder, ignore_errors=True)
    total = killed + len(survivors)
    print(
        f"{killed} of {total} changes were seen by a test ({time.monotonic() - started:.0f} s);"
        " survivors:"
    )
    print("\n".join(survivors) or "none")
    return (
        1
        if old_texts or not all(sound.values()) or (total and len(survivors) >= 0.1 * total)
        else 0
    )


if __name__ == "__main__":
    sys.exit(main())
