"""What runs are worth: σ between causes, standard deviations, and the choice of runs by them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ...fitting.envelopes.coordinates import COUNT, from_mechanics, to_parameters
from ...fitting.envelopes.inference import widen_axes
from ...fitting.least_squares import invert_information
from ...physics.resonator import PARAMETERS, Mechanics
from .information import InformationColumns, marginalise
from .questions import BASE, INHERENT, Question, say_in_words

Array = np.ndarray


TOLD = 3.0
"""σ from which a cause counts as told apart."""
DOUBLES = 1e-15
"""Part of the largest information below which a direction has none: what is hardly known keeps its
large σ as far as doubles reach."""
NOTHING = 1e-3
"""σ that rounding alone may give."""


def compute_separation(M: Array, question: Question, layout: InformationColumns) -> float:
    """σ by which a cause stands out with the base model free.

    Of two causes it is σ of the one that the other, free too, follows less: a lag does nothing that
    a gradient could not do, but not the other way round, and either is named where a gradient would
    stand out. With S the cause's information after all that is free is marginalised and its size s,
    σ² = sᵀ S s.

    Parameters
    ----------
    M
        Information (size, size) in the columns of the layout.
    question
        The cause and its rival, with their sizes in columns' units.
    layout
        The columns.

    Returns
    -------
    float
        σ; 0 where what is left is rounding.

    Examples
    --------
    Nine units of information on one parameter, of a size of two:

    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.planning.information import InformationColumns
    >>> from hrg_cli.stages.planning.questions import BASE, Question
    >>> from hrg_cli.stages.planning.worth import compute_separation
    >>> layout = InformationColumns((find("cubic_stiffness"),), {})
    >>> M = np.diag([1.0] * 7 + [9.0])
    >>> compute_separation(M, Question("cubic_stiffness", BASE, np.array([2.0])), layout)
    6.0
    """
    one = _find_cause_std(M, question.cause, question.size, question.rival, layout)
    if question.rival_size is None:
        return one
    return max(one, _find_cause_std(M, question.rival, question.rival_size, question.cause, layout))


def _find_cause_std(
    M: Array, cause: str, size: Array, rival: str, layout: InformationColumns
) -> float:
    """σ of a cause of that size with the base model, and the rival, free."""
    free = layout.list_free(cause, rival) + ([] if rival == BASE else layout.find_columns(rival))
    S = marginalise(M, layout.find_columns(cause), free)
    whole = M[np.ix_(layout.find_columns(cause), layout.find_columns(cause))]
    left, all_of_it = float(size @ S @ size), float(size @ whole @ size)
    return float(np.sqrt(left)) if left > max(1e-9 * all_of_it, NOTHING**2) else 0.0


def sum_separations(M: Array, questions: Sequence[Question], layout: InformationColumns) -> float:
    """Worth of an information for several questions, Σ log(1 + σ²): the least separated count most.

    Parameters
    ----------
    M
        Information (size, size) in the columns of the layout.
    questions
        What is to be told apart.
    layout
        The columns.

    Returns
    -------
    float
        0 where nothing is told.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.planning.information import InformationColumns
    >>> from hrg_cli.stages.planning.questions import BASE, Question
    >>> from hrg_cli.stages.planning.worth import sum_separations
    >>> layout = InformationColumns((find("cubic_stiffness"),), {})
    >>> asked = [Question("cubic_stiffness", BASE, np.array([2.0]))]
    >>> found = sum_separations(np.diag([1.0] * 7 + [9.0]), asked, layout)
    >>> bool(np.isclose(found, np.log(37)))
    True
    """
    return float(sum(np.log1p(compute_separation(M, q, layout) ** 2) for q in questions))


def compute_log_information(M: Array, m: Mechanics) -> float:
    """−log det of the covariance of the six parameters, each in a unit of the resonator's own
    (D-optimality, Kiefer and Wolfowitz 1959).

    Parameters
    ----------
    M
        Information, its first seven columns those of the coordinates; the second order is
        marginalised.
    m
        The resonator, for its units: damping and split.

    Returns
    -------
    float
        Larger where more is known; −∞ where a direction is not known at all.

    Examples
    --------
    Four times the information is half the standard deviation of six numbers:

    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.planning.worth import compute_log_information
    >>> m = Mechanics(frequency_hz=5e3, damping_rate_1_s=0.1)
    >>> gained = compute_log_information(4 * np.eye(7), m) - compute_log_information(np.eye(7), m)
    >>> bool(np.isclose(gained, 6 * np.log(4)))
    True
    """
    sign, value = np.linalg.slogdet(marginalise(M, range(6), [6]) / np.outer(_units(m), _units(m)))
    return float(value) if sign > 0 else -np.inf


def _units(m: Mechanics) -> Array:
    damping, split = (
        max(abs(m.damping_rate_1_s), 1e-9),
        max(abs(m.frequency_split_rad_s), abs(m.damping_rate_1_s), 1e-9),
    )
    return 1 / np.array([damping, damping, damping, split, split, 1.0])


def compute_std(M: Array, m: Mechanics) -> dict[str, float | None]:
    """Standard deviations of every parameter but the frequency that an information leaves.

    Parameters
    ----------
    M
        Information, its first seven columns those of the coordinates; the second order is a
        nuisance, and no parameter shows it.
    m
        The resonator at which it holds.

    Returns
    -------
    dict
        Parameter -> standard deviation in its unit; an axis whose split is not clear of its noise
        is as uncertain as any.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.planning.worth import compute_std
    >>> m = Mechanics(frequency_hz=5e3, damping_rate_1_s=0.1, damping_split_1_s=0.02)
    >>> found = compute_std(np.diag([1e8] * 7), m)
    >>> round(found["damping_rate_1_s"], 9)
    0.0001
    """
    _, slopes = to_parameters(from_mechanics(m), m.mode_number)
    covariance = np.zeros((COUNT, COUNT))
    # The second order is a nuisance here: its part is marginalised, not shown as a parameter.
    covariance[:6, :6] = invert_information(marginalise(M, range(6), [6]), DOUBLES, _units(m))
    predicted = slopes @ covariance @ slopes.T
    widen_axes(predicted, covariance, from_mechanics(m), m.mode_number)
    stds = np.sqrt(np.maximum(np.diag(predicted), 0))
    return {name: float(std) for (name, _), std in zip(PARAMETERS[1:], stds, strict=True)}


def choose_runs(
    had: Array, offered: Mapping[str, Array], count: int, worth: Callable[[Array], float]
) -> list[str]:
    """Different runs that are worth most together: a greedy choice, then exchanges while one helps.

    A first run that was best alone may be a poor one beside the others, and greedy choice keeps it
    (Fedorov 1972, Theory of Optimal Experiments).

    Parameters
    ----------
    had
        Information (size, size) there is already.
    offered
        That of each run of the menu, by name.
    count
        Runs to be chosen, at most as many as are offered.
    worth
        Of an information.

    Returns
    -------
    list of str
        Names, in the order in which they were chosen.

    Examples
    --------
    "both" is best alone, "left" and "right" are best together:

    >>> import numpy as np
    >>> from hrg_cli.stages.planning.worth import choose_runs
    >>> menu = {"both": np.diag([2.0, 2.0]), "left": np.diag([9.0, 0]), "right": np.diag([0, 9.0])}
    >>> worth = lambda M: float(np.linalg.slogdet(np.eye(2) + M)[1])
    >>> sorted(choose_runs(np.zeros((2, 2)), menu, 2, worth))
    ['left', 'right']
    """
    names: list[str] = []
    for _ in range(count):
        total = had + sum(offered[n] for n in names)
        names.append(
            max((n for n in offered if n not in names), key=lambda n: worth(total + offered[n]))
        )
    # A first run that was best alone may be a poor one beside the others: greedy choice keeps it.
    improved = True
    while improved:
        improved = False
        for k in range(len(names)):
            others = had + sum(offered[n] for i, n in enumerate(names) if i != k)
            best = max(
                (n for n in offered if n not in names or n == names[k]),
                key=lambda n: worth(others + offered[n]),
            )
            # More than rounding, or two runs of one worth would be exchanged for ever.
            if worth(others + offered[best]) > worth(others + offered[names[k]]) + 1e-9:
                names[k], improved = best, True
    return names


def find_impossible(
    everything: Array, questions: Sequence[Question], layout: InformationColumns
) -> list[str]:
    """What all runs of a menu together cannot tell apart.

    Parameters
    ----------
    everything
        Information (size, size) of all of them.
    questions
        What is to be told apart.
    layout
        The columns.

    Returns
    -------
    list of str
        A sentence for each question below `TOLD` σ, or that no run of any menu could answer.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.planning.information import InformationColumns
    >>> from hrg_cli.stages.planning.questions import BASE, Question
    >>> from hrg_cli.stages.planning.worth import find_impossible
    >>> layout = InformationColumns((find("cubic_stiffness"),), {})
    >>> asked = [Question("cubic_stiffness", BASE, np.array([0.5]))]
    >>> print(*find_impossible(np.diag([1.0] * 7 + [9.0]), asked, layout))
    all runs of the menu together tell ... from the base model by 1.5 σ only; add other runs
    """
    out = []
    for q in questions:
        if q.cause in INHERENT and q.rival == BASE:
            out.append(f"no run can tell {say_in_words(q.cause)} from {INHERENT[q.cause]}")
        elif compute_separation(everything, q, layout) < TOLD:
            sigma = compute_separation(everything, q, layout)
            out.append(
                f"all runs of the menu together tell {say_in_words(q.cause)} from"
                f" {say_in_words(q.rival)} by {sigma:.1f} σ only; add other runs"
            )
    return out
