"""The main window: pages and toasts, with menus, log and the actions of the table."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QAbstractSpinBox, QDockWidget, QLineEdit

from dsl_app.shared.known_files import Kind
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shell.actions import ACTIONS, Action
from dsl_app.shell.log import LogPanel
from dsl_app.shell.menus import Menus, RecentMenu
from dsl_app.shell.paged_window import PagedWindow, Parts, restore_layout
from dsl_app.shell.window_actions import THEMES, WindowActions


class MainWindow(PagedWindow):
    """The application's window.

    ``pages`` makes the widget of each page of the rail; ``commands`` do the actions of the table that neither
    a page nor the window itself can do; ``handlers`` open files and folders of kinds that no page opens.
    """

    def __init__(
        self,
        parts: Parts,
        pages: Mapping[str, Callable[[], PageWidget]],
        commands: Mapping[str, Callable[[], object]],
        handlers: Mapping[Kind, Callable[[Path], object]],
    ) -> None:
        super().__init__(parts, pages, handlers)
        self._log_dock = self._make_log_dock()
        self._acts: dict[str, Callable[[], object]] = {
            **WindowActions(self).all(),
            "show_log": self._show_log,
            **self._page_commands(),
            **commands,
        }
        self.menuBar().setObjectName("menu-bar")
        menus = Menus(self, ACTIONS, self.do)
        self.actions_by_key = menus.actions
        for action in ACTIONS:
            menus.actions[action.key].setVisible(self._can(action))
        self.recent_menu = RecentMenu(parts.recent, self.open_path, self)
        menus.put_after("open", self.recent_menu)
        self.opened.connect(self._offer_actions)
        parts.undo.changed.connect(lambda _: self._show_undo())
        self._show_undo()
        self.apply_theme(parts.settings.theme)
        restore_layout(self, parts.settings)

    def _make_log_dock(self) -> QDockWidget:
        dock = QDockWidget("Log", self)
        dock.setObjectName("log-dock")
        dock.setWidget(LogPanel(self.parts.records))
        self.addDockWidget(Qt.DockWidgetArea.BottomDockWidgetArea, dock)
        dock.hide()
        return dock

    def _show_log(self) -> None:
        self._log_dock.setVisible(not self._log_dock.isVisible())

    # Actions ---------------------------------------------------------------------------------------

    def do(self, key: str) -> None:
        """Do the action of a key: by the open page if it has it, else by the window."""
        typed = self.focusWidget()
        if isinstance(typed, QLineEdit | QAbstractSpinBox):
            # Text that is being typed is committed, as by a click on a button.
            typed.clearFocus()
            typed.setFocus()
        if not key.startswith(("page_", "theme_")):
            method = self.page_of(self.page).page_actions().get(key)
            if method is not None:
                method()
                return
        self._acts[key]()

    def _page_commands(self) -> dict[str, Callable[[], object]]:
        """Actions whose key begins with the name of a page: each opens that page, which does it."""

        def do_on(page: str, key: str) -> None:
            self.open_page(page).page_actions()[key]()

        pages = {action.key: action.key.partition("_")[0] for action in ACTIONS}
        return {key: partial(do_on, page, key) for key, page in pages.items() if page in self.pages}

    def _can(self, action: Action) -> bool:
        """Whether something does an action; others are not shown."""
        return bool(action.page) or action.key in self._acts

    def _offer_actions(self, page: str) -> None:
        for action in ACTIONS:
            if action.page:
                self.actions_by_key[action.key].setEnabled(action.page == page)

    def _show_undo(self) -> None:
        for key, word, text in (
            ("undo", "&Undo", self.parts.undo.undo_text),
            ("redo", "&Redo", self.parts.undo.redo_text),
        ):
            self.actions_by_key[key].setEnabled(bool(text))
            self.actions_by_key[key].setText(f"{word} {text}".strip())

    def apply_theme(self, name: str) -> None:
        """Show a theme by name: system, light or dark."""
        super().apply_theme(name)
        for key in THEMES:
            self.actions_by_key[f"theme_{key}"].setChecked(key == name)
