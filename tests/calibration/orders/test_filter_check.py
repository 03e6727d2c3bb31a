"""A filter that is not the one asked for is named, by its orders and by its colours."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.orders.filter_check import PlacedFilter, colour_shift, found_wavelengths, verdict
from dsl_core.optics.filters import nominal_filter, passed
from dsl_core.simulation.published_rig import published_rig

CENTRES = (430.0, 460.0, 490.0, 520.0, 550.0, 580.0, 610.0, 640.0)


def offset_px(nm: float) -> float:
    """Distance of a first order by the grating equation at normal incidence."""
    sine = nm / 2083.0
    return float(983.0 * sine / np.sqrt(1 - sine**2))


def placed(true_nm: dict[float, float] | None = None, measured: bool = True) -> list[PlacedFilter]:
    really = true_nm or {}
    return [
        PlacedFilter(nm, nm, measured, {m: (m * offset_px(really.get(nm, nm)), 0.2) for m in (1, -1)})
        for nm in CENTRES
    ]


def test_right_filters_raise_no_doubt() -> None:
    filters = placed()
    for each, found in zip(filters, found_wavelengths(published_rig(), filters), strict=True):
        assert found is not None
        assert verdict(published_rig(), each, found, 3.0, 1.0) == (False, "")


def test_wrong_filter_is_named_and_the_others_are_not() -> None:
    filters = placed({520.0: 550.0})
    found = found_wavelengths(published_rig(), filters)
    verdicts = {
        f.filter_nm: verdict(published_rig(), f, w, 3.0, 1.0) for f, w in zip(filters, found, strict=True)
    }
    unusable, sentence = verdicts.pop(520.0)
    assert unusable
    assert "the filter of 520 nm: its first orders are where those of 55" in sentence
    assert "± 1 nm should be" in sentence
    assert not any(bad for bad, _ in verdicts.values())


def test_tilted_filter_is_a_doubt() -> None:
    filters = placed({550.0: 546.0})
    index = CENTRES.index(550.0)
    found = found_wavelengths(published_rig(), filters)[index]
    unusable, sentence = verdict(published_rig(), filters[index], found, 3.0, 1.0)
    assert not unusable
    assert "nm shorter than it should; it may be tilted" in sentence
    assert "wavelengths 4.0 ± 0." in sentence


@pytest.mark.parametrize(("noise_px", "doubted"), [(0.2, True), (1.2, False)])
def test_a_dim_filter_is_not_judged_to_a_nanometre(noise_px: float, doubted: bool) -> None:
    # A column is two nanometres: 5 nm are certain with little noise, and two deviations with much.
    filters = placed({550.0: 555.1})
    index = CENTRES.index(550.0)
    dim = replace(
        filters[index], offsets_px={m: (px, noise_px) for m, (px, _) in filters[index].offsets_px.items()}
    )
    filters[index] = dim
    found = found_wavelengths(published_rig(), filters)[index]
    unusable, sentence = verdict(published_rig(), dim, found, 3.0, 1.0)
    assert not unusable
    assert bool(sentence) == doubted
    assert ("it passes wavelengths 5.1 ± 0." in sentence) == doubted


def test_broad_light_is_no_filter() -> None:
    each = placed()[0]
    unusable, sentence = verdict(published_rig(), each, (430.0, 1.0), 30.0, 0.4)
    assert unusable
    assert "as without a narrow filter" in sentence


def test_few_filters_are_compared_with_the_film() -> None:
    filters = placed({460.0: 600.0})[:2]
    right, wrong = found_wavelengths(published_rig(), filters)
    assert right is not None
    assert wrong is not None
    assert not verdict(published_rig(), filters[0], right, 3.0, 1.0)[0]
    assert verdict(published_rig(), filters[1], wrong, 3.0, 1.0)[0]


def test_two_swapped_filters_of_four_are_named_and_the_others_are_not() -> None:
    filters = [each for each in placed({580.0: 610.0, 610.0: 580.0}) if each.filter_nm >= 550]
    found = found_wavelengths(published_rig(), filters)
    verdicts = [
        verdict(published_rig(), each, where, 3.0, 1.0) for each, where in zip(filters, found, strict=True)
    ]
    assert [unusable for unusable, _ in verdicts] == [False, True, True, False]
    assert "where those of 610 ± 6 nm should be" in verdicts[1][1]


@pytest.mark.parametrize("centres", [CENTRES[:6], CENTRES])
def test_filters_in_reversed_order_are_named_with_where_they_are(centres: tuple[float, ...]) -> None:
    filters = placed(dict(zip(centres, centres[::-1], strict=True)))[: len(centres)]
    found = found_wavelengths(published_rig(), filters)
    verdicts = [
        verdict(published_rig(), each, where, 3.0, 1.0) for each, where in zip(filters, found, strict=True)
    ]
    assert verdicts[0][0]
    assert verdicts[-1][0]
    assert sum(unusable for unusable, _ in verdicts) >= len(centres) - 2


UNEVEN = (
    (430.0, 440.0, 450.0, 460.0, 470.0, 480.0, 650.0),
    (430.0, 450.0, 470.0, 490.0, 510.0, 530.0, 650.0),
    (405.0, 450.0, 470.0, 488.0, 500.0, 520.0, 532.0, 633.0),
    (540.0, 550.0, 560.0, 570.0, 580.0, 590.0, 450.0),
    (450.0, 450.1, 450.2, 450.3, 450.4, 450.5, 600.0),
)


def drawn(centres: tuple[float, ...], rng: np.random.Generator, swapped: int | None = None) -> list[bool]:
    """Which filters are refused, all within a nanometre of their labels, or one of them 20 nm off."""
    filters = []
    for index, nm in enumerate(centres):
        really = nm + rng.normal() + 20.0 * (index == swapped)
        offsets = {m: (m * offset_px(really) + rng.normal(0, 0.3), 0.3) for m in (1, -1)}
        filters.append(PlacedFilter(nm, nm, False, offsets))
    found = found_wavelengths(published_rig(), filters)
    return [
        verdict(published_rig(), each, where, 3.0, 1.0)[0] for each, where in zip(filters, found, strict=True)
    ]


@pytest.mark.parametrize("centres", UNEVEN)
def test_a_filter_far_from_all_others_is_no_other_one(centres: tuple[float, ...]) -> None:
    rng = np.random.default_rng(0)
    assert not np.any([drawn(centres, rng) for _ in range(15)])


@pytest.mark.parametrize("centres", UNEVEN)
def test_a_wrong_filter_in_an_uneven_set_is_refused_wherever_it_is(centres: tuple[float, ...]) -> None:
    rng = np.random.default_rng(0)
    for index in range(len(centres)):
        assert drawn(centres, rng, index)[index], centres[index]


@pytest.mark.parametrize("density", [0.97, 1.03])
def test_four_filters_show_a_film_unlike_its_data_sheet_and_raise_no_doubt(density: float) -> None:
    filters = placed({nm: density * nm for nm in CENTRES})[2:6]
    for each, found in zip(filters, found_wavelengths(published_rig(), filters), strict=True):
        assert found == pytest.approx((each.filter_nm, 0.01 * each.filter_nm), rel=0.06)
        assert verdict(published_rig(), each, found, 3.0, 1.0) == (False, "")


@pytest.mark.parametrize(("asked", "there"), [(450.0, 600.0), (540.0, 470.0), (600.0, 540.0)])
def test_colours_tell_another_filter(asked: float, there: float) -> None:
    rig = published_rig()
    seen = passed(rig, nominal_filter(there)).sum(1)
    shift, gain = colour_shift(rig, seen, nominal_filter(asked))
    assert abs(asked + shift - there) < 20.0
    assert gain > 12.0


def test_a_monochrome_camera_tells_no_filter_by_colours() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": "MONO"})})
    assert colour_shift(rig, np.array([0.0, 1.0, 0.0]), nominal_filter(600.0)) == (0.0, 0.0)


def test_colours_of_the_right_filter_are_accepted_though_the_response_is_off() -> None:
    rig = published_rig()
    for nm in CENTRES:
        seen = passed(rig, nominal_filter(nm)).sum(1) * np.array([0.85, 1.0, 1.15])
        shift, gain = colour_shift(rig, seen, nominal_filter(nm))
        assert gain < 12.0 or abs(shift) < 14.0


@pytest.mark.parametrize(
    ("width_px", "lines_per_mm", "rms_px", "unusable"),
    [
        (640, 480.0, 8.9, False),
        (640, 480.0, 9.1, True),
        (1920, 480.0, 13.5, False),
        (1920, 1000.0, 40.0, False),
        (1920, 480.0, 30.0, True),
        (320, 480.0, 8.9, False),
    ],
)
def test_a_filter_is_broad_by_its_nanometres(
    width_px: int, lines_per_mm: float, rms_px: float, unusable: bool
) -> None:
    """A filter of 20 nm is 13.5 columns wide on a projector of 1920: rms, with the lines."""
    rig = published_rig()
    lens = rig.projector.resized(width_px, width_px * 9 // 16)
    film = rig.film.model_copy(update={"lines_per_mm": lines_per_mm})
    rig = rig.model_copy(update={"projector": lens, "film": film})
    each = placed()[CENTRES.index(550.0)]
    assert verdict(rig, each, (550.0, 1.0), rms_px, 1.0)[0] == unusable


@pytest.mark.parametrize(("width_nm", "unusable"), [(10.0, True), (21.0, True), (42.0, False)])
def test_a_filter_that_is_stated_to_be_broad_may_be(width_nm: float, unusable: bool) -> None:
    each = replace(placed()[CENTRES.index(550.0)], width_nm=width_nm)
    assert verdict(published_rig(), each, (550.0, 1.0), 14.0, 1.0)[0] == unusable
