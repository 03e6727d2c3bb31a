"""One step: what to place where, whether it is right, and how far its capture is."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QSplitter, QVBoxLayout, QWidget

from dsl_app.calibrate.figures_table import FiguresTable
from dsl_app.calibrate.wizard.live_picture import LivePicture
from dsl_app.calibrate.wizard.placement_drawing import PlacementDrawing
from dsl_app.calibrate.wizard.state import Doing, Look, WizardState
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import label, set_role

TABLE_PX = 166


class StepPage(QWidget):
    """Follows the step that a wizard shows."""

    def __init__(self, state: WizardState) -> None:
        super().__init__()
        self._state = state
        self.title = label("", "title")
        self.instruction = label("")
        self.instruction.setWordWrap(True)
        self.instruction.setAccessibleName("What to do")
        self.instruction.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.drawing = PlacementDrawing()
        self.picture = LivePicture()
        self.verdict = label("", "muted")
        self.verdict.setWordWrap(True)
        self.verdict.setAccessibleName("Whether the target is right")
        self.figures = FiguresTable("What the look found")
        self.figures.setFixedHeight(TABLE_PX)
        self._lay_out()
        self.stops = [
            state.at.follow(lambda _: self._show_step()),
            state.statuses.follow(lambda _: self._show_step()),
            state.look.follow(lambda _: self._show_look()),
            state.doing.follow(lambda _: self._show_look()),
            state.is_checking.follow(lambda _: self._show_look()),
            state.seen.follow(self.picture.show_seen),
        ]

    def _lay_out(self) -> None:
        left = QWidget()
        words = QVBoxLayout(left)
        words.setContentsMargins(0, 0, 0, 0)
        words.addWidget(self.drawing, 1)
        words.addWidget(self.instruction)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.setChildrenCollapsible(False)
        split.addWidget(left)
        split.addWidget(self.picture)
        split.setStretchFactor(0, 1)
        split.setStretchFactor(1, 1)
        head = QHBoxLayout()
        head.addWidget(self.title)
        head.addStretch(1)
        column = QVBoxLayout(self)
        column.setContentsMargins(8, 0, 0, 0)
        column.addLayout(head)
        column.addWidget(split, 1)
        column.addWidget(self.verdict)
        column.addWidget(self.figures)

    def _show_step(self) -> None:
        status = self._state.status
        if status is None:
            return
        self.title.setText(status.step.title)
        self.instruction.setText(status.step.instruction)
        self.drawing.show_placement(status.step.placement)
        self._show_look()

    def _show_look(self) -> None:
        look = self._state.look.value
        self.figures.show_figures(() if look is None else look.figures)
        text, role = self._verdict(look)
        self.verdict.setText(text)
        set_role(self.verdict, role)

    def _verdict(self, look: Look | None) -> tuple[str, str]:
        state, status = self._state, self._state.status
        if state.doing.value in (Doing.CAPTURING, Doing.STOPPING):
            return "Capturing. Touch nothing until it is done.", "warn"
        if look is not None and look.trouble:
            return look.trouble, "bad"
        if look is not None:
            return (
                ("All is right: capture.", "good")
                if look.is_good
                else ("Not right yet; the table says what to do.", "warn")
            )
        if state.is_checking.value:
            return "Looking…", "muted"
        if status is not None and status.state == "captured":
            return (
                "✓ Captured. It can be captured anew; the old one stays until the new one is whole.",
                "good",
            )
        if status is not None and status.state == "refused":
            return f"✗ Refused: {status.reason}", "bad"
        return "Place the target, then check that it is right, or capture at once.", "muted"

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        for part in (self.drawing, self.picture, self.figures):
            part.apply_theme(theme)
