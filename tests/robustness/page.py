"""What the faults and the mutations came to, as one page: python tests/robustness/page.py
docs/FAULTS.md.

The figures are those that `make faults` and `make mutants` left in build/faults; both add to what
is there. What was not run here stays as the page has it.
"""

from __future__ import annotations

import json
import re
import sys
from collections import Counter
from pathlib import Path
from typing import Any

KEPT = Path("build/faults")
CORPUS = Path(__file__).with_name("corpus.json")
HEAD = """# Faults put in on purpose

Made by `python tests/robustness/page.py docs/FAULTS.md` from what `make faults` and `make mutants` left; do not edit.

One judge holds every run to the promises: exit status 0, 1, 2 or 3; with 1 and 2 one sentence, nothing on standard output and no
output; with 0 and 3 one JSON object; no traceback, no library's words, no half file, no figure that is not finite in a valid result,
bounded time and memory. An input that broke one is kept in `tests/robustness/corpus.json` and replayed in every run of the tests.
"""
LIBRARY = """A crash (exit -11) at a failed allocation is the library's: numpy (2.4.6) lets go of Python's lock before the iterator of
a broadcast or cast of more than 500 elements allocates its buffers (64 KiB each), and where these cannot be had it raises
MemoryError without the lock (`npyiter_allocate_buffers` below `NpyIter_Reset`). `np.ones(4000)[:, None, None] * np.eye(2)` and
`np.ones((4000, 2)) + np.full((4000, 2), 1j)` with such a buffer refused end in a segmentation fault without any code of
this project. An end by exit -6 is LLVM's, which ends the process where it has no memory to compile ("LLVM ERROR: out of memory").
What such an end leaves is what a kill leaves: the output is absent, and the next run removes the temporary file.
"""


def damage(runs: list[dict[str, Any]]) -> str:
    """Damaged inputs by command and exit status, over all runs."""
    counts: Counter = Counter()
    for run in runs:
        for name, status, number in run["counts"]:
            counts[name, status] += number
    replayed = _replayed(runs)
    _ended_since(counts, runs, replayed)
    trials, cpu = sum(run["trials"] for run in runs), sum(run["cpu_s"] for run in runs)
    names = sorted({name for name, _ in counts})
    statuses = sorted({status for (_, status), number in counts.items() if number})
    rows = [
        f"| {name} | " + " | ".join(str(counts[name, status] or "") for status in statuses) + " |"
        for name in names
    ]
    seeds = ", ".join(str(run["seed"]) for run in runs)
    return (
        f"## Damaged inputs\n\n{trials} inputs over {len(names)} commands, seeds {seeds}:"
        f" {_what_broke(runs)}{' The table has how these end now.' if replayed else ''}"
        f" {1e3 * cpu / max(trials, 1):.0f} ms of processor time each.\n\n"
        f"| command | {' | '.join(f'exit {status}' for status in statuses)} |\n"
        f"|---|{'---|' * len(statuses)}\n" + "\n".join(rows) + "\n"
    )


def _replayed(runs: list[dict[str, Any]]) -> dict[str, int]:
    """How each input of the corpus ended when it was last replayed."""
    return {_canonical(entry): status for run in runs for entry, status in run.get("replayed", [])}


def _ended_since(counts: Counter, runs: list[dict[str, Any]], replayed: dict[str, int]) -> None:
    """Count what once ended as nothing may under the exit status that it has now."""
    for failure in (failure for run in runs for failure in run["failures"]):
        entry, ended = _input_of(failure), re.search(r"ended with (-?\d+)", failure)
        now = replayed.get(_canonical(entry))
        if ended and now is not None:
            counts[entry["case"], int(ended[1])] -= 1
            counts[entry["case"], now] += 1


def _what_broke(runs: list[dict[str, Any]]) -> str:
    """How many inputs broke a promise, how many of them the corpus holds, and the inputs since."""
    broken = [failure for run in runs for failure in run["failures"]]
    if not broken:
        return "none broke a promise."
    corpus = [_canonical(entry) for entry in json.loads(CORPUS.read_text())]
    held = sum(_canonical(_input_of(failure)) in corpus for failure in broken)
    last = max(number for number, run in enumerate(runs) if run["failures"])
    since = sum(run["trials"] for run in runs[last + 1 :])
    return (
        f"{len(broken)} broke a promise when they were tried; {held} of these are in the corpus, which"
        f" every run of the tests replays, and none of the {since} inputs since then broke one."
    )


def _canonical(entry: Any) -> str:
    return json.dumps(entry, sort_keys=True)


def _input_of(failure: str) -> Any:
    """The damaged input in a failure's words (faults.put_damage)."""
    first = failure.partition("\n")[0]
    return json.loads(first[first.index("{") :])


COUNTED = """Calls are counted in a run without a failure; then the command is run again for each of them, which fails that once: an
open with EMFILE and with EACCES, a read, a write with ENOSPC and with EIO, a rename, an allocation of 16 KiB or more; "sector" is a read
that fails and with it every later one of the same place. A call that does not come in the second run is left out. Where the command ends
with 0 all the same, its output must be what it is without the failure (after an allocation: where it is one file). Processes that a command
starts are not reached.
"""


def calls(runs: list[dict[str, Any]], earlier: str = "") -> str:
    """Failing calls by kind and exit status, of each command's latest run; rows of an earlier page
    for commands that were not run."""
    latest = {run["counts"][0][0]: run for run in runs if run["counts"]}
    counts: Counter = Counter()
    for run in latest.values():
        for _, call, status, number in run["counts"]:
            counts[call, status] += number
    kinds = sorted({call for call, _ in counts})
    lines = [
        f"* {call}: "
        + ", ".join(f"{n} × exit {s}" for (c, s), n in sorted(counts.items()) if c == call)
        for call in kinds
    ]
    most = sorted({run["most"] for run in latest.values()})
    samples = [run["sample"] for run in latest.values() if run.get("sample")]
    each = _either(sorted(set(samples)))
    sampled = f" (of {len(samples)} of them {each} of those, spread evenly)" if samples else ""
    broken = [failure for run in latest.values() for failure in run["failures"]]
    return (
        f"## Failing calls\n\nThe first {_either(most)} of each kind that each of"
        f" {len(latest)} commands makes below its folder{sampled}, one at a time:"
        f" {sum(counts.values())} in all, {_whose(broken)}\n\n{COUNTED}\n"
        + "\n".join(lines)
        + f"\n\n| command | {' | '.join(kinds)} | broke |\n|---|{'---|' * (len(kinds) + 1)}\n"
        + "\n".join(_calls_row(name, latest[name], kinds) for name in sorted(latest))
        + "\n\n"
        + _not_again(earlier, set(latest))
        + LIBRARY
    )


def _not_again(earlier: str, run: set[str]) -> str:
    """The tables of an earlier page, less the commands that were run since; empty where none is
    left."""
    tables = []
    for block in (part.strip() for part in earlier.split("\n\n")):
        if not block.startswith("| command |"):
            continue
        head, line, *rows = block.splitlines()
        if left := [row for row in rows if row.split("|")[1].strip() not in run]:
            tables.append("\n".join([head, line, *left]) + "\n\n")
    return "Not run again; as earlier code left them:\n\n" + "".join(tables) if tables else ""


INSIDE = {
    "crashed inside _multiarray_umath": "inside numpy",
    "failed init": "by words of numpy's LAPACK",
    "crashed inside libhdf5": "inside HDF5",
    "crashed inside libllvmlite": "inside LLVM",
    "LLVM ERROR": "inside LLVM",
}
"""What a failure says (fail_nth.c names the library a crash was in), and what the page says."""


def _whose(broken: list[str]) -> str:
    """How many failing calls broke a promise, in which library, and each that was in none."""
    if not broken:
        return "none broke a promise."
    places: Counter = Counter()
    own = []
    for failure in broken:
        where = next((said for words, said in INSIDE.items() if words in failure), "")
        places[where] += 1
        if not where:
            own.append(re.sub(r"\s*\n\s*", " ", failure.strip()))
    told = [f"{number} {where}" for where, number in sorted(places.items()) if where]
    told += [f"{len(own)} in this program" if own else "none in this program"]
    return f"{len(broken)} broke a promise: {', '.join(told)}." + "".join(
        f"\n* broken: {failure[:300]}" for failure in own
    )


def _either(numbers: list[int]) -> str:
    return " or ".join(map(str, numbers))


def _calls_row(name: str, run: dict[str, Any], kinds: list[str]) -> str:
    counts = Counter()
    for _, call, _, number in run["counts"]:
        counts[call] += number
    cells = (str(counts[kind] or "") for kind in kinds)
    return f"| {name} | {' | '.join(cells)} | {len(run['failures']) or ''} |"


def kills(runs: list[dict[str, Any]]) -> str:
    """Kills by command and by when they fell, over all runs."""
    counts: Counter = Counter()
    for run in runs:
        for name, how, number in run["counts"]:
            counts[name, how] += number
    whole, broken = sum(counts.values()), sum(len(run["failures"]) for run in runs)
    when = ("before", "within", "after")
    rows = [
        f"| {name} | " + " | ".join(str(counts[name, how] or "") for how in when) + " |"
        for name in sorted({name for name, _ in counts})
    ]
    return (
        f"## Kills\n\n{whole} commands killed (SIGKILL) at a random instant, looked at, and run"
        f" again: {broken} broke a promise. Columns: before anything was written, while it was,"
        f" after the command had ended.\n\n| command | {' | '.join(when)} |\n|---|---|---|---|\n"
        + "\n".join(rows)
        + "\n"
    )


def sizes(runs: list[dict[str, Any]]) -> str:
    """The largest log that went through the chain, and the largest lot."""
    logs = [run for run in runs if "peak_mb" in run]
    lots = [run for run in runs if "lots" in run]
    lines = []
    if logs:
        told = max(logs, key=lambda run: run["bytes"])
        peaks = ", ".join(f"{name} {mb:.0f} MB" for name, mb in told["peak_mb"].items())
        lines.append(f"* A log of {told['bytes'] / 1e9:.2f} GB: peak memory of {peaks}.")
    if lots:
        few, many = max(lots, key=lambda run: run["lots"][1]["gyros"])["lots"]
        lines.append(
            f"* A lot of {many['gyros']} tiny gyros in one process: {many['begun_mb']:.0f} MB after a"
            f" tenth of them, {many['ended_mb']:.0f} MB after all, {many['files']:.0f} open files at"
            f" most ({few['gyros']} gyros: {few['files']:.0f})."
        )
    return "## Sizes\n\n" + "\n".join(lines) + "\n"


def mutants(told: dict[str, Any]) -> str:
    """The mutation score and the survivors."""
    rows = told["changes"]
    left = [row for row in rows if row["verdict"] == "survived"]
    lines = [f"* `{row['file']}`: `{row['old']}` → `{row['new']}`" for row in left]
    return (
        f"## Mutations\n\n{len(rows)} of {told['listed']} listed changes were run on the code as it is now;"
        f" {len(rows) - len(left)} were seen by a test"
        f" ({100 * (len(rows) - len(left)) / max(len(rows), 1):.1f} %)."
        + (" Survivors:\n\n" + "\n".join(lines) if left else "")
        + "\n"
    )


PARTS = (
    ("damage", "Damaged inputs", damage),
    ("calls", "Failing calls", calls),
    ("kills", "Kills", kills),
    ("sizes", "Sizes", sizes),
)


def page(folder: Path, before: str = "") -> str:
    """The whole page: the parts that were run, and of an earlier page those that were not."""
    kept = sections(before)
    parts = [HEAD]
    for name, title, told_runs in PARTS:
        if (folder / f"{name}.jsonl").exists():
            text = (folder / f"{name}.jsonl").read_text()
            rows = [json.loads(line) for line in text.splitlines()]
            earlier = kept.get(title, "")
            parts.append(
                calls(rows, earlier)
                if name == "calls"
                else told_runs(rows) + on_earlier_code(told_runs(rows), earlier)
            )
        elif title in kept:
            parts.append(kept[title])
    if (folder / "mutants.json").exists():
        parts.append(mutants(json.loads((folder / "mutants.json").read_text())))
    elif "Mutations" in kept:
        parts.append(kept["Mutations"])
    return "\n".join(parts)


EARLIER = "On earlier code: "


def on_earlier_code(now: str, earlier: str) -> str:
    """What an earlier page's part came to, in a line: figures gather over months, each of the code
    of its day. Of sizes, those that were not measured again."""
    lines = [line for line in earlier.splitlines() if line and not line.startswith(("#", "|"))]
    if now.startswith("## Sizes"):
        kinds = {line[:7] for line in now.splitlines()}
        again = {line.partition(":")[0] for line in now.splitlines()}
        left = [line for line in lines if line.partition(":")[0] not in again]
        said = (f"* {EARLIER}{one[2:]}" if one[:7] in kinds else one for one in left)
        return "".join(f"{line}\n" for line in said)
    before = [line for line in lines if line.startswith(EARLIER)]
    if lines and lines[0] not in now.splitlines():
        before.append(EARLIER + lines[0].replace(" The table has how these end now.", ""))
    return "".join(f"\n{line}\n" for line in before)


def sections(text: str) -> dict[str, str]:
    """The parts of a page by their titles."""
    found = text.split("\n## ")[1:]
    return {part.partition("\n")[0]: f"## {part.rstrip()}\n" for part in found}


if __name__ == "__main__":
    targets = [Path(name) for name in sys.argv[1:]]
    earlier = targets[0].read_text(encoding="utf-8") if targets and targets[0].exists() else ""
    text = page(KEPT, earlier)
    print(text)
    for target in targets:
        target.write_text(text, encoding="utf-8")
