"""A person before the screen: mouse and keys go to windows, as from the window system, never to widgets."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from PySide6.QtCore import QEvent, QMimeData, QPoint, QPointF, Qt, QTimer, QUrl
from PySide6.QtGui import QDragEnterEvent, QDropEvent, QWindow
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QComboBox, QWidget

W = TypeVar("W", bound=QWidget)
LEFT = Qt.MouseButton.LeftButton
PATIENCE_S = 400.0


def wait(holds: Callable[[], object], what: str, seconds: float = PATIENCE_S) -> None:
    """Let windows and threads live until something holds; ``what`` is said when it never does."""
    limit = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < limit, f"waited in vain: {what}"
        QApplication.processEvents()
        time.sleep(0.005)


def window_of(widget: QWidget) -> QWindow:
    """The window of the window system that a widget lies in."""
    handle = widget.window().windowHandle()
    assert handle is not None
    return handle


def click(widget: QWidget, at: QPoint | None = None) -> None:
    """Click what lies at a place of a widget, in its middle unless told where; it must be on top there."""
    wait(lambda: widget.isVisible() and widget.isEnabled(), f"{widget} to be there")
    at = widget.rect().center() if at is None else at
    on_top = QApplication.widgetAt(widget.mapToGlobal(at))
    assert on_top is not None
    assert on_top is widget or widget.isAncestorOf(on_top), f"{on_top} lies over {widget}"
    QTest.mouseClick(
        window_of(widget), LEFT, Qt.KeyboardModifier.NoModifier, widget.mapTo(widget.window(), at)
    )


def double_click(widget: QWidget, at: QPoint) -> None:
    """Click twice what lies at a place of a widget."""
    click(widget, at)
    place = widget.mapTo(widget.window(), at)
    QTest.mouseDClick(window_of(widget), LEFT, Qt.KeyboardModifier.NoModifier, place)


def drag(widget: QWidget, start: QPoint, end: QPoint) -> None:
    """Press at one place of a widget, move in steps, and release at another."""
    handle, none = window_of(widget), Qt.KeyboardModifier.NoModifier
    start, end = (widget.mapTo(widget.window(), at) for at in (start, end))
    QTest.mouseMove(handle, start)
    QTest.mousePress(handle, LEFT, none, start)
    for step in range(1, 9):
        QTest.mouseMove(handle, start + (end - start) * step / 8)
        QTest.qWait(10)
    QTest.mouseRelease(handle, LEFT, none, end)


def activate(widget: QWidget) -> None:
    """Give a window the keys, as a window manager does when the one over it is closed."""
    window = widget.window()
    if not window.isActiveWindow() and window.windowType() is not Qt.WindowType.Popup:
        window.activateWindow()
        assert QTest.qWaitForWindowActive(window)


def key(key: Qt.Key, of: QWidget, modifiers: Qt.KeyboardModifier = Qt.KeyboardModifier.NoModifier) -> None:
    """Press a key in the window of a widget."""
    activate(of)
    QTest.keyClick(window_of(of), key, modifiers)


def type_letter(widget: QWidget, letter: str) -> None:
    """Type a letter in the window of a widget."""
    activate(widget)
    # The binding takes letters, though its types do not say so.
    QTest.keyClick(window_of(widget), letter)  # type: ignore[call-overload]


def write(field: QWidget, text: str) -> None:
    """Click a field, replace what it holds, and leave it by Tab."""
    click(field, QPoint(12, field.height() // 2))
    key(Qt.Key.Key_A, field, Qt.KeyboardModifier.ControlModifier)
    for letter in text:
        type_letter(field, letter)
    key(Qt.Key.Key_Tab, field)


def choose(box: QComboBox, text: str) -> None:
    """Go to a list by Tab and type what its entry begins with."""
    for _ in range(100):
        if box.hasFocus():
            break
        key(Qt.Key.Key_Tab, box)
    assert box.hasFocus(), f"Tab never comes to {box.accessibleName()}"
    for letter in text:
        type_letter(box, letter)


def when_asked(kind: type[W], answer: Callable[[W], None]) -> list[W]:
    """Answer a dialog of a kind as soon as one waits for it; the returned list holds it from then on."""
    asked: list[W] = []

    def look() -> None:
        dialog = QApplication.activeModalWidget()
        if isinstance(dialog, kind) and dialog.isVisible():
            asked.append(dialog)
            answer(dialog)
        else:
            QTimer.singleShot(20, look)

    QTimer.singleShot(20, look)
    return asked


def opened(kind: type[W]) -> W:
    """The window of a kind, as soon as it is on the screen."""
    found: list[W] = []

    def look() -> bool:
        found[:] = [w for w in QApplication.topLevelWidgets() if isinstance(w, kind) and w.isVisible()]
        return bool(found)

    wait(look, f"a {kind.__name__}")
    QTest.qWaitForWindowExposed(found[0])
    return found[0]


def drop(widget: QWidget, path: Path) -> None:
    """Drop a file on a widget."""
    data = QMimeData()
    data.setUrls([QUrl.fromLocalFile(str(path))])
    at, copy, none = widget.rect().center(), Qt.DropAction.CopyAction, Qt.KeyboardModifier.NoModifier
    enter = QDragEnterEvent(at, copy, data, LEFT, none)
    QApplication.sendEvent(widget, enter)
    assert enter.isAccepted()
    QApplication.sendEvent(widget, QDropEvent(QPointF(at), copy, data, LEFT, none, QEvent.Type.Drop))
