"""The closing checks of a drift model, the same for every variant: fit at the noise known,
whiteness, unseen data, noise, spread.

The noise is that of the fit in which every table, every measured part and every suspected cause is
free; the variants are judged at it, so that what a variant fails to hold cannot pass for noise.
Each cause a variant leaves out is tested by its score at its solution:
    s = Gᵀ(b − A c),  Var s = Gᵀ(A − A C A)G (coefficients fitted to these data) or Gᵀ(A + A C A)G
    (coefficients from elsewhere)
with A, b the whitened normal equations and C the covariance of the variant's coefficients c: sᵀ
Var⁻¹ s is χ² if the cause is absent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ...fitting.checks import Check, check_goodness, check_holds, check_whiteness, list_failures
from ...fitting.noise.increment_noise import build_covariance_bands, whiten
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import TableSolution, solve
from ...fitting.tables.table_design import predict_turn
from ...fitting.tables.table_layout import Model, TableLayout
from .late_log import LATE
from .noise_guards import compare_known_noise

Array = np.ndarray
MOST_NAMED = 3
"""Causes that are named of one variant."""
WIDER = ("table", "combined")
"""Variants that hold every harmonic."""
LEAST_OWN = 1e-6
"""Part of a cause's information (relative to the whole) that must lie outside the variant's span to
be tested."""
FACTORS = {
    "quadrature_course": (
        "the drift moves with the measured quadrature, which is no function of temperature and"
        " angle ({z:.3g} times its error); use --model quadrature, or a firmer quadrature loop"
    ),
    "rate": (
        "the drift moves with the rate itself ({z:.3g} times its error), which no table holds: a"
        " scale factor that is not linear, or a frequency split under a soft quadrature loop"
    ),
    "quadrature_drive": (
        "the drift moves with the logged quadrature drive ({z:.3g} times its error): a phase error"
        " of the quadrature loop; run with --ladder to measure it"
    ),
    LATE: (
        "the waves turn earlier or later than the rate logs say ({z:.3g} times the error): the logs"
        " are late or early against the samples; keep both on one clock"
    ),
}
"""Sentences of the measured parts that a variant leaves out, by their names."""
LEAST_SEEN = 1e-9
"""Scaled eigenvalue of the normal matrix below which the data do not tell a direction."""


@dataclass(frozen=True)
class VariantSolution:
    """A variant's solution on all runs and with each fold left out; `foreign`: its coefficients
    come from elsewhere."""

    model: Model
    solution: TableSolution
    held: tuple[TableSolution, ...]
    foreign: bool = False
    averaged: tuple[str, ...] = ()
    """Its tables ("drift", "scale") whose harmonics are averaged over how large each may be."""


def judge_variants(
    fitted: Fitted, folds: Array, tried: Sequence[VariantSolution]
) -> list[tuple[list[Check], list[str]]]:
    """The closing checks of variants, at the noise of a fit with everything free.

    Parameters
    ----------
    fitted
        The runs with everything free.
    folds
        Fold of each piece (R, S), from 0.
    tried
        The variants.

    Returns
    -------
    list of tuple
        Checks of each variant, and what failed in words: a cause that is named, or else the checks
        themselves.

    Examples
    --------
    A model without a scale factor is not that of a gyro which turns:

    >>> from hrg_cli.stages.calibration.variant_solutions import solve_linear
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.guards import judge_variants
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> models = [Model("table", np.eye(4)), Model("without scale factor", np.eye(4)[:, :3])]
    >>> tried = [solve_linear(fitted, folds, model) for model in models]
    >>> [
    ...     all(check.passed for check in checks)
    ...     for checks, _ in judge_variants(fitted, folds, tried)
    ... ]
    [True, False]
    """
    A, b, _ = fitted.pieces.sum()
    noise = compare_known_noise(fitted)
    out = []
    for t, white in zip(tried, _whiteness(fitted, tried)):
        beside = _test_left_out(fitted.layout, A, b, t)
        general = [_check_folds(fitted, folds, t), *white]
        always = [noise, _spread(fitted.layout, t)]
        # a cause that is named is said; what else failed for its sake stands in the checks
        words = (
            _name_causes(fitted.layout, A, b, t, beside[:-1])
            or list_failures([beside[-1]])
            or list_failures(general)
        )
        out.append((beside + general + always, words + list_failures(always)))
    return out


def _name_causes(
    layout: TableLayout, A: Array, b: Array, tried: VariantSolution, checks: Sequence[Check]
) -> list[str]:
    """Sentences of the causes left out: the one that explains most, then those that still fail
    beside it."""
    said: list[str] = []
    matrix, before = tried.model.matrix, tried.solution.coefficients
    left = b - A @ before

    def find_fall(coefficients: Array) -> float:
        """By how much χ² falls from the variant's: of two large χ² no digit would be left."""
        step = coefficients - before
        return float(2 * left @ step - step @ A @ step)

    all_causes = {name: columns for name, columns, _ in _list_doubtful_causes(layout, "")}
    while len(said) < MOST_NAMED:
        failed = {check.name: check for check in checks if not check.passed}
        if not failed:
            break
        gains = {
            name: solve(
                A,
                b,
                Model("", np.concatenate([matrix, all_causes[name]], axis=1), tried.model.start),
            )
            for name in failed
        }
        worst = max(gains, key=lambda name: find_fall(gains[name].coefficients))
        said.append(failed[worst].sentence)
        matrix = np.concatenate([matrix, all_causes[worst]], axis=1)
        checks = _test_left_out(
            layout,
            A,
            b,
            VariantSolution(Model(tried.model.name, matrix, tried.model.start), gains[worst], ()),
        )[:-1]
    return said


def compute_score(
    A: Array,
    u: Array,
    G: Array,
    covariance: Array,
    sign: float,
    open_directions: Array | None = None,
) -> tuple[float, int]:
    """How far data contradict a solution along directions that it leaves out: the score test.

    s = Gᵀu against Var s = Gᵀ(A + sign·A C A)G; sᵀ(Var s)⁻¹s is χ² where the directions are absent
    (Rao 1948).

    Parameters
    ----------
    A
        Information (size, size) of the data.
    u
        b − A·c (size,) of the normal equations at the solution c.
    G
        Directions (size, g).
    covariance
        C of c (size, size).
    sign
        −1 where c was fitted to these data, 1 where it comes from elsewhere.
    open_directions
        Of the coefficients (size, k), known not at all: what lies along them is no contradiction.

    Returns
    -------
    tuple
        χ² and its degrees of freedom; what lies within the solution's own span is not tested.

    Examples
    --------
    A mean was fitted, c = 2; a second coefficient of ±1 that is 3 stands out by 9:

    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.guards import compute_score
    >>> A, b, C = np.eye(2), np.array([2.0, 3.0]), np.diag([1.0, 0.0])
    >>> compute_score(A, b - A @ np.array([2.0, 0.0]), np.eye(2), C, -1.0)
    (9.0, 1)
    """
    AG = A @ G
    # directions scaled to unit information, so that one cut-off serves rad/s and ppm
    size = np.diag(G.T @ AG)
    seen = size > 0
    if not seen.any():
        return 0.0, 0
    unit = 1 / np.sqrt(size[seen])
    AG = AG[:, seen] * unit
    V = (G[:, seen] * unit).T @ AG + sign * AG.T @ covariance @ AG
    along = (G[:, seen] * unit).T @ u
    if open_directions is not None and open_directions.size:
        # what moves with a direction that the coefficients leave open has no prediction to
        # contradict
        basis, size_of, _ = np.linalg.svd(AG.T @ open_directions)
        rank = int(np.sum(size_of > 1e-9 * max(size_of.max(initial=0.0), 1e-300)))
        V, along = basis[:, rank:].T @ V @ basis[:, rank:], basis[:, rank:].T @ along
    # a direction within the variant's own span has no variance left: its score is 0/0, not tested
    values, vectors = np.linalg.eigh((V + V.T) / 2)
    kept = values > LEAST_OWN
    return float(np.sum((vectors[:, kept].T @ along) ** 2 / values[kept])), int(kept.sum())


def find_unseen_directions(information: Array, model: Model) -> Array:
    """Directions of a model that data do not tell.

    Parameters
    ----------
    information
        (size, size) of the data.
    model
        What of the coefficients is free.

    Returns
    -------
    ndarray
        (size, k), in which the information is 0 to rounding.

    Examples
    --------
    Two coefficients of which the data see the sum:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import Model
    >>> from hrg_cli.stages.calibration.guards import find_unseen_directions
    >>> unseen = find_unseen_directions(np.ones((2, 2)), Model("both", np.eye(2)))
    >>> unseen.shape, bool(np.isclose(unseen.sum(), 0.0))
    ((2, 1), True)
    """
    M = model.matrix
    B = M.T @ information @ M
    unit = 1 / np.sqrt(np.where(np.diag(B) > 0, np.diag(B), 1.0))
    values, vectors = np.linalg.eigh(B * np.outer(unit, unit))
    return np.asarray(M @ (unit[:, None] * vectors[:, values < LEAST_SEEN]))


def _test_left_out(layout: TableLayout, A: Array, b: Array, tried: VariantSolution) -> list[Check]:
    """One check a cause that the variant may have left out, and one for all together."""
    u = b - A @ tried.solution.coefficients
    # of an average over harmonics in doubt, what plain least squares leaves free is tested: its own
    # covariance is a mixture's, not a fit's; and where that fit would put what it fits, for only
    # there does the score have that variance
    covariance = tried.solution.covariance if tried.foreign else solve(A, b, tried.model).covariance
    u = u if tried.foreign else u - A @ (covariance @ u)
    sign = 1.0 if tried.foreign else -1.0
    checks = []
    for name, columns, words in _list_doubtful_causes(layout, tried.model.name):
        chi2, rank = compute_score(A, u, columns, covariance, sign)
        if rank:
            checks.append(check_goodness(chi2, rank, words(float(np.sqrt(chi2 / rank))), name))
    chi2, rank = compute_score(A, u, np.eye(layout.size), covariance, sign)
    sentence = (
        f"model {tried.model.name} leaves more than the noise: χ² = {chi2:.4g} of what the runs"
        f" hold beside it, {rank} were expected; run with --ladder to see what each part buys"
    )
    return [*checks, check_goodness(chi2, max(rank, 1), sentence, "lack_of_fit")]


def _list_doubtful_causes(
    layout: TableLayout, variant: str
) -> list[tuple[str, Array, Callable[[float], str]]]:
    """(name, directions (size, g), sentence of the rms score) of every cause that the variant of
    this name may leave out."""
    out: list[tuple[str, Array, Callable[[float], str]]] = []
    for k in range(layout.drift_harmonics + 1):
        directions = layout.build_part_map("drift", k, lowest=k)
        out.append((f"drift_harmonic_{k}", directions, _say_harmonic(layout, "drift", k, variant)))
    for k in range(layout.scale_harmonics + 1):
        directions = layout.build_part_map("scale", k, lowest=k)
        out.append(
            (f"scale_factor_harmonic_{k}", directions, _say_harmonic(layout, "scale", k, variant))
        )
    out += [
        (name, layout.build_factor_map(name), partial(_say_factor, sentence))
        for name, sentence in FACTORS.items()
        if name in layout.factors
    ]
    return out


def _say_harmonic(layout: TableLayout, kind: str, k: int, variant: str) -> Callable[[float], str]:
    """The sentence of a harmonic of D or K that a model does not hold."""
    what = "the drift" if kind == "drift" else "the scale factor"
    part = f"its harmonic {2 * layout.mode_number * k}θ" if k else "its constant part"
    cause = (
        "loops that act τ late make K/(1 + ντ) of K, and --ladder tells τ beside free runs"
        if kind == "scale" and k == 0
        else "a defect beside the linear anisotropy"
    )
    others = " or ".join(f"--model {name}" for name in WIDER if name != variant)
    return lambda z: (
        f"{what} holds more than the model does in {part} ({z:.3g} times its error): {cause};"
        f" use {others}"
    )


def _say_factor(sentence: str, z: float) -> str:
    return sentence.format(z=z)


def _check_folds(fitted: Fitted, folds: Array, tried: VariantSolution) -> Check:
    """The worst fold predicted from the others, held against the prediction's own standard
    deviation."""
    worst = Check("held_out", 0.0, 1.0, True)
    everything = fitted.pieces.sum()[0]
    for f, solution in enumerate(tried.held):
        A, b, rows = fitted.pieces.sum(folds == f)
        if rows == 0:
            continue
        chi2, rank = compute_score(
            A,
            b - A @ solution.coefficients,
            np.eye(len(b)),
            solution.covariance,
            1.0,
            find_unseen_directions(everything - A, tried.model),
        )
        sentence = (
            f"data left out are predicted {np.sqrt(chi2 / max(rank, 1)):.3g} times worse than model"
            f" {tried.model.name} states (fold {f + 1} of {len(tried.held)}): the runs do not"
            " repeat, or the model is not theirs; look at stability in `hrg info`"
        )
        check = check_goodness(chi2, max(rank, 1), sentence, "held_out")
        if check.value / check.limit > worst.value / worst.limit:
            worst = check
    return worst


def _spread(layout: TableLayout, tried: VariantSolution) -> Check:
    drift = np.concatenate(
        [np.arange(layout.size)[layout.drift(j)] for j in range(len(layout.nodes))]
    )
    std = np.sqrt(np.maximum(np.diag(tried.solution.covariance)[drift], 0))
    sentence = (
        "the drift comes out without any standard deviation: nothing of it was measured; do not use"
        " it as known exactly"
    )
    return check_holds("drift_has_an_error", bool(std.max(initial=0.0) > 0), sentence)


def _settled(A: Array, b: Array, tried: VariantSolution) -> Array:
    """The coefficients whose residual should be white: those from elsewhere, moved within their own
    errors to where the data want them."""
    c, C = tried.solution.coefficients, tried.solution.covariance
    return (
        c
        if not tried.foreign
        else np.asarray(c + C @ np.linalg.solve(np.eye(len(c)) + A @ C, b - A @ c))
    )


def _angle_without_noise(fitted: Fitted, path: AnglePath) -> Array:
    """Wave angle (n,) in the increments' middles as the fit with everything free carries it through
    the run: in the order of the measured one a wave that stands still would show its own noise."""
    solution = fitted.solution.coefficients
    turn = predict_turn(path, fitted.layout, solution, solution)
    course = (np.cumsum(turn) - turn / 2) / path.mode_number
    return np.asarray(course + np.mean(path.average_neighbours(path.angle_rad) - course))


def _whiteness(fitted: Fitted, tried: Sequence[VariantSolution]) -> list[list[Check]]:
    """Whiteness of each variant's residual over time, wave angle, temperature (or frequency) and
    rate."""
    A, b, _ = fitted.pieces.sum()
    coefficients = np.stack([_settled(A, b, t) for t in tried], axis=1)
    white, angle, place, rate = [], [], [], []
    for path, turn, noise in zip(fitted.paths, fitted.turns, fitted.noises):
        rest = turn[:, None] - predict_turn(
            path, fitted.layout, coefficients, fitted.solution.coefficients
        )
        white.append(whiten(build_covariance_bands(path, noise), rest)[0])
        angle.append(np.mod(_angle_without_noise(fitted, path), np.pi / path.mode_number))
        place.append(fitted.layout.find_abscissa(path))
        rate.append(path.rate_rad_s)
    orders = {
        "wave angle": angle,
        "temperature" if fitted.layout.axis == "temperature" else "frequency": place,
        "rate": rate,
    }
    whole = np.concatenate(white)
    sorts = {
        name: np.argsort(np.concatenate(values), kind="stable")
        for name, values in orders.items()
        if np.ptp(np.concatenate(values)) > 0
    }
    out = []
    for i, t in enumerate(tried):
        rows = {"time": [w[:, i] for w in white]} | {
            name: [whole[order, i]] for name, order in sorts.items()
        }
        out.append(
            [
                check_whiteness(
                    list(residuals),
                    f"what model {t.model.name} leaves is no noise: over {name} it goes slowly,"
                    " where noise would not; a cause is missing: run diagnose on free runs, or"
                    " --ladder",
                    f"whiteness_over_{name.replace(' ', '_')}",
                )
                for name, residuals in rows.items()
            ]
        )
    return out
