"""What a page or dialog passes on to everything in it: the colours of a theme, and the end of following."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from dsl_app.shared.theme import Theme


def apply_theme_inside(widget: QWidget, theme: Theme) -> None:
    """Apply the colours of a theme to the outermost parts of a widget that have an ``apply_theme``."""
    for part in widget.findChildren(QWidget, options=Qt.FindChildOption.FindDirectChildrenOnly):
        apply_theme_to(part, theme)


def apply_theme_to(widget: QWidget, theme: Theme) -> None:
    """Apply the colours of a theme to a widget, which passes them on if it has none of its own."""
    getattr(widget, "apply_theme", lambda theme: apply_theme_inside(widget, theme))(theme)


def stop_following(widget: QWidget) -> None:
    """Let a widget and everything in it follow no state any more, by the functions in their ``stops``."""
    for part in (widget, *widget.findChildren(QWidget)):
        for stop in getattr(part, "stops", ()):
            stop()
