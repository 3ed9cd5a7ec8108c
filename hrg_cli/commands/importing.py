"""The body of `hrg import`: a foreign log (or standard input) to a recording file."""

from __future__ import annotations

import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .. import pipeline, store
from ..formats import import_log, second_file
from ..records import Recording
from .frame import Common, command_line, existing


def import_file(log: Path | None, run: Common, flags: Mapping[str, Any]) -> dict[str, Any]:
    """Read `log`, write the recording, return the command's JSON."""
    started = time.monotonic()
    values = run.settings(import_log, "import", **flags)
    log = existing([log] if log else [], "a log, or - for standard input")[0]
    output = run.need_output("recording.h5")
    with _on_disk(log) as path:
        sources = [path] if values["s_file"] is None else [path, second_file(path, values["s_file"])]
        record = pipeline.write_first(
            output, import_log(path, **values), values, "import", sources, force=run.force, command_line=command_line()
        )
    with pipeline.gone_if_it_fails(output), store.open_record(output, Recording) as whole:
        facts = {
            "run_id": whole.run_id,
            "samples": len(whole),
            "duration_s": float(whole.times(len(whole) - 1)[-1]),
            "sample_rate_hz": whole.sample_rate_hz,
        }
    return pipeline.report(record, output, started, facts)


@contextmanager
def _on_disk(log: Path) -> Iterator[Path]:
    """The log as a file: standard input is copied to a temporary one."""
    if str(log) != "-":
        yield log
        return
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "standard-input"
        with open(path, "wb") as file:
            shutil.copyfileobj(sys.stdin.buffer, file)
        yield path
