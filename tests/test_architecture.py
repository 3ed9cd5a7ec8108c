"""Imports run one way, and what must stay light stays light."""

import ast
import fnmatch
import functools
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest

import hrg_cli
from hrg_cli import Recording, store

PACKAGE = Path(hrg_cli.__file__).parent
BASE = {"units", "errors", "version", "extras", "threads", "allocation"}
FITS = {*BASE, "fourier", "least_count", "records", "physics", "effects"}
STAGES = {*FITS, "fitting", "settings"}
FILES = {*BASE, "least_count", "records", "settings", "store"}
PAGES = {*STAGES, "stages", "store", "pipeline", "limit_values", "limits", "holding"}
CHAIN = {*PAGES, "formats", "origins", "sources", "executors", "extended", "memory", "rehearsal"}
RESULTS = {
    *("measured_export", "exporting_records", "exporting", "comparing"),
    *("verification", "signatures"),
}
MAY_IMPORT: dict[str, set[str]] = {
    "units": set(),
    "errors": set(),
    "extras": set(),
    "version": set(),
    "threads": set(),
    "allocation": set(),
    "streams": {"errors"},
    "fourier": set(),
    "least_count": set(),
    "settings": {"errors"},
    "notebook": {"errors", "extras"},
    "executors": {"errors", "extras", "threads"},
    "limit_values": {"units", "errors"},
    "physics": {"units", "errors"},
    "effects": {"units", "errors", "physics"},
    "records": {"units", "errors", "fourier", "notebook"},
    "fitting": FITS,
    "store": {*BASE, "records"},
    "stages": STAGES,
    "studies": {*STAGES, "stages", "executors"},
    "formats": FILES,
    "origins": FILES,
    "memory": FILES,
    "verification": FILES,
    "signatures": FILES,
    "exporting_records": {*FILES, "reporting"},
    "limits": {*STAGES, "stages", "limit_values"},
    "holding": {"errors", "limit_values", "limits", "records"},
    "measured_export": {*STAGES, "stages"},
    "extended": {*STAGES, "stages", "store"},
    "sources": {*FILES, "origins"},
    "pipeline": {*FILES, "stages", "origins", "sources"},
    "comparing": {*BASE, "records", "limit_values", "limits"},
    "reporting": PAGES,
    "exporting": {*BASE, "records", "stages", "measured_export", "reporting"},
    "rehearsal": {*FILES, "stages", "executors", "pipeline"},
    "chain": CHAIN,
    "gyro": {*CHAIN, "chain"},
    "lots": {*CHAIN, "chain", "reporting"},
    "ledger": {*FILES, *RESULTS, "origins", "limit_values", "limits", "lots", "reporting"},
    "commands": {
        *CHAIN,
        *RESULTS,
        "chain",
        "gyro",
        "reporting",
        "lots",
        "ledger",
        "studies",
        "streams",
    },
    "front_page": set(),
    "group": {*BASE, "front_page", "commands"},
    "cli": {*BASE, "streams", "front_page", "group"},
    "__main__": {"cli"},
    "__init__": {*BASE, "records", "store", "stages", "reporting"},
}
"""Room (folder or module of the package) -> the rooms below it that it may import."""
LIVES_IN = {
    "reporting/lot_page.py": "lots",
    "reporting/ledger_tables.py": "ledger",
    "reporting/ledger_page.py": "ledger",
    "reporting/figures/ledger.py": "ledger",
}
"""Pages and tables of one room alone, kept beside the others for what they share with them."""
NUMPY_ONLY = {"physics", "effects"}

MODULES = {
    ".".join((PACKAGE.name, *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    ): path
    for path in sorted(PACKAGE.rglob("*.py"))
}
Graph = Mapping[str, set[str]]


def room_of(name: str) -> str:
    """The room of a module: its folder in the package, or itself."""
    inside = MODULES[name].relative_to(PACKAGE)
    return LIVES_IN.get(inside.as_posix(), inside.parts[0].removesuffix(".py"))


def imported_modules(name: str) -> Iterator[str]:
    """Every module of the package that a module imports, wherever in it: at its top, in a function,
    for a type checker alone, or by `import_module` of a text."""
    path = MODULES[name]
    package = name.split(".") if path.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            base = package[: len(package) - node.level + 1] if node.level else []
            module = ".".join([*base, *([node.module] if node.module else [])])
            for alias in node.names:
                whole = f"{module}.{alias.name}"
                yield from [whole] if whole in MODULES else [module] if module in MODULES else []
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in MODULES)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            yield from fnmatch.filter(MODULES, _pattern(node.args[0]))


def _pattern(text: ast.expr) -> str:
    """The modules that a text may name, as a pattern; none where it is a variable."""
    if isinstance(text, ast.JoinedStr):
        parts = (p.value if isinstance(p, ast.Constant) else "*" for p in text.values)
        return "".join(map(str, parts))
    return str(text.value) if isinstance(text, ast.Constant) else ""


def outside(path: Path) -> set[str]:
    """Packages from outside that a module imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and not node.level:
            found.add((node.module or "").split(".")[0])
        elif isinstance(node, ast.Import):
            found |= {a.name.split(".")[0] for a in node.names}
    return found


@functools.cache
def module_graph() -> Graph:
    """Module -> the modules it imports."""
    return {name: set(imported_modules(name)) - {name} for name in MODULES}


def find_circles(edges: Graph) -> dict[str, set[str]]:
    """What is left of a graph when all that points nowhere, or that nothing points at, is taken off
    again and again: its circles, and what lies between them."""
    left = {node: set(there) & edges.keys() for node, there in edges.items()}
    while True:
        pointed_at = set().union(*left.values())
        circling = {node for node, there in left.items() if there and node in pointed_at}
        if len(circling) == len(left):
            return left
        left = {node: left[node] & circling for node in circling}


@pytest.mark.parametrize("name", MODULES)
def test_imports_run_one_way(name: str) -> None:
    room = room_of(name)
    rooms = {room_of(there) for there in module_graph()[name]} - {room}
    assert rooms <= MAY_IMPORT[room], f"{room} may import {sorted(MAY_IMPORT[room])} only"
    packages = outside(MODULES[name])
    if room in NUMPY_ONLY:
        assert packages - set(sys.stdlib_module_names) <= {"numpy", "numba"}
    assert "h5py" not in packages or room in ("store", "formats")


def test_no_module_imports_one_that_imports_it() -> None:
    """A circle hidden in a function or from all but a type checker is one too."""
    assert find_circles(module_graph()) == {}


def test_rooms_are_floors() -> None:
    """The rules themselves hold no circle, and speak of every room."""
    assert find_circles(MAY_IMPORT) == {}
    assert {room_of(name) for name in MODULES} == set(MAY_IMPORT)


def test_circles_and_late_imports_are_seen() -> None:
    assert find_circles({"a": {"b"}, "b": {"c"}, "c": set()}) == {}
    circle = {"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}
    assert find_circles(circle) == {"b": {"c"}, "c": {"b"}}
    assert "hrg_cli.stages.identify" in set(imported_modules("hrg_cli.pipeline"))  # by its name
    assert "hrg_cli.formats" in set(imported_modules("hrg_cli.gyro"))  # in a function


def test_help_loads_nothing_heavy():
    code = """
import sys
from hrg_cli.cli import main
sys.argv = ['hrg', '--help']
try:
    main()
except SystemExit:
    pass
print([m for m in ('typer', 'numpy', 'h5py', 'pandas', 'pydantic', 'scipy') if m in sys.modules])
"""
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert out.rstrip().endswith("[]"), out.splitlines()[-1]


def test_a_stage_loads_no_other_stage(tmp_path: Path) -> None:
    """A quiet `demodulate` loaded the simulation, the diagnosis and the rehearsal: half of its
    second on a short recording."""
    t = np.arange(8000) / 8000
    noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    c, s = np.array([[1.0], [0.1]]) * np.cos(2 * np.pi * 1000 * t) + noise
    run = Recording(c=c, s=s, sample_rate_hz=8000.0, mode="free")
    store.write(tmp_path / "run.h5", run)
    code = f"""
import sys
from hrg_cli.cli import main
sys.argv = ['hrg', 'demodulate', {str(tmp_path / "run.h5")!r}, '-o', {str(tmp_path / "p.h5")!r}, '-q']
try:
    main()
except SystemExit as left:
    assert not left.code, left.code
stages = {{m.split('.')[2] for m in sys.modules if m.startswith('hrg_cli.stages.')}}
print(sorted(stages - {{'demodulate', 'demodulation'}}), 'hrg_cli.effects' in sys.modules)
"""
    out = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert out.split() == ["[]", "False"], out


SHAPES = PACKAGE / "reporting" / "json_shapes"
"""Shapes of the JSON have the names of the records that they show."""
TWICE = {"Place"}
"""Classes of the diagnosis that still share a name."""


def test_a_class_has_a_name_of_its_own() -> None:
    """Two classes of one name are read as one: no two rooms, nor the standard library's Path."""
    found: dict[str, list[str]] = {"Path": ["pathlib"]}
    for path in MODULES.values():
        if SHAPES in path.parents:
            continue
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                found.setdefault(node.name, []).append(path.relative_to(PACKAGE).as_posix())
    twice = {name: where for name, where in found.items() if len(where) > 1}
    assert set(twice) <= TWICE, twice


FACES = ("commands/", "studies/", "reporting/", "records/")
"""Rooms of one thing's command, study, page and record: these share its name with its stage."""
SAME_PART = {
    "report": "the JSON of a result: of the diagnosis, of the ledger",
    "record": "what makes the record of a stage: of the diagnosis, of the calibration",
    "continuity": "angles and phases made continuous: through a stream, along a run",
}
"""Names that two modules share because they do the same in two places."""


def test_a_module_has_a_name_of_its_own() -> None:
    """`table` was a tabulated calibration, a foreign log and a part of a simulation file."""
    found: dict[str, list[str]] = {}
    for path in MODULES.values():
        inside = path.relative_to(PACKAGE).as_posix()
        stage = inside.startswith("stages/") and inside.count("/") == 1
        if not stage and not inside.startswith(FACES) and not path.stem.startswith("__"):
            found.setdefault(path.stem, []).append(inside)
    twice = {name: where for name, where in found.items() if len(where) > 1}
    assert set(twice) == set(SAME_PART), twice


NO_ROOMS = {"helpers", "oracles", "robustness", "mutants", "handbook"}
"""Folders of the tests that are of no room: what tests share, programmes, the documentation."""


def test_tests_mirror_the_package() -> None:
    """The tests of a folder stand in a folder of its name, each under a name of its own."""
    tests = Path(__file__).parent
    found = [path.relative_to(tests) for path in sorted(tests.rglob("test_*.py"))]
    folders = {path.parent for path in found if path.parts[0] not in NO_ROOMS}
    assert not [str(folder) for folder in folders if not (PACKAGE / folder).is_dir()]
    assert len({path.name for path in found}) == len(found)


LONGEST_BODY = 45
"""Lines of a function without its signature and docstring: what a reader sees at once."""
MAY_BE_LONGER = {
    "physics/fast_loop.py: advance": "compiled: one pass over the samples, no calls of objects",
}
"""Functions above it, each with its reason."""


def body_lines(function: ast.FunctionDef | ast.AsyncFunctionDef) -> int:
    """Lines from the first statement after the docstring to the last."""
    body = function.body[1:] if ast.get_docstring(function) else function.body
    return (function.end_lineno or 0) - body[0].lineno + 1 if body else 0


def test_a_body_is_seen_at_once() -> None:
    """The longest had 174 lines; an exception that is none any more is taken off the list."""
    long = {
        f"{path.relative_to(PACKAGE).as_posix()}: {node.name}"
        for path in MODULES.values()
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and body_lines(node) > LONGEST_BODY
    }
    assert long == set(MAY_BE_LONGER)


MAY_PRINT = {"console", "guard", "cli", "group", "common", "frame", "version"}
"""Words of the program alone, names handed to the next command of a pipe, and what is made safe."""


def test_words_of_files_go_to_the_terminal_by_one_door() -> None:
    """`print` of a gyro's name let its escape sequences through (`ledger add`)."""
    found = {
        f"{path.relative_to(PACKAGE)}: {node.lineno}"
        for path in PACKAGE.rglob("*.py")
        if path.stem not in MAY_PRINT
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "print"
    }
    assert not found, f"{found}: console.say() leaves out what steers a terminal"
