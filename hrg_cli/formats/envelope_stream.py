"""The rows of a log of demodulated signals as periods, window by window, as they are read."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..errors import HrgError
from ..records import FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING, Array, Periods
from ..records.time_origin import shift_time
from .envelope_rows import EnvelopeRows
from .envelope_windows import WindowPlan, average_windows
from .magnitudes import find_amplitudes
from .row_noise import estimate_mean_turn
from .slow import mean_groups
from .taken import GAP_STEPS, Taken

UNKNOWN_PHASE = np.pi / np.sqrt(3)
"""Standard deviation of a phase of which nothing is known."""
UNKNOWN_OVER_KNOWN = 1e3
"""Least ratio of such a signal's standard deviation to that of one that is measured."""
Rows = tuple[Array, Array, list[Array]]
"""Times (n,), envelopes (channel, n), slow columns (n,)."""


def stream_windows(
    source: EnvelopeRows, blank: Periods, plan: WindowPlan, taken: Taken
) -> Iterator[Periods]:
    """The windows of a log of demodulated signals as periods, block by block, as they are read.

    Parameters
    ----------
    source
        The log's rows.
    blank
        Periods without rows, whose other fields the blocks take.
    plan
        How many rows make a window, and their noise.
    taken
        Filled with what is taken, for the last block.

    Returns
    -------
    iterator of Periods
        A window's signals are means of its rows; the last block bears what only the whole log
        tells.

    Raises
    ------
    HrgError
        Fewer rows than one window, or none in the range asked for.

    Examples
    --------
    A wave at rest of 2 V, seen by the first channel alone, in windows of 100 rows:

    >>> from pathlib import Path
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.formats.envelope import _no_windows
    >>> from hrg_cli.formats.envelope_stream import stream_windows
    >>> from hrg_cli.formats.envelope_windows import plan_windows
    >>> from hrg_cli.formats.log import Log
    >>> from hrg_cli.formats.taken import Taken
    >>> t, noise = np.arange(200) * 0.01, np.random.default_rng(1).standard_normal((2, 200, 2))
    >>> u = [[2.0], [0.0]] + 1e-3 * noise.view(complex)[..., 0]
    >>> source = Told(
    ...     path="lock-in", read_blocks=lambda: iter([(t, u, [])]),
    ...     signal=Told(columns={"s_in_phase": 2}, phase_known=True),
    ...     slow=Told(list_fields=list, list_constant_fields=dict, judge=list),
    ... )
    >>> plan, taken = plan_windows(Path(), [(t, u)], 100), Taken(Log("", (), iter), {}, {}, 100.0)
    >>> (windows,) = stream_windows(source, _no_windows(5e3, plan), plan, taken)
    >>> windows.time_s.round(9).tolist(), windows.signals.round(2)[:, 0].tolist()
    ([0.495, 1.495], [2.0, 2.0])
    """
    held: Periods | None = None
    left: Rows | None = None
    row = begun = 0
    for times, u, slow in source.read_blocks():
        part = taken.take_block(times)
        bad = ~np.isfinite(u[:, part].sum(0))
        if bad.any():
            taken.count_not_finite(bad, row + part.start)
        row += len(times)
        piece = (times[part], u[:, part], [values[part] for values in slow])
        if left is not None:
            piece = _join_blocks(left, piece)
        full, left = _split_rows(piece, len(piece[0]) // plan.rows * plan.rows)
        if len(full[0]):
            if held is not None:
                yield held
            shift = taken.first_s or 0.0
            held = _windows(blank, plan, source, full[0] - shift, *full[1:])
            held = held.replace(start_time=shift_time(blank.start_time, shift))
            held.flags[: max(0, -(-(plan.settling - begun) // plan.rows))] |= FLAG_SETTLING
            begun += len(full[0])
        if taken.to_s is not None and times[-1] >= taken.to_s:
            break
    taken.check_range(str(source.path))
    if held is None:
        raise HrgError(
            f"{source.path}: holds fewer rows than one window of {plan.rows}; record longer or"
            " lower rows_per_window"
        )
    for status, reason in [*taken.judge(), *source.slow.judge()]:
        held = held.judged([reason], status)
    facts = taken.list_facts()
    facts["rows"] = facts.pop("samples")
    yield held.replace(details=json.dumps(facts | {"noise": _noise(plan)}, ensure_ascii=False))


def _noise(plan: WindowPlan) -> dict[str, Any]:
    """What the record keeps of the rows' noise."""
    noise = plan.noise
    return {
        "correlated_rows": noise.correlated_rows,
        "rows_per_window": plan.rows,
        "row_std": [float(np.sqrt(v)) for v in noise.variance.mean(1)],
        "window_std": [float(np.sqrt(v / plan.rows)) for v in noise.density.mean(1)],
        "offset_hz": plan.offset_hz,
        "filter_passes": plan.passed,
    }


def _split_rows(rows: Rows, at: int) -> tuple[Rows, Rows]:
    """The first rows and those that are left."""
    times, u, slow = rows
    return (times[:at], u[:, :at], [v[:at] for v in slow]), (
        times[at:],
        u[:, at:],
        [v[at:] for v in slow],
    )


def _join_blocks(a: Rows, b: Rows) -> Rows:
    """Rows left over before the next ones."""
    return (
        np.concatenate([a[0], b[0]]),
        np.concatenate([a[1], b[1]], axis=1),
        [np.concatenate(pair) for pair in zip(a[2], b[2], strict=True)],
    )


def _windows(
    blank: Periods,
    plan: WindowPlan,
    source: EnvelopeRows,
    times: Array,
    u: Array,
    slow: list[Array],
) -> Periods:
    """Means of the rows, with standard deviations, flags and slow columns."""
    one = "s_in_phase" not in source.signal.columns
    if plan.moved_hz:
        u = u * np.exp(-2j * np.pi * plan.moved_hz * times)
    means, rows = average_windows(
        u, plan.rows, estimate_mean_turn(u) if plan.rows > 1 and u.shape[1] > 1 else 0.0
    )
    signals, std = _signals(means, plan, one)
    if plan.lengths:
        power, _ = average_windows(np.abs(u) ** 2, plan.rows, 0.0)
        signals[:, 0], std[:, 0] = find_amplitudes(power[0].real, plan.noise, plan.rows)
    if not source.signal.phase_known:
        # beside so large a σ no other is taken for unknown, nor this one for known (estimate)
        std[:, 1] = np.maximum(UNKNOWN_PHASE * signals[:, 0], UNKNOWN_OVER_KNOWN * std[:, 0])
        std[:, 2:] = std[:, :1]
    flags = np.zeros(len(rows), "u1")
    flags[~np.isfinite(means).all(0)] |= FLAG_NOT_FINITE
    steps = np.diff(times[: rows.size], prepend=times[0] - plan.step_s).reshape(rows.shape)
    flags[(steps > GAP_STEPS * plan.step_s)[:, 1:].any(1)] |= FLAG_GAP
    fields = dict(
        zip(
            source.slow.list_fields(),
            (mean_groups(values[: rows.size], plan.rows) for values in slow),
            strict=True,
        )
    )
    fields |= {
        name: np.full(len(rows), value)
        for name, value in source.slow.list_constant_fields().items()
    }
    row_std = np.sqrt(plan.noise.variance.mean(1))
    return blank.replace(
        time_s=times[: rows.size].reshape(rows.shape).mean(1),
        signals=signals,
        signals_std=std,
        residual_rms=np.broadcast_to(
            row_std[[0, 0]] * [1, 0] if one else row_std, (len(rows), 2)
        ).copy(),
        flags=flags,
        **fields,
    )


def _signals(means: Array, plan: WindowPlan, one: bool) -> tuple[Array, Array]:
    """The four signals (n, 4) of both channels' means (2, n), and their σ: noise along and across
    the phasor, turned with the stronger channel. one: both have the first channel's noise."""
    strong = means[np.argmax(np.nansum(np.abs(means) ** 2, axis=1))]
    cos2 = np.where(
        np.abs(strong) > 0, strong.real**2 / np.maximum(np.abs(strong) ** 2, 1e-300), 0.5
    )
    signals, std = np.empty((len(cos2), 4)), np.empty((len(cos2), 4))
    for k in range(2):
        of = 0 if one else k
        along, across = plan.find_density(of, np.abs(means[of])).T / plan.rows
        signals[:, 2 * k], signals[:, 2 * k + 1] = means[k].real, -means[k].imag
        std[:, 2 * k] = np.sqrt(along * cos2 + across * (1 - cos2))
        std[:, 2 * k + 1] = np.sqrt(along * (1 - cos2) + across * cos2)
    return signals, std
