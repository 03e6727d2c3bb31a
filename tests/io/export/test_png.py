"""Pictures for people, pixel by pixel: grey levels, colour bars, legends, and which band is the nearest."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from dsl_core.errors import StoreError
from dsl_core.io.export.png import band_picture, depth_picture, flags_picture, nearest_band, rgb_picture
from dsl_core.model.result import FLAG_COLOURS, FLAG_NAMES, Flag


def turbo(level: int) -> list[int]:
    return [int(v) for v in cv2.applyColorMap(np.array([[level]], np.uint8), cv2.COLORMAP_TURBO)[0, 0, ::-1]]


def test_the_nearest_band_is_at_most_half_the_widest_gap_away() -> None:
    uneven = [450.0, 460.0, 490.0]
    assert nearest_band(uneven, None) == (1, 460.0)
    assert nearest_band([450.0, 460.0, 470.0, 480.0], None) == (2, 470.0)
    assert nearest_band(uneven, 504.9) == (2, 490.0)
    assert nearest_band(uneven, 435.1) == (0, 450.0)
    for outside in (505.1, 434.9, float("nan")):
        with pytest.raises(StoreError, match="run from 450 to 490"):
            nearest_band(uneven, outside)
    assert nearest_band([550.0], 550.4) == (0, 550.0)
    with pytest.raises(StoreError, match=r"no band at 550\.6"):
        nearest_band([550.0], 550.6)
    assert nearest_band([450.0, 470.0], 479.9) == (1, 470.0)
    assert nearest_band([550.0, 550.2], 550.6) == (1, 550.2), "half a nanometre at least"


def test_levels_are_rounded_clipped_and_marked_where_unknown() -> None:
    values = np.array([[0.0, 0.5, 1.0, 1.7, -0.2, np.nan]], np.float32)
    assert band_picture(values)[0].tolist() == [
        [0] * 3, [128] * 3, [255] * 3, [255] * 3, [0] * 3, [0, 0, 96],
    ]  # fmt: skip
    colours = np.stack([values, values, np.zeros_like(values)])
    assert rgb_picture(colours)[0].tolist() == [
        [0, 0, 0], [128, 128, 0], [255, 255, 0], [255, 255, 0], [0, 0, 0], [128, 128, 128],
    ]  # fmt: skip


def test_depth_runs_from_red_to_blue_and_leaves_colours_to_most_pixels() -> None:
    depth = np.full((40, 10), 600.0, np.float32)
    depth[:20] = 700.0
    depth[0, :2], depth[39, 0] = (np.nan, 5000.0), 100.0
    picture = depth_picture(depth)
    assert picture.shape == (40, 120, 3)
    assert picture[0, 0].tolist() == [128] * 3
    # One outlier of four hundred does not move the ends of the bar.
    assert picture[30, 5].tolist() == turbo(255) == picture[39, 0].tolist()
    assert picture[10, 5].tolist() == turbo(0) == picture[0, 1].tolist()
    middle = depth_picture(np.array([[600.0] * 99 + [650.0] + [700.0] * 99], np.float32))
    assert middle[0, 99].tolist() == turbo(128)


def test_the_bar_says_which_depth_its_colours_mean() -> None:
    depth = np.linspace(600, 700, 200, dtype=np.float32)[:, None].repeat(3, 1)
    picture = depth_picture(depth)
    bar = picture[:, 3:]
    assert (bar[:, :8] == 255).all()
    assert (bar[:, 24:28] == 255).all()
    assert bar[0, 8].tolist() == bar[0, 23].tolist() == turbo(255)
    assert bar[-1, 8].tolist() == turbo(0)
    assert bar[100, 15].tolist() == turbo(round(255 * (1 - 100 / 199)))
    near, far = np.percentile(depth, (0.5, 99.5))
    wanted = np.full((200, 110, 3), 255, np.uint8)
    wanted[:, 8:24] = bar[:, 8:24]
    for k in range(5):
        row = int(np.clip(k / 4 * 199 + 4, 10, 197))
        text = f"{near + k / 4 * (far - near):.1f} mm"
        cv2.putText(wanted, text, (28, row), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 1, cv2.LINE_AA)
    assert (bar == wanted).all()


@pytest.mark.parametrize(("rows", "labels"), [(30, 2), (119, 2), (120, 3), (1000, 6)])
def test_a_bar_has_two_to_six_labels(rows: int, labels: int) -> None:
    depth = np.linspace(600, 700, rows, dtype=np.float32)[:, None].repeat(2, 1)
    dark = (depth_picture(depth)[:, 2 + 28 :, 0] < 128).any(1)
    assert int(np.count_nonzero(np.diff(np.r_[False, dark].astype(int)) == 1)) == labels


def test_a_picture_without_depth_or_of_one_depth_is_shown_all_the_same() -> None:
    nothing = depth_picture(np.full((30, 4), np.nan, np.float32))
    assert (nothing[:, :4] == 128).all()
    even = depth_picture(np.full((30, 4), 650.0, np.float32))
    assert even[3, 2].tolist() == turbo(0)


def test_a_legend_names_each_flag_with_its_share() -> None:
    first, second = list(Flag)[:2]
    flags = np.zeros((10, 300), np.uint16)
    flags[0, :30], flags[1, :6] = int(first), int(second)
    picture = flags_picture(flags)
    assert picture.shape == (10 + 18 * 2 + 4, 300, 3)
    legend = picture[10:]
    wanted = np.full(legend.shape, 255, np.uint8)
    for top, flag, share in ((4, first, "1.0 %"), (22, second, "0.2 %")):
        wanted[top : top + 12, 4:16] = tuple(bytes.fromhex(FLAG_COLOURS[flag][1:]))
        text = f"{FLAG_NAMES[flag]}  {share}"
        cv2.putText(wanted, text, (22, top + 11), cv2.FONT_HERSHEY_SIMPLEX, 0.38, (0, 0, 0), 1, cv2.LINE_AA)
    assert (legend == wanted).all()
    narrow = flags_picture(flags[:, :100])
    assert narrow.shape == (10 + 18 * 2 + 4, 240, 3)
    assert (narrow[:10, 100:] == 255).all()
