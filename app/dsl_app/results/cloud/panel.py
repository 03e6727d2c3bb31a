"""The 3D cloud of a result, with cursor, pins and a lasso."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, Qt, QTimer
from PySide6.QtGui import QMouseEvent, QShowEvent
from PySide6.QtWidgets import QWidget

from dsl_app.results.cloud.views import CloudView, make_cloud_view, normalised, prepare_cloud_view
from dsl_app.results.controller import ResultsController
from dsl_app.results.layers import Layers, rgb_of, within
from dsl_app.results.state import ResultsState, ResultView, Tool
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import label, push_button
from dsl_app.shared.widgets.layouts import column_of, row_of
from dsl_core.evaluation.marks import inside_outline, nearest_on_screen, on_screen
from dsl_core.io.result.result_arrays import ResultArrays

#: Number of points searched for the one under the moving mouse; a click searches all.
HOVER_POINTS = 60_000
#: Delay between the steps that fill a view, ms.
STEP_MS = 20


class CloudPanel(QWidget):
    """Follows a state while it is visible; the view is made when it is first shown."""

    def __init__(self, state: ResultsState, control: ResultsController, runner: JobRunner) -> None:
        super().__init__()
        self._state, self._control, self._runner, self._theme = state, control, runner, DARK
        self._is_preparing = False
        self.view: CloudView | None = None
        self._layers: Layers | None = None
        self._points = np.empty((0, 3), np.float32)
        self._flat = np.empty(0, np.intp)
        #: Whether the points are of another result than those on screen.
        self._is_new = True
        self._projected: NDArray[np.float64] | None = None
        self._lasso: list[tuple[float, float]] = []
        self._press: tuple[float, float] | None = None
        self._hint = label("", "muted")
        self._reset = push_button("Reset view", "Look from the position of the camera")
        self._reset.clicked.connect(lambda: None if self.view is None else self.view.reset())
        row = row_of((self._hint, 1), self._reset)
        self._box = column_of(row, on=self, margins=0)
        state.result.changed.connect(lambda _: self._new_result())
        for value in (state.cloud_by, state.band, state.quality, state.picture, state.search):
            value.changed.connect(lambda _: self._later.start())
        state.depth_limits.changed.connect(lambda _: self._limit_points())
        state.cursor.changed.connect(self._show_cursor)
        state.marks.changed.connect(lambda _: self._show_pins())
        state.tool.follow(lambda _: self._show_hint())
        # Colours follow a dragged slider once it rests for a moment.
        self._later = QTimer(self)
        self._later.setSingleShot(True)
        self._later.setInterval(60)
        self._later.timeout.connect(self._paint)

    # Make and fill ---------------------------------------------------------------------------------

    def showEvent(self, event: QShowEvent) -> None:
        """Make the view, or update it."""
        super().showEvent(event)
        if self.view is None and not self._is_preparing:
            self._prepare()
        self._new_result()

    def _prepare(self) -> None:
        self._is_preparing = True
        self._hint.setText("Preparing the 3D view…")
        self._runner.submit(
            Job(
                "Prepare the 3D view",
                lambda progress: prepare_cloud_view(),
                self._make,
                lambda error: self._give_up(f"The 3D view could not be prepared: {error}"),
                lambda: self._give_up("The 3D view was cancelled. Switch views to try again."),
                is_minor=True,
            )
        )

    def _give_up(self, sentence: str) -> None:
        self._is_preparing = False
        self._hint.setText(sentence)

    def _make(self, can_draw: bool) -> None:
        self.view = view = make_cloud_view(can_draw, self._view_moved, self._mouse)
        view.set_background(self._theme.base)
        self._box.insertWidget(0, view, 1)
        # The widget gets its size, and with it the camera, in the event loop.
        QTimer.singleShot(STEP_MS, self, self._new_result)

    def _new_result(self) -> None:
        result = self._state.result.value
        if self._layers is not None and self._layers.result is not result:
            # Even while hidden: a closed result must not stay in memory.
            self._layers, self._points = None, np.empty((0, 3), np.float32)
        if self.view is None or not self.isVisible():
            return
        if result is None or "points_mm" not in result.arrays:
            self._hint.setText("This result has no points.")
            return
        if self._layers is None:
            self._layers = Layers(result)
            self._is_new = True
            self._choose_points(result)
        self._show_hint()
        QTimer.singleShot(STEP_MS, self, self._show_result)

    def _limit_points(self) -> None:
        if self._layers is not None:
            self._choose_points(self._layers.result)
            self._later.start()

    def _choose_points(self, result: ResultArrays) -> None:
        """Choose the points within the limits; the others can neither be seen nor pointed at."""
        points = result["points_mm"]
        self._flat = np.flatnonzero(within(points[2], self._state.depth_limits.value))
        self._points = np.ascontiguousarray(points.reshape(3, -1)[:, self._flat].T)

    def _show_result(self) -> None:
        self._paint()
        self._show_pins()
        self._show_cursor(self._state.cursor.value)

    def _paint(self) -> None:
        if self.view is None or self._layers is None or not self.isVisible():
            return
        layer = self._layers.layer(self._state)
        if layer is None:
            return
        colours = rgb_of(layer).reshape(-1, 3)[self._flat]
        search = self._state.search.value
        if search is not None:
            colours = colours.copy()
            colours[search.found.ravel()[self._flat]] = tuple(bytes.fromhex(self._theme.accent[1:]))
        self.view.show_cloud(self._points, colours, self._is_new)
        self._is_new = False
        self._projected = None

    def _show_cursor(self, pixel: Pixel | None) -> None:
        result = self._state.result.value
        if self.view is None or result is None or not self.isVisible() or self._layers is None:
            return
        point = None if pixel is None or not result.holds(pixel) else result.at("points_mm", pixel)
        known = point is not None and bool(np.isfinite(point).all())
        self.view.show_marker(point if known else None, self._theme.accent)

    def _show_pins(self) -> None:
        result = self._state.result.value
        if self.view is None or result is None or not self.isVisible() or self._layers is None:
            return
        spots, colours = [], []
        for mark in self._state.marks.value:
            if mark.shown and mark.pixel is not None and not mark.trouble:
                spots.append(result.at("points_mm", mark.pixel))
                colour = self._theme.pins[mark.colour % len(self._theme.pins)]
                colours.append(tuple(bytes.fromhex(colour[1:])))
        points = np.array(spots, np.float32).reshape(-1, 3)
        known = np.isfinite(points).all(1)
        self.view.show_pins(points[known], np.array(colours, np.uint8).reshape(-1, 3)[known])

    def _show_hint(self) -> None:
        lasso = self._state.tool.value is Tool.LASSO
        self._hint.setText(
            "Draw around points with the left button."
            if lasso
            else "Drag or arrow keys rotate, Shift+drag pans, wheel or +/− zooms."
        )

    # Mouse -----------------------------------------------------------------------------------------

    def _view_moved(self) -> None:
        self._projected = None

    def _mouse(self, event: QMouseEvent) -> bool:
        """Point, pin or draw; True if the event must not rotate the view."""
        assert self.view is not None
        at = normalised(event.position(), self.view)
        lasso = self._state.tool.value is Tool.LASSO
        match event.type():
            case QEvent.Type.MouseButtonPress if event.button() == Qt.MouseButton.LeftButton:
                self._press = at
                self._lasso = [at] if lasso else []
                return lasso
            case QEvent.Type.MouseMove if self._press is not None and lasso:
                self._lasso.append(at)
                return True
            case QEvent.Type.MouseMove if event.buttons() == Qt.MouseButton.NoButton:
                self._point(at, HOVER_POINTS)
            case QEvent.Type.MouseMove:
                self._projected = None
            case QEvent.Type.MouseButtonRelease if event.button() == Qt.MouseButton.LeftButton:
                return self._released(at, lasso)
        return False

    def _released(self, at: tuple[float, float], lasso: bool) -> bool:
        press, self._press = self._press, None
        if lasso:
            self._end_lasso()
            return True
        if press is not None and np.hypot(at[0] - press[0], at[1] - press[1]) < 0.01:
            pixel = self._point(at, len(self._points))
            if pixel is not None:
                self._control.marks.pin(pixel)
        return False

    def _point(self, at: tuple[float, float], most: int) -> Pixel | None:
        """Put the cursor on the point under the mouse, searching at most ``most`` points."""
        assert self.view is not None
        if len(self._points) == 0:
            return None
        step = max(len(self._points) // most, 1)
        if step == 1 or self._projected is None:
            seen = on_screen(self._points[::step], self.view.projection())
            self._projected = seen if step > 1 else None
        else:
            seen = self._projected
        size = self.view.width(), self.view.height()
        found = nearest_on_screen(seen, at, size, 6.0 * step**0.5)
        if found is None:
            return None
        pixel = self._pixel(found * step)
        self._control.point_at(pixel)
        return pixel

    def _pixel(self, index: int) -> Pixel:
        result = self._state.result.value
        assert result is not None
        y, x = divmod(int(self._flat[index]), result.shape[1])
        return x, y

    def _end_lasso(self) -> None:
        outline, self._lasso = self._lasso, []
        result = self._state.result.value
        if self.view is None or result is None or len(outline) < 3:
            return
        seen = on_screen(self._points, self.view.projection())
        inside = inside_outline(seen[:, 0], seen[:, 1], outline)
        mask = np.zeros(result.shape, bool)
        mask.ravel()[self._flat[inside]] = True
        if mask.any():
            self._control.marks.add_pixels(mask)

    # Theme and end ---------------------------------------------------------------------------------

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        if self.view is not None:
            self.view.set_background(theme.base)
        if self._state.view.value is ResultView.CLOUD:
            self._show_pins()

    def release(self) -> None:
        """Release the graphics."""
        if self.view is not None:
            self.view.release()
            self.view = None
