from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.shared.widgets.help_window import HelpWindow, help_of, help_pages, help_window, slug, title_of
from dsl_app.shell.actions import PAGES
from dsl_app.shell.main_window import MainWindow
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget
from pytestqt.qtbot import QtBot

NAMES = {page.stem: page for page in help_pages()}


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> Iterator[MainWindow]:
    composition = Composition(StartOptions())
    made = composition.open_window(tmp_path)
    qtbot.addWidget(made)
    made.show()
    qtbot.waitExposed(made)
    yield made
    made.close()


def exists(topic: str) -> bool:
    name, _, heading = topic.partition("#")
    if name not in NAMES:
        return False
    headings = re.findall(r"^#+ (.*)$", NAMES[name].read_text(encoding="utf-8"), re.MULTILINE)
    return not heading or heading in [slug(each) for each in headings]


@pytest.mark.parametrize("page", NAMES.values(), ids=lambda page: page.stem)
def test_links_between_pages_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)]+)\)", page.read_text(encoding="utf-8"))
    broken = [
        link for link in links if not link.startswith("http") and not exists(link.replace(".md", "", 1))
    ]
    assert broken == []
    assert title_of(page)


def test_every_topic_of_the_window_exists(window: MainWindow) -> None:
    topics = {page.help for page in PAGES}
    for page in PAGES:
        shown = window.page_of(page.key)
        topics |= {
            str(each.property("help")) for each in shown.findChildren(QWidget) if each.property("help")
        }
    assert len(topics) > len(PAGES) + 5
    assert [topic for topic in sorted(topics) if not exists(topic)] == []


def opened() -> HelpWindow:
    (found,) = (w for w in QApplication.topLevelWidgets() if isinstance(w, HelpWindow) and w.isVisible())
    return found


def test_f1_explains_what_has_the_focus(window: MainWindow) -> None:
    window.activateWindow()
    page = window.open_page("scan")
    inside = page.findChild(QWidget, "scan-plan")
    assert inside is not None
    control = next(w for w in inside.findChildren(QWidget) if w.focusPolicy() & Qt.FocusPolicy.TabFocus)
    assert help_of(control) == "scanning#the-plan"
    control.setFocus()
    QTest.keyClick(window, Qt.Key.Key_F1)
    shown = opened()
    assert shown.page == "scanning"
    assert shown.text.textCursor().block().text() == "The plan"
    shown.accept()


def test_without_a_better_one_the_page_is_explained(window: MainWindow) -> None:
    for page in PAGES:
        window.open_page(page.key)
        window.rail.setFocus()
        window.do("help_page")
        shown = opened()
        assert shown.page == page.help
        shown.accept()
        QApplication.processEvents()


def test_links_and_the_list_lead_on_and_back_leads_back(qtbot: QtBot, window: MainWindow) -> None:
    shown = help_window("numbers", window)
    shown.show()
    # No title is cut.
    assert shown.pages.sizeHintForColumn(0) <= shown.pages.viewport().width()
    shown.show()
    assert not shown.back.isEnabled()
    shown.show_topic("comparing#figures")
    assert shown.pages.currentItem().text() == "Comparing"
    QTest.mouseClick(shown.back, Qt.MouseButton.LeftButton)
    assert shown.page == "numbers"
    QTest.mouseClick(shown.forward, Qt.MouseButton.LeftButton)
    assert shown.page == "comparing"
    rows = [shown.pages.item(i).text() for i in range(shown.pages.count())]
    assert rows[0] == "The rig"
    shown.pages.setCurrentRow(0)
    assert shown.page == "rig"
    assert "diffraction film" in shown.text.toPlainText()
    shown.accept()


def test_a_page_that_is_not_installed_is_said(window: MainWindow) -> None:
    shown = help_window("no-such-page", window)
    assert "Install dsl-scan again" in shown.text.toPlainText()
    shown.accept()


def test_a_search_lists_the_pages_with_all_words_and_shows_where(qtbot: QtBot, window: MainWindow) -> None:
    made = help_window("rig", window)
    qtbot.addWidget(made)
    QTest.keyClicks(made.search, "spectral angle")
    listed = [item for i in range(made.pages.count()) if not (item := made.pages.item(i)).isHidden()]
    assert 0 < len(listed) < made.pages.count()
    QTest.keyClick(made.search, Qt.Key.Key_Return)
    first = made.text.textCursor()
    assert first.selectedText().lower() == "spectral"
    QTest.keyClick(made.search, Qt.Key.Key_Return)
    assert made.text.textCursor().position() != first.position()
    assert made.nothing.isHidden()
    made.search.setText("spectral quux")
    assert not made.nothing.isHidden()
    made.search.clear()
    assert made.nothing.isHidden()
    assert not any(made.pages.item(i).isHidden() for i in range(made.pages.count()))
