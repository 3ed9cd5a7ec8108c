"""Thousands separators are read where they are beyond doubt, and named otherwise."""

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.formats import import_log, text_logs
from hrg_cli.records import collect

T = np.arange(400) / 2000.0
C, S = 8.3e5 * np.cos(2 * np.pi * 101.3 * T), 9e2 * np.cos(2 * np.pi * 101.3 * T + 0.2)


def in_german(number, digits=3):
    return f"{number:,.{digits}f}".translate(str.maketrans(",.", ".,"))


def written(folder, cells, mark):
    """A log of rows (time, c, s) as text."""
    path = folder / "log.csv"
    path.write_text("\n".join([mark.join(["t [s]", "c", "s"]), *map(mark.join, cells)]) + "\n")
    return path


GERMAN = [tuple(map(in_german, row)) for row in zip(T, C, S)]


@pytest.mark.parametrize("block", [1 << 20, 3000])
@pytest.mark.parametrize(
    ("mark", "cells"),
    [
        (";", [(in_german(t, 4), *row[1:]) for t, row in zip(T, GERMAN)]),
        (",", [(f"{t:.4f}", f'"{c:,.3f}"', f'"{s:,.3f}"') for t, c, s in zip(T, C, S)]),
        ("\t", [(f"{t:.4f}", f"{c:,.3f}", f"{s:,.3f}") for t, c, s in zip(T, C, S)]),
    ],
    ids=["German", "quoted", "tabs"],
)
def test_thousands_beyond_doubt_are_read(tmp_path, monkeypatch, mark, cells, block):
    monkeypatch.setattr(text_logs, "BLOCK_BYTES", block)
    found = collect(import_log(written(tmp_path, cells, mark)))
    assert found.sample_rate_hz == 2000.0
    np.testing.assert_allclose([found.c, found.s], [C, S], rtol=0, atol=5.1e-4)


def test_whole_thousands_are_told_by_the_others_of_their_column(tmp_path):
    cells = [(in_german(t, 4), in_german(c), in_german(s)) for t, c, s in zip(T, C, S)]
    cells[300] = (cells[300][0], "2.500", cells[300][2])
    assert collect(import_log(written(tmp_path, cells, ";"))).c[300] == 2500.0


@pytest.mark.parametrize("cell", ["2.500", "82.55,4", "2.5"])
def test_one_mark_before_three_digits_is_never_guessed(tmp_path, cell):
    cells = [(in_german(t, 4), f"{c:.3f}".replace(".", ","), "1,5") for t, c in zip(T, C)]
    cells[300] = (cells[300][0], cell, "1,5")
    with pytest.raises(HrgError, match=rf"line 302: '{cell}' in column 2 \(c\)"):
        collect(import_log(written(tmp_path, cells, ";")))


@pytest.mark.parametrize(
    ("cell", "column"), [("825'540,12", "'c' holds"), ("82.55,40", "'c' holds"), ("1.234", "(t)")]
)
def test_a_column_of_digits_that_is_no_number_is_named(tmp_path, cell, column):
    cells = [(in_german(t, 4), cell, cell, "1,5", "2,5", "3,5", "4,5") for t in T]
    path = tmp_path / "log.csv"
    rows = cells if cell != "1.234" else [row[:3] for row in cells]
    titles = ["t [s]", "c", "s", "d", "e", "f", "g"][: len(rows[0])]
    path.write_text("\n".join(map(";".join, [titles, *rows])) + "\n")
    with pytest.raises(HrgError, match="without thousands separators") as error:
        collect(import_log(path, c=2, s=3))
    assert column in str(error.value)
