"""The body of `hrg plan`: what is known and a menu in, the next runs as a simulation file out."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .. import pipeline, settings, store
from ..errors import HrgError, UsageError
from ..records import Diagnosis, Resonator, Wave
from ..stages.plan import plan, summary
from .frame import Common, existing


def plan_files(
    files: Sequence[Path], menu: Path | None, run: Common, flags: dict[str, Any]
) -> dict[str, Any]:
    """Plan the next runs; writes them as a simulation file; the command's JSON."""
    started = time.monotonic()
    values = run.settings(plan, **flags)
    first, *waves = existing(
        files, "a resonator or diagnosis file, then the waves measured already"
    )
    if menu is None:
        raise UsageError("no menu is named; add --menu configs/menu.toml")
    known = store.read_any(first)
    if not isinstance(known, Resonator | Diagnosis):
        raise HrgError(
            f"{first}: is a {known.kind} file; make a resonator with `hrg identify` or a diagnosis"
            " with `hrg diagnose`"
        )
    made = plan(
        known, settings.load_toml(menu), [store.read(path, Wave) for path in waves], **values
    )
    if run.output is not None:
        with store.atomic_path(run.output, run.force) as temporary:
            temporary.write_text(settings.to_toml(made.file), encoding="utf-8")
    return {
        **pipeline.common_keys("plan", made.status, made.status_reasons, run.output, started),
        **summary(made),
    }
