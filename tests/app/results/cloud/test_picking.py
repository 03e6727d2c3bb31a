"""Places and outlines on the 3D view and the pixels that they mean."""

from __future__ import annotations

import numpy as np
from dsl_app.results.cloud.picking import Picking

SIZE_PX = 400, 400
#: A parallel view along z of x and y from -1 to 1, and z from 0 to 10.
VIEW = np.array([[1.0, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0.2, -1], [0, 0, 0, 1]])
ALL = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]


def _two_sheets() -> Picking:
    """A sheet of 20 x 20 pixels, and the next 20 rows of the picture behind its left half."""
    y, x = np.mgrid[:20, :20] / 10.0 - 0.95
    front = np.stack([x, y, np.full_like(x, 2.0)]).reshape(3, -1).T
    behind = np.stack([x / 2 - 0.5, y, np.full_like(x, 9.0)]).reshape(3, -1).T
    picking = Picking()
    picking.take(np.concatenate([front, behind]).astype(np.float32), np.arange(800), 20)
    return picking


def test_a_lasso_does_not_reach_through() -> None:
    mask = _two_sheets().mask_inside(ALL, VIEW, SIZE_PX, (40, 20))
    assert mask[:20].all()
    assert not mask[20:].any()
    left = [(-1.0, -1.0), (0.0, -1.0), (0.0, 1.0), (-1.0, 1.0)]
    np.testing.assert_array_equal(_two_sheets().mask_inside(left, VIEW, SIZE_PX, (40, 20))[:20, 10:], False)
    assert not Picking().mask_inside(ALL, VIEW, SIZE_PX, (40, 20)).any()


def test_the_foremost_point_is_meant() -> None:
    picking = _two_sheets()
    assert picking.pixel_at((-0.95, 0.95), VIEW, SIZE_PX) == (0, 0)
    assert picking.pixel_at((0.85, -0.95), VIEW, SIZE_PX, most=400) == (18, 19)
    assert Picking().pixel_at((0, 0), VIEW, SIZE_PX) is None
