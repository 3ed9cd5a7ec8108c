"""Figures of the trade in the standards' words (IEEE Std 1431, 952): scale factor, bias over angle
and temperature, Allan deviation.

SI units and ppm; °/h and °/√h are for the screen. Rate figures are of input rate: drift divided by
the scale factor.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from ..errors import HrgError
from ..fitting.least_squares import fit_columns, solve
from ..fitting.tables.increments import AnglePath, build_path
from ..records import Calibration, Wave
from .calibration.interpolation import compute_corrections

Array = np.ndarray


def compute_calibration_figures(calibration: Calibration) -> dict[str, float]:
    """The figures of a data sheet that tables give: bias and scale factor over angle and
    temperature.

    Parameters
    ----------
    calibration
        The tables.

    Returns
    -------
    dict
        All of input rate [rad/s] or ppm of the scale factor: the mean; half the range over the
        angle at the worst node; half the range over temperature; residual figures on data held out,
        where they are told.

    Examples
    --------
    A drift of ±2 µrad/s over the angle at K = 0.5 is a bias of ±4 µrad/s:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.figures_of_merit import compute_calibration_figures
    >>> tables = Told(
    ...     drift_rad_s=[[2e-6, -2e-6]], scale_factor=[[0.5, 0.5]], details="{}", node=[20.0]
    ... )
    >>> found = compute_calibration_figures(tables)
    >>> found["bias_rad_s"], found["angle_dependent_bias_rad_s"], found["scale_factor_mean"]
    (0.0, 4e-06, 0.5)
    """
    drift, scale = np.asarray(calibration.drift_rad_s), np.asarray(calibration.scale_factor)
    bias = drift / scale
    mean = float(scale.mean())
    held = json.loads(calibration.details).get("figures", {})
    over_angle = bias.mean(axis=1)
    # a model without a constant term has no bias; its mean over the cells is their rounding
    over_angle[np.abs(over_angle) < 1e-12 * np.abs(bias).max()] = 0.0
    out = {
        "bias_rad_s": float(over_angle.mean()),
        "angle_dependent_bias_rad_s": float(np.ptp(bias, axis=1).max() / 2),
        "temperature_bias_rad_s": float(np.ptp(over_angle) / 2),
        "scale_factor_mean": mean,
        "scale_factor_angle_ppm": float(np.ptp(scale, axis=1).max() / 2 / mean * 1e6),
        "scale_factor_temperature_ppm": float(np.ptp(scale.mean(axis=1)) / 2 / mean * 1e6),
    }
    if len(calibration.node) > 1:
        slope = np.polyfit(np.asarray(calibration.node), scale.mean(axis=1), 1)[0]
        out["scale_factor_coefficient_ppm_per_node_unit"] = float(slope / mean * 1e6)
    for kind, name in (("drift", "bias_residual_rad_s"), ("scale", "scale_factor_residual_ppm")):
        value = held.get(kind, {}).get("held_out", {}).get("value")
        if value is not None:
            out[name] = float(value) / (mean if kind == "drift" else 1.0)
    return out


@dataclass(frozen=True)
class ScaleFactorFigures:
    """Straight line through (rate, output): error against the tables, asymmetry and nonlinearity in
    ppm, bias in rad/s of input rate."""

    scale_factor: float
    scale_factor_std: float
    bias_rad_s: float
    error_ppm: float
    asymmetry_ppm: float
    asymmetry_std_ppm: float
    nonlinearity_ppm: float
    rates_rad_s: list[float]
    residual_ppm: list[float]


def compute_scale_factor_figures(
    waves: Sequence[Wave | AnglePath],
    calibration: Calibration | None = None,
    *,
    temperatures_by: Calibration | None = None,
) -> ScaleFactorFigures:
    """Scale-factor error, asymmetry and nonlinearity of runs at several rates (IEEE Std 1431).

    The output of a run is −m·Δθ/Δt over whole periods of the wave angle, so that what depends on
    the angle averages out (runs that turn less are left out); with tables each run is compensated
    first, whole, measured part included, and the error is against 1. What K and the bias do over
    temperature is no nonlinearity: the means over the angle of `temperatures_by` are taken out of
    the outputs. Asymmetry: (K₊ − K₋)/mean, slopes of both signs with a common bias (NaN where too
    few rates tell it from the bias). Nonlinearity: largest residual from the line over the largest
    rate (NaN with two rates).

    Parameters
    ----------
    waves
        The runs, or their paths.
    calibration
        Tables by which they are compensated; None: raw outputs.
    temperatures_by
        Tables whose course over temperature is taken out of raw outputs.

    Returns
    -------
    ScaleFactorFigures
        The line and what departs from it.

    Raises
    ------
    HrgError
        Fewer rates than a line needs.

    Examples
    --------
    A gain 0.2 % larger to one side than to the other:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.figures_of_merit import compute_scale_factor_figures
    >>> def turn(rate):
    ...     t = np.arange(600.0)
    ...     return draw_path(rate, angle_rad=-(0.5 + 0.0005 * np.sign(rate)) * rate * t / 2)
    >>> found = compute_scale_factor_figures([turn(rate) for rate in (-0.4, -0.2, 0.2, 0.4)])
    >>> round(found.scale_factor, 9), round(found.asymmetry_ppm, 3)
    (0.5, 2000.0)
    """
    rates, outputs, errors = [], [], []
    for wave in waves:
        path = wave if isinstance(wave, AnglePath) else build_path(wave, harmonics=4)
        time, stop = path.interval_s, len(path)
        if calibration is not None:
            drift, scale = compute_corrections(calibration, path)
            turn = (path.turn - drift * time) / scale
        else:
            stop = _whole_periods(path)
            turn = path.turn
            if temperatures_by is not None:
                turn = _at_one_temperature(path, temperatures_by)
        if stop == 0:
            continue
        total = float(time[:stop].sum())
        rates.append(float(path.rotation[:stop].sum()) / total)
        outputs.append(-float(turn[:stop].sum()) / total)
        errors.append(np.sqrt(2 * np.mean(path.angle_variance)) * path.mode_number / total)
    return _line_through(
        np.array(rates), np.array(outputs), np.array(errors), compensated=calibration is not None
    )


def _whole_periods(path: AnglePath) -> int:
    """Increments of a run until the last whole period π/m of its wave angle; 0: it turns less."""
    period = np.pi / path.mode_number
    periods = np.floor(abs(path.angle_rad[-1] - path.angle_rad[0]) / period)
    if periods < 1:
        return 0
    travelled = np.abs(np.cumsum(np.diff(path.angle_rad))) / period
    return int(np.searchsorted(travelled, periods - 1e-9)) + 1


def _at_one_temperature(path: AnglePath, tables: Calibration) -> Array:
    """m·Δθ (n,) as it would be with the tables' mean K and mean bias at every temperature."""
    x = path.average_neighbours(path.find_abscissa(tables.axis))
    period = np.full(len(path), np.pi / tables.mode_number)
    drift, scale = tables.values_at(x, np.zeros(len(path)), period)  # their means over the angle
    mean_drift, mean_scale = (
        float(np.asarray(h)[:, 0].mean())
        for h in (tables.drift_harmonics, tables.scale_factor_harmonics)
    )
    return np.asarray(
        (path.turn - drift * path.interval_s) * mean_scale / scale + mean_drift * path.interval_s
    )


def _line_through(
    rate: Array, output: Array, errors: Array, *, compensated: bool
) -> ScaleFactorFigures:
    """The figures of (n,) rates and outputs, whose own errors are `errors`."""
    distinct = len(np.unique(np.round(rate / max(np.abs(rate).max(initial=0.0), 1e-300), 3)))
    if distinct < 2:
        raise HrgError(
            "the runs that turn through a period of the wave angle have one rate only: "
            "a scale factor needs at least two; add a run at another rate"
        )
    line = np.stack([rate, np.ones_like(rate)], axis=1)
    gain, offset = fit_columns(line, output)
    residual = output - line @ np.array([gain, offset])
    spread = float(np.sqrt(np.mean(errors**2)))
    std = spread / np.sqrt(np.sum((rate - rate.mean()) ** 2))
    asymmetry, asymmetry_std = _asymmetry(rate, output, spread, with_bias=not compensated)
    ppm = residual / (gain * np.abs(rate).max()) * 1e6
    reference = 1.0 if compensated else gain
    # two rates have a line through them, whatever the gyro does
    nonlinearity = float(np.abs(ppm).max()) if distinct > 2 else float("nan")
    return ScaleFactorFigures(
        float(gain), float(std), float(offset / gain), float((gain / reference - 1) * 1e6),
        asymmetry, asymmetry_std, nonlinearity, rate.tolist(), ppm.tolist(),
    )  # fmt: skip


def _asymmetry(
    rate: Array, output: Array, spread: float, *, with_bias: bool
) -> tuple[float, float]:
    """(K₊ − K₋)/mean in ppm with its standard deviation; NaN where the rates do not tell it.

    `with_bias`: beside a common bias; tables have taken that away.
    """
    halves = np.stack([np.maximum(rate, 0), np.minimum(rate, 0), np.ones_like(rate)], axis=1)
    if not with_bias:
        halves = halves[:, :2]
    columns = halves.shape[1]
    scaled = halves / np.abs(halves).max(axis=0, initial=1e-300)
    if np.linalg.matrix_rank(scaled, tol=1e-3) < columns:
        return float("nan"), float("nan")
    found, covariance = solve(halves, output)
    contrast = np.array([1.0, -1.0, 0.0])[:columns]
    std = spread * np.sqrt(contrast @ covariance @ contrast)
    mean = (found[0] + found[1]) / 2
    return float((found[0] - found[1]) / mean * 1e6), float(std / mean * 1e6)


def compute_trade_figures(
    calibration: Calibration, paths: Sequence[AnglePath]
) -> dict[str, float | None]:
    """The figures of a calibration that its JSON and its table show.

    Parameters
    ----------
    calibration
        The tables.
    paths
        The runs.

    Returns
    -------
    dict
        Name -> figure; None where the runs cannot tell.

    Examples
    --------
    Without runs at several rates nothing is said of asymmetry:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.figures_of_merit import compute_trade_figures
    >>> tables = Told(drift_rad_s=[[0.0]], scale_factor=[[0.5]], details="{}", node=[20.0])
    >>> found = compute_trade_figures(tables, [])
    >>> found["scale_factor_mean"], found["scale_factor_asymmetry_ppm"]
    (0.5, None)
    """
    out: dict[str, float | None] = {
        k: v if np.isfinite(v) else None
        for k, v in compute_calibration_figures(calibration).items()
    }
    names = ("error_ppm", "asymmetry_ppm", "nonlinearity_ppm")
    try:
        compensated = compute_scale_factor_figures(paths, calibration)
        raw = compute_scale_factor_figures(paths, temperatures_by=calibration)
    except HrgError:
        return out | {f"scale_factor_{name}": None for name in names}
    found = {
        "error_ppm": compensated.error_ppm,
        "asymmetry_ppm": raw.asymmetry_ppm,
        "nonlinearity_ppm": raw.nonlinearity_ppm,
    }
    return out | {
        f"scale_factor_{name}": value if np.isfinite(value) else None
        for name, value in found.items()
    }


@dataclass(frozen=True)
class AllanFigures:
    """Allan deviation of a rate with the coefficients of IEEE Std 952 annex C; one that is not told
    from zero is 0 (see `intervals`)."""

    time_s: Array
    deviation_rad_s: Array
    quantization_rad: float
    angle_random_walk_rad_sqrt_s: float
    bias_instability_rad_s: float
    rate_random_walk_rad_s_sqrt_s: float
    intervals: dict[str, dict[str, float]]
    """Name with its unit -> value, std, and low and high of the 95 % interval."""
    chi2_per_dof: float


ALLAN_UNITS = {
    "quantization": "rad",
    "angle_random_walk": "rad_sqrt_s",
    "bias_instability": "rad_s",
    "rate_random_walk": "rad_s_sqrt_s",
}


def compute_allan_figures(
    rate_rad_s: Array, interval_s: float, window_s: float = 0.0, bend_off_s: float = 0.0
) -> AllanFigures:
    """Overlapping Allan deviation of a rate and its coefficients (IEEE Std 952-1997, annex C).

    The coefficients are fitted with the covariance of the deviation's values (`fit_allan_terms`).

    Parameters
    ----------
    rate_rad_s
        Evenly spaced rates (n,), rad/s, at least 30 and all finite.
    interval_s
        Between them, s.
    window_s
        What each end's angle was averaged over, s.
    bend_off_s
        Of windows so long that stand for their middle.

    Returns
    -------
    AllanFigures
        Deviation, coefficients and their 95 % intervals; a coefficient that is not told from zero
        is 0.

    Raises
    ------
    HrgError
        Fewer than 30 values, or values that are not finite.

    Examples
    --------
    White noise of 0.001 rad/s each second is an angle random walk of 0.001 rad/√s:

    >>> import numpy as np
    >>> from hrg_cli.stages.figures_of_merit import compute_allan_figures
    >>> rate = 1e-3 * np.random.default_rng(1).normal(size=4000)
    >>> round(compute_allan_figures(rate, 1.0).angle_random_walk_rad_sqrt_s, 4)
    0.001
    """
    from ..fitting.tables.allan import compute_allan_deviation
    from ..fitting.tables.allan_terms import fit_allan_terms

    rate = np.asarray(rate_rad_s, float)
    if len(rate) < 30 or not np.isfinite(rate).all():
        raise HrgError(
            f"an Allan deviation needs at least 30 finite rates, {int(np.isfinite(rate).sum())} are"
            " there; a longer run is needed"
        )
    time, deviation, _ = compute_allan_deviation(rate, interval_s)
    found = fit_allan_terms(rate, interval_s, window_s, bend_off_s)
    intervals = {f"{name}_{ALLAN_UNITS[name]}": asdict(c) for name, c in found.coefficients.items()}
    q, n, b, k = (c.value for c in found.coefficients.values())
    return AllanFigures(time, deviation, q, n, b, k, intervals, found.chi2 / max(found.dof, 1))
