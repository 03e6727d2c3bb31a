"""Dialogs that only show text or ask one question, and the base of those that start long work."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import shiboken6
from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QFontDatabase, QIcon, QShowEvent
from PySide6.QtWidgets import (
    QApplication,
    QDialog,
    QDialogButtonBox,
    QLabel,
    QMessageBox,
    QPlainTextEdit,
    QWidget,
)

from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.forms import label, named, push_button, set_role
from dsl_app.shared.widgets.inside import stop_following
from dsl_app.shared.widgets.layouts import column_of
from dsl_app.shared.wording import in_window

#: Share of the window that a dialog of tables or plots takes.
SHARE = 0.65
#: What a desktop draws around a dialog, px.
FRAME = QSize(8, 40)


def confirm(parent: QWidget, title: str, text: str, go: str, stay: str) -> bool:
    """Whether a person wants what ends something: the button ``go``; Enter and Escape mean ``stay``.

    So does a window that is gone before its question is answered, as when all are closed.
    """
    box = QMessageBox(parent)
    box.setIcon(QMessageBox.Icon.Question)
    box.setWindowTitle(title)
    box.setTextFormat(Qt.TextFormat.PlainText)
    box.setText(text)
    wanted = box.addButton(go, QMessageBox.ButtonRole.AcceptRole)
    safe = box.addButton(stay, QMessageBox.ButtonRole.RejectRole)
    box.setDefaultButton(safe)
    box.setEscapeButton(safe)
    set_role(safe, "primary")
    box.exec()
    if not shiboken6.isValid(box):
        return False
    chosen = box.clickedButton()
    # It must not go before its answer is read, nor live as long as its parent.
    box.deleteLater()
    return chosen is wanted


class _Buttons(QDialogButtonBox):
    """The Tab key follows the order on screen, which is that of the desktop, and not that of creation."""

    def showEvent(self, event: QShowEvent) -> None:
        """Put the buttons in order."""
        super().showEvent(event)
        for before, after in pairwise(sorted(self.buttons(), key=lambda button: button.x())):
            self.setTabOrder(before, after)


def dialog_buttons(leave: QDialogButtonBox.StandardButton) -> QDialogButtonBox:
    """The buttons of a dialog, with one that leaves it.

    The Tab key reaches widgets in the order in which they come to the dialog: laid out last, these are last,
    and a form begins with its first field. The style's own icons are dark on a dark button.
    """
    made = _Buttons(leave)
    made.button(leave).setIcon(QIcon())
    return made


def text_window(title: str, content: QWidget, parent: QWidget, width: int, height: int) -> QDialog:
    """A dialog around some content, with a Close button."""
    window = QDialog(parent)
    window.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
    window.setWindowTitle(title)
    resize_within(window, QSize(width, height))
    buttons = dialog_buttons(QDialogButtonBox.StandardButton.Close)
    buttons.button(QDialogButtonBox.StandardButton.Close).setToolTip("Close this window (Escape)")
    buttons.rejected.connect(window.reject)
    column_of((content, 1), buttons, on=window)
    return window


def command_window(command: str, parent: QWidget) -> QDialog:
    """A command line to copy."""
    text = named(QPlainTextEdit(command), "Command line", "Run this in a terminal to do the same")
    text.setReadOnly(True)
    text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
    window = text_window("Command line", text, parent, 640, 220)
    copy = push_button(
        "Copy", "Copy the command", lambda: QApplication.clipboard().setText(command), "primary"
    )
    box = window.findChild(QDialogButtonBox)
    assert isinstance(box, QDialogButtonBox)
    box.addButton(copy, QDialogButtonBox.ButtonRole.ActionRole)
    return window


def use_room(dialog: QDialog, parent: QWidget, least: QSize) -> None:
    """Give a dialog of tables or plots most of the window it belongs to, and at least a size."""
    room = parent.window().size()
    resize_within(dialog, (room * SHARE).expandedTo(least))


def resize_within(dialog: QDialog, size: QSize) -> None:
    """Give a dialog a size, as far as its screen has room: its buttons must not be beyond the edge."""
    dialog.resize(size.boundedTo(dialog.screen().availableSize() - FRAME))


class JobDialog(QDialog):
    """Asks for the settings of long work, and closes once that has started.

    ``start`` starts it, or returns False; ``command_line`` gives the command that does the same. Lay out the
    settings in `column`, then call `close_column`.
    """

    def __init__(self, start: Callable[[], bool], command_line: Callable[[], str], parent: QWidget) -> None:
        super().__init__(parent)
        self._start_work = start
        #: Functions that disconnect the dialog from its state when it closes.
        self.stops: list[Callable[[], None]] = []
        self.column = column_of(on=self)
        self.text: QLabel = label("", "muted", wraps=True)
        self.buttons = dialog_buttons(QDialogButtonBox.StandardButton.Cancel)
        self.go = self.buttons.addButton("", QDialogButtonBox.ButtonRole.AcceptRole)
        set_role(self.go, "primary")
        self.command = self.buttons.addButton("Show command line", QDialogButtonBox.ButtonRole.ActionRole)
        self.command.setToolTip("Show the command that does the same in a terminal")
        self.command.clicked.connect(lambda: command_window(command_line(), self).open())
        self.buttons.accepted.connect(self._start)
        self.buttons.rejected.connect(self.reject)

    def name_buttons(self, go: str, go_tip: str, cancel_tip: str) -> None:
        """Set the texts and tooltips of the buttons."""
        self.go.setText(go)
        self.go.setToolTip(plain_tip(go_tip))
        self.buttons.button(QDialogButtonBox.StandardButton.Cancel).setToolTip(plain_tip(cancel_tip))

    def close_column(self) -> None:
        """Add remark and buttons below everything else."""
        self.column.addWidget(self.text)
        self.column.addWidget(self.buttons)

    def show_status(self, trouble: str, remark: str, is_busy: bool = False) -> None:
        """Show what is wrong, else the remark; the work can only start when nothing is wrong."""
        self.text.setText(in_window(trouble) or remark)
        set_role(self.text, "warn" if trouble else "muted")
        self.go.setEnabled(not trouble and not is_busy)

    def _start(self) -> None:
        if self._start_work():
            self.accept()

    def done(self, result: int) -> None:
        """Disconnect from the state."""
        stop_following(self)
        super().done(result)
