"""Icons drawn in the colours of the theme, sharp at any scaling."""

from __future__ import annotations

from functools import lru_cache

from PySide6.QtCore import QByteArray, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPixmap
from PySide6.QtSvg import QSvgRenderer

from dsl_core.resources import resource_path

#: Pixels a side; Qt scales down to what a control needs.
SIZE_PX = 96
#: Side of the colour in front of a line of a list, px.
SWATCH_PX = 14


@lru_cache(maxsize=64)
def icon(name: str, colour: str, checked_colour: str = "") -> QIcon:
    """The icon ``resources/icons/NAME.svg``, its lines in a colour (``#rrggbb``) or, checked, in another."""
    made = QIcon(_picture(name, colour))
    if checked_colour:
        made.addPixmap(_picture(name, checked_colour), QIcon.Mode.Normal, QIcon.State.On)
    return made


def swatch(colour: str) -> QIcon:
    """The colour in front of a line of a list; on a selected line it has an edge, and keeps its colour.

    Without a picture of its own for that, Qt tints it by the colour of the selection.
    """
    picture = QPixmap(SWATCH_PX, SWATCH_PX)
    picture.fill(QColor(colour))
    made = QIcon(picture)
    edged = QPixmap(picture)
    painter = QPainter(edged)
    painter.setPen(Qt.GlobalColor.white)
    painter.drawRect(0, 0, SWATCH_PX - 1, SWATCH_PX - 1)
    painter.end()
    made.addPixmap(edged, QIcon.Mode.Selected)
    return made


def _picture(name: str, colour: str) -> QPixmap:
    drawing = resource_path(f"icons/{name}.svg").read_text(encoding="utf-8").replace("COLOR", colour)
    picture = QPixmap(SIZE_PX, SIZE_PX)
    picture.fill(Qt.GlobalColor.transparent)
    painter = QPainter(picture)
    QSvgRenderer(QByteArray(drawing.encode())).render(painter, QRectF(0, 0, SIZE_PX, SIZE_PX))
    painter.end()
    return picture
