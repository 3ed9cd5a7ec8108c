"""Diagnosis, the gain: how much better runs are predicted that the extended model was not fitted to."""

from __future__ import annotations

import numpy as np

from ...fitting import evidence
from ...fitting.evidence import HeldOut
from ...fitting.extended_fit import Fit

Array = np.ndarray
FEWEST_RUNS = 4
TIME_BLOCKS = 5


def folds_of(fit: Fit) -> tuple[str, list[Array]]:
    """("runs", one fold a run) with four runs or more, else ("time", blocks of time across all runs): indices into the residual."""
    run, row = fit.rows[:, 0], fit.rows[:, 1]
    runs = np.unique(run)
    if len(runs) >= FEWEST_RUNS:
        return "runs", [np.flatnonzero(run == k) for k in runs]
    count = np.array([row[run == k].max() + 1 for k in runs])
    block = np.minimum(row * TIME_BLOCKS // count[np.searchsorted(runs, run)], TIME_BLOCKS - 1)
    return "time", [np.flatnonzero(block == b) for b in range(TIME_BLOCKS)]


def errors(fit: Fit, kind: str, folds: list[Array]) -> Array:
    """Mean squared whitened error of every fold, predicted from the others (linearised at the optimum)."""
    own_columns = np.array([name.startswith("run") and "." in name for name in fit.names])
    shared = ~own_columns if kind == "runs" else np.ones(len(own_columns), bool)
    own = {}
    for number, rows in enumerate(folds):
        block = fit.design[np.ix_(rows, np.flatnonzero(~shared))]
        own[number] = block[:, np.any(block != 0, axis=0)] if block.size else np.zeros((len(rows), 0))
    names = [name for name, keep in zip(fit.names, shared, strict=True) if keep]
    prior = []
    for k, name in enumerate(names):
        if name.startswith("p") and name[1:].isdigit() and np.isfinite(fit.freedom.std[int(name[1:])]):
            row = np.zeros(len(names))
            row[k] = 1 / fit.freedom.std[int(name[1:])]
            prior.append(row)
    return evidence.held_out(fit.residual, fit.design[:, shared], own, folds, np.array(prior) if prior else None)


def held_out(before: Fit, after: Fit) -> tuple[str, HeldOut]:
    """Held-out errors of two fits of the same data on the same folds."""
    kind, folds = folds_of(before)
    return kind, HeldOut(errors(before, kind, folds), errors(after, kind, folds))
