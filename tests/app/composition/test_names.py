"""Everything that can be operated has a name and says what it does, for eyes and for screen readers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from dsl_app.calibrate.campaign_box import NewCampaignDialog
from dsl_app.calibrate.page import CalibratePage
from dsl_app.calibrate.wizard.window import CalibrationWizard
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.importing.dialog import ImportDialog
from dsl_app.results.export.dialog import ExportDialog
from dsl_app.results.page import ResultsPage
from dsl_app.rig.page import RigPage
from dsl_app.rig.profiles.dialog import ProfileDialog
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shell.actions import PAGES
from dsl_app.shell.main_window import MainWindow
from dsl_app.shell.toasts import Toast
from PySide6.QtCore import Qt
from PySide6.QtGui import QAccessible
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QApplication,
    QComboBox,
    QDialogButtonBox,
    QDockWidget,
    QHeaderView,
    QLineEdit,
    QPlainTextEdit,
    QPushButton,
    QScrollBar,
    QTabBar,
    QTextBrowser,
    QWidget,
)
from pytestqt.qtbot import QtBot

from dsl_core.io.campaign_folder import CampaignFolder
from tests.app.importing.published_folders import make_folders
from tests.app.support.small_result import write_small_result

INTERACTIVE = (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QAbstractSpinBox,
    QComboBox,
    QLineEdit,
    QPlainTextEdit,
    QTextBrowser,
)


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> Iterator[MainWindow]:
    composition = Composition(StartOptions())
    made = composition.open_window(tmp_path)
    qtbot.addWidget(made)
    made.show()
    yield made
    made.close()


def operable(root: QWidget) -> Iterator[QWidget]:
    """What a person can operate below a widget, without the parts that Qt makes of its own."""
    for widget in root.findChildren(QWidget):
        if not isinstance(widget, INTERACTIVE) or isinstance(widget, QScrollBar | QHeaderView):
            continue
        if widget.objectName().startswith("qt_") or is_part(widget):
            continue
        yield widget


def is_part(widget: QWidget) -> bool:
    """Whether a widget is the inside of another one, such as the line of a spin box."""
    parent = widget.parentWidget()
    while parent is not None:
        if isinstance(parent, QAbstractSpinBox | QComboBox | QLineEdit | QAbstractItemView | QTabBar):
            return True
        if isinstance(parent, QDockWidget) and widget.parentWidget() is parent:
            return isinstance(widget, QAbstractButton)
        parent = parent.parentWidget()
    return False


def is_standard(widget: QWidget) -> bool:
    """Whether a button is one that every dialog of every program has, such as Cancel."""
    box = widget.parentWidget()
    if not isinstance(box, QDialogButtonBox) or not isinstance(widget, QAbstractButton):
        return False
    return box.standardButton(widget) is not QDialogButtonBox.StandardButton.NoButton


def complaints(root: QWidget) -> list[str]:
    found = []
    for room in root.findChildren(Deferred):
        _ = room.content
    for widget in operable(root):
        interface = QAccessible.queryAccessibleInterface(widget)
        name = interface.text(QAccessible.Text.Name) if interface is not None else ""
        what = f"{type(widget).__name__} {name or where(widget)!r}"
        if not name:
            found.append(f"{what} has no name")
        if not widget.toolTip() and not is_standard(widget):
            found.append(f"{what} has no tooltip")
    return found


def nameless(root: QWidget) -> list[str]:
    """What the Tab key comes to and a screen reader has no name for, plots and pictures included."""
    found = []
    for widget in root.findChildren(QWidget):
        is_stop = widget.focusPolicy() & Qt.FocusPolicy.TabFocus and widget.focusProxy() is None
        if not is_stop or widget.objectName().startswith("qt_") or is_part(widget):
            continue
        interface = QAccessible.queryAccessibleInterface(widget)
        if interface is None or not interface.text(QAccessible.Text.Name):
            found.append(where(widget))
    return found


def where(widget: QWidget) -> str:
    parts = []
    at: QWidget | None = widget
    while at is not None:
        parts.append(at.objectName() or type(at).__name__)
        at = at.parentWidget()
    return " < ".join(parts[:5])


@pytest.mark.parametrize("key", [page.key for page in PAGES])
def test_every_control_of_a_page_has_a_name_and_a_tooltip(window: MainWindow, key: str) -> None:
    page = window.open_page(key)
    assert complaints(page) == []
    assert nameless(page) == []
    assert given_twice(window, page) == []


@pytest.mark.slow
def test_a_button_that_cannot_be_pressed_says_why(window: MainWindow) -> None:
    silent = list[str]()
    for page in PAGES:
        shown = window.open_page(page.key)
        for room in shown.findChildren(Deferred):
            _ = room.content
        silent += [
            f"{page.key}: {button.text()}"
            for button in shown.findChildren(QPushButton)
            if button.isVisible() and not button.isEnabled() and not _has_reason(button)
        ]
    assert silent == []


def _has_reason(button: QPushButton) -> bool:
    own = button.property("own-tip")
    return own is not None and button.toolTip() != own


def given_twice(window: MainWindow, page: QWidget) -> list[str]:
    """Letters that Alt gives to a menu and to a part of a page, or to two parts that are seen at once."""
    menus = {letter(action.text()): action.text() for action in window.menuBar().actions()}
    seen, found = dict(menus), []
    assert len(menus) == len(window.menuBar().actions()), "two menus have one letter"
    texts: list[tuple[QWidget, str]] = [(each, each.text()) for each in page.findChildren(QAbstractButton)]
    texts += [(bar, bar.tabText(i)) for bar in page.findChildren(QTabBar) for i in range(bar.count())]
    for widget, text in texts:
        key = letter(text)
        owner = (seen if widget.isVisible() else menus).get(key) if key else None
        if owner is not None and owner != text:
            found.append(f"{text} and {owner}")
        if key and widget.isVisible():
            seen[key] = text
    return found


def letter(text: str) -> str:
    """The letter that acts with Alt; empty for none."""
    marked = text.replace("&&", "").partition("&")[2]
    return marked[:1].lower()


def test_every_control_around_the_pages_has_a_name_and_a_tooltip(window: MainWindow) -> None:
    window.toasts.tell("error", "A sentence", "Details")
    window.toasts.offer("An offer", {"Take it": lambda: None})
    window.do("tour")
    window.do("show_log")
    pages = [window.page_of(page.key) for page in PAGES]
    found = [
        each
        for widget in window.findChildren(QWidget)
        if widget.parentWidget() is window or isinstance(widget, Toast)
        for each in complaints(widget)
        if not any(page.isAncestorOf(widget) for page in pages)
    ]
    assert found == []


def test_every_control_of_the_results_has_a_name_and_a_tooltip(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    window.open_path(write_small_result(tmp_path))
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=20_000)
    page = window.open_page("results")
    assert isinstance(page, ResultsPage)
    page.export()
    (dialog,) = page.findChildren(ExportDialog)
    assert complaints(dialog) == []
    dialog.reject()
    assert complaints(page.graph) == []
    assert nameless(page.graph) == []
    assert complaints(NewCampaignDialog(tmp_path, "twin", page)) == []
    assert complaints(page) == []
    assert nameless(page) == []


def test_every_control_of_a_rig_profile_has_a_name_and_a_tooltip(window: MainWindow) -> None:
    page = window.open_page("rig")
    assert isinstance(page, RigPage)
    page.profile_requested.emit("")
    (dialog,) = window.findChildren(ProfileDialog)
    for form in dialog.forms.values():
        form.driver.setCurrentIndex(form.driver.count() - 1)
        form.driver.activated.emit(form.driver.currentIndex())
    assert complaints(dialog) == []


@pytest.mark.slow
def test_every_control_of_a_wizard_and_of_imports_has_a_name_and_a_tooltip(
    qtbot: QtBot, window: MainWindow, tmp_path: Path
) -> None:
    campaign = CampaignFolder.begin(tmp_path / "room", "twin", {"size": "64x48"})
    window.open_path(campaign.path)
    page = window.open_page("calibrate")
    assert isinstance(page, CalibratePage)
    page.banner.action.click()
    qtbot.waitUntil(lambda: page._rig.devices.value is not None, timeout=60_000)
    page.run("geometry")
    qtbot.waitUntil(lambda: bool(window.findChildren(CalibrationWizard)), timeout=60_000)
    (wizard,) = window.findChildren(CalibrationWizard)
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=60_000)
    assert complaints(wizard) == []
    assert nameless(wizard) == []
    wizard.reject()
    window.open_path(make_folders(tmp_path / "published").scene)
    qtbot.waitUntil(lambda: bool(window.findChildren(ImportDialog)), timeout=60_000)
    (dialog,) = window.findChildren(ImportDialog)
    assert complaints(dialog) == []
    dialog.reject()
    qtbot.waitUntil(lambda: not window.parts.runner.active, timeout=60_000)


@pytest.mark.parametrize("action", ["help_page", "shortcuts", "about", "show_command"])
def test_every_control_of_a_window_beside_has_a_name_and_a_tooltip(window: MainWindow, action: str) -> None:
    before = set(QApplication.topLevelWidgets())
    window.open_page("rig")
    window.do(action)
    opened = [each for each in QApplication.topLevelWidgets() if each not in before and each.isVisible()]
    assert opened
    for each in opened:
        assert complaints(each) == []
        each.close()
