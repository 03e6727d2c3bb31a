"""The 3D view of a result, with cursor, pins, a lasso and measurements."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, Qt, QTimer
from PySide6.QtGui import QMouseEvent, QShowEvent
from PySide6.QtWidgets import QWidget

from dsl_app.results.cloud.look import Grid
from dsl_app.results.cloud.measuring import Measure, Measured, measure_plane, measure_points
from dsl_app.results.cloud.overlay import Overlay
from dsl_app.results.cloud.picking import HOVER_POINTS, Picking
from dsl_app.results.cloud.tools import CloudTools
from dsl_app.results.cloud.views import (
    BROKEN,
    CloudView,
    InteractiveCloud,
    StaticCloud,
    make_cloud_view,
    normalised,
    prepare_cloud_view,
)
from dsl_app.results.controller import ResultsController
from dsl_app.results.layers import NOTHING, Layers, materials_table, rgb_of, tinted_by
from dsl_app.results.state import ResultsState, ResultView, Tool, within
from dsl_app.shared.jobs.base import Job, JobRunner
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.layouts import column_of
from dsl_core.io.result.result_arrays import ResultArrays
from dsl_core.model.result import Flag

if TYPE_CHECKING:
    from dsl_app.results.cloud.section_plot import SectionPlot

#: Height that the curve of a section leaves to the view in a low window, px.
LEAST_VIEW_PX = 80
#: Delay between the steps that fill a view, ms.
STEP_MS = 20
UNPREPARED = (
    "The 3D view could not be prepared: {}\n\nInstall or update the graphics driver, then switch views to try"
    " again. Export… writes the points as PLY for another program."
)
HINT = "Drag or arrow keys rotate, Shift+drag pans, wheel or +/− zooms."


class CloudPanel(QWidget):
    """Follows a state while it is visible; the view is made when it is first shown."""

    def __init__(self, state: ResultsState, control: ResultsController, runner: JobRunner) -> None:
        super().__init__()
        self._state, self._control, self._runner, self._theme = state, control, runner, DARK
        self._is_preparing = False
        self.view: CloudView | None = None
        self._layers: Layers | None = None
        self._picking, self._grid = Picking(), Grid((0, 0), np.empty(0, np.intp))
        #: The picture (`ResultArrays.picture`) whose points are on screen.
        self._shown: object = None
        self._lasso: list[tuple[float, float]] = []
        self._press: tuple[float, float] | None = None
        self._measure, self._picked = Measure.NOTHING, list[Pixel]()
        self._measured: Measured | None = None
        self._hint = label("", "muted", wraps=True, can_be_copied=True)
        # Always the height of two lines: a shorter answer does not move the tools above it.
        self._hint.setMinimumHeight(2 * self._hint.fontMetrics().lineSpacing())
        self._hint.setAlignment(Qt.AlignmentFlag.AlignTop)
        self.tools = CloudTools()
        self.section: SectionPlot | None = None
        #: In the place of the view until it is there: what is done, or why there is none.
        self.message = label("", "muted", wraps=True, can_be_copied=True)
        self.message.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.message.setMargin(20)
        self._box = column_of((self.message, 1), self.tools, self._hint, on=self, margins=0, spacing=4)
        self._connect()
        # Colours follow a dragged slider once it rests for a moment.
        self._later = QTimer(self)
        self._later.setSingleShot(True)
        self._later.setInterval(60)
        self._later.timeout.connect(self._paint)

    def _connect(self) -> None:
        state, tools = self._state, self.tools
        state.result.changed.connect(lambda _: self._new_result())
        for value in (
            state.cloud_by,
            state.band,
            state.quality,
            state.picture,
            state.bands,
            state.levels,
            state.search,
            state.materials,
        ):
            value.changed.connect(lambda _: self._later.start())
        state.depth_limits.changed.connect(lambda _: self._limit_points())
        state.cursor.changed.connect(self._show_cursor)
        state.marks.changed.connect(lambda _: self._show_pins())
        state.tool.follow(self._take_tool)
        tools.look_chosen.connect(lambda look: None if self.view is None else self.view.take_look(look))
        tools.side_chosen.connect(lambda side: None if self.view is None else self.view.see_from(side))
        tools.share_chosen.connect(self._show_share)
        tools.measure_chosen.connect(self._start_measuring)

    # Make and fill ---------------------------------------------------------------------------------

    def showEvent(self, event: QShowEvent) -> None:
        """Make the view, or update it."""
        super().showEvent(event)
        if self.view is None and not self._is_preparing:
            self._prepare()
        self._new_result()

    def _prepare(self) -> None:
        self._is_preparing = True
        self.message.setText("Preparing the 3D view…")
        self._runner.submit(
            Job(
                "Prepare the 3D view",
                lambda progress: prepare_cloud_view(),
                self._make,
                lambda error: self._give_up(UNPREPARED.format(error)),
                lambda: self._give_up("The 3D view was cancelled. Switch views to try again."),
                is_minor=True,
            )
        )

    def _give_up(self, sentence: str) -> None:
        self._is_preparing = False
        self.message.setText(sentence)

    def _make(self, can_draw: bool) -> None:
        view = make_cloud_view(can_draw, self._picking.view_moved, self._mouse)
        if isinstance(view, InteractiveCloud):
            view.failed.connect(self._fall_back)
        self._place(view, can_draw)

    def _fall_back(self, reason: str) -> None:
        """Show a fixed picture where 3D began and then failed; what is wrong and what to do is said there."""
        broken = self.view
        if broken is None:
            return
        self._shown = None
        self._place(StaticCloud(BROKEN.format(reason.rstrip("."))), False)
        broken.release()
        broken.deleteLater()

    def _place(self, view: CloudView, can_draw: bool) -> None:
        if self.view is not None:
            self._box.removeWidget(self.view)
            self.view.hide()
        self.view = view
        view.apply_theme(self._theme)
        self.tools.setEnabled(can_draw)
        self._show_measured(self._measured)
        self.message.hide()
        view.setMinimumHeight(LEAST_VIEW_PX)
        self._box.insertWidget(0, view, 1)
        # The widget gets its size, and with it the camera, in the event loop.
        QTimer.singleShot(STEP_MS, self, self._new_result)

    def _new_result(self) -> None:
        result = self._state.result.value
        if self._layers is not None and self._layers.result is not result:
            # Even while hidden: a closed result must not stay in memory.
            self._layers, self._grid = None, Grid((0, 0), np.empty(0, np.intp))
            self._picking.take(np.empty((0, 3), np.float32), self._grid.flat, 1)
            self._begin_again()
        if self.view is None or result is None or not self.isVisible():
            return
        if self._layers is None:
            self._layers = Layers(result)
            self._choose_points(result)
        self._show_hint()
        QTimer.singleShot(STEP_MS, self, self._show_result)

    def _limit_points(self) -> None:
        if self._layers is not None:
            self._choose_points(self._layers.result)
            self._later.start()

    def _show_share(self, percent: int) -> None:
        """Hide the nearest and farthest points, but for the middle ``percent``."""
        result = self._state.result.value
        if result is None:
            return
        depth = result["depth_mm"]
        rest = (100 - percent) / 2
        known = depth[np.isfinite(depth)]
        if percent == 100 or known.size == 0:
            self._control.limit_depth(None)
        else:
            low, high = np.percentile(known, (rest, 100 - rest))
            self._control.limit_depth((float(low), float(high)))

    def _choose_points(self, result: ResultArrays) -> None:
        """Choose the points within the limits; the others can neither be seen nor pointed at."""
        points, std, normals = result["points_mm"], result.known("depth_std_mm"), result.known("normals")
        flat = np.flatnonzero(within(points[2], self._state.depth_limits.value))
        self._picking.take(np.ascontiguousarray(points.reshape(3, -1)[:, flat].T), flat, result.shape[1])
        edge = (result["flags"] & int(Flag.DEPTH_EDGE)) != 0
        self._grid = Grid(result.shape, flat, std, edge, normals)

    def _show_result(self) -> None:
        self._paint()
        self._show_pins()
        self._show_cursor(self._state.cursor.value)

    def _paint(self) -> None:
        if self.view is None or self._layers is None or not self.isVisible():
            return
        layer = self._layers.layer(self._state)
        if layer is None:
            # The picture beside says why.
            colours = np.full(self._picking.points.shape, tuple(bytes.fromhex(NOTHING[1:])), np.uint8)
        else:
            colours = rgb_of(layer).reshape(-1, 3)[self._grid.flat]
        materials, search = self._state.materials.value, self._state.search.value
        if materials is not None:
            shown = materials.found.shown
            table = materials_table(shown, self._theme.ground)
            colours = tinted_by(colours, shown.values.ravel()[self._grid.flat], table)
        if search is not None:
            colours = colours.copy()
            colours[search.found.ravel()[self._grid.flat]] = tuple(bytes.fromhex(self._theme.accent[1:]))
        picture = self._layers.result.picture
        self.view.show_cloud(self._picking.points, colours, picture != self._shown, self._grid)
        self._shown = picture
        self._picking.view_moved()

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
                colour = self._theme.pin(mark.colour)
                colours.append(tuple(bytes.fromhex(colour[1:])))
        points = np.array(spots, np.float32).reshape(-1, 3)
        known = np.isfinite(points).all(1)
        self.view.show_pins(points[known], np.array(colours, np.uint8).reshape(-1, 3)[known])

    def _show_hint(self) -> None:
        if self._measured is not None:
            self._hint.setText(self._measured.text)
        elif self._measure is not Measure.NOTHING:
            self._hint.setText(self._measure.value)
        elif self._draws:
            self._hint.setText("Draw around points with the left button.")
        else:
            self._hint.setText("" if isinstance(self.view, StaticCloud) else HINT)

    # Measure ---------------------------------------------------------------------------------------

    def _start_measuring(self, kind: Measure) -> None:
        self._measure = kind
        self._begin_again()
        # What is chosen last, lasso or measure, has the left button.
        if kind is not Measure.NOTHING and self._state.tool.value is Tool.LASSO:
            self._state.tool.set(Tool.PIN)

    def _take_tool(self, tool: Tool) -> None:
        if tool is Tool.LASSO:
            self.tools.measure.choose(Measure.NOTHING)
            self._start_measuring(Measure.NOTHING)
        self._show_hint()

    def _begin_again(self) -> None:
        """Forget what is measured, and what a person is about to measure or to draw."""
        self._picked.clear()
        self._lasso, self._press = [], None
        self._show_measured(None)

    def _measure_pixel(self, pixel: Pixel) -> None:
        result = self._state.result.value
        assert result is not None
        self._picked.append(pixel)
        if len(self._picked) < 2:
            self._show_measured(None)
            self._show_overlay([np.asarray(result.at("points_mm", pixel), np.float64)])
            return
        first, last = self._picked
        self._picked.clear()
        self._show_measured(measure_points(result, self._measure, first, last))

    def _show_measured(self, found: Measured | None) -> None:
        cut = None if found is None else found.section
        if cut is not None:
            self._section_plot().show_section(cut)
        if self.section is not None:
            self.section.setVisible(cut is not None)
        self._measured = found
        self._show_hint()
        if self.view is not None:
            self.view.show_overlay(Overlay(line=None if found is None else found.ends))

    def _section_plot(self) -> SectionPlot:
        if self.section is None:
            # pyqtgraph takes a moment to import.
            from dsl_app.results.cloud.section_plot import SectionPlot

            self.section = SectionPlot()
            self.section.apply_theme(self._theme)
            self._box.insertWidget(self._box.indexOf(self.tools), self.section)
        return self.section

    def _show_overlay(self, points: list[NDArray[np.float64]]) -> None:
        if self.view is not None:
            self.view.show_overlay(Overlay(points, lasso=self._lasso))

    # Mouse -----------------------------------------------------------------------------------------

    @property
    def _draws(self) -> bool:
        """Whether the left button draws around points."""
        return self._measure is Measure.PLANE or self._state.tool.value is Tool.LASSO

    def _mouse(self, event: QMouseEvent) -> bool:
        """Point, pin, measure or draw; True if the event must not rotate the view."""
        assert self.view is not None
        at = normalised(event.position(), self.view)
        match event.type():
            case QEvent.Type.MouseButtonPress if event.button() == Qt.MouseButton.LeftButton:
                self._press = at
                self._lasso = [at] if self._draws else []
                return self._draws
            case QEvent.Type.MouseMove if self._press is not None and self._lasso:
                self._lasso.append(at)
                self._show_overlay([])
                return True
            case QEvent.Type.MouseMove if event.buttons() == Qt.MouseButton.NoButton:
                self._point(at, HOVER_POINTS)
            case QEvent.Type.MouseMove:
                self._picking.view_moved()
            case QEvent.Type.MouseButtonRelease if event.button() == Qt.MouseButton.LeftButton:
                return self._released(at)
        return False

    def _released(self, at: tuple[float, float]) -> bool:
        press, self._press = self._press, None
        if self._lasso:
            self._end_lasso()
            return True
        if press is not None and np.hypot(at[0] - press[0], at[1] - press[1]) < 0.01:
            pixel = self._point(at, None)
            if pixel is not None and self._measure is Measure.NOTHING:
                self._control.marks.pin(pixel)
            elif pixel is not None:
                self._measure_pixel(pixel)
        return False

    def _point(self, at: tuple[float, float], most: int | None) -> Pixel | None:
        """Put the cursor on the point under the mouse, searching at most ``most`` points."""
        assert self.view is not None
        size = self.view.width(), self.view.height()
        pixel = self._picking.pixel_at(at, self.view.projection(), size, most)
        if pixel is not None:
            self._control.point_at(pixel)
        return pixel

    def _end_lasso(self) -> None:
        outline, self._lasso = self._lasso, []
        self._show_overlay([])
        result = self._state.result.value
        if self.view is None or result is None:
            return
        size = self.view.width(), self.view.height()
        mask = self._picking.mask_inside(outline, self.view.projection(), size, result.shape)
        if self._measure is Measure.PLANE:
            self._show_measured(measure_plane(result, mask))
        elif mask.any():
            self._control.marks.add_pixels(mask)

    # Theme and end ---------------------------------------------------------------------------------

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        if self.section is not None:
            self.section.apply_theme(theme)
        if self.view is not None:
            self.view.apply_theme(theme)
        if self._state.view.value is ResultView.CLOUD:
            self._show_pins()
            self._later.start()

    def release(self) -> None:
        """Release the graphics."""
        if self.view is not None:
            self.view.release()
            self.view = None
