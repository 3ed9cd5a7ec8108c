"""The commands of the chain: from recorded samples to tables, one command a step."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import UsageError
from .frame import (
    NO_DRAWS,
    ONE_PROCESS,
    Common,
    Files,
    OneFile,
    Rehearsals,
    command,
    existing,
    numbers,
    run_stage_on_files,
)

app = typer.Typer()
OF_REHEARSAL = {
    "jobs": "Processes that share the rehearsals of --rehearse; the rest is done by one."
}


@command(
    app,
    "import",
    "hrg import log.csv -o recording.h5 --c 2 --s 3 --time 1 --mode free",
    idle=NO_DRAWS | ONE_PROCESS,
)
def import_(
    run: Common,
    log: OneFile = None,
    c: Annotated[
        str | None,
        typer.Option(help="Column of channel C: its title or 1-based number.", show_default=False),
    ] = None,
    s: Annotated[
        str | None,
        typer.Option(
            help='Column of channel S; "none" for a log of one channel.', show_default=False
        ),
    ] = None,
    s_file: Annotated[
        str | None,
        typer.Option(
            help="File of channel S, where it has its own; or OLD=NEW put into LOG's name.",
            show_default=False,
        ),
    ] = None,
    time_column: Annotated[
        str | None,
        typer.Option("--time", help='Column of times; "none" to ignore them.', show_default=False),
    ] = None,
    temperature: Annotated[
        str | None, typer.Option(help="Column of the temperature.", show_default=False)
    ] = None,
    rate: Annotated[
        str | None, typer.Option(help="Column of the rate.", show_default=False)
    ] = None,
    sample_rate_hz: Annotated[
        float | None,
        typer.Option(help="Sampling rate, where the log has none.", show_default=False),
    ] = None,
    mode: Annotated[str | None, typer.Option(help="free or forced.", show_default=False)] = None,
    mode_number: Annotated[
        int | None, typer.Option(help="2 for a shell, 1 for a pendulum.", show_default=False)
    ] = None,
    readout: Annotated[
        str | None, typer.Option(help="direct or carrier.", show_default=False)
    ] = None,
    carrier_hz: Annotated[
        float | None, typer.Option(help="Carrier frequency.", show_default=False)
    ] = None,
    nominal_frequency_hz: Annotated[
        float | None, typer.Option(help="Expected oscillation frequency.", show_default=False)
    ] = None,
    units: Annotated[
        str | None, typer.Option(help="Unit of both channels.", show_default=False)
    ] = None,
    time_units: Annotated[
        str | None, typer.Option(help="s, ms, us, ns, min or h.", show_default=False)
    ] = None,
    clock_hz: Annotated[
        float | None,
        typer.Option(
            help="Ticks a second, where the column of times counts ticks.", show_default=False
        ),
    ] = None,
    auxiliary_time: Annotated[
        str | None,
        typer.Option(
            help="Column of the slow columns' own times, where they have fewer rows.",
            show_default=False,
        ),
    ] = None,
    rate_units: Annotated[
        str | None, typer.Option(help="rad/s, deg/s, deg/h or rpm.", show_default=False)
    ] = None,
    temperature_units: Annotated[
        str | None, typer.Option(help="degC, K or degF.", show_default=False)
    ] = None,
    separator: Annotated[
        str | None,
        typer.Option(help="Of a text log; a blank for any run of blanks.", show_default=False),
    ] = None,
    decimal: Annotated[
        str | None, typer.Option(help='Decimal sign of a text log: "." or ",".', show_default=False)
    ] = None,
    constant_rate_rad_s: Annotated[
        float | None, typer.Option(help="Rate of the whole run.", show_default=False)
    ] = None,
    constant_temperature_degc: Annotated[
        float | None, typer.Option(help="Temperature of the whole run.", show_default=False)
    ] = None,
    gyro_id: Annotated[str | None, typer.Option(help="The gyro.", show_default=False)] = None,
    run_id: Annotated[
        str | None, typer.Option(help="The run; the file's name by default.", show_default=False)
    ] = None,
    lot_id: Annotated[str | None, typer.Option(help="The lot.", show_default=False)] = None,
    format: Annotated[
        str | None,
        typer.Option(
            help="Name of the format, where its content is not to decide.", show_default=False
        ),
    ] = None,
    from_s: Annotated[
        float | None,
        typer.Option(help="Take the log from this time on; it becomes t = 0.", show_default=False),
    ] = None,
    to_s: Annotated[
        float | None, typer.Option(help="Take the log up to this time.", show_default=False)
    ] = None,
    envelope: Annotated[
        bool,
        typer.Option(
            "--envelope",
            help=(
                "The log holds demodulated signals (lock-in, FPGA, spectrum analyser): write"
                " periods."
            ),
        ),
    ] = False,
    c_in_phase: Annotated[
        str | None,
        typer.Option(help="Envelope: column of C's in-phase signal.", show_default=False),
    ] = None,
    c_quadrature: Annotated[
        str | None,
        typer.Option(help="Envelope: column of C's quadrature signal.", show_default=False),
    ] = None,
    s_in_phase: Annotated[
        str | None,
        typer.Option(help="Envelope: column of S's in-phase signal.", show_default=False),
    ] = None,
    s_quadrature: Annotated[
        str | None,
        typer.Option(help="Envelope: column of S's quadrature signal.", show_default=False),
    ] = None,
    amplitude: Annotated[
        str | None,
        typer.Option(help="Envelope: column of one channel's amplitude.", show_default=False),
    ] = None,
    phase: Annotated[
        str | None, typer.Option(help="Envelope: column of its phase.", show_default=False)
    ] = None,
    phase_units: Annotated[
        str | None, typer.Option(help="Envelope: deg, rad or turns.", show_default=False)
    ] = None,
    decibel: Annotated[
        bool | None,
        typer.Option(
            "--decibel", help="Envelope: the amplitude is a level in dB.", show_default=False
        ),
    ] = None,
    reference_frequency_hz: Annotated[
        float | None,
        typer.Option(
            help="Envelope: frequency of the demodulator's reference.", show_default=False
        ),
    ] = None,
    rows_per_window: Annotated[
        int | None,
        typer.Option(
            help="Envelope: rows averaged to a window; by their correlation by default.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """A laboratory's log (CSV, WAV, FLAC, MATLAB, TDMS, Parquet, LabOne; - for standard input) to a
    recording.

    With --envelope, a log of demodulated signals (I and Q of one or two channels, amplitude and
    phase, or amplitude alone) to periods.

    --show-config prints the mapping as TOML; kept as a file it serves a whole lot through --config.
    """
    from .importing import import_file, show

    flags = {key: value for key, value in locals().items() if key not in _NO_SETTINGS}
    for key in _COLUMNS:
        flags[key] = _column(flags[key])
    report = import_file(log, run, {**flags, "time": _column(time_column)}, envelope)
    run.finish(report, lambda: show(report))


_NO_SETTINGS = ("run", "log", "time_column", "import_file", "show", "envelope")
_COLUMNS = (
    *("c", "s", "temperature", "rate", "auxiliary_time"),
    *("c_in_phase", "c_quadrature", "s_in_phase", "s_quadrature", "amplitude", "phase"),
)


def _column(name: str | None) -> str | int | None:
    """A column's title, or its number."""
    return int(name) if name is not None and name.isdigit() else name


@command(app, "simulate", "hrg simulate configs/free_run_downs.toml -o run.h5")
def simulate(
    run: Common,
    config_file: Annotated[
        Path | None, typer.Argument(metavar="CONFIG.toml", show_default=False)
    ] = None,
    model: Annotated[
        str | None,
        typer.Option(
            help="fast (equations of motion, sample by sample) or slow (envelopes).",
            show_default=False,
        ),
    ] = None,
    only_run: Annotated[
        str | None, typer.Option("--run", help="Only this run of the file.", show_default=False)
    ] = None,
    effects_from: Annotated[
        Path | None,
        typer.Option(
            help="Python file with effects of your own; it is executed.", show_default=False
        ),
    ] = None,
) -> None:
    """Simulate recordings of a gyro described in TOML; several [[run]] tables give OUTPUT-RUN.h5
    each."""
    from ..reporting import console
    from .simulating import simulate_files

    started = time.monotonic()
    config_file = existing([config_file] if config_file else [], "a simulation file (TOML)")[0]
    with console.progress_bar("simulate", run.quiet or run.json) as progress:
        report = simulate_files(
            config_file,
            run,
            model=model,
            only_run=only_run,
            effects_from=effects_from,
            progress=progress,
        )
    run.finish({**report, "elapsed_s": round(time.monotonic() - started, 3)})


@command(
    app,
    "inject",
    "hrg inject recording.h5 --effect gain_mismatch --set gain=0.01 -o injected.h5",
    idle=NO_DRAWS | ONE_PROCESS,
    says={
        "assignments": (
            "A parameter of the effect, PARAMETER=VALUE (EFFECT.PARAMETER=VALUE of several), or a"
            " setting; may be repeated."
        )
    },
)
def inject(
    run: Common,
    recording: OneFile = None,
    effect: Annotated[
        list[str] | None,
        typer.Option("--effect", help="Effect to hide; may be repeated.", show_default=False),
    ] = None,
    resonator: Annotated[
        Path | None,
        typer.Option(
            help=(
                "The identified resonator, for effects of the motion; fitted to this run by"
                " default."
            ),
            show_default=False,
        ),
    ] = None,
    effects_from: Annotated[
        Path | None,
        typer.Option(
            help="Python file with effects of your own; it is executed.", show_default=False
        ),
    ] = None,
) -> None:
    """An effect of the catalogue hidden in measured samples, to see whether a diagnosis finds it
    there."""
    from ..reporting import console
    from .injecting import inject_file

    with console.progress_bar("inject", run.quiet or run.json) as progress:
        outcome = inject_file(recording, run, effect or [], resonator, effects_from, progress)
    run.finish(outcome.json)


@command(
    app,
    "demodulate",
    "hrg demodulate run.h5 -o periods.h5 --periods-per-window 50",
    idle=NO_DRAWS | ONE_PROCESS,
)
def demodulate(
    run: Common,
    recording: OneFile = None,
    periods_per_window: Annotated[
        float | None,
        typer.Option(help="Oscillation periods a window (default 1).", show_default=False),
    ] = None,
    nominal_frequency_hz: Annotated[
        float | None,
        typer.Option(help="Look for the oscillation near this frequency.", show_default=False),
    ] = None,
    from_s: Annotated[
        float | None,
        typer.Option(
            help="Begin at this time of the recording; rows keep its times.", show_default=False
        ),
    ] = None,
    to_s: Annotated[
        float | None, typer.Option(help="End at this time of the recording.", show_default=False)
    ] = None,
) -> None:
    """Samples to signals a window: least squares at the oscillation frequency, which is found and
    followed."""
    run_stage_on_files(
        run,
        "demodulate",
        [recording] if recording else [],
        periods_per_window=periods_per_window,
        nominal_frequency_hz=nominal_frequency_hz,
        from_s=from_s,
        to_s=to_s,
    )


@command(app, "estimate", "hrg estimate periods.h5 -o wave.h5", idle=NO_DRAWS | ONE_PROCESS)
def estimate(
    run: Common,
    periods: OneFile = None,
    solver: Annotated[
        str | None,
        typer.Option(help="gauss-newton, levenberg-marquardt or closed-form.", show_default=False),
    ] = None,
    start: Annotated[
        str | None,
        typer.Option(
            help="Start of the solver: previous, closed-form or fixed.", show_default=False
        ),
    ] = None,
    carrier_phase_rad: Annotated[
        float | None,
        typer.Option(help="Known carrier phase; estimated a period otherwise.", show_default=False),
    ] = None,
) -> None:
    """Signals to the wave: main amplitude, quadrature, wave angle and phases with standard
    deviations."""
    run_stage_on_files(
        run,
        "estimate",
        [periods] if periods else [],
        solver=solver,
        start=start,
        carrier_phase_rad=carrier_phase_rad,
    )


@command(app, "identify", "hrg identify wave-*.h5 -o resonator.h5 --method all", says=OF_REHEARSAL)
def identify(
    run: Common,
    waves: Files = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="Method of identification, or all (compared in one table).", show_default=False
        ),
    ] = None,
    rate_rad_s: Annotated[
        float | None,
        typer.Option(
            help="Constant rate where the files log none (or to override).", show_default=False
        ),
    ] = None,
    fit_rate: Annotated[
        bool | None,
        typer.Option(
            "--fit-rate",
            help="Fit one unknown constant rate beside the resonator, added to the logged rates.",
            show_default=False,
        ),
    ] = None,
    scale_factor: Annotated[
        float | None, typer.Option(help="Known scale factor K, held fixed.", show_default=False)
    ] = None,
    damping_axis_rad: Annotated[
        float | None, typer.Option(help="Known damping axis, held fixed.", show_default=False)
    ] = None,
    stiffness_axis_rad: Annotated[
        float | None, typer.Option(help="Known stiffness axis, held fixed.", show_default=False)
    ] = None,
    most_different: Annotated[
        int | None,
        typer.Option(
            help="Use only so many free windows, the most different ones.", show_default=False
        ),
    ] = None,
    bootstrap: Annotated[
        int | None,
        typer.Option(
            help="Draws of a block bootstrap for the errors, 0: none.", show_default=False
        ),
    ] = None,
    window: Annotated[
        str | None,
        typer.Option(help="auto: cut the free windows out of long records.", show_default=False),
    ] = None,
    profile: Annotated[
        bool | None,
        typer.Option(
            "--profile", help="Profile likelihood of every parameter.", show_default=False
        ),
    ] = None,
    eliminate_rate: Annotated[
        bool | None,
        typer.Option(
            "--eliminate-rate",
            help=(
                "fixed-axes with the published elimination of the rate (halves the damping split)."
            ),
            show_default=False,
        ),
    ] = None,
    earth_rate_deg_h: Annotated[
        float | None,
        typer.Option(
            help="Earth's rate about the axis, added to the logged rates.", show_default=False
        ),
    ] = None,
    latitude_deg: Annotated[
        float | None,
        typer.Option(help="Latitude from which the Earth's rate is taken.", show_default=False),
    ] = None,
    axis_tilt_deg: Annotated[
        float | None,
        typer.Option(
            help="Tilt of the sensitive axis from the vertical (default 0).", show_default=False
        ),
    ] = None,
    axis_azimuth_deg: Annotated[
        float | None,
        typer.Option(help="Direction of that tilt, from north (default 0).", show_default=False),
    ] = None,
    rehearse: Rehearsals = None,
) -> None:
    """Resonator parameters from free run-downs: damping and frequency split, their axes, scale
    factor."""
    run_stage_on_files(
        run,
        "identify",
        waves or [],
        method=method,
        rate_rad_s=rate_rad_s,
        fit_rate=fit_rate,
        scale_factor=scale_factor,
        damping_axis_rad=damping_axis_rad,
        stiffness_axis_rad=stiffness_axis_rad,
        most_different=most_different,
        bootstrap=bootstrap,
        window=window,
        profile=profile,
        eliminate_rate=eliminate_rate,
        earth_rate_deg_h=earth_rate_deg_h,
        latitude_deg=latitude_deg,
        axis_tilt_deg=axis_tilt_deg,
        axis_azimuth_deg=axis_azimuth_deg,
        rehearse=rehearse,
    )


@command(
    app, "rate", "hrg rate wave.h5 --resonator resonator.h5 -o rate.h5", idle=NO_DRAWS | ONE_PROCESS
)
def rate(
    run: Common,
    wave: OneFile = None,
    resonator: Annotated[
        Path | None, typer.Option(help="The identified resonator, held.", show_default=False)
    ] = None,
    nodes: Annotated[
        int | None,
        typer.Option(
            help="Times at which the rate is fitted (default: as many as the run asks).",
            show_default=False,
        ),
    ] = None,
    earth_rate_deg_h: Annotated[
        float | None,
        typer.Option(help="Earth's rate about the axis, taken off the answer.", show_default=False),
    ] = None,
    latitude_deg: Annotated[
        float | None,
        typer.Option(help="Latitude from which the Earth's rate is taken.", show_default=False),
    ] = None,
    axis_tilt_deg: Annotated[
        float | None,
        typer.Option(
            help="Tilt of the sensitive axis from the vertical (default 0).", show_default=False
        ),
    ] = None,
    axis_azimuth_deg: Annotated[
        float | None,
        typer.Option(help="Direction of that tilt, from north (default 0).", show_default=False),
    ] = None,
    main_phase_error_rad: Annotated[
        float | None,
        typer.Option(
            help="Driven run: known phase error of the main force (default 0).", show_default=False
        ),
    ] = None,
    quadrature_phase_error_rad: Annotated[
        float | None,
        typer.Option(
            help="Driven run: known phase error of the quadrature force (default 0).",
            show_default=False,
        ),
    ] = None,
) -> None:
    """The rate a free or driven run shows, with the identified resonator as reference model."""
    if resonator is None and not run.show_config:
        raise UsageError("no resonator is named; add --resonator resonator.h5")
    run_stage_on_files(
        run,
        "rate",
        [wave] if wave else [],
        beside={"resonator": resonator},
        nodes=nodes,
        earth_rate_deg_h=earth_rate_deg_h,
        latitude_deg=latitude_deg,
        axis_tilt_deg=axis_tilt_deg,
        axis_azimuth_deg=axis_azimuth_deg,
        main_phase_error_rad=main_phase_error_rad,
        quadrature_phase_error_rad=quadrature_phase_error_rad,
    )


@command(
    app,
    "calibrate",
    "hrg calibrate forced-*.wave.h5 -o calibration.h5 --harmonics 2 --ladder",
    says=OF_REHEARSAL,
)
def calibrate(
    run: Common,
    waves: Files = None,
    model: Annotated[
        str | None,
        typer.Option(
            help=(
                "auto (default: of those that fit, the one that predicts data left out best),"
                " table, parametric, quadrature, phase, "
                "combined, physical, or all (table, the others compared)."
            ),
            show_default=False,
        ),
    ] = None,
    harmonics: Annotated[
        int | None,
        typer.Option(
            help="Fourier band limit in 2m*angle; by cross-validation where not given.",
            show_default=False,
        ),
    ] = None,
    axis: Annotated[
        str | None, typer.Option(help="temperature or frequency.", show_default=False)
    ] = None,
    interpolation: Annotated[
        str | None,
        typer.Option(help="Between nodes: linear, cubic or monotone.", show_default=False),
    ] = None,
    nodes: Annotated[
        str | None, typer.Option(help="Nodes in °C (or Hz), joined by commas.", show_default=False)
    ] = None,
    scale_factor_harmonics: Annotated[
        int | None,
        typer.Option(
            help="Band limit of the scale factor; by cross-validation where not given.",
            show_default=False,
        ),
    ] = None,
    rate_rad_s: Annotated[
        float | None,
        typer.Option(help="Constant rate of runs without a rate log.", show_default=False),
    ] = None,
    earth_rate_rad_s: Annotated[
        float | None,
        typer.Option(
            help="Earth's rate about the sensitive axis, added to the logged rate.",
            show_default=False,
        ),
    ] = None,
    ladder: Annotated[
        bool | None,
        typer.Option(
            "--ladder", help="Residual after each of the seven stages.", show_default=False
        ),
    ] = None,
    stable_only: Annotated[
        bool | None,
        typer.Option("--stable-only", help="Drop what does not repeat.", show_default=False),
    ] = None,
    resonator: Annotated[
        list[Path] | None,
        typer.Option(
            help="Resonator file of --model physical; repeated, one a temperature (or frequency).",
            show_default=False,
        ),
    ] = None,
    output_column: Annotated[
        str | None,
        typer.Option(help="Of a table of dwells (CSV …): the gyro's output.", show_default=False),
    ] = None,
    rate_column: Annotated[
        str | None,
        typer.Option(
            help="Of a table of dwells: the rate in rad/s; none: the gyro at rest.",
            show_default=False,
        ),
    ] = None,
    temperature_column: Annotated[
        str | None, typer.Option(help="Of a table of dwells: the temperature.", show_default=False)
    ] = None,
    rehearse: Rehearsals = None,
) -> None:
    """Drift D(T, angle) and scale-factor K(T, angle) tables from forced runs over temperature and
    rate.

    FILE: wave files; or one foreign table of dwells of any rate gyro, with --output-column,
    --rate-column and --temperature-column.
    """
    of_waves: dict[str, Any] = {
        "model": model,
        "harmonics": harmonics,
        "axis": axis,
        "interpolation": interpolation,
        "nodes": None if nodes is None else numbers(nodes, "--nodes"),
        "scale_factor_harmonics": scale_factor_harmonics,
        "rate_rad_s": rate_rad_s,
        "earth_rate_rad_s": earth_rate_rad_s,
        "ladder": ladder,
        "stable_only": stable_only,
    }
    of_table = {"output": output_column, "rate": rate_column, "temperature": temperature_column}
    from .calibrating import calibrate_table, is_table

    if is_table(waves or [], of_table):
        from ..reporting import tables

        strange = [
            name
            for name, value in of_waves.items()
            if value is not None and name != "interpolation"
        ]
        if strange or resonator:
            raise UsageError(
                f"--{(strange or ['resonator'])[0].replace('_', '-')} is for wave files; a table of"
                " dwells has no wave angle"
            )
        if rehearse is not None:
            raise UsageError(
                "--rehearse is for wave files; a table of dwells has no runs to rehearse"
            )
        outcome = calibrate_table(waves or [], run, {**of_table, "interpolation": interpolation})
        run.finish(outcome.json, lambda: tables.show(outcome.record, outcome.json))
        return
    run_stage_on_files(
        run,
        "calibrate",
        waves or [],
        beside={"resonator": resonator or None},
        rehearse=rehearse,
        **of_waves,
    )


@command(
    app,
    "compensate",
    "hrg compensate wave.h5 --calibration calibration.h5 -o compensated.h5",
    idle=NO_DRAWS | ONE_PROCESS,
)
def compensate(
    run: Common,
    wave: OneFile = None,
    calibration: Annotated[
        Path | None, typer.Option(help="The tables to apply.", show_default=False)
    ] = None,
    windows_per_increment: Annotated[
        int | None,
        typer.Option(
            help=(
                "Windows averaged to one end of an increment (default 1): less noise, coarser time."
            ),
            show_default=False,
        ),
    ] = None,
    earth_rate_rad_s: Annotated[
        float | None,
        typer.Option(
            help="Earth's rate about the sensitive axis, part of the true rate.", show_default=False
        ),
    ] = None,
) -> None:
    """Rate and angle of a run after the tables."""
    if calibration is None and not run.show_config:
        raise UsageError("no tables are named; add --calibration calibration.h5")
    run_stage_on_files(
        run,
        "compensate",
        [wave] if wave else [],
        beside={"calibration": calibration},
        windows_per_increment=windows_per_increment,
        earth_rate_rad_s=earth_rate_rad_s,
    )


@command(
    app,
    "diagnose",
    "hrg diagnose wave-*.h5 -o diagnosis.h5 --model resonator.h5",
    idle=NO_DRAWS | ONE_PROCESS,
)
def diagnose(
    run: Common,
    waves: Files = None,
    model: Annotated[
        Path | None,
        typer.Option(
            help="What you believe: a resonator file or a simulation's TOML.", show_default=False
        ),
    ] = None,
    effects_from: Annotated[
        Path | None,
        typer.Option(
            help="Python file with effects of your own; it is executed.", show_default=False
        ),
    ] = None,
    scale_factor: Annotated[
        float | None, typer.Option(help="Known scale factor K, held fixed.", show_default=False)
    ] = None,
    free_phase: Annotated[
        bool | None,
        typer.Option(
            "--free-phase",
            help="Judge shape and angle alone, where the phase wanders.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """What the simulation gets wrong: the cause, its size, the extended model
    (OUTPUT.extended.toml) and the gain."""
    from ..reporting import console, tables
    from .diagnosing import diagnose_files

    with console.progress_bar("diagnose", run.quiet or run.json) as progress:
        flags = {"scale_factor": scale_factor, "free_phase": free_phase}
        outcome = diagnose_files(waves or [], run, model, effects_from, flags, progress)
    run.finish(outcome.json, lambda: tables.show(outcome.record, outcome.json))


@command(
    app,
    "plan",
    "hrg plan resonator.h5 --menu configs/menu.toml -o next.toml --runs 3",
    idle=NO_DRAWS | ONE_PROCESS,
)
def plan(
    run: Common,
    files: Files = None,
    menu: Annotated[
        Path | None,
        typer.Option(help="TOML file with the runs that are feasible.", show_default=False),
    ] = None,
    runs: Annotated[
        int | None, typer.Option(help="Runs to choose (default 3).", show_default=False)
    ] = None,
    criterion: Annotated[
        str | None, typer.Option(help="auto, separate or variance.", show_default=False)
    ] = None,
    causes: Annotated[
        str | None, typer.Option(help="Causes to separate, joined by commas.", show_default=False)
    ] = None,
) -> None:
    """The next experiment: the runs of a menu that separate open causes or shrink the worst
    variances, as a simulation file.

    FILE: a resonator or diagnosis file, then the wave files measured already.
    """
    from ..reporting import console
    from .planning import plan_files

    named = None if causes is None else [name.strip() for name in causes.split(",") if name.strip()]
    report = plan_files(
        files or [], menu, run, {"runs": runs, "criterion": criterion, "causes": named}
    )

    def show() -> None:
        console.print_table(
            "", ("run", "why"), [(r["run_id"], r["reason"]) for r in report["runs"]]
        )
        rows = [
            (" / ".join(row["causes"]), row["before_sigma"], row["after_sigma"])
            for row in report["separations"]
        ]
        rows += [(name, std, report["after"][name]) for name, std in report["before"].items()]
        console.print_table(
            "", ("separation in σ, or standard deviation", "before", "expected after"), rows
        )
        for sentence in report["impossible"]:
            console.say(sentence)

    run.finish(report, show)


@command(
    app,
    "forecast",
    "hrg forecast resonator.h5 --drive parametric -o forecast.svg",
    idle=NO_DRAWS | ONE_PROCESS,
)
def forecast(
    run: Common,
    resonator: OneFile = None,
    drive: Annotated[
        str | None,
        typer.Option(
            help="free (run-down), force (default) or parametric (one ring electrode).",
            show_default=False,
        ),
    ] = None,
    wave_angle_rad: Annotated[
        float | None, typer.Option(help="Wave angle at the start (default 0).", show_default=False)
    ] = None,
    rate_rad_s: Annotated[
        float | None, typer.Option(help="Constant input rate (default 0).", show_default=False)
    ] = None,
    duration_s: Annotated[
        float | None,
        typer.Option(help="Length of the forecast (default 3600).", show_default=False),
    ] = None,
    quadrature_gain_1_s: Annotated[
        float | None,
        typer.Option(help="Gain of a quadrature loop by force (default 0).", show_default=False),
    ] = None,
    scale_factor: Annotated[
        float | None, typer.Option(help="K, where the resonator has none.", show_default=False)
    ] = None,
    trim: Annotated[
        bool | None,
        typer.Option(
            "--trim", help="Forecast the gyro as a spring along its stiffest axis leaves it."
        ),
    ] = None,
    trim_step_rad_s: Annotated[
        float | None,
        typer.Option(
            help="Smallest step of the spring, of either electrode pair.", show_default=False
        ),
    ] = None,
) -> None:
    """The drift a resonator will show, alone: D over the angle, the wave's way over hours, the
    error between external fixes.

    Written as a table over time (.csv), all of it (.json) or one figure (.svg, .png), by the
    output's suffix.
    """
    flags = {key: value for key, value in locals().items() if key not in ("run", "resonator")}
    from .forecasting import forecast_file

    run.finish(*forecast_file(resonator, run, flags))


@command(
    app,
    "mismatch",
    "hrg mismatch wave.h5 --main-amplitude 1.0 -o mismatch.csv",
    idle=NO_DRAWS | ONE_PROCESS,
)
def mismatch(
    run: Common,
    wave: OneFile = None,
    main_amplitude: Annotated[
        float | None,
        typer.Option(help="Set amplitude; the run's median where not given.", show_default=False),
    ] = None,
    computing_s: Annotated[
        float | None,
        typer.Option(
            help="Time from a window's end until its signals are there (default 0).",
            show_default=False,
        ),
    ] = None,
) -> None:
    """The signals a control system acts on: error of the amplitude, quadrature, phase and angle,
    with their noise and delay."""
    from .mismatching import mismatch_file

    run.finish(
        *mismatch_file(wave, run, {"main_amplitude": main_amplitude, "computing_s": computing_s})
    )
