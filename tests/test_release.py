"""What is released: metadata, the packed files, and (slowly) a wheel and an sdist that install and
work in an empty environment."""

import os
import re
import subprocess
import tomllib
import venv
import zipfile
from importlib import resources
from pathlib import Path

import pytest
from conftest import ringing

import hrg_cli
from hrg_cli import store
from hrg_cli.records import Periods

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PACKED = (
    "py.typed",
    "hrg.1",
    "reporting/base.html",
    "reporting/parts.html",
    "reporting/page.html",
    "reporting/page.css",
    "reporting/page.js",
    "reporting/plots.js",
    "reporting/surface.js",
    "reporting/lot.html",
)


def test_versions_agree():
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert PROJECT["project"]["version"] == hrg_cli.__version__
    assert re.search(r"^version: (\S+)$", citation, re.M)[1].strip('"') == hrg_cli.__version__
    assert f"## {hrg_cli.__version__}" in (ROOT / "CHANGELOG.md").read_text(
        encoding="utf-8"
    ).replace("[", "").replace("]", "")


def test_licence_and_citation():
    assert (
        "MIT" in (ROOT / "LICENSE").read_text(encoding="utf-8")
        and PROJECT["project"]["license"] == "MIT"
    )
    citation = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    for key in (
        "cff-version",
        "message",
        "title",
        "type",
        "authors",
        "abstract",
        "keywords",
        "license",
    ):
        assert re.search(rf"^{key}:", citation, re.M), key


def test_packed_files_are_declared():
    for name in PACKED:
        assert (resources.files("hrg_cli") / name).is_file()
        declared = PROJECT["tool"]["setuptools"]["package-data"]["hrg_cli"]
        assert any(Path(name).match(pattern) for pattern in declared), name


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["wheel", "sdist"])
def test_installs_and_works_in_an_empty_environment(kind, tmp_path):
    """Needs a package index: builds in isolation, installs the dependencies, runs the installed
    command."""
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}

    def run(*arguments):
        done = subprocess.run(
            [*map(str, arguments)],
            cwd=tmp_path,
            env=clean,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout[-1000:] + done.stderr[-2000:]
        return done.stdout

    source = tmp_path / "source"
    source.mkdir()
    for name in (
        "hrg_cli",
        "pyproject.toml",
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "CITATION.cff",
    ):
        (source / name).symlink_to(ROOT / name)
    for name, packages in (("builder", ["build"]), ("empty", [])):
        venv.create(tmp_path / name, with_pip=True)
        if packages:
            run(tmp_path / name / "bin" / "pip", "install", "--quiet", *packages)
    run(
        tmp_path / "builder" / "bin" / "python",
        "-m",
        "build",
        f"--{kind}",
        "--outdir",
        tmp_path / "dist",
        source,
    )
    (made,) = (tmp_path / "dist").iterdir()
    if kind == "wheel":
        names = zipfile.ZipFile(made).namelist()
        assert {f"hrg_cli/{name}" for name in PACKED} <= set(names)
        assert any(name.endswith("share/man/man1/hrg.1") for name in names)
        assert not any(name.startswith(("tests/", "benchmarks/")) for name in names)
    run(tmp_path / "empty" / "bin" / "pip", "install", "--quiet", f"{made}[report]")
    hrg = tmp_path / "empty" / "bin" / "hrg"
    assert run(hrg, "--version").split() == ["hrg", hrg_cli.__version__]
    assert "demodulate" in run(hrg, "--help") and "gain_mismatch" in run(hrg, "effects")
    store.write(tmp_path / "a.h5", ringing())
    run(hrg, "demodulate", "a.h5", "-o", "p.h5")
    run(hrg, "report", "p.h5", "-o", "p.html", "--full")
    assert len(store.read(tmp_path / "p.h5", Periods)) > 100 and "<svg" in (
        tmp_path / "p.html"
    ).read_text(encoding="utf-8")
    assert (tmp_path / "empty" / "share" / "man" / "man1" / "hrg.1").is_file()
