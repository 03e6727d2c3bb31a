"""A rectangle on a picture that a person draws up by its corners."""

from __future__ import annotations

from typing import Any

import pyqtgraph as pg

from dsl_app.shared.theme import Theme

#: Region of an image as x, y, width, height in its pixels.
Region = tuple[int, int, int, int]
#: The first region: the middle part of the picture, of this share in width and height.
FIRST_SHARE = 0.4


class RegionBox(pg.RectROI):  # type: ignore[misc]
    """Drag it or its corners; it lies on an image that shows ``cell_px`` pixels a side as one."""

    def __init__(self, cell_px: int) -> None:
        super().__init__((0, 0), (1, 1), sideScalers=True)
        self.addScaleHandle((0, 0), (1, 1))
        self._cell_px = cell_px

    def put_in_middle(self, width_px: int, height_px: int) -> None:
        """Cover the middle of an image of so many pixels."""
        wide, high = (size * FIRST_SHARE / self._cell_px for size in (width_px, height_px))
        self.setPos((width_px / self._cell_px - wide) / 2, (height_px / self._cell_px - high) / 2)
        self.setSize((wide, high))

    def region(self, width_px: int, height_px: int) -> Region:
        """What it covers, whole cells within the image, at least one."""
        cell = self._cell_px
        left, top = self.pos().x(), self.pos().y()
        right, bottom = left + self.size().x(), top + self.size().y()
        x0, y0 = (_within(at, 0, size // cell - 1) for at, size in ((left, width_px), (top, height_px)))
        x1, y1 = (
            _within(at, low + 1, size // cell)
            for at, low, size in ((right, x0, width_px), (bottom, y0, height_px))
        )
        return x0 * cell, y0 * cell, (x1 - x0) * cell, (y1 - y0) * cell

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self.setPen(pg.mkPen(theme.accent, width=2))
        self.hoverPen = pg.mkPen(theme.accent, width=3)
        handles: list[Any] = self.getHandles()
        for handle in handles:
            handle.pen = pg.mkPen(theme.accent, width=2)
            handle.currentPen = handle.pen


def _within(value: float, low: int, high: int) -> int:
    return min(max(round(value), low), high)


def cut(pixels: Any, region: Region | None) -> Any:
    """The part of a mosaic that a region covers; all of it for None."""
    if region is None:
        return pixels
    x, y, width, height = region
    return pixels[y : y + height, x : x + width]
