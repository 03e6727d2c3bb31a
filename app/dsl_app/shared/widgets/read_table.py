"""Read-only tables: their look and their keys."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QSize, Qt, QTimer
from PySide6.QtGui import QColor, QFont, QPainter, QPaintEvent, QResizeEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QSizePolicy,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableWidget,
    QTableWidgetItem,
)

from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import quiet

LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
_ROLE, _SIDE = Qt.ItemDataRole.UserRole + 1, Qt.ItemDataRole.TextAlignmentRole
#: Space between rows with wrapped lines, px: without it two rows look like one.
ROOM_PX = 6
#: Least width of a column with wrapped lines, px: a few words.
LEAST_WRAPPED_PX = 160
#: Least width of a column that takes what the others leave, px: a short name with its colour.
LEAST_WIDE_PX = 76
#: Height of a row of figures, px.
DENSE_PX = 22


class _Roomy(QStyledItemDelegate):
    """Items with some room above and below."""

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:
        return super().sizeHint(option, index) + QSize(0, ROOM_PX)


class ReadTable(QTableWidget):
    """Whole rows are selected, Tab leaves the table, columns are as wide as their contents.

    Cells with a role have its colour in the ``theme``.
    """

    def __init__(self, name: str, tip: str, heads: Sequence[str], rows: int = 0) -> None:
        super().__init__(rows, len(heads))
        self._wrapped: int | None = None
        self._fills = True
        self._widened: int | None = None
        #: Said in its middle while it has no rows.
        self.empty_text = ""
        self.theme = DARK
        self.setAccessibleName(name)
        self.setToolTip(plain_tip(tip))
        self.setHorizontalHeaderLabels(heads)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.verticalHeader().hide()
        header = self.horizontalHeader()
        header.setDefaultAlignment(LEFT)
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)

    def wrap(self, column: int, fills: bool = True) -> None:
        """Let a column take the remaining width, but not less than `LEAST_WRAPPED_PX`, and wrap its lines.

        One that does not fill takes no more than its texts need: what stands beside them stays near.
        """
        self._wrapped, self._fills = column, fills
        self.setItemDelegate(_Roomy(self))
        header = self.horizontalHeader()
        header.setSectionResizeMode(column, QHeaderView.ResizeMode.Stretch)
        # All columns are resized one after the other; the rows only once.
        self.fit_rows = QTimer(self)
        self.fit_rows.setSingleShot(True)
        self.fit_rows.timeout.connect(self._fit_wrapped)
        header.sectionResized.connect(lambda *_: self.fit_rows.start(0))

    def be_dense(self, padding_px: int = 6) -> None:
        """Show rows of figures close to each other, with digits of equal width; ``padding_px`` between."""
        self.verticalHeader().setDefaultSectionSize(DENSE_PX)
        self.setStyleSheet(f"QTableView::item {{ padding: 0px {padding_px}px; }}")
        font = self.font()
        font.setFeature(QFont.Tag("tnum"), 1)
        self.setFont(font)

    def keep_room(self, rows: int) -> None:
        """Keep the room of so many rows, whether they are there, seen or hidden: nothing moves for them."""
        rows_px = rows * self.verticalHeader().defaultSectionSize()
        self.setMinimumHeight(self.horizontalHeader().sizeHint().height() + rows_px + 2 * self.frameWidth())
        policy = self.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        # It takes more where there is more, and asks for no more.
        policy.setVerticalPolicy(QSizePolicy.Policy.Ignored)
        self.setSizePolicy(policy)

    def widen(self, column: int) -> None:
        """Let a column take the remaining width, but not less than `LEAST_WIDE_PX`; longer texts are cut."""
        self._widened = column
        self.horizontalHeader().setSectionResizeMode(column, QHeaderView.ResizeMode.Stretch)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Fit the wrapped column to the new width."""
        super().resizeEvent(event)
        self._fit_widened()
        if self._wrapped is not None:
            self.fit_rows.start(0)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the rows, or what will be there."""
        super().paintEvent(event)
        if self.rowCount() == 0 and self.empty_text:
            painter = QPainter(self.viewport())
            painter.setPen(QColor(self.theme.muted))
            middle = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
            painter.drawText(self.viewport().rect().adjusted(8, 0, -8, 0), middle, self.empty_text)

    def _fit_widened(self) -> None:
        if self._widened is not None:
            self._stretch(self._widened, LEAST_WIDE_PX)

    def _fit_wrapped(self) -> None:
        assert self._wrapped is not None
        items = (self.item(row, self._wrapped) for row in range(self.rowCount()))
        has_text = any(item is not None and item.text() for item in items)
        self._stretch(self._wrapped, LEAST_WRAPPED_PX if has_text else 0)
        if has_text:
            self.resizeRowsToContents()
        else:
            self.verticalHeader().setDefaultSectionSize(DENSE_PX)
            for row in range(self.rowCount()):
                self.setRowHeight(row, DENSE_PX)

    def _stretch(self, column: int, least_px: int) -> None:
        """Give a column what the others leave; if that is too little, scroll sideways."""
        header = self.horizontalHeader()
        others = sum(header.sectionSize(i) for i in range(header.count()) if i != column)
        left_px = self.viewport().width() - others
        if not self._fills:
            needed_px = max(self.sizeHintForColumn(column), header.sectionSizeHint(column))
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Fixed)
            header.resizeSection(column, max(least_px, min(left_px, needed_px)))
        elif least_px and left_px < least_px:
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Fixed)
            header.resizeSection(column, least_px)
        else:
            header.setSectionResizeMode(column, QHeaderView.ResizeMode.Stretch)

    def show_rows(self, rows: Sequence[Sequence[QTableWidgetItem]]) -> None:
        """Show other rows; columns and rows are resized once, not after every item."""
        self.setRowCount(len(rows))
        for column, item in enumerate(rows[0] if rows else ()):
            # A head stands over its figures.
            self.model().setHeaderData(column, Qt.Orientation.Horizontal, item.data(_SIDE), _SIDE)
        with quiet(self.model()):
            for number, row in enumerate(rows):
                for column, item in enumerate(row):
                    self._colour(item)
                    self.setItem(number, column, item)
        self.model().layoutChanged.emit()
        self._fit_widened()
        if self._wrapped is not None:
            self._fit_wrapped()

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme to the cells; nobody is told that they changed."""
        self.theme = theme
        with quiet(self):
            for row, column in product(range(self.rowCount()), range(self.columnCount())):
                self._colour(self.item(row, column))

    def _colour(self, item: QTableWidgetItem | None) -> None:
        role = "" if item is None else item.data(_ROLE)
        if item is not None and role:
            item.setForeground(QColor(getattr(self.theme, role)))


def cell(text: str, role: str = "", side: Qt.AlignmentFlag = LEFT) -> QTableWidgetItem:
    """An item with its whole text as tooltip; ``role`` names a colour of the theme, such as muted."""
    item = QTableWidgetItem(text)
    item.setData(_ROLE, role)
    item.setTextAlignment(side)
    item.setToolTip(plain_tip(text))
    return item
