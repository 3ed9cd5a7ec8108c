"""Every benchmark in one run on one machine, as one page: python benchmarks/page.py
docs/BENCHMARKS.md [names of benchmarks]

Without a file the page goes to standard output alone. A benchmark that fails ends the run; nothing
is written then.
"""

import ast
import os
import platform
import subprocess
import sys
import time
from importlib.metadata import version
from pathlib import Path

FOLDER = Path(__file__).parent
ORDER = (
    "help",
    "alternatives",
    "chain",
    "lot",
    "simulate",
    "demodulate",
    "estimate",
    "identify",
    "calibrate",
    "diagnose",
)
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def machine() -> str:
    """What the figures were measured on, without its name."""
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "h5py", "numba"))
    return (
        f"{platform.system()} on {platform.machine()}, {os.cpu_count()} cores, {memory:.0f} GB of"
        f" memory, Python {platform.python_version()}, {libraries}; one thread a process for linear"
        " algebra."
    )


def section(path: Path) -> str:
    """One benchmark's title, its command and what it printed."""
    title = (
        ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or path.stem
    ).splitlines()[0]
    environment = {**os.environ, **dict.fromkeys(THREADS, "1")}
    started = time.perf_counter()
    done = subprocess.run(
        [sys.executable, str(path)], env=environment, capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(f"{path.name} failed:\n{done.stderr}")
    text = done.stdout.strip()
    shown = text if text.startswith("|") else f"```\n{text}\n```"
    print(f"{path.name}: {time.perf_counter() - started:.0f} s", file=sys.stderr, flush=True)
    return f"## {title.rstrip('.')}\n\n`python benchmarks/{path.name}`\n\n{shown}\n"


def page(names: list[str]) -> str:
    """The whole page."""
    files = {path.stem.removeprefix("bench_"): path for path in sorted(FOLDER.glob("bench_*.py"))}
    chosen = names or [
        *(name for name in ORDER if name in files),
        *(name for name in files if name not in ORDER),
    ]
    before, started = os.getloadavg()[0], time.perf_counter()
    sections = [section(files[name]) for name in chosen]
    minutes = (time.perf_counter() - started) / 60
    head = (
        "# Speed of the whole\n\nMade by `python benchmarks/page.py docs/BENCHMARKS.md` in one"
        f" run; do not edit.\n\n{machine()} The run took {minutes:.1f} minutes; other programs kept"
        f" {before:.1f} cores busy when it began.\n"
    )
    return "\n".join([head, *sections])


if __name__ == "__main__":
    output = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    made = page(sys.argv[2:])
    print(made)
    if output is not None:
        output.write_text(made, encoding="utf-8")
