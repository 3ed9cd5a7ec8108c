"""Where measured envelopes jump: a step at every row beside a cubic through its neighbours, over
neighbourhoods of several lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..physics.plant import SlowState
from .effect import OF_EVERY_RUN, RUN, Array, Parameter, Runs, Values

FEWEST = 4
"""Rows on either side by which a jump is judged, at least."""
PARTS = (30, 10)
"""Parts of a run that longer neighbourhoods are of: they see smaller jumps, where the run is smooth
enough."""
CHANCE = 1e-3
"""Chance that one of all rows of runs without a jump is taken for one."""
MOST = 4
"""Instants tried, the clearest first."""
QUARTER = 1.9226
"""First quartile of χ² with the four reals of a jump."""


@dataclass(frozen=True)
class Jump:
    """A jump of run `run` near `time_s`: Δu (2,) of the envelopes e^{−j·turn·t} u as they stand on
    the table that turns, and its χ²."""

    run: int
    time_s: float
    change: Array
    turn_rad_s: float
    chi2: float


def find_jumps(runs: Runs) -> list[Jump]:
    """Where envelopes jump by more than noise and their own curvature, the clearest first.

    Parameters
    ----------
    runs
        Measured ones side by side.

    Returns
    -------
    list of Jump
        None twice, as a jump is seen by neighbourhoods of several lengths.

    Examples
    --------
    A step of 0.1 in C at 10 s, noise 10⁻³:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.effects.envelope_jumps import find_jumps
    >>> t, random = np.arange(200) * 0.1, np.random.default_rng(1)
    >>> u = 1 + 0.1 * (t > 10)[:, None] * [1.0, 0.0] + 1e-3 * random.standard_normal((200, 2))
    >>> runs = Told(
    ...     time_s=t[None],
    ...     envelope=u[None] + 0j,
    ...     weight=np.full((1, 200), 1e3),
    ...     table_turn_rad=0 * t[None],
    ... )
    >>> (jump,) = find_jumps(runs)
    >>> round(jump.time_s, 1), jump.change.real.round(2).tolist()
    (10.0, [0.1, 0.0])
    """
    found: list[Jump] = []
    threshold = _threshold((1 + len(PARTS)) * int(np.count_nonzero(runs.weight)))
    # a table whose rate steps bends the wave's course, which is no jump of it
    on_table = _stand_on_table(runs.envelope, runs.table_turn_rad)
    for number, (t, u, weight) in enumerate(zip(runs.time_s, on_table, runs.weight, strict=True)):
        rows = np.flatnonzero(weight)
        if len(rows) < 8 * FEWEST:
            continue
        t, weight = t[rows], weight[rows]
        turn = float(
            np.sum(np.angle(np.sum(np.conj(u[rows][:-1]) * u[rows][1:], axis=-1))) / (t[-1] - t[0])
        )
        still = u[rows] * np.exp(-1j * turn * t)[:, None]
        for side in sorted({max(FEWEST, len(rows) // part) for part in (*PARTS, len(rows))}):
            change, variance = _steps(t, still, side)
            chi2 = np.sum(np.abs(change) ** 2, axis=-1) * weight[side:-side] ** 2 / variance
            # what the rows' own curvature does everywhere is no jump
            chi2 = chi2 / max(1.0, float(np.quantile(chi2, 0.25)) / QUARTER)
            for k in map(
                int, np.flatnonzero((chi2 > threshold) & (chi2 == _largest_near(chi2, 2 * side)))
            ):
                found.append(
                    Jump(
                        number,
                        _instant(t, still, k + side, change[k]),
                        change[k],
                        turn,
                        float(chi2[k]),
                    )
                )
    found.sort(key=lambda jump: -jump.chi2)
    return [
        jump
        for k, jump in enumerate(found)
        if not any(_is_same_jump(jump, other, runs) for other in found[:k])
    ]


def _stand_on_table(u: Array, turn: Array) -> Array:
    """Envelopes (..., 2) without the turn of mθ, −turn (...), that the rate makes."""
    c, s = np.cos(turn), np.sin(turn)
    return np.stack([c * u[..., 0] - s * u[..., 1], s * u[..., 0] + c * u[..., 1]], axis=-1)


def find_strikes(runs: Runs) -> list[Jump]:
    """The clearest jumps of single runs.

    What the others together show as much of at that time of theirs is of the programme, and strikes
    none of them.

    Parameters
    ----------
    runs
        Measured ones side by side.

    Returns
    -------
    list of Jump
        `MOST` at most.

    Examples
    --------
    All three runs step at 10 s: so does the programme.

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.effects.envelope_jumps import find_strikes
    >>> t, random = np.tile(np.arange(200) * 0.1, (3, 1)), np.random.default_rng(1)
    >>> u = 1 + 0.1 * (t > 10)[..., None] + 1e-3 * random.standard_normal((3, 200, 2))
    >>> weight = np.full((3, 200), 1e3)
    >>> len(find_strikes(Told(time_s=t, envelope=u + 0j, weight=weight, table_turn_rad=0 * t)))
    0
    """
    found = find_jumps(runs)
    alone = [
        jump
        for jump in found
        if jump.chi2
        > sum(o.chi2 for o in found if o.run != jump.run and _is_simultaneous(o, jump, runs))
    ]
    return alone[:MOST]


def list_instants(runs: Runs) -> list[Values]:
    """Where a run is struck, the clearest first.

    Parameters
    ----------
    runs
        Measured ones side by side.

    Returns
    -------
    list of dict
        Of each the instant [s from the run's beginning] and the run's number from 0.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.effects.envelope_jumps import list_instants
    >>> t, random = np.arange(200) * 0.1, np.random.default_rng(1)
    >>> u = 1 + 0.1 * (t > 10)[:, None] * [1.0, 0.0] + 1e-3 * random.standard_normal((200, 2))
    >>> runs = Told(
    ...     time_s=t[None],
    ...     envelope=u[None] + 0j,
    ...     weight=np.full((1, 200), 1e3),
    ...     table_turn_rad=0 * t[None],
    ... )
    >>> [{name: round(value, 1) for name, value in start.items()} for start in list_instants(runs)]
    [{'time_s': 10.0, 'run': 0.0}]
    """
    return [{"time_s": jump.time_s, RUN: float(jump.run)} for jump in find_strikes(runs)]


def find_part_after(time_s: Array, instant: float) -> Array:
    """The part of every row that lies after an instant.

    A row is the mean of its length, which the times of its neighbours show.

    Parameters
    ----------
    time_s
        (..., n) [s].
    instant
        In seconds.

    Returns
    -------
    ndarray
        (..., n), 0 to 1.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects.envelope_jumps import find_part_after
    >>> find_part_after(np.arange(4.0), 1.25).tolist()
    [0.0, 0.25, 1.0, 1.0]
    """
    if time_s.ndim == 0 or time_s.shape[-1] < 2:
        return np.asarray(time_s > instant, float)
    after, width = time_s - instant, np.gradient(time_s, axis=-1)
    # rows that only fill up a shorter run have no length
    lengths = np.divide(after, width, out=np.sign(after), where=width > 0)
    return np.asarray(np.clip(lengths + 0.5, 0, 1))


def make_run_parameter(what: str = "in which it happens") -> Parameter:
    """The parameter that says in which run of several something happens.

    Parameters
    ----------
    what
        Of the run, in words.

    Returns
    -------
    Parameter
        Held by every fit; neutral is every run.

    Examples
    --------
    >>> from hrg_cli.effects.envelope_jumps import make_run_parameter
    >>> make_run_parameter().meaning
    'number of the run in which it happens, from 0; −1: every run'
    """
    return Parameter(
        RUN,
        "1",
        0.0,
        f"number of the run {what}, from 0; −1: every run",
        neutral=OF_EVERY_RUN,
        fitted=False,
    )


def find_own_runs(p: Values, state: SlowState) -> Array:
    """1 in the run, or the runs, in which something happens, and 0 elsewhere.

    Parameters
    ----------
    p
        With the number of the run.
    state
        With the number of every run, where several stand side by side.

    Returns
    -------
    ndarray
        (...), as the state's numbers.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.effects.envelope_jumps import find_own_runs
    >>> find_own_runs({"run": 1.0}, Told(run=np.array([0, 1, 2]))).tolist()
    [0.0, 1.0, 0.0]
    """
    if state.run is None or p[RUN] == OF_EVERY_RUN:
        return np.ones(())
    return np.asarray(state.run == p[RUN], float)


def _threshold(rows: int) -> float:
    """x with rows · P(χ²₄ > x) = CHANCE, P = e^{−x/2}(1 + x/2)."""
    x = 40.0
    for _ in range(20):
        x = 2 * float(np.log(max(1, rows) * (1 + x / 2) / CHANCE))
    return x


def _steps(t: Array, u: Array, side: int) -> tuple[Array, Array]:
    """Step of both envelopes (n − 2·side, 2) at every row beside a cubic through its neighbours,
    and its variance for rows of variance 1.

    The row itself, which holds a part of the jump, does not count.
    """
    around = np.delete(np.arange(2 * side + 1), side)
    x = (np.lib.stride_tricks.sliding_window_view(t, 2 * side + 1) - t[side:-side, None])[:, around]
    x = x / np.abs(x).max(axis=1, keepdims=True)
    beside = np.stack([np.ones_like(x), x, x**2, x**3, np.sign(x) / 2], axis=-1)
    # the last row of the pseudo-inverse, from what of the last column the others do not hold
    Q, R = np.linalg.qr(beside)
    step = Q[..., -1] / R[:, -1:, -1]
    windows = np.lib.stride_tricks.sliding_window_view(u, 2 * side + 1, axis=0)[..., around]
    return np.einsum("ncw,nw->nc", windows, step), np.sum(step**2, axis=1)


def _largest_near(values: Array, reach: int) -> Array:
    """Largest value within `reach` rows, (n,)."""
    return np.max(
        np.lib.stride_tricks.sliding_window_view(np.pad(values, reach), 2 * reach + 1), axis=-1
    )


def _instant(t: Array, u: Array, k: int, change: Array) -> float:
    """The instant within row k, whose mean holds the part of the jump that comes before its end."""
    x, rows = t[k - FEWEST : k] - t[k], u[k - FEWEST : k]
    before = np.linalg.lstsq(np.column_stack([x**0, x, x**2]), rows, rcond=None)[0][0]
    part = float(
        np.clip(
            np.real(np.sum(np.conj(change) * (u[k] - before))) / np.sum(np.abs(change) ** 2), 0, 1
        )
    )
    return float(t[k] + (0.5 - part) * (t[k + 1] - t[k - 1]) / 2)


def _is_same_jump(jump: Jump, clearer: Jump, runs: Runs) -> bool:
    """Whether two jumps are one, seen over two lengths."""
    return jump.run == clearer.run and _is_simultaneous(jump, clearer, runs)


def _is_simultaneous(jump: Jump, clearer: Jump, runs: Runs) -> bool:
    """Whether two jumps come at one time of their runs, as near as the rows tell."""
    t = runs.time_s[jump.run]
    near_s = 2 * FEWEST * float(np.median(np.diff(t[: len(t) // 2])))
    return abs(jump.time_s - clearer.time_s) < near_s
