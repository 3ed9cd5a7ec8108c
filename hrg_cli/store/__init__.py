"""Reads and writes every kind of record as HDF5: whole or not at all, checked on the way in,
provenance beside the data.

Written under a temporary name in the target folder and renamed when whole; an existing output is
replaced only when asked. Datasets carry dimension scales, so each group opens with
`xarray.open_dataset(path, group=..., engine="h5netcdf")`.
"""

from .atomic import (
    check_output,
    is_same_file,
    keep_whole_or_none,
    need_no_input,
    remove_stale,
    write_whole,
)
from .handles import need_possible, need_readable
from .headings import (
    find_changes,
    find_kind,
    find_provenance,
    find_unreadable,
    is_hdf5,
    read_heading,
    read_texts,
)
from .layout import FORMAT, FORMAT_VERSION, AnyRecord
from .own_outputs import find_own, note_own
from .reading import open_record, read, read_any
from .writing import compute_sha256, order_time, stamp_now, write

__all__ = [
    "FORMAT",
    "FORMAT_VERSION",
    "AnyRecord",
    "check_output",
    "compute_sha256",
    "find_changes",
    "find_kind",
    "find_own",
    "find_provenance",
    "find_unreadable",
    "is_hdf5",
    "is_same_file",
    "keep_whole_or_none",
    "need_no_input",
    "need_possible",
    "need_readable",
    "note_own",
    "open_record",
    "order_time",
    "read",
    "read_any",
    "read_heading",
    "read_texts",
    "remove_stale",
    "stamp_now",
    "write",
    "write_whole",
]
