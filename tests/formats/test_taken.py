"""An import says what it took of a log, and no loss is silent: rows at the top, other decimal
signs, logarithms, gaps, cuts."""

import json

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.formats import import_log
from hrg_cli.records import Recording, collect

N, RATE = 4000, 8000.0
RNG = np.random.default_rng(3)
T = np.arange(N) / RATE
C = np.cos(2 * np.pi * 513 * T) + 0.01 * RNG.standard_normal(N)
S = 0.4 * np.cos(2 * np.pi * 513 * T + 0.2) + 0.01 * RNG.standard_normal(N)


def row(i, separator=",", decimal="."):
    return separator.join(f"{v[i]:.6f}".replace(".", decimal) for v in (T, C, S))


def log(
    folder,
    *,
    top=0,
    other=None,
    title="time (s),c (V),s (V)",
    separator=",",
    decimal=".",
    name="log.csv",
):
    """A log whose first `top` rows are written by `other(i)`."""
    lines = [title.replace(",", separator)] + [
        other(i) if i < top else row(i, separator, decimal) for i in range(N)
    ]
    path = folder / name
    path.write_text("\n".join(lines) + "\n")
    return path


def test_rows_lost_at_the_top_refuse_the_recording(tmp_path, hrg):
    path = log(tmp_path, top=1500, other=lambda i: f"{T[i]:.6f},OVERLOAD,OVERLOAD")
    made = hrg("import", path, "-o", tmp_path / "r.h5", "--json")
    assert made.status == 3 and made.json["status"] == "refused"
    assert "lines 2 to 1501 (1500 rows)" in made.json["status_reasons"][0]
    assert made.json["left_out"][0] == {
        "first_line": 2,
        "last_line": 1501,
        "rows": 1500,
        "why": "a cell is no number",
        "example": "0.000000,OVERLOAD,OVERLOAD",
    }
    assert made.json["columns"]["c"] == {"column": 2, "name": "c", "units": "V"}, (
        "the titles are still found above the lost rows"
    )


LOST = [(1, "valid"), (3, "valid"), (40, "suspect"), (700, "suspect"), (801, "refused")]
BAD = ["{t},---,---", "---,---,---", "{t},,ERR", "{t},0.1"]


# one line of two cells above a table of three columns may be an instrument's own
@pytest.mark.parametrize(
    "rows, status, bad",
    [(*lost, bad) for bad in BAD for lost in LOST if bad != "{t},0.1" or lost[0] >= 3],
)
def test_every_lost_row_is_told(tmp_path, rows, status, bad):
    made = collect(import_log(log(tmp_path, top=rows, other=lambda i: bad.format(t=f"{T[i]:.6f}"))))
    assert made.status == status and f"{rows} of {N} rows" in made.status_reasons[0]
    assert len(made) == N - rows and made.c_units == "V"


@pytest.mark.parametrize(
    "first, then",
    [
        ((";", ","), (";", ".")),
        ((";", "."), (";", ",")),
        ((";", "."), (",", ".")),
        (("\t", ","), (",", ".")),
    ],
)
def test_a_decimal_comma_that_becomes_a_point_is_refused(tmp_path, first, then):
    path = log(
        tmp_path, top=2000, other=lambda i: row(i, *first), separator=then[0], decimal=then[1]
    )
    with pytest.raises(
        HrgError, match=r"written in two ways: .* in line 2, .* in line 2002; .* after line 2001"
    ):
        import_log(path)


def test_titles_keys_and_units_are_no_lost_rows(tmp_path):
    """Lines above the data that hold numbers, as instruments write them."""
    for above in (
        "Sample Interval,1e-6,s\nRecord Length,2500,\ntime,c,s",
        "time,c,s\ns,1,1",
        "time,1,2",
        "# made 2026\n# time, c, s",
        "X,CH1,CH2\nSequence,Volt,Volt",
        "Model,TDS 2024,\nRecord Length,4000,",
    ):
        path = tmp_path / "log.csv"
        path.write_text(above + "\n" + "\n".join(row(i) for i in range(50)) + "\n")
        made = collect(import_log(path, time=1, c=2, s=3))
        assert made.status == "valid" and not made.status_reasons and len(made) == 50, above


@pytest.mark.parametrize("unit", ["dBm", "dBV", "dB"])
def test_a_logarithm_is_no_oscillation(tmp_path, unit):
    path = log(tmp_path, title=f"time (s),ch1 ({unit}),ch2 ({unit})")
    with pytest.raises(
        HrgError,
        match=rf"is in {unit}, samples of an oscillation.*--envelope --amplitude COLUMN --decibel",
    ):
        import_log(path)
    with pytest.raises(HrgError, match="logarithm"):
        import_log(log(tmp_path), units=unit)


def test_what_was_taken_stands_in_the_file_and_on_the_screen(tmp_path, hrg):
    lines = log(tmp_path).read_text().splitlines()
    del lines[1001:1101], lines[2001:2011]
    lines[50] = lines[50].rsplit(",", 1)[0] + ","
    path = tmp_path / "gaps.csv"
    path.write_text("\n".join(lines) + "\n")
    made = hrg("import", path, "-o", tmp_path / "r.h5", "--json")
    assert made.status == 0 and made.json["sample_rate_hz"] is None
    assert made.json["gaps"]["count"] == 2 and made.json["gaps"]["longest_s"] == pytest.approx(
        101 / RATE
    )
    assert made.json["gaps"]["first"][0]["before"] == "line 1002"
    assert made.json["not_finite"] == {"count": 1, "first": ["line 51"]}
    assert any("line 1002" in reason for reason in made.json["status_reasons"])
    with store.open_record(tmp_path / "r.h5", Recording) as kept:
        assert json.loads(kept.details)["columns"]["s"]["column"] == 3
    shown = hrg("import", path, "-o", tmp_path / "r.h5", "--force")
    assert "column 2 (c)" in shown.out and "V" in shown.out and "before line 1002" in shown.out


# Cutting


def test_a_part_of_a_log_begins_at_zero_with_its_slow_columns(tmp_path, hrg):
    """A part of 0.1 s from 0.2 s on: the samples of the log, t = 0 at its first, temperature and
    start time moved along."""
    path = tmp_path / "log.csv"
    path.write_text(
        "time (s),c (V),s (V),temperature (degC)\n"
        + "\n".join(f"{row(i)},{20 + T[i]:.6f}" for i in range(N))
        + "\n"
    )
    flags = ("--from-s", "0.2", "--to-s", "0.3", "--set", 'start_time="2026-01-01T10:00:00Z"')
    made = hrg("import", path, "-o", tmp_path / "r.h5", "--json", *flags)
    assert (
        made.status == 0
        and made.json["samples"] == 800
        and made.json["cut"]["first_s"] == pytest.approx(0.2)
    )
    kept = store.read(tmp_path / "r.h5", Recording)
    np.testing.assert_allclose(kept.c, np.round(C[1600:2400], 6), atol=1e-12)
    assert kept.start_time == "2026-01-01T10:00:00.200000Z" and kept.times(0, 1)[0] == 0
    np.testing.assert_allclose(kept.temperature_degc, 20.2 + kept.auxiliary_time_s, atol=2e-6)
    assert "from_s = 0.2" in kept.provenance.settings and "to_s = 0.3" in kept.provenance.settings


@pytest.mark.parametrize(
    "flags, says",
    [
        (("--from-s", 0.3, "--to-s", 0.2), "from_s = 0.3 is not before to_s = 0.2"),
        (("--from-s", 7), "none of its rows lies between from_s = 7"),
        (("--from-s", 0.10001, "--to-s", 0.10002), "none of its rows"),
    ],
)
def test_a_part_with_nothing_in_it_is_a_sentence(tmp_path, hrg, flags, says):
    made = hrg("import", log(tmp_path), "-o", tmp_path / "r.h5", *flags)
    assert made.status == 1 and says in made.err and not (tmp_path / "r.h5").exists()


def test_an_end_behind_the_log_is_told(tmp_path):
    made = collect(import_log(log(tmp_path), to_s=9.0))
    assert (
        len(made) == N
        and "to_s = 9 lies behind the end of the log at 0.499875 s" in made.status_reasons[0]
    )


@pytest.mark.parametrize(
    ("gaps", "words"), [(1, "the times have a gap of"), (2, "2 gaps, the longest of")]
)
def test_gaps_are_told_in_a_sentence(tmp_path, gaps, words):
    lines = log(tmp_path).read_text().splitlines()
    for begin in (1001, 1501)[:gaps]:
        del lines[begin : begin + 50]
    path = tmp_path / "gaps.csv"
    path.write_text("\n".join(lines) + "\n")
    assert any(words in reason for reason in collect(import_log(path)).status_reasons)


CLOSING = {
    "words": "end of measurement\n",
    "no line end": "end of measurement",
    "keys": "Samples{s}4000\nstopped{s}12:00:03\n",
    "blank lines between": "\nTotal samples: 4000\n\noperator{s}M\n\n",
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize(
    ("separator", "decimal"), [(",", "."), (" ", "."), (";", ","), ("\t", ".")]
)
@pytest.mark.parametrize("words", list(CLOSING))
def test_words_that_close_a_log_are_told_and_every_row_is_taken(
    tmp_path, words, separator, decimal, encoding
):
    path = log(tmp_path, separator=separator, decimal=decimal, title="time,c,s")
    text = path.read_text() + CLOSING[words].format(s=separator)
    path.write_bytes(text.encode(encoding))
    record = collect(import_log(path))
    np.testing.assert_allclose(record.c, C, atol=6e-7)
    assert record.status == "valid"
    told = json.loads(record.details)["left_out"][0]
    first = next(k for k, line in enumerate(text.split("\n"), 1) if line[:1].isalpha() and k > 1)
    assert (told["first_line"], told["last_line"]) == (first, len(text.splitlines()))
    assert any("words below the last row" in reason for reason in record.status_reasons)


@pytest.mark.parametrize("block", [64, 100, 333, 4096])
def test_closing_words_on_either_side_of_a_block_are_left_out(tmp_path, block, monkeypatch):
    """Whatever line of them a block ends in; a byte that some encodings take for a line end is none."""
    monkeypatch.setattr("hrg_cli.formats.text_logs.BLOCK_BYTES", block)
    path = log(tmp_path)
    words = "the end\n\noperator: M\x85ller\ntable stopped\n" + "note: none\n" * 8
    path.write_bytes(path.read_bytes() + words.encode("latin-1"))
    record = collect(import_log(path))
    np.testing.assert_allclose(record.c, C, atol=6e-7)
    assert json.loads(record.details)["left_out"][0]["rows"] == 12


def test_a_last_row_of_words_and_numbers_is_a_row(tmp_path):
    """Beside columns of text a row's first two cells may be words."""
    path = tmp_path / "log.csv"
    rows = [f"{'stop' if i == N - 1 else ''},M,{row(i)}" for i in range(N)]
    path.write_text("event,operator,time,c,s\n" + "\n".join(rows) + "\n")
    record = collect(import_log(path))
    assert len(record) == N and not json.loads(record.details)["left_out"]


@pytest.mark.parametrize(
    "last", ["0.5,0.2", "OVERLOAD,OVERLOAD,OVERLOAD", "mean,0.1,0.2", "rms,0.1,0.2,0.3"]
)
def test_a_last_row_that_is_broken_is_no_closing_word(tmp_path, last):
    path = log(tmp_path)
    path.write_text(path.read_text() + last + "\n")
    with pytest.raises(HrgError, match=f"line {N + 2}"):
        collect(import_log(path))
