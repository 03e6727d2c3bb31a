"""One step: what to place where, what the camera sees, and whether it is right."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

from dsl_app.calibrate.figures_table import FiguresTable
from dsl_app.calibrate.wizard.ghost import PointsPx
from dsl_app.calibrate.wizard.placement_drawing import PlacementDrawing
from dsl_app.calibrate.wizard.presentation import NO_PICTURE, Points, step_display
from dsl_app.calibrate.wizard.state import Seen, WizardState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import label, set_role
from dsl_app.shared.widgets.layouts import HighArea, boxed, column_of, row_of, splitter
from dsl_app.shared.widgets.pictures import PictureView
from dsl_core.capture.preview import MANY_SATURATED

#: Height of the table of figures, and in a page that is lower than this.
TABLE_PX, LOW_TABLE_PX, LOW_PX = 166, 92, 560
DASHES = Qt.PenStyle.DashLine
NO_FIGURES = "What a check finds is listed here: figures, their limits, and what to do about those outside."


class StepPage(QWidget):
    """Follows the step that a wizard shows."""

    def __init__(self, state: WizardState) -> None:
        super().__init__()
        self._state = state
        self.title = label("", "title")
        self.instruction = label("", wraps=True, name="What to do", can_be_copied=True)
        self.drawing = PlacementDrawing()
        self.picture = LiveFrameView()
        self.verdict = label("", "muted", wraps=True, name="Whether the target is right")
        self.figures = FiguresTable("What the check found")
        self.figures.empty_text = NO_FIGURES
        self._lay_out()
        shown = (
            *(state.at, state.statuses, state.look, state.doing, state.is_checking),
            *(state.captures_itself, state.is_awaited, state.outlines, state.covered, state.places_itself),
        )
        self.stops = [*follow_any(self._show, *shown), state.seen.follow(self.picture.show_seen)]

    def _lay_out(self) -> None:
        # A low window has no room for all of it: it scrolls, and no line is drawn over another.
        left = HighArea(boxed(column_of((self.drawing, 1), self.instruction, margins=0)))
        split = splitter(Qt.Orientation.Horizontal, (left, 1), (self.picture, 1))
        column_of(self.title, (split, 1), self.verdict, self.figures, on=self, margins=(8, 0, 0, 0))

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give drawing and instruction the room that a low window has; the table scrolls."""
        super().resizeEvent(event)
        is_low = event.size().height() < LOW_PX
        self.figures.setFixedHeight(LOW_TABLE_PX if is_low else TABLE_PX)
        # The list of steps names it, too.
        self.title.setVisible(not is_low)

    def _show(self) -> None:
        shown = step_display(self._state)
        if shown is None:
            return
        self.title.setText(shown.title)
        self.instruction.setText(shown.instruction)
        self.drawing.show_placement(shown.placement)
        self.figures.show_figures(shown.figures)
        self.picture.show_points(shown.points)
        self.picture.say_why_empty(shown.why_no_picture)
        self.verdict.setText(shown.verdict)
        set_role(self.verdict, shown.role)


class LiveFrameView(QWidget):
    """The camera's last frame while a target is placed and captured; saturated pixels are red.

    Over it is where the target is wanted, what a look found of it, and what is captured already.
    """

    def __init__(self) -> None:
        super().__init__()
        tip = "The camera's last bright frame; saturated pixels are red"
        self.view = PictureView("Camera picture", tip)
        self.view.setMinimumSize(220, 150)
        self.view.box.setMouseEnabled(False, False)
        self._theme = DARK
        self._points, self._why_empty = Points(), NO_PICTURE
        self._wanted = pg.PlotCurveItem(antialias=True)
        self._found, self._covered = pg.ScatterPlotItem(size=7), pg.ScatterPlotItem(size=5)
        for item in (self._covered, self._wanted, self._found):
            self.view.box.addItem(item, ignoreBounds=True)
        self._text = label(self._why_empty, "muted", wraps=True)
        self.legend = [label("") for _ in range(3)]
        column_of((self.view, 1), row_of((self._text, 1), *self.legend), on=self, margins=0)

    def show_seen(self, seen: Seen | None) -> None:
        """Show a frame; None clears it."""
        if seen is None:
            self.view.image.clear()
            self._draw(has_picture=False)
            self._text.setText(self._why_empty)
            set_role(self._text, "muted")
            return
        self._draw(has_picture=True)
        self.view.image.setImage(seen.picture, autoLevels=False, levels=None)
        self.view.fit()
        self._text.setText(f"saturated {100 * seen.saturated:.2f} %")
        set_role(self._text, "bad" if seen.saturated > MANY_SATURATED else "muted")

    def say_why_empty(self, text: str) -> None:
        """Say below the place of the picture why there is none, while there is none."""
        self._why_empty = text
        if self.view.image.image is None:
            self._text.setText(text)

    def show_points(self, points: Points) -> None:
        """Draw points over the picture, as far as there is one."""
        self._points = points
        self._draw(self.view.image.image is not None)

    def _draw(self, has_picture: bool) -> None:
        shown, theme = self._points if has_picture else Points(), self._theme
        outline = (*shown.wanted, *shown.wanted[:1])
        self._wanted.setData(*_in_cells(outline), pen=pg.mkPen(theme.accent, width=2, style=DASHES))
        for item, points, colour in (
            (self._found, shown.found, theme.good),
            (self._covered, shown.covered, theme.muted),
        ):
            item.setData(*_in_cells(points), pen=pg.mkPen("#000000", width=1), brush=pg.mkBrush(colour))
        for line, (words, role) in zip(self.legend, (*shown.legend, *[("", "")] * 3), strict=False):
            line.setText(words)
            set_role(line, role)
            line.setVisible(bool(words))

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.view.apply_theme(theme)
        self._draw(self.view.image.image is not None)


def _in_cells(points_px: PointsPx) -> tuple[list[float], list[float]]:
    """Where pixels of the camera are in a picture of its Bayer cells, of two by two pixels each."""
    return [(x + 0.5) / 2 for x, _ in points_px], [(y + 0.5) / 2 for _, y in points_px]
