"""What the faults and the mutations came to, as one page: python tests/robustness/page.py
docs/FAULTS.md.

The figures are those that `make faults` and `make mutants` left in build/faults.
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from pathlib import Path
from typing import Any

KEPT = Path("build/faults")
HEAD = """# Faults put in on purpose

Made by `python tests/robustness/page.py docs/FAULTS.md` from what `make faults` and `make mutants` left; do not edit.

One judge holds every run to the promises: exit status 0, 1, 2 or 3; with 1 and 2 one sentence, nothing on standard output and no
output; with 0 and 3 one JSON object; no traceback, no library's words, no half file, no figure that is not finite in a valid result,
bounded time and memory. An input that broke one is kept in `tests/robustness/corpus.json` and replayed in every run of the tests.
"""


def damage(runs: list[dict[str, Any]]) -> str:
    """Damaged inputs by command and exit status, over all runs."""
    counts: Counter = Counter()
    for run in runs:
        for name, status, number in run["counts"]:
            counts[name, status] += number
    trials, cpu = sum(run["trials"] for run in runs), sum(run["cpu_s"] for run in runs)
    broken = sum(len(run["failures"]) for run in runs)
    names = sorted({name for name, _ in counts})
    statuses = sorted({status for _, status in counts})
    rows = [
        f"| {name} | " + " | ".join(str(counts[name, status] or "") for status in statuses) + " |"
        for name in names
    ]
    seeds = ", ".join(str(run["seed"]) for run in runs)
    return (
        f"## Damaged inputs\n\n{trials} inputs over {len(names)} commands, seeds {seeds}:"
        f" {broken} broke a promise. {1e3 * cpu / max(trials, 1):.0f} ms of processor time each.\n\n"
        f"| command | {' | '.join(f'exit {status}' for status in statuses)} |\n"
        f"|---|{'---|' * len(statuses)}\n" + "\n".join(rows) + "\n"
    )


def calls(told: dict[str, Any]) -> str:
    """Failing calls by kind and exit status."""
    counts: Counter = Counter()
    for _, call, status, number in told["counts"]:
        counts[call, status] += number
    lines = [
        f"* {call}: "
        + ", ".join(f"{n} × exit {s}" for (c, s), n in sorted(counts.items()) if c == call)
        for call in sorted({call for call, _ in counts})
    ]
    cases = len({name for name, *_ in told["counts"]})
    return (
        f"## Failing calls\n\nThe first {told['most']} of each kind in {cases} commands, one at a"
        f" time (allocations of 16 KiB or more): {len(told['failures'])} broke a promise.\n\n"
        + "\n".join(lines)
        + "\n"
    )


def mutants(told: dict[str, Any]) -> str:
    """The mutation score and the survivors."""
    rows = told["changes"]
    left = [row for row in rows if row["verdict"] == "survived"]
    lines = [f"* `{row['file']}`: `{row['old']}` → `{row['new']}`" for row in left]
    return (
        f"## Mutations\n\n{len(rows)} of {told['listed']} listed changes of the code were run;"
        f" {len(rows) - len(left)} were seen by a test"
        f" ({100 * (len(rows) - len(left)) / max(len(rows), 1):.1f} %)."
        + (" Survivors:\n\n" + "\n".join(lines) if left else "")
        + "\n"
    )


def page(folder: Path) -> str:
    """The whole page, of the parts that were run."""
    parts = [HEAD]
    if (folder / "damage.jsonl").exists():
        text = (folder / "damage.jsonl").read_text()
        parts.append(damage([json.loads(line) for line in text.splitlines()]))
    for name, told in (("calls", calls), ("mutants", mutants)):
        if (folder / f"{name}.json").exists():
            parts.append(told(json.loads((folder / f"{name}.json").read_text())))
    return "\n".join(parts)


if __name__ == "__main__":
    text = page(KEPT)
    print(text)
    for name in sys.argv[1:]:
        Path(name).write_text(text, encoding="utf-8")
