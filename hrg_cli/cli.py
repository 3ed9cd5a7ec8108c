"""The command line's entry: the page of help, or one of the commands."""

from __future__ import annotations

import gc
import os
import sys
from typing import TYPE_CHECKING, Any

from . import streams, threads
from .errors import NO_MEMORY, HrgError, is_no_memory
from .front_page import COMMANDS as COMMANDS
from .front_page import COMPLETES, compose_front_page, is_front_page_asked

if TYPE_CHECKING:
    from .group import app as app


def __getattr__(name: str) -> Any:
    """The group loads on first use (PEP 562), so that `hrg --help` does without its library."""
    if name == "app":
        from .group import app

        return app
    raise AttributeError(f"module 'hrg_cli.cli' has no attribute {name!r}")


def main() -> None:
    """Entry point of the `hrg` script."""
    try:
        _start()
    except KeyboardInterrupt:  # outside the command's own guard: while its modules are loaded
        print("hrg: interrupted; no output was written", file=sys.stderr, flush=True)
        raise SystemExit(130) from None


def _start() -> None:
    threads.use_one()
    # no plugin of pydantic's is wanted: it would look for them in every package of the environment
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    streams.prepare()
    try:
        with streams.flush_at_end():
            _answer(sys.argv[1:])
    except HrgError as error:  # its words did not reach standard output
        print(f"hrg: {error}", file=sys.stderr, flush=True)
        raise SystemExit(1) from None
    except Exception as error:  # while the command's modules are loaded
        if not is_no_memory(error):
            raise
        print(f"hrg: {NO_MEMORY}", file=sys.stderr, flush=True)
        raise SystemExit(1) from None
    finally:
        # the process ends: to look through all its modules for circles first is a sixth of a
        # short command
        gc.freeze()


def _answer(arguments: list[str]) -> None:
    """Show the page of help where nothing else is asked for, or run the command."""
    if is_front_page_asked(arguments) and COMPLETES not in os.environ:
        print(compose_front_page())
        return
    from .group import app

    app(prog_name="hrg")


if __name__ == "__main__":
    main()
