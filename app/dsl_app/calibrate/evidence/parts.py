"""What evidence is made of: plots with a caption and a legend, tables of numbers, and reading aside."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Qt, QThreadPool, Signal
from PySide6.QtGui import QColor, QFont, QShowEvent
from PySide6.QtWidgets import (
    QLabel,
    QStackedLayout,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.deferred import call_deferred
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.plots import calm_plot, theme_plots
from dsl_app.shared.widgets.read_table import LEFT, RIGHT, ReadTable, cell

Floats = NDArray[np.floating[Any]]
#: A name of the legend with its colour (``#rrggbb``) and the sign that stands for it.
Key = tuple[str, str, str]
LINE, DOT, BAR = "━", "●", "■"


class ChartBox(QWidget):
    """A plot under its title and legend; a sentence in its place while there is nothing to draw.

    Plots are slow to make: this one is made and drawn when it is first seen.
    """

    def __init__(
        self,
        title: str,
        tip: str,
        left: str,
        bottom: str,
        left_width: int = 52,
        prepare: Callable[[Any], object] = lambda plot: None,
    ) -> None:
        """``prepare`` gets the plot when it is made."""
        super().__init__()
        self._theme, self._prepare = DARK, prepare
        self._make = partial(calm_plot, title, tip, left, bottom, left_width)
        self._plot: Any = None
        self._draw: Callable[[], object] | None = None
        self._is_next = False
        self.title = label(title, "heading")
        self.legend = QLabel()
        self.legend.setWordWrap(True)
        self.legend.setTextFormat(Qt.TextFormat.RichText)
        self.legend.setAccessibleName(f"Legend of {title}")
        self.sentence = label("", "muted")
        self.sentence.setWordWrap(True)
        self.sentence.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._stack = QStackedLayout()
        self._stack.addWidget(self.sentence)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addWidget(self.title)
        column.addWidget(self.legend)
        column.addLayout(self._stack, 1)

    def hasHeightForWidth(self) -> bool:
        """Boxes side by side and below each other share the room alike, however long their legends are."""
        return False

    @property
    def plot(self) -> Any:
        """The plot with all that is to be seen on it."""
        self._make_plot()
        self._draw_now()
        return self._plot

    def _make_plot(self) -> None:
        if self._plot is None:
            self._plot = self._make()
            self._plot.setMouseEnabled(False, False)
            self._plot.setMinimumHeight(90)
            theme_plots((self._plot,), self._theme)
            self._stack.addWidget(self._plot)
            self._prepare(self._plot)

    @property
    def item(self) -> Any:
        """What curves are added to."""
        return self.plot.getPlotItem()

    def draw(self, draw: Callable[[], object]) -> None:
        """Call what draws on this box as soon as the box is seen; only the latest is called."""
        self._draw = draw
        if self.isVisible():
            self._draw_soon()

    def showEvent(self, event: QShowEvent) -> None:
        """Draw what waited for it, one box after the other."""
        super().showEvent(event)
        self._draw_soon()

    def _draw_soon(self) -> None:
        if self._draw is not None and not self._is_next:
            self._is_next = True
            call_deferred(self, self._take_turn)

    def _take_turn(self) -> None:
        self._is_next = False
        if not self.isVisible():
            return
        # Making a plot takes as long as drawing on it: a turn each.
        if self._plot is None and self._draw is not None:
            self._make_plot()
            self._draw_soon()
        else:
            self._draw_now()

    def _draw_now(self) -> None:
        draw, self._draw = self._draw, None
        if draw is not None:
            draw()

    def begin(self) -> None:
        """Forget what was drawn and show the plot."""
        self.item.clear()
        self.legend.clear()
        self.legend.hide()
        self._stack.setCurrentWidget(self.plot)

    def say(self, sentence: str) -> None:
        """Show a sentence in place of the plot, and of what was to be drawn."""
        self._draw = None
        if self._plot is not None:
            self._plot.getPlotItem().clear()
        self.legend.clear()
        self.legend.hide()
        self.sentence.setText(sentence)
        self._stack.setCurrentWidget(self.sentence)

    def name_curves(self, keys: Sequence[Key]) -> None:
        """Show a legend of colours and names."""
        self.legend.setText(" &nbsp; ".join(_legend(*key) for key in keys))
        self.legend.show()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme; what is drawn keeps its own."""
        self._theme = theme
        if self._plot is not None:
            theme_plots((self._plot,), theme)


def like_a_picture(plot: Any) -> None:
    """Square pixels, and rows that count downwards."""
    plot.getViewBox().setAspectLocked(True)
    plot.getViewBox().invertY(True)


def _legend(name: str, colour: str, sign: str) -> str:
    words = escape(name).replace(" ", "&nbsp;")
    return f'<span style="color:{colour}">{sign}</span>&nbsp;{words}' if sign else words


@dataclass(frozen=True)
class Cell:
    """A number or words of a table; ``role`` is good, warn, bad or muted."""

    text: str
    role: str = ""


class NumberTable(ReadTable):
    """Rows of numbers in figures of equal width, right-aligned below their heads; nothing to edit."""

    def __init__(self, name: str, heads: Sequence[tuple[str, str]], words: Sequence[int] = (0,)) -> None:
        """``heads`` are names and tool tips of the columns; ``words`` are those that hold words."""
        super().__init__(name, "", [head for head, _ in heads])
        self._theme, self._words, self._rows = DARK, set(words), list[list[Cell]]()
        for column, (_, tip) in enumerate(heads):
            head = self.horizontalHeaderItem(column)
            assert head is not None
            head.setToolTip(tip)
            head.setTextAlignment(LEFT if column in self._words else RIGHT)
        self.verticalHeader().setDefaultSectionSize(22)
        self.horizontalHeader().setStretchLastSection(len(heads) - 1 in self._words)
        self.setStyleSheet("QTableView::item { padding: 0px 6px; }")
        font = self.font()
        font.setFeature(QFont.Tag("tnum"), 1)
        self.setFont(font)

    def fill(self, rows: Sequence[Sequence[Cell | str]]) -> None:
        """Show other rows; typographic minus signs throughout."""
        self._rows = [[each if isinstance(each, Cell) else Cell(each) for each in row] for row in rows]
        self.show_rows([[self._item(each, i) for i, each in enumerate(row)] for row in self._rows])
        self._colour()

    def _item(self, each: Cell, column: int) -> QTableWidgetItem:
        if column in self._words:
            return cell(each.text)
        return cell(each.text.replace("-", "−"), side=RIGHT)

    def row_texts(self, row: int) -> list[str]:
        """What a row says."""
        found = [self.item(row, column) for column in range(self.columnCount())]
        return [each.text() if each is not None else "" for each in found]

    def _colour(self) -> None:
        theme = self._theme
        colours = {"": theme.text, "good": theme.good, "warn": theme.warn, "bad": theme.bad}
        for i, row in enumerate(self._rows):
            for column, each in enumerate(row):
                item = self.item(i, column)
                if item is not None:
                    item.setForeground(QColor(colours.get(each.role, theme.muted)))

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self._colour()


def with_spread(value: float, std: float) -> str:
    """A value and its deviation with two digits of the deviation, down to a ten-thousandth.

    >>> with_spread(210.8184, 0.0204), with_spread(3.0, 0.0)
    ('210.818 ± 0.020', '3')
    """
    if std <= 0:
        return f"{value:g}"
    digits = min(max(1 - int(np.floor(np.log10(std))), 0), 4)
    return f"{value:.{digits}f} ± {max(std, 10.0**-digits):.{digits}f}"


class Aside(QObject):
    """Reads something in another thread and hands it over in the window's; only the latest is handed over."""

    _ended = Signal(int, object, object)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._number = 0
        self._show: Callable[[Any], object] | None = None
        self._ended.connect(self._finish)

    @property
    def is_busy(self) -> bool:
        """Whether something is still being read."""
        return self._show is not None

    def read(self, work: Callable[[], Any], show: Callable[[Any], object]) -> None:
        """Call ``show`` with what ``work`` returns, or with the exception that it raised."""
        self._number, self._show = self._number + 1, show
        number = self._number

        def run() -> None:
            try:
                found, trouble = work(), None
            except Exception as error:  # told in the window, never lost in a thread
                found, trouble = None, error
            # The widget may be gone meanwhile, and this object with it: then nobody waits for it.
            with suppress(RuntimeError):
                self._ended.emit(number, found, trouble)

        QThreadPool.globalInstance().start(run)

    def _finish(self, number: int, found: object, trouble: Exception | None) -> None:
        if number != self._number or self._show is None:
            return
        show, self._show = self._show, None
        show(found if trouble is None else trouble)
