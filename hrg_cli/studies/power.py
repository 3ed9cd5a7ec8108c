"""Power of a detector from draws: binomial intervals, the curve through named and not named, the
ideal detector's, and their figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
NINETY = 1.2815515655446004
"""Φ⁻¹(0.9)."""
WIDTHS = np.linspace(1.0, 3.0, 21)
"""Widths of the curve tried: an estimate scatters by one σ at least; several parameters and random
directions widen it."""


def compute_share(hits: int, tries: int) -> list[float | None]:
    """A binomial share with its 95 % interval (Clopper and Pearson, 1934).

    Parameters
    ----------
    hits
        Of the tries.
    tries
        How many.

    Returns
    -------
    list
        Share, low, high, tries; no share of no tries.

    Examples
    --------
    >>> from hrg_cli.studies.power import compute_share
    >>> share, low, high, tries = compute_share(0, 10)
    >>> share, low, round(high, 4), compute_share(0, 0)
    (0.0, 0.0, 0.3085, [None, 0.0, 1.0, 0])
    """
    from scipy.special import betaincinv

    if not tries:
        return [None, 0.0, 1.0, 0]
    low = float(betaincinv(hits, tries - hits + 1, 0.025)) if hits else 0.0
    high = float(betaincinv(hits + 1, tries - hits, 0.975)) if hits < tries else 1.0
    return [hits / tries, low, high, tries]


def compute_ideal(sizes: Sequence[float], false_alarm: float) -> dict[str, Any]:
    """Power of the best detector of one known effect (Neyman and Pearson, 1933): Φ(z − z_α).

    Parameters
    ----------
    sizes
        In σ.
    false_alarm
        Its rate α.

    Returns
    -------
    dict
        Chance by size, and the sizes that are seen in half and in 90 % of the draws.

    Examples
    --------
    >>> from hrg_cli.studies.power import compute_ideal
    >>> found = compute_ideal([0.0], 0.05)
    >>> round(found["chance"]["0"], 9), round(found["half"], 3)
    (0.05, 1.645)
    """
    from scipy.special import ndtr, ndtri

    threshold = float(-ndtri(false_alarm))
    return {
        "chance": {f"{s:g}": float(ndtr(s - threshold)) for s in sizes},
        "half": threshold,
        "ninety": threshold + NINETY,
    }


def fit_curve(draws: Sequence[tuple[float, bool]]) -> dict[str, Any]:
    """The curve Φ((z − half)/w) through what was named and what was not, by largest likelihood.

    Parameters
    ----------
    draws
        Size, and whether it was named.

    Returns
    -------
    dict
        Size named in half of the draws with its 95 % interval (likelihood ratio), and in 90 %; None
        beyond twice the largest size.

    Examples
    --------
    >>> from hrg_cli.studies.power import fit_curve
    >>> found = fit_curve([(2.0, False)] * 9 + [(4.0, False), (4.0, True)] * 9 + [(6.0, True)] * 9)
    >>> round(found["half"], 1)
    4.0
    """
    from scipy.special import log_ndtr

    size = np.array([s for s, _ in draws])
    sign = np.where([named for _, named in draws], 1.0, -1.0)
    end = 2 * float(size.max())
    half = np.linspace(0.05 * end, end, 400)
    levels = sorted(set(size.tolist()))
    level = np.zeros((len(half), len(WIDTHS)))
    for s in levels:
        for side in (1.0, -1.0):
            count = int(np.sum((size == s) & (sign == side)))
            level += count * log_ndtr(side * (s - half[:, None]) / WIDTHS)
    profile = level.max(axis=1)
    inside = half[profile > profile.max() - 1.92]
    k, j = np.unravel_index(int(np.argmax(level)), level.shape)
    if k == len(half) - 1:
        return {"half": None, "half_interval": [float(inside[0]), None], "ninety": None}
    interval = [float(inside[0]), float(inside[-1]) if inside[-1] < end else None]
    return {
        "half": float(half[k]),
        "half_interval": interval,
        "ninety": float(half[k] + NINETY * WIDTHS[j]),
    }


def compute_coverage(errors: Sequence[float]) -> dict[str, float | int | None]:
    """How honest standard deviations are: errors over σ.

    Parameters
    ----------
    errors
        In σ.

    Returns
    -------
    dict
        Their rms (1: honest), the share within 1.96, and how many; None of no errors.

    Examples
    --------
    >>> from hrg_cli.studies.power import compute_coverage
    >>> compute_coverage([1.0, -1.0, 3.0, -3.0])
    {'error_rms': 2.23606797749979, 'within_1_96': 0.5, 'errors': 4}
    """
    e = np.abs(np.asarray(errors, float))
    if not len(e):
        return {"error_rms": None, "within_1_96": None, "errors": 0}
    return {
        "error_rms": float(np.sqrt(np.mean(e**2))),
        "within_1_96": float(np.mean(e < 1.96)),
        "errors": len(e),
    }


def draw_figure(study: dict[str, Any]) -> Figure:
    """Power of all effects against size, the size of half power of each, and the confusion matrix.

    Parameters
    ----------
    study
        Of `diagnosis_study`.

    Returns
    -------
    matplotlib.figure.Figure
        Three panels.

    Examples
    --------
    >>> from hrg_cli.studies.diagnosis import assemble
    >>> from hrg_cli.studies.power import draw_figure
    >>> nothing = dict(group=[], outcome="nothing", errors={}, limit_holds=None, draw=0)
    >>> rows = [dict(hidden="gain_mismatch", size=size, **nothing) for size in (3.0, 6.0)]
    >>> len(draw_figure(assemble(rows, [3.0, 6.0])).axes) >= 3
    True
    """
    from matplotlib.figure import Figure

    names = list(study["effects"])
    drawing = Figure(figsize=(19, 3 + 0.25 * max(12, len(names))), layout="constrained")
    power, halves, matrix = drawing.subplots(1, 3, width_ratios=(1, 0.8, 1.6))
    _power(power, study)
    _halves(halves, study, names)
    _matrix(matrix, study, names)
    return drawing


def _power(axes: Any, study: dict[str, Any]) -> None:
    from scipy.special import ndtr

    sizes, best = study["sizes"], study["ideal"]
    for figures in study["effects"].values():
        at = [s for s in sizes if f"{s:g}" in figures["named"]]
        axes.plot(
            at, [figures["named"][f"{s:g}"][0] for s in at], color="0.8", linewidth=0.8, zorder=0
        )
    pooled = np.array([study["all"]["named"].get(f"{s:g}", [np.nan] * 4)[:3] for s in sizes], float)
    around = np.abs(pooled[:, 1:] - pooled[:, :1]).T
    axes.errorbar(
        sizes,
        pooled[:, 0],
        around,
        color="C0",
        marker="o",
        capsize=3,
        label="diagnosis, all effects",
    )
    fine = np.linspace(0.5 * min(sizes), max(sizes), 200)
    axes.plot(
        fine, ndtr(fine - best["half"]), color="C1", label="ideal detector of one known effect"
    )
    axes.set(
        xlabel="size, σ of an ideal detector",
        ylabel="chance of being named",
        ylim=(-0.02, 1.02),
        title="grey: every effect",
    )
    axes.legend(loc="lower right")


def _halves(axes: Any, study: dict[str, Any], names: list[str]) -> None:
    for row, name in enumerate(names):
        figures = study["effects"][name]
        if figures["half"] is None:
            continue
        low, high = figures["half_interval"]
        axes.plot(
            [low, high if high is not None else 2 * max(study["sizes"])],
            [row, row],
            color="C0",
            linewidth=1,
        )
        axes.plot(figures["half"], row, "o", color="C0", markersize=4)
        axes.plot(figures["ninety"], row, "|", color="C0")
    axes.axvline(study["ideal"]["half"], color="C1")
    axes.axvline(study["ideal"]["ninety"], color="C1", linestyle=":")
    axes.set_yticks(range(len(names)), names)
    axes.set(ylim=(len(names) - 0.5, -0.5), xlim=(0, max(study["sizes"])))
    axes.set(xlabel="size/σ named in half (•) and 90 % (|) of the draws; lines: ideal")


def _matrix(axes: Any, study: dict[str, Any], names: list[str]) -> None:
    confusion = study["confusion"]
    named = list(dict.fromkeys([*names, *(k for row in confusion.values() for k in row)]))
    shares = np.array([[confusion[a].get(b, 0.0) for b in named] for a in names])
    image = axes.imshow(shares, cmap="Greys", vmin=0, vmax=1, aspect="auto")
    axes.set_xticks(range(len(named)), named, rotation=90)
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel="named", ylabel="hidden", title="where an ideal detector is sure")
    axes.figure.colorbar(image, ax=axes, label="share")
