"""From the light of filters to efficiencies and their deviations; filters that cannot be used are named."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.calibration.light.chain_equations import LineScan
from dsl_core.calibration.light.zero_order import ZeroOrderFit
from dsl_core.calibration.orders.bandpass import (
    SeenFilter,
    _check,
    _sample,
    _second,
    fit_bandpass,
    plane_pixels,
    profile_scan,
)
from dsl_core.calibration.orders.filter_check import PlacedFilter
from dsl_core.calibration.orders.filter_shift import cell_terms
from dsl_core.calibration.orders.order_light import FilterLight, OrderLight
from dsl_core.calibration.orders.steady_light import LightJump
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.bandpass import BandpassCalibration, apply_bandpass
from dsl_core.model.plan import ScanLines
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.correspondence import GratingModel
from dsl_core.optics.filters import FINE_NM, nominal_filter, passed, relative_shift
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
RIG = RIG.model_copy(update={"camera": RIG.camera.resized(112, 72)})
CENTRES, REFLECTANCE, NOISE = range(440, 651, 15), 0.99, 1e-3
#: Light of the second order of each side over that of its first one.
SHARE = {1: 0.038, -1: 0.049}


def seen(centre: float, really_nm: float | None = None, seed: int = 0) -> SeenFilter:
    """What the rig shows through a filter: every ratio with a noise of a thousandth of the zero order's."""
    rng = np.random.default_rng((seed, int(centre)))
    light = passed(RIG, nominal_filter(really_nm or centre))
    nm = float(light.sum(0) @ FINE_NM / light.sum())
    orders = {}
    for order in (1, -1, 2, -2):
        first = order // abs(order)
        ratio = light @ RIG.efficiency[first].at(FINE_NM) / light.sum(1)
        ratio = (ratio if abs(order) == 1 else SHARE[first] * ratio) + 1e-4 * rng.standard_normal(3)
        sine = order * nm / RIG.film.period_nm
        offset = RIG.projector.fx_px * sine / np.sqrt(1 - sine**2)
        orders[order] = OrderLight(order, ratio, np.full(3, 1e-4), offset, 0.2, 0.95, 3.0, 2000)
    zero = REFLECTANCE * light.sum(1) * (1 + NOISE * rng.standard_normal(3))
    return SeenFilter(
        centre, nominal_filter(centre), True, FilterLight(zero, NOISE * zero, orders, (0.0, 0.01), 0.0)
    )


def without_filter() -> tuple[LineScan, ZeroOrderFit]:
    """White pixels all over the image, and the fit of their amplitudes."""
    rng = np.random.default_rng(1)
    pixels = np.sort(rng.choice(112 * 72, 2500, replace=False))
    colours = bayer_channels(RIG.sensor.bayer, 72, 112).ravel()[pixels]
    shading = rng.uniform(0.5, 1.0, len(pixels))
    white = REFLECTANCE * chain_response(RIG, 0, FINE_NM).sum((1, 2))
    amplitude = white[colours] * shading * (1 + 0.003 * rng.standard_normal(len(pixels)))
    none = np.zeros(len(pixels))
    scan = LineScan(
        ScanLines(width_px=5, step_px=5), pixels, np.full(len(pixels), 700.0), shading,
        rng.uniform(20.0, 620.0, len(pixels)), amplitude, none, np.zeros((128, len(pixels))),
        np.ones((128, len(pixels))),
    )  # fmt: skip
    good = np.ones(len(pixels), bool)
    response = RIG.projector_response.model_copy(update={"blur_px": 0.7})
    return scan, ZeroOrderFit(scan.column_px, amplitude, good, response, (0.01, 1e-5, 0.5), 1.0)


@pytest.fixture(scope="module")
def record() -> BandpassCalibration:
    scan, profile = without_filter()
    assert profile_scan(scan).pixels.tolist() == scan.pixels.tolist()
    return fit_bandpass(RIG, scan, profile, [seen(nm) for nm in CENTRES], REFLECTANCE)


@pytest.mark.parametrize("order", [1, -1])
def test_first_orders_are_within_half_a_percent(record: BandpassCalibration, order: int) -> None:
    nm = np.arange(450.0, 641.0, 10.0)
    truth = RIG.efficiency[order].at(nm)
    assert record.efficiency[order].at(nm) == pytest.approx(truth, rel=5e-3)
    assert record.misfit[order] <= 2.0


def test_each_second_order_has_its_share_and_the_deviations_of_both(record: BandpassCalibration) -> None:
    """A film sends more to one side than to the other."""
    sides = []
    for order in (1, -1):
        first, second = record.efficiency[order], record.efficiency[2 * order]
        assert first.std is not None
        assert second.std is not None
        share = np.array(second.values) / np.array(first.values)
        variance = (np.array(second.std) ** 2 - (share * np.array(first.std)) ** 2) / np.square(first.values)
        assert share == pytest.approx(share[0])
        assert variance == pytest.approx(variance[0])
        assert abs(share[0] - SHARE[order]) < 4 * variance[0] ** 0.5
        assert variance[0] ** 0.5 < 0.015 * SHARE[order]
        sides.append((share[0], variance[0]))
    mean = np.mean([share for share, _ in sides])
    assert record.second_order_share == pytest.approx(mean)
    squares = [variance + (share - mean) ** 2 for share, variance in sides]
    assert record.second_order_share_std == pytest.approx(np.mean(squares) ** 0.5)


def test_response_and_white_scale_stay_where_they_are_right(record: BandpassCalibration) -> None:
    after = apply_bandpass(record, RIG)
    for truth, found in zip(RIG.response, after.response, strict=True):
        scale = after.white_scale / RIG.white_scale
        bright = truth.at(FINE_NM) > 0.3 * max(truth.values)
        assert scale * found.at(FINE_NM)[bright] == pytest.approx(truth.at(FINE_NM)[bright], rel=0.01)
    assert after.projector_response.blur_px == 0.7
    assert record.blur_std_px == 0.01


def test_filters_are_listed_with_where_their_orders_put_them(record: BandpassCalibration) -> None:
    assert [each.filter_nm for each in record.filters] == list(CENTRES)
    for each in record.filters:
        assert each.found_nm == pytest.approx(each.effective_nm, abs=0.5)
        assert [sample.order for sample in each.orders] == [-2, -1, 1, 2]
    assert record.warnings == ()


def test_wrong_filters_and_a_target_that_moved_are_named_together() -> None:
    scan, profile = without_filter()
    filters = [seen(nm, 530.0 if nm == 500 else None) for nm in CENTRES]
    filters[-1] = replace(filters[-1], light=replace(filters[-1].light, shift_px=(0.4, 0.01)))
    with pytest.raises(CalibrationError) as error:
        fit_bandpass(RIG, scan, profile, filters, REFLECTANCE)
    assert "The filter of 500 nm: its first orders are where" in str(error.value)
    assert "the filter of 650 nm: the zero order is +0.40 columns" in str(error.value)
    assert "545 nm" not in str(error.value)


def test_light_that_changed_at_once_is_named() -> None:
    scan, profile = without_filter()
    filters = [seen(nm) for nm in CENTRES]
    filters[1] = replace(filters[1], light=replace(filters[1].light, jump=LightJump(-0.2, 400.0)))
    with pytest.raises(CalibrationError, match=r"light changed by -20% at once while .* column 400"):
        fit_bandpass(RIG, scan, profile, filters, REFLECTANCE)


def test_a_broad_first_order_is_named() -> None:
    scan, profile = without_filter()
    filters = [seen(nm) for nm in CENTRES]
    wide = {m: replace(light, width_px=30.0) for m, light in filters[2].light.orders.items()}
    filters[2] = replace(filters[2], light=replace(filters[2].light, orders=wide))
    with pytest.raises(CalibrationError, match="filter of 470 nm: the light of the first orders is spread"):
        fit_bandpass(RIG, scan, profile, filters, REFLECTANCE)


def test_no_filters_and_no_target_are_refused() -> None:
    scan, profile = without_filter()
    with pytest.raises(CalibrationError, match="No filter was captured"):
        fit_bandpass(RIG, scan, profile, [])
    blind = replace(profile, good=np.zeros(len(profile.good), bool))
    with pytest.raises(CalibrationError, match="shows too little of the target"):
        fit_bandpass(RIG, scan, blind, [seen(nm) for nm in CENTRES], REFLECTANCE)


def test_a_sample_is_the_weighted_mean_of_the_colours_that_see_an_order() -> None:
    def of_order(order: int, std: list[float], offset_px: float = 0.25) -> OrderLight:
        return OrderLight(order, np.array([0.1, 0.2, 0.4]), np.array(std), offset_px, 0.01, 0.5, 3.0, 900)

    orders = {
        1: of_order(1, [0.01, 0.02, np.inf]),
        -1: of_order(-1, [np.inf] * 3),
        2: of_order(2, [0.1] * 3, np.nan),
    }
    light = FilterLight(np.array([1.0, np.nan, 3.0]), np.full(3, 0.1), orders, (0.0, 0.0), 0.0)
    each = SeenFilter(540.0, nominal_filter(540.0), False, light)
    found = _sample(each, PlacedFilter(540.0, 541.0, False, {}), (542.0, 0.5))
    assert (found.filter_nm, found.effective_nm, found.found_nm, found.found_std_nm) == (
        540.0,
        541.0,
        542.0,
        0.5,
    )
    assert found.zero_dn_per_ms == (1.0, 0.0, 3.0)
    (sample,) = found.orders
    weight = np.array([1e4, 2500.0])
    assert sample.order == 1
    assert sample.ratio == pytest.approx(weight @ [0.1, 0.2] / weight.sum())
    assert sample.ratio_std == pytest.approx(weight.sum() ** -0.5)
    assert (sample.offset_px, sample.offset_std_px) == (0.25, 0.01)


def test_pixels_have_their_places_in_the_image_and_whole_orders_where_rows_are_free() -> None:
    scan, _ = without_filter()
    found = plane_pixels(RIG, scan, 550.0)
    rows, columns = np.divmod(scan.pixels, 112)
    assert found.place == pytest.approx(np.stack([(2 * rows + 1) / 144, (2 * columns + 1) / 224]))
    assert found.colour.tolist() == bayer_channels(RIG.sensor.bayer, 72, 112).ravel()[scan.pixels].tolist()
    where = torch.as_tensor(scan.pixels), torch.as_tensor(scan.depth_mm)
    for order in (1, -1, 2, -2):
        ends = GratingModel(RIG).trace(*where, order, np.array([535.0, 565.0])).rows.numpy()
        wanted = (ends.min(0) > 8) & (ends.max(0) < RIG.projector.height_px - 9)
        assert found.whole[order].tolist() == wanted.tolist()
    assert not found.whole[1].all()


def test_blur_and_halo_are_fitted_to_three_thousand_pixels_at_most() -> None:
    scan, _ = without_filter()
    many = scan.at(np.tile(np.arange(len(scan.pixels)), 5))
    assert len(profile_scan(many).pixels) == 2500, "every fifth of 12500"
    assert profile_scan(scan).pixels.tolist() == scan.pixels.tolist()


@pytest.mark.parametrize(("width", "height"), [(112, 72), (160, 80), (160, 120)])
def test_every_colour_of_a_small_picture_without_a_gap_is_among_the_pixels_of_the_fit(
    width: int, height: int
) -> None:
    scan, _ = without_filter()
    whole = replace(scan.at(np.arange(width * height) % len(scan.pixels)), pixels=np.arange(width * height))
    chosen = profile_scan(whole).pixels
    colours = bayer_channels(RIG.sensor.bayer, height, width).ravel()[chosen]
    assert np.bincount(colours, minlength=3) / len(chosen) == pytest.approx([0.25, 0.5, 0.25], abs=0.03)


@pytest.mark.parametrize(("shift_px", "moved"), [(0.149, False), (0.151, True), (-0.151, True)])
def test_a_target_has_moved_from_a_seventh_of_a_column_on(shift_px: float, moved: bool) -> None:
    each = seen(540)
    each = replace(each, light=replace(each.light, shift_px=(shift_px, 0.0)))
    place = PlacedFilter(540.0, 540.0, True, {})
    if moved:
        with pytest.raises(CalibrationError, match=re.escape(f"zero order is {shift_px:+.2f} columns")):
            _check(RIG, [each], [place], [(540.0, 0.1)])
    else:
        _check(RIG, [each], [place], [(540.0, 0.1)])


def test_second_orders_are_compared_with_the_first_at_the_same_light() -> None:
    each = seen(540)
    light = passed(RIG, nominal_filter(540.0))
    light[2] = 0.0
    second = each.light.orders[2]
    unsure = replace(second, std=np.array([np.inf, 1e-4, 1e-4]))
    each = replace(each, light=replace(each.light, orders=each.light.orders | {2: unsure}))
    sides = []
    for order in (1, -1):
        fit: Any = SimpleNamespace(curve=RIG.efficiency[order])
        sides.append(_second(order, [each], [light], fit))
    assert [len(side) for side in sides] == [1, 2], "green of one, red and green of the other"
    first = float(light[1] @ RIG.efficiency[1].at(FINE_NM) / light[1].sum())
    assert sides[0][0] == pytest.approx((second.ratio[1], 1e-4, first))


def at_an_angle(centre: float, scan: LineScan, index: float) -> SeenFilter:
    """The filter of an index, whose band shifts with the angle of view; no noise."""
    terms = cell_terms(RIG, plane_pixels(RIG, scan, 550.0), scan.pixels)
    shift = relative_shift(terms, np.array([index**-2, 0.0, 0.0]))
    cells = np.stack([REFLECTANCE * passed(RIG, nominal_filter(centre), s[None]).sum(1) for s in shift], 1)
    light = passed(RIG, nominal_filter(centre), shift)
    straight = seen(centre)
    orders = {
        order: replace(
            straight.light.orders[order],
            ratio=light @ RIG.efficiency[order].at(FINE_NM) / light.sum(1),
            cells=np.ones(24),
        )
        for order in (1, -1)
    }
    zero = REFLECTANCE * light.sum(1)
    seen_light = FilterLight(zero, NOISE * zero, orders, (0.0, 0.01), 0.0, cells, NOISE * cells)
    orders |= {order: straight.light.orders[order] for order in (2, -2)}
    return replace(straight, light=seen_light)


@pytest.mark.slow
def test_filters_seen_at_an_angle_are_taken_as_they_pass_light() -> None:
    scan, profile = without_filter()
    filters = [at_an_angle(nm, scan, 1.9) for nm in CENTRES]
    found = fit_bandpass(RIG, scan, profile, filters, REFLECTANCE)
    assert found.filter_index is not None
    assert found.filter_index[0] == pytest.approx(1.9, abs=0.05)
    assert found.filters_off_nm == pytest.approx(0.0, abs=0.3)
    nm = np.arange(450.0, 641.0, 10.0)
    after = apply_bandpass(found, RIG)
    for truth, curve in zip(RIG.response, after.response, strict=True):
        bright = truth.at(nm) > 0.3 * max(truth.values)
        scale = after.white_scale / RIG.white_scale
        assert scale * curve.at(nm)[bright] == pytest.approx(truth.at(nm)[bright], rel=0.01)
    for order in (1, -1):
        assert found.efficiency[order].at(nm) == pytest.approx(RIG.efficiency[order].at(nm), rel=5e-3)


@pytest.mark.slow
def test_filters_that_are_all_off_alike_are_told(record: BandpassCalibration) -> None:
    scan, profile = without_filter()
    found = fit_bandpass(RIG, scan, profile, [seen(nm, nm - 6.0) for nm in CENTRES], REFLECTANCE)
    assert found.filters_off_nm == pytest.approx(-6.0, abs=0.4)
    assert record.filters_off_nm == pytest.approx(0.0, abs=0.3)
    assert record.filter_index is None


def test_the_target_is_the_white_that_the_light_refers_to_unless_another_one_is_stated(
    record: BandpassCalibration,
) -> None:
    scan, profile = without_filter()
    filters = [seen(nm) for nm in CENTRES]
    yellowed = SpectralCurve.of([430.0, 660.0], [0.78, 0.88])
    known = RIG.model_copy(update={"white_reflectance": yellowed})
    assert fit_bandpass(known, scan, profile, filters, REFLECTANCE) == record
    found = fit_bandpass(known, scan, profile, filters)
    # What the curve takes from white, response and white scale have to give back, at each wavelength.
    for truth, response in zip(RIG.response, found.response, strict=True):
        bright = truth.at(FINE_NM) > 0.3 * max(truth.values)
        given = found.white_scale * response.at(FINE_NM) * yellowed.at(FINE_NM)
        expected = REFLECTANCE * RIG.white_scale * truth.at(FINE_NM)
        assert given[bright] == pytest.approx(expected[bright], rel=0.02)
