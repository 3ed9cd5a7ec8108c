"""First look at a resonator (correlations, runs) and at a compensated rate (what is left, Allan
deviation)."""

from __future__ import annotations

import numpy as np

from ...fitting.tables.allan import compute_allan_deviation
from ...records import Array, Compensated, Resonator
from ...units import DEGREE_PER_HOUR
from ..figure_names import name_figure
from ..text import format_hundredths, format_number
from .drawing import (
    INK,
    SERIES,
    Plot,
    average_bins,
    choose_time_unit,
    draw_legend,
    draw_line,
    make_panels,
    note,
    say_spread,
    set_labels,
    set_log_axis,
)


def plot_resonator(record: Resonator) -> list[Plot]:
    """Correlations of a resonator's parameters, and how each run agrees.

    Parameters
    ----------
    record
        The resonator.

    Returns
    -------
    list of Plot
        Empty where one parameter alone is known.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.reporting.figures.result import plot_resonator
    >>> found = Resonator(
    ...     name=np.array(["frequency_hz", "scale_factor"]), units=np.array(["Hz", "1"]),
    ...     value=np.array([5e3, 0.55]), std=np.array([1e-3, 1e-3]), covariance=1e-6 * np.eye(2),
    ... )
    >>> len(plot_resonator(found))
    1
    """
    found = []
    deviation = np.sqrt(np.clip(np.diag(record.covariance), 0, None))
    known = deviation > 0
    if known.sum() > 1:
        found.append(
            _correlation(
                [name_figure(str(n)) for n, k in zip(record.name, known) if k],
                record.covariance[np.ix_(known, known)],
            )
        )
    if record.run is not None and record.run_chi2_per_dof is not None and len(record.run):
        found.append(_runs(record))
    return found


def _correlation(names: list[str], covariance: Array) -> Plot:
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    n = len(names)
    figure, axes = make_panels(
        1, 1, height=min(6.5, 1.4 + 0.42 * n), width=min(8.2, 3.4 + 0.52 * n)
    )
    ax = axes[0, 0]
    ax.grid(False)
    image = ax.imshow(
        correlation, vmin=-1, vmax=1, cmap="RdBu_r", aspect="auto", interpolation="nearest"
    )
    for i in range(n):
        for j in range(n):
            value = float(correlation[i, j])
            ax.text(
                j,
                i,
                format_hundredths(value),
                ha="center",
                va="center",
                fontsize=7.5,
                color="#000001" if abs(value) < 0.6 else "#fffffe",
            )
    ax.set_xticks(range(n), names, rotation=38, ha="right")
    ax.set_yticks(range(n), names)
    figure.colorbar(image, ax=ax, label="correlation", shrink=0.9)
    pairs = sorted(
        ((abs(correlation[i, j]), i, j) for i in range(n) for j in range(i)), reverse=True
    )[:3]
    words = (
        "Correlation of the estimates; strongest: "
        + ", ".join(
            f"{names[i]} with {names[j]} {format_number(float(correlation[i, j]), 2)}"
            for _, i, j in pairs
        )
        + "."
    )
    return Plot("correlation", "Correlation of the parameters", words, figure)


def _runs(record: Resonator) -> Plot:
    assert record.run is not None and record.run_chi2_per_dof is not None
    names, values = [str(r) for r in record.run], np.asarray(record.run_chi2_per_dof)
    figure, axes = make_panels(1, 1, height=2.3)
    ax = axes[0, 0]
    ax.bar(np.arange(len(names)), values, color=SERIES[0], width=0.65)
    ax.axhline(1, color=INK, lw=0.8, ls="--")
    step = max(1, -(-len(names) // 24))
    ax.set_xticks(
        np.arange(len(names))[::step],
        [n[:14] for n in names[::step]],
        rotation=38 if len(names) > 6 else 0,
        ha="right" if len(names) > 6 else "center",
    )
    set_labels(ax, x="run", y="χ² per degree of freedom")
    worst = int(np.nanargmax(values)) if np.isfinite(values).any() else 0
    words = (
        f"χ² per degree of freedom of {len(names)} runs: {say_spread(values)}; the worst is"
        f" {names[worst]}. One is expected of noise alone."
    )
    return Plot("runs", "How each run agrees with the fit", words, figure)


def plot_compensated(record: Compensated) -> list[Plot]:
    """The rate and what was left of it before and after the tables, and the Allan deviation.

    Parameters
    ----------
    record
        A compensated run.

    Returns
    -------
    list of Plot
        Empty of a single row.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.reporting.figures.result import plot_compensated
    >>> class Told(SimpleNamespace):
    ...     def __len__(self):
    ...         return 1
    >>> plot_compensated(Told())
    []
    """
    if len(record) < 2:
        return []
    found = [_compensated(record)]
    interval = float(np.median(np.diff(record.time_s)))
    series = [
        (np.asarray(y) / DEGREE_PER_HOUR, name, k)
        for k, (y, name) in enumerate(
            ((record.residual_before_rad_s, "before"), (record.residual_after_rad_s, "after"))
        )
        if y is not None and np.isfinite(y).all()
    ]
    if not series and np.isfinite(record.rate_estimate_rad_s).all():
        series = [(np.asarray(record.rate_estimate_rad_s) / DEGREE_PER_HOUR, "rate estimate", 0)]
    if series and len(record) >= 9 and interval > 0:
        found.append(_allan(series, interval))
    return found


def _compensated(record: Compensated) -> Plot:
    factor, unit = choose_time_unit(float(record.time_s[-1] - record.time_s[0]))
    known = record.residual_after_rad_s is not None
    figure, axes = make_panels(3 if known else 2, 1, height=1.75, sharex=True)
    time = np.asarray(record.time_s) * factor
    draw_line(axes[0, 0], time, np.degrees(np.asarray(record.rate_estimate_rad_s)), 0)
    set_labels(axes[0, 0], y="°/s", title="Rate estimate")
    draw_line(axes[1, 0], time, np.degrees(np.asarray(record.angle_estimate_rad)), 2)
    set_labels(axes[1, 0], y="°", title="Angle estimate")
    words = f"Rate estimate {say_spread(np.degrees(np.asarray(record.rate_estimate_rad_s)))} °/s"
    if known:
        ax = axes[2, 0]
        for y, name, k in (
            (record.residual_before_rad_s, "before", 1),
            (record.residual_after_rad_s, "after", 0),
        ):
            if y is not None:
                error = np.asarray(y) / DEGREE_PER_HOUR
                draw_line(ax, time, error, k, alpha=0.25, lw=0.6, points=700)
                ax.plot(
                    *average_bins(time, error, 120)[:2],
                    color=SERIES[k],
                    lw=1.4,
                    label=f"{name} the tables",
                )
                rms = float(np.sqrt(np.nanmean(np.square(y)))) / DEGREE_PER_HOUR
                words += f"; residual {name} {format_number(rms)} °/h rms"
        set_labels(ax, y="°/h", title="Rate error and its running mean")
        draw_legend(ax, above=True)
    axes[-1, 0].set_xlabel(f"time, {unit}")
    return Plot("compensated", "Rate after the tables", words + ".", figure)


def _allan(series: list[tuple[Array, str, int]], interval_s: float) -> Plot:
    figure, axes = make_panels(1, 1, height=3.0)
    ax = axes[0, 0]
    said = []
    for rate, name, k in series:
        tau, deviation, relative = compute_allan_deviation(rate, interval_s)
        ax.loglog(tau, deviation, "o-", ms=2.8, color=SERIES[1 - k], label=name)
        ax.fill_between(
            tau,
            deviation / (1 + relative),
            deviation * (1 + relative),
            color=SERIES[1 - k],
            alpha=0.18,
            lw=0,
        )
        best = int(np.argmin(deviation))
        said.append(
            f"{name}: {format_number(float(deviation[0]), 3)} °/h at"
            f" {format_number(float(tau[0]), 3)} s, lowest"
            f" {format_number(float(deviation[best]), 3)} °/h at"
            f" {format_number(float(tau[best]), 3)} s"
        )
    set_labels(ax, x="averaging time τ, s", y="Allan deviation, °/h")
    ax.grid(True, which="both")
    set_log_axis(ax.xaxis)
    set_log_axis(ax.yaxis)
    draw_legend(ax)
    note(ax, "band: ± standard error")
    return Plot("allan", "Allan deviation of the rate error", "; ".join(said) + ".", figure)
