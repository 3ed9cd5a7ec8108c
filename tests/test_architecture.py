"""Imports run one way, and what must stay light stays light."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import hrg_cli

PACKAGE = Path(hrg_cli.__file__).parent
MAY_IMPORT = {
    "units": set(),
    "errors": set(),
    "extras": set(),
    "physics": {"units", "errors"},
    "effects": {"units", "errors", "physics"},
    "fitting": {"units", "errors", "records", "physics", "effects"},
    "notebook": {"errors", "extras"},
    "records": {"units", "errors", "notebook"},
    "store": {"units", "errors", "records"},
    "settings": {"errors"},
    "stages": {"units", "errors", "physics", "effects", "fitting", "records", "settings"},
    "formats": {"units", "errors", "extras", "records", "settings", "store"},
    "ledger": {
        *("errors", "records", "store", "origins", "limit_values", "limits", "comparing"),
        *("exporting_records", "lots", "reporting"),
    },
    "studies": {
        "units",
        "errors",
        "physics",
        "effects",
        "fitting",
        "records",
        "stages",
        "executors",
    },
}
NUMPY_ONLY = {"physics", "effects"}


def imported(path):
    """(names inside the package, names outside) that a module imports."""
    inside, outside = set(), set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.level:
            package = path.relative_to(PACKAGE).parts[:-1]
            base = package[: len(package) - node.level + 1]
            for name in (
                [node.module.split(".")[0]] if node.module else [a.name for a in node.names]
            ):
                inside.add((*base, name)[0])
        elif isinstance(node, ast.ImportFrom):
            outside.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.Import):
            outside |= {a.name.split(".")[0] for a in node.names}
    return inside, outside


@pytest.mark.parametrize(
    "path", sorted(PACKAGE.rglob("*.py")), ids=lambda p: str(p.relative_to(PACKAGE))
)
def test_imports_run_one_way(path):
    room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if room not in MAY_IMPORT:
        return
    inside, outside = imported(path)
    assert inside - {room} - {"__version__"} <= MAY_IMPORT[room], (
        f"{room} may import {MAY_IMPORT[room]} only"
    )
    if room in NUMPY_ONLY:
        assert outside - set(sys.stdlib_module_names) <= {"numpy", "numba"}
    assert "h5py" not in outside or room in ("store", "formats")


def test_help_loads_nothing_heavy():
    code = """
import sys
from hrg_cli.cli import main
sys.argv = ['hrg', '--help']
try:
    main()
except SystemExit:
    pass
print([m for m in ('numpy', 'h5py', 'pandas', 'pydantic', 'scipy') if m in sys.modules])
"""
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert out.rstrip().endswith("[]"), out.splitlines()[-1]
