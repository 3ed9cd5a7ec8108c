"""Where the base model's coordinates stand once something else is there as well: C Jᵀ S p̂
elsewhere, C their covariance, J the design, S what it does to the rows over σ at size 1, p̂ its
size.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..envelopes.coordinates import COUNT
from ..least_squares import invert_information
from .evidence import Score
from .extended_fit import ExtendedFit

Array = np.ndarray


def move_coordinates(fit: ExtendedFit, S: Array) -> Array:
    """By how much a fit's coordinates stand elsewhere where something is there besides: C Jᵀ S.

    Parameters
    ----------
    fit
        Of the runs.
    S
        What it does to the rows over σ, (N, …).

    Returns
    -------
    ndarray
        (7, …); 0 of coordinates that are held.

    Examples
    --------
    Nothing moves nothing:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.moves import move_coordinates
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> move_coordinates(draw_fit(), np.zeros(draw_fit().design.shape[0])).tolist()
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    """
    columns = list(fit.layout.coordinates)
    out = np.zeros((COUNT, *S.shape[1:]))
    out[columns] = (fit.covariance @ fit.design.multiply_transposed(S))[: len(columns)]
    return out


def move_by_causes(fit: ExtendedFit, scores: Sequence[Score]) -> Array:
    """By how much the coordinates stand elsewhere where these causes are there together, each as
    large as the residual asks.

    Parameters
    ----------
    fit
        Beside which they were scored.
    scores
        Of the causes.

    Returns
    -------
    ndarray
        (7,); 0 of coordinates that are held.

    Examples
    --------
    Of a gain mismatch that the base model had no part for, in the order of `COORDINATES`:

    >>> from hrg_cli.fitting.causes.moves import move_by_causes
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> fit, candidates = draw_mismatched_fit(), draw_found_case().inquiry.candidates
    >>> ((score, _),) = score_effects(fit, candidates)
    >>> move_by_causes(fit, [score]).shape
    (7,)
    """
    S = np.concatenate([one.columns for one in scores], axis=1)
    size = np.linalg.norm(S, axis=0)
    S = S / np.where(size > 0, size, 1.0)
    free = fit.basis.project_out(fit.basis.project_out(S))
    estimate = invert_information(free.T @ free) @ (free.T @ fit.residual)
    return move_coordinates(fit, S @ estimate)
