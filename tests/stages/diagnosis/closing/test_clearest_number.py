"""Numbers of a cause that are off zero together and none by itself."""

import numpy as np
import pytest

from hrg_cli.effects import find
from hrg_cli.stages.diagnosis.closing.sized import Sized
from hrg_cli.stages.diagnosis.drawn_case import draw_case


class Believed(Sized):
    """Sizes of a cause as they are laid down here."""

    off_zero = (np.array([1.0, 1.0]), np.array([[1.0, -0.999], [-0.999, 1.0]]))

    def _measure_off(self, effect):
        return self.off_zero


def test_numbers_that_only_together_are_off_zero_are_not_clear():
    """45 σ along their sum, 1 σ each: beside a rest of χ² 5 an ageing of 31.6 σ had numbers of 0.2,
    1.1 and 2.1 σ."""
    ordinary = Sized.from_case(draw_case())
    sized = Believed(ordinary.fit, ordinary.beside, ordinary.factor)
    ageing = find("ageing")
    assert sized.measure_sigma_off(ageing) == pytest.approx(np.sqrt(2 / 0.001), rel=1e-6)
    assert sized.measure_clearest_sigma(ageing) == pytest.approx(1.0)


def test_one_clear_number_is_enough_and_none_is_clearer_than_all():
    ordinary = Sized.from_case(draw_case())
    sized = Believed(ordinary.fit, ordinary.beside, ordinary.factor)
    for off in (np.array([9.0, 0.1]), np.array([-2.0, 2.0])):
        sized.__class__.off_zero = (off, np.diag([1.0, 4.0]))
        clearest = sized.measure_clearest_sigma(find("ageing"))
        assert clearest == pytest.approx(np.max(np.abs(off) / [1.0, 2.0]))
        assert clearest <= sized.measure_sigma_off(find("ageing"))
