"""What a diagnosis finds, and what it invents, on the user's own recordings: every effect hidden in
them at several sizes (`inject`).

What the recordings show without any injection is the background: its causes are not counted as
false names, and its size of an effect is taken off the one found. A size is in σ of an ideal
detector that knows the effect and its direction, with the base model and the background's causes as
free as these runs and weak priors leave them; where these leave more than noise, σ is larger by the
root of χ² per degree of freedom.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from ..effects import EFFECTS, find
from ..effects.effect import RUN, Effect
from ..errors import HrgError, UsageError
from ..executors import run_tasks, start_processes
from ..records import Recording, Wave, collect
from ..stages.demodulate import demodulate
from ..stages.diagnose import diagnose, summarise
from ..stages.estimate import estimate
from ..stages.inject import inject
from ..stages.injection.samples import UnchangedError
from .power import compute_coverage, compute_share
from .recovery_sizes import choose_values, fit_background, need_thinkable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


Array = np.ndarray
Row = dict[str, Any]
LARGEST_GROUP = 3
"""Names that a group may have in which the effect counts as named."""


def recovery_study(
    recordings: Sequence[Recording],
    known: Sequence[Row] = (),
    keep: Callable[[Sequence[Row]], None] = lambda rows: None,
    *,
    effects: Annotated[
        list[str], Field(description="effects to hide; none: every one of the catalogue")
    ] = [],  # noqa: B006
    sizes: Annotated[
        list[float], Field(min_length=1, description="sizes, in σ of an ideal detector")
    ] = [5.0, 10.0, 20.0],  # noqa: B006
    draws: Annotated[int, Field(ge=1, description="random directions and instants an effect")] = 1,
    periods_per_window: Annotated[
        float, Field(gt=0, description="oscillation periods per window")
    ] = 5.0,
    scale_factor: Annotated[
        float | None, Field(gt=0, description="known scale factor K, held")
    ] = None,
    seed: Annotated[int, Field(ge=0, description="seed of directions and instants")] = 0,
    jobs: Annotated[int, Field(ge=1, description="processes")] = 1,
) -> dict[str, Any]:
    """How well diagnosis finds effects that are hidden in a user's own recordings.

    Parameters
    ----------
    recordings
        Of one gyro.
    known
        Rows of an interrupted study, which are not done again.
    keep
        Told all rows whenever there are more.
    effects
        That are hidden; empty: every one of the catalogue.
    sizes
        In σ of an ideal detector.
    draws
        Random directions and instants an effect.
    periods_per_window
        Periods of the oscillation in a window.
    scale_factor
        Known K, held; None: fitted.
    seed
        Of directions and instants.
    jobs
        Processes.

    Returns
    -------
    dict
        Sizes, background, effects (name -> figures), all and rows.

    Raises
    ------
    UsageError
        No recording, a size that is not above 0, or an unknown effect.
    HrgError
        The recordings as they are give no diagnosis.

    Examples
    --------
    >>> from hrg_cli.studies.recovery import recovery_study
    >>> recovery_study([])
    Traceback (most recent call last):
    ...
    hrg_cli.errors.UsageError: no recording is named; name the recordings of one gyro, ...
    """
    if not recordings:
        raise UsageError(
            "no recording is named; name the recordings of one gyro, e.g. hrg study recovery"
            " run-*.h5 -o study/"
        )
    names = effects or [e.name for e in EFFECTS]
    for name in names:
        find(name)
    if min(sizes) <= 0:
        raise UsageError(f"sizes holds {min(sizes):g}; a size is above 0 σ")
    waves = [_make_wave(recording, periods_per_window) for recording in recordings]
    background = _need_diagnosed(_diagnosed(waves, scale_factor))
    rows = [dict(row) for row in known]
    done = {(row["effect"], row["draw"]) for row in rows}
    tasks = [
        (
            tuple(recordings),
            tuple(waves),
            background,
            name,
            draw,
            tuple(sizes),
            periods_per_window,
            scale_factor,
            seed,
        )
        for draw in range(draws)
        for name in names
        if (name, draw) not in done
    ]
    # a slice at a time, so that an interrupted study loses little
    at_once = 4 * jobs if jobs > 1 else 1
    for first in range(0, len(tasks), at_once):
        for made in run_tasks(
            recover, tasks[first : first + at_once], lambda: start_processes(jobs)
        ):
            rows += made or []
        keep(list(rows))
    return assemble([row for row in rows if row["effect"] in names], list(sizes), background)


def recover(
    task: tuple[
        Sequence[Recording],
        Sequence[Wave],
        Row,
        str,
        int,
        Sequence[float],
        float,
        float | None,
        int,
    ],
) -> list[Row]:
    """What diagnosis says of one effect, hidden in one direction at every size.

    Parameters
    ----------
    task
        Recordings, their waves, the background's report, effect, draw, sizes [σ], periods per
        window, known K or None, and seed.

    Returns
    -------
    list of dict
        A row a size; one row with the reason where these runs cannot show the effect.

    Examples
    --------
    Free runs have no drive that could be turned:

    >>> import numpy as np
    >>> from hrg_cli import collect, simulate
    >>> from hrg_cli.stages.simulate import list_run_ids
    >>> from hrg_cli.studies.hidden import draw_programme, make_waves
    >>> from hrg_cli.studies.recovery import recover
    >>> table = draw_programme(np.random.default_rng(1), "gain_mismatch", 3e-4)
    >>> runs = [collect(simulate(table, run=run, seed=1)) for run in list_run_ids(table)]
    >>> waves = make_waves(table, 1, "gain_mismatch")
    >>> task = (runs, waves, {"effects": []}, "drive_rotation", 0, (10.0,), 40.0, None, 0)
    >>> [row["not_shown"] for row in recover(task)]
    ['drive_rotation: these runs cannot show it']
    """
    recordings, waves, background, name, draw, sizes, periods_per_window, scale_factor, seed = task
    effect, random = find(name), np.random.default_rng([seed, draw, zlib.crc32(name.encode())])
    rows: list[Row] = []
    try:
        fit = fit_background(waves, scale_factor, background)
        values_at = choose_values(effect, fit, recordings, waves, random)
        for size in sizes[:1] if effect.whole_samples else sizes:
            true = values_at(size)
            need_thinkable(effect, true, size, fit)
            changed = [
                _hide(recording, number, effect, true)
                for number, recording in enumerate(recordings)
            ]
            if all(one is recording for one, recording in zip(changed, recordings, strict=True)):
                why = f"{name}: does nothing in these recordings"
                return [*rows, {"effect": name, "draw": draw, "size": None, "not_shown": why}]
            pairs = zip(changed, recordings, waves, strict=True)
            seen = [
                wave if one is recording else _make_wave(one, periods_per_window)
                for one, recording, wave in pairs
            ]
            report = _diagnosed(seen, scale_factor)
            rows.append(
                {
                    "effect": name,
                    "draw": draw,
                    "size": size,
                    "true": true,
                    **judge_report(report, background, effect, true),
                }
            )
    except HrgError as error:
        rows.append({"effect": name, "draw": draw, "size": None, "not_shown": str(error)})
    return rows


def judge_report(report: Row, background: Row, effect: Effect, true: dict[str, float]) -> Row:
    """What a diagnosis says of an effect that was hidden.

    Parameters
    ----------
    report
        Of the recordings with it.
    background
        Of the recordings as they are.
    effect
        That was hidden.
    true
        Its parameters.

    Returns
    -------
    dict
        Whether it is named first or among others beside the background, what is named falsely, and
        its size against the true one.

    Examples
    --------
    Found 1.1 times as large as it is, one σ off:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.studies.recovery import judge_report
    >>> gain = {"value": 0.011, "std": 0.001}
    >>> found = dict(name="gain_mismatch", indistinguishable_from=[], parameters={"gain": gain})
    >>> report = {"verdict": "explained", "effects": [found]}
    >>> row = judge_report(report, {"effects": []}, find("gain_mismatch"), {"gain": 0.01})
    >>> (
    ...     row["first"],
    ...     round(row["found_over_true"]["gain"], 9),
    ...     round(row["error_over_std"]["gain"], 9),
    ... )
    (True, 1.1, 1.0)
    """
    before = {e["name"]: e for e in background["effects"]}
    entries = report["effects"]
    groups = [[e["name"], *e["indistinguishable_from"]] for e in entries]
    own = [group for group in groups if effect.name in group and len(group) <= LARGEST_GROUP]
    new = [group for group in groups if group[0] not in before or group in own]
    found = next((e for e in entries if e["name"] == effect.name), None)
    sizes, errors = {}, {}
    sign = _find_sign(effect, found, true) if found else 1.0
    for parameter, value in (found["parameters"] if found else {}).items():
        neutral = next(p.neutral for p in effect.parameters if p.name == parameter)
        wanted = true.get(parameter, neutral) - neutral
        was = (
            before.get(effect.name, {})
            .get("parameters", {})
            .get(parameter, {})
            .get("value", neutral)
            - neutral
        )
        if not wanted or value["value"] is None:
            continue
        there = sign * (value["value"] - neutral - was)
        sizes[parameter] = there / wanted
        if value["std"]:
            errors[parameter] = (there - wanted) / value["std"]
    return {
        "verdict": report["verdict"],
        "refused": report.get("refused"),
        "first": bool(own) and bool(new) and new[0] == own[0],
        "among": bool(own),
        "false": [group[0] for group in groups if group not in own and group[0] not in before],
        "found_over_true": sizes,
        "error_over_std": errors,
    }


def _find_sign(effect: Effect, found: Row, true: dict[str, float]) -> float:
    """Common sign of the parameters where it is nobody's to know: of a vector coherent with φ, and
    of a knock half a period later."""
    if not effect.coherent and effect.slow_jump is None:
        return 1.0
    parts = [
        (p["value"], true.get(name, 0.0), p["std"])
        for name, p in found["parameters"].items()
        if p["value"] is not None and p["std"]
    ]
    return float(np.sign(sum(value * wanted / std**2 for value, wanted, std in parts)) or 1.0)


def assemble(rows: Sequence[Row], sizes: list[float], background: Row) -> dict[str, Any]:
    """The figures of the study, from what each draw says.

    Parameters
    ----------
    rows
        A row an effect, draw and size.
    sizes
        In σ of an ideal detector.
    background
        Of the recordings as they are.

    Returns
    -------
    dict
        Sizes, background, effects, all and rows.

    Examples
    --------
    >>> from hrg_cli.studies.recovery import assemble
    >>> background = {"verdict": "adequate", "effects": [], "after": {"chi2_per_dof": 1.0}}
    >>> assemble([], [5.0], background)["background"]
    {'verdict': 'adequate', 'named': [], 'chi2_per_dof': 1.0}
    """
    names = [e.name for e in EFFECTS if any(r["effect"] == e.name for r in rows)]
    held = {e["name"] for e in background["effects"]}
    rows = [_blame_background(row) if row["effect"] in held else row for row in rows]
    of = {name: [r for r in rows if r["effect"] == name] for name in names}
    return {
        "sizes": sizes,
        "background": {
            "verdict": background["verdict"],
            "named": [e["name"] for e in background["effects"]],
            "chi2_per_dof": background["after"]["chi2_per_dof"],
        },
        "effects": {name: _effect_figures(of[name], sizes) for name in names},
        "all": _effect_figures([r for r in rows if not find(r["effect"]).whole_samples], sizes),
        "rows": list(rows),
    }


def _blame_background(row: Row) -> Row:
    """A row of an effect that the background holds; where more of it was not shown, that is why."""
    if row["size"] is not None:
        return row
    return {**row, "not_shown": f"{row['effect']}: is part of the background of these runs already"}


def describe_background(study: dict[str, Any]) -> str:
    """What the recordings show without any injection, as a line for a person.

    Parameters
    ----------
    study
        Of `recovery_study`.

    Returns
    -------
    str
        The verdict, χ² per degree of freedom, and the causes.

    Examples
    --------
    >>> from hrg_cli.studies.recovery import assemble, describe_background
    >>> background = {"verdict": "partly explained", "after": {"chi2_per_dof": 329.0}}
    >>> background["effects"] = [{"name": "cubic_stiffness"}]
    >>> describe_background(assemble([], [5.0], background))
    'background: partly explained, χ² 329: cubic stiffness'
    """
    found = study["background"]
    named = ", ".join(found["named"]).replace("_", " ") or "no cause"
    misfit = found["chi2_per_dof"]
    left = "" if misfit is None else f", χ² {misfit:.3g}"
    return f"background: {found['verdict']}{left}: {named}"


def _effect_figures(rows: Sequence[Row], sizes: Sequence[float]) -> dict[str, Any]:
    """Of one effect (or all), by size: shares named first, among others, with a false name beside;
    the size found over the true one.

    A share is [share, low, high, tries] with its 95 % interval. `not_shown`: why these recordings
    cannot show it, else None.
    """
    tried = [r for r in rows if r["size"] is not None]
    by_size = {}
    for size in sizes:
        at = [r for r in tried if r["size"] == size]
        if at:
            by_size[f"{size:g}"] = {
                key: compute_share(sum(bool(r[key]) for r in at), len(at))
                for key in ("first", "among", "false")
            }
    ratios = [ratio for r in tried if r["among"] for ratio in r["found_over_true"].values()]
    return {
        "by_size": by_size,
        "found_over_true": float(np.median(ratios)) if ratios else None,
        **compute_coverage([e for r in tried if r["among"] for e in r["error_over_std"].values()]),
        "not_shown": (
            next((r["not_shown"] for r in rows if r["size"] is None), None) if not tried else None
        ),
    }


def _hide(recording: Recording, number: int, effect: Effect, values: dict[str, float]) -> Recording:
    """A recording with the effect in it; the same one where it does nothing, as what happens in one
    run does to the others."""
    if effect.of_one_run:
        if values[RUN] != number:
            return recording
        values = {name: value for name, value in values.items() if name != RUN}
    try:
        return collect(inject(recording, effects={effect.name: values}))
    except UnchangedError:
        return recording


def _make_wave(recording: Recording, periods_per_window: float) -> Wave:
    return collect(estimate(collect(demodulate(recording, periods_per_window=periods_per_window))))


def _need_diagnosed(background: Row) -> Row:
    """The background's report. HrgError: it was refused, as would be all that is hidden in it."""
    if background.get("refused"):
        raise HrgError(
            "these recordings give no diagnosis as they are, and nothing hidden in them could be"
            f" found: {background['refused']}"
        )
    return background


def _diagnosed(waves: Sequence[Wave], scale_factor: float | None) -> Row:
    """The diagnosis's report; a refusal is one, too."""
    try:
        found = diagnose(waves, scale_factor=scale_factor)
    except (HrgError, ArithmeticError, np.linalg.LinAlgError) as error:
        # of data that an injection spoilt beyond any model: no name is given, and that is what the
        # study counts
        return {
            "verdict": "refused",
            "refused": str(error),
            "effects": [],
            "after": {"chi2_per_dof": None},
        }
    report = summarise(found)
    why = "; ".join(found.status_reasons) if found.status == "refused" else None
    return {key: report[key] for key in ("verdict", "effects", "after")} | {"refused": why}


def tabulate(study: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The study as a table for a person.

    Parameters
    ----------
    study
        Of `recovery_study`.

    Returns
    -------
    tuple
        Headings, and a row an effect: shares named first, among others and with a false name, size
        found over true, error over σ.

    Examples
    --------
    >>> from hrg_cli.studies.recovery import assemble, tabulate
    >>> row = dict(effect="gain_mismatch", draw=0, size=5.0, first=True, among=True, false=[])
    >>> row |= dict(refused=None, found_over_true={"gain": 1.1}, error_over_std={"gain": 1.0})
    >>> background = {"verdict": "adequate", "effects": [], "after": {"chi2_per_dof": 1.0}}
    >>> head, rows = tabulate(assemble([row], [5.0], background))
    >>> dict(zip(head, rows[0]))["found/true"], dict(zip(head, rows[0]))["first at 5 σ"]
    ('1.1', '1.00')
    """
    sizes = [f"{s:g}" for s in study["sizes"]]
    heads = [
        "effect",
        *(f"{what} at {s} σ" for s in sizes for what in ("first", "among", "false")),
        "found/true",
        "error/σ",
        "not shown",
    ]

    def row(name: str, figures: dict[str, Any]) -> tuple[Any, ...]:
        cells: list[Any] = []
        for s in sizes:
            at = figures["by_size"].get(s)
            cells += [
                "" if at is None else f"{at[key][0]:.2f}" for key in ("first", "among", "false")
            ]
        numbers = [
            "" if figures[key] is None else f"{figures[key]:.3g}"
            for key in ("found_over_true", "error_rms")
        ]
        return (name, *cells, *numbers, figures["not_shown"] or "")

    return tuple(heads), [
        *(row(name, figures) for name, figures in study["effects"].items()),
        row("all", study["all"]),
    ]


def draw_figure(study: dict[str, Any]) -> Figure:
    """Shares named first and with a false name of every effect by size, and the size found over the
    true one.

    Parameters
    ----------
    study
        Of `recovery_study`.

    Returns
    -------
    matplotlib.figure.Figure
        Three panels.

    Examples
    --------
    >>> from hrg_cli.studies.recovery import assemble, draw_figure
    >>> row = dict(effect="gain_mismatch", draw=0, size=5.0, first=True, among=True, false=[])
    >>> row |= dict(refused=None, found_over_true={"gain": 1.1}, error_over_std={"gain": 1.0})
    >>> background = {"verdict": "adequate", "effects": [], "after": {"chi2_per_dof": 1.0}}
    >>> len(draw_figure(assemble([row], [5.0], background)).axes)
    3
    """
    from matplotlib.figure import Figure

    names = [name for name, figures in study["effects"].items() if figures["by_size"]]
    sizes = [f"{s:g}" for s in study["sizes"]]
    drawing = Figure(figsize=(13, 2.5 + 0.27 * max(4, len(names))), layout="constrained")
    first, false, ratio = drawing.subplots(1, 3, width_ratios=(1, 1, 1.2))
    for axes, key, title, colours in (
        (first, "first", "named first", "Greens"),
        (false, "false", "a false name beside", "Reds"),
    ):
        shares = np.full((len(names), len(sizes)), np.nan)
        for k, name in enumerate(names):
            for j, s in enumerate(sizes):
                if s in study["effects"][name]["by_size"]:
                    shares[k, j] = study["effects"][name]["by_size"][s][key][0]
                    axes.text(j, k, f"{shares[k, j]:.2g}", ha="center", va="center", fontsize=8)
        if names:
            axes.imshow(shares, cmap=colours, vmin=0, vmax=1.6, aspect="auto")
        axes.set_xticks(range(len(sizes)), sizes)
        axes.set_yticks(range(len(names)), names if key == "first" else [])
        axes.set(title=title, xlabel="size, σ of an ideal detector")
    places = {name: k for k, name in enumerate(names)}
    for row in study["rows"]:
        if row["size"] is not None and row["effect"] in places:
            found = list(row["found_over_true"].values())
            ratio.plot(
                found,
                [places[row["effect"]]] * len(found),
                "o",
                color="C0",
                alpha=0.6,
                markersize=4,
            )
    ratio.axvline(1.0, color="0.6")
    ratio.set(
        ylim=(len(names) - 0.5, -0.5), xlim=(-0.5, 2.5), title="size found over true", yticks=[]
    )
    drawing.suptitle(describe_background(study))
    return drawing
