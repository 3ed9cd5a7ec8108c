"""The files for engines in configs/: their commands exist, the Snakefile runs, and the container's
steps work in an empty environment (no container is built here)."""

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest
import typer.main
from conftest import ringing

from docs.handbook.man_page import list_commands
from hrg_cli import store
from hrg_cli.cli import app
from hrg_cli.ledger import database

ROOT = Path(__file__).parent.parent
CONFIGS = ROOT / "configs"
COMMANDS = list_commands(typer.main.get_command(app))
CLEAN = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}


def commands_in(text):
    """(command, options) of every hrg command in a file of an engine."""
    for said in re.findall(r"(?:\bhrg|\{HRG\}|\$\(HRG\)) ([a-z][^|;\n]*)", text):
        words = re.findall(r"[^\s\"`]+", said)
        name = " ".join(words[:2]) if words[0] == "ledger" else words[0]
        if name in COMMANDS or words[0] == "ledger":
            yield name, [w for w in words if re.fullmatch(r"--?[a-z][a-z-]*", w)]


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Snakefile", {"run", "ledger add", "ledger show"}),
        ("Containerfile", {"run"}),
        ("ci_workflow.yml", {"run", "check"}),
        ("pipeline.mk", {"demodulate", "identify", "calibrate", "report"}),
    ],
)
def test_commands_and_options_exist(name, expected):
    found = list(commands_in((CONFIGS / name).read_text(encoding="utf-8")))
    assert expected <= {command for command, _ in found}
    for command, options in found:
        assert set(options) <= {o for p in COMMANDS[command].params for o in p.opts}, command


def snakemake(tmp_path):
    """The engine: the installed one, else one installed into an environment of its own."""
    found = shutil.which("snakemake")
    if found is None:
        venv.create(tmp_path / "engine", with_pip=True)
        pip = [str(tmp_path / "engine" / "bin" / "pip"), "install", "--quiet", "snakemake>=9"]
        subprocess.run(pip, env=CLEAN, check=True)
        found = str(tmp_path / "engine" / "bin" / "snakemake")
    return found


@pytest.mark.slow
def test_snakefile_makes_a_task_of_every_gyro(tmp_path):
    """Needs snakemake or a package index. Three gyros, one damaged: the others are entered; one
    changed: that one alone is done again."""
    engine = snakemake(tmp_path)
    lab = tmp_path / "a lab"
    (lab / "bin").mkdir(parents=True)
    (lab / "bin" / "hrg").write_text(
        f'#!/bin/sh\nexec env PYTHONPATH="{ROOT}" "{sys.executable}" -m hrg_cli.cli "$@"\n'
    )
    (lab / "bin" / "hrg").chmod(0o755)
    shutil.copy(CONFIGS / "Snakefile", lab)
    for gyro in ("SN-1", "SN 2", "SN-3"):
        (lab / "recordings" / gyro).mkdir(parents=True)
        record = ringing(seconds=0.4, gyro_id=gyro, run_id=gyro)
        store.write(lab / "recordings" / gyro / "free.h5", record)
    damaged = lab / "recordings" / "SN-3" / "free.h5"
    damaged.write_bytes(damaged.read_bytes()[:3000])
    (lab / "chain.toml").write_text("[demodulate]\nperiods_per_window = 4.0\n")

    def run(*options):
        given = ["--config", "station=2", "settings=chain.toml"]
        return subprocess.run(
            [engine, "--cores", "1", "--keep-going", *options, *given],
            cwd=lab,
            env=CLEAN | {"PATH": f"{lab / 'bin'}:{os.environ['PATH']}", "HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )

    first = run()
    assert first.returncode == 1 and "free.h5" in first.stdout + first.stderr
    entered = database.read_entries(lab / "results" / "ledger.sqlite")
    assert {e.gyro_id for e in entered} == {"SN-1", "SN 2"}
    assert {e.station for e in entered} == {"2"}
    settings = json.loads((lab / "results" / "SN 2" / "run.json").read_text())
    assert settings["status"] in ("valid", "suspect", "refused")
    shutil.rmtree(lab / "recordings" / "SN-3")
    again = run()
    assert again.returncode == 0, again.stderr[-2000:]
    assert "Nothing to be done" in again.stdout + again.stderr
    changed = ringing(seconds=0.4, angle_rad=0.8, gyro_id="SN-1", run_id="SN-1")
    store.write(lab / "recordings" / "SN-1" / "free.h5", changed, force=True)
    before = (lab / "results" / "SN 2" / "run.json").stat().st_mtime_ns
    last = run()
    assert last.returncode == 0, last.stderr[-2000:]
    assert (lab / "results" / "SN 2" / "run.json").stat().st_mtime_ns == before
    rows = database.read_entries(lab / "results" / "ledger.sqlite")
    count = [sum(e.gyro_id == gyro for e in entered) for gyro in ("SN-1", "SN 2")]
    assert [sum(e.gyro_id == g for e in rows) for g in ("SN-1", "SN 2")] == [2 * count[0], count[1]]


def instructions():
    """(word, rest) of the container file's lines."""
    text = (CONFIGS / "Containerfile").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [tuple(line.split(" ", 1)) for line in lines]


def test_container_copies_what_is_there():
    copied = [shlex.split(rest) for word, rest in instructions() if word == "COPY"]
    for *sources, _ in copied:
        for source in sources:
            assert (ROOT / source).exists(), source
    said = dict(instructions())
    assert json.loads(said["ENTRYPOINT"]) == ["hrg"] and json.loads(said["CMD"]) == ["--help"]


@pytest.mark.slow
def test_container_steps_work_in_an_empty_environment(tmp_path):
    """Needs a package index: what COPY copies, RUN runs there, ENTRYPOINT starts."""
    source = tmp_path / "source"
    source.mkdir()
    venv.create(tmp_path / "python", with_pip=True)
    path = f"{tmp_path / 'python' / 'bin'}:{os.environ['PATH']}"
    for word, rest in instructions():
        if word == "COPY":
            *names, target = shlex.split(rest)
            for name in names:
                place = source / target / name if target.endswith("/") else source / target
                copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
                copy(ROOT / name, place)
        elif word == "RUN":
            subprocess.run(["sh", "-ec", rest], cwd=source, env=CLEAN | {"PATH": path}, check=True)
    said = dict(instructions())
    shutil.rmtree(source)
    for arguments in (json.loads(said["CMD"]), ["effects", "gain_mismatch"]):
        words = [*json.loads(said["ENTRYPOINT"]), *arguments]
        done = subprocess.run(
            words,
            cwd=tmp_path,
            env=CLEAN | {"PATH": path},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0 and done.stdout, done.stderr
