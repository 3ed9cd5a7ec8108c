"""The page of bounds says what the code does."""

import importlib
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "bounds.md"
ROWS = re.findall(r"^\|[^|]*\| (±?[\de.+-]+)[^|]*\| `([\w.]+)` \|$", PAGE.read_text(), re.MULTILINE)


def test_every_row_is_read():
    assert len(ROWS) == PAGE.read_text().count("` |\n")


@pytest.mark.parametrize(("figure", "name"), ROWS, ids=[name for _, name in ROWS])
def test_a_bound_is_that_of_the_code(figure, name):
    module, _, constant = name.rpartition(".")
    held = getattr(importlib.import_module(f"hrg_cli.{module}"), constant)
    assert float(figure.lstrip("±")) == held
