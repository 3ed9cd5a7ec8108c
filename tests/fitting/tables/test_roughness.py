"""The price of a table's curvature: that of the curve, not of where its nodes lie or of their unit."""

import numpy as np
import pytest

from hrg_cli.fitting.tables.table_layout import TableLayout, compute_roughness

UNEVEN = np.array([0.0, 3.0, 10.0, 14.0, 30.0, 33.0])


def price(nodes, values):
    penalty = compute_roughness(TableLayout(nodes, "temperature", 2, 0, 0))[::2, ::2]
    return float(values @ penalty @ values)


@pytest.mark.parametrize("unit", [1e-3, 1.0, 5e3])
def test_the_price_is_free_of_the_unit_of_the_nodes(unit):
    values = np.random.default_rng(0).normal(size=len(UNEVEN))
    assert price(unit * UNEVEN, values) == pytest.approx(price(UNEVEN, values), rel=1e-9)


def test_a_parabola_costs_its_curvature_wherever_the_nodes_lie():
    """∫ 2² dx over what the inner nodes stand for, by X³/J."""
    spans = [(right - left) / 2 for left, right in zip(UNEVEN, UNEVEN[2:], strict=False)]
    wanted = 4 * sum(spans) * np.ptp(UNEVEN) ** 3 / len(UNEVEN)
    assert price(UNEVEN, UNEVEN**2) == pytest.approx(wanted)
    assert price(UNEVEN, 1 + 2 * UNEVEN) == pytest.approx(0.0, abs=1e-9)
