"""What the pictures of a capture show: a table with small pictures, and the columns that they decode to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QSize
from PySide6.QtGui import QIcon, QImage, QPixmap
from PySide6.QtWidgets import QHeaderView, QStackedWidget

from dsl_app.importing.captures.look import SMALL_PX
from dsl_app.importing.captures.state import NO_FILE, Decoded
from dsl_app.shared.known_files import breakable
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of
from dsl_app.shared.widgets.pictures import DEPTH, PictureView, colour_map
from dsl_app.shared.widgets.read_table import ReadTable, cell

_LEFT_OVER = "not in the mapping"


class FilesTable(ReadTable):
    """Each picture and what it shows."""

    def __init__(self) -> None:
        super().__init__("Pictures", "What each picture shows by the mapping", ("Picture", "Shows"))
        self.setIconSize(QSize(SMALL_PX, SMALL_PX * 3 // 4))
        self.horizontalHeader().setSectionResizeMode(1, QHeaderView.ResizeMode.Stretch)
        self._names: list[str] = []
        self._icons: dict[str, QIcon] = {}

    def show_table(self, table: tuple[tuple[str, str], ...]) -> None:
        """Show names and words; where they do not fit, the words say so."""
        names = [name for name, _ in table]
        if names != self._names:
            self._icons, self._names = {}, names
        self.show_rows([(cell(breakable(name)), cell(words, _role(name, words))) for name, words in table])
        self._show_icons()

    def show_small(self, small: dict[str, NDArray[np.uint8]]) -> None:
        """Show small pictures before the names."""
        self._icons = {name: QIcon(_pixmap(picture)) for name, picture in small.items()}
        self._show_icons()

    def _show_icons(self) -> None:
        for row, name in enumerate(self._names):
            item = self.item(row, 0)
            if item is not None and name in self._icons:
                item.setIcon(self._icons[name])
        self.resizeRowsToContents()


def _role(name: str, words: str) -> str:
    if name == NO_FILE:
        return "bad"
    return "warn" if words == _LEFT_OVER else "muted" if words == "not used" else ""


def _pixmap(picture: NDArray[np.uint8]) -> QPixmap:
    height, width = picture.shape[:2]
    image = QImage(picture.data, width, height, 3 * width, QImage.Format.Format_RGB888)
    return QPixmap.fromImage(image)


class DecodedPicture(QStackedWidget):
    """The decoded columns in colours, or words in their place."""

    def __init__(self) -> None:
        super().__init__()
        tip = "Columns of the projector that each pixel sees: they should run evenly over every surface"
        self.picture = PictureView("Decoded columns", tip)
        self.picture.image.setColorMap(colour_map(DEPTH))
        self.words = label("", "muted", wraps=True)
        self.addWidget(boxed(column_of(STRETCH, self.words, STRETCH)))
        self.addWidget(self.picture)

    def show_decoded(self, decoded: Decoded | None) -> None:
        """Show columns, from dark for the first to bright for the last."""
        if decoded is None:
            self.setCurrentIndex(0)
            return
        known = decoded.column_px[np.isfinite(decoded.column_px)]
        levels = (float(known.min()), float(known.max()) + 1e-3) if known.size else (0.0, 1.0)
        self.picture.image.setImage(decoded.column_px, levels=levels)
        self.picture.fit()
        self.setCurrentIndex(1)
