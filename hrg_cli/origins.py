"""Which recorded samples a file goes back to: fingerprints of the channels' values, kept with every
source along the chain.

A recording's fingerprint is the SHA-256 of its length and of stretches of both channels spread over
the whole of it, as physical values: the same for a copy under another name, compressed otherwise or
stored again, and made without reading the file. A part cut out of it is known by its times,
`fingerprint@from:to`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from . import store
from .errors import NotHrgError
from .records import Recording

STRETCHES, STRETCH = 48, 1024
"""Stretches of samples that are hashed, and their length."""


def find_samples(path: Path, part: str = "") -> tuple[str, ...]:
    """Fingerprints of the recorded samples that a file goes back to.

    Parameters
    ----------
    path
        Of hrg, or another program's.
    part
        What the command takes of a recording, as `name_part` says it.

    Returns
    -------
    tuple of str
        Sorted; empty for a file that is not hrg's, or whose sources do not say.

    Raises
    ------
    HrgError
        The file is damaged, or cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.origins import find_samples
    >>> with TemporaryDirectory() as folder:
    ...     log = Path(folder) / "lab.csv"
    ...     _ = log.write_text("t,c,s")
    ...     print(find_samples(log))
    ()
    """
    try:
        kind = store.find_kind(path).kind
        if kind == "recording":
            with store.open_record(path, Recording) as recording:
                return (fingerprint(recording) + part,)
        provenance = store.find_provenance(path)
    except NotHrgError:
        return ()
    known = {sample for source in provenance.sources for sample in source.samples}
    if not known and kind in ("periods", "wave"):
        known = {
            source.sha256
            for source in provenance.sources
            if source.kind in ("recording", "periods")
        }
    return tuple(sorted(known - {""}))


def fingerprint(recording: Recording) -> str:
    """SHA-256 of the length of a recording and of stretches of both channels' physical values.

    Parameters
    ----------
    recording
        Its channels may be on disk.

    Returns
    -------
    str
        64 digits; the same for a copy that is called, compressed or stored otherwise.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.origins import fingerprint
    >>> run = dict(s=np.zeros(9), sample_rate_hz=8e3, mode="free")
    >>> one, other = (Recording(c=np.full(9, c), **run) for c in (0.1, 0.2))
    >>> (
    ...     fingerprint(one) == fingerprint(one.replace(run_id="b")),
    ...     fingerprint(one) == fingerprint(other),
    ... )
    (True, False)
    """
    length = len(recording.c)
    digest = hashlib.sha256(str(length).encode())
    starts = np.linspace(0, max(length - STRETCH, 0), STRETCHES).astype(int)
    # each once; `np.unique` would load the masked arrays
    for start in dict.fromkeys(starts.tolist()):
        for channel in recording.physical(start, min(start + STRETCH, length)):
            digest.update(np.ascontiguousarray(channel, dtype="<f8").tobytes())
    return digest.hexdigest()


def name_part(settings: Mapping[str, Any]) -> str:
    """The part of a recording that a command's settings take.

    Parameters
    ----------
    settings
        Of a stage.

    Returns
    -------
    str
        "@from:to" in seconds; empty for all of it.

    Examples
    --------
    >>> from hrg_cli.origins import name_part
    >>> name_part({"from_s": 1, "to_s": None}), name_part({})
    ('@1.0:', '')
    """
    first, last = settings.get("from_s"), settings.get("to_s")
    return (
        ""
        if first is None and last is None
        else f"@{'' if first is None else float(first)}:{'' if last is None else float(last)}"
    )


def overlap(one: str, other: str) -> bool:
    """Whether two parts of the same samples share some.

    Parameters
    ----------
    one, other
        "from:to" in seconds; "" is all of them.

    Returns
    -------
    bool
        A part that begins where another ends shares nothing with it.

    Examples
    --------
    >>> from hrg_cli.origins import overlap
    >>> overlap("0:2", "1:"), overlap("0:2", "2:3"), overlap("", "2:3")
    (True, False, True)
    """
    (a, b), (c, d) = _ends(one), _ends(other)
    return a < d and c < b


def find_shared(samples: Sequence[Sequence[str]]) -> Iterator[tuple[int, int]]:
    """Inputs that go back to samples which an earlier input holds too.

    Parameters
    ----------
    samples
        Fingerprints of each input.

    Returns
    -------
    iterator of tuple
        Places of two inputs, the earlier first.

    Examples
    --------
    >>> from hrg_cli.origins import find_shared
    >>> list(find_shared([["aa@0:2"], ["bb"], ["aa@1:3"]]))
    [(0, 2)]
    """
    first: dict[str, list[tuple[int, str]]] = {}
    for place, own in enumerate(samples):
        for sample in own:
            whole, _, part = sample.partition("@")
            known = first.setdefault(whole, [])
            yield from ((other, place) for other, taken in known if overlap(part, taken))
            known.append((place, part))


def _ends(part: str) -> tuple[float, float]:
    first, _, last = part.partition(":")
    return (float(first) if first else -np.inf), (float(last) if last else np.inf)
