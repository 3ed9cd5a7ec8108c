"""The examples in the docstrings of public functions run and print what they show; those functions
tell their parameters, results and errors."""

import doctest
import inspect
from importlib import import_module

import pytest

import hrg_cli

EXAMPLES = {
    "hrg_cli.stages.simulate": ["simulate"],
    "hrg_cli.stages.identify": ["identify"],
    "hrg_cli.stages.calibrate": ["calibrate"],
    "hrg_cli.stages.rate_table": ["rate_table"],
    "hrg_cli.records": ["collect"],
    "hrg_cli.store.reading": ["read"],
    "hrg_cli.store.writing": ["write"],
    "hrg_cli.reporting.answer": ["answer"],
    "hrg_cli.physics.ellipse": ["envelopes", "wave"],
    "hrg_cli.fitting.tables.allan": ["allan_deviation"],
    "hrg_cli.limit_values": ["limit_value"],
    "hrg_cli.settings": ["parse_assignment"],
}
CASES = [(module, name) for module, names in EXAMPLES.items() for name in names]
SECTIONS = ("Parameters\n", "Returns\n")
IN_WORK = ("demodulate", "estimate", "diagnose")
"""Public functions whose docstrings have no sections yet."""


@pytest.mark.parametrize(("module", "name"), CASES, ids=[name for _, name in CASES])
def test_an_example_prints_what_it_shows(module, name):
    function = getattr(import_module(module), name)
    found = doctest.DocTestFinder(recurse=False).find(function, name, globs={})
    assert found and found[0].examples, f"{name} has no example"
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    runner.run(found[0], out=said.append)
    assert runner.summarize(verbose=False).failed == 0, "".join(said)


def test_public_functions_tell_parameters_and_results():
    public = [getattr(hrg_cli, name) for name in dir(hrg_cli) if name in hrg_cli._PUBLIC]
    functions = [f for f in public if inspect.isfunction(f)]
    assert len(functions) >= 8
    for function in functions:
        if function.__name__ not in IN_WORK:
            for section in SECTIONS:
                assert section in function.__doc__, f"{function.__name__} has no {section.strip()}"


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
