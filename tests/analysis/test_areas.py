from typing import Any

import numpy as np
import pytest

from dsl_core.analysis.areas import pixel_areas_mm2
from dsl_core.analysis.class_table import ClassRow
from dsl_core.analysis.classification import areas_of
from tests.cases.chart_cube import chart_result


def test_a_tilted_plane_has_its_area_whatever_the_noise_of_depth() -> None:
    rng, focal = np.random.default_rng(3), 200.0
    v, u = np.mgrid[0:60, 0:80].astype(float)
    ray = np.stack([(u - 39.5) / focal, (v - 29.5) / focal, np.ones_like(u)])
    normal = np.array([np.sin(0.7), 0.0, -np.cos(0.7)])
    depth = 700 * normal[2] / np.tensordot(normal, ray, 1)
    normals = np.broadcast_to(normal[:, None, None], ray.shape)
    areas = pixel_areas_mm2(ray * depth, normals)
    # The plane's part between the outermost pixel centres and half a pixel beyond them, by its corners.
    corners = np.array([[x, y, 1.0] for x, y in ((-40, -30), (40, -30), (40, 30), (-40, 30))])
    corners[:, :2] /= focal
    a, b, c, d = (corner * 700 * normal[2] / (normal @ corner) for corner in corners)
    whole = np.linalg.norm(np.cross(b - a, c - a)) / 2 + np.linalg.norm(np.cross(c - a, d - a)) / 2
    assert areas.sum() == pytest.approx(whole, rel=2e-3)
    noisy = pixel_areas_mm2(ray * (depth + rng.normal(0, 1.0, depth.shape)), normals)
    assert noisy.sum() == pytest.approx(whole, rel=5e-3)


def test_pixels_without_a_point_have_no_area() -> None:
    points = np.full((3, 4, 4), np.nan)
    assert np.isnan(pixel_areas_mm2(points)).all()


def seen_plane(shown: np.ndarray) -> tuple[np.ndarray, float]:
    """Points of a level plane where pixels are shown, and the area of each pixel, mm2."""
    v, u = np.indices(shown.shape).astype(float)
    points = 700 * np.stack([(u - 39.5) / 200, (v - 29.5) / 200, np.ones_like(u)])
    points[:, ~shown] = np.nan
    return points.astype(np.float32), (700 / 200) ** 2


@pytest.mark.parametrize(
    "part",
    [
        np.s_[:, 20:22],
        np.s_[:, 20:23],
        np.s_[10:12, :],
        np.s_[10:13, :],
        np.s_[10:12, 20:22],
        np.s_[10:13, 20:23],
    ],
)
@pytest.mark.parametrize("is_cut", [False, True])
def test_narrow_strips_have_the_area_that_they_have_in_a_picture(
    part: tuple[slice, slice], is_cut: bool
) -> None:
    shown = np.zeros((60, 80), bool)
    shown[part] = True
    points, each_mm2 = seen_plane(shown)
    areas = pixel_areas_mm2(points[(slice(None), *part)] if is_cut else points)
    known = areas[np.isfinite(areas)]
    assert known.size == shown.sum()
    np.testing.assert_allclose(known, each_mm2, rtol=0.01)


@pytest.mark.parametrize("line", ["column", "row", "diagonal", "pixel"])
def test_pixels_on_one_line_have_no_known_area(line: str) -> None:
    shown = np.zeros((60, 80), bool)
    where: dict[str, Any] = {"column": np.s_[:, 30], "row": np.s_[30], "pixel": np.s_[30, 30]}
    shown[where.get(line, (np.arange(60), np.arange(60) + 7))] = True
    points, _ = seen_plane(shown)
    assert np.isnan(pixel_areas_mm2(points)).all()


@pytest.mark.parametrize(
    "kept",
    [np.r_[10:30, 60:80], np.flatnonzero(np.arange(80) % 10 < 6), np.r_[70:40:-1, 20:0:-1], np.r_[3, 4, 40]],
)
@pytest.mark.parametrize("axis", [1, 2])
def test_pixels_keep_their_areas_where_others_are_left_out(kept: np.ndarray, axis: int) -> None:
    points, each_mm2 = seen_plane(np.ones((80, 80), bool))
    places = (np.arange(80), kept) if axis == 1 else (kept, np.arange(80))
    areas = pixel_areas_mm2(points.take(kept, axis), None, places)
    np.testing.assert_allclose(areas, each_mm2, rtol=1e-3)


def test_of_every_third_column_each_stands_for_three() -> None:
    points, each_mm2 = seen_plane(np.ones((60, 80), bool))
    areas = pixel_areas_mm2(points[..., 1::3], None, (np.arange(1, 80, 3), np.arange(60)))
    np.testing.assert_allclose(areas, 3 * each_mm2, rtol=1e-3)


def test_a_result_says_itself_what_is_left_out() -> None:
    whole = chart_result()
    known = areas_of(whole)
    part = areas_of(whole.isel(x=np.r_[5:20, 40:55]))
    assert known is not None
    assert part is not None
    np.testing.assert_allclose(part.mm2, known.mm2[:, np.r_[5:20, 40:55]], rtol=1e-3)


def test_thousands_of_a_table_are_no_decimal_commas() -> None:
    row = ClassRow("red", 1, 51308, 0.5, 21402.3, 1341.7, 1203.0)
    texts = [text.replace(chr(0xA0), " ") for text in (row.pixels_text, row.area_text)]
    assert texts == ["51 308 ± 1 342", "21 402 ± 1 203"]


def test_a_deviation_below_the_last_digit_is_no_zero() -> None:
    row = ClassRow("red", 1, 51308, 0.5, 98.0, 0.3, 0.02, 1e-5)
    texts = [text.replace(chr(0xA0), " ") for text in (row.pixels_text, row.area_text, row.share_text)]
    assert texts == ["51 308 ± 1", "98.0 ± 0.1", "50.0 ± 0.1 %"]
