"""The page that `hrg --help` shows, and the table of commands it is made of.

It is laid out here, for the command line's library as well, whose loading takes five times as long
as Python itself: with nothing but this page asked for it is not loaded.
"""

from __future__ import annotations

import shutil
import textwrap
from collections.abc import Iterator, Sequence

ASKED = ("-h", "--help")
COMPLETES = "_HRG_COMPLETE"
"""What a shell sets that asks for completions."""
SUMMARY = (
    "Calibration of solid-state wave (hemispherical resonator) gyroscopes: from recorded samples to"
    " correction tables."
)
OPTIONS = {
    "--version": "Print the version and leave.",
    "--install-completion": "Install completion for the current shell.",
    "--show-completion": (
        "Show completion for the current shell, to copy it or customize the installation."
    ),
    ", ".join(ASKED): "Show this message and exit.",
}
"""As typed -> what it does; all but the first are typer's own, a test holds them to it."""
CHAIN = (
    "The chain: simulate or import, demodulate, estimate, then identify, calibrate or diagnose,"
    " compensate, report."
)
COMMANDS = {
    "import": (
        "import_",
        "A laboratory's log (CSV, .csv.gz, WAV, FLAC, MATLAB, NumPy, TDMS, Parquet, LabOne; - for"
        " standard input) to a recording.",
    ),
    "simulate": (
        "simulate",
        "Simulate recordings of a gyro described in TOML; several [[run]] tables give"
        " OUTPUT-RUN.h5 each.",
    ),
    "inject": (
        "inject",
        "An effect of the catalogue hidden in measured samples, to see whether a diagnosis finds it"
        " there.",
    ),
    "demodulate": (
        "demodulate",
        "Samples to signals per window: least squares at the oscillation frequency, which is found"
        " and followed.",
    ),
    "estimate": (
        "estimate",
        "Signals to the wave: main amplitude, quadrature, wave angle and phases with standard"
        " deviations.",
    ),
    "identify": (
        "identify",
        "Resonator parameters from free run-downs: damping and frequency split, their axes, scale"
        " factor.",
    ),
    "rate": (
        "rate",
        "The rate a free or driven run shows, with the identified resonator as reference model.",
    ),
    "calibrate": (
        "calibrate",
        "Drift D(T, angle) and scale-factor K(T, angle) tables from forced runs over temperature"
        " and rate.",
    ),
    "compensate": ("compensate", "Rate and angle of a run after the tables."),
    "diagnose": (
        "diagnose",
        "What the simulation gets wrong: the cause, its size, the extended model"
        " (OUTPUT.extended.toml) and the gain.",
    ),
    "plan": (
        "plan",
        "The next experiment: the runs of a menu that separate open causes or shrink the worst"
        " variances, as a simulation file.",
    ),
    "forecast": (
        "forecast",
        "The drift a resonator will show, alone: D over the angle, the wave's way over hours, the"
        " error between external fixes.",
    ),
    "mismatch": (
        "mismatch",
        "The signals a control system acts on: error of the amplitude, quadrature, phase and angle,"
        " with their noise and delay.",
    ),
    "update": (
        "update",
        "A calibration whose coefficients moved, brought up to date by a resonator found later;"
        " what moved is told in σ.",
    ),
    "export": (
        "export",
        "Any hrg file for other programs, by the output's suffix: CSV, JSON (.gz), Parquet, XLSX,"
        " MAT; a calibration as a C header.",
    ),
    "check": (
        "check",
        "Hold the figures of files against limits and an earlier result: exit status 0 within, 3"
        " outside.",
    ),
    "diff": ("diff", "What moved between two results of one kind, in σ of both."),
    "report": (
        "report",
        "One self-contained page (or the figures) about any set of hrg files: the answer first.",
    ),
    "info": ("info", "What a file holds: kind, validity, history, sources, figures."),
    "verify": (
        "verify",
        "Whether files are as they were written: checksums of every dataset, the chain of sources,"
        " a lot's notes; 3 when not.",
    ),
    "rehearse": (
        "rehearse",
        "Whether a result's errors hold: its programme again and again on a simulated twin, through"
        " raw samples and the same stages.",
    ),
    "run": (
        "run",
        "The whole chain on the recordings (or logs, or a folder of them) of one gyro: the answer,"
        " and a page to show.",
    ),
    "batch": (
        "batch",
        "The whole chain for every gyro of a lot, a page each, and the lot as a whole: causes in"
        " common, worst gyros, outliers; resumes where it was interrupted; 3 when a gyro does not"
        " pass.",
    ),
    "ledger": (
        "ledger",
        "Every result of every gyro over time: drift, charts, capability, gauge study.",
    ),
    "study": (
        "study",
        "Repeat one of the papers' experiments, or a study of this project's own methods: table and"
        " figures into a folder.",
    ),
    "effects": (
        "effects",
        "The catalogue of effects: what a simulation can contain and a diagnosis can name.",
    ),
}
"""Name -> module in `commands`, and the first sentence of its help, in the order of the help: so
that the list of commands is shown without loading them."""
NARROWEST, WIDEST = 50, 78
"""Columns of the page, whatever the terminal has."""


def compose_front_page(columns: int | None = None) -> str:
    """The help of `hrg` itself.

    Parameters
    ----------
    columns
        Of the terminal; None: as many as it says it has.

    Returns
    -------
    str
        Lines without the last one's end.

    Examples
    --------
    >>> from hrg_cli.front_page import compose_front_page
    >>> compose_front_page(80).splitlines()[0]
    'Usage: hrg [OPTIONS] COMMAND [ARGS]...'
    """
    seen = shutil.get_terminal_size().columns if columns is None else columns
    width = max(NARROWEST, min(seen - 2, WIDEST))
    commands = {name: summary for name, (_, summary) in COMMANDS.items()}
    return "\n".join(
        [
            "Usage: hrg [OPTIONS] COMMAND [ARGS]...",
            "",
            *_indent(SUMMARY, width),
            "",
            "Options:",
            *_list_entries(OPTIONS, width),
            "",
            "Commands:",
            *_list_entries(commands, width),
            "",
            *_indent(CHAIN, width),
        ]
    )


def is_front_page_asked(arguments: Sequence[str]) -> bool:
    """Whether a call asks for the front page and nothing else.

    Parameters
    ----------
    arguments
        Of the command line, behind the program's name.

    Returns
    -------
    bool
        True where it does.

    Examples
    --------
    >>> from hrg_cli.front_page import is_front_page_asked
    >>> is_front_page_asked(["--help"]), is_front_page_asked(["demodulate", "--help"])
    (True, False)
    """
    return len(arguments) == 1 and arguments[0] in ASKED


def _indent(text: str, width: int) -> list[str]:
    return textwrap.wrap(text, width, initial_indent="  ", subsequent_indent="  ")


def _list_entries(entries: dict[str, str], width: int) -> Iterator[str]:
    """Names in one column, what they mean beside them."""
    column = max(map(len, entries)) + 2
    for name, meaning in entries.items():
        for at, line in enumerate(textwrap.wrap(meaning, width - column - 2)):
            yield f"  {'' if at else name:{column}}{line}"
