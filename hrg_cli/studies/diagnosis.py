"""How well diagnosis names causes: the chance of naming each effect against its size, and what it
is taken for when it errs.

Every effect is hidden on random devices in a programme that can show it (`hidden`), data from the
fast engine through the raw samples. The yardstick is the ideal detector of Neyman and Pearson: it
knows the one effect it looks for and its direction, so that it sees a size z with the chance Φ(z −
z_α) at a false-alarm rate α, that of diagnosis's whole search. Where diagnosis names half, over
where the ideal detector sees half, is what the search costs: that nobody says beforehand which of
all the causes it is.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from ..effects import EFFECTS, find
from ..errors import UsageError
from ..executors import run_tasks, start_processes
from ..stages.diagnose import diagnose, summarise
from ..stages.diagnosis.thresholds import SIGNIFICANT
from .hidden import Hiding, draw_programme, hide, list_effects_beside, make_waves
from .power import compute_coverage, compute_ideal, compute_share, fit_curve

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
LARGEST_GROUP = 3
"""Names that a group may have in which the effect counts as named."""
KINDS = {
    "plain": "ageing",
    "forced": "drive_rotation",
    "forced with loop": "quadrature_drive_phase_error",
    "cycles": "thermal_gradient",
    "steps": "centrifugal_stiffness",
}
"""Kinds of programmes, each by an effect that needs it."""
NOTHING, DESCRIBED = "nothing", "described"
SURE = 0.99
"""Chance of the ideal detector from which a size counts in the confusion matrix."""


def diagnosis_study(
    *,
    effects: Annotated[
        list[str], Field(description="effects to hide; none: every one of the catalogue")
    ] = [],  # noqa: B006
    sizes: Annotated[
        list[float], Field(min_length=1, description="sizes, in σ of an ideal detector")
    ] = [4.0, 6.0, 10.0],  # noqa: B006
    draws: Annotated[int, Field(ge=1, description="random devices an effect")] = 2,
    controls: Annotated[
        int, Field(ge=0, description="clean programmes of each kind for the false alarms")
    ] = 4,
    noise: Annotated[
        float, Field(gt=0, le=0.1, description="noise of a sample, full amplitude 1")
    ] = 3e-4,
    seed: Annotated[int, Field(ge=0, description="seed of devices and noise")] = 0,
    jobs: Annotated[int, Field(ge=1, description="processes")] = 1,
) -> dict[str, Any]:
    """The power of diagnosis: how often effects that were hidden in simulated samples are named.

    Parameters
    ----------
    effects
        That are hidden; empty: every one of the catalogue.
    sizes
        In σ of an ideal detector.
    draws
        Random devices an effect.
    controls
        Clean programmes of each kind, for the false alarms.
    noise
        Of a sample; the full amplitude is 1.
    seed
        Of devices and noise.
    jobs
        Processes.

    Returns
    -------
    dict
        Sizes, ideal, effects (name -> figures, see `_effect_figures`), all, confusion and controls.

    Raises
    ------
    UsageError
        A size that is not above 0, or an unknown effect.

    Examples
    --------
    >>> from hrg_cli.studies.diagnosis import diagnosis_study
    >>> diagnosis_study(sizes=[0.0])
    Traceback (most recent call last):
    ...
    hrg_cli.errors.UsageError: sizes holds 0; a size is above 0 σ
    """
    names = effects or [e.name for e in EFFECTS]
    for name in names:
        find(name)
    if min(sizes) <= 0:
        raise UsageError(f"sizes holds {min(sizes):g}; a size is above 0 σ")
    tasks: list[tuple[Any, ...]] = [
        ("hidden", name, draw, tuple(sizes), noise, seed) for draw in range(draws) for name in names
    ]
    tasks += [("clean", kind, draw, (), noise, seed) for draw in range(controls) for kind in KINDS]
    found = run_tasks(_draw_of, tasks, lambda: start_processes(jobs))
    return assemble([row for rows in found if rows is not None for row in rows], list(sizes))


def _draw_of(task: tuple[str, str, int, tuple[float, ...], float, int]) -> list[dict[str, Any]]:
    """One device: what diagnosis says of it at every size, or of its clean programme."""
    sort, name, draw, sizes, noise, seed = task
    random = np.random.default_rng([seed, draw, zlib.crc32(name.encode())])
    first = int(random.integers(2**31))
    if sort == "clean":
        shown = KINDS[name]
        report = summarise(diagnose(make_waves(draw_programme(random, shown, noise), first, shown)))
        named = [e["name"] for e in report["effects"]]
        return [{"clean": name, "named": named, "verdict": report["verdict"]}]
    hidden = hide(name, random, noise)
    rows = []
    for k, size in enumerate((1.0,) if find(name).whole_samples else sizes):
        report = summarise(
            diagnose(hidden.measure(size, first + k), scale_factor=hidden.scale_factor)
        )
        rows.append(
            {"hidden": name, "draw": draw, "size": size, **_judge_report(report, hidden, size)}
        )
    return rows


def _judge_report(report: dict[str, Any], hidden: Hiding, size: float) -> dict[str, Any]:
    """The group named first, the outcome, (found − true)/σ of the parameters, whether the upper
    limit holds the truth.

    outcome: "named" (in a group of at most three), "wrong" (another cause), "described" (an open
    term) or "nothing".
    """
    name, true = hidden.effect.name, hidden.choose_values(size)
    # about the runs' own temperature a bend is a slope besides
    others = {*list_effects_beside(hidden.effect), hidden.effect.bends}
    entries = [e for e in report["effects"] if e["name"] not in others]
    group = [entries[0]["name"], *entries[0]["indistinguishable_from"]] if entries else []
    if group:
        outcome = "named" if name in group and len(group) <= LARGEST_GROUP else "wrong"
    else:
        outcome = NOTHING if report["verdict"] in ("adequate", "explained") else DESCRIBED
    errors = {}
    own = next((e for e in entries if e["name"] == name), None)
    if own is not None:
        fitted = {p.name for p in hidden.effect.fitted()}
        parts = {k: v for k, v in own["parameters"].items() if k in fitted and v["std"]}
        sign = 1.0
        # half a period later the same knock has the other sign
        if hidden.effect.coherent or hidden.effect.slow_jump is not None:
            sign = float(
                np.sign(sum(v["value"] * true[k] / v["std"] ** 2 for k, v in parts.items())) or 1.0
            )
        errors = {k: (sign * v["value"] - true[k]) / v["std"] for k, v in parts.items()}
    row = next((t for t in report["tested"] if t["name"] == name), None)
    held = None
    if row is not None and row["upper_limit"] is not None:
        of_that_unit = [
            abs(true[p.name] - p.neutral) for p in hidden.effect.fitted() if p.units == row["units"]
        ]
        held = max(of_that_unit, default=0.0) <= row["upper_limit"]
    return {"group": group, "outcome": outcome, "errors": errors, "limit_holds": held}


def assemble(rows: Sequence[dict[str, Any]], sizes: list[float]) -> dict[str, Any]:
    """The figures of the study, from what each draw says.

    Parameters
    ----------
    rows
        A row a device and size, and a row a clean programme.
    sizes
        In σ of an ideal detector.

    Returns
    -------
    dict
        Sizes, ideal, effects, all, confusion and controls.

    Examples
    --------
    A cause that was hidden once and named:

    >>> from hrg_cli.studies.diagnosis import assemble
    >>> row = dict(group=["gain_mismatch"], outcome="named", errors={}, limit_holds=None, draw=0)
    >>> found = assemble([dict(hidden="gain_mismatch", size=6.0, **row)], [6.0])
    >>> found["effects"]["gain_mismatch"]["named"]["6"][0]
    1.0
    """
    hidden = [r for r in rows if "hidden" in r]
    clean = [r for r in rows if "clean" in r]
    names = [e.name for e in EFFECTS if any(r["hidden"] == e.name for r in hidden)]
    own = {name: [r for r in hidden if r["hidden"] == name] for name in names}
    scaled = [r for r in hidden if not find(r["hidden"]).whole_samples]
    wrong = sum(bool(r["named"]) for r in clean)
    return {
        "sizes": sizes,
        "false_alarm_rate": SIGNIFICANT,
        "ideal": compute_ideal(sizes, SIGNIFICANT),
        "effects": {
            name: _effect_figures(own[name], sizes) | {"programme": _programme_of(name)}
            for name in names
        },
        "all": _effect_figures(scaled, sizes),
        "confusion": _confusion(own, sizes),
        "controls": {
            "alarms": compute_share(sum(r["verdict"] != "adequate" for r in clean), len(clean)),
            "causes_named": compute_share(wrong, len(clean)),
            "alarmed": [r for r in clean if r["verdict"] != "adequate"],
        },
    }


def _effect_figures(rows: Sequence[dict[str, Any]], sizes: Sequence[float]) -> dict[str, Any]:
    """Of one effect (or all): chance of naming by size with its 95 % interval, size at which half
    and 90 % are named, what goes wrong.

    `cost`: half-size over the ideal detector's; `error_rms` and `within_1_96` of (found − true)/σ;
    `limits_hold`: share of all draws in which the effect was named or lies below its 95 % upper
    limit.
    """

    def chance(at: Sequence[dict[str, Any]]) -> list[float | None]:
        return compute_share(sum(r["outcome"] == "named" for r in at), len(at))

    named = {f"{s:g}": chance(at) for s in sizes if (at := [r for r in rows if r["size"] == s])}
    fitted = fit_curve([(r["size"], r["outcome"] == "named") for r in rows])
    if not named:  # no size but its own
        named, fitted = {"any": chance(rows)}, dict.fromkeys(fitted)
    limits = [r["limit_holds"] is not False for r in rows if r["outcome"] != "wrong"]
    return {
        "named": named,
        **fitted,
        "cost": None
        if fitted["half"] is None
        else fitted["half"] / compute_ideal([], SIGNIFICANT)["half"],
        "wrong": compute_share(sum(r["outcome"] == "wrong" for r in rows), len(rows)),
        "described": compute_share(sum(r["outcome"] == DESCRIBED for r in rows), len(rows)),
        **compute_coverage([e for r in rows for e in r["errors"].values()]),
        "limits_hold": compute_share(sum(limits), len(limits)),
    }


def _programme_of(name: str) -> str:
    """What the effect needs to be seen, in words."""
    effect = find(name)
    needs = {
        "every other run forced": "drive" in effect.shown_by,
        "temperature in cycles": "temperature cycle" in effect.shown_by,
        "rate in steps": "rate steps" in effect.shown_by,
        "scale factor known": "known scale factor" in effect.shown_by,
        "one sample lost": effect.whole_samples,
        f"beside {effect.beside}": bool(effect.beside),
    }
    return ", ".join(words for words, needed in needs.items() if needed) or "free runs"


def _confusion(
    own: dict[str, list[dict[str, Any]]], sizes: Sequence[float]
) -> dict[str, dict[str, float]]:
    """{hidden: {named: share}} at the sizes that an ideal detector is sure of; a group shares its
    count."""
    seen = [s for s in sizes if compute_ideal([s], SIGNIFICANT)["chance"][f"{s:g}"] >= SURE] or [
        max(sizes)
    ]
    out: dict[str, dict[str, float]] = {}
    for name, rows in own.items():
        at = [r for r in rows if r["size"] in seen or find(name).whole_samples]
        out[name] = {}
        for row in at:
            for one in row["group"] or [row["outcome"]]:
                out[name][one] = out[name].get(one, 0.0) + 1 / (len(at) * max(1, len(row["group"])))
    return out


def tabulate(study: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The study as a table for a person.

    Parameters
    ----------
    study
        Of `diagnosis_study`.

    Returns
    -------
    tuple
        Headings, and a row an effect.

    Examples
    --------
    >>> from hrg_cli.studies.diagnosis import assemble, tabulate
    >>> row = dict(group=["gain_mismatch"], outcome="named", errors={}, limit_holds=None, draw=0)
    >>> head, rows = tabulate(assemble([dict(hidden="gain_mismatch", size=6.0, **row)], [6.0]))
    >>> rows[0][0], len(rows[0]) == len(head)
    ('gain_mismatch', True)
    """
    sizes = [f"{s:g}" for s in study["sizes"]]

    def row(name: str, f: dict[str, Any]) -> tuple[Any, ...]:
        chance = [f"{f['named'][s][0]:.2f}" if s in f["named"] else "" for s in sizes]
        if "any" in f["named"]:
            chance[-1] = f"{f['named']['any'][0]:.2f}"
        number = [("" if f[k] is None else f"{f[k]:.1f}") for k in ("half", "ninety", "cost")]
        rms = "" if f["error_rms"] is None else f"{f['error_rms']:.2f}"
        return (name, *chance, *number, f"{f['wrong'][0]:.2f}", rms)

    rows = [row(name, figures) for name, figures in study["effects"].items()]
    best = study["ideal"]
    last = (
        "ideal detector",
        *(f"{best['chance'][s]:.2f}" for s in sizes),
        f"{best['half']:.1f}",
        f"{best['ninety']:.1f}",
        "1.0",
        "",
        "",
    )
    heads = ("named at size/σ", *sizes, "half at", "90 % at", "cost", "wrong", "error/σ")
    return heads, [*rows, row("all", study["all"]), last]


def draw_figure(study: dict[str, Any]) -> Figure:
    """The study as pictures.

    Parameters
    ----------
    study
        Of `diagnosis_study`.

    Returns
    -------
    matplotlib.figure.Figure
        As `power.draw_figure` draws it.

    Examples
    --------
    >>> from hrg_cli.studies.diagnosis import assemble, draw_figure
    >>> nothing = dict(group=[], outcome="nothing", errors={}, limit_holds=None, draw=0)
    >>> rows = [dict(hidden="gain_mismatch", size=size, **nothing) for size in (3.0, 6.0)]
    >>> len(draw_figure(assemble(rows, [3.0, 6.0])).axes) >= 3
    True
    """
    from .power import draw_figure as drawn

    return drawn(study)
