"""Pipes as in MRtrix3: `-o -` writes a temporary file and prints its name; `-` as an input takes
the names from standard input.

    hrg demodulate run.h5 -o - | hrg estimate - -o - | hrg identify - -o resonator.h5

What travels is a name, so that every step reads a whole, checked file; whoever takes a temporary
file removes it when done.
"""

from __future__ import annotations

import contextlib
import os
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..errors import HrgError, UsageError

DASH = Path("-")
PREFIX = "hrg-pipe-"
MAKES_A_FILE = (
    "import",
    "simulate",
    "demodulate",
    "estimate",
    "identify",
    "rate",
    "calibrate",
    "compensate",
    "diagnose",
)
"""Commands whose output is one hrg file, which a pipe can hand on."""
READS_CONTENT = ("import",)
"""Commands to which `-` is the content itself."""


def name_piped_output(command: str) -> Path:
    """The name of a temporary output that does not exist yet.

    Parameters
    ----------
    command
        That will write it.

    Returns
    -------
    Path
        In the folder for temporary files.

    Raises
    ------
    UsageError
        The command makes no hrg file.

    Examples
    --------
    >>> from hrg_cli.commands.pipes import name_piped_output
    >>> name_piped_output("demodulate").name.startswith("hrg-pipe-")
    True
    """
    if command not in MAKES_A_FILE:
        raise UsageError(
            f"{command} -o -: only an hrg file goes through a pipe ({', '.join(MAKES_A_FILE)});"
            " name a file"
        )
    handle, name = tempfile.mkstemp(prefix=PREFIX, suffix=".h5")
    os.close(handle)
    os.unlink(name)
    return Path(name)


def take_from_pipe(command: str, arguments: Mapping[str, Any]) -> tuple[dict[str, Any], list[Path]]:
    r"""The arguments with every `-` replaced by the names that came through the pipe, and those
    names.

    Parameters
    ----------
    command
        That is given them.
    arguments
        Of its body.

    Returns
    -------
    tuple
        The arguments, and the names in their order; none where no `-` is among them.

    Raises
    ------
    HrgError
        Nothing came; `-` twice, or several names for one file, is a UsageError.

    Examples
    --------
    >>> import io, sys
    >>> from pathlib import Path
    >>> from hrg_cli.commands.pipes import take_from_pipe
    >>> own, sys.stdin = sys.stdin, io.StringIO("a.h5\nb.h5\n")
    >>> arguments, names = take_from_pipe("identify", {"files": [Path("-"), Path("c.h5")]})
    >>> sys.stdin = own
    >>> [path.name for path in arguments["files"]], len(names)
    (['a.h5', 'b.h5', 'c.h5'], 2)
    """
    dashes = [
        key
        for key, value in arguments.items()
        if value == DASH or (isinstance(value, list) and DASH in value)
    ]
    if not dashes or command in READS_CONTENT:
        return dict(arguments), []
    if len(dashes) > 1 or arguments[dashes[0]] == [DASH, DASH]:
        raise UsageError("- stands for what comes through the pipe and can be named once")
    names = [Path(line) for line in sys.stdin.read().split("\n") if line.strip()]
    if not names:
        raise HrgError(
            "-: nothing came through the pipe; the command before it failed, or has no -o -"
        )
    value = arguments[dashes[0]]
    if isinstance(value, list):
        return {
            **arguments,
            dashes[0]: [p for v in value for p in (names if v == DASH else [v])],
        }, names
    if len(names) > 1:
        raise UsageError(f"-: {len(names)} files came through the pipe, one was expected")
    return {**arguments, dashes[0]: names[0]}, names


def hand_on(output: Path) -> list[Path]:
    """List the files made under a temporary output's name: itself, or one per run.

    Parameters
    ----------
    output
        The temporary name.

    Returns
    -------
    list of Path
        In the order of their names.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.commands.pipes import hand_on
    >>> with TemporaryDirectory() as name:
    ...     (Path(name) / "x-2.h5").touch()
    ...     (Path(name) / "x-1.h5").touch()
    ...     [path.name for path in hand_on(Path(name) / "x.h5")]
    ['x-1.h5', 'x-2.h5']
    """
    return [output] if output.exists() else sorted(output.parent.glob(f"{output.stem}-*.h5"))


def remove(names: list[Path]) -> None:
    """Remove the temporary files that were taken, and what was made beside them; other files stay.

    Parameters
    ----------
    names
        That came through the pipe.

    Examples
    --------
    >>> from hrg_cli.commands.pipes import name_piped_output, remove
    >>> output = name_piped_output("demodulate")
    >>> output.touch()
    >>> remove([output])
    >>> output.exists()
    False
    """
    folder = Path(tempfile.gettempdir())
    for name in names:
        if name.name.startswith(PREFIX) and name.parent == folder:
            for path in [name, *folder.glob(f"{name.stem}.*")]:
                with contextlib.suppress(OSError):
                    path.unlink()
