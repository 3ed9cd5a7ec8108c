"""Faults over all commands: `faults.py --trials 20000` puts damaged inputs into them, `--failures
200` so many failing calls of each kind, `--kills 500` kills them at random instants.

Every failing input is told with its seed and kept below build/faults, its damage as a line of JSON
that belongs into corpus.json. Figures are added to those of earlier runs there.
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import shutil
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from robustness import batches, calls, damage, judge, kills, programme

KEPT = Path("build/faults")
"""What every run came to, for `page.py`."""
KILLS_AT_ONCE = 20
CORPUS = Path(__file__).with_name("corpus.json")


def words_of(case: programme.Case, good: Path, folder: Path, changed: str) -> list[str]:
    """The command line, the damaged input and the output in the trial's folder, the rest where the
    good ones are."""
    out = []
    for word in case.words:
        if word.startswith("{") and word != "{out}":
            name = word[1:-1]
            word = str(folder / name if name == changed else good / name)
        out.append(str(folder / case.output) if word == "{out}" else word)
    return [*out, "-q", "--json"]


@dataclass(frozen=True)
class Trial:
    """One damaged input of one command."""

    case: programme.Case
    changed: str
    damages: list[damage.Damage]

    def line(self) -> str:
        """As the corpus keeps it."""
        return json.dumps({"case": self.case.name, "input": self.changed, "damages": self.damages})


def attempt(trial: Trial, run: judge.Runner, good: Path, folder: Path) -> judge.Outcome:
    """One damaged input put into its command."""
    case, changed = trial.case, trial.changed
    judge.clean(folder)
    shutil.copy(good / changed, folder / changed)
    if case.name == "batch" and changed == "lot.toml":
        shutil.copy(good / "recording.h5", folder)
    elif case.name == "batch":
        shutil.copy(good / "lot.toml", folder)
    damage.apply(folder / changed, trial.damages)
    words = words_of(case, folder if case.name == "batch" else good, folder, changed)
    return run(words, folder, folder / case.output)


def turns(cases: list[programme.Case]) -> list[programme.Case]:
    """The order in which commands get inputs: all cheap ones, then one of the costly."""
    cheap = [case for case in cases if not case.costly]
    costly = [case for case in cases if case.costly]
    if not cheap or not costly:
        return cases
    return [one for last in costly for one in (*cheap, last)]


def drawn(good: Path, cases: list[programme.Case], trials: int, seed: int) -> list[Trial]:
    """So many damaged inputs over the commands in turn."""
    rng = np.random.default_rng(seed)
    order, out = turns(cases), []
    for trial in range(trials):
        case = order[trial % len(order)]
        changed = case.damaged[int(rng.integers(len(case.damaged)))]
        out.append(Trial(case, changed, damage.draw(rng, good / changed)))
    return out


def put_damage(
    good: Path, folder: Path, cases: list[programme.Case], trials: int, seed: int, kept: Path | None
) -> tuple[Counter, list[str]]:
    """Damaged inputs over the commands in turn: how each ended, and what broke a promise."""
    counts: Counter = Counter()
    failures = []
    damaged = drawn(good, cases, trials, seed)
    put = partial(attempt, good=good, folder=folder)
    for number, (trial, found) in enumerate(zip(damaged, batches.outcomes(damaged, put))):
        counts[trial.case.name, found.status] += 1
        if found.broken:
            failures.append(
                f"seed {seed}, trial {number}: {trial.line()}\n  {'; '.join(found.broken)}\n "
                f" {found.err.strip()[-600:]}"
            )
            print(failures[-1], file=sys.stderr, flush=True)
            if kept is not None:
                kept.mkdir(parents=True, exist_ok=True)
                with (kept / "corpus.jsonl").open("a") as lines:
                    lines.write(trial.line() + "\n")
    return counts, failures


def replay(good: Path, folder: Path) -> tuple[list[tuple[dict, int]], list[str]]:
    """Every damage that ever broke a promise: how those end that keep it now, and what breaks it
    again."""
    cases = {case.name: case for case in programme.ready(good)}
    ended, failures = [], []
    for entry in json.loads(CORPUS.read_text()):
        if entry["case"] in cases:
            trial = Trial(cases[entry["case"]], entry["input"], entry["damages"])
            found = attempt(trial, judge.run, good, folder)
            if found.broken:
                failures.append(
                    f"{json.dumps(entry)}\n  {'; '.join(found.broken)}\n "
                    f" {found.err.strip()[-300:]}"
                )
            else:
                ended.append((entry, found.status))
    return ended, failures


def told_by_case(counts: Counter) -> str:
    """Counts by (command, …) as a line a command."""
    lines = []
    for name in sorted({name for name, *_ in counts}):
        of = [(rest, n) for (case, *rest), n in sorted(counts.items()) if case == name]
        said = ", ".join(f"{n} × {' '.join(map(str, rest))}" for rest, n in of)
        lines.append(f"  {name:20} {said}")
    return "\n".join(lines)


def keep(name: str, told: dict, counts: Counter, failures: list[str]) -> None:
    """One run's figures, beside those of earlier ones."""
    KEPT.mkdir(parents=True, exist_ok=True)
    row = told | {"counts": [[*key, n] for key, n in counts.items()], "failures": failures}
    with (KEPT / name).open("a") as lines:
        lines.write(json.dumps(row) + "\n")


def put_kills(good: Path, folder: Path, asked: argparse.Namespace) -> list[str]:
    """The kills, kept a few at a time: what broke a promise."""
    killed = kills.put_kills(good, folder, asked.kills, asked.seed, asked.only)
    counts: Counter = Counter()
    failures = []
    while some := list(itertools.islice(killed, KILLS_AT_ONCE)):
        counted = Counter((name, how) for name, how, _ in some)
        broken = [told for *_, told in some if told]
        keep("kills.jsonl", {"seed": asked.seed, "kills": len(some)}, counted, broken)
        counts += counted
        failures += broken
        print("\n".join(broken), end="\n" if broken else "", file=sys.stderr, flush=True)
    print(f"{sum(counts.values())} kills, seed {asked.seed}\n{told_by_case(counts)}")
    return failures


def parsed() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=0, help="damaged inputs")
    parser.add_argument("--failures", type=int, default=0, help="calls of each kind and command")
    parser.add_argument(
        "--sampled",
        type=int,
        default=0,
        help="only so many of these calls, spread evenly; for commands that take seconds",
    )
    parser.add_argument("--kills", type=int, default=0, help="kills")
    parser.add_argument(
        "--seed", type=int, default=int(os.environ.get("HRG_TEST_SEED") or time.time()) % 2**31
    )
    parser.add_argument(
        "--only", default="", help="commands whose names begin with this; several joined by commas"
    )
    parser.add_argument("--no-costly", action="store_true")
    return parser.parse_args()


def main() -> int:
    """Figures on standard output; status 1 where a promise was broken."""
    asked = parsed()
    if asked.failures:
        calls.preloaded()
    judge.warm()
    folder = Path(tempfile.mkdtemp(prefix="hrg-faults-"))
    good = programme.build(judge.clean(folder / "good"))
    cases = programme.named(programme.ready(good, not asked.no_costly), asked.only)
    replaying = asked.trials and not asked.only
    replayed, failures = replay(good, folder / "trial") if replaying else ([], [])
    if asked.trials:
        used = sum(os.times()[:4])
        counts, broken = put_damage(good, folder / "trial", cases, asked.trials, asked.seed, KEPT)
        told = {"seed": asked.seed, "trials": asked.trials, "cpu_s": sum(os.times()[:4]) - used}
        told |= {"replayed": replayed} if replayed else {}
        keep("damage.jsonl", told, counts, broken)
        print(f"{asked.trials} damaged inputs, seed {asked.seed}\n{told_by_case(counts)}")
        failures += broken
    if asked.failures:
        for case in cases:
            counts, broken = calls.put_failures(
                good, folder / "trial", [case], asked.failures, sample=asked.sampled
            )
            told = {"most": asked.failures, "sample": asked.sampled}
            keep("calls.jsonl", told, counts, broken)
            print(f"{sum(counts.values())} failing calls\n{told_by_case(counts)}", flush=True)
            failures += broken
    if asked.kills:
        failures += put_kills(good, folder / "trial", asked)
    print(f"{len(failures)} broke a promise")
    print("\n".join(failures[:40]))
    shutil.rmtree(folder, ignore_errors=True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
