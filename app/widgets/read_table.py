"""Tables that are read, not edited: how all of them look and answer to keys."""

from __future__ import annotations

from collections.abc import Sequence

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableWidget, QTableWidgetItem

LEFT = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignVCenter
RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter


class ReadTable(QTableWidget):
    """Whole rows are selected, Tab leaves the table, columns are as wide as what they hold."""

    def __init__(self, name: str, tip: str, heads: Sequence[str], rows: int = 0) -> None:
        super().__init__(rows, len(heads))
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
        self.setWordWrap(True)
        header = self.horizontalHeader()
        header.setSectionResizeMode(column, QHeaderView.ResizeMode.Stretch)
        header.sectionResized.connect(lambda *_: self.resizeRowsToContents())


def cell(text: str, colour: str = "", side: Qt.AlignmentFlag = LEFT) -> QTableWidgetItem:
    """An item that shows all of its text when the mouse rests on it."""
    item = QTableWidgetItem(text)
    if colour:
        item.setForeground(QColor(colour))
    item.setTextAlignment(side)
    item.setToolTip(text)
    return item
