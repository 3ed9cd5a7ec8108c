"""What a plan is to tell apart: causes that a diagnosis left open or a user names, and what no run
can tell."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...effects import EFFECTS
from ...errors import HrgError
from ...records import Diagnosis, Resonator, Wave
from .information import InformationColumns

Array = np.ndarray


BASE = "the base model"
INHERENT = {e.name: f"{e.same_as_base}; {e.next_experiment}" for e in EFFECTS if e.same_as_base}
"""What no run of any menu can tell from the base model, and what else would."""


@dataclass(frozen=True)
class Question:
    """A cause, what it is to be told from (a cause or the base model), and the sizes of both in
    columns' units."""

    cause: str
    rival: str
    size: Array
    rival_size: Array | None = None


def list_open_causes(
    known: Resonator | Diagnosis, causes: Sequence[str]
) -> tuple[dict[str, dict[str, float]], list[list[str]]]:
    """Sizes of causes, and the groups that are to be told apart.

    Open are the causes found that have rivals and those named by the user, or, where none is named,
    those that the diagnosis's runs could not show; where there is none of these, the causes found
    are to be seen better.

    Parameters
    ----------
    known
        Resonator or diagnosis.
    causes
        That the user names.

    Returns
    -------
    tuple
        Name -> its parameters' sizes (empty: not found, of a typical size), and groups [cause,
        rivals…].

    Raises
    ------
    HrgError
        There is no effect of that name.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.planning.questions import list_open_causes
    >>> list_open_causes(Told(), ["gain_mismatch", "cubic_stiffness"])[1]
    [['gain_mismatch', 'cubic_stiffness'], ['cubic_stiffness', 'gain_mismatch']]
    >>> list_open_causes(Told(), ["dust"])
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: there is no effect dust; `hrg effects` lists them
    """
    names = {effect.name for effect in EFFECTS}
    unknown = [name for name in causes if name not in names]
    if unknown:
        raise HrgError(f"there is no effect {unknown[0]}; `hrg effects` lists them")
    sizes: dict[str, dict[str, float]] = {name: {} for name in causes}
    groups = [[a, *(b for b in causes if b != a)] for a in causes]
    if isinstance(known, Diagnosis):
        report = known.read_report()
        settled: list[list[str]] = []
        for found in known.told("effects"):
            if found["name"] in names:
                sizes[found["name"]] = {
                    key: float(p["value"])
                    for key, p in (found.get("parameters", {}) | found.get("held", {})).items()
                }
                rivals = [r for r in found.get("indistinguishable_from", ()) if r in names]
                (groups if rivals else settled).append([found["name"], *rivals])
        for group in _unseen(report) if not causes else ():
            sizes |= {name: {} for name in group if name not in sizes}
            groups.append(group)
        groups = groups or settled
    return sizes, groups


def _unseen(report: Mapping[str, Any]) -> list[list[str]]:
    """Causes that the diagnosis's runs could not tell from the model, though others can, each with
    those that do the same in them."""
    names = (
        {effect.name for effect in EFFECTS}
        - set(INHERENT)
        - {found["name"] for found in report["effects"]}
    )
    entries = report.get("not_separable", [])
    hidden = [name for group in entries if group.get("base") for name in group["effects"]]
    alike = [group["effects"] for group in entries if not group.get("base")]
    out = []
    for name in dict.fromkeys(hidden):
        if name in names:
            out.append(
                [
                    name,
                    *dict.fromkeys(
                        other
                        for group in alike
                        if name in group
                        for other in group
                        if other != name and other in names
                    ),
                ]
            )
    return out


def list_never_told(known: Resonator | Diagnosis) -> list[str]:
    """What a diagnosis left open and no run of any menu can tell.

    Parameters
    ----------
    known
        Resonator or diagnosis.

    Returns
    -------
    list of str
        A sentence a cause, with what else would tell it; empty of a resonator.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.planning.questions import list_never_told
    >>> list_never_told(Told(kind="resonator"))
    []
    """
    if not isinstance(known, Diagnosis):
        return []
    told = {name for group in known.told("not_separable") for name in group["effects"]}
    return [
        f"no run can tell {say_in_words(name)} from {same}"
        for name, same in INHERENT.items()
        if name in told
    ]


def list_questions(
    sizes: Mapping[str, Mapping[str, float]],
    groups: Sequence[Sequence[str]],
    layout: InformationColumns,
    waves: Sequence[Wave],
) -> list[Question]:
    """The questions of groups of causes: each against the base model and against its rivals.

    Parameters
    ----------
    sizes
        Name -> its parameters' sizes.
    groups
        [cause, rivals…].
    layout
        Which causes there are.
    waves
        At whose amplitude a size that is not known is the typical one.

    Returns
    -------
    list of Question
        No pair of them twice.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.planning.information import InformationColumns
    >>> from hrg_cli.stages.planning.questions import list_questions
    >>> names = ["gain_mismatch", "electrode_nonorthogonality"]
    >>> layout = InformationColumns(tuple(map(find, names)), {})
    >>> waves = [Told(main_amplitude=np.ones(9))]
    >>> [(q.cause, q.rival) for q in list_questions({}, [names], layout, waves)][1]
    ('gain_mismatch', 'electrode_nonorthogonality')
    """
    amplitude = float(np.median([np.sqrt(np.mean(w.main_amplitude**2)) for w in waves]))
    effects = {effect.name: effect for effect in layout.causes}

    def size(name: str) -> Array:
        given = sizes.get(name, {})
        return np.array(
            [
                given.get(p.name, p.typical * amplitude**p.amplitude_power)
                for p in effects[name].fitted()
            ]
        )

    out: list[Question] = []
    for cause, *rivals in groups:
        for rival in [BASE, *rivals]:
            if not any({q.cause, q.rival} == {cause, rival} for q in out):
                out.append(
                    Question(cause, rival, size(cause), None if rival == BASE else size(rival))
                )
    return out


def say_in_words(name: str) -> str:
    """A cause or a parameter without the marks of a key and its unit.

    Parameters
    ----------
    name
        Key of the cause, or of the parameter.

    Returns
    -------
    str
        Words.

    Examples
    --------
    >>> from hrg_cli.stages.planning.questions import say_in_words
    >>> say_in_words("damping_rate_1_s"), say_in_words("gain_mismatch")
    ('damping rate', 'gain mismatch')
    """
    unit = next((end for end in ("_1_s", "_rad_s", "_rad", "_hz") if name.endswith(end)), "")
    return name.removesuffix(unit).replace("_", " ")
