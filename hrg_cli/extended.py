"""What a diagnosis leaves beside its file: the extended model as a simulation file, and its
resonator as a file of its own."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from . import store
from .records import Diagnosis, Source
from .stages.diagnosis.extended.extended_resonator import build_extended_resonator


def find_extended_paths(output: Path) -> tuple[Path, Path]:
    """Where a diagnosis leaves its extended model.

    Parameters
    ----------
    output
        The diagnosis, NAME.h5.

    Returns
    -------
    tuple of Path
        NAME.extended.toml and NAME.extended_resonator.h5.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.extended import find_extended_paths
    >>> [path.name for path in find_extended_paths(Path("diagnosis.h5"))]
    ['diagnosis.extended.toml', 'diagnosis.extended_resonator.h5']
    """
    stem = output.name.removesuffix(".h5")
    return output.with_name(f"{stem}.extended.toml"), output.with_name(
        f"{stem}.extended_resonator.h5"
    )


def write_extended(diagnosis: Diagnosis, output: Path, force: bool) -> list[Path]:
    """Write what a diagnosis holds of its extended model, beside it.

    Parameters
    ----------
    diagnosis
        As it was written.
    output
        Its file.
    force
        Files that are there may be replaced.

    Returns
    -------
    list of Path
        The files written; none of a diagnosis without a model.

    Raises
    ------
    HrgError
        One exists.

    Examples
    --------
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli.extended import write_extended
    >>> from hrg_cli.records import Diagnosis
    >>> rows = dict.fromkeys(("run", "time_s", "wave_angle_rad", "main_amplitude"), np.zeros(0))
    >>> signals = ("measured", "simulated_before", "simulated_after", "residual_before")
    >>> rows |= dict.fromkeys((*signals, "residual_after"), np.zeros((0, 4)))
    >>> none = Diagnosis(verdict="unexplained", report="{}", series="{}", **rows)
    >>> write_extended(none, Path("diagnosis.h5"), False)
    []
    """
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
