"""Every benchmark on one machine, as one page: python benchmarks/page.py docs/BENCHMARKS.md
[names of benchmarks]

With names those alone are measured, and the page's other sections stay as they are, with their own day
and commit. Without a file the page goes to standard output alone. A benchmark that fails ends the run;
nothing is written then.
"""

import ast
import os
import platform
import re
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
    "power",
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
    said = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or path.stem
    title = " ".join(said.split("\n\n")[0].split())
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
    told = f"`python benchmarks/{path.name}`, {time.strftime('%Y-%m-%d')}, commit {commit()}"
    return f"## {title.rstrip('.')}\n\n{told}\n\n{shown}\n"


def commit() -> str:
    """The code's commit, by its first digits."""
    done = subprocess.run(
        ["git", "-C", str(FOLDER), "rev-parse", "--short=7", "HEAD"],
        capture_output=True,
        text=True,
        check=False,
    )
    return done.stdout.strip() or "unknown"


def kept_sections(page: Path | None) -> dict[str, str]:
    """The sections of an earlier page by the benchmark that made them."""
    if page is None or not page.exists():
        return {}
    parts = re.split(r"^(?=## )", page.read_text(encoding="utf-8"), flags=re.M)[1:]
    return {found[1]: part for part in parts if (found := re.search(r"bench_(\w+)\.py`", part))}


def page(names: list[str], earlier: Path | None = None) -> str:
    """The whole page."""
    files = {path.stem.removeprefix("bench_"): path for path in sorted(FOLDER.glob("bench_*.py"))}
    chosen = names or [
        *(name for name in ORDER if name in files),
        *(name for name in files if name not in ORDER),
    ]
    before, started = os.getloadavg()[0], time.perf_counter()
    sections = (kept_sections(earlier) if names else {}) | {
        name: section(files[name]) for name in chosen
    }
    minutes = (time.perf_counter() - started) / 60
    head = (
        "# Benchmarks\n\nMade by `python benchmarks/page.py docs/BENCHMARKS.md`; do not edit."
        " Each section has its day and the commit it was measured on.\n\n"
        f"{machine()} The last run ({', '.join(names) or 'all'}) took {minutes:.1f} minutes; other"
        f" programs kept {before:.1f} cores busy when it began.\n"
    )
    order = [*(n for n in ORDER if n in sections), *(n for n in sections if n not in ORDER)]
    return "\n".join([head, *(sections[name].strip("\n") + "\n" for name in order)])


if __name__ == "__main__":
    output = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    made = page(sys.argv[2:], output)
    print(made)
    if output is not None:
        output.write_text(made, encoding="utf-8")
