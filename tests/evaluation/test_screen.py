"""What is hidden in a view, and how long a pixel is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.evaluation.screen import foremost, mm_per_px

SIZE_PX = 400, 300


def _projection(parallel: bool) -> NDArray[np.float64]:
    """A view along +z from the origin, with y downwards: 40 degrees high, or 500 mm."""
    near, far, aspect = 100.0, 2000.0, SIZE_PX[0] / SIZE_PX[1]
    look = np.diag([1.0, -1.0, -1.0, 1.0])
    if parallel:
        depth = [0, 0, -2 / (far - near), -(far + near) / (far - near)]
        lens = np.array([[1 / 250 / aspect, 0, 0, 0], [0, 1 / 250, 0, 0], depth, [0, 0, 0, 1.0]])
    else:
        high = 1 / np.tan(np.radians(20))
        depth = [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)]
        lens = np.array([[high / aspect, 0, 0, 0], [0, high, 0, 0], depth, [0, 0, -1.0, 0]])
    return lens @ look


@pytest.mark.parametrize("parallel", [False, True])
def test_a_sheet_hides_what_is_behind_it_and_a_slope_does_not_hide_itself(parallel: bool) -> None:
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-100, 100, 80), np.linspace(-80, 80, 64)))
    front = np.stack([x, y, 700 + 1.5 * x], axis=1)
    behind = np.stack([x * 0.6, y * 0.6, np.full_like(x, 1000.0)], axis=1)
    beside = behind[:20] + np.array([300.0, 0, 0])
    seen = foremost(np.concatenate([front, behind, beside]), _projection(parallel), SIZE_PX)
    count = len(front)
    assert seen[:count].all()
    assert not seen[count : 2 * count].any()
    # 300 mm to the right is on the screen of both views.
    assert seen[2 * count :].all()


@pytest.mark.parametrize("parallel", [False, True])
def test_the_length_of_a_pixel(parallel: bool) -> None:
    expected = 500 / 300 if parallel else 2 * np.tan(np.radians(20)) * 700 / 300
    assert mm_per_px(np.array([30.0, 5.0, 700.0]), _projection(parallel), 300) == pytest.approx(expected)


def test_behind_the_eye_nothing_is_seen() -> None:
    points = np.array([[0.0, 0, -700]])
    assert np.isnan(mm_per_px(points[0], _projection(False), 300))
    assert not foremost(points, _projection(False), SIZE_PX).any()
