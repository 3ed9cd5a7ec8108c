"""What most likely moved the waves of driven runs beside their log, in jumps of the motion from
step to step.

Knows which pieces of the log may have been off, by what forces, and how their scatter stands in the
rows (`designs.Softened`); from a residual it takes the likeliest walk.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .designs import Softened
from .wave_frame import to_complex

Array = np.ndarray


@dataclass(frozen=True)
class LogPieces:
    """Pieces of the log that scatter by one value each.

    Parameters
    ----------
    jumps
        (R, n − 1, 4, c): jumps in the steps by one σ of c commands in the row before or behind.
    piece
        Which piece every row belongs to, (n,).

    Examples
    --------
    One command, logged by values for two rows each; what one σ of a value is in each of its rows:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.walks import LogPieces
    >>> pieces = LogPieces(np.ones((1, 3, 4, 1)), np.array([0, 0, 1, 1]))
    >>> pieces.count, pieces.share.round(3).tolist(), pieces.build_jumps().shape
    (2, [0.707, 0.707, 0.707, 0.707], (1, 3, 4, 2))
    >>> pieces.build_jumps()[0, :, 0].round(3).tolist()
    [[1.414, 0.0], [0.707, 0.707], [0.0, 1.414]]
    """

    jumps: Array
    piece: Array

    @property
    def count(self) -> int:
        """Number of pieces."""
        return int(self.piece[-1]) + 1

    @property
    def share(self) -> Array:
        """1/√rows of every row's piece (n,): what one σ of the piece is in each of its rows."""
        return 1 / np.sqrt(np.bincount(self.piece))[self.piece]

    def build_jumps(self) -> Array:
        """Jumps in the steps by one σ of every piece, (R, n − 1, 4, c · pieces): of a row's mean
        half in the step before its middle, half in that behind."""
        runs, steps, _, commands = self.jumps.shape
        out = np.zeros((runs, steps, 4, commands, self.count))
        k = np.arange(steps)
        for row in (k, k + 1):
            part = self.jumps * self.share[row][:, None, None]
            out[:, k, :, :, self.piece[row]] += np.moveaxis(part, 1, 0)
        return out.reshape(runs, steps, 4, commands * self.count)

    def compute_jumps(self, run: int, value: Array) -> Array:
        """Jumps (n − 1, 2) of one run's steps by values (c · pieces,) of its pieces."""
        rows = value.reshape(-1, self.count)[:, self.piece] * self.share
        return np.asarray(
            to_complex(np.einsum("kic,ck->ki", self.jumps[run], rows[:, 1:] + rows[:, :-1]))
        )


@dataclass(frozen=True)
class WalkPart:
    """One run's pieces as one part of the scatter: D = Q√Λ Vᵀ over σ, of which V (c · pieces, r)
    stands here; without pieces what scatters is no walk."""

    run: int
    pieces: LogPieces | None
    turn: Array


@dataclass(frozen=True)
class Walk:
    """The likely part of what may scatter: jumps of the motion in every step (R, n − 1, 2), and by
    how much they moved what is seen (R, n, 2) where they were found; the parts stand in the order
    of those of the scatter. Likewise of what loops answered, in jumps too, or by the commands'
    frame, which the runs hold: by how much it moved what is seen, `answered`, to first order about
    a motion, `along` (R, n, 2), since so much of it is known with its covariance."""

    parts: tuple[WalkPart, ...]
    jumps: Array
    seen: Array
    answers: Array | None = None
    answered: Array | None = None
    along: Array | None = None

    @classmethod
    def make_still(cls, motion: Array) -> Walk:
        """That of runs (R, n, 2) which do not walk."""
        return cls((), np.zeros_like(motion[:, 1:]), np.zeros_like(motion))

    def stand_still(self) -> Walk:
        """The same of the answers alone, before it is asked anew."""
        return replace(self, jumps=np.zeros_like(self.jumps), seen=np.zeros_like(self.seen))

    @property
    def moved(self) -> Array:
        """All that it moved of what is seen, (R, n, 2)."""
        return self.seen if self.answered is None else self.seen + self.answered

    @property
    def all_jumps(self) -> Array:
        """Those of the answers among them."""
        return self.jumps if self.answers is None else self.jumps + self.answers

    def estimate_jumps(self, residual: Array, scatter: Softened) -> Array:
        """Jumps (R, n − 1, 2) by the likeliest values of all pieces, w = Dᵀ C⁻¹ r, of a residual
        (N,) that is whitened by C^{−1/2}."""
        left, jumps = residual.copy(), np.zeros_like(self.jumps)
        for part, (rows, Q, power) in zip(reversed(self.parts), reversed(scatter.own), strict=True):
            along = Q.T @ left[rows] / np.sqrt(1 + power)
            if part.pieces is not None:
                value = part.turn @ (np.sqrt(power) * along)
                jumps[part.run] += part.pieces.compute_jumps(part.run, value)
            left[rows] -= Q @ (along * (np.sqrt(1 + power) - 1))
        return jumps
