"""What each view paints, and in which colours."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dsl_app.results.layers import NOTHING, Layers, rgb_of
from dsl_app.results.state import QualityMap, ResultsState, ResultView, within

from dsl_core.io.result.result_arrays import load_arrays
from dsl_core.optics.levels import rgba_of_colours
from tests.app.support.small_result import BLUE, DARK, RED, UNREACHED, write_small_result


@pytest.fixture
def layers(tmp_path: Path) -> Layers:
    return Layers(load_arrays(write_small_result(tmp_path)))


def state_of(view: ResultView, quality: QualityMap = QualityMap.FLAGS, band: int = 0) -> ResultsState:
    state = ResultsState()
    state.view.set(view)
    state.quality.set(quality)
    state.band.set(band)
    return state


def test_limits_keep_known_depths_between_them() -> None:
    depth_mm = np.array([690.0, 700.0, 710.0, 720.0, np.nan])
    assert within(depth_mm, (700.0, 710.0)).tolist() == [False, True, True, False, False]
    assert within(depth_mm, None).tolist() == [True] * 4 + [False]


def test_a_band_is_painted_from_zero_to_one_level_for_all_bands(layers: Layers) -> None:
    first, last = (layers.layer(state_of(ResultView.BAND, band=band)) for band in (0, 46))
    assert first is not None
    assert last is not None
    assert (first.image[8, 3], first.image[8, 30]) == pytest.approx((BLUE[0], RED[0]))
    assert first.levels == last.levels == pytest.approx((0.0, 0.7), abs=0.01)


def test_the_cloud_has_the_colours_of_the_view_chosen_for_it(layers: Layers) -> None:
    state = state_of(ResultView.CLOUD)
    state.cloud_by.set(ResultView.DEPTH)
    cloud, depth = layers.layer(state), layers.layer(state_of(ResultView.DEPTH))
    assert cloud is not None
    assert depth is not None
    assert (cloud.image is depth.image, cloud.levels) == (True, depth.levels)
    assert np.isnan(cloud.image[DARK[1], DARK[0]])


def test_the_picture_of_the_next_result_is_not_painted_on_the_points_of_the_last(layers: Layers) -> None:
    state = state_of(ResultView.CLOUD)
    state.picture.set(np.full((7, 5, 4), 255, np.uint8))
    shown = layers.layer(state)
    assert shown is not None
    assert shown.image.shape[:2] == layers.result.shape


def test_points_without_a_value_are_grey_and_a_legend_says_so(layers: Layers) -> None:
    # In the darkest pixel there is no depth either: it is no point.
    colours, cube = layers.result["rgb"].copy(), layers.result["reflectance"].copy()
    for values in (colours, cube):
        values[:, 5, 7] = np.nan
    arrays = {**layers.result.arrays, "rgb": colours, "reflectance": cube}
    result = replace(layers.result, arrays=arrays)
    missing = np.isnan(colours[0])
    assert missing[DARK[1], DARK[0]]
    for by in (ResultView.COLOUR, ResultView.BAND):
        state = state_of(ResultView.CLOUD)
        state.cloud_by.set(by)
        state.picture.set(rgba_of_colours(colours))
        cloud = Layers(result).layer(state)
        assert cloud is not None
        assert rgb_of(cloud)[5, 7].tolist() == list(bytes.fromhex(NOTHING[1:]))
        ((colour, name, share),) = cloud.keys
        assert (colour, name) == (NOTHING, "no spectrum")
        assert share == pytest.approx(1 / (missing.size - 1))
        state.view.set(by)
        flat = Layers(result).layer(state)
        assert flat is not None
        ((colour, name, share),) = flat.keys
        assert (colour[:4], name) == ("rgba", "no spectrum")
        assert share == pytest.approx(missing.mean())


def test_what_depth_limits_hide_is_not_called_a_missing_depth(layers: Layers) -> None:
    state = state_of(ResultView.DEPTH)
    state.depth_limits.set((700.0, 705.0))
    layer = layers.layer(state)
    assert layer is not None
    ((_, name, share),) = layer.keys
    assert name == "no depth between the limits"
    assert 0.5 < share < 0.9


def test_a_picture_with_all_values_has_no_legend_of_missing_ones(layers: Layers) -> None:
    even = {"depth_mm": np.full(layers.result.shape, 700.0, np.float32)}
    result = replace(layers.result, arrays={**layers.result.arrays, **even})
    layer = Layers(result).layer(state_of(ResultView.DEPTH))
    assert layer is not None
    assert layer.keys == ()
    assert layer.levels == pytest.approx((699.65, 700.35), abs=1e-3), "a scale with room for figures"


def test_flags_have_a_legend_with_their_shares(layers: Layers) -> None:
    layer = layers.layer(state_of(ResultView.QUALITY))
    assert layer is not None
    shares = {name: share for _, name, share in layer.keys}
    assert shares["no flags"] == pytest.approx(1 - 2 / (24 * 36))
    assert len(shares) == 3
    colours = rgb_of(layer)
    assert (colours[DARK[1], DARK[0]] != colours[0, 9]).any()
    assert (colours[UNREACHED[1], UNREACHED[0]] != colours[0, 9]).any()


@pytest.mark.parametrize(
    ("quality", "value", "label"),
    [
        (QualityMap.SHARE, 0.1, "Data share"),
        (QualityMap.SPREAD, 0.01, "Deviation"),
        (QualityMap.DEPTH_SPREAD, 0.25, "Deviation (mm)"),
    ],
)
def test_maps_of_quality_show_their_figure(
    layers: Layers, quality: QualityMap, value: float, label: str
) -> None:
    layer = layers.layer(state_of(ResultView.QUALITY, quality))
    assert layer is not None
    assert layer.label == label
    assert layer.image[UNREACHED[1], UNREACHED[0]] == pytest.approx(value)
