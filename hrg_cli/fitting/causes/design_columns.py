"""Which column of the design is which number: parameters are found by name and slice, never by
parsing a label.

The order is that of the columns: shared coordinates of the resonator, then each run's own numbers,
then the effects' parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..envelopes.coordinates import COORDINATES

Array = np.ndarray
OWN = 5
"""Numbers of a run's own: start state (4 reals) and frequency offset."""
FREQUENCY = OWN - 1
"""Place of the frequency offset among them."""


@dataclass(frozen=True)
class FitColumns:
    """Ordered names of everything fitted.

    Parameters
    ----------
    coordinates
        Of the resonator, by their places in `COORDINATES`.
    runs
        How many; each has `OWN` columns.
    effects
        With the names of their fitted parameters.

    Examples
    --------
    Damping and K, two runs and one effect:

    >>> from hrg_cli.fitting.causes.design_columns import FitColumns
    >>> layout = FitColumns((0, 5), 2, (("gain_mismatch", ("gain",)),))
    >>> layout.count, layout.coordinate("scale_factor"), layout.run(1), layout.frequency(1)
    (13, 1, slice(7, 12, None), 11)
    >>> layout.parameter("gain_mismatch", "gain"), layout.shared.tolist()
    (12, [0, 1, 12])
    """

    coordinates: tuple[int, ...]
    runs: int
    effects: tuple[tuple[str, tuple[str, ...]], ...] = ()

    @property
    def count(self) -> int:
        """Number of columns."""
        return (
            len(self.coordinates) + self.runs * OWN + sum(len(names) for _, names in self.effects)
        )

    @property
    def shared(self) -> Array:
        """Columns of the coordinates and of the effects, which every run may feel."""
        first = len(self.coordinates)
        return np.r_[0:first, first + self.runs * OWN : self.count]

    def coordinate(self, name: str) -> int | None:
        """Column of a coordinate by its name; None where it is held."""
        index = COORDINATES.index(name)
        return self.coordinates.index(index) if index in self.coordinates else None

    def run(self, number: int) -> slice:
        """Columns of a run's own numbers."""
        first = len(self.coordinates) + number * OWN
        return slice(first, first + OWN)

    def frequency(self, number: int) -> int:
        """Column of a run's frequency offset."""
        return self.run(number).start + FREQUENCY

    def effect(self, name: str) -> slice:
        """Columns of an effect's fitted parameters, in their order. KeyError: it is not in the
        fit."""
        first = len(self.coordinates) + self.runs * OWN
        for other, parameters in self.effects:
            if other == name:
                return slice(first, first + len(parameters))
            first += len(parameters)
        raise KeyError(name)

    def parameters(self, name: str) -> tuple[str, ...]:
        """Fitted parameters of an effect; none where it is not in the fit."""
        return dict(self.effects).get(name, ())

    def parameter(self, effect: str, name: str) -> int:
        """Column of one parameter of an effect. KeyError: it is not fitted."""
        names = self.parameters(effect)
        if name not in names:
            raise KeyError(f"{effect}.{name}")
        return self.effect(effect).start + names.index(name)

    def groups(self) -> Iterator[tuple[str, str, slice]]:
        """("coordinate" | "run" | "effect", its name or number, its columns), in order."""
        for place, index in enumerate(self.coordinates):
            yield "coordinate", COORDINATES[index], slice(place, place + 1)
        for number in range(self.runs):
            yield "run", str(number), self.run(number)
        for name, _ in self.effects:
            yield "effect", name, self.effect(name)

    def spread_rows(self, columns: Sequence[int], rows: Array) -> Array:
        """Rows (m, len(columns)) spread over all columns, (m, count)."""
        out = np.zeros((len(rows), self.count))
        out[:, list(columns)] = rows
        return out
