"""First look at results: resonator, calibration (maps, harmonics, ladder), compensated rate and diagnosis."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from matplotlib.ticker import MaxNLocator

from ..records import Array, Calibration, Compensated, Diagnosis, Resonator
from ..units import DEGREE_PER_HOUR
from .allan import allan_deviation
from .figures import INK, MUTED, SERIES, Plot, chosen, labels, legend, line, log_axis, note, number, panels, scatter_with_mean, spread, time_unit


def json_object(text: str) -> dict[str, Any]:
    """A record's JSON text as an object; anything else is an empty one."""
    value = _json(text)
    return value if isinstance(value, dict) else {}


def json_list(text: str) -> list[Any]:
    """A record's JSON text as a list; anything else is an empty one."""
    value = _json(text)
    return value if isinstance(value, list) else []


def _json(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def entries(report: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The objects in a list of a JSON object."""
    value = report.get(key)
    return [e for e in value if isinstance(e, dict)] if isinstance(value, list) else []


def child(report: dict[str, Any], key: str) -> dict[str, Any]:
    """The object of that key, or an empty one."""
    value = report.get(key)
    return value if isinstance(value, dict) else {}


# ---------------------------------------------------------------- resonator


def resonator_plots(record: Resonator) -> list[Plot]:
    """Correlations of the parameters, and how each run agrees."""
    found = []
    deviation = np.sqrt(np.clip(np.diag(record.covariance), 0, None))
    known = deviation > 0
    if known.sum() > 1:
        found.append(_correlation([str(n) for n, k in zip(record.name, known) if k], record.covariance[np.ix_(known, known)]))
    if record.run is not None and record.run_chi2_per_dof is not None and len(record.run):
        found.append(_runs(record))
    return found


def _correlation(names: list[str], covariance: Array) -> Plot:
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    n = len(names)
    figure, axes = panels(1, 1, height=min(6.5, 1.4 + 0.42 * n), width=min(8.2, 3.4 + 0.52 * n))
    ax = axes[0, 0]
    ax.grid(False)
    image = ax.imshow(correlation, vmin=-1, vmax=1, cmap="RdBu_r", aspect="auto", interpolation="nearest")
    for i in range(n):
        for j in range(n):
            value = float(correlation[i, j])
            ax.text(j, i, f"{value:.2f}".replace("-", "−"), ha="center", va="center", fontsize=7.5, color="#000001" if abs(value) < 0.6 else "#fffffe")
    ax.set_xticks(range(n), names, rotation=38, ha="right")
    ax.set_yticks(range(n), names)
    figure.colorbar(image, ax=ax, label="correlation", shrink=0.9)
    pairs = sorted(((abs(correlation[i, j]), i, j) for i in range(n) for j in range(i)), reverse=True)[:3]
    words = "Correlation of the estimates; strongest: " + ", ".join(f"{names[i]} with {names[j]} {number(float(correlation[i, j]), 2)}" for _, i, j in pairs) + "."
    return Plot("correlation", "Correlation of the parameters", words, figure)


def _runs(record: Resonator) -> Plot:
    assert record.run is not None and record.run_chi2_per_dof is not None
    names, values = [str(r) for r in record.run], np.asarray(record.run_chi2_per_dof)
    figure, axes = panels(1, 1, height=2.3)
    ax = axes[0, 0]
    ax.bar(np.arange(len(names)), values, color=SERIES[0], width=0.65)
    ax.axhline(1, color=INK, lw=0.8, ls="--")
    step = max(1, -(-len(names) // 24))
    ax.set_xticks(np.arange(len(names))[::step], [n[:14] for n in names[::step]], rotation=38 if len(names) > 6 else 0, ha="right" if len(names) > 6 else "center")
    labels(ax, x="run", y="χ² a degree of freedom")
    worst = int(np.nanargmax(values)) if np.isfinite(values).any() else 0
    words = f"χ² a degree of freedom of {len(names)} runs: {spread(values)}; the worst is {names[worst]}. One is expected of noise alone."
    return Plot("runs", "How each run agrees with the fit", words, figure)


# ---------------------------------------------------------------- calibration


def calibration_plots(record: Calibration) -> list[Plot]:
    """Maps of D and K, their harmonics with σ, and the ladder."""
    mean = float(np.nanmean(record.scale_factor_harmonics[:, 0])) or 1.0
    found = [
        _map(record, record.drift_rad_s / DEGREE_PER_HOUR, record.drift_rad_s_std / DEGREE_PER_HOUR, "D", "drift D, °/h", "drift-map"),
        _map(record, (record.scale_factor / mean - 1) * 1e6, record.scale_factor_std / abs(mean) * 1e6, "K", f"K/{number(mean, 6)} − 1, ppm", "scale-factor-map"),
        _harmonics(record, mean),
    ]
    ladder = entries(json_object(record.details), "ladder")
    if ladder:
        found.append(_ladder(ladder))
    return found


def _node_axis(record: Calibration) -> str:
    return "temperature, °C" if record.axis == "temperature" else "frequency, Hz"


def _map(record: Calibration, values: Array, deviation: Array, symbol: str, label: str, key: str) -> Plot:
    node, angle = np.asarray(record.node), np.degrees(np.asarray(record.wave_angle_rad))
    several = len(node) > 1
    figure, axes = panels(1, 2 if several else 1, height=2.9, width=8.2 if several else 7.2)
    ax = axes[0, 0]
    picked = np.unique(np.linspace(0, len(node) - 1, min(5, len(node))).round().astype(int))
    for k, i in enumerate(picked):
        colour = SERIES[k % len(SERIES)]
        ax.plot(angle, values[i], color=colour, label=f"{number(float(node[i]), 6)} {'°C' if record.axis == 'temperature' else 'Hz'}")
        ax.fill_between(angle, values[i] - deviation[i], values[i] + deviation[i], color=colour, alpha=0.2, lw=0)
    labels(ax, x="wave angle θ, °", y=label, title=f"{symbol} against θ with ±σ")
    ax.margins(y=0.12)
    legend(ax, fontsize=7.5)
    if several:
        shade = axes[0, 1]
        shade.grid(False)
        order = np.argsort(node)
        centre = float(np.nanmedian(values))
        span = float(np.nanmax(np.abs(values - centre))) or 1.0
        mesh = shade.pcolormesh(
            angle, node[order], values[order], cmap="RdBu_r", vmin=centre - span, vmax=centre + span, shading="gouraud" if len(angle) > 1 else "nearest", rasterized=True
        )
        shade.plot(np.full(len(node), angle[0]), node, "_", color=MUTED, ms=6, clip_on=False)
        figure.colorbar(mesh, ax=shade, label=label)
        labels(shade, x="wave angle θ, °", y=_node_axis(record), title=f"Map of {symbol}")
    low, high = np.unravel_index(np.nanargmin(values), values.shape), np.unravel_index(np.nanargmax(values), values.shape)
    words = (
        f"{label} over {len(node)} nodes ({_node_axis(record)} {spread(node)}) and {len(angle)} angles: lowest {number(float(values[low]))} at {number(float(angle[low[1]]), 3)}°, "
        f"highest {number(float(values[high]))} at {number(float(angle[high[1]]), 3)}°; median σ {number(float(np.nanmedian(deviation)), 2)}."
    )
    return Plot(key, f"{'Drift' if symbol == 'D' else 'Scale factor'} {symbol} against wave angle and {record.axis}", words, figure)


def _harmonics(record: Calibration, mean: float) -> Plot:
    figure, axes = panels(2, 1, height=2.3)
    said = []
    parts = (
        (record.drift_harmonics / DEGREE_PER_HOUR, record.drift_harmonics_std / DEGREE_PER_HOUR, "D, °/h", 0),
        (record.scale_factor_harmonics[:, 1:] / mean * 1e6, record.scale_factor_harmonics_std[:, 1:] / abs(mean) * 1e6, "K, ppm", 1),
    )
    for ax, (values, deviation, label, first) in zip(axes[:, 0], parts):
        names = _harmonic_names(values.shape[1] + first, record.mode_number)[first:]
        nodes = np.unique(np.linspace(0, len(values) - 1, min(5, len(values))).round().astype(int))
        for k, i in enumerate(nodes):
            at = np.arange(len(names)) + (k - (len(nodes) - 1) / 2) * 0.13
            ax.errorbar(at, values[i], deviation[i], fmt="o", ms=3.2, lw=1.1, capsize=2, color=SERIES[k % len(SERIES)], label=number(float(record.node[i]), 6))
        ax.axhline(0, color=INK, lw=0.5)
        ax.set_xticks(range(len(names)), names)
        labels(ax, y=label, title=f"Harmonics of {label[0]} with ±σ")
        middle = values[len(values) // 2]
        sigma = deviation[len(values) // 2]
        said.append(f"{label}: " + ", ".join(f"{n} {number(float(v), 3)} ± {number(float(s), 2)}" for n, v, s in zip(names, middle, sigma)))
    if len(record.node) > 1:
        axes[0, 0].legend(title=_node_axis(record), title_fontsize=8, fontsize=7.5, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return Plot("harmonics", "Harmonics with σ", f"At the middle node: {'; '.join(said)}.", figure)


def _harmonic_names(count: int, mode: int) -> list[str]:
    return ["constant"] + [f"{'cos' if k % 2 else 'sin'} {2 * mode * ((k + 1) // 2)}θ" for k in range(1, count)]


def _ladder(steps: list[dict[str, Any]]) -> Plot:
    names = [str(step.get("stage", i + 1)) for i, step in enumerate(steps)]
    figure, axes = panels(1, 2, height=0.9 + 0.3 * len(steps), width=8.2, sharey=True)
    columns = (
        ("drift_rms_rad_s", "drift left, °/h rms", 1 / DEGREE_PER_HOUR),
        ("scale_factor_rms_ppm", "scale factor left, ppm rms", 1.0),
    )
    said = []
    for ax, (key, label, factor), colour in zip(axes[0], columns, SERIES):
        values = np.array([_float(step.get(key)) for step in steps]) * factor
        shown = np.nan_to_num(values)
        ax.barh(range(len(steps)), shown, color=colour, height=0.6)
        finite = shown[shown > 0]
        if len(finite) and finite.max() > 20 * finite.min():
            ax.set_xscale("log")
            ax.set_xlim(finite.min() / 3, finite.max() * 6)
            log_axis(ax.xaxis)
        else:
            ax.set_xlim(0, (finite.max() if len(finite) else 1) * 1.25)
        for i, value in enumerate(values):
            ax.annotate(number(float(value), 3), (shown[i] if shown[i] > 0 else ax.get_xlim()[0], i), xytext=(4, 0), textcoords="offset points", va="center", fontsize=8)
        labels(ax, x=label)
        said.append(f"{label}: " + ", ".join(f"{n} {number(float(v), 3)}" for n, v in zip(names, values)))
    axes[0, 0].set_yticks(range(len(steps)), names)
    axes[0, 0].invert_yaxis()
    return Plot("ladder", "Ladder: what each step of the calibration leaves", ". ".join(said) + ".", figure)


def _float(value: Any) -> float:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else float("nan")


# ---------------------------------------------------------------- compensated


def compensated_plots(record: Compensated) -> list[Plot]:
    """The rate and what was left of it before and after the tables, and the Allan deviation."""
    if len(record) < 2:
        return []
    found = [_compensated(record)]
    interval = float(np.median(np.diff(record.time_s)))
    series = [
        (np.asarray(y) / DEGREE_PER_HOUR, name, k)
        for k, (y, name) in enumerate(((record.residual_before_rad_s, "before"), (record.residual_after_rad_s, "after")))
        if y is not None and np.isfinite(y).all()
    ]
    if not series and np.isfinite(record.rate_estimate_rad_s).all():
        series = [(np.asarray(record.rate_estimate_rad_s) / DEGREE_PER_HOUR, "rate estimate", 0)]
    if series and len(record) >= 9 and interval > 0:
        found.append(_allan(series, interval))
    return found


def _compensated(record: Compensated) -> Plot:
    factor, unit = time_unit(float(record.time_s[-1] - record.time_s[0]))
    known = record.residual_after_rad_s is not None
    figure, axes = panels(3 if known else 2, 1, height=1.75, sharex=True)
    time = np.asarray(record.time_s) * factor
    line(axes[0, 0], time, np.degrees(np.asarray(record.rate_estimate_rad_s)), 0)
    labels(axes[0, 0], y="°/s", title="Rate estimate")
    line(axes[1, 0], time, np.degrees(np.asarray(record.angle_estimate_rad)), 2)
    labels(axes[1, 0], y="°", title="Angle estimate")
    words = f"Rate estimate {spread(np.degrees(np.asarray(record.rate_estimate_rad_s)))} °/s"
    if known:
        ax = axes[2, 0]
        for y, name, k in ((record.residual_before_rad_s, "before", 1), (record.residual_after_rad_s, "after", 0)):
            if y is not None:
                line(ax, time, np.asarray(y) / DEGREE_PER_HOUR, k, f"{name} the tables")
                words += f"; residual {name} {number(float(np.sqrt(np.nanmean(np.square(y)))) / DEGREE_PER_HOUR)} °/h rms"
        labels(ax, y="°/h", title="Rate error")
        legend(ax, above=True)
    axes[-1, 0].set_xlabel(f"time, {unit}")
    return Plot("compensated", "Rate after the tables", words + ".", figure)


def _allan(series: list[tuple[Array, str, int]], interval_s: float) -> Plot:
    figure, axes = panels(1, 1, height=3.0)
    ax = axes[0, 0]
    said = []
    for rate, name, k in series:
        tau, deviation, relative = allan_deviation(rate, interval_s)
        ax.loglog(tau, deviation, "o-", ms=2.8, color=SERIES[1 - k], label=name)
        ax.fill_between(tau, deviation / (1 + relative), deviation * (1 + relative), color=SERIES[1 - k], alpha=0.18, lw=0)
        best = int(np.argmin(deviation))
        said.append(f"{name}: {number(float(deviation[0]), 3)} °/h at {number(float(tau[0]), 3)} s, lowest {number(float(deviation[best]), 3)} °/h at {number(float(tau[best]), 3)} s")
    labels(ax, x="averaging time τ, s", y="Allan deviation, °/h")
    ax.grid(True, which="both")
    log_axis(ax.xaxis)
    log_axis(ax.yaxis)
    legend(ax)
    note(ax, "band: ± standard error")
    return Plot("allan", "Allan deviation of the rate error", "; ".join(said) + ".", figure)


# ---------------------------------------------------------------- diagnosis


def diagnosis_plots(record: Diagnosis) -> list[Plot]:
    """Ranking of the causes found, the gain, and residuals before and after against θ, time, amplitude and temperature."""
    report = json_object(record.report)
    found = []
    if entries(report, "effects") or entries(report, "tested"):
        found.append(_ranking(report))
    if isinstance(report.get("gain"), dict):
        found.append(_gain(report))
    if len(record):
        for k, name in enumerate(json_list(record.series)):
            if k < record.residual_before.shape[1]:
                found.append(_residuals(record, str(name), k))
    return found


def _ranking(report: dict[str, Any]) -> Plot:
    effects = [(str(e.get("name")), abs(_float(e.get("z"))), 0) for e in entries(report, "effects")]
    named = {name for name, _, _ in effects}
    tested = sorted(((str(e.get("name")), abs(_float(e.get("z"))), 5) for e in entries(report, "tested") if str(e.get("name")) not in named), key=lambda e: -np.nan_to_num(e[1]))
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
        (axes[0, 0], _float(child(report, "baseline").get("chi2_per_dof")), _float(child(report, "after").get("chi2_per_dof")), "χ² a degree of freedom", 4),
        (axes[0, 1], _float(gain.get("before")), _float(gain.get("after")), f"residual on held-out {held}", 2),
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
    if np.isfinite(_float(gain.get("ratio"))):
        note(axes[0, 1], f"ratio {number(_float(gain.get('ratio')), 3)} ± {number(_float(gain.get('std')), 2)}")
        said.append(f"ratio {number(_float(gain.get('ratio')), 3)} ± {number(_float(gain.get('std')), 2)}")
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
