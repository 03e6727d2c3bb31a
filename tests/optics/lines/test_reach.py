"""Which bands first orders reach, and that an order which a film does not have reaches none."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.lines.reach import sends_light, unreached_share
from dsl_core.simulation.published_rig import published_rig

NM = np.array([450.0, 550.0, 650.0])


def with_orders(*orders: int) -> Rig:
    """The published rig with some of its orders only."""
    rig = published_rig()
    return rig.model_copy(update={"efficiency": {order: rig.efficiency[order] for order in orders}})


def test_a_film_sends_light_only_through_orders_that_it_has() -> None:
    for orders in ((1, -1), (1,), (-1,), (2,), ()):
        rig = published_rig()
        known = {order: rig.efficiency.get(order, rig.efficiency[1]) for order in orders}
        rig = rig.model_copy(update={"efficiency": known})
        for order in (1, -1):
            assert sends_light(rig, order, NM).tolist() == [order in orders] * 3


def test_an_order_that_hardly_gets_any_light_reaches_nothing() -> None:
    curves = {
        1: SpectralCurve.of([450.0, 650.0], [0.2, 0.4]),
        -1: SpectralCurve.of([450.0, 650.0], [0.0, 0.01]),
    }
    rig = published_rig().model_copy(update={"efficiency": curves})
    assert sends_light(rig, 1, NM).all()
    assert sends_light(rig, -1, NM).tolist() == [False, True, True]


@pytest.mark.parametrize("order", [1, -1])
def test_a_rig_with_one_first_order_leaves_more_bands_unreached(order: int) -> None:
    both, one = unreached_share(with_orders(1, -1)), unreached_share(with_orders(order))
    assert both < 0.1
    assert one > 0.3
    assert unreached_share(with_orders()) == 1
