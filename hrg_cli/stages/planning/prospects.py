"""What is known before the next runs, what each run of a menu would add, and what is to be told
apart: three matrices and lists over the same columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...effects import find
from ...physics.resonator import Mechanics
from ...records import Diagnosis, Resonator, Wave
from ..simulation_file import SimulationFile
from .information import InformationColumns, compute_information, make_wave
from .known import find_reference_temperatures, make_mechanics, make_weak_prior, read_information
from .questions import BASE, Question, list_open_causes, list_questions, say_in_words
from .worth import TOLD, compute_separation, compute_std

Array = np.ndarray


@dataclass(frozen=True)
class Prospects:
    """Informations (columns, columns) about the resonator and the causes of `layout`: that had
    before, and that of every run offered."""

    mechanics: Mechanics
    layout: InformationColumns
    had: Array
    offered: Mapping[str, Array]
    questions: Sequence[Question]

    def sum_information(self, names: Sequence[str]) -> Array:
        """Information after the runs of these names."""
        return np.asarray(self.had + sum(self.offered[name] for name in names))

    def sum_all_information(self) -> Array:
        """Information after all runs of the menu."""
        return self.sum_information(list(self.offered))

    def list_answerable(self) -> list[Question]:
        """Questions that all runs of the menu together answer."""
        whole = self.sum_all_information()
        return [q for q in self.questions if compute_separation(whole, q, self.layout) >= TOLD]


def weigh_menu(
    known: Resonator | Diagnosis,
    made: Sequence[Wave],
    feasible: Mapping[str, SimulationFile],
    causes: Sequence[str],
) -> Prospects:
    """What is known before, what each run of a menu would add, and what is to be told apart.

    Parameters
    ----------
    known
        Resonator or diagnosis.
    made
        Waves of the runs made, where they are at hand: they know what the result's covariance has
        forgotten.
    feasible
        Name -> run of the menu.
    causes
        That the user names.

    Returns
    -------
    Prospects
        Over the same columns.

    Examples
    --------
    A run that turns tells the scale factor, one at rest does not:

    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.planning.prospects import weigh_menu
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> names, std = ("frequency_hz", "damping_rate_1_s"), np.array([1e-3, 1e-4])
    >>> known = Resonator(
    ...     name=np.array(names), units=np.array(["Hz", "s-1"]), value=np.array([5e3, 0.1]),
    ...     std=std, covariance=np.diag(std**2),
    ... )
    >>> runs = [{"run_id": "still"}, {"run_id": "turning", "environment": {"rate_rad_s": 1.0}}]
    >>> menu = {
    ...     "device": {"frequency_hz": 5000.0, "damping_rate_1_s": 0.1},
    ...     "run": runs,
    ...     "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ...     "readout": {"noise": 1e-3},
    ... }
    >>> feasible = {run.run_id: run for run in list_runs(menu)}
    >>> offered = weigh_menu(known, [], feasible, []).offered
    >>> bool(offered["turning"][5, 5] > 1e6 * offered["still"][5, 5])
    True
    """
    mechanics = make_mechanics(known)
    sizes, groups = list_open_causes(known, causes)
    acting = _acting_causes(sizes, groups)
    rivals = (rival for group in groups for rival in group)
    effects = tuple(find(name) for name in dict.fromkeys([*sizes, *acting, *rivals]))
    layout = InformationColumns(effects, acting)
    waves = {name: make_wave(run) for name, run in feasible.items()}
    references = find_reference_temperatures([*made, *waves.values()], effects)
    added = compute_information(list(waves.values()), mechanics, layout, references, False)
    # the runs made, where they are at hand, know what the result's covariance has forgotten
    known_by_runs = (
        sum(compute_information(made, mechanics, layout, references, True))
        if made
        else read_information(known, mechanics, layout)
    )
    return Prospects(
        mechanics,
        layout,
        make_weak_prior(mechanics, layout) + known_by_runs,
        dict(zip(waves, added, strict=True)),
        list_questions(sizes, groups, layout, [*made, *waves.values()]),
    )


def _acting_causes(
    sizes: Mapping[str, dict[str, float]], groups: Sequence[Sequence[str]]
) -> dict[str, dict[str, float]]:
    """The causes with a size, by name; a thermometer's error shows only through what follows
    temperature: where none was found, a typical coefficient is assumed."""
    acting = {name: given for name, given in sizes.items() if given}
    beside = {find(name).beside for group in groups for name in group if name != BASE} - {""}
    if beside and not any(find(name).follows_temperature for name in acting):
        acting |= {name: {p.name: p.typical for p in find(name).fitted()} for name in beside}
    return acting


def explain_run(
    name: str, names: Sequence[str], prospects: Prospects, asked: Sequence[Question]
) -> str:
    """What would be lost without one run of those chosen.

    Parameters
    ----------
    name
        Of the run.
    names
        Of all that are chosen.
    prospects
        What each tells.
    asked
        Questions that the menu answers.

    Returns
    -------
    str
        The question that it answers most, or else the parameter that it tells best.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.planning.information import InformationColumns
    >>> from hrg_cli.stages.planning.prospects import Prospects, explain_run
    >>> m, turning = Mechanics(frequency_hz=5e3, damping_rate_1_s=0.1), np.eye(7)
    >>> turning[5, 5] = 1e4
    >>> had = Prospects(m, InformationColumns((), {}), np.eye(7), {"turning": turning}, [])
    >>> explain_run("turning", ["turning"], had, [])
    'makes σ of the scale factor 100 times smaller'
    """
    layout = prospects.layout
    without = prospects.sum_information([n for n in names if n != name])
    total = without + prospects.offered[name]
    if asked:
        gains = [
            (
                np.log1p(compute_separation(total, q, layout) ** 2)
                - np.log1p(compute_separation(without, q, layout) ** 2),
                q,
            )
            for q in asked
        ]
        q = max(gains, key=lambda pair: pair[0])[1]
        before_sigma, after_sigma = (
            compute_separation(without, q, layout),
            compute_separation(total, q, layout),
        )
        return (
            f"tells {say_in_words(q.cause)} from {say_in_words(q.rival)}: {before_sigma:.3g} σ"
            f" without it, {after_sigma:.3g} σ with it"
        )
    before, after = (compute_std(M, prospects.mechanics) for M in (without, total))
    best = max(before, key=lambda key: (before[key] or 0.0) / max(after[key] or 0.0, 1e-300))
    times = (before[best] or 0.0) / max(after[best] or 0.0, 1e-300)
    return f"makes σ of the {say_in_words(best)} {times:.3g} times smaller"
