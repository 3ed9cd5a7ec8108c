"""The examples in the docstrings of public functions run and print what they show; those functions
tell their parameters, results and errors."""

import ast
import doctest
import inspect
import pkgutil
import re
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import get_type_hints

import pytest

import docs.handbook
import hrg_cli
from hrg_cli.effects import EFFECTS, Effect, Parameter

FURTHER = {
    "hrg_cli.physics.ellipse": ["compute_envelopes", "find_wave"],
    "hrg_cli.limit_values": ["limit_value"],
    "hrg_cli.settings": ["parse_assignment"],
}
"""Functions with examples beside those that the package exports."""


def modules_of(package, deep=True):
    """Every module of a package of hrg_cli, those of its packages as well."""
    found = import_module(f"hrg_cli.{package}")
    walk = pkgutil.walk_packages if deep else pkgutil.iter_modules
    for module in walk(found.__path__, f"hrg_cli.{package}."):
        if not module.ispkg:
            yield module.name.removeprefix("hrg_cli.")


HELD = (
    *modules_of("physics"),
    *modules_of("store"),
    *modules_of("records"),
    *modules_of("formats"),
    *modules_of("reporting"),
    *modules_of("studies"),
    *modules_of("exporting"),
    *modules_of("ledger"),
    *(
        f"commands.{name}"
        for name in ("dry_run", "frame", "guard", "one_stage", "options", "pipes")
    ),
    "commands.told_differences",
    "effects",
    *modules_of("effects"),
    *("chain", "comparing", "errors", "executors", "exporting_records", "extended", "extras"),
    *("fourier", "gyro", "holding", "limit_values", "limits", "measured_export", "memory"),
    *("notebook", "origins", "pipeline", "rehearsal", "settings", "signatures", "streams"),
    *("threads", "units", "verification"),
    *modules_of("lots"),
    *modules_of("stages.planning"),
    *modules_of("stages.calibration"),
    *modules_of("stages.identification"),
    *modules_of("stages.rehearsing"),
    *modules_of("stages.simulation"),
    *modules_of("stages.compensation"),
    *modules_of("stages.demodulation"),
    *modules_of("stages.estimation"),
    *modules_of("stages.forecasting"),
    *modules_of("stages.injection"),
    *modules_of("stages", deep=False),
    "stages.diagnosis.drawn_case",
    *modules_of("stages.diagnosis.base"),
    *modules_of("stages.diagnosis.drive"),
    *modules_of("stages.diagnosis.samples"),
    *modules_of("stages.diagnosis.closing"),
    *modules_of("stages.diagnosis.extended"),
    *modules_of("stages.diagnosis.report"),
    *modules_of("stages.diagnosis.suspects"),
    *modules_of("stages.diagnosis.fits"),
    *modules_of("stages.diagnosis.search"),
    *modules_of("fitting"),
)
"""Modules that are told whole: every public function has its sections and an example."""
HANDBOOK = tuple(
    module.name for module in pkgutil.iter_modules(docs.handbook.__path__, "docs.handbook.")
)
"""What makes the documentation's generated parts, beside the package."""
TOLD_WHOLE = [
    import_module(name)
    for name in (*(f"hrg_cli.{held}" for held in HELD), *HANDBOOK)
    if not name.endswith("__main__")
]


def functions_of(module):
    """The public functions that a module defines; the terms of an effect are told by `Effect`."""
    terms = list(vars(module.EFFECT).values()) if hasattr(module, "EFFECT") else []
    for name, found in vars(module).items():
        one = inspect.unwrap(found) if callable(found) else found
        own = inspect.isfunction(one) and one.__module__ == module.__name__
        if own and not name.startswith("_") and one not in terms:
            yield f"{module.__name__.removeprefix('hrg_cli.')}.{name}", one


PUBLIC = {name: getattr(hrg_cli, name) for name in hrg_cli.__all__}
FUNCTIONS = {name: found for name, found in PUBLIC.items() if inspect.isfunction(found)}
EXAMPLES = FUNCTIONS | {
    name: getattr(import_module(module), name)
    for module, names in FURTHER.items()
    for name in names
}
for told in TOLD_WHOLE:
    EXAMPLES |= {
        place: function
        for place, function in functions_of(told)
        if function not in EXAMPLES.values()
    }
SHOWN_CLASSES = {
    f"{told.__name__.removeprefix('hrg_cli.')}.{name}": found
    for told in TOLD_WHOLE
    for name, found in vars(told).items()
    if inspect.isclass(found)
    and found.__module__ == told.__name__
    and ">>>" in (found.__doc__ or "")
}
"""Classes of those modules that have an example."""
METHODS = {
    found.__qualname__: found
    for cls in PUBLIC.values()
    if inspect.isclass(cls)
    for name, found in inspect.getmembers(cls, inspect.isroutine)
    if not name.startswith("_") and (getattr(found, "__module__", "") or "").startswith("hrg_cli")
}


def documented():
    """Functions of the reference's page, those of its modules as well."""
    page = Path(__file__).parents[1] / "docs" / "reference" / "python.md"
    for place in re.findall(r"^::: (\S+)$", page.read_text(encoding="utf-8"), re.M):
        found = pkgutil.resolve_name(place)
        if inspect.isfunction(found):
            yield place, found
        elif inspect.ismodule(found):
            exported = getattr(found, "__all__", vars(found))
            for name in exported:
                one = getattr(found, name)
                if inspect.isfunction(one) and (
                    hasattr(found, "__all__") or one.__module__ == found.__name__
                ):
                    yield f"{place}.{name}", one


TOLD = (
    EXAMPLES
    | METHODS
    | {place: found for place, found in documented() if found not in EXAMPLES.values()}
)
SHOWN = {
    name: found
    for name, found in TOLD.items()
    if name in EXAMPLES or ">>>" in (found.__doc__ or "")
}


SHOWN |= SHOWN_CLASSES


def find_other_examples():
    """Examples of all that is not told whole yet, and of methods: they too are read and believed."""
    seen = {inspect.getdoc(found) for found in SHOWN.values()}
    finder = doctest.DocTestFinder(exclude_empty=True)
    for module in pkgutil.walk_packages(hrg_cli.__path__, "hrg_cli."):
        if not module.name.endswith("__main__"):
            for found in finder.find(import_module(module.name)):
                if found.examples and inspect.cleandoc(found.docstring) not in seen:
                    yield found


def run_example(example):
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    runner.run(example, out=said.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(said)


@pytest.mark.parametrize("name", SHOWN)
def test_an_example_prints_what_it_shows(name):
    found = doctest.DocTestFinder(recurse=False).find(SHOWN[name], name, globs={})
    assert found and found[0].examples, f"{name} has no example"
    run_example(found[0])


@pytest.mark.parametrize("example", [*find_other_examples()], ids=lambda example: example.name)
def test_an_example_of_no_list_prints_what_it_shows(example):
    """An effect's method showed [] for a parameter that it gives, and a log without times a rate."""
    run_example(example)


def section_of(function, title):
    """The text of a section of a numpydoc docstring; empty where there is none."""
    text = inspect.getdoc(function)
    found = re.search(rf"^{title}\n-+\n(.*?)(?=^\w[\w ]*\n---|\Z)", text, re.M | re.S)
    return found[1] if found else ""


def hints_of(function):
    """Type of each parameter; none where one is imported for a type checker alone."""
    try:
        return get_type_hints(function, include_extras=True)
    except NameError:
        return {}


@pytest.mark.parametrize("name", TOLD)
def test_public_functions_tell_parameters_results_and_errors(name):
    """One sentence first; every parameter in the section, or described where it is declared
    (`Field(description=…)`, which the command line and the settings show)."""
    function = TOLD[name]
    first = inspect.getdoc(function).split("\n\n")[0]
    assert re.fullmatch(r"[^.]*(\.\S[^.]*)*[.]", first.replace("\n", " ")), f"{name}: {first}"
    lines = re.findall(r"^[*\w].*", section_of(function, "Parameters"), re.M)
    told = {name.lstrip("*") for line in lines for name in line.split(", ")}
    hints = {} if name in METHODS else hints_of(function)
    declared = {
        parameter
        for parameter, hint in hints.items()
        if any(getattr(beside, "description", None) for beside in getattr(hint, "__metadata__", ()))
    }
    taken = set(inspect.signature(function).parameters) - {"self"}
    assert taken == told | (declared & taken), name
    if inspect.signature(function).return_annotation not in ("None", None):
        assert section_of(function, "Returns"), f"{name} does not tell its result"
    if "raise HrgError(" in inspect.getsource(function):
        assert section_of(function, "Raises"), f"{name} does not tell its errors"


TITLES = "Parameters|Returns|Yields|Raises|Attributes|Notes|Examples"


def docstrings():
    """Every docstring of the package, with its place."""
    package = Path(hrg_cli.__file__).parent
    for path in sorted(package.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module):
                where = f"{path.relative_to(package)}: {getattr(node, 'name', '')}"
                yield where, ast.get_docstring(node) or ""


def find_broken_titles(text):
    """Titles of sections that are no line of their own above a line as long."""
    flowed = re.findall(r"\b\w+ -{4,}", text)
    lines = re.findall(rf"^({TITLES}) *\n(.*)$", text, re.M)
    return flowed + [title for title, below in lines if below != "-" * len(title)]


def test_sections_have_their_titles_on_lines_of_their_own():
    """Three had flowed into the text, so that neither numpydoc nor a reader saw the section."""
    assert find_broken_titles("It fits.\n\nExamples -------- Two runs:")
    assert find_broken_titles("It fits.\n\nReturns\n---\nfloat")
    found = {where: broken for where, text in docstrings() if (broken := find_broken_titles(text))}
    assert not found


@pytest.mark.parametrize("told", [Effect, Parameter])
def test_an_effects_fields_are_told_once_for_all_pages(told):
    names = re.findall(r"^\w+$", section_of(told, "Attributes"), re.M)
    assert names == [field.name for field in fields(told)]


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_a_term_says_what_is_its_own(effect):
    """Its equation; what it takes and gives stands in `Effect`."""
    for name, term in vars(effect).items():
        if inspect.isfunction(term) and term.__module__.endswith(f".{effect.name}"):
            assert inspect.getdoc(term), name


def test_everything_exported_says_what_it_is():
    assert sorted(hrg_cli.__all__) == sorted(hrg_cli._PUBLIC)
    assert len(FUNCTIONS) >= 10
    for name, found in PUBLIC.items():
        assert len(inspect.getdoc(found) or "") > 30, name


@pytest.mark.slow
def test_a_type_checker_sees_the_public_api(tmp_path):
    """`from hrg_cli import identify` is the function, not Any."""
    api = pytest.importorskip("mypy.api")
    names = [name for name in hrg_cli._PUBLIC if name not in ("store", "HrgError")]
    text = f"from hrg_cli import {', '.join(names)}\n" + "".join(
        f"reveal_type({name})\n" for name in names
    )
    (tmp_path / "uses.py").write_text(text)
    said, _, status = api.run([str(tmp_path / "uses.py"), "--cache-dir", str(tmp_path / "cache")])
    assert status == 0, said
    assert said.count("Revealed type is") == len(names)
    assert 'type is "Any"' not in said
