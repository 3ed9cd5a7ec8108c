"""Text logs inside gzip: as the log itself, from every command that takes logs, or a sentence."""

import errno
import gzip
import os
from pathlib import Path

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.formats import import_log, read_table, unpacked
from hrg_cli.records import Recording

LOG = Path(__file__).parents[2] / "sample_data" / "lab_log.csv"
COLUMNS = ("--time", 1, "--c", 2, "--s", 3, "--temperature", 4)


def packed(folder, raw, name="log.csv.gz"):
    path = folder / name
    path.write_bytes(gzip.compress(raw))
    return path


def test_a_packed_log_is_the_log_itself(hrg, tmp_path):
    """It was "of no format known", though `run` takes .gz from a folder."""
    path = packed(tmp_path, LOG.read_bytes())
    for source, name in ((LOG, "plain.h5"), (path, "packed.h5")):
        assert hrg("import", source, "-o", tmp_path / name, *COLUMNS).status == 0
    plain, unpacked = (store.read(tmp_path / f"{n}.h5", Recording) for n in ("plain", "packed"))
    for column in ("c", "s", "temperature_degc"):
        assert np.array_equal(getattr(plain, column)[:], getattr(unpacked, column)[:]), column
    assert plain.sample_rate_hz == unpacked.sample_rate_hz
    (source,) = unpacked.provenance.sources
    assert source.sha256 == store.compute_sha256(path)


@pytest.mark.parametrize(
    ("damage", "said"),
    [
        (lambda raw: raw[: len(raw) // 2], "damaged or cut short"),
        (lambda raw: raw[:200] + bytes([raw[200] ^ 0xFF]) + raw[201:], "damaged or cut short"),
        (lambda raw: raw[:-6] + b"\0\0" + raw[-4:], "damaged or cut short"),
        (lambda raw: gzip.compress(b"\x89PNG\r\n\x1a\n\0\0\0\0" * 20), "no text inside"),
        (lambda raw: gzip.compress(b""), "is empty"),
    ],
)
def test_a_damaged_one_is_told_so(tmp_path, damage, said):
    path = packed(tmp_path, LOG.read_bytes())
    path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(HrgError, match=said) as caught:
        for _ in import_log(path, time=1, c=2, s=3):
            pass
    assert str(path) in str(caught.value)


def test_a_packed_table_is_read(tmp_path):
    path = packed(tmp_path, b"a,b\n1,2\n3,4\n5,7\n", "table.csv.gz")
    assert list(read_table(path)["b"]) == [2, 4, 7]


def test_what_unpacks_without_end_is_refused(tmp_path, monkeypatch):
    """A megabyte of gzip may hold a gigabyte of newlines, a gigabyte a terabyte."""
    monkeypatch.setattr(unpacked, "LARGEST_BYTES", 1 << 20)
    path = packed(tmp_path, b"time [s],C,S\n" + b"\n" * (4 << 20))
    with pytest.raises(HrgError, match="unpacks to more than 1 MB, 200 times its size"):
        list(import_log(path, time=1, c=2, s=3))
    rows = "\n".join(f"{n * 1e-3:.6f},1.0,2.0" for n in range(120_000)).encode()
    path = packed(tmp_path, b"time [s],C,S\n" + rows)
    assert len(rows) > 2 << 20
    assert len(read_table(path)["C"]) == 120_000


@pytest.mark.parametrize(
    ("number", "said"), [(errno.EMFILE, "too many files are open"), (errno.EIO, "is damaged")]
)
def test_a_log_that_cannot_be_looked_into_is_one_sentence(number, said, monkeypatch):
    """It was an internal error; too many open files were called a log to copy again."""

    def failing(*_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(unpacked, "open", failing, raising=False)
    with pytest.raises(HrgError, match=rf"lab_log\.csv: .*{said}"):
        read_table(LOG)
