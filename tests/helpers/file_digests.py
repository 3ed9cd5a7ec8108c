"""Digests of what files hold, whatever times and command lines they name."""

import hashlib

import h5py


def rows(folder):
    """Digest of the datasets of every file in a folder (the attributes name times and command
    lines)."""
    found = {}
    for path in sorted(folder.glob("*.wave.h5")):
        with h5py.File(path) as file:
            found[path.name] = {
                name: hashlib.sha256(item[()].tobytes()).hexdigest()
                for name, item in file["wave"].items()
            }
    return found
