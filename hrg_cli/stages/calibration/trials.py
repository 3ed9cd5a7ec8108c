"""What is tried on the prepared runs: everything at once, which tells the noise, then each model of
the drift that the runs and resonators can give."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting.checks import list_failures
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted, fit
from ...fitting.tables.table_layout import TableLayout
from ...records import Resonator
from .choice import TriedVariant, choose_best, explain_choice, list_possible, solve_variants
from .chosen import Chosen
from .comparison import compare_variants
from .drift_models import FACTORS
from .factors import build_factors
from .folds import choose_folds
from .late_log import Lateness, follow
from .preparation import PreparedRuns
from .resonators import ResonatorCoefficients, pool_resonators
from .variant_average import add_spread_of_variants, weigh_variants
from .variant_solutions import Wanted
from .wider_model import WIDEST, hold_against_widest

Array = np.ndarray


@dataclass(frozen=True)
class FullFit:
    """The runs fitted with every table, measured part and suspected cause free: what is left is the
    noise at which each variant is judged."""

    fitted: Fitted
    free: list[AnglePath]
    """Free runs, in the rate log's time as found."""
    late: Lateness | None
    factors: Mapping[str, Any]
    layout: TableLayout


def fit_everything(
    runs: PreparedRuns, limits: tuple[int, int], axis: str, interpolation: str
) -> FullFit:
    """Prepared runs fitted with all that may be in them, and the lateness of their rate logs.

    Parameters
    ----------
    runs
        The runs.
    limits
        Harmonics of 2mθ in drift and scale factor.
    axis
        Quantity of the nodes.
    interpolation
        Between the nodes.

    Returns
    -------
    FullFit
        What it leaves is the noise at which each variant is judged.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.trials import fit_everything
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> runs = Told(
    ...     forced=fitted.paths,
    ...     free=[],
    ...     nodes=layout.nodes,
    ...     usable=Told(waves=[Told(mode_number=2)]),
    ... )
    >>> whole = fit_everything(runs, (1, 0), "temperature", "linear")
    >>> sorted(whole.factors), bool(abs(whole.fitted.solution.coefficients[3] - 0.55) < 1e-6)
    (['rate'], True)
    """
    factors, widths = build_factors(runs.forced, runs.nodes, axis, interpolation, FACTORS)
    mode_number = runs.usable.waves[0].mode_number
    layout = TableLayout(runs.nodes, axis, mode_number, *limits, interpolation, factors, widths)
    fitted, free, late = follow(fit(runs.forced, layout), runs.free)
    return FullFit(fitted, free, late, factors, layout)


def add_loop_columns(fitted: Fitted) -> Fitted:
    """The same runs fitted with the columns of the ladder's factors.

    Parameters
    ----------
    fitted
        The runs.

    Returns
    -------
    Fitted
        With quadrature, and with the drives where they are logged.

    Examples
    --------
    Without a log of the drives:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.trials import add_loop_columns
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> list(add_loop_columns(fitted).layout.factors)
    ['quadrature']
    """
    old = fitted.layout
    factors, widths = build_factors(
        fitted.paths,
        old.nodes,
        old.axis,
        old.interpolation,
        ["quadrature", "quadrature_drive", "main_drive"],
    )
    return fit(fitted.paths, replace(old, factors=factors, factor_columns=widths))


def take_coefficients(
    resonators: Sequence[Resonator],
    model: str,
    axis: str,
    runs: PreparedRuns,
    interpolation: str,
) -> tuple[ResonatorCoefficients | None, str | None]:
    """The resonators' coefficients over the nodes' quantity, or why there are none.

    Parameters
    ----------
    resonators
        Identified from free runs.
    model
        That was asked for.
    axis
        Quantity of the nodes.
    runs
        Whose nodes and range the coefficients must reach.
    interpolation
        Between the nodes.

    Returns
    -------
    tuple
        The coefficients or None, and why there are none; None where no resonator was given.

    Raises
    ------
    HrgError
        They cannot be used, and were asked for by name ("physical").

    Examples
    --------
    >>> from hrg_cli.stages.calibration.trials import take_coefficients
    >>> take_coefficients([], "auto", "temperature", None, "linear")
    (None, None)
    """
    if not resonators:
        return None, None
    try:
        found = pool_resonators(resonators, axis, runs.nodes, *runs.valid, interpolation)
    except HrgError as error:
        if model == "physical":
            raise
        return None, str(error)
    disagree = list_failures(found.checks)
    if disagree and model == "physical":
        raise HrgError(disagree[0])
    return (None, disagree[0]) if disagree else (found, None)


@dataclass(frozen=True)
class TriedModels:
    """The models that were tried, and which of them is the answer."""

    answers: list[TriedVariant]
    answer: TriedVariant
    not_tried: dict[str, str]
    """Why, by the model's name."""
    coefficients: ResonatorCoefficients | None

    def list_details(
        self, chosen: Chosen, explained: bool, draws: int, seed: int
    ) -> dict[str, Any]:
        """What the record keeps of the comparison; `explained`: the choice among models, too."""
        fitted, folds = chosen.fitted, chosen.folds
        told: dict[str, Any] = {
            "choice": explain_choice(fitted, self.answers, chosen.answer, self.not_tried)
            | {"weights": weigh_variants(self.answers)}
            if explained
            else None,
            "resonator": None if self.coefficients is None else self.coefficients.list_rows(),
        }
        if len(self.answers) > 1:
            told["variants"] = compare_variants(
                fitted, folds, self.answers, chosen.scale_factor, draws, seed
            )
        return told


def try_models(
    whole: FullFit,
    folds: Array,
    wanted: Wanted,
    resonators: tuple[ResonatorCoefficients | None, str | None],
    model: str,
    refused: bool,
) -> TriedModels:
    """The model that was named, or all that are possible, solved and judged.

    Parameters
    ----------
    whole
        The runs fitted with everything free.
    folds
        Fold of each piece (R, S), from 0.
    wanted
        What was fixed.
    resonators
        Their coefficients or None, and why there are none.
    model
        "auto", "all", or the name of one.
    refused
        Whether the programme gives no tables: then the table alone is tried.

    Returns
    -------
    TriedModels
        With the answer, whose error holds what the variants that fit differ by: those that were
        asked for, and the widest.

    Raises
    ------
    HrgError
        The model that was named cannot be tried.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.variant_solutions import Wanted
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.trials import try_models
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> whole, wanted = Told(fitted=fitted, layout=layout, factors={}), Wanted(1, 0, seed=0)
    >>> try_models(whole, folds, wanted, (None, None), "auto", False).answer.name
    'parametric'
    """
    coefficients, why_not = resonators
    possible, not_tried = list_possible(whole.layout, coefficients, why_not)
    names = _choose_names(model, possible, not_tried, refused, whole.factors)
    beside = [WIDEST] if WIDEST in possible and WIDEST not in names and not refused else []
    tried = solve_variants(whole.fitted, folds, [*names, *beside], wanted, coefficients)
    tried = hold_against_widest(whole.layout, tried)
    asked = tried[: len(names)]
    answer = choose_best(asked) if model == "auto" else asked[0]
    answer = add_spread_of_variants(whole.layout, answer, tried)
    return TriedModels(asked, answer, not_tried, coefficients)


def try_again(
    whole: FullFit,
    harmonics: int,
    wanted: Wanted,
    resonators: tuple[ResonatorCoefficients | None, str | None],
    model: str,
) -> TriedVariant:
    """The answer of other runs of the same programme, for its checks alone.

    No harmonic in doubt is averaged over.

    Parameters
    ----------
    whole
        These runs fitted with everything free.
    harmonics
        Of 2mθ in the drift that each fold must leave.
    wanted
        What was fixed.
    resonators
        Their coefficients or None, and why there are none.
    model
        "auto", "all", or the name of one.

    Returns
    -------
    TriedVariant
        The answer.

    Raises
    ------
    HrgError
        The model that was named cannot be tried.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.variant_solutions import Wanted
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.trials import try_again
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> whole = Told(fitted=fitted, layout=layout, factors={})
    >>> try_again(whole, 0, Wanted(1, 0, seed=0), (None, None), "table").fits
    True
    """
    folds = choose_folds(whole.fitted, harmonics)[0]
    quick = replace(wanted, average=False)
    return try_models(whole, folds, quick, resonators, model, refused=False).answer


def _choose_names(
    model: str,
    names: Sequence[str],
    not_tried: Mapping[str, str],
    refused: bool,
    factors: Mapping[str, Any],
) -> list[str]:
    """The models that are tried. HrgError: the one that was named cannot be."""
    if model == "phase" and "phase" not in factors:
        raise HrgError(
            "model phase needs frequency_hz and a quadrature in every run, one is missing or not"
            " finite; estimate the runs again"
        )
    if model == "auto" and refused:
        return ["table"]
    if model in ("auto", "all"):
        return list(names)
    if model in not_tried:
        raise HrgError(f"model {model} cannot be tried: {not_tried[model]}")
    return [model]
