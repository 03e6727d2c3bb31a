"""Rows and columns of widgets in one expression: parts in their order, with stretch and gaps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TypeVar

from PySide6.QtCore import QEvent, QObject, QSize, Qt
from PySide6.QtWidgets import (
    QBoxLayout,
    QHBoxLayout,
    QLayout,
    QScrollArea,
    QSplitter,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from dsl_app.shared.plain_tip import plain_tip

A = TypeVar("A", bound=QScrollArea)
B = TypeVar("B", bound=QBoxLayout)
#: Least height of content that scrolls, px.
LEAST_HIGH_PX = 72
#: No limit to a width.
LARGEST_PX = 16_777_215
Margins = int | tuple[int, int, int, int]


@dataclass(frozen=True)
class Stretch:
    """Empty room that takes its share of what is left."""

    share: int = 1


#: What pushes the parts before it and those after it apart.
STRETCH = Stretch()
Item = QWidget | QLayout
#: A widget or layout, alone or with its stretch and alignment; a gap in pixels; or empty room.
Part = Item | tuple[Item, int] | tuple[QWidget, int, Qt.AlignmentFlag] | int | Stretch


def row_of(
    *parts: Part, on: QWidget | None = None, margins: Margins | None = None, spacing: int | None = None
) -> QHBoxLayout:
    """Parts from left to right; ``on`` is the widget that they are laid out on."""
    return _filled(QHBoxLayout(), parts, on, margins, spacing)


def column_of(
    *parts: Part, on: QWidget | None = None, margins: Margins | None = None, spacing: int | None = None
) -> QVBoxLayout:
    """Parts from top to bottom; ``on`` is the widget that they are laid out on."""
    return _filled(QVBoxLayout(), parts, on, margins, spacing)


def boxed(layout: QLayout) -> QWidget:
    """A widget with a layout, where a widget is needed."""
    made = QWidget()
    made.setLayout(layout)
    return made


def _filled(
    box: B, parts: tuple[Part, ...], on: QWidget | None, margins: Margins | None, spacing: int | None
) -> B:
    if on is not None:
        on.setLayout(box)
    if margins is not None:
        left, top, right, bottom = (margins,) * 4 if isinstance(margins, int) else margins
        box.setContentsMargins(left, top, right, bottom)
    if spacing is not None:
        box.setSpacing(spacing)
    for part in parts:
        _add(box, part)
    return box


def _add(box: QBoxLayout, part: Part) -> None:
    match part:
        case int():
            box.addSpacing(part)
        case Stretch():
            box.addStretch(part.share)
        case (item, stretch):
            _add_item(box, item, stretch)
        case (widget, stretch, side):
            box.addWidget(widget, stretch, side)
        case item:
            _add_item(box, item)


def _add_item(box: QBoxLayout, item: Item, stretch: int = 0) -> None:
    if isinstance(item, QWidget):
        box.addWidget(item, stretch)
    else:
        box.addLayout(item, stretch)


def splitter(direction: Qt.Orientation, *parts: tuple[QWidget, int], sizes: Sequence[int] = ()) -> QSplitter:
    """A splitter of parts with their stretch factors, and their first sizes; no part can be collapsed."""
    made = QSplitter(direction)
    made.setChildrenCollapsible(False)
    for place, (widget, stretch) in enumerate(parts):
        made.addWidget(widget)
        made.setStretchFactor(place, stretch)
    if sizes:
        made.setSizes(sizes)
    return made


def scrolled(content: QWidget) -> QScrollArea:
    """Content that scrolls up and down where it is higher than its room, without a frame."""
    return _scrolling(QScrollArea(), content)


class HighArea(QScrollArea):
    """Content that scrolls up and down in a low window, at its full width; elsewhere as high as it likes."""

    def __init__(self, content: QWidget) -> None:
        super().__init__()
        self._content = content
        _scrolling(self, content)

    def minimumSizeHint(self) -> QSize:
        """As wide as the content with a scroll bar: nothing inside is cut at its side."""
        bar_px = self.verticalScrollBar().sizeHint().width()
        return QSize(self._content.minimumSizeHint().width() + bar_px, LEAST_HIGH_PX)

    def sizeHint(self) -> QSize:
        """As high as the content likes to be."""
        return self._content.sizeHint().expandedTo(self.minimumSizeHint())

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Ask for other room when the content does: it may be made later."""
        if event.type() is QEvent.Type.LayoutRequest:
            self.updateGeometry()
        return super().eventFilter(watched, event)


class SideArea(QScrollArea):
    """Content of a width that scrolls up and down; a scroll bar takes none of that width."""

    def __init__(self, content: QWidget, width_px: int) -> None:
        super().__init__()
        _scrolling(self, content)
        self._width_px, self._may_grow = width_px, False
        self.verticalScrollBar().rangeChanged.connect(lambda low, high: self._fit())
        self._fit()

    def set_width(self, width_px: int, may_grow: bool = False) -> None:
        """Give the content another width, exactly or at least."""
        self._width_px, self._may_grow = width_px, may_grow
        self._fit()

    def _fit(self) -> None:
        bar = self.verticalScrollBar()
        width_px = self._width_px + bar.sizeHint().width() * (bar.maximum() > 0)
        self.setMinimumWidth(width_px)
        self.setMaximumWidth(LARGEST_PX if self._may_grow else width_px)


def _scrolling(area: A, content: QWidget) -> A:
    """An area that follows the focus of what is inside and takes none itself, which nobody would see."""
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    area.setWidget(content)
    area.setWidgetResizable(True)
    area.setFrameShape(QScrollArea.Shape.NoFrame)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    return area


def tab_in_place(place: QWidget) -> None:
    """Let the Tab key come to what is inside a widget where that is: what is made later else comes last.

    The order is that in which parts were put into each other. Qt's own is not asked for: PySide takes what
    `nextInFocusChain` returns for a child of the widget that it was asked of, and once that is gone declares
    deleted what is still there.
    """
    stops = list(_stops(place.window()))
    inside = [each for each in stops if place.isAncestorOf(each)]
    if inside:
        # It is a ring, so that before the first comes the last.
        before = stops[stops.index(inside[0]) - 1]
        for one, other in pairwise((before, *inside)):
            QWidget.setTabOrder(one, other)


def _stops(widget: QWidget) -> Iterator[QWidget]:
    """What the Tab key comes to inside a widget, but for other windows."""
    for part in widget.findChildren(QWidget, options=Qt.FindChildOption.FindDirectChildrenOnly):
        if not part.isWindow():
            if part.focusPolicy() & Qt.FocusPolicy.TabFocus:
                yield part
            yield from _stops(part)


def tabs_of(name: str, *tabs: tuple[QWidget, str, str]) -> QTabWidget:
    """Tabs from their widgets, titles and tooltips; ``name`` is told to screen readers."""
    made = QTabWidget()
    made.setDocumentMode(True)
    made.tabBar().setDrawBase(False)
    made.tabBar().setAccessibleName(name)
    for widget, title, tip in tabs:
        made.setTabToolTip(made.addTab(widget, title), plain_tip(tip))
    return made
