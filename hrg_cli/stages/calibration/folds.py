"""Which data stay unseen: folds of whole runs where programmes repeat, of time otherwise; band
limits and smoothness chosen with them."""

from __future__ import annotations

import numpy as np

from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import PIECES, compute_held_out_chi_square
from ...fitting.tables.table_layout import Model, TableLayout, compute_roughness
from .drift_models import build_variant
from .programme import examine

Array = np.ndarray
SMOOTHNESS = (1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e4)


def split_by_time(fitted: Fitted) -> Array:
    """Folds of contiguous stretches of time, the same of every run.

    Parameters
    ----------
    fitted
        The runs.

    Returns
    -------
    ndarray
        Fold (R, S) of each piece.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.folds import split_by_time
    >>> folds = split_by_time(Told(paths=["one", "two"]))
    >>> folds.shape[0], bool((folds[0] == folds[1]).all())
    (2, True)
    """
    return np.tile(np.arange(PIECES), (len(fitted.paths), 1))


def choose_folds(fitted: Fitted, harmonics: int) -> tuple[Array, str]:
    """Which data stay unseen: whole runs where programmes repeat, stretches of time otherwise.

    Whole runs are left out only if the others still give every table and reach the rates left out:
    no figure is an extrapolation.

    Parameters
    ----------
    fitted
        The runs.
    harmonics
        Of 2mθ in the drift that the others must still give.

    Returns
    -------
    tuple
        Fold (R, S) of each piece, and "runs" or "time".

    Examples
    --------
    Four runs at four rates: without one of them the others do not reach its rate.

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.folds import choose_folds
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> choose_folds(fitted, 0)[1]
    'time'
    """
    nodes, axis = fitted.layout.nodes, fitted.layout.axis
    # the first, where K may have any
    of_scale = min(1, fitted.layout.scale_harmonics)
    nearest = [
        int(np.argmin(np.abs(nodes - np.mean(fitted.layout.find_abscissa(p)))))
        for p in fitted.paths
    ]
    fold = np.array([nearest[:r].count(n) for r, n in enumerate(nearest)])
    mean = np.array([float(np.mean(p.rate_rad_s)) for p in fitted.paths])
    # Rates set to the same value differ by the table's own error.
    slack = 0.1 * float(np.abs(mean).max(initial=0.0))

    def serves(left: int) -> bool:
        for n in set(nearest):
            own = np.array(nearest) == n
            kept, gone = mean[own & (fold != left)], mean[own & (fold == left)]
            if len(gone) and (
                len(kept) == 0
                or (gone < kept.min() - slack).any()
                or (gone > kept.max() + slack).any()
            ):
                return False
        rest = [p for p, f in zip(fitted.paths, fold) if f != left]
        return not any(f.refuses for f in examine(rest, nodes, axis, harmonics, of_scale))

    count = int(fold.max()) + 1
    # With two folds each half would be judged by tables of the other half alone.
    if count >= 3 and all(serves(left) for left in range(count)):
        return np.repeat(fold[:, None], PIECES, axis=1), "runs"
    return split_by_time(fitted), "time"


def choose_limits(
    fitted: Fitted, drift: int | None, scale: int | None, family: str = "table"
) -> tuple[int, int, dict[str, list[float]]]:
    """Harmonics of drift and scale factor that predict data left out best, drift first.

    Parameters
    ----------
    fitted
        The runs.
    drift, scale
        Harmonics of 2mθ that were fixed; None: chosen.
    family
        "table", or "combined": with the measured quadrature beside.

    Returns
    -------
    tuple
        Both numbers, and the scores by harmonics: χ² of stretches of time left out, above the
        smallest.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.folds import choose_limits
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> choose_limits(fitted, 1, None)[:2]
    (1, 0)
    """
    layout, folds = fitted.layout, split_by_time(fitted)
    scores = {"drift": [0.0], "scale_factor": [0.0]}
    if drift is None:
        candidates = [
            build_variant(family, layout, k, layout.scale_harmonics)
            for k in range(layout.drift_harmonics + 1)
        ]
        scores["drift"] = [
            compute_held_out_chi_square(fitted.pieces, folds, model) for model in candidates
        ]
        drift = int(np.argmin(scores["drift"]))
    if scale is None:
        candidates = [
            build_variant(family, layout, drift, k) for k in range(layout.scale_harmonics + 1)
        ]
        scores["scale_factor"] = [
            compute_held_out_chi_square(fitted.pieces, folds, model) for model in candidates
        ]
        scale = int(np.argmin(scores["scale_factor"]))
    return drift, scale, {key: [s - min(row) for s in row] for key, row in scores.items()}


def choose_smoothness(fitted: Fitted, model: Model) -> tuple[Array, float]:
    """Penalty on curvature along the nodes that predicts data left out best.

    Parameters
    ----------
    fitted
        The runs.
    model
        What of the coefficients is free.

    Returns
    -------
    tuple
        Penalty (size, size), and its weight relative to the information about each kind of
        coefficient.

    Examples
    --------
    One node has no curvature:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.folds import choose_smoothness
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> penalty, weight = choose_smoothness(fitted, Model("table", np.eye(layout.size)))
    >>> bool((penalty == 0).all())
    True
    """
    layout: TableLayout = fitted.layout
    information = np.diag(fitted.pieces.sum()[0])
    scale = np.zeros(layout.size)
    for part in (layout.drift, layout.scale):
        places = np.concatenate([np.arange(layout.size)[part(j)] for j in range(len(layout.nodes))])
        scale[places] = np.sqrt(np.mean(information[places]))
    penalty = compute_roughness(layout) * np.outer(scale, scale)
    scores = [
        compute_held_out_chi_square(fitted.pieces, split_by_time(fitted), model, weight * penalty)
        for weight in SMOOTHNESS
    ]
    best = SMOOTHNESS[int(np.argmin(scores))]
    return best * penalty, best
