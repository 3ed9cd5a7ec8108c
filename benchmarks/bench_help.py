"""How long `hrg --help` takes against `python -c pass`, pair by pair."""

import statistics
import subprocess
import sys
import time

PAIRS = 15


def seconds(*arguments: str) -> float:
    """Wall time of one process."""
    started = time.perf_counter()
    subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - started


def main() -> None:
    """Print median times and the median ratio."""
    pairs = [(seconds("-m", "hrg_cli.cli", "--help"), seconds("-c", "pass")) for _ in range(PAIRS)][
        1:
    ]
    ratio = statistics.median(a / b for a, b in pairs)
    ours, bare = (1e3 * statistics.median(x) for x in zip(*pairs))
    print(f"hrg --help: {ours:.0f} ms, python -c pass: {bare:.0f} ms, ratio {ratio:.1f}")


if __name__ == "__main__":
    main()
