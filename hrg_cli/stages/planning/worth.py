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
    """σ by which the cause stands out with the base model free; of two causes, σ of the one that
    the other, free too, follows less.

    A lag does nothing that a gradient could not do, but not the other way round: either is named
    where a gradient would stand out.
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
    """Sum of log(1 + σ²): the least separated count most."""
    return float(sum(np.log1p(compute_separation(M, q, layout) ** 2) for q in questions))


def compute_log_information(M: Array, m: Mechanics) -> float:
    """−log det of the covariance of the six parameters."""
    sign, value = np.linalg.slogdet(marginalise(M, range(6), [6]) / np.outer(_units(m), _units(m)))
    return float(value) if sign > 0 else -np.inf


def _units(m: Mechanics) -> Array:
    damping, split = (
        max(abs(m.damping_rate_1_s), 1e-9),
        max(abs(m.frequency_split_rad_s), abs(m.damping_rate_1_s), 1e-9),
    )
    return 1 / np.array([damping, damping, damping, split, split, 1.0])


def compute_std(M: Array, m: Mechanics) -> dict[str, float | None]:
    """Standard deviation of every parameter but the frequency from the base model's information."""
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
    """Greedy choice of different runs, then exchanges while one helps."""
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
    """Sentences about what all runs of the menu together cannot tell apart."""
    out = []
    for q in questions:
        if q.cause in INHERENT and q.rival == BASE:
            out.append(f"no run can tell {say_in_words(q.cause)} from {INHERENT[q.cause]}")
        elif compute_separation(everything, q, layout) < TOLD:
            sigma = compute_separation(everything, q, layout)
            out.append(
                f"all runs of the menu together tell {say_in_words(q.cause)} from {say_in_words(q.rival)}"
                f" by {sigma:.1f} σ only; add other runs"
            )
    return out
