from __future__ import annotations

import pytest
from dsl_app.shared.widget_state import ButtonState
from dsl_app.shared.widgets.forms import (
    ChoiceBox,
    NumberBox,
    WholeBox,
    allow,
    check_box,
    label,
    named,
    progress_bar,
    push_button,
    quiet,
    show_button,
)
from dsl_app.shared.widgets.read_table import RIGHT, ReadTable, cell
from PySide6.QtCore import QLocale, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLineEdit, QWidget
from pytestqt.qtbot import QtBot


@pytest.mark.parametrize("keys", [[Qt.Key.Key_G], [Qt.Key.Key_Down] * 2], ids=["typed", "arrows"])
def test_an_entry_that_was_found_by_keys_is_told(qtbot: QtBot, keys: list[Qt.Key]) -> None:
    box = ChoiceBox("Colour")
    qtbot.addWidget(box)
    for name in ("red", "blue", "green"):
        box.addItem(name)
    told: list[int] = []
    box.activated.connect(told.append)
    box.show()
    for key in keys:
        QTest.keyClick(box, key)
    assert box.currentText() == "green"
    assert told[-1] == 2


def test_an_entry_is_chosen_by_what_it_stands_for(qtbot: QtBot) -> None:
    box = ChoiceBox("Colour", choices=[("Red", 7), ("Blue", 9)])
    qtbot.addWidget(box)
    box.choose(9)
    assert (box.currentText(), box.accessibleName(), box.toolTip()) == ("Blue", "Colour", "Colour")


def test_a_button_that_cannot_be_pressed_says_why_before_what_it_does(qtbot: QtBot) -> None:
    button, own, tips = push_button("&Start", "Begins the work"), "Begins the work", list[str]()
    qtbot.addWidget(button)
    for on, why in ((False, "Open it first."), (True, "Open it first."), (False, "Connect it."), (False, "")):
        allow(button, on, why)
        assert button.isEnabled() == on
        tips.append(button.toolTip())
    assert tips == [f"Open it first. {own}", own, f"Connect it. {own}", own]
    show_button(button, ButtonState(is_enabled=False, tip="Goes on", why="Wait."))
    assert button.toolTip() == "Wait. Goes on"
    allow(button, False, "The scan <b>1 is open.")
    assert button.toolTip() == "<p>The scan &lt;b&gt;1 is open. Goes on</p>", "names are no markup"
    show_button(button, ButtonState(tip="Goes on"))
    assert button.toolTip() == "Goes on"


def test_a_button_says_and_does_what_it_was_made_for(qtbot: QtBot) -> None:
    done: list[int] = []
    button = push_button("&Start", "Begins the work", lambda: done.append(1), role="primary")
    qtbot.addWidget(button)
    button.click()
    assert (done, button.toolTip(), button.property("role")) == ([1], "Begins the work", "primary")
    box = check_box("Loop", "Again and again")
    qtbot.addWidget(box)
    assert (box.text(), box.toolTip()) == ("Loop", "Again and again")
    line = named(QLineEdit(), "Filter", "By words")
    qtbot.addWidget(line)
    assert (line.accessibleName(), line.toolTip()) == ("Filter", "By words")


def test_what_is_set_quietly_is_not_told(qtbot: QtBot) -> None:
    first, second = NumberBox("First", 0, 9, 1), NumberBox("Second", 0, 9, 1)
    told: list[float] = []
    for box in (first, second):
        qtbot.addWidget(box)
        box.valueChanged.connect(told.append)
    with quiet(first, second):
        first.setValue(2)
        with quiet(second):
            second.setValue(3)
        second.setValue(4)
    assert told == [], "an inner block does not end the outer one"
    first.setValue(5)
    assert told == [5.0]


def test_a_table_to_read_shows_whole_cells_and_is_left_by_tab(qtbot: QtBot) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    table, after = ReadTable("Figures", "What was found", ("Name", "Value")), QLineEdit()
    for child in (table, after):
        child.setParent(window)
    table.setRowCount(1)
    table.setItem(0, 0, cell("depth"))
    table.setItem(0, 1, cell("700.125 mm", side=RIGHT))
    with qtbot.waitActive(window):
        window.show()
        window.activateWindow()
    table.setFocus()
    table.setCurrentCell(0, 0)
    QTest.keyClick(table, Qt.Key.Key_F2)
    assert not table.findChildren(QLineEdit)
    assert {index.column() for index in table.selectedIndexes()} == {0, 1}
    QTest.keyClick(table, Qt.Key.Key_Tab)
    assert after.hasFocus()


def test_a_label_never_reads_its_text_as_markup(qtbot: QtBot) -> None:
    words = label("<b>bold</b><img src='http://example.org/x.png'>")
    qtbot.addWidget(words)
    assert words.textFormat() is Qt.TextFormat.PlainText
    words.setText("<h1>large</h1>")
    plain = label("x" * 14)
    qtbot.addWidget(plain)
    assert words.sizeHint().height() == plain.sizeHint().height()


@pytest.mark.parametrize("language", ["de_DE", "en_US", "fr_FR", "ar_EG"])
def test_a_number_means_the_same_in_every_language(qtbot: QtBot, language: str) -> None:
    before = QLocale()
    QLocale.setDefault(QLocale(language))
    try:
        for typed in ("55.5", "55,5"):
            box = NumberBox("Exposure", 0.0, 5000.0, 1.0, "ms", 1)
            qtbot.addWidget(box)
            box.selectAll()
            QTest.keyClicks(box, typed)
            box.interpretText()
            assert (box.value(), box.text()) == (55.5, "55.5 ms")
        whole, bar = WholeBox("Width", 0, 20_000, 1920, "px"), progress_bar("Progress")
        for widget in (whole, bar):
            qtbot.addWidget(widget)
        bar.setValue(42)
        assert (whole.text(), bar.text()) == ("1920 px", "42%")
    finally:
        QLocale.setDefault(before)
