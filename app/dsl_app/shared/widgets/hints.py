"""What can be done with a plot or a picture, said where it covers nothing."""

from __future__ import annotations

from PySide6.QtCore import QEvent
from PySide6.QtWidgets import QMainWindow, QWidget

from dsl_app.shared.widgets.forms import named


def hint(widget: QWidget, name: str, text: str) -> None:
    """Name a plot or picture for screen readers, and say in the status line what can be done with it.

    The widget leaves out the events of which `is_said_below` is true: its tooltip would cover the data. In a
    window without a status line it is shown.
    """
    named(widget, name, text)
    widget.setStatusTip(text)


def is_said_below(widget: QWidget, event: QEvent) -> bool:
    """Whether an event asks for a tooltip that the status line of the window has already."""
    return event.type() is QEvent.Type.ToolTip and isinstance(widget.window(), QMainWindow)
