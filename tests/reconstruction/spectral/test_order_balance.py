"""A film that was turned over is told by pixels that both first orders reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.model.spectral import SpectralCurve
from dsl_core.reconstruction.spectral.first_order_light import NM, FirstOrderLight
from dsl_core.reconstruction.spectral.order_balance import order_balance_finding

from .conftest import Lines


def test_orders_as_calibrated_are_not_talked_of(chart: Lines) -> None:
    assert order_balance_finding(chart.rig, chart.light()) is None


def test_a_film_that_was_turned_over_is_told_with_the_ratio(chart: Lines) -> None:
    orders = chart.rig.efficiency
    turned = chart.rig.model_copy(update={"efficiency": {**orders, 1: orders[-1], -1: orders[1]}})
    found = order_balance_finding(turned, chart.light())
    assert found is not None
    assert found.significant
    assert found.part == "orders"
    wavelengths = (450.0, 550.0, 650.0)
    ratio = (orders[1].at(wavelengths) / orders[-1].at(wavelengths)).mean() ** 2
    assert found.value == pytest.approx(ratio - 1, rel=0.1)
    assert "turned over" in found.sentence


def test_a_small_difference_is_left_to_what_follows_it(chart: Lines) -> None:
    first = chart.rig.efficiency[1]
    dimmer = SpectralCurve.of(first.wavelengths_nm, [value / 1.15 for value in first.values])
    rig = chart.rig.model_copy(update={"efficiency": {**chart.rig.efficiency, 1: dimmer}})
    assert order_balance_finding(rig, chart.light()) is None


def test_nothing_is_told_by_noise_or_of_a_film_with_one_order(chart: Lines) -> None:
    orders = chart.rig.efficiency
    turned = chart.rig.model_copy(update={"efficiency": {**orders, 1: orders[-1], -1: orders[1]}})
    noisy = replace(chart.picked, std=1000 * chart.picked.std)
    assert order_balance_finding(turned, chart.light(noisy)) is None
    for one in ({1: orders[-1], -2: orders[-1]}, {-1: orders[1], 2: orders[1]}):
        assert order_balance_finding(chart.rig.model_copy(update={"efficiency": one}), chart.light()) is None


@pytest.mark.parametrize("dim", [1, -1])
def test_wavelengths_at_which_either_order_is_in_the_noise_say_nothing(dim: int, chart: Lines) -> None:
    """A hundred pixels in whose one order there is hardly any light, as in front of a shield."""
    shape = (len(NM), 100)
    radiance = {order: np.full(shape, 0.5 if order == dim else 50.0) for order in (1, -1)}
    variance = {order: np.full(shape, 1.0) for order in (1, -1)}
    light = FirstOrderLight(np.zeros(100, np.intp), radiance, variance)
    assert order_balance_finding(chart.rig, light) is None
    sure = FirstOrderLight(light.site, radiance, {order: 0.01 * variance[order] for order in (1, -1)})
    assert order_balance_finding(chart.rig, sure) is not None
