"""What moved is bounded by tiles of a picture, and counts from so many pixels and deviations on."""

import numpy as np
import pytest

from dsl_core.capture.motion import _light, _movement
from dsl_core.optics.sensor import raw_variance
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.image_shift import TileShifts


def tiles(
    x: float = 0.0, std: float = 0.01, change: float = 0.0, moved: int = 24, explained: float = 1.0
) -> TileShifts:
    """Shifts of 4 x 6 tiles, of which the first ones moved; the others tell that they did not."""
    is_moved = (np.arange(24) < moved).reshape(4, 6)
    nothing, one = np.zeros((4, 6)), np.ones((4, 6))
    shift, changed = (np.asarray(size * is_moved, np.float64) for size in (x, change))
    return TileShifts(shift, nothing, std * one, std / 2 * one, changed, one, 1e9 * one, explained * one)


@pytest.mark.parametrize(
    ("found", "is_moved"),
    [
        (tiles(0.099, 0.01), False), (tiles(0.101, 0.01), True),
        (tiles(0.5, 0.049), True), (tiles(0.5, 0.051), False),
        (tiles(0.12, 0.0201), False), (tiles(0.12, 0.0199), True),
        (tiles(change=0.24), False), (tiles(change=0.26), True),
        (tiles(0.5, moved=1), False), (tiles(0.5, moved=2), True),
    ],
)  # fmt: skip
def test_tiles_move_by_a_fifth_of_a_pixel_and_six_deviations(found: TileShifts, is_moved: bool) -> None:
    assert (_movement(found, (32, 48), False) is not None) == is_moved


def test_a_movement_is_the_median_of_its_tiles_in_pixels_of_the_camera() -> None:
    found = tiles(0.5, 0.02)
    found.x[1, 2:4], found.x[2:] = 0.0, 0.0
    found.x[0, 0], found.x[0, 1] = 0.3, 3.0
    seen = _movement(found, (32, 48), True)
    assert seen is not None
    assert (seen.shift_px, seen.std_px, seen.is_pattern) == (1.0, 0.04, True)
    assert (seen.columns, seen.rows) == ((0, 96), (0, 32))
    assert (seen.after, seen.before) == (None, None)


def test_what_moved_is_bounded_by_its_tiles() -> None:
    found = tiles()
    found.x[1:3, 2:5] = 0.5
    seen = _movement(found, (32, 48), False)
    assert seen is not None
    assert (seen.columns, seen.rows) == ((32, 80), (16, 48))
    assert "Something moved by 1.0 ± 0.1 px in columns 32-80, rows 16-48 of the picture" in seen.sentence


@pytest.mark.parametrize(("moved", "is_all"), [(14, False), (15, True)])
def test_from_six_tenths_of_the_tiles_on_all_of_the_picture_moved(moved: int, is_all: bool) -> None:
    seen = _movement(tiles(0.5, moved=moved), (32, 48), False)
    assert seen is not None
    assert (seen.columns is None) == (seen.rows is None) == is_all


def test_a_scene_that_changed_has_no_shift() -> None:
    seen = _movement(tiles(std=1.0, change=0.5, moved=2), (32, 48), False)
    assert seen is not None
    assert (seen.shift_px, seen.std_px) == (None, 0.0)
    assert seen.columns is None, "of two tiles that tell, at least, both changed"
    assert "The scene changed, since the scan began, by more than a small motion." in seen.sentence


@pytest.mark.parametrize(("explained", "is_motion"), [(0.59, False), (0.61, True)])
def test_a_shift_that_explains_only_a_part_of_what_changed_is_no_sure_motion(
    explained: float, is_motion: bool
) -> None:
    found = tiles(0.5, moved=3, explained=0.3)
    found.explained[0, 1] = explained
    seen = _movement(found, (32, 48), True)
    assert seen is not None
    assert ("The pattern moved by 1.0" in seen.sentence) == is_motion
    assert ("a motion explains only a part of it: camera or projector sharpen" in seen.sentence) == (
        not is_motion
    )
    assert ("Fix camera, projector and scene" in seen.advice) == is_motion


def test_light_is_what_is_above_black_with_the_noise_of_both() -> None:
    sensor = published_rig().sensor
    lit = np.array([[500, 700, 900], [600, 800, 900]], np.uint16)
    black = np.array([[260, 270, 900], [280, 290, 900]], np.uint16)
    light, variance = _light(lit, black, sensor)
    assert light.tolist() == [[(240 + 430 + 320 + 510) / 4]]
    noise = [raw_variance(sensor, each[:, :2] - sensor.black_level_dn) for each in (lit * 1.0, black * 1.0)]
    assert variance.item() == pytest.approx((noise[0] + noise[1]).mean() / 4)
    for share, is_known in ((0.97, True), (0.99, False)):
        lit[0, 0] = share * sensor.full_scale_dn
        assert (_light(lit, black, sensor)[1].item() < 1e6) == is_known
