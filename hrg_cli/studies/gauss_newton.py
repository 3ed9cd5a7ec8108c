"""The two numerical experiments of seed B on the convergence of its Gauss–Newton iteration (2), and
the closed form beside them.

First experiment: A, B uniform in [−1, 1], all angles in [0, 2π), start x = 0. Second, the working
gyro: A in 0.5 ± 0.1, B, φ, ψ in ± 0.1, θ in [0, 2π), start (0.5, 0, θ + δ, 0, 0) with δ in ± 0.1.
An iteration ends when √(Σr²/8) ≤ 1e-6; residual evaluations are counted. These choices, and A and B
fresh in the angle steps, are those that give the paper's figures (PHYSICS §3).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from ..fitting.ellipse.closed_form import solve_closed_form
from ..fitting.ellipse.gauss_newton import make_step, solve_gauss_newton
from ..physics.signals import make_signals

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
CHUNK_VECTORS = 100_000
MOST_EVALUATIONS = 60
TOLERANCE = 1e-6
TITLES = {
    "random_start_zero": "first experiment: any wave, start 0",
    "near_start": "second experiment: start near the solution",
}


def gauss_newton_study(
    *,
    vectors: Annotated[int, Field(ge=1, description="random vectors an experiment")] = 1_000_000,
    seed: Annotated[int, Field(ge=0, description="seed of the random numbers")] = 2022,
) -> dict[str, Any]:
    """Both numerical experiments of seed B on the convergence of its Gauss–Newton iteration.

    Parameters
    ----------
    vectors
        Random vectors an experiment.
    seed
        Of the random numbers.

    Returns
    -------
    dict
        Experiment -> mean, most, failures, the share that converges monotonously, a histogram
        (residual evaluations -> vectors) and the closed form; the misfit by iteration of two cases.

    Examples
    --------
    The closed form needs no iteration and never fails:

    >>> from hrg_cli.studies.gauss_newton import gauss_newton_study
    >>> found = gauss_newton_study(vectors=200, seed=1)
    >>> (
    ...     found["random_start_zero"]["closed_form"]["failures"],
    ...     sum(found["near_start"]["histogram"].values()),
    ... )
    (0, 200)
    """
    generator = np.random.default_rng(seed)
    first = _experiment(_random_waves, vectors, generator)
    second = _experiment(_working_gyro, vectors, generator)
    cases = {"non_monotone": first.pop("slowest"), "monotone": second.pop("slowest")}
    return {
        "vectors": vectors,
        "seed": seed,
        "random_start_zero": first,
        "near_start": second,
        "cases": cases,
    }


def _random_waves(n: int, generator: np.random.Generator) -> tuple[Array, Array]:
    """True vectors and starts (n, 5) of the first experiment."""
    x = np.column_stack([generator.uniform(-1, 1, (n, 2)), generator.uniform(0, 2 * np.pi, (n, 3))])
    return x, np.zeros_like(x)


def _working_gyro(n: int, generator: np.random.Generator) -> tuple[Array, Array]:
    """True vectors and starts (n, 5) of the second experiment."""
    x = np.column_stack(
        [0.5 + generator.uniform(-0.1, 0.1, n), generator.uniform(-0.1, 0.1, (n, 4))]
    )
    x[:, 2] = generator.uniform(0, 2 * np.pi, n)
    start = np.zeros_like(x)
    start[:, 0], start[:, 2] = 0.5, x[:, 2] + generator.uniform(-0.1, 0.1, n)
    return x, start


def _experiment(draw: Any, vectors: int, generator: np.random.Generator) -> dict[str, Any]:
    counts = np.zeros(MOST_EVALUATIONS + 1, int)
    failures = monotone = closed_failures = 0
    closed_worst, most, slowest = 0.0, 0, [0.0]
    for first in range(0, vectors, CHUNK_VECTORS):
        x, start = draw(min(CHUNK_VECTORS, vectors - first), generator)
        z = make_signals(x)
        found = solve_gauss_newton(
            z,
            start,
            residual_tolerance=TOLERANCE,
            step_tolerance=0.0,
            max_iterations=MOST_EVALUATIONS,
        )
        done = found.evaluations > 0
        counts += np.bincount(found.evaluations[done], minlength=MOST_EVALUATIONS + 1)
        failures += int((~done).sum())
        monotone += int(found.monotone.sum())
        worst = int(np.argmax(found.evaluations))
        if found.evaluations[worst] > most:
            most, slowest = int(found.evaluations[worst]), _misfits(z[worst], start[worst])
        misfit = np.sqrt(((make_signals(solve_closed_form(z)[0]) - z) ** 2).mean(axis=1))
        closed_failures += int((misfit > TOLERANCE).sum())
        closed_worst = max(closed_worst, float(misfit.max()))
    evaluations = np.arange(len(counts))
    total = max(1, int(counts.sum()))
    mean = float((counts * evaluations).sum() / total)
    variance = float((counts * (evaluations - mean) ** 2).sum() / total)
    return {
        "mean": mean,
        "mean_std": float(np.sqrt(variance / total)),
        "max": most,
        "failures": failures,
        "monotone_fraction": monotone / vectors,
        "histogram": {str(k): int(n) for k, n in enumerate(counts) if n},
        "closed_form": {
            "iterations": 0,
            "failures": closed_failures,
            "worst_residual_rms": closed_worst,
        },
        "slowest": slowest,
    }


def _misfits(z: Array, start: Array) -> list[float]:
    """√(Σr²/8) at the start and after every iteration of (2), until it is within the tolerance; z
    (8), start (5)."""
    x, out = start[None], []
    for _ in range(MOST_EVALUATIONS):
        out.append(float(np.sqrt(((z - make_signals(x)[0]) ** 2).sum() / 8)))
        if out[-1] <= TOLERANCE:
            break
        x = make_step(z[None], x)
    return out


def tabulate(study: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The study as a table for a person.

    Parameters
    ----------
    study
        Of `gauss_newton_study`.

    Returns
    -------
    tuple
        Headings, and a row for the iteration and one for the closed form of each experiment.

    Examples
    --------
    >>> from hrg_cli.studies.gauss_newton import gauss_newton_study, tabulate
    >>> [row[1] for row in tabulate(gauss_newton_study(vectors=200, seed=1))[1]]
    ['Gauss–Newton', 'closed form', 'Gauss–Newton', 'closed form']
    """
    rows: list[tuple[Any, ...]] = []
    for name, title in TITLES.items():
        result = study[name]
        counts = ", ".join(f"{k}: {n}" for k, n in result["histogram"].items())
        spread = f"{result['mean']:.3f} ± {result['mean_std']:.3f}"
        rows.append(
            (
                title,
                "Gauss–Newton",
                spread,
                result["max"],
                result["failures"],
                f"{result['monotone_fraction']:.3f}",
                counts,
            )
        )
        rows.append((title, "closed form", 0, 0, result["closed_form"]["failures"], "", ""))
    return (
        "experiment",
        "solver",
        "mean evaluations",
        "most",
        "failures",
        "monotone",
        "evaluations: vectors",
    ), rows


def draw_figure(study: dict[str, Any]) -> Figure:
    """Histograms of the iterations above, the misfit by iteration of two cases below.

    Parameters
    ----------
    study
        Of `gauss_newton_study`.

    Returns
    -------
    matplotlib.figure.Figure
        Four panels.

    Examples
    --------
    >>> from hrg_cli.studies.gauss_newton import draw_figure, gauss_newton_study
    >>> len(draw_figure(gauss_newton_study(vectors=200, seed=1)).axes)
    4
    """
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(10, 7), layout="constrained")
    axes = drawing.subplots(2, 2)
    for axis, name in zip(axes[0], TITLES, strict=True):
        result = study[name]
        evaluations = [int(k) for k in result["histogram"]]
        axis.bar(evaluations, list(result["histogram"].values()), color="0.4")
        axis.axvline(
            result["mean"],
            color="C1",
            label=f"mean {result['mean']:.3f}, max {result['max']}, failures {result['failures']}",
        )
        axis.margins(y=0.3)
        axis.set(yscale="log", xlabel="residual evaluations", ylabel="vectors", title=TITLES[name])
        axis.xaxis.get_major_locator().set_params(integer=True)
        axis.legend()
    for axis, (name, history) in zip(axes[1], study["cases"].items(), strict=True):
        axis.semilogy(range(1, len(history) + 1), history, "o-", color="0.3")
        axis.axhline(TOLERANCE, color="C1", linestyle="--", label="tolerance")
        axis.set(
            xlabel="residual evaluation",
            ylabel="residual rms",
            title=f"{name.replace('_', '-')} convergence",
        )
        axis.xaxis.get_major_locator().set_params(integer=True)
        axis.legend()
    return drawing
