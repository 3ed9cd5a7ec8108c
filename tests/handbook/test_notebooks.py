"""The documentation's notebooks run from the first cell to the last and show what is printed in
them; their pages in the site are made of them."""

import json
import re
from pathlib import Path

import pytest

from docs.handbook.notebook_page import make_page, run_notebook

DOCS = Path(__file__).parent.parent.parent / "docs"
NOTEBOOKS = sorted(DOCS.rglob("*.ipynb"))
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def read(path):
    return json.loads(path.read_text(encoding="utf-8"))


def shown(notebook):
    """Every cell's kinds of output, and its texts."""
    cells = [cell["outputs"] for cell in notebook["cells"] if cell["cell_type"] == "code"]
    kinds = [[output["output_type"] for output in outputs] for outputs in cells]
    texts = [o.get("text", o.get("data", {}).get("text/plain", "")) for c in cells for o in c]
    return kinds, "\n".join(texts)


def test_there_is_a_notebook():
    assert NOTEBOOKS


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_a_notebook_shows_what_it_prints(path):
    """Words are the same, numbers within 2 %, as another processor rounds otherwise."""
    written = read(path)
    kinds, text = shown(written)
    kinds_now, now = shown(run_notebook(written))
    assert kinds_now == kinds
    assert NUMBER.sub("#", now) == NUMBER.sub("#", text)
    assert [*map(float, NUMBER.findall(now))] == pytest.approx(
        [*map(float, NUMBER.findall(text))], rel=0.02
    )


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_its_page_is_made_of_it(path):
    page, figures = make_page(read(path), path.stem)
    renew = f"run `python -m docs.handbook.notebook_page {path.relative_to(DOCS.parent)}`"
    assert path.with_suffix(".md").read_text(encoding="utf-8") == page, renew
    assert figures
    for name, content in figures.items():
        assert (path.parent / name).read_bytes() == content, renew


def test_outputs_are_those_of_jupyter():
    """Text printed, the value of a last expression, none after a semicolon; names live on."""
    code = ["a = 2\nprint(a)\na + 1", "a * 3;", "None"]
    cells = [{"cell_type": "code", "metadata": {}, "source": source} for source in code]
    (first, second, third), _ = shown(run_notebook({"cells": cells}))
    assert first == ["stream", "execute_result"] and second == third == []
