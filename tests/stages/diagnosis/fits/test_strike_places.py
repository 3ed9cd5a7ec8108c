"""The place of a strike, however strong it is."""

import pytest

from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
from hrg_cli.stages.diagnosis.fits.places import find_another_start


@pytest.mark.parametrize("turn_rad", [1e-3, 3e-3, 1e-2])
def test_a_run_moves_on_as_from_another_start_where_its_wave_was_turned(turn_rad):
    """From 3 mrad on the chance is 0 as a number at many rows, from 10 mrad on in another run too."""
    first, second, third = draw_waves()
    turn = turn_rad * (second.time_s > 0.5)
    turned = second.replace(wave_angle_rad=second.wave_angle_rad + turn)
    place = find_another_start(fit_waves([first, turned, third]), slow=1.0)
    assert place is not None
    assert (place.run, place.row) == (1, 25)
