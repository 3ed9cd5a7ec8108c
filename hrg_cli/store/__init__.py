"""Reads and writes every kind of record as HDF5: whole or not at all, checked on the way in,
provenance beside the data.

Written under a temporary name in the target folder and renamed when whole; an existing output is
replaced only when asked. Datasets carry dimension scales, so each group opens with
`xarray.open_dataset(path, group=..., engine="h5netcdf")`.
"""

from .atomic import (
    atomic_path,
    check_output,
    is_same_file,
    need_no_input,
    remove_stale,
    whole_or_none,
)
from .handles import need_possible, need_readable
from .headings import changes, heading_of, is_hdf5, kind_of, provenance_of, texts_of, unreadable
from .layout import FORMAT, FORMAT_VERSION, AnyRecord
from .reading import open_record, read, read_any
from .writing import created_now, sha256, write

__all__ = [
    "FORMAT",
    "FORMAT_VERSION",
    "AnyRecord",
    "atomic_path",
    "changes",
    "check_output",
    "created_now",
    "heading_of",
    "is_hdf5",
    "is_same_file",
    "kind_of",
    "need_no_input",
    "need_possible",
    "need_readable",
    "open_record",
    "provenance_of",
    "read",
    "read_any",
    "remove_stale",
    "sha256",
    "texts_of",
    "unreadable",
    "whole_or_none",
    "write",
]
