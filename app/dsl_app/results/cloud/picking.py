"""Which pixels are meant by a place or an outline on the 3D view. No Qt."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dsl_app.results.cloud.look import Points
from dsl_app.shared.spectrum import Pixel
from dsl_core.evaluation.marks import inside_outline, nearest_on_screen, on_screen
from dsl_core.evaluation.screen import foremost

#: Number of points searched for the one under the moving mouse; a click searches all.
HOVER_POINTS = 60_000


class Picking:
    """Points (n, 3) and their pixels as flat indices (n,) of a picture of ``columns``."""

    def __init__(self) -> None:
        self.points = np.empty((0, 3), np.float32)
        self.flat = np.empty(0, np.intp)
        self.columns = 1
        self._hovered: NDArray[np.float64] | None = None

    def take(self, points: Points, flat: NDArray[np.intp], columns: int) -> None:
        """Take other points."""
        self.points, self.flat, self.columns = points, flat, columns
        self._hovered = None

    def view_moved(self) -> None:
        """Forget where points were on the screen."""
        self._hovered = None

    def pixel_at(
        self,
        at: tuple[float, float],
        projection: NDArray[np.float64],
        size_px: tuple[int, int],
        most: int | None = None,
    ) -> Pixel | None:
        """The pixel of the point at a place (normalised), searching at most ``most`` points (None: all)."""
        if len(self.points) == 0:
            return None
        step = 1 if most is None else max(len(self.points) // most, 1)
        if step == 1 or self._hovered is None:
            seen = on_screen(self.points[::step], projection)
            self._hovered = seen if step > 1 else None
        else:
            seen = self._hovered
        found = nearest_on_screen(seen, at, size_px, 6.0 * step**0.5)
        return None if found is None else self._pixel(found * step)

    def _pixel(self, index: int) -> Pixel:
        y, x = divmod(int(self.flat[index]), self.columns)
        return x, y

    def mask_inside(
        self,
        outline: Sequence[tuple[float, float]],
        projection: NDArray[np.float64],
        size_px: tuple[int, int],
        shape: tuple[int, int],
    ) -> NDArray[np.bool_]:
        """Pixels (rows, columns) whose points are in an outline (normalised) and not hidden by others."""
        mask = np.zeros(shape, bool)
        if len(outline) >= 3 and len(self.points):
            seen = on_screen(self.points, projection)
            inside = inside_outline(seen[:, 0], seen[:, 1], outline)
            inside &= foremost(self.points, projection, size_px)
            mask.ravel()[self.flat[inside]] = True
        return mask
