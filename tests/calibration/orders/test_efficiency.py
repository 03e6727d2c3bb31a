"""Efficiencies come out of ratios averaged over filters, with deviations that hold."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dsl_core.calibration.orders.efficiency import (
    RatioSample,
    fit_efficiency,
    require_both_orders,
    second_order_curve,
    second_order_share,
    shares_of_sides,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.filters import FINE_NM, nominal_filter, passed
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.solve.smooth_functions import solve_smooth

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


@pytest.mark.parametrize("centres", [(450, 640), (450, 550, 650), (430, 500, 570, 660)])
def test_few_filters_do_not_say_that_a_curve_is_straight(centres: tuple[int, ...]) -> None:
    inside = []
    for seed in range(6):
        rig, rng = random_rig(seed, published_rig()), np.random.default_rng(seed)
        for order in (1, -1):
            truth = rig.efficiency[order]
            light = [light for nm in centres for light in passed(rig, nominal_filter(nm)) if light.any()]
            ratio = [float(each @ truth.at(FINE_NM) / each.sum()) for each in light]
            seen = [
                RatioSample(r * (1 + 2e-3 * rng.normal()), 2e-3 * r, each)
                for r, each in zip(ratio, light, strict=True)
            ]
            found = fit_efficiency(order, seen).curve
            assert found.std is not None
            std = np.interp(NM, found.wavelengths_nm, found.std)
            inside.append(np.abs(found.at(NM) - truth.at(NM)) < 1.96 * std)
    assert np.mean(inside) > 0.9


def test_scatter_beyond_the_stated_noise_is_noticed() -> None:
    noisy = samples(1, 0, range(430, 661, 10), noise=0.02)
    fit = fit_efficiency(1, [RatioSample(s.ratio, s.ratio * 1e-3, s.light) for s in noisy])
    assert fit.misfit >= 8.0


def test_one_filter_is_not_enough() -> None:
    with pytest.raises(CalibrationError, match=r"Order \+1 was found through 3 filters"):
        fit_efficiency(1, samples(1, 0, range(500, 501)))


def test_a_film_of_one_order_is_told_as_one() -> None:
    seen = samples(1, 0, range(430, 661, 40))
    nothing = [RatioSample(0.0, 1e-3, each.light) for each in seen]
    require_both_orders({1: seen, -1: seen})
    require_both_orders({1: nothing, -1: nothing})
    told = r"Order -1 was found through none of the filters, order \+1 through \d+: the film sends no light"
    with pytest.raises(CalibrationError, match=told):
        require_both_orders({1: seen, -1: nothing})


def test_second_orders_are_a_share_of_the_first_and_may_be_unknown() -> None:
    share, std = second_order_share([(0.004, 0.0002, 0.1), (0.0085, 0.0002, 0.2), (np.nan, np.inf, 0.1)])
    assert share == pytest.approx(0.0416, abs=3e-3)
    assert 5e-4 < std < 4e-3
    assert second_order_share([(np.nan, np.inf, 0.1)]) == (0.0, np.inf)


def test_the_deviation_of_the_second_order_is_that_of_a_weighted_mean() -> None:
    shares = np.array([0.04, 0.05, 0.042])
    first, std = np.array([0.1, 0.2, 0.15]), np.array([2e-4, 3e-4, 5e-4])
    weight = (first / std) ** 2
    mean = (weight * shares).sum() / weight.sum()
    share, share_std = second_order_share(list(zip(shares * first, std, first, strict=True)))
    assert share == pytest.approx(mean)
    # These scatter far beyond their noise, which widens the deviation by as much.
    chi = (weight * (shares - mean) ** 2).sum() / 2
    assert chi > 5
    assert share_std == pytest.approx(np.sqrt(chi / weight.sum()))
    assert second_order_share([(0.004, 2e-4, 0.1)] * 4) == pytest.approx((0.04, 1e-3))


def test_a_side_without_second_orders_has_about_those_of_the_other() -> None:
    none = 0.0, np.inf
    assert shares_of_sides({1: (0.03, 0.001), -1: (0.05, 0.002)}) == {1: (0.03, 0.001), -1: (0.05, 0.002)}
    assert shares_of_sides({1: none, -1: none}) == {}
    found = shares_of_sides({1: (0.04, 0.001), -1: none})
    assert found[1] == (0.04, 0.001)
    assert found[-1] == pytest.approx((0.04, np.hypot(0.001, 0.008)))


def test_deviations_of_the_second_order_cover_the_share() -> None:
    rng, sigmas = np.random.default_rng(0), []
    for _ in range(200):
        first = rng.uniform(0.08, 0.12, 12)
        noisy = [(0.05 * f + 3e-4 * rng.normal(), 3e-4, f) for f in first]
        share, std = second_order_share(noisy)
        sigmas.append((share - 0.05) / std)
    assert 0.75 < np.std(sigmas) < 1.05


def test_a_second_order_has_the_deviations_of_the_first_and_of_its_share() -> None:
    first = SpectralCurve.of([450.0, 550.0, 650.0], [0.1, 0.2, 0.05], std=[0.003, 0.001, 0.0])
    second = second_order_curve(first, 0.04, 0.005)
    assert second.values == pytest.approx([0.004, 0.008, 0.002])
    assert second.std is not None
    expected = [np.hypot(0.04 * 0.003, 0.005 * 0.1), np.hypot(0.04 * 0.001, 0.005 * 0.2), 0.005 * 0.05]
    assert second.std == pytest.approx(expected)


def test_the_share_of_second_orders_is_a_weighted_mean_with_the_larger_deviation() -> None:
    samples = [(0.02, 0.004, 0.5), (0.08, 0.01, 1.0), (0.05, np.inf, 1.0), (0.05, 0.01, 0.0)]
    share, std = second_order_share(samples)
    weight = np.array([(0.5 / 0.004) ** 2, (1.0 / 0.01) ** 2])
    each = np.array([0.04, 0.08])
    mean = weight @ each / weight.sum()
    chi = weight @ (each - mean) ** 2
    assert chi > 1
    assert share == pytest.approx(mean)
    assert std == pytest.approx(np.sqrt(chi / weight.sum()))
    assert second_order_share([(0.02, 0.01, 0.5)]) == pytest.approx((0.04, 0.02))
    assert second_order_share([(-0.02, 0.01, 0.5)])[0] == 0.0
    assert second_order_share([(0.1, np.inf, 0.5)]) == (0.0, np.inf)


def test_a_second_order_has_the_deviations_of_share_and_first() -> None:
    first = SpectralCurve.of([400.0, 700.0], [0.2, 0.4], std=[0.01, 0.02])
    second = second_order_curve(first, 0.1, 0.03)
    assert second.values == pytest.approx((0.02, 0.04))
    assert second.std == pytest.approx((np.hypot(0.001, 0.006), np.hypot(0.002, 0.012)))


def test_ratios_are_means_of_the_curve_over_their_light_as_smooth_as_they_say(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = list[Any]()

    def noted(*parts: Any, **choices: Any) -> Any:
        asked.append((*parts, choices))
        return solve_smooth(*parts, **choices)

    monkeypatch.setattr("dsl_core.calibration.orders.efficiency.solve_smooth", noted)
    seen = samples(1, 0, range(450, 651, 50))
    fit_efficiency(1, [*seen, RatioSample(2.9, 1.0, seen[0].light), RatioSample(1.0, np.inf, seen[0].light)])
    assert len(asked) == 4
    equations, (function,), choices = asked[-1]
    assert (function.level_std, function.rise_std) == (4.0, 2.0)
    # From a curve that hardly bends to one that bends as it likes, by about half decades and by octaves.
    assert np.log10(choices["amplitudes"]) == pytest.approx([-2.52, -2, -1.52, -1, -0.52], abs=0.01)
    assert np.log2(choices["lengths"]) == pytest.approx(np.log2(30) + np.arange(4))
    assert choices["noise_factors"] == (1.0, 1.4, 2.0, 4.0, 8.0)
    # What is not three deviations above nothing is not used; a level moves every logarithm by as much.
    assert equations.count == len(seen)
    level = np.ones(len(equations.right))
    assert level @ equations.normal @ level == pytest.approx(len(seen) / (1e-3**2 + 8e-4**2), rel=5e-3)


def test_a_ratio_counts_from_three_deviations_on() -> None:
    seen = samples(1, 0, range(450, 651, 100))
    few = [s for s in seen if round(float(s.light @ FINE_NM / s.light.sum())) < 500]
    for sigmas, counts in ((3.1, True), (2.9, False)):
        other = RatioSample(seen[-1].ratio, seen[-1].ratio / sigmas, seen[-1].light)
        if counts:
            assert fit_efficiency(1, [few[0], other]).curve.values
        else:
            with pytest.raises(CalibrationError, match="through 1 filters"):
                fit_efficiency(1, [few[0], other])


def test_a_curve_has_a_value_every_two_nanometres_over_all_nodes() -> None:
    curve = fit_efficiency(1, samples(1, 0, range(450, 651, 50))).curve
    assert list(curve.wavelengths_nm) == [400.0 + 2 * k for k in range(151)]
