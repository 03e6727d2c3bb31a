"""The chart is found however it is turned, and what is no chart is told."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from dsl_core.calibration.colour.color_checker import expected_colours
from dsl_core.calibration.colour.patches import (
    INNER,
    PatchSamples,
    _inside,
    _robust_mean,
    find_chart,
    orient_chart,
    patch_samples,
    patch_signals,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.charts import chart_reflectance
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.sim_devices import open_twin

EXPECTED = expected_colours(published_rig(), "BabelColor Average")
#: The mosaic after quarter turns counterclockwise of an even-sized RGGB.
TURNED: tuple[BayerPattern, ...] = ("RGGB", "GBRG", "BGGR", "GRBG")
CORNERS = [[10.0, 4.0], [207.0, 9.0], [208.0, 139.0], [15.0, 135.0]]


@cache
def chart(tilt_y_deg: int = 0, roll_deg: int = 0, scene: str = "color-checker") -> np.ndarray:
    """A white picture of the twin's chart, black subtracted, as a mosaic of even size."""
    options = {"scene": scene, "film": "off", "size": "222x145", "tilt_y_deg": str(tilt_y_deg)}
    if roll_deg:
        options["roll_deg"] = str(roll_deg)
    devices = open_twin(options)
    info = devices.projector.info
    devices.projector.show(np.full((info.height_px, info.width_px), 150, np.uint8))
    devices.camera.configure(1000 / 60)
    devices.camera.prepare(0)
    return np.asarray(devices.camera.snap().pixels[:144].astype(np.float32) - 260)


@pytest.mark.slow
@pytest.mark.parametrize("quarter", range(4))
@pytest.mark.parametrize("tilt_y_deg", [0, 20])
def test_found_in_every_orientation(quarter: int, tilt_y_deg: int) -> None:
    turned = np.ascontiguousarray(np.rot90(chart(tilt_y_deg), quarter))
    pose = find_chart(turned, TURNED[quarter], EXPECTED, "the picture")
    assert pose.quarter_turns == (-quarter) % 4
    samples = patch_samples(pose.corners_px, (turned.shape[0], turned.shape[1]))
    signals = patch_signals(turned, np.zeros(turned.shape, bool), TURNED[quarter], samples)
    # White is the nineteenth patch, black the last; between them a factor of about thirty.
    assert signals.mean[18].min() > 20 * signals.mean[23].max() / 2
    assert np.unravel_index(signals.mean.sum(1).argmax(), (24,))[0] == 18


@pytest.mark.slow
def test_a_chart_upside_down_on_the_table_is_told() -> None:
    pose = find_chart(chart(roll_deg=180), "RGGB", EXPECTED, "the picture")
    assert pose.quarter_turns == 2


@pytest.mark.slow
def test_patches_have_the_ratios_of_their_reflectances() -> None:
    mosaic = chart()
    pose = find_chart(mosaic, "RGGB", EXPECTED, "the picture")
    seen = patch_signals(
        mosaic, np.zeros(mosaic.shape, bool), "RGGB", patch_samples(pose.corners_px, (144, 222))
    )
    ratio = seen.mean / EXPECTED
    # Light falls off across the chart, and noise is a few times the deviation at most.
    assert np.ptp(ratio, axis=0).max() < 0.2 * ratio.mean()
    assert (seen.std < 0.02 * seen.mean + 1).all()
    assert next(iter(chart_reflectance(np.array([550.0])))) == "dark skin"


@pytest.mark.slow
def test_corners_may_be_given_from_any() -> None:
    found = find_chart(chart(), "RGGB", EXPECTED, "the picture")
    for start in range(4):
        given = np.roll(np.array(CORNERS), start, axis=0)
        pose = orient_chart(chart(), "RGGB", given, EXPECTED, "the picture")
        assert np.abs(pose.corners_px - found.corners_px).max() < 4


@pytest.mark.slow
def test_a_mirrored_chart_is_told() -> None:
    with pytest.raises(CalibrationError, match="mirrored"):
        find_chart(np.ascontiguousarray(chart()[:, ::-1]), "GRBG", EXPECTED, "the picture")


def test_no_chart_is_told() -> None:
    with pytest.raises(CalibrationError, match=r"No Color Checker was found in the picture"):
        find_chart(chart(scene="plane"), "RGGB", EXPECTED, "the picture")


def test_another_chart_is_told() -> None:
    with pytest.raises(CalibrationError, match="does not have the colours"):
        orient_chart(chart(), "RGGB", np.array(CORNERS), np.roll(EXPECTED, 7, axis=0), "the picture")


def test_a_chart_cut_off_is_told() -> None:
    moved = np.array(CORNERS) + np.array([60.0, 0.0])
    with pytest.raises(CalibrationError, match="outside the picture"):
        orient_chart(chart(), "RGGB", moved, EXPECTED, "the picture")
    with pytest.raises(CalibrationError, match="Patch 5 "):
        patch_samples(moved, (144, 222))


@pytest.mark.slow
def test_dust_does_not_count_and_saturation_is_counted() -> None:
    mosaic = chart().copy()
    pose = find_chart(mosaic, "RGGB", EXPECTED, "the picture")
    samples = patch_samples(pose.corners_px, (144, 222))
    clean = patch_signals(mosaic, np.zeros(mosaic.shape, bool), "RGGB", samples)
    mosaic.ravel()[samples.pixels[18][::25]] = 0
    full = np.zeros(mosaic.shape, bool)
    full.ravel()[samples.pixels[0]] = True
    seen = patch_signals(mosaic, full, "RGGB", samples)
    np.testing.assert_allclose(seen.mean[18], clean.mean[18], rtol=0.01)
    assert (seen.saturated[0] == 1).all()
    assert (seen.saturated[1:] == 0).all()


def inside(shape: tuple[int, int], centre: tuple[float, float] = (1.5, 0.5)) -> list[int]:
    """Pixels of a patch where patches are a hundred pixels apart."""
    to_picture = np.diag([100.0, 100.0, 1.0])
    found: list[int] = _inside(to_picture, np.linalg.inv(to_picture), np.array(centre), shape).tolist()
    return found


def test_the_inner_part_of_a_patch_is_a_little_over_a_quarter_to_each_side_of_its_middle() -> None:
    # From column 122 to 178 and from row 22 to 78, both ends included.
    assert INNER == 0.28
    rows, columns = np.divmod(inside((100, 200)), 200)
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (122, 178, 22, 78)
    assert len(rows) == 57 * 57


@pytest.mark.parametrize(("shape", "is_in_view"), [((79, 179), True), ((78, 179), False), ((79, 178), False)])
def test_a_patch_out_of_view_in_part_has_no_pixels(shape: tuple[int, int], is_in_view: bool) -> None:
    assert bool(inside(shape)) == is_in_view


@pytest.mark.parametrize(
    ("centre", "is_in_view"), [((0.28, 0.5), True), ((0.27, 0.5), False), ((0.5, 0.27), False)]
)
def test_a_patch_may_begin_at_the_first_pixel(centre: tuple[float, float], is_in_view: bool) -> None:
    assert bool(inside((200, 200), centre)) == is_in_view


def test_a_mean_is_that_of_values_within_four_deviations_with_its_own_deviation() -> None:
    values = np.array([9.0, 10.0, 10.0, 11.0, 10.0, 9.0, 11.0, 15.0, 17.0])
    # The median of distances from 10 is 1, so that 15 is within four deviations of 1.48 and 17 is not.
    kept = values[:-1]
    found = _robust_mean(values)
    assert found == pytest.approx((kept.mean(), kept.std(ddof=1) / 8**0.5, 8))
    assert _robust_mean(np.full(5, 3.0)) == (3.0, 0.0, 5)


def test_channels_with_fewer_than_three_values_have_no_mean() -> None:
    mosaic, full = np.arange(48.0).reshape(6, 8), np.zeros((6, 8), bool)
    # Red is at even rows and columns: three of them, of which one is saturated.
    samples = PatchSamples((np.array([0, 2, 4, 1, 9]), np.array([0, 2, 4, 6])))
    full[0, 4] = True
    seen = patch_signals(mosaic, full, "RGGB", samples)
    assert np.isnan(seen.mean[0]).all()
    assert seen.mean[1, 0] == pytest.approx(8 / 3)
    assert seen.count.tolist() == [[0, 0, 0], [3, 0, 0]]
    assert seen.saturated == pytest.approx(np.array([[1 / 3, 0, 0], [1 / 4, 0, 0]]))
