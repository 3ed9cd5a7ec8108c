"""Memory that runs out while libraries are loaded is called so, whatever the library makes of it."""

import ctypes
import errno
import subprocess
import sys
from pathlib import Path

import pytest

from hrg_cli.errors import NO_MEMORY, is_no_memory
from hrg_cli.lots import lot_work
from hrg_cli.store.atomic import explain_write_error
from hrg_cli.store.handles import explain_read_error

LIMITED = """
import resource, sys
from pathlib import Path
import importlib.util
from hrg_cli.store.atomic import write_whole
from hrg_cli.errors import HrgError
have = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (have + (24 << 20), have + (24 << 20)))
try:
    with write_whole(Path(sys.argv[1])):
        import llvmlite.binding.ffi as ffi
        ffi.lib._load_lib()
except HrgError as error:
    print(error)
"""


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="no /proc here")
def test_a_library_without_room_is_no_fault_of_the_output(tmp_path):
    """The compiler's library takes more than 100 MB; its own words are that it cannot be found."""
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, str(tmp_path / "out.h5")],
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert NO_MEMORY in done.stdout, done
    assert list(tmp_path.iterdir()) == []


def test_other_libraries_and_files_are_not_called_so(tmp_path):
    with pytest.raises(OSError, match="no_such_library") as missing:
        ctypes.CDLL("no_such_library.so")
    assert not is_no_memory(missing.value)
    assert "cannot be written" in str(explain_write_error(missing.value, tmp_path / "out.h5"))
    try:
        raise OSError("libx.so: failed to map segment from shared object")
    except OSError as first:
        assert is_no_memory(first)
        with pytest.raises(OSError, match="not found") as later:
            raise OSError("libx.so: not found")  # noqa: B904 (as llvmlite does)
        assert is_no_memory(later.value)
    assert is_no_memory(ImportError("liby.so: failed to map segment from shared object"))


def test_a_gyro_of_a_lot_that_finds_no_memory_is_no_internal_error():
    with lot_work._reporting({"gyro_id": "G"}) as result:
        raise MemoryError("Unable to allocate 32.0 KiB")
    assert result == {"gyro_id": "G", "status": "failed", "error": NO_MEMORY}


def test_an_input_that_memory_has_no_room_for_is_not_called_damaged(tmp_path):
    lacking = OSError(errno.ENOMEM, "Cannot allocate memory")
    assert NO_MEMORY in str(explain_read_error(lacking, tmp_path / "in.h5"))
    assert "damaged" in str(
        explain_read_error(OSError(errno.EIO, "Input/output error"), tmp_path / "in.h5")
    )


def test_a_chunk_that_gets_no_memory_is_not_called_damaged(tmp_path):
    """h5py tells of it by an OSError without a number."""
    lacking = OSError("Can't synchronously read data (memory allocation failed for raw data chunk)")
    said = str(explain_read_error(lacking, tmp_path / "in.h5", "/wave/flags"))
    assert "needs more memory than is free" in said and "/wave/flags" in said
    assert "damaged" not in said
