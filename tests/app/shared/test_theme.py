from __future__ import annotations

import pytest
from dsl_app.shared.theme import DARK, LIGHT, Theme, style_sheet
from PySide6.QtWidgets import QHBoxLayout, QToolButton, QWidget
from pytestqt.qtbot import QtBot


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.2."""
    parts = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a: str, b: str) -> float:
    high, low = sorted((luminance(a), luminance(b)), reverse=True)
    return (high + 0.05) / (low + 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=lambda theme: theme.name)
@pytest.mark.parametrize("role", ["text", "muted", "good", "warn", "bad"])
def test_text_is_readable(theme: Theme, role: str) -> None:
    for behind in (theme.window, theme.base):
        assert contrast(getattr(theme, role), behind) >= 4.5
    # On pictures there are hints.
    for behind in (theme.surround, theme.raised):
        assert contrast(theme.muted, behind) >= 4.5
        assert contrast(theme.accent, behind) >= 3


def test_a_hole_of_a_surface_is_not_black() -> None:
    for theme in (LIGHT, DARK):
        assert contrast("#000000", theme.raised) >= 1.5
        assert contrast("#ffffff", theme.raised) >= 1.15


def test_white_of_a_picture_has_an_edge_in_either_theme() -> None:
    for theme in (LIGHT, DARK):
        for colour in ("#ffffff", "#000000"):
            assert contrast(colour, theme.surround) >= 1.15


@pytest.mark.parametrize("theme", [LIGHT, DARK], ids=lambda theme: theme.name)
def test_accent_and_pins_stand_out(theme: Theme) -> None:
    assert contrast(theme.on_accent, theme.accent) >= 4.5
    assert all(contrast(theme.pin(index), theme.base) >= 3 for index in range(250))


@pytest.mark.parametrize("is_checked", [False, True])
def test_a_choice_shows_that_it_has_the_keys(qtbot: QtBot, is_checked: bool) -> None:
    window = QWidget()
    qtbot.addWidget(window)
    row, pictures = QHBoxLayout(window), []
    buttons = [QToolButton(), QToolButton()]
    for button in buttons:
        button.setProperty("role", "choice")
        button.setCheckable(True)
        button.setChecked(is_checked)
        row.addWidget(button)
    window.setStyleSheet(style_sheet(DARK))
    window.show()
    window.activateWindow()
    for other in buttons:
        other.setFocus()
        qtbot.waitUntil(other.hasFocus)
        pictures.append(buttons[0].grab().toImage())
    assert pictures[0] != pictures[1]
