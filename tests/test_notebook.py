"""Records in a notebook: short, with coordinates, with a plot; correlated parameters; types that a
checker sees."""

import ast
from pathlib import Path

import numpy as np
import pytest
import records_by_hand as by_hand

import hrg_cli
from hrg_cli.errors import HrgError
from hrg_cli.records import FLAG_GAP


@pytest.mark.parametrize("kind", by_hand.RECORDS)
def test_short_names_and_plots(kind):
    mpl = pytest.importorskip("matplotlib")
    mpl.use("Agg")
    record = by_hand.RECORDS[kind]()
    assert len(repr(record)) < 200 and record.status in repr(record) and "\n" not in repr(record)
    assert (
        "<table>" in record._repr_html_()
        and "<script" not in record.replace(status_reasons=("<script>",))._repr_html_()
    )
    ax = record.plot()
    assert ax.get_ylabel() and (ax.lines or ax.collections)
    with pytest.raises(HrgError, match="no column"):
        record.plot(column="nothing")


@pytest.mark.parametrize(
    ("kind", "against", "shown"),
    [
        ("recording", "time_s", "c"),
        ("wave", "time_s", "wave_angle_rad, rad"),
        ("calibration", "wave_angle_rad", "drift_rad_s, rad s-1"),
    ],
)
def test_the_first_plot_is_of_what_was_measured(kind, against, shown):
    """A calibration's was of its own nodes, a recording's against the row."""
    mpl = pytest.importorskip("matplotlib")
    mpl.use("Agg")
    record = by_hand.RECORDS[kind]()
    ax = record.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == (against, shown)
    if kind == "recording":
        assert ax.lines[0].get_xdata()[:3] == pytest.approx(np.arange(3) / record.sample_rate_hz)


def test_even_samples_have_times():
    pytest.importorskip("xarray")
    record = by_hand.recording()
    data = record.to_xarray()
    assert data.c.dims == ("time_s",) and data.time_s.attrs["units"] == "s"
    assert np.diff(data.time_s) == pytest.approx(1 / record.sample_rate_hz)


def test_xarray_has_coordinates():
    pytest.importorskip("xarray")
    wave = by_hand.wave().to_xarray()
    assert (
        wave.wave_angle_rad.dims == ("time_s",)
        and "temperature_degc" in wave.coords
        and wave.time_s.attrs["units"] == "s"
    )
    part = wave.sel(time_s=slice(float(wave.time_s[3]), float(wave.time_s[9])))
    assert part.sizes["time_s"] == 7
    table = by_hand.calibration().to_xarray()
    assert set(table.drift_rad_s.dims) == {"temperature_degc", "wave_angle_rad"}
    resonator = by_hand.resonator().to_xarray()
    assert float(resonator.value.sel(name="scale_factor")) == by_hand.resonator().get(
        "scale_factor"
    )
    assert int(by_hand.wave().to_xarray().flags.max()) <= 2 * 8 and FLAG_GAP == 2


def test_tables_are_evaluated():
    """At its own nodes a table gives its own values; a node beyond its range is refused."""
    table = by_hand.calibration()
    drift, scale = table.evaluate(
        np.asarray(table.node)[:, None], np.asarray(table.wave_angle_rad)[None]
    )
    assert drift.shape == scale.shape == table.drift_rad_s.shape
    assert drift == pytest.approx(
        table.drift_rad_s, abs=1e-9 + 1e-6 * np.abs(table.drift_rad_s).max()
    )
    with pytest.raises(HrgError, match="the tables are for"):
        table.evaluate(float(table.node_max) + 50, 0.0)


def test_parameters_are_correlated():
    """σ of a difference of two correlated parameters is that of the covariance, not the sum of
    squares."""
    pytest.importorskip("uncertainties")
    record = by_hand.resonator()
    numbers = record.uncertain()
    a, b = (list(record.name).index(n) for n in ("scale_factor", "damping_split_1_s"))
    C = record.covariance
    wanted = np.sqrt(C[a, a] + C[b, b] - 2 * C[a, b])
    assert (numbers["scale_factor"] - numbers["damping_split_1_s"]).std_dev == pytest.approx(
        wanted, rel=1e-9
    )


def test_a_type_checker_sees_the_public_names():
    """The names under TYPE_CHECKING are those that load on first use, from the same places."""
    tree = ast.parse(Path(hrg_cli.__file__).read_text())
    block = next(
        n
        for n in tree.body
        if isinstance(n, ast.If) and getattr(n.test, "id", "") == "TYPE_CHECKING"
    )
    seen = {
        a.asname: (f"hrg_cli.{n.module}" if n.module else "hrg_cli", a.name)
        for n in block.body
        for a in n.names
    }
    loaded = {
        k: (module, name) if name else ("hrg_cli", k)
        for k, (module, name) in hrg_cli._PUBLIC.items()
    }
    assert seen == loaded and all(getattr(hrg_cli, name) is not None for name in seen)
