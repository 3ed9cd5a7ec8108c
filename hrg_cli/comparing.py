"""Two results of one kind held against each other: every figure's difference in its own unit and in
σ of both."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .errors import HrgError
from .limit_values import find_unit
from .limits import list_figures
from .records import Calibration, Diagnosis, Record


@dataclass(frozen=True)
class Difference:
    """A figure of both results; `sigma` is (new − old)/√(σ_old² + σ_new²), None where no σ is
    known."""

    name: str
    old: float
    old_std: float | None
    new: float
    new_std: float | None
    units: str
    difference: float
    sigma: float | None


@dataclass(frozen=True)
class Comparison:
    """The differences, largest in σ first; figures that only one of them has; words that differ
    (gyro, verdict, status); those of the figures that are a result's own, with a σ there, and which
    of the two has them."""

    differences: tuple[Difference, ...]
    only_old: tuple[str, ...]
    only_new: tuple[str, ...]
    words: tuple[tuple[str, str, str], ...]
    lone_figures: tuple[tuple[str, str], ...] = ()

    @property
    def largest_sigma(self) -> float | None:
        """Size of the largest difference in σ; None where no figure has a σ."""
        known = [abs(d.sigma) for d in self.differences if d.sigma is not None]
        return max(known) if known else None

    @property
    def is_empty(self) -> bool:
        """Whether the two are alike in every figure and word."""
        moved = any(d.difference for d in self.differences)
        return not (moved or self.only_old or self.only_new or self.words)

    @property
    def lone_causes(self) -> list[tuple[str, str]]:
        """Causes that one result alone has: "old" or "new", and the cause's name."""
        return [
            (place, cause)
            for place, names in (("old", self.only_old), ("new", self.only_new))
            for cause in sorted({n.split(".")[1] for n in names if n.startswith("effects.")})
        ]


def compare(
    old: Record, new: Record, called: tuple[str, str] = ("the old file", "the new one")
) -> Comparison:
    """Hold two results of one kind against each other.

    Parameters
    ----------
    old, new
        The results.
    called
        What they are called in errors.

    Returns
    -------
    Comparison
        Every figure that both have, largest difference in σ first, and what one of them has alone.

    Raises
    ------
    HrgError
        Two kinds, or two gyros' mode numbers.

    Examples
    --------
    A frequency that is 3 mHz higher, ± 1 mHz in both:

    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.comparing import compare
    >>> old, new = (
    ...     Resonator(
    ...         name=np.array(["frequency_hz"]), value=np.array([hz]), std=np.array([1e-3]),
    ...         units=np.array(["Hz"]), covariance=np.array([[1e-6]]), details="{}",
    ...     )
    ...     for hz in (5000.0, 5000.003)
    ... )
    >>> first = compare(old, new).differences[0]
    >>> first.name, round(first.difference, 6), round(first.sigma, 2)
    ('frequency_hz', 0.003, 2.12)
    """
    if old.kind != new.kind:
        raise HrgError(
            f"{called[0]} is a {old.kind}, {called[1]} a {new.kind}; name two of one kind"
        )
    mode = getattr(old, "mode_number", 2)
    if mode != getattr(new, "mode_number", mode):
        raise HrgError(
            f"{called[0]} is of mode number {mode}, {called[1]} of"
            f" {getattr(new, 'mode_number', mode)}; compare like with like"
        )
    first, second = list_figures(old), list_figures(new)
    names = [
        n
        for n in first
        if n in second
        and is_told_once(n, first)
        and math.isfinite(first[n])
        and math.isfinite(second[n])
    ]
    found = [
        _difference(n, first[n], find_std(n, first), second[n], find_std(n, second), int(mode))
        for n in names
    ]
    if isinstance(old, Calibration) and isinstance(new, Calibration):
        found += compare_tables(old, new)
    only_old, only_new = (
        tuple(n for n in own if n not in other and is_told_once(n, own))
        for own, other in ((first, second), (second, first))
    )
    measured = (("old", only_old, first), ("new", only_new, second))
    return Comparison(
        tuple(sorted(found, key=lambda d: -abs(d.sigma) if d.sigma is not None else 1.0)),
        only_old,
        only_new,
        _list_words(old, new),
        tuple((place, n) for place, names, known in measured for n in names if _is_own(n, known)),
    )


def _list_words(old: Record, new: Record) -> tuple[tuple[str, str, str], ...]:
    """The words that differ: status, gyro where both name one, verdict of diagnoses."""
    words: list[tuple[str, str, str]] = [("status", old.status, new.status)]
    gyro, other = (str(getattr(one, "gyro_id", "")) for one in (old, new))
    if gyro and other:
        words.append(("gyro", gyro, other))
    if isinstance(old, Diagnosis) and isinstance(new, Diagnosis):
        words.append(("verdict", old.verdict, new.verdict))
    return tuple(w for w in words if w[1] != w[2])


def _is_own(name: str, figures: dict[str, float]) -> bool:
    """Whether a figure is a result's own, and measured."""
    return "." not in name and find_std(name, figures) is not None


def _difference(
    name: str, old: float, old_std: float | None, new: float, new_std: float | None, mode: int
) -> Difference:
    change = compute_change(name, old, new, mode)
    both = (
        math.hypot(old_std or 0.0, new_std or 0.0)
        if old_std is not None and new_std is not None
        else 0.0
    )
    return Difference(
        name,
        old,
        old_std,
        new,
        new_std,
        find_unit(name),
        change,
        change / both if both > 0 else None,
    )


def compute_change(name: str, old: float, new: float, mode: int) -> float:
    """New less old; of an axis, which repeats after π/m, the shorter way round.

    Parameters
    ----------
    name
        Of the figure.
    old, new
        Its values.
    mode
        m.

    Returns
    -------
    float
        In the figure's unit.

    Examples
    --------
    >>> from hrg_cli.comparing import compute_change
    >>> round(compute_change("damping_axis_rad", 0.01, 1.56, 2), 6)
    -0.020796
    """
    change = new - old
    if name.endswith(("axis_rad", "axis_rad.value")):
        period = math.pi / mode
        change = (change + period / 2) % period - period / 2
    return change


def is_told_once(name: str, figures: dict[str, float]) -> bool:
    """Whether a figure is told once, by a name that means the same in two results.

    Parameters
    ----------
    name
        Of the figure.
    figures
        All of the result's, name -> value.

    Returns
    -------
    bool
        It is no σ, no place in a list and no second spelling.

    Examples
    --------
    >>> from hrg_cli.comparing import is_told_once
    >>> figures = {"frequency_hz": 5e3, "frequency_hz_std": 1e-3, "runs.0.rows": 9.0}
    >>> [name for name in figures if is_told_once(name, figures)]
    ['frequency_hz']
    """
    parts = name.split(".")
    twice = name.startswith("parameters.") and len(parts) > 1 and parts[1] in figures
    return not (twice or any(part.isdigit() for part in parts) or _is_std(name, figures))


def _is_std(name: str, figures: dict[str, float]) -> bool:
    return name.endswith((".std", "_std")) and (
        name[:-4] in figures or f"{name[:-4]}.value" in figures or name.endswith(".std")
    )


def find_std(name: str, figures: dict[str, float]) -> float | None:
    """The standard deviation of a figure.

    Parameters
    ----------
    name
        Of the figure.
    figures
        All of the result's, name -> value.

    Returns
    -------
    float or None
        In the figure's unit; None where the figures do not hold it.

    Examples
    --------
    >>> from hrg_cli.comparing import find_std
    >>> find_std("frequency_hz", {"frequency_hz": 5e3, "frequency_hz_std": 1e-3})
    0.001
    """
    keys = (f"{name}_std", f"{name.removesuffix('.value')}.std")
    return next((figures[k] for k in keys if k in figures and math.isfinite(figures[k])), None)


def compare_tables(old: Calibration, new: Calibration) -> Sequence[Difference]:
    """Where two tables differ most in σ.

    Both are read on the old one's nodes that the new one reaches.

    Parameters
    ----------
    old, new
        Calibrations over the same axis; over two there is nothing to compare.

    Returns
    -------
    list of Difference
        One of the drift D, one of the scale factor K.

    Examples
    --------
    A drift that grew by 10⁻⁶ rad/s, ± 10⁻⁷ in both:

    >>> from hrg_cli.comparing import compare_tables
    >>> from hrg_cli.stages.calibration.drawn_tables import draw_tables
    >>> tables = draw_tables()
    >>> moved = tables.replace(drift_harmonics=tables.drift_harmonics + 1e-6)
    >>> [(found.name, round(found.sigma, 2)) for found in compare_tables(tables, moved)]
    [('table.drift_rad_s', 7.07), ('table.scale_factor', 0.0)]
    """
    if old.axis != new.axis:
        return []
    node, angle = np.meshgrid(
        np.asarray(old.node, float), np.asarray(old.wave_angle_rad, float), indexing="ij"
    )
    low, high = (
        float(x) if np.isfinite(x) else y
        for x, y in ((new.node_min, -np.inf), (new.node_max, np.inf))
    )
    reached = (node >= low) & (node <= high)
    if not reached.any():
        return []
    # both by one way: where the tables are alike, rounding is too
    here, there = (one.values_at(node[reached], angle[reached]) for one in (old, new))
    # σ of the new table at the old one's nodes: that of its nearest node and angle
    near = np.abs(np.asarray(new.node, float)[None] - node[reached][:, None]).argmin(axis=1)
    turn = np.abs(np.asarray(new.wave_angle_rad, float)[None] - angle[reached][:, None]).argmin(
        axis=1
    )
    found = []
    for k, name in enumerate(("drift_rad_s", "scale_factor")):
        old_std = np.asarray(getattr(old, f"{name}_std"))[reached]
        new_std = np.asarray(getattr(new, f"{name}_std"))[near, turn]
        sigma = (there[k] - here[k]) / np.where((s := np.hypot(old_std, new_std)) > 0, s, np.nan)
        if np.isfinite(sigma).any():
            at = int(np.nanargmax(np.abs(sigma)))
            said = f"table.{name}"
            found.append(
                _difference(
                    said,
                    float(here[k][at]),
                    float(old_std[at]),
                    float(there[k][at]),
                    float(new_std[at]),
                    2,
                )
            )
    return found
