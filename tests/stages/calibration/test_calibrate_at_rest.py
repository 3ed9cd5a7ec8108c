"""Dwells at rest alone tell no scale factor: said, and the refused tables can be read."""

import pytest

from hrg_cli import collect, demodulate, estimate, simulate, store
from hrg_cli.stages.calibrate import calibrate


def dwell(angle_rad):
    """A driven run at rest, at one temperature."""
    config = {
        "device": {"frequency_hz": 203.7, "damping_rate_1_s": 0.05, "scale_factor": 0.28},
        "recording": {"sample_rate_hz": 911.3, "duration_s": 20.0},
        "readout": {"noise": 1e-3},
        "run": [
            {
                "run_id": f"at{angle_rad}",
                "control": {"mode": "forced"},
                "start": {"wave_angle_rad": angle_rad},
                "environment": {"rate_rad_s": 0.0, "temperature_degc": 25.0},
            }
        ],
    }
    return collect(estimate(collect(demodulate(collect(simulate(config)), periods_per_window=20))))


def test_tables_of_dwells_at_rest_are_refused_and_written(tmp_path):
    """They were an error of the file, "look for values out of all proportion in the input"."""
    tables = calibrate([dwell(angle) for angle in (0.1, 0.6, 1.2)])
    assert tables.status == "refused"
    assert "the scale factor K cannot be told" in " ".join(tables.status_reasons)
    store.write(tmp_path / "rest.h5", tables)
    assert store.read_any(tmp_path / "rest.h5").status == "refused"


def test_tables_in_use_hold_no_scale_factor_of_zero(tmp_path):
    tables = calibrate([dwell(angle) for angle in (0.1, 0.6, 1.2)])
    used = tables.replace(status="suspect")
    with pytest.raises(Exception, match="scale_factor holds 0"):
        store.write(tmp_path / "used.h5", used)
