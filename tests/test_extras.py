"""Without the optional packages: what can be done is done, what cannot says what to install."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import records_by_hand

from hrg_cli.extras import EXTRAS

ROOT = Path(__file__).parents[1]
SAMPLES = [str(ROOT / "sample_data" / f"free-{k}.h5") for k in (1, 2, 3, 4)]
BLOCKER = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {names!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Absent())
"""


def hrg_without(names, tmp_path):
    """`hrg` as an installation without these packages runs it, in a folder of its own."""
    (tmp_path / "absent").mkdir()
    (tmp_path / "absent" / "sitecustomize.py").write_text(BLOCKER.format(names=names))
    path = os.pathsep.join([str(tmp_path / "absent"), str(ROOT), os.environ.get("PYTHONPATH", "")])

    def hrg(*words):
        return subprocess.run(
            [sys.executable, "-m", "hrg_cli", *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=300,
        )

    return hrg


@pytest.fixture
def base(tmp_path):
    """`hrg` of a base installation with the compiler, which has tests of its own."""
    # markupsafe comes with jinja2 alone
    return hrg_without(sorted({*EXTRAS, "markupsafe"} - {"numba"}), tmp_path)


@pytest.fixture
def plain(tmp_path):
    """`hrg` without the compiler."""
    return hrg_without(["numba"], tmp_path)


def test_the_project_declares_the_extras_that_messages_name():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    optional = project["optional-dependencies"]
    for package, extra in EXTRAS.items():
        assert any(package in one.replace("[", " ").replace(">", " ") for one in optional[extra])
        assert not any(one.startswith(package) for one in project["dependencies"])
    assert set(EXTRAS.values()) <= set(optional["all"][0].split("[")[1][:-1].split(","))


def test_a_lot_without_a_page_names_none(base, tmp_path):
    """The last line of `hrg batch` named a page that no base installation had written."""
    listed = ", ".join(f'"{path}"' for path in SAMPLES[:2])
    (tmp_path / "lot.toml").write_text(f'recordings = [{listed}]\nstages = ["identify"]\n')
    made = base("batch", "lot.toml", "-o", "lot")
    assert not (tmp_path / "lot" / "lot.html").exists()
    assert "no page: pages and figures need matplotlib" in made.stdout, made.stderr
    assert "lot.html" not in made.stdout


def test_a_base_installation_calibrates_and_says_what_its_page_needs(base, tmp_path):
    made = base("run", *SAMPLES, "-o", "results")
    assert made.returncode == 0, made.stderr
    assert (tmp_path / "results" / "diagnosis.h5").is_file()
    assert not (tmp_path / "results" / "report.html").exists()
    said = made.stdout
    assert "no page: pages and figures need matplotlib" in said
    assert "pip install 'hrg-cli[report]'" in said
    assert json.loads((tmp_path / "results" / "run.json").read_text())["report"] is None


@pytest.mark.parametrize(
    ("words", "packages"),
    [
        (("report", SAMPLES[0], "-o", "page.html"), ("jinja2", "matplotlib")),
        (("report", SAMPLES[0], "--format", "png", "-o", "pictures"), ("jinja2", "matplotlib")),
        (("export", SAMPLES[0], "-o", "samples.parquet"), ("pyarrow",)),
        (("export", SAMPLES[0], "-o", "samples.xlsx"), ("openpyxl",)),
    ],
)
def test_what_an_absent_package_is_needed_for_fails_with_one_sentence(
    base, tmp_path, words, packages
):
    there = set(tmp_path.iterdir())
    failed = base(*words)
    assert failed.returncode == 1 and not failed.stdout
    (line,) = failed.stderr.splitlines()
    (extra,) = {EXTRAS[package] for package in packages}
    assert any(package in line for package in packages)
    assert f"pip install 'hrg-cli[{extra}]'" in line
    assert set(tmp_path.iterdir()) == there


def test_pages_of_a_ledger_and_a_rehearsal_ask_for_the_same_extra(base, tmp_path):
    """The ledger's page ended in an internal error: jinja2's own dependency was imported first."""
    records_by_hand.write_all(tmp_path)
    assert base("ledger", "add", "resonator.h5", "--ledger", "l.sqlite").returncode == 0
    failed = base("ledger", "show", "--ledger", "l.sqlite", "-o", "l.html")
    assert failed.returncode == 1 and not (tmp_path / "l.html").exists()
    assert "internal error" not in failed.stderr
    assert "pip install 'hrg-cli[report]'" in failed.stderr


def test_help_needs_no_optional_package(base):
    for words in (("--help",), ("report", "--help"), ("batch", "--help")):
        assert base(*words).returncode == 0


SHORT = """
[device]
frequency_hz = 1000.0
quality_factor = 20000.0
[recording]
sample_rate_hz = 8000.0
duration_s = 0.05
"""
SLOWLY = "simulating in plain Python"


def test_a_lot_of_recordings_is_not_said_to_be_simulated(plain, tmp_path):
    """`hrg batch` said so whatever its stages were."""
    listed = ", ".join(f'"{path}"' for path in SAMPLES[:2])
    (tmp_path / "lot.toml").write_text(f'recordings = [{listed}]\nstages = ["identify"]\n')
    made = plain("batch", "lot.toml", "-o", "lot", "--jobs", "2")
    assert made.returncode == 0 and SLOWLY not in made.stdout + made.stderr, made.stderr


@pytest.mark.parametrize("jobs", ["1", "2"])
def test_what_is_simulated_without_a_compiler_is_said_once(plain, tmp_path, jobs):
    """However many runs and processes there are; not of envelopes, and not quietly."""
    runs = '[[run]]\nrun_id = "a"\n[[run]]\nrun_id = "b"\n'
    (tmp_path / "file.toml").write_text(SHORT + runs)
    given = ("simulate", "file.toml", "--jobs", jobs, "--force", "-o", "made.h5")
    made = plain(*given)
    assert made.returncode == 0, made.stderr
    [said] = [line for line in made.stderr.splitlines() if SLOWLY in line]
    assert said.endswith("run pip install 'hrg-cli[fast]'") and "Warning" not in made.stderr
    assert SLOWLY not in plain(*given, "-q").stderr
    assert SLOWLY not in plain(*given, "--model", "slow").stderr


def test_an_effect_put_into_samples_is_not_simulated(plain):
    """`hrg inject` said so though no engine runs."""
    words = ("--effect", "gain_mismatch", "--set", "gain=0.01", "-o", "injected.h5")
    made = plain("inject", SAMPLES[0], *words)
    assert made.returncode == 0 and SLOWLY not in made.stderr, made.stderr
