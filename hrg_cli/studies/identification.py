"""Every identification method on the same simulated programmes: who is biased, who reaches the
Cramér–Rao bound, whose errors are honest.

A draw is a random gyro and a programme of six free run-downs (four angles at rest, two signs of
rotation), simulated from its second-order equations sample by sample with converter noise,
demodulated, estimated and identified. Errors are in units of each draw's own Cramér–Rao standard
deviation, those of axes modulo their period.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..physics.resonator import OF_GENERATOR
from ..records import Wave, collect
from ..stages.demodulate import demodulate
from ..stages.estimate import estimate
from ..stages.identify import identify
from ..stages.simulate import simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
PROGRAMME = ((0.0, 0.0), (0.4, 0.0), (0.8, 0.0), (1.2, 0.0), (0.2, 2.5), (0.6, -2.5))
"""Start angle [rad] after a random one, rate [rad/s]."""


def identification_study(
    *,
    draws: Annotated[int, Field(ge=2, description="simulated programmes")] = 200,
    noise: Annotated[
        float, Field(gt=0, le=0.3, description="noise of a sample, full amplitude 1")
    ] = 1e-3,
    quadrature: Annotated[float, Field(ge=0, le=1, description="|a_B/a_A| at the start")] = 0.05,
    frequency_hz: Annotated[float, Field(gt=0, description="oscillation frequency")] = 1003.7,
    duration_s: Annotated[float, Field(gt=0, description="length of a run")] = 3.0,
    methods: Annotated[
        Literal["all", "likelihood"], Field(description="every method, or the likelihood alone")
    ] = "all",
    seed: Annotated[int, Field(ge=0, description="seed of gyros and noise")] = 0,
) -> dict[str, Any]:
    """Bias, scatter and coverage of every identification method, over the Cramér–Rao bound of each
    draw.

    Parameters
    ----------
    draws
        Simulated programmes.
    noise
        Of a sample; the full amplitude is 1.
    quadrature
        |a_B/a_A| at the start.
    frequency_hz
        Of the oscillation.
    duration_s
        Of a run.
    methods
        "all", or "likelihood" alone.
    seed
        Of gyros and noise.

    Returns
    -------
    dict
        A row a method and parameter: bias and rms in Cramér–Rao deviations, how often its 68 and 95
        % intervals hold the truth [%], and the share of draws in which it answered.

    Examples
    --------
    >>> from hrg_cli.studies.identification import identification_study
    >>> found = identification_study(draws=2, duration_s=0.5, methods="likelihood")
    >>> len(found["rows"]), found["rows"][0]["answers"]
    (6, 1.0)
    """
    rng = np.random.default_rng(seed)
    errors: dict[tuple[str, str], list[tuple[float, float]]] = {}
    chi2 = []
    for draw in range(draws):
        device = _device(rng, frequency_hz)
        waves = _programme(device, rng, noise, quadrature, duration_s, seed=seed * 1_000_003 + draw)
        result = identify(waves, method=methods)
        details = _details(result.details)
        chi2.append(result.chi2_per_dof)
        bound = details["cramer_rao_std"]
        alone = [
            {
                "method": "likelihood",
                "parameters": {
                    n: {"value": v, "std": e} for n, (v, e, _) in result.parameters().items()
                },
            }
        ]
        for row in details.get("methods", alone):
            for name, cell in row["parameters"].items():
                if name in OF_GENERATOR:
                    error = _error(cell["value"], device[name], name)
                    errors.setdefault((row["method"], name), []).append(
                        (error / bound[name], error / cell["std"] if cell["std"] > 0 else np.inf)
                    )
    rows = [
        _row(method, name, np.array(values), draws) for (method, name), values in errors.items()
    ]
    return {
        "draws": draws,
        "seed": seed,
        "noise": noise,
        "quadrature": quadrature,
        "chi2_per_dof": float(np.mean(chi2)),
        "rows": rows,
    }


def _device(rng: np.random.Generator, frequency_hz: float) -> dict[str, float]:
    nu = float(rng.uniform(0.2, 0.6))
    return {
        "frequency_hz": frequency_hz,
        "damping_rate_1_s": nu,
        "damping_split_1_s": nu * float(rng.uniform(0.02, 0.15)),
        "damping_axis_rad": float(rng.uniform(0, np.pi / 2)),
        "frequency_split_rad_s": float(rng.uniform(0.1, 0.6)),
        "stiffness_axis_rad": float(rng.uniform(0, np.pi / 2)),
        "scale_factor": 0.554,
    }


def _programme(
    device: dict[str, float],
    rng: np.random.Generator,
    noise: float,
    quadrature: float,
    duration_s: float,
    seed: int,
) -> list[Wave]:
    """Waves of the six run-downs of one gyro, from simulated samples."""
    turn, sense = float(rng.uniform(0, np.pi / 2)), float(rng.choice([-1.0, 1.0]))
    table = {
        "frequency_hz": device["frequency_hz"],
        "time_constant_s": 1 / device["damping_rate_1_s"],
        "damping_split": device["damping_split_1_s"] / device["damping_rate_1_s"],
        **{
            k: device[k]
            for k in (
                "damping_axis_rad",
                "frequency_split_rad_s",
                "stiffness_axis_rad",
                "scale_factor",
            )
        },
    }
    runs = [
        {
            "run_id": str(i + 1),
            "start": {
                "wave_angle_rad": turn + angle,
                "quadrature": sense * quadrature,
                "phase_rad": float(rng.uniform(-3, 3)),
            },
            "environment": {"rate_rad_s": rate},
        }
        for i, (angle, rate) in enumerate(PROGRAMME)
    ]
    config = {
        "device": table,
        "readout": {"noise": noise},
        "recording": {
            "sample_rate_hz": 8 * round(device["frequency_hz"]) * 1.0,
            "duration_s": duration_s,
        },
        "run": runs,
    }
    waves = []
    for run in runs:
        recording = collect(simulate(config, run=str(run["run_id"]), seed=seed))
        waves.append(collect(estimate(collect(demodulate(recording, periods_per_window=8.0)))))
    return waves


def _details(text: str) -> dict[str, Any]:
    import json

    return dict(json.loads(text))


def _error(value: float, true: float, name: str) -> float:
    error = value - true
    return (
        float(np.mod(error + np.pi / 4, np.pi / 2) - np.pi / 4)
        if name.endswith("axis_rad")
        else error
    )


def _row(method: str, name: str, values: Array, draws: int) -> dict[str, Any]:
    in_bound, in_own = values[:, 0], np.abs(values[:, 1])
    return {
        "method": method,
        "parameter": name,
        "bias": float(np.median(in_bound)),
        "scatter": float(np.sqrt(np.mean(in_bound**2))),
        "coverage_68": float(100 * np.mean(in_own < 1.0)),
        "coverage_95": float(100 * np.mean(in_own < 1.96)),
        "answers": len(values) / draws,
    }


def tabulate(study: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The study as a table for a person.

    Parameters
    ----------
    study
        Of `identification_study`.

    Returns
    -------
    tuple
        Headings, and a row a method and parameter.

    Examples
    --------
    >>> from hrg_cli.studies.identification import tabulate
    >>> row = dict(method="likelihood", parameter="scale_factor", bias=0.01, scatter=1.02)
    >>> tabulate({"rows": [row | dict(coverage_68=68.0, coverage_95=95.0)]})[1]
    [('likelihood', 'scale_factor', '+0.01', '1.02', '68', '95')]
    """
    rows = [
        (
            r["method"],
            r["parameter"],
            f"{r['bias']:+.2f}",
            f"{r['scatter']:.2f}",
            f"{r['coverage_68']:.0f}",
            f"{r['coverage_95']:.0f}",
        )
        for r in study["rows"]
    ]
    return (
        "method",
        "parameter",
        "bias / bound",
        "scatter / bound",
        "68 % covers",
        "95 % covers",
    ), rows


def draw_figure(study: dict[str, Any]) -> Figure:
    """Scatter of every method and parameter over the Cramér–Rao bound, and how often its intervals
    hold the truth.

    Parameters
    ----------
    study
        Of `identification_study`.

    Returns
    -------
    matplotlib.figure.Figure
        Two panels.

    Examples
    --------
    >>> from hrg_cli.studies.identification import draw_figure
    >>> row = dict(method="likelihood", parameter="scale_factor", bias=0.01, scatter=1.02)
    >>> row |= dict(coverage_68=68.0, coverage_95=95.0)
    >>> len(draw_figure({"rows": [row], "draws": 9, "noise": 1e-3}).axes)
    2
    """
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(11, 6), layout="constrained")
    left, right = drawing.subplots(1, 2, sharey=True)
    methods = list(dict.fromkeys(r["method"] for r in study["rows"]))[::-1]
    for k, name in enumerate(OF_GENERATOR):
        rows = {r["method"]: r for r in study["rows"] if r["parameter"] == name}
        place = [methods.index(m) + 0.1 * (k - 2.5) for m in rows]
        left.plot(
            [r["scatter"] for r in rows.values()],
            place,
            "o",
            color=f"C{k}",
            label=name,
            markersize=4,
        )
        for key, fill in (("coverage_68", "none"), ("coverage_95", "full")):
            right.plot(
                [r[key] for r in rows.values()],
                place,
                "o",
                color=f"C{k}",
                markersize=4,
                fillstyle=fill,
            )
    scatters = [r["scatter"] for r in study["rows"]]
    left.set_xscale("log")
    left.set_xlim(min(0.5, 0.8 * min(scatters)), max(5.0, 1.5 * max(scatters)))
    left.axvline(1.0, color="0.5", linewidth=0.8)
    left.set_yticks(range(len(methods)), methods)
    left.set_ylim(-0.5, len(methods) - 0.5)
    left.set(
        xlabel="rms error / Cramér–Rao bound",
        title=f"{study['draws']} programmes, noise {study['noise']:g}",
    )
    for level in (68.3, 95.0):
        right.axvline(level, color="0.5", linewidth=0.8)
    right.set_xlim(0, 101)
    right.set(xlabel="truth inside the 68 % (open) and 95 % (full) interval, %")
    left.legend(fontsize=7)
    return drawing
