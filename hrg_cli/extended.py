"""What a diagnosis leaves beside its file: the extended model as a simulation file, and its
resonator as a file of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from . import store
from .records import Diagnosis, Source
from .stages.diagnosis.extended.extended_resonator import build_extended_resonator


def find_extended_paths(output: Path) -> tuple[Path, Path]:
    """NAME.extended.toml and NAME.extended_resonator.h5 of NAME.h5."""
    stem = output.name.removesuffix(".h5")
    return output.with_name(f"{stem}.extended.toml"), output.with_name(
        f"{stem}.extended_resonator.h5"
    )


def write_extended(diagnosis: Diagnosis, output: Path, force: bool) -> list[Path]:
    """Write what the diagnosis holds of its extended model; the files written. HrgError: one exists
    (unless `force`)."""
    model, resonator = find_extended_paths(output)
    written = []
    if diagnosis.extended_model:
        with store.write_whole(model, force) as temporary:
            temporary.write_text(diagnosis.extended_model, encoding="utf-8")
        written.append(model)
    record = build_extended_resonator(diagnosis)
    if record is not None:
        provenance = replace(
            diagnosis.provenance,
            sources=(Source(output.name, "diagnosis", store.compute_sha256(output)),),
        )
        store.write(resonator, record.replace(provenance=provenance), force)
        written.append(resonator)
    return written
