"""Efficiencies come out of ratios averaged over filters, with deviations that hold."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.orders.efficiency import RatioSample, fit_efficiency, second_order_share
from dsl_core.errors import CalibrationError
from dsl_core.optics.filters import FINE_NM, nominal_filter, passed
from dsl_core.simulation.published_rig import published_rig

NM = np.arange(430.0, 661.0, 5.0)


def samples(order: int, seed: int, centres: range, noise: float = 1e-3) -> list[RatioSample]:
    rig, rng = published_rig(), np.random.default_rng(seed)
    truth = rig.efficiency[order].at(FINE_NM)
    found = []
    for centre in centres:
        for light in passed(rig, nominal_filter(centre + rng.normal())):
            ratio = float(light @ truth / light.sum())
            found.append(RatioSample(ratio * (1 + noise * rng.normal()), ratio * noise, light))
    return found


@pytest.mark.parametrize("order", [1, -1])
def test_efficiency_is_within_a_fifth_of_a_percent_and_its_deviation(order: int) -> None:
    truth = published_rig().efficiency[order].at(NM)
    sigmas = []
    for seed in range(4):
        fit = fit_efficiency(order, samples(order, seed, range(430, 661, 10)))
        error = fit.curve.at(NM) / truth - 1
        assert np.sqrt(np.mean(error**2)) < 2e-3
        assert fit.curve.std is not None
        sigmas.append(error * truth / np.interp(NM, fit.curve.wavelengths_nm, fit.curve.std))
    assert 0.4 < np.sqrt(np.mean(np.square(sigmas))) < 1.4


def test_few_filters_give_a_curve_with_larger_deviation_between_them() -> None:
    fit = fit_efficiency(1, samples(1, 0, range(430, 661, 115)))
    truth = published_rig().efficiency[1].at(NM)
    assert fit.curve.std is not None
    spread = np.interp(NM, fit.curve.wavelengths_nm, fit.curve.std) / truth
    assert np.all(np.abs(fit.curve.at(NM) / truth - 1) < 4 * spread)
    assert np.interp(600.0, NM, spread) > 2 * np.interp(545.0, NM, spread)


def test_scatter_beyond_the_stated_noise_is_noticed() -> None:
    noisy = samples(1, 0, range(430, 661, 10), noise=0.02)
    fit = fit_efficiency(1, [RatioSample(s.ratio, s.ratio * 1e-3, s.light) for s in noisy])
    assert fit.misfit >= 8.0


def test_one_filter_is_not_enough() -> None:
    with pytest.raises(CalibrationError, match=r"Order \+1 was found through 3 filters"):
        fit_efficiency(1, samples(1, 0, range(500, 501)))


def test_second_orders_are_a_share_of_the_first_and_may_be_unknown() -> None:
    share, std = second_order_share([(0.004, 0.0002, 0.1), (0.0085, 0.0002, 0.2), (np.nan, np.inf, 0.1)])
    assert share == pytest.approx(0.0416, abs=3e-3)
    assert 5e-4 < std < 4e-3
    assert second_order_share([(np.nan, np.inf, 0.1)]) == (0.0, np.inf)
