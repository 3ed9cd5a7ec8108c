"""How much processor time `hrg --help` takes against `python -c pass`, pair by pair: as installed
here, and without the hooks that editable packages load into every process."""

import os
import statistics
import sys

from timing import processor_seconds

PAIRS = 15


def compare(said: str, *options: str) -> None:
    """Print median times and the median ratio of processes with these options of Python's."""
    # without `site` nothing finds the packages but this
    path = {"PYTHONPATH": os.pathsep.join(filter(None, sys.path[1:]))}
    python = [sys.executable, *options]
    pairs = [
        (
            processor_seconds([*python, "-m", "hrg_cli.cli", "--help"], path),
            processor_seconds([*python, "-c", "pass"], path),
        )
        for _ in range(PAIRS + 1)
    ][1:]
    ratio = statistics.median(a / b for a, b in pairs)
    ours, bare = (1e3 * statistics.median(x) for x in zip(*pairs, strict=True))
    print(f"{said}: hrg --help {ours:.0f} ms, python -c pass {bare:.0f} ms, ratio {ratio:.1f}")


def main() -> None:
    """Print both ratios."""
    compare("as installed")
    compare("without hooks", "-S")


if __name__ == "__main__":
    main()
