"""The documentation tells no lie: its generated parts are fresh, its commands run and print what is
shown, its links lead somewhere.

`PYTHONPATH=tests/helpers python tests/test_readme.py [PAGE …]` writes the printed outputs and the generated parts anew.
"""

import os
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from warm_hrg import warm_hrg

from docs.handbook import pages
from hrg_cli import Calibration, Recording, store
from hrg_cli.formats import readers

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs").rglob("*.md"))]
SAID = re.compile(
    r"<!-- commands run by a (?P<slow>slow )?test(?P<after>, after those above)?"
    r"(?:, with (?P<given>[\w.]+))? -->\n```sh\n(?P<commands>.*?)```(?:\n\n<!-- output of these"
    r" commands -->\n```text\n(?P<output>.*?)```)?",
    re.S,
)


@dataclass(frozen=True)
class Said:
    """A block of commands on a page, with what goes before it."""

    page: Path
    found: re.Match[str]
    before: str
    """Commands of the page's blocks above that it goes on from."""

    @property
    def id(self) -> str:
        """The page and the block's place on it."""
        line = self.found.string.count("\n", 0, self.found.start()) + 1
        return f"{self.page.relative_to(ROOT)}-{line}"


def blocks(page: Path) -> list[Said]:
    """The blocks of a page that a test runs."""
    told: list[Said] = []
    for found in SAID.finditer(page.read_text(encoding="utf-8")):
        above = told[-1].before + told[-1].found["commands"] if found["after"] else ""
        told.append(Said(page, found, above))
    return told


RUN = [said for page in PAGES for said in blocks(page)]
SAMPLES = [said for said in RUN if said.found["slow"] and not said.before]
SHORTER = [("duration_s = 12.0", "duration_s = 6.0")]
"""A sample of a slow block runs on shorter recordings."""
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
COUNTED = re.compile(r"\ball \d+ [a-z]+")
LONGEST_README = 150
LONGEST_LINE = 200
"""Characters: two lines of a terminal."""


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def give(folder: Path, name: str | None) -> None:
    """A file that a block takes for granted, under its name there."""
    if name == "LOG":
        shutil.copy(ROOT / "sample_data" / "lab_log.csv", folder / name)
    elif name is not None:
        import records_by_hand as by_hand  # from another folder, which only pytest looks into

        store.write(folder / name, by_hand.RECORDS[Path(name).stem]())


PLAIN_HRG = f'#!/bin/sh\nexec "{sys.executable}" -m hrg_cli.cli "$@"\n'


@pytest.fixture(scope="module")
def warm(tmp_path_factory):
    """A script `hrg` that need not import what it calls."""
    with warm_hrg(tmp_path_factory.mktemp("warm"), ROOT) as script:
        yield script


def run(
    said: Said, folder: Path, shorter: Sequence[tuple[str, str]] = (), script: str = PLAIN_HRG
) -> str:
    """Standard output of the commands in a folder that looks like a clone's root; of those that go
    before them only the files."""
    for part in ("configs", "sample_data"):
        shutil.copytree(ROOT / part, folder / part)
    for config in (folder / "configs").glob("*.toml"):
        text = config.read_text(encoding="utf-8")
        for long, short in shorter:
            text = text.replace(long, short)
        config.write_text(text, encoding="utf-8")
    give(folder, said.found["given"])
    before = f"{{\n{said.before}}} > before.txt\n" if said.before else ""
    commands = before + said.found["commands"]
    hrg = folder / "bin" / "hrg"
    hrg.parent.mkdir()
    hrg.write_text(script)
    hrg.chmod(0o755)
    environment = os.environ | {
        "PATH": f"{hrg.parent}:{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
    }
    done = subprocess.run(
        ["bash", "-euxc", commands],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    told = [line for line in done.stderr.splitlines() if not line.startswith("+")]
    for line in [*done.stdout.splitlines(), *told]:
        assert len(line.rstrip()) <= LONGEST_LINE, line
    return done.stdout


def words_and_numbers(text: str) -> tuple[list[str], list[float]]:
    """Words with a # for each number, and the numbers; errors in brackets, as in 3.181(6), are left
    out."""
    text = re.sub(r"\(\d+\)", "", text)
    return NUMBER.sub("#", text).split(), [float(found) for found in NUMBER.findall(text)]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_generated_parts_are_fresh(page):
    text = page.read_text(encoding="utf-8")
    assert pages.renew_text(text) == text, "run `python -m docs.handbook README.md docs`"


def test_every_generated_part_stands_somewhere():
    written = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for part in pages.PARTS:
        assert f"<!-- generated: {part} -->" in written


def test_every_command_of_tutorials_and_howtos_is_run():
    for page in PAGES:
        if page.parent.name in ("tutorials", "howto"):
            text = page.read_text(encoding="utf-8")
            assert len(blocks(page)) == text.count("```sh\n"), (
                f"{name(page)}: a block without a test"
            )


@pytest.mark.parametrize(
    "said",
    [
        pytest.param(said, id=said.id, marks=[pytest.mark.slow] if said.found["slow"] else [])
        for said in RUN
    ],
)
def test_commands_run_and_print_what_is_shown(said, tmp_path, warm):
    """The words are the same, and what is counted in words ("all 22 closing checks"); the numbers
    within 5 % or a few of their last digits, as another processor rounds otherwise."""
    if "openssl" in said.found["commands"] and shutil.which("openssl") is None:
        pytest.skip("openssl is not here")
    printed = run(said, tmp_path, script=warm)
    if said.found["output"] is None:
        return
    words, numbers = words_and_numbers(printed)
    shown_words, shown_numbers = words_and_numbers(said.found["output"])
    assert words == shown_words, "run `python tests/test_readme.py`"
    assert COUNTED.findall(printed) == COUNTED.findall(said.found["output"])
    np.testing.assert_allclose(numbers, shown_numbers, rtol=0.05, atol=1e-9)


@pytest.mark.parametrize("said", SAMPLES, ids=[said.id for said in SAMPLES])
def test_slow_commands_run_on_shorter_recordings(said, tmp_path, warm):
    run(said, tmp_path, SHORTER, warm)


def test_every_equation_of_the_papers_has_a_command_that_is_run():
    """Seed A (1) to (17) and seed B (1), (2) stand in the papers' table, each beside a command of
    the page's block; those of the block that make something of a gyro all stand in the table."""
    page = ROOT / "docs" / "explanation" / "papers.md"
    (said,) = (said for said in RUN if said.page == page)
    commands = said.found["commands"].splitlines()
    rows = re.findall(r"^\| ([AB])(.*?) \| `(hrg .*?)` \|", page.read_text("utf-8"), re.M)
    told: dict[str, set[int]] = {"A": set(), "B": set()}
    for paper, equation, command in rows:
        assert command in commands, command
        for first, last in re.findall(r"\((\d+)\)(?:–\((\d+)\))?", equation):
            told[paper] |= set(range(int(first), int(last or first) + 1))
    assert told == {"A": set(range(1, 18)), "B": {1, 2}}
    kinds = {command.split()[1] for *_, command in rows}
    assert kinds == {line.split()[1] for line in commands if line.startswith("hrg ")}


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        if not target.startswith(("http://", "https://", "mailto:")):
            assert (page.parent / target).exists(), (
                f"{name(page)} links to {target}, which is not there"
            )


def test_flow_chart_is_fresh():
    made = runpy.run_path(str(ROOT / "docs" / "explanation" / "verdict_flow.py"))["chart"]()
    assert (ROOT / "docs" / "explanation" / "verdict.svg").read_text(encoding="utf-8") == made


@pytest.mark.slow
def test_picture_of_the_demonstration_is_todays(tmp_path):
    """README and index show what `make run` draws; some fifty pixels may differ, a changed number has
    more."""
    hrg = tmp_path / "bin" / "hrg"
    hrg.parent.mkdir()
    hrg.write_text(PLAIN_HRG)
    hrg.chmod(0o755)
    path = {"PATH": f"{hrg.parent}:{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    chain = ["bash", "configs/run_chain.sh", str(tmp_path / "run")]
    subprocess.run(chain, cwd=ROOT, env=os.environ | path, check=True, capture_output=True)
    made, shown = (
        imread(picture) for picture in (tmp_path / "run" / "answer.png", ROOT / "docs/answer.png")
    )
    renew = "run `make run` and copy build/run/answer.png to docs"
    assert made.shape == shown.shape, renew
    assert np.mean(np.abs(made - shown).max(axis=-1) > 0.2) < 1e-4, renew


def test_readme_is_short():
    assert len(README.read_text(encoding="utf-8").splitlines()) <= LONGEST_README


def test_every_page_is_in_the_site():
    listed = set(re.findall(r"[\w/-]+\.md", (ROOT / "mkdocs.yml").read_text(encoding="utf-8")))
    assert {str(page.relative_to(ROOT / "docs")) for page in PAGES if page != README} == listed


def test_citations_of_physics_resolve():
    """Every label that the code cites as PHYSICS … stands in docs/explanation/physics.md."""
    page = (ROOT / "docs" / "explanation" / "physics.md").read_text(encoding="utf-8")
    for path in sorted((ROOT / "hrg_cli").rglob("*.py")):
        for cited in re.findall(
            r"PHYSICS ((?:§\s?\d|[MRCE]\d+\w?)(?:(?:, | and | to )[MRCE]\d+\w?\b)*)",
            path.read_text(encoding="utf-8"),
        ):
            for label in re.findall(r"§\s?\d|[MRCE]\d+p?b?", cited):
                label = label.replace(" ", "")
                found = f"## {label} " in page if label.startswith("§") else f"**{label}**" in page
                assert found, f"{path.relative_to(ROOT)} cites {label}"


@pytest.mark.parametrize("which", ["validation", "papers"])
def test_a_page_names_tests_that_exist(which):
    page = (ROOT / "docs" / "explanation" / f"{which}.md").read_text(encoding="utf-8")
    named = re.findall(r"`(tests/[\w/]+\.py)::(\w+)`", page)
    assert len(named) > 20
    for file, test in named:
        text = (ROOT / file).read_text(encoding="utf-8")
        assert f"def {test}(" in text, f"{file} has no {test}"


def test_every_key_of_every_toml_file_has_a_meaning():
    empty = [
        line
        for line in (ROOT / "docs" / "reference" / "toml.md").read_text().splitlines()
        if line.startswith("| `") and line.rstrip().endswith("|  |")
    ]
    assert not empty


def test_library_example_runs(tmp_path, monkeypatch):
    """Four short forced runs on a turning table; the tables of the README's five lines hold the K
    that was put in."""
    (code,) = re.findall(
        r"## As a library\n\n```python\n(.*?)```", README.read_text(encoding="utf-8"), re.S
    )
    (tmp_path / "runs").mkdir()
    t, scale_factor = np.arange(0, 40, 1 / 1500), 0.55
    for k, rate in enumerate((-0.5, -0.3, 0.3, 0.5)):
        theta = 0.1 - scale_factor * rate * t / 2
        carrier = np.cos(2 * np.pi * 251.3 * t)
        noise = 1e-4 * np.random.default_rng(k).standard_normal((2, len(t)))
        log = dict(
            auxiliary_time_s=t[::1500],
            temperature_degc=np.full(len(t[::1500]), 20.0),
            rate_rad_s=np.full(len(t[::1500]), rate),
        )
        c, s = np.cos(2 * theta) * carrier + noise[0], np.sin(2 * theta) * carrier + noise[1]
        store.write(
            tmp_path / "runs" / f"{k}.h5",
            Recording(c=c, s=s, sample_rate_hz=1500.0, mode="forced", run_id=str(k), **log),
        )
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "README.md", "exec"), {})
    table = store.read(tmp_path / "calibration.h5", Calibration)
    assert (
        np.abs(table.scale_factor - scale_factor).max() < 1e-3
        and np.abs(table.drift_rad_s).max() < 1e-3
    )


def test_the_format_of_the_page_is_imported(tmp_path, monkeypatch, hrg):
    """The page's whole reader, one line in the table, a file of that format."""
    page = (ROOT / "docs" / "howto" / "add-a-format.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.S)
    module = {"__name__": "hrg_cli.formats.bench", "__package__": "hrg_cli.formats"}
    exec(compile(code, "add-a-format.md", "exec"), module)
    monkeypatch.setattr(readers, "READERS", (module["READER"], *readers.READERS))
    samples = np.arange(2000, dtype="<i2").reshape(-1, 2)
    log = b"MYLG" + np.array([8000.0], "<f8").tobytes() + samples.tobytes()
    (tmp_path / "run.mylg").write_bytes(log)
    assert hrg("import", tmp_path / "run.mylg", "-o", tmp_path / "run.h5").status == 0
    taken = store.read(tmp_path / "run.h5", Recording)
    assert taken.sample_rate_hz == 8000.0 and taken.c_scale_factor == 1e-4
    assert np.array_equal(np.column_stack([taken.c, taken.s]), samples)
    (tmp_path / "short.mylg").write_bytes(log[:8])
    short = hrg("import", tmp_path / "short.mylg", "-o", tmp_path / "short.h5")
    assert short.status == 1 and "ends within its head" in short.err


def renew(asked: Sequence[str]) -> None:
    """Write the outputs that the commands print now, and the generated parts, of the pages named or
    of all."""
    for page in [Path(name).resolve() for name in asked] or PAGES:
        text = page.read_text(encoding="utf-8")
        for said in reversed(blocks(page)):
            found = said.found
            if found["output"] is not None:
                with tempfile.TemporaryDirectory() as folder:
                    lines = run(said, Path(folder)).splitlines()
                printed = "\n".join(line.rstrip() for line in lines) + "\n"
                text = text[: found.start("output")] + printed + text[found.end("output") :]
        page.write_text(pages.renew_text(text), encoding="utf-8")


if __name__ == "__main__":
    renew(sys.argv[1:])
