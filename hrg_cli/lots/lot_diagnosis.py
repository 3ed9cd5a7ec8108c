"""What a lot says as a whole: causes that its gyros, or those of a station or since a day, have in
common; parameters that stand off in a group; the population of everything measured. As JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..effects import EFFECTS
from ..reporting.answer_words import say_in_words
from ..reporting.quantities import LABELS, RATE_OF_DECAY, choose_unit
from ..reporting.text import clean_text, format_number
from .common_causes import CommonCause, find_common_causes, gather_estimates
from .groups import Group, Origin
from .lot_table import NO_ORDER
from .shifts import Population, Shift, estimate_populations, find_shifts

Gyro = Mapping[str, Any]


def diagnose_lot(
    gyros: Sequence[Gyro],
    figures: Sequence[Mapping[str, tuple[float, float]]],
    origins: Mapping[str, Origin],
    rate: float,
) -> dict[str, Any]:
    """What a lot says as a whole: causes in common, parameters that stand off, populations.

    Parameters
    ----------
    gyros
        Of each its `gyro_id` and `results`, stage -> JSON.
    figures
        Of each (value, σ) by name.
    origins
        Of the gyros by name, where something is known of where they come from.
    rate
        Chance that a lot whose gyros have nothing in common is told that they have: half of it for
        causes, half for parameters.

    Returns
    -------
    dict
        `lot_causes`, `lot_tests` and `populations` of the lot's report.

    Examples
    --------
    Ten gyros alike but for 0.1 % of their scale factor:

    >>> import numpy as np
    >>> from hrg_cli.lots.lot_diagnosis import diagnose_lot
    >>> K = 0.55 + 5e-4 * np.random.default_rng(1).standard_normal(10)
    >>> gyros = [{"gyro_id": f"SN-{k}", "results": {}} for k in range(10)]
    >>> found = diagnose_lot(gyros, [{"scale_factor": (k, 1e-5)} for k in K], {}, 0.02)
    >>> found["lot_causes"], found["populations"]["scale_factor"]["gyros"]
    ([], 10)
    >>> bool(3e-4 < found["populations"]["scale_factor"]["spread"] < 9e-4)
    True
    """
    own = [origins.get(gyro["gyro_id"], Origin({})) for gyro in gyros]
    names = [str(gyro["gyro_id"]) for gyro in gyros]
    scores = [_scores(gyro) for gyro in gyros]
    found = find_common_causes(scores, own, rate / 2)
    ordered = [{k: v for k, v in one.items() if k not in NO_ORDER} for one in figures]
    moved, tested = find_shifts(ordered, own, rate / 2)
    return {
        "lot_causes": [
            *(_cause(one, names, gyros, own) for one in found.causes),
            *(_shift(one, names) for one in moved),
        ],
        "lot_tests": {
            "pairs": found.tested + tested,
            "rate": rate,
            "groups": found.groups,
            "gyros_diagnosed": sum(one is not None for one in scores),
        },
        "populations": {
            **{one.name: _population(one) for one in estimate_populations(ordered)},
            **_pool_causes(scores),
        },
    }


def _scores(gyro: Gyro) -> Mapping[str, Any] | None:
    """A diagnosis's scores; None where there are none, or it was refused."""
    diagnosed = gyro.get("results", {}).get("diagnose") or {}
    return diagnosed.get("scores") if diagnosed.get("status") != "refused" else None


def _cause(
    one: CommonCause, names: Sequence[str], gyros: Sequence[Gyro], own: Sequence[Origin]
) -> dict[str, Any]:
    """A common cause; which of the gyros' own diagnoses name it says how far it was known."""
    effect, _, parameter = one.name.partition(".")
    named = [
        names[k]
        for k in one.group.members
        if any(
            e.get("name") == effect
            for e in gyros[k].get("results", {}).get("diagnose", {}).get("effects") or []
        )
    ]
    alone = [names[k] for k in one.alone]
    inside = set(one.group.members)
    others = [e for e in one.estimates if e[0] not in inside]
    sentence = (
        f"{one.group.describe()}: {say_in_words(effect)}"
        f" {size_cause(parameter, one.value, one.std, one.units)}"
    )
    return {
        "kind": "cause",
        "name": effect,
        "parameter": parameter,
        "sentence": clean_text(sentence),
        **_group(one.group, names),
        "value": one.value,
        "std": one.std,
        "spread": one.spread,
        "units": one.units,
        "z": one.z,
        "p_value": one.p_value,
        "gyros": one.gyros,
        "named_alone_by": named,
        "individual": alone,
        "indistinguishable_from": [name.partition(".")[0] for name in one.rivals],
        "others": _mean(others),
        "estimates": [
            {
                "gyro_id": names[k],
                "value": x,
                "std": std,
                "in_group": k in inside,
                "day": own[k].day,
            }
            for k, x, std in one.estimates
        ],
    }


def _shift(one: Shift, names: Sequence[str]) -> dict[str, Any]:
    """A parameter that stands off in a group."""
    units = _units(one.name)
    words = (
        RATE_OF_DECAY
        if one.name == "damping_rate_1_s"
        else LABELS.get(one.name, say_in_words(one.name))
    )
    sign = "higher" if one.value > 0 else "lower"
    size = size_cause(one.name, abs(one.value), one.std, units)
    sentence = f"{one.group.describe()}: {words} {sign} by {size} than the others'"
    return {
        "kind": "parameter",
        "name": one.name,
        "parameter": one.name,
        "sentence": clean_text(sentence),
        **_group(one.group, names),
        "value": one.value,
        "std": one.std,
        "spread": one.spread,
        "units": units,
        "z": one.z,
        "p_value": one.p_value,
        "gyros": one.gyros,
        "named_alone_by": [],
        "individual": [],
        "indistinguishable_from": [e.name for e in EFFECTS if e.same_as_parameter == one.name],
        "others": None,
        "estimates": [],
    }


def _group(group: Group, names: Sequence[str]) -> dict[str, Any]:
    return {
        "group": {"by": group.by, "value": group.value} if group.by else None,
        "also": list(group.also),
        "since": group.since or None,
        "until": group.until or None,
        "members": [names[k] for k in group.members],
    }


def _mean(estimates: Sequence[tuple[int, float, float]]) -> dict[str, float] | None:
    """The weighted mean of the gyros outside the group, which tells whether they have it, too."""
    if not estimates:
        return None
    x, std = np.array([e[1:] for e in estimates]).T
    w = 1 / std**2
    return {"value": float(w @ x / w.sum()), "std": float(w.sum() ** -0.5)}


def size_cause(name: str, value: float, std: float, units: str) -> str:
    """A size with its σ as people read it.

    Parameters
    ----------
    name
        Of the parameter, by which the unit that is shown is chosen.
    value, std
        In `units`.
    units
        As files have them.

    Returns
    -------
    str
        Both to the second digit of σ, with the unit; the value alone where σ is not known.

    Examples
    --------
    >>> from hrg_cli.lots.lot_diagnosis import size_cause
    >>> size_cause("gain", 5e-4, 1e-4, "1")
    '500 ± 100 ppm'
    """
    factor, unit = choose_unit(name, value, units)
    if not (math.isfinite(std) and std > 0):
        return f"{format_number(value * factor, 4)} {unit}".strip()
    last = math.floor(math.log10(std * abs(factor))) - 1
    if abs(last) > 6:
        text = f"{format_number(value * factor, 3)} ± {format_number(std * abs(factor), 2)}"
    else:
        shown = [round(v, -last) for v in (value * factor, std * abs(factor))]
        text = " ± ".join(f"{v:.{max(0, -last)}f}" for v in shown)
    return f"{text} {unit}".strip().replace("-", "−")


def _population(one: Population) -> dict[str, Any]:
    return {
        "mean": one.mean,
        "mean_std": one.mean_std,
        "spread": one.spread,
        "spread_std": one.spread_std,
        "measured_std": one.measured_std,
        "gyros": one.gyros,
        "units": _units(one.name),
    }


def _units(name: str) -> str:
    from ..limit_values import find_unit

    if name == "frequency_split_rad_s":
        return "rad s-1"
    return find_unit(name) if not name.endswith("_1_s") else "s-1"


def _pool_causes(scores: Sequence[Mapping[str, Any] | None]) -> dict[str, Any]:
    """The population of every cause's size, by "effect.parameter"."""
    estimates = gather_estimates(scores)
    if not estimates.names:
        return {}
    pairs = zip(estimates.value, estimates.std, strict=True)
    measured = [
        {
            name: (float(x), float(s))
            for name, x, s in zip(estimates.names, *row, strict=True)
            if math.isfinite(x) and math.isfinite(s)
        }
        for row in pairs
    ]
    return {
        one.name: _population(one) | {"units": estimates.units[one.name]}
        for one in estimate_populations(measured)
    }
