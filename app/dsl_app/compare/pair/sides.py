"""Before there are two results: a place for each, with a picture of what is open and what could be."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QRect, QSize, Qt, Signal
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen, QPixmap, QResizeEvent, QShowEvent
from PySide6.QtWidgets import QFrame, QVBoxLayout, QWidget

from dsl_app.compare.pair.state import Floats, PairState, Side, side_texts
from dsl_app.shared.evented import follow_any
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.layouts import column_of, row_of
from dsl_app.shared.widgets.pictures import DEPTH, colour_map, hatch
from dsl_app.shared.widgets.recent_list import RecentList
from dsl_core.optics.levels import spread_of

#: Smallest height of a place, px, and how round its outline is.
LEAST_PX, ROUND_PX = 120, 8


class PairSides(QWidget):
    """The places of A and B; ``recent`` is shown in the one that is filled next."""

    def __init__(self, state: PairState, recent: RecentList) -> None:
        super().__init__()
        self._state, self._recent = state, recent
        self.places = [SidePlace(), SidePlace()]
        row_of(*((place, 1) for place in self.places), on=self, margins=0)
        self.stops = follow_any(self._show, state.first, state.second)
        recent.filled.connect(self._show_recent)
        for place in self.places:
            place.resized.connect(self._level)

    def _show(self) -> None:
        sides = self._state.first.value, self._state.second.value
        for place, side, (title, text) in zip(self.places, sides, side_texts(self._state), strict=True):
            place.show_side(side, title, text)
        free = self.places[sides[0] is not None]
        if self._recent.parent() is not free:
            free.column.insertWidget(free.column.indexOf(free.picture), self._recent)
        self._show_recent()
        self._level()

    def _level(self) -> None:
        """Give both texts the room of the longer one, which takes more lines on a narrow page."""
        texts = [place.text for place in self.places]
        room = max(text.heightForWidth(text.width()) for text in texts)
        for text in texts:
            text.setMinimumHeight(room)

    def _show_recent(self) -> None:
        # Without entries it would still push down the picture of its side, and the two would not be level.
        self._recent.setVisible(self._recent.files.count() > 0)

    def showEvent(self, event: QShowEvent) -> None:
        """List recent results, of which some may have come while the page was not seen."""
        super().showEvent(event)
        self._recent.fill()


class SidePlace(QFrame):
    """The place of one result."""

    resized = Signal()

    def __init__(self) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self.title, self.text, self.picture = (
            label("", "heading"),
            label("", "muted", wraps=True),
            SmallDepth(),
        )
        self.text.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.column: QVBoxLayout = column_of(self.title, self.text, (self.picture, 1), on=self)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Tell, once its text has its width."""
        super().resizeEvent(event)
        self.resized.emit()

    def show_side(self, side: Side | None, title: str, text: str) -> None:
        """Show a result, or with None that there is none yet."""
        self.title.setText(title)
        self.text.setText(text)
        self.picture.show_depth(None if side is None else side.arrays["depth_mm"])


class SmallDepth(QWidget):
    """The depth of a result as a picture; a dashed outline while there is none."""

    def __init__(self) -> None:
        super().__init__()
        self._pixmap, self._theme = QPixmap(), DARK
        self.setMinimumHeight(LEAST_PX)
        self.setAccessibleName("Depth")

    @property
    def is_empty(self) -> bool:
        """Whether there is no picture."""
        return self._pixmap.isNull()

    def show_depth(self, depth_mm: Floats | None) -> None:
        """Show depths (h, w); where there is none the ground is hatched, as in the pictures of a pair."""
        self._pixmap = QPixmap() if depth_mm is None else _pixmap(depth_mm)
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint it as large as it can be."""
        painter = QPainter(self)
        if self.is_empty:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(QColor(self._theme.line), 2, Qt.PenStyle.DashLine))
            painter.drawRoundedRect(self.rect().adjusted(1, 1, -2, -2), ROUND_PX, ROUND_PX)
            return
        size = self._pixmap.size().scaled(self.size(), Qt.AspectRatioMode.KeepAspectRatio)
        place = QRect(0, 0, size.width(), size.height())
        place.moveCenter(self.rect().center())
        hatch(painter, place, self._theme)
        painter.drawPixmap(place, self._pixmap)

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.update()

    def sizeHint(self) -> QSize:
        """What it takes at least."""
        return QSize(2 * LEAST_PX, LEAST_PX)


def _pixmap(depth_mm: Floats) -> QPixmap:
    low, high = spread_of(depth_mm)
    has_value = np.isfinite(depth_mm)
    share = np.where(has_value, (depth_mm - low) / max(high - low, 1e-6), 0).clip(0, 1)
    table = colour_map(DEPTH).getLookupTable(nPts=256, alpha=True)
    pixels = np.ascontiguousarray(table[(share * 255).astype(np.uint8)])
    pixels[~has_value, 3] = 0
    height, width = depth_mm.shape
    # A pixmap has its own pixels, while an image only points to these.
    return QPixmap.fromImage(QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_RGBA8888))
