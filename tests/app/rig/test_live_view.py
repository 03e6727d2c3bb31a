"""The live picture in the colours of a theme."""

from __future__ import annotations

from dsl_app.rig.live_view import LiveView
from dsl_app.shared.theme import DARK, LIGHT
from pytestqt.qtbot import QtBot


def test_the_legend_can_be_read_in_either_theme(qtbot: QtBot) -> None:
    view = LiveView()
    qtbot.addWidget(view)
    for theme in (DARK, LIGHT):
        view.apply_theme(theme)
        names = [text.item.toHtml() for _, text in view._legend.items]
        assert [theme.muted in name for name in names] == [True] * 3
