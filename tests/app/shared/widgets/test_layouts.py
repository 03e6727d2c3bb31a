from __future__ import annotations

import shiboken6
from dsl_app.shared.widgets.layouts import (
    STRETCH,
    SideArea,
    Stretch,
    boxed,
    column_of,
    row_of,
    scrolled,
    splitter,
    tab_in_place,
    tabs_of,
)
from PySide6.QtCore import Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QDialogButtonBox, QLabel, QLineEdit, QPushButton, QWidget
from pytestqt.qtbot import QtBot


def test_parts_keep_their_order_stretch_and_side(qtbot: QtBot) -> None:
    one, two, three, inner = (QLabel(text) for text in ("one", "two", "three", "inner"))
    home = QWidget()
    qtbot.addWidget(home)
    side = Qt.AlignmentFlag.AlignTop
    made = row_of(one, (two, 3), 7, (three, 1, side), Stretch(2), (column_of(inner), 4), on=home, margins=5)
    items = [item for i in range(made.count()) if (item := made.itemAt(i)) is not None]
    assert [item.widget() for item in items[:2]] == [one, two]
    assert [made.stretch(i) for i in range(made.count())] == [0, 3, 0, 1, 2, 4]
    assert (items[2].sizeHint().width(), items[3].alignment()) == (7, side)
    assert home.layout() is made
    assert inner.parent() is home, "widgets of inner layouts belong to the widget, too"
    margins = made.contentsMargins()
    assert {margins.left(), margins.top(), margins.right(), margins.bottom()} == {5}


def test_a_side_is_not_cut_by_its_scroll_bar(qtbot: QtBot) -> None:
    content = QWidget()
    content.setMinimumHeight(300)
    home, area = QWidget(), SideArea(content, 120)
    row_of(area, STRETCH, on=home, margins=0)
    qtbot.addWidget(home)
    home.show()
    for height_px, is_scrolled in ((400, False), (200, True), (400, False)):
        home.resize(400, height_px)
        qtbot.waitUntil(lambda: area.viewport().width() == 120)
        assert (area.width() > 120) == is_scrolled
    area.set_width(90, may_grow=True)
    assert (area.minimumWidth(), area.maximumWidth() > 400) == (90, True)


def test_a_column_in_a_box_has_its_own_margins_and_spacing(qtbot: QtBot) -> None:
    word = QLabel("word")
    made = boxed(column_of(word, STRETCH, margins=(1, 2, 3, 4), spacing=9))
    qtbot.addWidget(made)
    column = made.layout()
    assert column is not None
    margins = column.contentsMargins()
    assert (margins.left(), margins.top(), margins.right(), margins.bottom()) == (1, 2, 3, 4)
    assert column.spacing() == 9
    assert word.parent() is made


def test_a_splitter_keeps_its_parts_open(qtbot: QtBot) -> None:
    left, right = QLabel("left"), QLabel("right")
    made = splitter(Qt.Orientation.Horizontal, (left, 0), (right, 1), sizes=(100, 300))
    qtbot.addWidget(made)
    made.resize(400, 50)
    made.show()
    assert [made.widget(i) for i in range(made.count())] == [left, right]
    assert not made.childrenCollapsible()
    assert made.sizes()[1] > 2 * made.sizes()[0]


def test_scrolled_content_is_as_wide_as_its_room(qtbot: QtBot) -> None:
    content = QLabel("content")
    area = scrolled(content)
    qtbot.addWidget(area)
    assert area.widget() is content
    assert area.widgetResizable()
    assert area.horizontalScrollBarPolicy() is Qt.ScrollBarPolicy.ScrollBarAlwaysOff
    assert area.focusPolicy() is Qt.FocusPolicy.NoFocus, "a stop of the Tab key that nobody sees"


def test_the_tab_key_comes_to_what_was_made_later_where_it_is(qtbot: QtBot) -> None:
    page, first, last = QWidget(), QLineEdit(), QLineEdit()
    qtbot.addWidget(page)
    place = boxed(column_of(margins=0))
    column_of(first, place, last, on=page)
    later = [QLineEdit(), QLineEdit()]
    for field in later:
        place.layout().addWidget(field)  # type: ignore[union-attr]
    tab_in_place(place)
    page.show()
    first.setFocus()
    for field in (*later, last, first):
        QTest.keyClick(page.focusWidget(), Qt.Key.Key_Tab)
        assert page.focusWidget() is field


def test_a_widget_that_goes_takes_no_button_of_others_along(qtbot: QtBot) -> None:
    page, message, box = QWidget(), QPushButton("Close"), QDialogButtonBox()
    qtbot.addWidget(page)
    place = boxed(column_of(QLineEdit(), margins=0))
    column_of(place, message, box, on=page)
    save = box.addButton("Save", QDialogButtonBox.ButtonRole.AcceptRole)
    tab_in_place(place)
    shiboken6.delete(message)
    assert shiboken6.isValid(save)


def test_tabs_have_titles_and_tips(qtbot: QtBot) -> None:
    first, second = QLabel("first"), QLabel("second")
    made = tabs_of("Views", (first, "&First", "The first one"), (second, "&Second", "The other"))
    qtbot.addWidget(made)
    assert [made.tabText(i) for i in range(2)] == ["&First", "&Second"]
    assert [made.tabToolTip(i) for i in range(2)] == ["The first one", "The other"]
    assert made.widget(1) is second
    assert made.tabBar().accessibleName() == "Views"
