from __future__ import annotations

import time

from dsl_app.shared.theme import DARK, LIGHT, Theme
from dsl_app.shared.widgets.deferred import PAUSE_MS, Deferred, call_deferred
from PySide6.QtCore import Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QLabel, QLineEdit, QVBoxLayout, QWidget
from pytestqt.qtbot import QtBot


class Slow(QLabel):
    """A part that takes long to make."""

    def __init__(self, made: list[Slow]) -> None:
        super().__init__("slow")
        self.theme = DARK
        made.append(self)

    def apply_theme(self, theme: Theme) -> None:
        self.theme = theme


def test_a_part_is_made_when_it_is_seen(qtbot: QtBot) -> None:
    made: list[Slow] = []
    room = Deferred(lambda: Slow(made))
    qtbot.addWidget(room)
    room.apply_theme(LIGHT)
    room.show()
    assert made == [], "the window comes round first"
    qtbot.waitUntil(lambda: room.made is not None and room.made.isVisible())
    assert made[0].theme is LIGHT
    room.apply_theme(DARK)
    assert made[0].theme is DARK
    room.hide()
    room.show()
    assert room.content is made[0]
    assert len(made) == 1


def test_who_asks_for_a_part_gets_it_at_once(qtbot: QtBot) -> None:
    made: list[Slow] = []
    room = Deferred(lambda: Slow(made))
    qtbot.addWidget(room)
    assert room.content is made[0]
    room.show()
    qtbot.waitUntil(made[0].isVisible)
    qtbot.wait(2 * PAUSE_MS)
    assert len(made) == 1


def test_a_part_that_nobody_waits_for_any_more_is_not_made(qtbot: QtBot) -> None:
    made: list[Slow] = []
    room = Deferred(lambda: Slow(made))
    qtbot.addWidget(room)
    room.show()
    room.hide()
    qtbot.wait(2 * PAUSE_MS)
    assert made == []
    room.show()
    qtbot.waitUntil(lambda: len(made) == 1)


def test_the_window_comes_round_between_two_turns(qtbot: QtBot) -> None:
    page = QWidget()
    qtbot.addWidget(page)
    rounds, turns = list[None](), list[int]()
    clock = QTimer(page)
    clock.timeout.connect(lambda: rounds.append(None))
    clock.start(0)

    def act() -> None:
        turns.append(len(rounds))
        time.sleep(2.5e-3 * PAUSE_MS)

    for _ in range(3):
        call_deferred(page, act)
    qtbot.waitUntil(lambda: len(turns) == 3)
    assert turns[0] < turns[1] < turns[2]


def test_whose_window_is_gone_loses_the_turn_and_others_do_not(qtbot: QtBot) -> None:
    page, gone, taken = QWidget(), QWidget(), list[str]()
    qtbot.addWidget(page)
    column = QVBoxLayout(page)
    column.addWidget(gone)
    call_deferred(gone, lambda: taken.append("gone"))
    call_deferred(page, lambda: taken.append("page"))
    column.removeWidget(gone)
    gone.deleteLater()
    qtbot.waitUntil(lambda: taken == ["page"])


def test_the_tab_key_comes_to_a_part_where_it_is(qtbot: QtBot) -> None:
    page, first, last = QWidget(), QLineEdit(), QLineEdit()
    qtbot.addWidget(page)
    room = Deferred(QLineEdit)
    layout = QVBoxLayout(page)
    for part in (first, room, last):
        layout.addWidget(part)
    page.show()
    made = room.content
    qtbot.waitUntil(made.isVisible)
    first.setFocus()
    for part in (made, last, first):
        QTest.keyClick(page.focusWidget(), Qt.Key.Key_Tab)
        assert page.focusWidget() is part
