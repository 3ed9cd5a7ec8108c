"""Coefficients of tables as a rehearsal holds them against the file's."""

from types import SimpleNamespace

import numpy as np
import pytest
from forced_runs import Truth, programme

from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.rehearsing.rehearsed_figures import compare_figures


@pytest.fixture(scope="module")
def tables():
    waves = programme(Truth(3), (20,), (0.3, -0.3, 0.15, -0.15), duration=30.0, noise=1e-6)
    return calibrate(waves, bootstrap=0, harmonics=2, scale_factor_harmonics=2, model="table")


@pytest.mark.parametrize(("place", "seen"), [(4, False), (1, True)])
def test_a_harmonic_that_the_file_does_not_see_is_held_as_well_as_the_file_knows_it(
    tables, place, seen
):
    """Averaged with its absence it was 0.2 of its σ in the file, and absent to 4e-9 in the twin: 42 of
    those σ, of tables that were right."""
    value = np.array(tables.scale_factor_harmonics)
    std = np.array(tables.scale_factor_harmonics_std)
    value[0, place] = (20.0 if seen else 0.2) * std[0, place]
    file = tables.replace(scale_factor_harmonics=value)
    absent = value.copy()
    absent[0, place] = 0.0
    sure = std.copy()
    sure[0, place] *= 1e-3
    again = tables.replace(scale_factor_harmonics=absent, scale_factor_harmonics_std=sure)
    name = {4: "sin 2·2mθ", 1: "cos 1·2mθ"}[place]
    figures = compare_figures(again, SimpleNamespace(truth=file, settings={}))
    t = figures[f"scale_factor {name} at 20 °C"].compute_t()
    assert abs(t) > 1e3 if seen else abs(t) == pytest.approx(0.2)
