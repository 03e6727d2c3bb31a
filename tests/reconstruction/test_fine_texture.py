"""What is said of a texture finer than pixels, and what depth then states."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, cast

import numpy as np

from dsl_core.model.result import Flag
from dsl_core.reconstruction.fine_texture import follow_scatter
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.simulation.published_rig import published_rig

SHAPE = (48, 64)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]].astype(float)


@dataclass
class Seen:
    """A geometry that keeps what its deviations are to hold besides."""

    column_px: np.ndarray
    flags: np.ndarray = field(default_factory=lambda: np.zeros(SHAPE, np.uint16))
    depth_mm: np.ndarray = field(default_factory=lambda: np.full(SHAPE, 700.0))
    column_std_px: np.ndarray = field(default_factory=lambda: np.full(SHAPE, 0.02))
    error_px: np.ndarray | None = None

    def by(self, rig: Any, error_px: np.ndarray, window_px: int | None) -> Seen:
        return replace(self, error_px=error_px)


def test_fine_texture_is_told_and_held_by_deviations() -> None:
    texture = 3.0 * X + 0.3 * ((X + Y) % 2)
    geometry, findings = follow_scatter(published_rig(), cast(Geometry, Seen(texture)))
    error = cast(Seen, geometry).error_px
    assert error is not None
    assert (error > 0.1).all()
    assert [(each.part, each.significant) for each in findings] == [("surfaces", True)]
    assert "100% of the pixels" in findings[0].sentence


def test_pixels_of_edges_are_not_asked() -> None:
    texture = 3.0 * X + 0.3 * ((X + Y) % 2)
    edges = np.full(SHAPE, int(Flag.DEPTH_EDGE), np.uint16)
    geometry, findings = follow_scatter(published_rig(), cast(Geometry, Seen(texture, edges)))
    assert (cast(Seen, geometry).error_px, findings) == (None, [])
