"""White signals and the camera's evenness come out of uniform pictures with known truth."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.spectral_refinement import FINE_NM
from dsl_core.calibration.light.spectralon import (
    UniformPictures,
    _between_nodes,
    _blocks,
    _mean,
    _near_course,
    _roughness,
    _white_std,
    fit_evenness,
    match_whites,
    measure_white,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.spectralon import WhiteSignals
from dsl_core.model.rig import BayerPattern, Sensor
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import bayer_channels, gain_at_pixels
from dsl_core.simulation.published_rig import published_rig

SHAPE = (96, 144)
Y, X = (axis / max(axis.max(), 1) * 2 - 1 for axis in np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float))
#: Vignetting: a fifth less light in the corners.
VIGNETTE = 1 - 0.1 * (X**2 + Y**2)
SIGNAL = np.array([[4.0, 1.0, 0.2], [1.0, 6.0, 1.5], [0.3, 1.0, 5.0]])
EVERY = np.ones(SHAPE, bool)


def pictures(
    gain: np.ndarray, noise: float = 2e-3, white: float = 1.0, bayer: BayerPattern = "RGGB"
) -> UniformPictures:
    """Red, green, blue and white on a target whose shading falls to one side."""
    rng = np.random.default_rng(0)
    channel = bayer_channels(bayer, *SHAPE)
    shading = 0.8 + 0.1 * X
    of_light = np.concatenate([SIGNAL.T, white * SIGNAL.sum(1)[None]])[:, channel]
    radiance = of_light * shading * gain * (1 + noise * rng.standard_normal((4, *SHAPE)))
    return UniformPictures(radiance, np.zeros(SHAPE, bool), shading, EVERY, Sensor(bayer=bayer))


def test_vignetting_is_found() -> None:
    truth = VIGNETTE / VIGNETTE.mean()
    found = fit_evenness(truth + 0.01 * np.random.default_rng(1).standard_normal(SHAPE), EVERY)
    error = gain_at_pixels(found.flat_field, *SHAPE) - truth
    assert np.sqrt(np.mean(error**2)) < 1e-3
    assert np.abs(error).max() < 6e-3
    assert found.residual == pytest.approx(0.01 / np.sqrt(VIGNETTE.size / (27 * 39)), rel=0.15)
    assert found.chi_square > 50


def test_an_even_camera_is_found_even_within_its_deviation() -> None:
    sigmas = []
    for seed in range(3):
        found = fit_evenness(1 + 0.01 * np.random.default_rng(seed).standard_normal(SHAPE), EVERY)
        sigmas.append((np.array(found.flat_field.gain) - 1) / np.array(found.std))
        assert found.chi_square == pytest.approx(1.0, abs=0.2)
    assert 0.5 < np.sqrt(np.mean(np.square(sigmas))) < 1.3


@pytest.mark.parametrize("noise", [0.002, 0.01])
def test_deviations_of_the_grid_hold_what_it_cannot_bend_to(noise: float) -> None:
    truth = VIGNETTE / VIGNETTE.mean()
    found = fit_evenness(truth + noise * np.random.default_rng(1).standard_normal(SHAPE), EVERY)
    stated = gain_at_pixels(found.flat_field.model_copy(update={"gain": found.std}), *SHAPE)
    sigmas = (gain_at_pixels(found.flat_field, *SHAPE) - truth) / stated
    assert 0.7 < np.sqrt(np.mean(sigmas**2)) < 1.1


def test_strong_vignetting_is_no_dirt() -> None:
    found = measure_white(pictures(1 - 0.25 * (X**2 + Y**2)))
    assert found.used.mean() > 0.99
    dirty = pictures(1 - 0.25 * (X**2 + Y**2))
    dirty.radiance[:, 20:30, 20:40] *= 0.7
    assert not measure_white(dirty).used[20:30, 20:40].any()


def test_white_signals_are_those_at_unit_shading_without_vignetting() -> None:
    found = measure_white(pictures(VIGNETTE))
    scale = found.white.array / SIGNAL
    # The gain has mean one, so that all signals are smaller by the mean of what the vignette leaves.
    assert scale == pytest.approx(np.full((3, 3), scale.mean()), rel=2e-3)
    assert scale.mean() == pytest.approx(VIGNETTE.mean(), rel=2e-3)
    assert found.white.white_over_sum == pytest.approx((1.0, 1.0, 1.0), abs=1e-3)
    assert np.max(found.white.rel_std) < 1e-3
    assert found.used.mean() > 0.99


def test_a_monochrome_camera_has_the_signals_of_its_one_colour() -> None:
    found = measure_white(pictures(VIGNETTE, bayer="MONO")).white
    assert found.array[[0, 2]].tolist() == [[0.0] * 3] * 2
    assert found.array[1] / SIGNAL[1] == pytest.approx(np.full(3, VIGNETTE.mean()), rel=2e-3)
    assert found.white_over_sum == pytest.approx((1.0, 1.0, 1.0), abs=1e-3)
    rig = published_rig()
    rig = rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": "MONO"})})
    even = SpectralCurve.of([400.0, 700.0], [0.99, 0.99])
    matched = match_whites(rig, found, even)
    light = np.stack([curve.at(FINE_NM) for curve in matched.emission]) * even.at(FINE_NM)
    signal = matched.white_scale * light @ matched.response[1].at(FINE_NM)
    assert signal == pytest.approx(found.array[1], rel=1e-6)
    assert 0 < matched.white_scale_rel_std < 0.01


def test_deviations_of_white_are_those_of_means_over_pixels() -> None:
    found = measure_white(pictures(np.ones(SHAPE)))
    pixels = np.array([1, 2, 1])[:, None] * VIGNETTE.size / 4
    assert np.mean(np.array(found.white.rel_std) * np.sqrt(pixels)) == pytest.approx(2e-3, rel=0.15)


def test_dirt_saturation_and_dark_borders_do_not_count() -> None:
    clean = pictures(np.ones(SHAPE))
    dirty = clean.radiance.copy()
    dirty[:, 20:30, 20:40] *= 0.5
    dirty[:, 60:70, 60:80] *= 0.95
    saturated = np.zeros(SHAPE, bool)
    saturated[60:70, 60:80] = True
    found = measure_white(
        UniformPictures(dirty, saturated, clean.shading, EVERY & (X > -0.9), Sensor(bayer="RGGB"))
    )
    assert not found.used[20:30, 20:40].any()
    assert not found.used[60:70, 60:80].any()
    assert not found.used[:, :5].any()
    assert found.white.array == pytest.approx(SIGNAL, rel=2e-3)


def test_white_that_is_not_the_sum_is_told() -> None:
    found = measure_white(pictures(np.ones(SHAPE), white=0.9))
    assert found.white.white_over_sum == pytest.approx((0.9, 0.9, 0.9), abs=1e-3)


def test_a_target_that_is_hardly_in_view_is_refused() -> None:
    seen = pictures(np.ones(SHAPE))
    little = EVERY & (X > 0.98)
    with pytest.raises(CalibrationError, match="pixels of the Spectralon are lit"):
        measure_white(UniformPictures(seen.radiance, seen.saturated, seen.shading, little, seen.sensor))


def test_a_flat_field_has_nine_rows_and_thirteen_columns_from_edge_to_edge() -> None:
    found = fit_evenness(np.ones((72, 112)), np.ones((72, 112), bool)).flat_field
    assert found.rows_px == pytest.approx(np.linspace(0, 71, 9))
    assert found.columns_px == pytest.approx(np.linspace(0, 111, 13))
    assert np.array(found.gain) == pytest.approx(np.ones((9, 13)))


def test_blocks_are_means_of_places_and_values_where_a_fifth_of_the_fullest_is_usable() -> None:
    """Three blocks a node: 27 rows of them, four pixels high, and 39 columns of five."""
    rng = np.random.default_rng(3)
    relative, usable = rng.random((108, 195)), np.ones((108, 195), bool)
    usable[:4, :5], usable[4:8, :5] = False, False
    usable[0, :4] = True  # four of twenty are a fifth and not more
    usable[4, :5] = True
    row, column, value, count = _blocks(relative, usable)
    assert len(count) == 27 * 39 - 1
    assert sorted(set(count.tolist())) == [5.0, 20.0]
    at = int(np.flatnonzero(count == 5)[0])
    assert (row[at], column[at]) == (4.0, 2.0)
    assert value[at] == pytest.approx(relative[4, :5].mean())
    assert (row[0], column[0], value[0]) == pytest.approx((1.5, 7.0, relative[:4, 5:10].mean()))


def test_a_mean_is_as_sure_as_blocks_that_hold_a_fifth_of_the_fullest_agree() -> None:
    block = np.repeat([0, 7, 35, 20], [10, 10, 10, 2])
    values = np.repeat([1.0, 2.0, 3.0, 50.0], [10, 10, 10, 2])
    mean, std = _mean(values, block)
    assert mean == pytest.approx(160 / 32)
    # Two of ten are a fifth and not more: three blocks are left.
    scatter = np.mean((np.array([1, 2, 3]) - mean) ** 2)
    assert std == pytest.approx(np.sqrt(scatter / 2))
    # Three of ten are more.
    block, values = np.append(block, 20), np.append(values, 50.0)
    mean, std = _mean(values, block)
    scatter = np.average((np.array([1, 2, 3, 50]) - mean) ** 2, weights=[10, 10, 10, 3])
    assert std == pytest.approx(np.sqrt(scatter / 3))
    assert _mean(np.ones(5), np.zeros(5, int)) == (1.0, 0.0)


def test_what_is_curved_between_nodes_is_unsure_by_its_second_difference() -> None:
    down, across = np.indices((9, 13)).astype(float)
    found = _between_nodes((0.02 * down**2 + 0.05 * across**2).ravel())
    assert found == pytest.approx(np.hypot(0.04, 0.1) * 0.5 / np.sqrt(180))
    bend = np.zeros((9, 13))
    bend[0] = 1.0
    edge = _between_nodes(bend.ravel()).reshape(9, 13)
    assert (edge[:2] > 0).all()
    assert not edge[2:].any()


def test_only_what_a_parabola_cannot_do_is_rough() -> None:
    down, across = np.indices((9, 13)).astype(float)
    rough = _roughness()
    assert rough.shape == (6 * 13 + 9 * 10, 117)
    assert np.abs(rough @ (down**2 + 3 * across - across**2 + down * across).ravel()).max() < 1e-9
    cubes = rough @ (down**3).ravel()
    assert sorted(set(np.abs(cubes).round(9).tolist())) == [0.0, 6.0]
    assert np.count_nonzero(cubes) == 6 * 13
    assert np.count_nonzero(rough @ (across**3).ravel()) == 9 * 10


@pytest.mark.parametrize(("factor", "near"), [(1.19, True), (1.21, False), (0.81, True), (0.79, False)])
def test_a_pixel_is_dirt_a_fifth_off_the_course_of_its_colour(factor: float, near: bool) -> None:
    colours = np.indices((40, 50)).sum(0) % 3
    white = np.array([1.0, 2.0, 5.0])[colours]
    white[11, 12] *= factor
    good = np.ones((40, 50), bool)
    found = _near_course(white, colours, good)
    assert found[11, 12] == near
    assert found.sum() == 2000 - (not near)


def test_the_deviation_of_white_is_that_of_its_three_lights() -> None:
    signal = ((1.0, 2.0, 3.0), (1.0, 1.0, 2.0), (5.0, 3.0, 2.0))
    rel = ((0.01, 0.01, 0.0), (0.0, 0.0, 0.01), (0.003, 0.0, 0.0))
    found = _white_std(WhiteSignals(signal=signal, rel_std=rel, white_over_sum=(1.0, 1.0, 1.0)))
    assert found == pytest.approx([np.hypot(0.01, 0.02) / 6, 0.02 / 4, 0.015 / 10])
