from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import pytest
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.shared.jobs.qt_runner import QtRunner
from dsl_app.shell.main_window import MainWindow
from dsl_app.shell.toasts import Toasts
from dsl_app.shell.tour import STEPS, Tour, next_to
from PySide6.QtCore import QRect, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QPushButton, QWidget
from pytestqt.qtbot import QtBot


@pytest.fixture
def window(qtbot: QtBot, tmp_path: Path) -> MainWindow:
    composition = Composition(StartOptions())
    made = composition.open_window(tmp_path)
    qtbot.addWidget(made)
    made.show()
    qtbot.waitExposed(made)
    return made


def idle(runner: QtRunner) -> bool:
    return not runner.active


def tour_of(window: MainWindow) -> Tour:
    (tour,) = window.findChildren(Tour)
    return tour


def test_the_tour_goes_forth_and_back_by_mouse_and_keys(qtbot: QtBot, window: MainWindow) -> None:
    window.do("tour")
    tour = tour_of(window)
    assert not tour.back.isEnabled()
    for step in STEPS[:-1]:
        assert tour.step is step
        assert window.page == step.page
        QTest.mouseClick(tour.next, Qt.MouseButton.LeftButton)
    assert tour.next.text() == "&Done"
    QTest.keyClick(tour.next, Qt.Key.Key_Left)
    assert tour.step is STEPS[-2]
    QTest.mouseClick(tour.back, Qt.MouseButton.LeftButton)
    assert tour.step is STEPS[-3]
    for _ in range(3):
        QTest.keyClick(tour, Qt.Key.Key_Right)
    qtbot.waitUntil(lambda: not window.findChildren(Tour))
    assert window.parts.settings.tour_seen
    window.close()


def test_escape_leaves_and_the_menu_starts_it_again(qtbot: QtBot, window: MainWindow) -> None:
    window.actions_by_key["tour"].trigger()
    window.actions_by_key["tour"].trigger()
    QTest.keyClick(tour_of(window), Qt.Key.Key_Escape)
    qtbot.waitUntil(lambda: not window.findChildren(Tour))
    window.actions_by_key["tour"].trigger()
    assert tour_of(window).step is STEPS[0]
    window.close()


def test_tab_stays_on_the_card(window: MainWindow) -> None:
    window.do("tour")
    tour = tour_of(window)
    for _ in range(4):
        QTest.keyClick(QApplication.focusWidget() or tour, Qt.Key.Key_Tab)
        assert QApplication.focusWidget() in (tour.skip, tour.back, tour.next)
    window.close()


def test_every_step_points_at_something_that_exists(window: MainWindow) -> None:
    for step in STEPS:
        window.page_of(step.page)
        assert window.findChild(QWidget, step.target) is not None, step.target
    window.close()


def test_the_card_covers_neither_the_target_nor_leaves_the_window(window: MainWindow) -> None:
    window.resize(1024, 700)
    window.do("tour")
    tour = tour_of(window)
    for _ in STEPS[:-1]:
        assert tour.rect().contains(tour.card.geometry())
        tour.next.click()
    window.close()


def test_a_card_stands_where_there_is_room() -> None:
    room = QRect(0, 0, 1000, 800)
    assert next_to(QRect(0, 0, 90, 800), 360, 200, room).x() > 90
    assert next_to(QRect(700, 100, 300, 200), 360, 200, room).x() < 340
    assert next_to(QRect(100, 0, 850, 30), 360, 200, room).y() > 30
    assert next_to(QRect(100, 600, 850, 190), 360, 200, room).y() < 400


def test_a_person_is_offered_the_tour_once(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stays: list[float] = []
    offer = Toasts.offer

    def offering(self: Toasts, text: str, offers: dict[str, Any], stay_s: float = 0.0) -> None:
        stays.append(stay_s)
        offer(self, text, offers, stay_s)

    monkeypatch.setattr(Toasts, "offer", offering)
    for offered in (True, False):
        composition = Composition(StartOptions(offers_tour=True))
        window = composition.open_window(tmp_path)
        qtbot.addWidget(window)
        window.show()
        composition._start_now()
        toasts, runner = window.toasts.shown, window.parts.runner
        buttons = [button.text() for toast in toasts for button in toast.findChildren(QPushButton)]
        assert ("Take the tour" in buttons) is offered
        # It leaves by itself: the page needs the room.
        assert all(stay_s > 0 for stay_s in stays)
        qtbot.waitUntil(partial(idle, runner), timeout=60_000)
        window.close()
