"""First look at a diagnosis: ranking of causes, gain, residuals before and after against everything."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from ...records import Array, Diagnosis
from ..json_text import as_float, child, entries, json_list, json_object
from .drawing import (
    INK,
    MUTED,
    SERIES,
    Plot,
    chosen,
    labels,
    legend,
    log_axis,
    note,
    number,
    panels,
    scatter_with_mean,
    time_unit,
)
from .forecast import forecast_plots


def diagnosis_plots(record: Diagnosis) -> list[Plot]:
    """Ranking of the causes found, the gain, and residuals before and after against θ, time, amplitude and temperature."""
    report = json_object(record.report)
    found = []
    if entries(report, "effects") or entries(report, "tested"):
        found.append(_ranking(report))
    if isinstance(report.get("gain"), dict):
        found.append(_gain(report))
    found += forecast_plots(report)
    if len(record):
        for k, name in enumerate(json_list(record.series)):
            if k < record.residual_before.shape[1]:
                found.append(_residuals(record, str(name), k))
    return found


def _ranking(report: dict[str, Any]) -> Plot:
    effects = [(str(e.get("name")), abs(as_float(e.get("z"))), 0) for e in entries(report, "effects")]
    named = {name for name, _, _ in effects}
    tested = sorted(
        ((str(e.get("name")), abs(as_float(e.get("z"))), 5) for e in entries(report, "tested") if str(e.get("name")) not in named),
        key=lambda e: -np.nan_to_num(e[1]),
    )
    rows = (effects + tested)[:24]
    figure, axes = panels(1, 1, height=0.8 + 0.24 * len(rows))
    ax = axes[0, 0]
    values = np.array([np.nan_to_num(z) for _, z, _ in rows])
    ax.barh(range(len(rows)), np.maximum(values, 1e-3), color=[SERIES[c] for _, _, c in rows], height=0.65)
    if values.max(initial=1.0) > 50:
        ax.set_xscale("log")
        ax.set_xlim(0.3, values.max() * 3)
        log_axis(ax.xaxis)
    else:
        ax.set_xlim(0, max(5.0, values.max(initial=1.0)) * 1.15)
    for i, z in enumerate(values):
        ax.annotate(number(float(z), 3), (max(z, ax.get_xlim()[0]), i), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8)
    ax.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    ax.invert_yaxis()
    labels(ax, x="|z|, standard deviations")
    note(ax, "blue: found, in the order found; grey: tested, not found")
    words = f"Verdict: {report.get('verdict')}. "
    words += "Found: " + ", ".join(f"{n} at {number(z, 3)} σ" for n, z, _ in effects) + ". " if effects else "No cause was found. "
    words += f"Tested and not found: {chosen([f'{n} {number(z, 2)} σ' for n, z, _ in tested], 8)}." if tested else ""
    return Plot("ranking", "Causes by significance", words, figure)


def _gain(report: dict[str, Any]) -> Plot:
    gain = report["gain"]
    figure, axes = panels(1, 2, height=2.1, width=7.2)
    held = str(gain.get("held_out", "data"))
    said = []
    for ax, before, after, label, colour in (
        (
            axes[0, 0],
            as_float(child(report, "baseline").get("chi2_per_dof")),
            as_float(child(report, "after").get("chi2_per_dof")),
            "χ² a degree of freedom",
            4,
        ),
        (axes[0, 1], as_float(gain.get("before")), as_float(gain.get("after")), f"residual on held-out {held}", 2),
    ):
        values = [before, after]
        ax.bar([0, 1], np.nan_to_num(values), color=[MUTED, SERIES[colour]], width=0.55)
        ax.set_xticks([0, 1], ["before", "after"])
        top = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
        ax.set_ylim(0, top * 1.18 or 1.0)
        ax.yaxis.set_major_locator(MaxNLocator(5))
        for i, value in enumerate(values):
            ax.annotate(number(value), (i, np.nan_to_num(value)), xytext=(0, 3), textcoords="offset points", ha="center", fontsize=8.5)
        labels(ax, y=label)
        said.append(f"{label} {number(before)} before and {number(after)} after")
    if np.isfinite(as_float(gain.get("ratio"))):
        note(axes[0, 1], f"ratio {number(as_float(gain.get('ratio')), 3)} ± {number(as_float(gain.get('std')), 2)}")
        said.append(f"ratio {number(as_float(gain.get('ratio')), 3)} ± {number(as_float(gain.get('std')), 2)}")
    return Plot("gain", "Gain of the extended model", "; ".join(said) + ".", figure)


def _residuals(record: Diagnosis, name: str, k: int) -> Plot:
    before, after = np.asarray(record.residual_before)[:, k], np.asarray(record.residual_after)[:, k]
    factor, unit = time_unit(float(np.ptp(record.time_s)))
    against: list[tuple[str, Array]] = [
        ("θ modulo 180°", np.degrees(np.asarray(record.wave_angle_rad)) % 180),
        (f"time, {unit}", np.asarray(record.time_s) * factor),
        ("a_A", np.asarray(record.main_amplitude)),
    ]
    for values, label, scale in ((record.temperature_degc, "T, °C", 1.0), (record.rate_rad_s, "Ω, °/s", np.degrees(1.0))):
        if values is not None and np.nanmax(values) > np.nanmin(values):
            against.append((label, np.asarray(values) * scale))
    figure, axes = panels(1, len(against), height=2.3, width=8.2, sharey=True)
    for ax, (label, x) in zip(axes[0], against):
        scatter_with_mean(ax, x, before, 1, "before")
        scatter_with_mean(ax, x, after, 0, "after")
        ax.axhline(0, color=INK, lw=0.5)
        labels(ax, x=label)
    both = np.concatenate([before, after])
    low, high = np.nanpercentile(both, [0.5, 99.5])
    if high > low:
        axes[0, 0].set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    axes[0, 0].set_ylabel("residual, σ")
    legend(axes[0, -1], above=True)
    rms = [float(np.sqrt(np.nanmean(r**2))) for r in (before, after)]
    words = f"Whitened residual of {name}: {number(rms[0])} σ rms before, {number(rms[1])} σ rms after the extended model."
    return Plot(f"residual-{k}", f"Residual of {name} before and after", words, figure)
