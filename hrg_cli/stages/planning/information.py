"""Plan, the Fisher information: what each feasible run tells of the base model and of every cause,
its own nuisances marginalised.

The run is made without noise by the slow engine, its sensitivities are those of the diagnosis; with
A = [base | causes] over σ and O the run's own columns (start state, frequency), M = Aᵀ(I − P_O)A.
Informations of runs add.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...effects.effect import Effect
from ...fitting.causes import designs, extended_fit, scales, whitened_rows
from ...fitting.causes.coordinate_priors import CoordinatePriors
from ...fitting.causes.design_columns import OWN
from ...fitting.causes.fit_point import Point
from ...fitting.causes.sensitivities import find_base_sensitivities, linearise_flow
from ...fitting.causes.slow_prediction import predict
from ...fitting.envelopes.coordinates import COUNT, from_mechanics
from ...fitting.least_squares import invert_information
from ...physics import ellipse, slow_engine, slow_motion
from ...physics.plant import make_linear_plant
from ...physics.resonator import Mechanics
from ...records import Wave
from .. import simulate
from ..diagnosis.base.data import prepare
from ..simulation_file import SimulationFile

Array = np.ndarray
ROWS, STEPS = 120, 1500


@dataclass(frozen=True)
class InformationColumns:
    """Columns of the information: the seven coordinates, then each cause's fitted parameters.

    `acting`: values of the causes that act while others are judged (a lagging thermometer shows
    only where something follows temperature); those not in question themselves are as free as the
    base model.
    """

    causes: tuple[Effect, ...]
    acting: Mapping[str, Mapping[str, float]]

    def __post_init__(self) -> None:
        assert len({c.name for c in self.causes}) == len(self.causes)

    def find_columns(self, name: str) -> list[int]:
        """Columns of a cause."""
        first = COUNT
        for cause in self.causes:
            count = len(cause.fitted())
            if cause.name == name:
                return list(range(first, first + count))
            first += count
        raise KeyError(name)

    def list_free(self, *questioned: str) -> list[int]:
        """Columns marginalised beside the causes in question: the base model and whatever else
        acts."""
        return list(range(COUNT)) + [
            k for name in self.acting if name not in questioned for k in self.find_columns(name)
        ]

    @property
    def size(self) -> int:
        """Number of columns."""
        return COUNT + sum(len(c.fitted()) for c in self.causes)


def make_wave(run: SimulationFile) -> Wave:
    """The wave that a run would show, without noise, with the standard deviations of its noise.

    N samples of noise σ leave σ√(2/N) on each of cosine and sine of a window.

    Parameters
    ----------
    run
        As a simulation file describes it.

    Returns
    -------
    Wave
        Of 1500 windows, by the slow engine.

    Examples
    --------
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> from hrg_cli.stages.planning.information import make_wave
    >>> (run,) = list_runs(
    ...     {
    ...         "device": {"frequency_hz": 5000.0, "quality_factor": 1e6},
    ...         "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ...         "readout": {"noise": 1e-3},
    ...     }
    ... )
    >>> wave = make_wave(run)
    >>> len(wave), bool(abs(wave.signal_std[0] - 1e-3 * (2 / 40) ** 0.5) < 1e-9)
    (1500, True)
    """
    table = run.recording
    step = table.duration_s / STEPS
    start, electrical = simulate.make_start(run)
    world = simulate.make_environment(run)
    plant = partial(make_linear_plant, simulate.make_mechanics(run), simulate.make_courses(run))
    blocks = slow_engine.run(
        world,
        plant,
        simulate.make_control(run),
        slow_motion.SlowTerms(),
        start,
        step,
        STEPS,
        electrical,
    )
    made = list(blocks)
    u = np.concatenate([block.envelopes(np.arange(block.samples.z.shape[1])) for block in made])
    command = np.concatenate([block.command for block in made], axis=1)
    t = np.arange(STEPS) * step
    a_A, a_B, angle, phase = ellipse.find_wave(u, run.device.mode_number)
    angle, phase = ellipse.unwrap(angle, phase, run.device.mode_number)
    noise = float(np.hypot(run.readout.noise, _converter(run)))
    # Demodulating N samples of noise σ leaves σ√(2/N) on each of cosine and sine.
    std = np.full(STEPS, noise * np.sqrt(2 / (table.sample_rate_hz * step)))
    warm, rate = (
        np.interp(t, world.time_s, world.logged_temperature_degc),
        np.interp(t, world.time_s, world.logged_rate_rad_s),
    )
    forced = run.control.mode == "forced"
    zero = np.zeros(STEPS)
    return Wave(
        time_s=t, main_amplitude=a_A, quadrature_amplitude=a_B, wave_angle_rad=angle,
        phase_rad=phase, carrier_phase_rad=zero,
        main_amplitude_std=std, quadrature_amplitude_std=std,
        wave_angle_rad_std=std / a_A / run.device.mode_number,
        phase_rad_std=std / a_A, carrier_phase_rad_std=zero, residual_rms=zero, signal_std=std,
        iterations=np.zeros(STEPS, "i2"), flags=np.zeros(STEPS, "u1"), temperature_degc=warm,
        rate_rad_s=rate,
        drive_main=command[0] if forced else None, drive_quadrature=command[1] if forced else None,
        frequency_hz=np.full(STEPS, run.device.frequency_hz),
        reference_frequency_hz=run.device.frequency_hz, window_s=step,
        mode=run.control.mode, mode_number=run.device.mode_number, run_id=run.run_id,
    )  # fmt: skip


def _converter(run: SimulationFile) -> float:
    """Noise of the converter's steps, LSB/√12."""
    if run.readout.adc_bits == 0:
        return 0.0
    return (run.readout.full_scale or 1.0) / 2 ** (run.readout.adc_bits - 1) / np.sqrt(12)


def compute_information(
    waves: Sequence[Wave],
    mechanics: Mechanics,
    layout: InformationColumns,
    references: Mapping[str, Mapping[str, float]],
    measured: bool,
) -> list[Array]:
    """Each wave's information about the base model and every cause, its own nuisances marginalised.

    M = Aᵀ(I − P_O)A of the columns A over σ and the projection P_O onto the run's own ones: start
    and frequency.

    Parameters
    ----------
    waves
        The runs.
    mechanics
        The resonator, at which the columns are taken.
    layout
        Which columns there are.
    references
        Cause -> the temperature from which it counts, for those that do not bring their own.
    measured
        Whether the wave's own start and frequency are fitted first; those of a menu are exact.

    Returns
    -------
    list of ndarray
        (size, size) a wave.

    Examples
    --------
    Two noises as large: a quarter of the information.

    >>> import numpy as np
    >>> from hrg_cli.stages.planning.information import InformationColumns, make_wave
    >>> from hrg_cli.stages.planning.information import compute_information
    >>> from hrg_cli.stages.simulate import make_mechanics
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> base = {
    ...     "device": {"frequency_hz": 5000.0, "quality_factor": 1e6},
    ...     "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ... }
    >>> noises = [{"readout": {"noise": noise}} for noise in (1e-3, 2e-3)]
    >>> runs = [run for noise in noises for run in list_runs(base | noise)]
    >>> waves, layout = [make_wave(run) for run in runs], InformationColumns((), {})
    >>> one, two = compute_information(waves, make_mechanics(runs[0]), layout, {}, False)
    >>> one.shape, bool(np.allclose(one, 4 * two))
    ((7, 7), True)
    """
    out = []
    for wave in waves:
        series, point, _ = prepare([wave], mechanics.scale_factor, ROWS)
        acting = [c for c in layout.causes if c.name in layout.acting]
        active = tuple(
            (c, c.values() | dict(references.get(c.name, {})) | dict(layout.acting[c.name]))
            for c in acting
        )
        truth = Point(from_mechanics(mechanics), point.start, point.offset_rad_s, active)
        if measured:
            flow = extended_fit.fit(series, truth, CoordinatePriors(truth.p, np.zeros(COUNT))).flow
        else:
            flow = linearise_flow(predict(series, replace(truth, offset_rad_s=np.zeros(1))))
        shared, own = find_base_sensitivities(flow)
        own_columns = whitened_rows.flatten_rows(series, own)
        columns = [whitened_rows.flatten_rows(series, shared)]
        for cause in layout.causes:
            values = (
                cause.values()
                | dict(references.get(cause.name, {}))
                | dict(layout.acting.get(cause.name, {}))
            )
            columns.append(
                whitened_rows.find_sensitivity(
                    flow, cause, values, scales.list_steps(cause, series)
                )
            )
        # A cause may have no slope at some rows (no log of what it follows): these tell nothing of
        # it.
        A = np.nan_to_num(np.concatenate(columns, axis=1))
        # Start and frequency are every run's own: what they can imitate is no information.
        basis = designs.orthonormalise(own_columns[:, :OWN])
        A = A - basis @ (basis.T @ A)
        out.append(A.T @ A)
    return out


def marginalise(M: Array, wanted: Sequence[int], free: Sequence[int]) -> Array:
    """Information on some columns after others are marginalised, the Schur complement.

    M_ww − M_wf M_ff⁻¹ M_fw.

    Parameters
    ----------
    M
        Information (size, size).
    wanted
        Columns that are asked for.
    free
        Columns that may be anything.

    Returns
    -------
    ndarray
        (wanted, wanted).

    Examples
    --------
    What a column shares with a free one is no information:

    >>> import numpy as np
    >>> from hrg_cli.stages.planning.information import marginalise
    >>> marginalise(np.array([[2.0, 1.0], [1.0, 1.0]]), [0], [1]).round(9).tolist()
    [[1.0]]
    """
    wanted, free = list(wanted), list(free)
    inside = M[np.ix_(wanted, wanted)]
    if not free:
        return inside
    cross = M[np.ix_(free, wanted)]
    return inside - cross.T @ invert_information(M[np.ix_(free, free)], 1e-10) @ cross
