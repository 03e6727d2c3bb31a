"""The guided tour: darkens the window except for one part, and explains that on a card next to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from PySide6.QtCore import QEvent, QObject, QPoint, QRect, Qt, Signal
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPainterPath, QPaintEvent, QPen
from PySide6.QtWidgets import QFrame, QWidget

from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import label, push_button
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of

CARD_PX, GAP_PX, MARGIN_PX = 360, 14, 6
SHADE = QColor(0, 0, 0, 130)
_FORWARD = (Qt.Key.Key_Right, Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_PageDown)
_ARROWS = (Qt.Key.Key_Left, Qt.Key.Key_Right)
_BACK = (Qt.Key.Key_Left, Qt.Key.Key_Backspace, Qt.Key.Key_PageUp)


@dataclass(frozen=True)
class TourStep:
    """One step: the page it is about, the object name of the widget it points at, and its text."""

    page: str
    target: str
    title: str
    text: str


STEPS: tuple[TourStep, ...] = (
    TourStep(
        "rig",
        "rail",
        "Five pages, in the order of the work",
        "Rig, Calibrate, Scan, Results, Compare. Ctrl+1 to Ctrl+5 open them. You need no hardware: a"
        " simulated rig is included.",
    ),
    TourStep(
        "rig",
        "live-view",
        "Camera picture",
        "Start the live view to see raw frames with their histogram. Red cells are saturated; the focus score"
        " rises as edges get sharper. The display never changes what is saved.",
    ),
    TourStep(
        "scan",
        "scan-plan",
        "What to scan",
        "Choose a preset, or your own patterns and exposures. The curve next to it shows what accuracy costs"
        " in time on this rig.",
    ),
    TourStep(
        "scan",
        "scan-run",
        "Start, pause, resume",
        "Frames, time and disk space are shown before the start, and so is anything that prevents it. Every"
        " frame is saved before the next one is captured: a scan can always be resumed.",
    ),
    TourStep(
        "results",
        "spectra",
        "Spectra with their uncertainty",
        "The spectrum under the cursor, with its 95 % band; dashed where there was no light and only the"
        " smoothness prior decides. Click the picture to pin it; drop a spectroradiometer file to compare.",
    ),
    TourStep(
        "results",
        "result-pictures",
        "Five views, one cursor",
        "Keys 1 to 5: colours, one band, depth, quality, and the 3D cloud. All share one cursor, and the key"
        " I shows what its pixel received from each line.",
    ),
    TourStep(
        "results",
        "menu-bar",
        "Help wherever you are",
        "F1 explains the control that has the focus. File, Show command line shows the command that does the"
        " same. Help, Guided tour repeats this tour; Help, Demo opens a finished scan.",
    ),
)


class Tour(QWidget):
    """Covers a window; ``step_changed`` tells the step to show, ``ended`` that the tour is over.

    The receiver of ``step_changed`` opens the page, then calls `point_at` with the part of the window.
    """

    step_changed = Signal(object)
    ended = Signal()

    def __init__(self, steps: Sequence[TourStep], theme: Theme, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self._steps, self._theme, self._at = tuple(steps), theme, 0
        self._target: QWidget | None = None
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._count, self._title = label("", "muted"), label("", "heading")
        self._text = label("", wraps=True)
        self.skip = push_button("&Skip", "End the tour (Escape)", self.leave)
        self.back = push_button("&Back", "Previous step (left arrow)", lambda: self.go(self._at - 1))
        self.next = push_button(
            "&Next", "Next step (right arrow or Enter)", lambda: self.go(self._at + 1), role="primary"
        )
        for button in (self.skip, self.back, self.next):
            # Enter presses the one that has the focus, as in a dialog.
            button.setAutoDefault(True)
        self.card = self._make_card()
        for watched in (window, self.skip, self.back, self.next):
            watched.installEventFilter(self)

    def _make_card(self) -> QFrame:
        card = QFrame(self)
        card.setProperty("role", "card")
        card.setFixedWidth(CARD_PX)
        buttons = row_of(self.skip, STRETCH, self.back, self.next)
        column_of(self._count, self._title, self._text, 6, buttons, on=card, margins=(14, 12, 14, 12))
        return card

    @property
    def step(self) -> TourStep:
        """The step that is shown."""
        return self._steps[self._at]

    def start(self) -> None:
        """Show the first step."""
        self.setGeometry(self._window.rect())
        self.show()
        self.raise_()
        self.go(0)

    def go(self, to: int) -> None:
        """Show a step by its number; after the last one the tour ends."""
        if to >= len(self._steps):
            self.leave()
            return
        self._at = max(to, 0)
        step = self.step
        self._count.setText(f"{self._at + 1} of {len(self._steps)}")
        self._title.setText(step.title)
        self._text.setText(step.text)
        self.setAccessibleName(f"Tour: {step.title}")
        self.setAccessibleDescription(step.text)
        self.back.setEnabled(self._at > 0)
        self.next.setText("&Done" if self._at + 1 == len(self._steps) else "&Next")
        self.step_changed.emit(step)
        self.next.setFocus()

    def point_at(self, target: QWidget) -> None:
        """Keep a part of the window bright, and put the card next to it."""
        self._target = target
        self._settle()

    def leave(self) -> None:
        """End the tour."""
        self._window.removeEventFilter(self)
        self.hide()
        self.ended.emit()
        self.deleteLater()

    # Place -----------------------------------------------------------------------------------------

    @property
    def hole(self) -> QRect:
        """What stays bright, in pixels of the window."""
        if self._target is None:
            return QRect()
        corner = self._target.mapTo(self._window, QPoint(0, 0))
        around = QRect(corner, self._target.size()).adjusted(-MARGIN_PX, -MARGIN_PX, MARGIN_PX, MARGIN_PX)
        return around.intersected(self.rect())

    def _settle(self) -> None:
        self.card.adjustSize()
        self.card.move(next_to(self.hole, self.card.size().width(), self.card.size().height(), self.rect()))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Darken everything except the target."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        hole = QPainterPath()
        hole.addRoundedRect(self.hole, 6, 6)
        shade = QPainterPath()
        shade.addRect(self.rect())
        painter.fillPath(shade.subtracted(hole), SHADE)
        painter.setPen(QPen(QColor(self._theme.accent), 2))
        painter.drawPath(hole)

    # Keys and size ---------------------------------------------------------------------------------

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Arrows, Enter and Escape."""
        if event.key() in _FORWARD:
            self.go(self._at + 1)
        elif event.key() in _BACK:
            self.go(self._at - 1)
        elif event.key() == Qt.Key.Key_Escape:
            self.leave()

    def focusNextPrevChild(self, forward: bool) -> bool:
        """Keep Tab inside the card."""
        stops = [button for button in (self.skip, self.back, self.next) if button.isEnabled()]
        at = next((i for i, button in enumerate(stops) if button.hasFocus()), -1)
        stops[(at + (1 if forward else -1)) % len(stops)].setFocus()
        return True

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Follow the window's size, and handle the arrows before buttons use them to move the focus."""
        if watched is self._window and event.type() == QEvent.Type.Resize:
            self.setGeometry(self._window.rect())
            self._settle()
        if isinstance(event, QKeyEvent) and event.type() == QEvent.Type.KeyPress and event.key() in _ARROWS:
            self.keyPressEvent(event)
            return True
        return False


def next_to(hole: QRect, width: int, height: int, room: QRect) -> QPoint:
    """Position of a card of a size next to a hole: right, left, below or above it, else at its centre."""
    inside = QRect(room.left() + GAP_PX, room.top() + GAP_PX, room.width() - width - 2 * GAP_PX, 0)
    inside.setHeight(room.height() - height - 2 * GAP_PX)
    x = min(max(hole.left(), inside.left()), inside.right())
    y = min(max(hole.top(), inside.top()), inside.bottom())
    if hole.right() + GAP_PX + width < room.right():
        return QPoint(hole.right() + GAP_PX, y)
    if hole.left() - GAP_PX - width > room.left():
        return QPoint(hole.left() - GAP_PX - width, y)
    if hole.bottom() + GAP_PX + height < room.bottom():
        return QPoint(x, hole.bottom() + GAP_PX)
    if hole.top() - GAP_PX - height > room.top():
        return QPoint(x, hole.top() - GAP_PX - height)
    return QPoint(hole.center().x() - width // 2, hole.center().y() - height // 2)
