"""What was done is noted beside the outputs, with a key made of the inputs' content, the settings
and the version.

Work already done is not done again, and anything that changed is. A note also tells outputs that
were made here from files that were not.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from . import store
from .errors import HrgError
from .version import __version__


def make_key(content: Sequence[Any], inputs: Sequence[Path]) -> str:
    """SHA-256 over the version, what the work depends on, and the content of the inputs.

    Parameters
    ----------
    content
        What the work depends on beside files, as JSON can hold it.
    inputs
        Files whose names and bytes count.

    Returns
    -------
    str
        64 hexadecimal digits.

    Examples
    --------
    >>> from hrg_cli.memory import make_key
    >>> make_key([{"blocks": 300}], []) == make_key([{"blocks": 400}], [])
    False
    """
    text = json.dumps(
        [__version__, content, [[p.name, store.compute_sha256(p)] for p in inputs]],
        sort_keys=True,
        default=str,
    )
    return hashlib.sha256(text.encode()).hexdigest()


def recall(note: Path, key: str) -> dict[str, Any] | None:
    """What was noted for this key, if every output is still there, unchanged.

    Parameters
    ----------
    note
        The note's file, beside the outputs.
    key
        Of the work as it would be done now.

    Returns
    -------
    dict or None
        None: it has to be done.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.memory import recall, remember
    >>> with TemporaryDirectory() as name:
    ...     note = Path(name) / "note.json"
    ...     remember(note, "key", {"status": "valid"}, [])
    ...     recall(note, "key"), recall(note, "another")
    ({'status': 'valid'}, None)
    """
    noted = _read(note)
    return (
        dict(noted["result"])
        if noted is not None and noted["key"] == key and _unchanged(noted, note.parent)
        else None
    )


def is_ours(note: Path, output: Path) -> bool:
    """Whether an output was made by the work that a note tells of.

    It is as it was left then, or of work that was begun and killed.

    Parameters
    ----------
    note
        The note's file.
    output
        Beside it.

    Returns
    -------
    bool
        False where there is no note.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.memory import is_ours, remember
    >>> with TemporaryDirectory() as name:
    ...     note, output = Path(name) / "note.json", Path(name) / "wave.h5"
    ...     _ = output.write_text("a wave")
    ...     remember(note, "key", {}, [output])
    ...     before, _ = is_ours(note, output), output.write_text("another")
    ...     before, is_ours(note, output)
    (True, False)
    """
    noted = _read(note)
    return noted is not None and (
        output.name in noted.get("begun", ())
        or noted["outputs"].get(output.name) == store.compute_sha256(output)
    )


def begin(note: Path, outputs: Sequence[Path]) -> None:
    """Note, before it is done, what the work will write: what is found of it after a kill is its
    own.

    What is there already and somebody else's is not.

    Parameters
    ----------
    note
        The note's file.
    outputs
        That the work will write.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.memory import begin, is_ours
    >>> with TemporaryDirectory() as name:
    ...     note, output = Path(name) / "note.json", Path(name) / "wave.h5"
    ...     begin(note, [output])
    ...     _ = output.write_text("half of a wave")
    ...     is_ours(note, output)
    True
    """
    ours = [p.name for p in outputs if not p.exists() or is_ours(note, p)]
    _write(note, (_read(note) or {"key": None, "outputs": {}, "result": {}}) | {"begun": ours})


def remember(note: Path, key: str, result: Mapping[str, Any], outputs: Sequence[Path]) -> None:
    """Write the note: key, the outputs' hashes, the result.

    Parameters
    ----------
    note
        The note's file.
    key
        Of the work.
    result
        As JSON can hold it.
    outputs
        That the work wrote.

    Examples
    --------
    >>> import json
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.memory import remember
    >>> with TemporaryDirectory() as name:
    ...     remember(Path(name) / "note.json", "key", {"status": "valid"}, [])
    ...     json.loads((Path(name) / "note.json").read_text())["result"]
    {'status': 'valid'}
    """
    hashes = {p.name: store.compute_sha256(p) for p in outputs}
    _write(note, {"key": key, "outputs": hashes, "result": result})


def _write(note: Path, content: Mapping[str, Any]) -> None:
    with store.write_whole(note, force=True) as temporary:
        temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def _read(note: Path) -> dict[str, Any] | None:
    """A note of the right shape; anything else is none."""
    try:
        noted = json.loads(note.read_text(encoding="utf-8"))
        return (
            noted
            if {"key", "outputs", "result"} <= set(noted)
            and isinstance(noted["outputs"], dict)
            and isinstance(noted.get("begun", []), list)
            else None
        )
    except (OSError, ValueError, TypeError):
        return None


def _unchanged(noted: Mapping[str, Any], folder: Path) -> bool:
    try:
        return isinstance(noted["result"], dict) and all(
            store.compute_sha256(folder / name) == digest
            for name, digest in noted["outputs"].items()
        )
    except HrgError:
        return False
