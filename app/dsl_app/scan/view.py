"""The last frame of a scan, and the intensity graph of a pixel as it builds up."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QSplitter, QWidget

from dsl_app.scan.controller import ScanController
from dsl_app.scan.state import LivePicture, ScanState
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.hints import FocusRing
from dsl_app.shared.widgets.layouts import column_of
from dsl_app.shared.widgets.pictures import DEPTH, PictureView, arrow_step, colour_map
from dsl_app.shared.widgets.plots import MONO_COLOUR, CalmPlot
from dsl_core.capture.preview import BlockGraph
from dsl_core.model.figure import decimals
from dsl_core.model.plan import CapturePlan, Shot, spoken_number
from dsl_core.optics.levels import between, spread_of

#: Red, green and blue of the camera: they are data and the same in every theme.
CHANNEL_COLOURS = ("#d94545", "#3fa34d", "#3f7fd9")
NO_PIXEL = "Intensity graph: point at a pixel of the picture"
HINT = "No frame yet. Start a scan, then point at the picture to plot the intensity of a pixel."
#: Columns of the published projector: the range of the empty axis.
PUBLISHED_COLUMNS = 640
_ROLES = {"code": "code", "spectral": "pattern", "white": "white", "black": "black", "sentinel": "repeat"}


class FramePicture(QWidget):
    """The last frame; emits ``pointed`` with a camera pixel under the mouse or moved to by arrow keys."""

    pointed = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self._shown: LivePicture | None = None
        self._cursor: tuple[int, int] | None = None
        tip = "The last frame. Point at a pixel, or use arrow keys, to plot its intensity."
        self.view = PictureView("Last frame of the scan", tip)
        # The keyboard comes to this widget, so that it is this one's name that is read.
        self.setAccessibleName("Last frame of the scan")
        self.setAccessibleDescription(tip)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.view.setFocusProxy(self)
        FocusRing(self, self.view)
        self.box = self.view.box
        self.box.setMouseEnabled(False, False)
        self._mark = pg.TargetItem(size=13, movable=False, pen=pg.mkPen("#ffffff", width=2))
        self.box.addItem(self._mark, ignoreBounds=True)
        self._mark.hide()
        self._text = label(HINT, "muted", wraps=True)
        column_of((self.view, 1), self._text, on=self, margins=0, spacing=4)
        self._mouse = pg.SignalProxy(self.view.scene().sigMouseMoved, rateLimit=30, slot=self._hover)

    def show_picture(self, shown: LivePicture | None) -> None:
        """Show a frame."""
        before, self._shown = self._shown, shown
        if shown is None:
            self.view.image.clear()
            self._text.setText(HINT)
            return
        self.view.image.setImage(shown.picture, autoLevels=False, levels=None)
        self.view.image.setRect(0, 0, *covered_px(shown))
        place = f"Frame {shown.shot.number} of {shown.plan.shot_count}"
        self._text.setText(f"{place}: {words_of(shown.shot, shown.plan)}")
        if before is None or covered_px(before) != covered_px(shown):
            self.view.fit()

    def show_depth(self, depth_mm: NDArray[np.float32]) -> None:
        """Show the depth of a reconstruction, mm (rows, columns), whose spectra are being computed."""
        low, high = spread_of(depth_mm)
        table = np.asarray(colour_map(DEPTH).getLookupTable(nPts=256, alpha=False), np.uint8)
        known = np.isfinite(depth_mm)
        picture = table[(255 * between(np.where(known, depth_mm, low), (low, high))).astype(np.uint8)]
        picture[~known] = 0
        self.view.image.setImage(picture, autoLevels=False, levels=None)
        self.view.image.setRect(0, 0, *depth_mm.shape[::-1])
        self.view.fit()
        digits = decimals(high - low)
        self._text.setText(
            f"Depth, {low:.{digits}f} mm (dark) to {high:.{digits}f} mm (bright). Spectra are being computed."
        )

    def show_cursor(self, pixel: tuple[int, int] | None) -> None:
        """Mark a pixel of the camera."""
        self._cursor = pixel
        self._mark.setVisible(pixel is not None)
        if pixel is not None:
            self._mark.setPos(*pixel)

    def _hover(self, event: tuple[Any]) -> None:
        if self._shown is not None:
            at = self.box.mapSceneToView(event[0])
            self._point(int(at.x()), int(at.y()))

    def _point(self, x: int, y: int) -> None:
        assert self._shown is not None
        width, height = covered_px(self._shown)
        if 0 <= x < width and 0 <= y < height:
            self.pointed.emit((x, y))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Arrow keys move the pixel, with Shift by ten times as much."""
        step = arrow_step(event)
        if step is None or self._shown is None:
            super().keyPressEvent(event)
            return
        width, height = covered_px(self._shown)
        cell = self._shown.cell_px
        x, y = self._cursor or (width // 2, height // 2)
        # The pixel may be one of an earlier scan with a larger picture.
        x, y = min(x, width - 1), min(y, height - 1)
        self._point(x + 2 * cell * step[0], y + 2 * cell * step[1])


class ScanView(QSplitter):
    """The last frame above the graph of a pixel; follows a `ScanState`."""

    def __init__(self, state: ScanState, controller: ScanController) -> None:
        super().__init__(Qt.Orientation.Vertical)
        self.picture, self.graph = FramePicture(), GraphPlot()
        set_help(self.picture, "scanning#while-it-runs")
        set_help(self.graph, "reading-an-intensity-graph")
        self.setChildrenCollapsible(False)
        for widget, stretch in ((self.picture, 5), (self.graph, 4)):
            widget.setMinimumHeight(120)
            self.addWidget(widget)
            self.setStretchFactor(self.count() - 1, stretch)
        self.picture.pointed.connect(controller.point_at)
        self.stops = [
            state.picture.follow(self.picture.show_picture),
            state.depth.follow(lambda depth: self._show_depth(state, depth)),
            state.cursor.follow(self.picture.show_cursor),
            state.graph.follow(self.graph.show_graph),
        ]

    def _show_depth(self, state: ScanState, depth_mm: NDArray[np.float32] | None) -> None:
        """Show the depth, and afterwards the last frame again."""
        if depth_mm is not None:
            self.picture.show_depth(depth_mm)
        else:
            self.picture.show_picture(state.picture.value)


class GraphPlot(QWidget):
    """R, G and B of a pixel, or its brightness, over the projector's columns; earlier settings are dotted."""

    def __init__(self) -> None:
        super().__init__()
        self.plot = CalmPlot(
            "Intensity graph",
            "Raw counts of the pixel while the lines move across the projector: the high peak is the zero"
            " order, the first orders are on either side.",
            "Raw counts (DN)", "First column of the line (px)",
        )  # fmt: skip
        self._title = label(NO_PIXEL, "heading", wraps=True)
        self._curves: list[Any] = []
        self.plot.setXRange(0, PUBLISHED_COLUMNS, padding=0.02)
        self.plot.setYRange(0, 1000, padding=0.02)
        column_of(self._title, (self.plot, 1), on=self, margins=0, spacing=4)

    def show_graph(self, graph: BlockGraph | None) -> None:
        """Draw a graph, as far as captured."""
        if graph is None:
            self._title.setText(NO_PIXEL)
            for curve in self._curves:
                curve.setData([], [])
            return
        x, y = graph.pixel
        self._title.setText(f"Intensity graph at {x}, {y} px, mean of {graph.block_px} × {graph.block_px}")
        settings = len(graph.mean_dn)
        self._make_curves(settings)
        begun = [i for i in range(settings) if np.isfinite(graph.mean_dn[i]).any()]
        colours = CHANNEL_COLOURS if graph.mean_dn.shape[2] == 3 else (MONO_COLOUR,)
        for curve in self._curves:
            curve.setVisible(False)
        for i in range(settings):
            for channel, colour in enumerate(colours):
                curve = self._curves[3 * i + channel]
                curve.setVisible(i in begun)
                # The setting being captured is drawn solid.
                old = bool(begun) and i != begun[-1]
                style = Qt.PenStyle.DotLine if old else Qt.PenStyle.SolidLine
                curve.setPen(pg.mkPen(colour, width=1, style=style))
                curve.setData(graph.position_px, graph.mean_dn[i, :, channel], connect="finite")
        self.plot.enableAutoRange(axis="y")
        if len(graph.position_px):
            self.plot.setXRange(0, graph.position_px[-1] or 1, padding=0.02)

    def _make_curves(self, settings: int) -> None:
        while len(self._curves) < 3 * settings:
            self._curves.append(self.plot.plot([], []))


def covered_px(shown: LivePicture) -> tuple[int, int]:
    """Width and height of the area shown, camera pixels."""
    height, width = shown.picture.shape[:2]
    return width * shown.cell_px, height * shown.cell_px


def words_of(shot: Shot, plan: CapturePlan) -> str:
    """Pattern and exposure of a shot, in words."""
    counts = {"code": plan.code_count, "spectral": plan.spectral_count}
    which = f" {spoken_number(shot.pattern)} of {counts[shot.role]}" if shot.role in counts else ""
    setting = f"setting {spoken_number(shot.setting)} of {len(plan.settings)}"
    return f"{_ROLES[shot.role]}{which}, {setting} ({shot.exposure_ms:.1f} ms at level {shot.level:g})"
