"""A seeded sample of the faults that `make faults` puts into every command, every input that ever
broke a promise, and the judge itself."""

import itertools
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import importing_the_same

from hrg_cli.cli import COMMANDS
from robustness import calls, faults, judge, kills, page, programme, sizes

SEED = int(os.environ.get("HRG_TEST_SEED", "1"))
SAMPLE = 60


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    judge.warm()
    return programme.build(tmp_path_factory.mktemp("good"))


@pytest.mark.parametrize(
    "case", [case for case in programme.CASES if not case.costly], ids=lambda case: case.name
)
def test_good_inputs_break_no_promise(case, good, tmp_path):
    """The harness tests something: without a fault every command ends with a result."""
    if case not in programme.ready(good):
        pytest.skip(f"no library here writes {case.damaged[0]}")
    trial = faults.Trial(case, case.damaged[0], [])
    found = faults.attempt(trial, judge.run, good, tmp_path / "trial")
    assert found.status in (0, 3) and not found.broken, found


def test_damaged_inputs_break_no_promise(good, tmp_path):
    counts, failures = faults.put_damage(
        good, tmp_path / "trial", programme.ready(good, costly=False), SAMPLE, SEED, None
    )
    assert not failures, "\n".join(failures)
    assert sum(counts.values()) == SAMPLE


def test_what_broke_a_promise_once_does_not_again(good, tmp_path):
    _, failures = faults.replay(good, tmp_path / "trial")
    assert not failures, "\n".join(failures)


@pytest.mark.slow
@pytest.mark.parametrize("more", range(10))
def test_thousands_of_damaged_inputs(more, good, tmp_path):
    _, failures = faults.put_damage(
        good, tmp_path / "trial", programme.ready(good), 400, 1000 * SEED + more, None
    )
    assert not failures, "\n".join(failures)


def test_killed_commands_leave_nothing_half(good, tmp_path, monkeypatch):
    """A few commands killed at random instants; `make faults` kills all of them, and lots."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", kills.STAMP)
    cases = [case for case in programme.CASES if case.name in ("demodulate", "check resonator")]
    for case in cases:
        whole = kills.undisturbed(case, good, tmp_path / "trial")
        for part in (0.2, 0.6, 0.95):
            _, broken = kills.killed(case, good, tmp_path / "trial", part * whole.seconds, whole)
            assert not broken, f"{case.name}: {broken}"


def test_a_half_output_of_a_killed_command_is_seen(tmp_path):
    whole = kills.Whole(0, "digest", 1.0)
    (tmp_path / "out.h5").write_bytes(b"half")
    assert kills.half(tmp_path / "out.h5", whole) == ["a half out.h5"]
    (tmp_path / "lot" / "G1").mkdir(parents=True)
    (tmp_path / "lot" / "G1" / "wave.h5").write_bytes(b"half")
    assert "a half file" in kills.half(tmp_path / "lot", whole)[0]
    assert kills.half(tmp_path / "none.h5", whole) == []


@pytest.fixture(scope="module")
def shim(tmp_path_factory):
    """The library that makes calls fail."""
    made = tmp_path_factory.mktemp("shim") / "fail_nth.so"
    try:
        subprocess.run(
            ["cc", "-shared", "-fPIC", "-O1", "-o", str(made), str(calls.SHIM), "-ldl"],
            check=True,
            capture_output=True,
        )
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no C compiler here")
    return made


def test_calls_that_fail_break_no_promise(shim):
    """The first few calls of each kind of estimate and export, failing one at a time."""
    script = f"""
import sys, tempfile
from pathlib import Path
from robustness import calls, judge, programme
judge.warm()
folder = Path(tempfile.mkdtemp())
good = programme.build(judge.clean(folder / "good"))
cases = [case for case in programme.ready(good) if case.name in ("estimate", "export csv")]
for kind in {KINDS!r}:
    failing = [c for c in calls.CALLS if c[0] == kind][:1]
    counts, failures = calls.put_failures(good, folder / "trial", cases, 8, failing)
    print(kind, sum(n for (_, _, status), n in counts.items() if status == 1), *failures)
"""
    environment = importing_the_same() | {"LD_PRELOAD": str(shim), "HRG_FAULT_SHIM": str(shim)}
    done = subprocess.run(
        [sys.executable, "-c", script],
        capture_output=True,
        text=True,
        env=environment,
        timeout=600,
        check=True,
    )
    told = [line.split(" ", 2) for line in done.stdout.strip().splitlines()]
    assert [kind for kind, *_ in told] == list(KINDS)
    for kind, failed, *broken in told:
        assert int(failed) > 0, f"no {kind} failed: the shim did nothing"
        assert not broken, done.stdout


KINDS = ("open", "read", "sector", "write")


def test_another_result_than_without_the_failure_is_seen(good, tmp_path):
    """A read that failed cost a column, or the fingerprint of the samples, under exit 0."""
    case = next(case for case in programme.CASES if case.name == "info recording")
    trial = calls.Failing(case, "read", 3, 5)

    def run(words, folder, output, arm):
        output.write_text(told)
        return judge.Outcome(0, told, "", 0.0, 0.0)

    told = '{"status": "valid", "elapsed_s": 1.0}'
    whole = {case.name: kills.digest(write(tmp_path / "a.json", '{"status": "valid"}'))}
    assert not calls.attempt(trial, run, good, tmp_path / "trial", whole).broken
    told = '{"status": "valid", "rows": 3}'
    found = calls.attempt(trial, run, good, tmp_path / "trial", whole)
    assert found.broken == ["another result than without the failure"]


def write(path, text):
    path.write_text(text)
    return path


def test_calls_are_tried_evenly_or_all():
    assert calls.tried(5, 0) == [1, 2, 3, 4, 5] == calls.tried(5, 8)
    assert calls.tried(0, 3) == []
    some = calls.tried(200, 9)
    assert some[0] == 1 and some[-1] == 200 and len(some) == 9
    assert all(24 <= later - one <= 26 for one, later in itertools.pairwise(some))


def test_every_command_has_a_case():
    """A command without a case is a command without faults; those left out are named."""
    without = {"effects", "study"}  # a list that is printed, and experiments of the project's own
    named = {case.words[0] for case in programme.CASES}
    assert set(COMMANDS) - named == without


JUDGED = {
    "two sentences": (judge.Outcome(1, "", "hrg: a\nhrg: b\n", 0, 0), "not one sentence"),
    "a traceback": (
        judge.Outcome(1, "", "Traceback (most recent call last):", 0, 0),
        "a traceback",
    ),
    "words on standard output": (
        judge.Outcome(1, "x", "hrg: a\n", 0, 0),
        "standard output of a failed command",
    ),
    "a strange status": (judge.Outcome(70, "", "hrg: a\n", 0, 0), "ended with 70"),
    "no JSON": (judge.Outcome(0, "done", "", 0, 0), "no JSON object"),
    "too slow": (judge.Outcome(1, "", "hrg: a\n", 1e4, 0), "took 10000 s"),
    "too large": (judge.Outcome(1, "", "hrg: a\n", 0, 1e5), "took 100000 MB"),
    "colours": (judge.Outcome(1, "", "hrg: \x1b[31ma\n", 0, 0), "control characters"),
}


@pytest.mark.parametrize("what", JUDGED)
def test_the_judge_sees_broken_promises(what, tmp_path):
    outcome, says = JUDGED[what]
    assert any(
        says in sentence
        for sentence in judge._broken(outcome, tmp_path, tmp_path / "out.h5", set())
    )


def test_the_judge_sees_what_is_left_behind(tmp_path):
    for name in (".out.h5.hrg-1-1.tmp", "out.h5"):
        (tmp_path / name).write_text("half")
    said = judge._broken(
        judge.Outcome(1, "", "hrg: a\n", 0, 0), tmp_path, tmp_path / "out.h5", set()
    )
    assert any("behind" in sentence for sentence in said) and any(
        "an output of a failed" in sentence for sentence in said
    )
    (tmp_path / "t.csv").write_text("a,b\n1,nan\n")
    said = judge._broken(
        judge.Outcome(0, '{"status": "valid"}', "", 0, 0),
        tmp_path,
        tmp_path / "t.csv",
        {".out.h5.hrg-1-1.tmp", "out.h5"},
    )
    assert said == ["nan in t.csv of a valid result"]


def test_the_page_tells_what_broke_and_what_is_kept():
    kept = json.loads(faults.CORPUS.read_text())[0]
    lost = kept | {"input": "other.h5"}
    failures = [
        f"seed 1, trial 2: {json.dumps(entry)}\n  ended with 70\n  " for entry in (kept, lost)
    ]
    runs = [{"trials": 10, "failures": failures}, {"trials": 30, "failures": []}]
    said = page._what_broke(runs)
    assert said.startswith("2 broke a promise") and "1 of these are in the corpus" in said
    assert "none of the 30 inputs since" in said
    assert page._what_broke(runs[1:]) == "none broke a promise."


def test_the_page_shows_how_an_input_ends_since_it_was_mended():
    """Exits of code that was mended long ago stood in the table as if they were today's."""
    entry = json.loads(faults.CORPUS.read_text())[0]
    name = entry["case"]
    failure = f"seed 1, trial 2: {json.dumps(entry)}\n  ended with 70\n  "
    then = {
        "seed": 1,
        "trials": 2,
        "cpu_s": 0.1,
        "counts": [[name, 70, 1], [name, 0, 1]],
        "failures": [failure],
    }
    today = then | {"seed": 2, "counts": [[name, 0, 2]], "failures": []}
    assert "exit 70" in page.damage([then, today])
    said = page.damage([then, today | {"replayed": [[entry, 1]]}])
    assert "exit 70" not in said and f"| {name} | 3 | 1 |" in said
    assert "The table has how these end now." in said


def test_the_page_tells_in_which_library_a_failing_call_ended():
    """122 crashes of libraries and faults of this program were one number."""
    crash = "info: alloc 5 fails with ENOMEM: ended with -11 inside {0}\n  crashed inside {0}"
    broken = [crash.format("libhdf5-9e18.so.320"), crash.format("_multiarray_umath.so")]
    assert page._whose(broken) == (
        "2 broke a promise: 1 inside HDF5, 1 inside numpy, none in this program."
    )
    own = "plan: open 3 fails with EACCES: not one sentence\n  hrg: a\n  hrg: b"
    said = page._whose([*broken, own])
    assert "1 in this program." in said
    assert said.endswith("* broken: plan: open 3 fails with EACCES: not one sentence hrg: a hrg: b")
    assert page._whose([]) == "none broke a promise."


def test_commands_that_were_not_run_again_stay_on_the_page():
    """A run of one command dropped the figures of all others."""

    def run(name, status):
        counts = [[name, "read", status, 7]]
        return {"most": 200, "sample": 0, "counts": counts, "failures": []}

    before = page.calls([run("plan", 1), run("rate", 1)])
    after = page.calls([run("rate", 0)], before)
    assert "* read: 7 × exit 0" in after and after.count("| rate | 7 |") == 1
    assert "Not run again" in after and after.count("| plan | 7 |") == 1
    again = page.calls([run("rate", 0)], after)
    assert again == after
    assert "Not run again" not in page.calls([run("plan", 0), run("rate", 0)], after)


def test_what_was_not_run_stays_on_the_page(tmp_path):
    """The page of an empty folder had nothing but its head: figures of runs elsewhere were lost."""
    before = (Path(__file__).parents[2] / "docs" / "FAULTS.md").read_text(encoding="utf-8")
    assert page.page(tmp_path, before) == before
    log = {"bytes": 2_000_000_000, "peak_mb": {"import": 90.0}}
    (tmp_path / "sizes.jsonl").write_text(json.dumps(log) + "\n")
    after = page.page(tmp_path, before)
    titles = list(page.sections(after))
    assert titles == ["Damaged inputs", "Failing calls", "Kills", "Sizes", "Mutations"]
    assert "A log of 2.00 GB: peak memory of import 90 MB." in after
    kept = page.sections(before) | {"Sizes": ""}
    assert page.sections(after) | {"Sizes": ""} == kept


def test_figures_of_earlier_code_stay_on_the_page_in_a_line(tmp_path):
    """A short run on the newest code took the place of thousands of inputs."""
    run = {"seed": 7, "trials": 10, "cpu_s": 1.0, "counts": [["plan", 1, 10]], "failures": []}
    many = run | {"seed": 8, "trials": 20_000}
    lot = {"gyros": 70, "begun_mb": 1.0, "ended_mb": 1.0, "files": 5}
    log = {"bytes": 2e9, "peak_mb": {"import": 9.0}}
    before = f"# Faults\n\n{page.damage([many])}\n{page.sizes([{'lots': [lot, lot]}, log])}"
    (tmp_path / "damage.jsonl").write_text(json.dumps(run) + "\n")
    (tmp_path / "sizes.jsonl").write_text(json.dumps(log))
    after = page.page(tmp_path, before)
    said = page.sections(after)["Damaged inputs"]
    assert "10 inputs over 1 commands, seeds 7: none broke" in said
    assert said.count(page.EARLIER) == 1
    assert f"{page.EARLIER}20000 inputs over 1 commands, seeds 8: none broke" in said
    told = page.sections(after)["Sizes"]
    assert told.count("A log of") == 1 and told.count("A lot of") == 1
    assert page.page(tmp_path, after) == after
    few = lot | {"gyros": 50}
    (tmp_path / "sizes.jsonl").write_text(json.dumps({"lots": [few, few]}))
    told = page.sections(page.page(tmp_path, before))["Sizes"]
    assert "* A lot of 50 tiny" in told and f"* {page.EARLIER}A lot of 70 tiny" in told
    assert "* A log of 2.00 GB" in told


def test_sizes_that_grow_are_told():
    flat = {"begun_mb": 100.0, "ended_mb": 101.0, "files": 5}
    assert sizes.broken({"lots": [flat, flat]}) == []
    assert len(sizes.broken({"lots": [flat, flat | {"ended_mb": 200.0, "files": 50}]})) == 2
    assert sizes.broken({"peak_mb": {"import": 90.0, "identify": 301.0}}) == [
        "identify took 301 MB"
    ]
