"""Tables that are read, not edited: how all of them look and answer to keys."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import QModelIndex, QPersistentModelIndex, QSize, Qt, QTimer
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHeaderView,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QTableWidget,
    QTableWidgetItem,
)

LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


#: Room between rows whose lines break, px: without it two rows read as one.
ROOM_PX = 6


class _Roomy(QStyledItemDelegate):
    """Items with some room above and below."""

    def sizeHint(self, option: QStyleOptionViewItem, index: QModelIndex | QPersistentModelIndex) -> QSize:
        return super().sizeHint(option, index) + QSize(0, ROOM_PX)


class ReadTable(QTableWidget):
    """Whole rows are selected, Tab leaves the table, columns are as wide as what they hold."""

    def __init__(self, name: str, tip: str, heads: Sequence[str], rows: int = 0) -> None:
        super().__init__(rows, len(heads))
        self._wraps = False
        self.setAccessibleName(name)
        self.setToolTip(tip)
        self.setHorizontalHeaderLabels(heads)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.verticalHeader().hide()
        header = self.horizontalHeader()
        header.setDefaultAlignment(LEFT)
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)

    def wrap(self, column: int) -> None:
        """Let a column take the room that the others leave, and break its lines."""
        self._wraps = True
        self.setItemDelegate(_Roomy(self))
        header = self.horizontalHeader()
        header.setSectionResizeMode(column, QHeaderView.ResizeMode.Stretch)
        # All columns change one after the other; the rows follow once.
        self.fit_rows = QTimer(self)
        self.fit_rows.setSingleShot(True)
        self.fit_rows.timeout.connect(self.resizeRowsToContents)
        header.sectionResized.connect(lambda *_: self.fit_rows.start(0))

    def show_rows(self, rows: Sequence[Sequence[QTableWidgetItem]]) -> None:
        """Show other rows; columns and rows find their sizes once, not after every item."""
        self.setRowCount(len(rows))
        self.model().blockSignals(True)
        for number, row in enumerate(rows):
            for column, item in enumerate(row):
                self.setItem(number, column, item)
        self.model().blockSignals(False)
        self.model().layoutChanged.emit()
        if self._wraps:
            self.resizeRowsToContents()


def cell(text: str, colour: str = "", side: Qt.AlignmentFlag = LEFT) -> QTableWidgetItem:
    """An item that shows all of its text when the mouse rests on it."""
    item = QTableWidgetItem(text)
    if colour:
        item.setForeground(QColor(colour))
    item.setTextAlignment(side)
    item.setToolTip(text)
    return item
