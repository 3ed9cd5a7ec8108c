"""The file of a lot: which recordings, which stages, which settings, which limits; checked whole
before any work begins."""

from __future__ import annotations

import fnmatch
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from .. import settings
from ..errors import HrgError
from ..formats import import_log
from ..limit_values import spell_whole_names
from ..limits import check_tables, read_bounds
from ..pipeline import STAGES
from .groups import GROUPED_BY

PER_RECORDING = ("demodulate", "estimate")
PER_GYRO = ("identify", "calibrate", "diagnose")
_STRICT = ConfigDict(
    extra="forbid",
    frozen=True,
    allow_inf_nan=False,
    populate_by_name=True,
    use_attribute_docstrings=True,
)
Table = dict[str, Any]
Members = dict[str, list[str]]


class RunSettings(BaseModel):
    """Settings of the recordings whose file name fits a pattern."""

    model_config = _STRICT
    import_: Annotated[Table, Field(alias="import")] = {}
    """Settings of import."""
    demodulate: Table = {}
    """Settings of demodulate."""
    estimate: Table = {}
    """Settings of estimate."""


class GyroSettings(BaseModel):
    """What the lot's file says of a gyro: its recordings, where these do not name it, and where and
    when they were made."""

    model_config = _STRICT
    gyro_id: Annotated[str, Field(min_length=1)]
    """The gyro."""
    recordings: list[str] = []
    """Names or patterns of its recordings, relative to this file."""
    day: Annotated[str, Field(pattern=r"^(\d{4}-\d{2}-\d{2})?$")] = ""
    """Day it was measured on."""
    station: str = ""
    """Station it was measured at."""
    fixture: str = ""
    """Fixture it was held in."""
    operator: str = ""
    """Who measured it."""
    firmware: str = ""
    """Firmware of its electronics."""
    order: str = ""
    """Order it belongs to."""

    @field_validator(*GROUPED_BY, mode="before")
    @classmethod
    def _as_text(cls, value: Any) -> Any:
        return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


class LotSettings(BaseModel):
    """A lot: patterns or names of recordings (hrg files or foreign logs), relative to the lot's
    file."""

    model_config = _STRICT
    lot_id: str = ""
    """The lot."""
    created: Annotated[str, Field(pattern=r"^(\d{4}-\d{2}-\d{2}T\d{2}:\d{2}:\d{2}Z)?$")] = ""
    """The time written into every file; empty: the true one."""
    recordings: list[str] = []
    """Names or patterns of recordings, relative to this file; one text or a list."""
    gyro: list[GyroSettings] = []
    """Gyros named here rather than by their recordings."""
    stages: list[Literal["identify", "calibrate", "diagnose"]] = ["identify", "calibrate"]
    """Stages after estimate."""
    outlier_rate: Annotated[float, Field(gt=0, lt=1)] = 0.05
    """Chance that a lot without outliers is given one; the distance follows from the lot's size."""
    outlier_z: Annotated[float, Field(gt=0)] | None = None
    """A fixed distance instead, in robust σ."""
    common_rate: Annotated[float, Field(gt=0, lt=1)] = 0.02
    """Chance that a lot whose gyros have nothing in common is told that they have."""
    groups: dict[Literal["station", "fixture", "operator", "firmware", "order"], Members] = {}
    """By key and value, patterns of the gyros' names."""
    limits: dict[str, Table] = {}
    """What `hrg check` would be given, by kind of file."""
    import_: Annotated[Table, Field(alias="import")] = {}
    """Settings of import."""
    demodulate: Table = {}
    """Settings of demodulate."""
    estimate: Table = {}
    """Settings of estimate."""
    identify: Table = {}
    """Settings of identify."""
    calibrate: Table = {}
    """Settings of calibrate."""
    diagnose: Table = {}
    """Settings of diagnose."""
    runs: dict[str, RunSettings] = {}
    """Settings of the recordings whose file name fits a pattern."""

    @field_validator("recordings", mode="before")
    @classmethod
    def _one_or_many(cls, value: Any) -> Any:
        return [value] if isinstance(value, str) else value

    @field_validator("groups", mode="before")
    @classmethod
    def _one_pattern_or_many(cls, value: Any) -> Any:
        return (
            {
                key: {name: [p] if isinstance(p, str) else p for name, p in members.items()}
                if isinstance(members, dict)
                else members
                for key, members in value.items()
            }
            if isinstance(value, dict)
            else value
        )

    @cached_property
    def _noted(self) -> dict[str, dict[str, str]]:
        """What the tables [[gyro]] say of each gyro's day and groups."""
        noted: dict[str, dict[str, str]] = {}
        for gyro in self.gyro:
            own = noted.setdefault(gyro.gyro_id, {})
            for key in ("day", *GROUPED_BY):
                if getattr(gyro, key):
                    own.setdefault(key, getattr(gyro, key))
        return noted

    def find_groups(self, gyro: str) -> dict[str, str]:
        """The keys that group a gyro, by its own table, else by the first pattern that fits its
        name."""
        own, out = self._noted.get(gyro, {}), {}
        for key, members in self.groups.items():
            for value, patterns in members.items():
                if any(fnmatch.fnmatchcase(gyro, pattern) for pattern in patterns):
                    out[str(key)] = value
                    break
        return out | {key: own[key] for key in GROUPED_BY if key in own}

    def find_day(self, gyro: str) -> str:
        """The day that the lot's file gives a gyro."""
        return self._noted.get(gyro, {}).get("day", "")

    def merge_given(self, stage: str, file_name: str = "") -> Table:
        """The settings given for a stage: the lot's, then those of every pattern that fits the
        file's name."""
        attribute = "import_" if stage == "import" else stage
        given = dict(getattr(self, attribute))
        for pattern, run in self.runs.items():
            if hasattr(run, attribute) and fnmatch.fnmatchcase(file_name, pattern):
                given |= getattr(run, attribute)
        return given

    def check_settings(
        self, stage: str, file_name: str = "", where: str = "the lot's file"
    ) -> Table:
        """The whole checked settings of a stage; `where` names what holds them."""
        function = import_log if stage == "import" else STAGES[stage].load_function()
        checked = settings.validate(
            settings.make_model(function),
            self.merge_given(stage, file_name),
            where,
            prefix=f"{stage}.",
        )
        return {key: getattr(checked, key) for key in type(checked).model_fields}


def read_lot(
    path: Path | str, assignments: tuple[str, ...] = (), over: Table | None = None
) -> LotSettings:
    """The lot of a TOML file, checked whole: its settings, limits and those of every stage.

    Parameters
    ----------
    path
        Of the file.
    assignments
        Texts `key=value`, applied last.
    over
        Tables over the file's own.

    Returns
    -------
    LotSettings
        The lot.

    Raises
    ------
    HrgError
        Not TOML, unknown keys, wrong values, no recordings named; a limit that is none is a
        UsageError.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.lots.lot_settings import read_lot
    >>> with TemporaryDirectory() as name:
    ...     file = Path(name) / "lot.toml"
    ...     _ = file.write_text('recordings = "*.h5"')
    ...     lot = read_lot(file, ("demodulate.periods_per_window=20",))
    >>> lot.recordings, lot.demodulate
    (['*.h5'], {'periods_per_window': 20})
    """
    path = Path(path)
    tree = settings.load_toml(path)
    settings.merge(tree, over or {})
    for text in assignments:
        settings.assign(tree, *settings.parse_assignment(text))
    lot: LotSettings = settings.validate(LotSettings, tree, str(path))
    if not lot.recordings and not any(g.recordings for g in lot.gyro):
        raise HrgError(
            f'{path}: names no recordings; write recordings = "data/*.h5" or [[gyro]] tables'
        )
    check_tables(lot.limits)
    for table in lot.limits.values():
        for name, limit in spell_whole_names(table).items():
            if name not in ("status", "verdict"):
                read_bounds(name, limit)
    for stage in ("import", *PER_RECORDING, *lot.stages):
        for pattern in ("", *lot.runs):
            lot.check_settings(stage, pattern, str(path))
    return lot


def list_recordings(lot: LotSettings, path: Path) -> list[tuple[str | None, Path]]:
    """Every recording that the lot's file names, sorted, none twice.

    Parameters
    ----------
    lot
        Its settings.
    path
        Of its file, beside which the recordings are looked for.

    Returns
    -------
    list of tuple
        The gyro that the file names for it, or None, and the recording.

    Raises
    ------
    HrgError
        A name or pattern that no file fits, or a recording that two gyros name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.lots.lot_settings import LotSettings, list_recordings
    >>> with TemporaryDirectory() as name:
    ...     for run in "ab":
    ...         (Path(name) / f"{run}.h5").touch()
    ...     lot = LotSettings(recordings="*.h5", gyro=[{"gyro_id": "SN-1", "recordings": ["b.h5"]}])
    ...     found = list_recordings(lot, Path(name) / "lot.toml")
    >>> [(gyro, file.name) for gyro, file in found]
    [(None, 'a.h5'), ('SN-1', 'b.h5')]
    """
    found: dict[Path, str | None] = {}
    for gyro, patterns in [(None, lot.recordings), *((g.gyro_id, g.recordings) for g in lot.gyro)]:
        for pattern in patterns:
            files = _matching(path.parent, pattern)
            if not files:
                raise HrgError(
                    f"{path}: no file fits {pattern!r} in {path.parent.absolute()}; correct it"
                )
            for file in files:
                other = found.get(file)
                if gyro is not None and other not in (None, gyro):
                    raise HrgError(
                        f"{path}: {file.name} is named by gyro {other} and by gyro {gyro}; a"
                        " recording is of one gyro: leave it out of the other"
                    )
                found[file] = gyro if gyro is not None else other
    return [(gyro, path) for path, gyro in sorted(found.items())]


def _matching(base: Path, pattern: str) -> list[Path]:
    whole = base / pattern
    if whole.is_file():
        return [whole.absolute()]
    try:
        root, relative = (
            (Path(whole.anchor), str(whole.relative_to(whole.anchor)))
            if Path(pattern).is_absolute()
            else (base, pattern)
        )
        return sorted(p.absolute() for p in root.glob(relative) if p.is_file())
    except (ValueError, NotImplementedError, OSError) as error:
        raise HrgError(
            f"{base}: {pattern!r} is no pattern of files ({error}); write e.g. data/*.h5"
        ) from error
