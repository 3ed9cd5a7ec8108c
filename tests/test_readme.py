"""The documentation tells no lie: its generated parts are fresh, its commands run and print what is
shown, its links lead somewhere.

`python tests/test_readme.py` writes the printed outputs and the generated parts anew.
"""

import os
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from hrg_cli import Calibration, Recording, store
from hrg_cli.handbook import pages

ROOT = Path(__file__).parent.parent
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs").rglob("*.md"))]
SAID = re.compile(
    r"<!-- commands run by a test -->\n```sh\n(?P<commands>.*?)```(?:\n\n<!-- output of these"
    r" commands -->\n```text\n(?P<output>.*?)```)?",
    re.S,
)
RUN = [(page, found) for page in PAGES for found in SAID.finditer(page.read_text(encoding="utf-8"))]
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
LONGEST_README = 150


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def run(commands: str, folder: Path) -> str:
    """Standard output of the commands in a folder that looks like a clone's root."""
    for part in ("configs", "sample_data"):
        shutil.copytree(ROOT / part, folder / part)
    hrg = folder / "bin" / "hrg"
    hrg.parent.mkdir()
    hrg.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m hrg_cli.cli "$@"\n')
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
    return done.stdout


def words_and_numbers(text: str) -> tuple[list[str], list[float]]:
    """Words with a # for each number, and the numbers; errors in brackets, as in 3.181(6), are left
    out."""
    text = re.sub(r"\(\d+\)", "", text)
    return NUMBER.sub("#", text).split(), [float(found) for found in NUMBER.findall(text)]


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_generated_parts_are_fresh(page):
    text = page.read_text(encoding="utf-8")
    assert pages.renewed(text) == text, "run `python -m hrg_cli.handbook README.md docs`"


def test_every_generated_part_stands_somewhere():
    written = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    for part in pages.PARTS:
        assert f"<!-- generated: {part} -->" in written


@pytest.mark.parametrize(
    ("page", "said"), RUN, ids=[f"{name(page)}-{k}" for k, (page, _) in enumerate(RUN)]
)
def test_commands_run_and_print_what_is_shown(page, said, tmp_path):
    """The words are the same; the numbers within 5 % or a few of their last digits, as another
    processor rounds otherwise."""
    printed = run(said["commands"], tmp_path)
    if said["output"] is None:
        return
    words, numbers = words_and_numbers(printed)
    shown_words, shown_numbers = words_and_numbers(said["output"])
    assert words == shown_words, "run `python tests/test_readme.py`"
    np.testing.assert_allclose(numbers, shown_numbers, rtol=0.05, atol=1e-9)


def test_every_equation_of_the_papers_has_a_command_that_is_run():
    """Seed A (1) to (17) and seed B (1), (2) stand in the papers' table, each beside a command of
    the page's block; those of the block that make something of a gyro all stand in the table."""
    page = ROOT / "docs" / "explanation" / "papers.md"
    (said,) = (found for of, found in RUN if of == page)
    commands = said["commands"].splitlines()
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


def test_validation_names_tests_that_exist():
    page = (ROOT / "docs" / "explanation" / "validation.md").read_text(encoding="utf-8")
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


def renew() -> None:
    """Write the outputs that the commands print now, and the generated parts."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for found in reversed(list(SAID.finditer(text))):
            if found["output"] is not None:
                with tempfile.TemporaryDirectory() as folder:
                    printed = (
                        "\n".join(
                            line.rstrip()
                            for line in run(found["commands"], Path(folder)).splitlines()
                        )
                        + "\n"
                    )
                text = text[: found.start("output")] + printed + text[found.end("output") :]
        page.write_text(pages.renewed(text), encoding="utf-8")


if __name__ == "__main__":
    renew()
