from __future__ import annotations

from dsl_app.shared.evented import Value
from dsl_app.shared.theme import DARK, LIGHT, Theme
from dsl_app.shared.widgets.inside import apply_theme_inside, apply_theme_to, stop_following
from dsl_app.shared.widgets.layouts import boxed, column_of, row_of
from PySide6.QtWidgets import QLabel, QWidget
from pytestqt.qtbot import QtBot


class Painted(QWidget):
    def __init__(self, *parts: QWidget) -> None:
        super().__init__()
        self.themes: list[Theme] = []
        column_of(*parts, on=self)

    def apply_theme(self, theme: Theme) -> None:
        self.themes.append(theme)


def test_the_outermost_parts_with_colours_get_the_theme_once(qtbot: QtBot) -> None:
    inner = Painted()
    outer, other = Painted(inner), Painted()
    page = boxed(row_of(QLabel("plain"), boxed(column_of(outer)), other))
    qtbot.addWidget(page)
    apply_theme_inside(page, LIGHT)
    assert outer.themes == other.themes == [LIGHT]
    assert inner.themes == [], "the widget around it knows what to pass on"
    apply_theme_to(page, DARK)
    apply_theme_to(outer, DARK)
    assert outer.themes == [LIGHT, DARK, DARK]


def test_a_page_and_all_in_it_stop_following(qtbot: QtBot) -> None:
    value, seen = Value(0), list[int]()
    part = QLabel("part")
    page = boxed(column_of(boxed(row_of(part))))
    qtbot.addWidget(page)
    page.stops = [value.changed.connect(seen.append)]  # type: ignore[attr-defined]
    part.stops = [value.changed.connect(lambda now: seen.append(-now))]  # type: ignore[attr-defined]
    value.set(1)
    stop_following(page)
    value.set(2)
    assert seen == [1, -1]
