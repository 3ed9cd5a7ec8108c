"""What every command is given by the options that all have, and how it ends: settings, output,
report."""

from __future__ import annotations

import inspect
import json
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import typer
import typer.main

from ..errors import UsageError
from .guard import DONE, REFUSED, forgive_closed_pipe

SAME_CONTENT = {".h5": (".h5", ".hdf5", ".he5", ".nc", ".nc4"), ".html": (".html", ".htm")}
OTHER_CONTENT = (
    *(".csv", ".json", ".h", ".toml", ".txt", ".pdf", ".png", ".svg", ".jpg"),
    *(".xlsx", ".xls", ".mat", ".parquet", ".wav", ".flac", ".tdms", ".zip"),
)
PROMISING = frozenset((*SAME_CONTENT[".h5"], *SAME_CONTENT[".html"], *OTHER_CONTENT))
"""Suffixes that tell a person and other programs what a file holds."""


@dataclass(frozen=True)
class Common:
    """The options that every command takes."""

    output: Path | None
    force: bool
    config: Path | None
    assignments: tuple[str, ...]
    show_config: bool
    json: bool
    quiet: bool
    verbose: bool
    strict: bool
    seed: int | None
    jobs: int
    piped: bool = False
    """The output is a temporary file whose name goes through a pipe."""

    def resolve_settings(
        self, function: Callable[..., Any], table: str = "", **flags: Any
    ) -> dict[str, Any]:
        """The command's resolved settings; with --show-config they are printed and the command
        ends."""
        from .. import settings

        accepted = inspect.signature(function).parameters
        for name in ("seed", "jobs"):
            if name in accepted and name not in flags:
                flags[name] = (
                    getattr(self, name)
                    if name == "seed"
                    else (self.jobs if self.jobs != 1 else None)
                )
        values = settings.resolve(function, self.config, self.assignments, flags, table)
        if self.show_config:
            self.leave_with_settings({table or function.__name__: values})
        return values

    def leave_with_settings(self, values: Mapping[str, Any]) -> NoReturn:
        """Print settings as TOML (as JSON with --json) and end the command."""
        from .. import settings

        text = settings.to_toml(values)
        if self.json:
            import tomllib

            from ..reporting import console

            console.print_json(tomllib.loads(text))
        else:
            print(text, end="")
        raise typer.Exit(DONE)

    def write_report(self, report: Mapping[str, Any]) -> dict[str, Any]:
        """The report of a command that only answers, written as JSON where --output names a
        file."""
        from ..reporting import console
        from ..store import write_whole

        whole = {**report, "output": None if self.output is None else str(self.output)}
        if self.output is not None:
            self._need_suffix("report.json")
            with write_whole(self.output, self.force) as temporary:
                temporary.write_text(
                    json.dumps(console.clean(whole), indent=1, ensure_ascii=False) + "\n",
                    encoding="utf-8",
                )
        return whole

    def need_output(self, example: str) -> Path:
        """The output, or the usage error that names an example; also where its suffix promises
        another content."""
        if self.output is None:
            raise UsageError(f"no output is named; add -o {example}")
        self._need_suffix(example)
        return self.output

    def _need_suffix(self, example: str) -> None:
        suffix = "" if self.output is None else self.output.suffix.lower()
        wanted = re.findall(r"\.\w+", example)
        if (
            wanted
            and suffix in PROMISING
            and not any(suffix in SAME_CONTENT.get(w, (w,)) for w in wanted)
        ):
            raise UsageError(
                f"-o {self.output}: {self.output} would not hold what {suffix} promises; name it as"
                f" {example}"
            )

    def finish(
        self,
        report: Mapping[str, Any],
        show: Callable[[], None] | None = None,
        *,
        judged: bool = True,
        told: Collection[str] = (),
    ) -> None:
        """Print the result and leave with the exit status that its validity asks for (0 where it is
        told but not judged).

        told: reasons that `show` says already.
        """
        from ..reporting import console

        with forgive_closed_pipe():
            self._print(report, show)
        if self.verbose and not self.quiet and report.get("elapsed_s") is not None:
            console.tell(f"{report['kind']}: {report['elapsed_s']:g} s")
        if not judged:
            return
        if not self.json and not (self.quiet and report["status"] == "valid"):
            reasons = report.get("status_reasons", [])
            if report.get("answer") and not self.quiet and not self.piped:
                # The words of an answer need the diagnosis' parts, which most commands never load.
                from ..reporting import answer_text

                reasons = answer_text.list_untold(reasons, report["answer"]["why"])
            shown = () if self.quiet or self.piped else told
            for reason in reasons:
                if reason not in shown:
                    console.tell(f"{report['status']}: {reason}")
        if report.get("status") == "refused" or (self.strict and report.get("status") == "suspect"):
            raise typer.Exit(REFUSED)

    def _print(self, report: Mapping[str, Any], show: Callable[[], None] | None) -> None:
        """What goes to standard output: names of files into a pipe, the JSON, or words."""
        from ..reporting import console

        if self.piped and self.output is not None:
            from .pipes import hand_on

            print(*hand_on(self.output), sep="\n")
        elif self.json:
            console.print_json(report)
        elif not self.quiet:
            if show is not None:
                show()
            if report.get("output"):
                console.say(f"{report['output']}: {report['kind']}, {report['status']}")
