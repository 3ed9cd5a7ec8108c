"""What a record does in a notebook: a short name of itself, a table, an xarray dataset with
coordinates, a first plot.

Everything follows from the columns' declarations; xarray, matplotlib and uncertainties are loaded
when asked for.
"""

from __future__ import annotations

import html
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import HrgError
from .extras import tell_how_to_install

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes

COORDINATES = {
    "row": ("time_s", "wave_angle_rad", "temperature_degc", "rate_rad_s"),
    "auxiliary_row": ("auxiliary_time_s",),
    "truth_row": ("truth_time_s",),
    "parameter": ("name",),
    "parameter_2": ("name",),
    "node": ("temperature_degc", "frequency_hz"),
    "angle": ("wave_angle_rad",),
    "run": ("run",),
}
"""Dimension -> the columns that say where along it a value stands; the first that is there indexes
it."""
PLOTTED = (
    "wave_angle_rad",
    "rate_estimate_rad_s",
    "signals",
    "c",
    "drift_rad_s",
    "value",
    "measured",
)
"""Columns whose first plot tells most, in that order."""


def need_package(package: str, what: str) -> Any:
    """A package that the notebook's views need.

    Parameters
    ----------
    package
        Its name, or a module's in it.
    what
        What needs it, in words.

    Returns
    -------
    module
        Imported.

    Raises
    ------
    HrgError
        It is not installed.

    Examples
    --------
    >>> from hrg_cli.notebook import need_package
    >>> need_package("json.decoder", "a table").__name__
    'json.decoder'
    """
    try:
        return import_module(package)
    except ImportError as error:
        raise HrgError(f"{what} needs {tell_how_to_install(package.split('.')[0])}") from error


class NotebookView:
    """The methods; `columns()`, `kind`, `status` and `status_reasons` are the record's."""

    def __repr__(self) -> str:
        facts = ", ".join(f"{name}={value!r}" for name, value in _facts(self).items())
        return f"<{type(self).__name__} {self.status}: {facts}>"  # type: ignore[attr-defined]

    def _repr_html_(self) -> str:
        rows = {"status": self.status} | _facts(self)  # type: ignore[attr-defined]
        if self.status_reasons:  # type: ignore[attr-defined]
            rows["because"] = "; ".join(self.status_reasons)  # type: ignore[attr-defined]
        lines = "".join(_line(key, str(value)) for key, value in rows.items())
        caption = f"<caption><b>{html.escape(type(self).__name__)}</b></caption>"
        return f"<table>{caption}{lines}{_parameter_rows(self)}</table>"

    def to_xarray(self) -> xarray.Dataset:
        """The record as a dataset, with time, angle, temperature and names as coordinates.

        Returns
        -------
        xarray.Dataset
            A variable a column, its unit and meaning as attributes.

        Raises
        ------
        HrgError
            xarray is not installed.
        """
        xr = need_package("xarray", "to_xarray")
        variables, attributes = {}, {"kind": self.kind, "status": self.status}  # type: ignore[attr-defined]
        for name, spec in self.columns().items():  # type: ignore[attr-defined]
            value = getattr(self, name)
            if value is None:
                continue
            if spec.dims is None:
                attributes[name] = value
            else:
                variables[name] = (
                    spec.dims,
                    np.asarray(value[:]),
                    {"units": spec.units or "", "long_name": spec.meaning},
                )
        if (times := _even_times(self)) is not None:
            said = {"units": "s", "long_name": "time of each sample, from its rate"}
            variables["time_s"] = (("row",), times, said)
        data = xr.Dataset(variables, attrs=attributes)
        for dimension in list(data.dims):
            known = [
                n
                for n in COORDINATES.get(str(dimension), ())
                if n in variables and len(variables[n][0]) == 1
            ]
            own = [n for n in known if variables[n][0][0] == dimension]
            data = data.set_coords(own)
            if (
                own
                and own[0]
                in ("time_s", "name", "wave_angle_rad", "temperature_degc", "frequency_hz")
                and own[0] != dimension
            ):
                index = data[own[0]]
                if index.to_index().is_unique:
                    data = data.swap_dims({dimension: own[0]})
        return data

    def plot(self, ax: Axes | None = None, column: str | None = None) -> Axes:
        """A first look at one column against time, angle or name.

        Parameters
        ----------
        ax
            Axes to draw on; None: axes of its own.
        column
            Its field name; None: the one that tells most.

        Returns
        -------
        matplotlib.axes.Axes
            Labelled with names and units.

        Raises
        ------
        HrgError
            The record has no such column, or matplotlib is not installed.
        """
        columns = self.columns()  # type: ignore[attr-defined]
        there = [n for n, spec in columns.items() if spec.dims and getattr(self, n) is not None]
        telling = [n for n in PLOTTED if n in there and not _is_index(n, columns[n].dims)]
        name = column or next(iter(telling or there), "")
        if name not in there:
            raise HrgError(
                f"{name or 'the record'}: is no column of this {self.kind}; it has"  # type: ignore[attr-defined]
                f" {', '.join(there)}"
            )
        if ax is None:
            ax = need_package("matplotlib.pyplot", "plot").subplots()[1]
        spec, y = columns[name], np.asarray(getattr(self, name)[:])
        across = spec.dims[1] if spec.dims[0] == "node" and len(spec.dims) > 1 else spec.dims[0]
        along, x = _abscissa(self, name, across, y.shape[spec.dims.index(across)])
        ax.plot(x, y.T if across != spec.dims[0] else y, "o" if x.dtype.kind == "O" else "-")
        ax.set_xlabel(along)
        ax.set_ylabel(f"{name}, {spec.units}" if spec.units not in (None, "1", "any") else name)
        return ax


def _is_index(name: str, dims: Any) -> bool:
    """Whether a column says where along its dimension the others stand."""
    return len(dims) == 1 and COORDINATES.get(dims[0], ("",))[0] == name


def _even_times(record: Any) -> Any:
    """Times of the rows of evenly sampled channels, which no column holds; None for others."""
    rate = getattr(record, "sample_rate_hz", None)
    if rate is None or getattr(record, "time_s", None) is not None:
        return None
    return np.arange(len(record)) / rate


def _abscissa(record: Any, name: str, across: str, size: int) -> tuple[str, Any]:
    """What a column is plotted against, and its values: the coordinate of its dimension, else the
    row."""
    columns = record.columns()
    for along in COORDINATES.get(across, ()):
        there = along in columns and getattr(record, along) is not None
        if there and along != name and columns[along].dims == (across,):
            return along, np.asarray(getattr(record, along)[:])
    if across == "row" and (times := _even_times(record)) is not None:
        return "time_s", times
    return "row", np.arange(size)


def _facts(record: Any) -> dict[str, Any]:
    """Length, gyro, run, verdict: what tells one record from another."""
    facts: dict[str, Any] = {"rows": len(record)} if len(record) else {}
    for name in ("gyro_id", "run_id", "lot_id", "mode", "verdict", "method", "model"):
        value = getattr(record, name, "")
        if value:
            facts[name] = value
    return facts


def _parameter_rows(record: Any) -> str:
    if not hasattr(record, "parameters"):
        return ""
    return "".join(
        _line(name, f"{value:.10g} ± {std:.2g} {units}")
        for name, (value, std, units) in record.parameters().items()
    )


def _line(name: str, value: str) -> str:
    return (
        "<tr><th"
        f" style='text-align:left'>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
    )
