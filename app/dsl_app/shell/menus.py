"""The menus of a window, made from the table of actions."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QMainWindow, QMenu, QWidget

from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.settings import RecentFiles, entry_text
from dsl_app.shell.actions import Action

#: Titles of menus whose first letter with Alt opens another one.
_TITLES = {"Results": "Res&ults"}


class Menus:
    """Makes a Qt action for each one of the table; ``do`` gets the key of the triggered one."""

    def __init__(self, window: QMainWindow, table: Iterable[Action], do: Callable[[str], object]) -> None:
        self._window, self._do = window, do
        self.actions: dict[str, QAction] = {}
        self._menus: dict[str, QMenu] = {}
        for record in table:
            self._add(record)

    def _add(self, record: Action) -> None:
        if record.menu not in self._menus:
            menu = self._window.menuBar().addMenu(_TITLES.get(record.menu, f"&{record.menu}"))
            menu.setToolTipsVisible(True)
            self._menus[record.menu] = menu
        if record.separator:
            self._menus[record.menu].addSeparator()
        made = QAction(record.text, self._window)
        if record.shortcut:
            made.setShortcut(QKeySequence(record.shortcut))
        made.setStatusTip(record.tip)
        made.setToolTip(plain_tip(record.tip or record.text.replace("&", "")))
        made.setCheckable(record.checkable)
        made.triggered.connect(lambda _checked=False, key=record.key: self._do(key))
        self.actions[record.key] = made
        self._menus[record.menu].addAction(made)

    def put_after(self, key: str, menu: QMenu) -> None:
        """Put a submenu below an action."""
        for home in self._menus.values():
            entries = home.actions()
            if self.actions[key] in entries:
                place = entries.index(self.actions[key]) + 1
                home.insertMenu(entries[place], menu)


class RecentMenu(QMenu):
    """Filled each time it is shown; missing files are marked, and choosing one says so."""

    def __init__(self, recent: RecentFiles, open_path: Callable[[Path], object], parent: QWidget) -> None:
        super().__init__("Open &recent", parent)
        self._recent, self._open = recent, open_path
        self.setToolTipsVisible(True)
        self.aboutToShow.connect(self.fill)
        self.fill()

    def fill(self) -> None:
        """List the files by number, the latest first."""
        self.clear()
        for i, path in enumerate(self._recent.paths.value, 1):
            # Only the first nine have a mnemonic.
            number = f"&{i}  " if i < 10 else f"{i}  "
            action = self.addAction(f"{number}{entry_text(path).replace('&', '&&')}")
            action.setToolTip(plain_tip(str(path)))
            action.setStatusTip(str(path))
            action.triggered.connect(lambda _checked=False, path=path: self._open(path))
        if self.isEmpty():
            self.addAction("Nothing has been opened yet").setEnabled(False)
