"""The resonator's mechanical parameters: what `hrg identify` finds in waves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..notebook import need_package
from .columns import JSON_LIST, JSON_OBJECT, ORDER, SCATTER, Array, Valid, attribute, column
from .record import Record


@dataclass(frozen=True, kw_only=True, repr=False)
class Resonator(Record):
    """Mechanical parameters with covariance, and how well each run agrees."""

    kind: ClassVar[str] = "resonator"
    made_by: ClassVar[str] = "hrg identify"
    name: Array = column("1", "parameter", ("parameter",), dtype="str")
    value: Array = column("any", "value", ("parameter",))
    std: Array = column("any", "standard deviation", ("parameter",), valid=SCATTER)
    units: Array = column("1", "unit", ("parameter",), dtype="str")
    covariance: Array = column("any", "covariance of the values", ("parameter", "parameter_2"))
    method: str = attribute("method of identification", default="likelihood")
    mode_number: int = attribute("angular mode number m", default=2, dtype="i8", valid=ORDER)
    gyro_id: str = attribute("the gyro", default="")
    lot_id: str = attribute("the lot", default="")
    chi2_per_dof: float = attribute(
        "χ² per degree of freedom of the fit",
        default=float("nan"),
        dtype="f8",
        valid=Valid(missing="anywhere", infinite=True, at_least=0),
    )
    condition: float = attribute(
        "condition number of the scaled Fisher information",
        default=float("nan"),
        dtype="f8",
        valid=Valid(missing="anywhere", infinite=True, at_least=0),
    )
    temperature_degc: float | None = attribute(
        "mean temperature of the runs, where it was logged", default=None, dtype="f8"
    )
    temperature_span_degc: float | None = attribute(
        "range of the runs' temperatures", default=None, dtype="f8", valid=SCATTER
    )
    flat_directions: str = attribute(
        "JSON list of sentences: what these runs cannot tell", default="[]", valid=JSON_LIST
    )
    details: str = attribute(
        "JSON: method comparison, profiles, bounds", default="{}", valid=JSON_OBJECT
    )
    run: Array | None = column(
        "1", "run", ("run",), group="/fit", name="run_id", dtype="str", optional=True
    )
    run_chi2_per_dof: Array | None = column(
        "1",
        "χ² per degree of freedom of the run",
        ("run",),
        group="/fit",
        name="chi2_per_dof",
        optional=True,
        valid=Valid(missing="anywhere", at_least=0),
    )
    run_residual_rms: Array | None = column(
        "any",
        "rms of the run's envelope residual",
        ("run",),
        group="/fit",
        name="residual_rms",
        optional=True,
        valid=Valid(missing="anywhere", at_least=0),
    )
    run_rows: Array | None = column(
        "1",
        "windows used of the run",
        ("run",),
        group="/fit",
        name="rows",
        dtype="i8",
        optional=True,
        valid=SCATTER,
    )

    def parameters(self) -> dict[str, tuple[float, float, str]]:
        """All parameters by name.

        Returns
        -------
        dict
            name -> (value, standard deviation, unit), in the order of the covariance.
        """
        return {
            str(n): (float(v), float(s), str(u))
            for n, v, s, u in zip(self.name, self.value, self.std, self.units)
        }

    @property
    def modes_alone(self) -> bool:
        """Whether it came from runs of one signal each, which show frequencies and decays but no
        wave that turns."""
        return not {"stiffness_axis_rad", "damping_axis_rad"} & set(map(str, self.name))

    def get(self, name: str) -> float:
        """Value of one parameter.

        Parameters
        ----------
        name
            As in `name`, such as "damping_rate_1_s".

        Returns
        -------
        float
            In the parameter's unit.

        Raises
        ------
        KeyError
            The resonator does not have it: its runs could not tell it.
        """
        return self.parameters()[name][0]

    def uncertain(self) -> dict[str, Any]:
        """The parameters as correlated numbers: what is computed from them has its right σ.

        Returns
        -------
        dict
            name -> a number of the package `uncertainties`.

        Raises
        ------
        HrgError
            The package is not installed.
        """
        package, values = (
            need_package("uncertainties", "uncertain()"),
            np.asarray(self.value, float),
        )
        numbers = package.correlated_values(values, np.asarray(self.covariance, float))
        return dict(zip(map(str, self.name), numbers, strict=True))
