"""The picture of a result: the first four views, the cursor, marks, and outlines drawn with the mouse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QLabel, QWidget

from dsl_app.results.controller import ResultsController
from dsl_app.results.layers import NO_COLOUR, Layer, Layers, materials_table
from dsl_app.results.outline_box import OutlineBox
from dsl_app.results.state import Mark, ResultsState, ResultView, Tool
from dsl_app.shared.evented import follow_any
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.forms import named
from dsl_app.shared.widgets.layouts import column_of
from dsl_app.shared.widgets.pictures import NoValues, PictureView, arrow_step, colour_map
from dsl_app.shared.widgets.plots import theme_bar
from dsl_core.io.result.result_arrays import ResultArrays

#: Mouse moves are handled at most this often, Hz.
CURSOR_HZ = 60
# pyqtgraph's own limit drops the last move, so the cursor would stop short of where the mouse rests.
pg.setConfigOption("mouseRateLimit", -1)


class _Canvas(PictureView):
    """The graphics view, which passes keys on to the picture."""

    key = Signal(QKeyEvent)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Offer the key to the picture first."""
        event.ignore()
        self.key.emit(event)
        if not event.isAccepted():
            super().keyPressEvent(event)


class ResultImage(QWidget):
    """Paints the result of a state, and asks its controller for what mouse and keys do."""

    def __init__(self, state: ResultsState, control: ResultsController) -> None:
        super().__init__()
        self._state, self._control = state, control
        self._layers: Layers | None = None
        self._theme = DARK
        self._mark_items: list[Any] = []
        self._bar: tuple[Any, ...] = ()
        self.box = OutlineBox()
        self.canvas = _Canvas(
            "Picture of the result",
            "Click or press Enter to pin a spectrum; drag to pan, wheel to zoom; arrow keys move the cursor",
            self.box,
        )
        self.no_values = NoValues(self.box)
        self.image, self.overlay = self.canvas.image, pg.ImageItem(axisOrder="row-major")
        self.overlay.setZValue(5)
        self.materials = pg.ImageItem(axisOrder="row-major")
        self.materials.setZValue(4)
        self._vertical, self._horizontal = (pg.InfiniteLine(angle=angle, movable=False) for angle in (90, 0))
        self.pins = pg.ScatterPlotItem(size=11, pxMode=True, pen=pg.mkPen("#000000", width=1))
        for item in (self.overlay, self.materials, self._vertical, self._horizontal, self.pins):
            self.box.addItem(item, ignoreBounds=True)
        for line in (self._vertical, self._horizontal):
            line.setZValue(20)
            line.hide()
        self.pins.setZValue(30)
        self.bar = pg.ColorBarItem(interactive=False, width=14, colorMap=colour_map("viridis"))
        self.canvas.addItem(self.bar, 0, 1)
        self.legend = named(QLabel(), "Legend")
        self.legend.setWordWrap(True)
        self.legend.setTextFormat(Qt.TextFormat.RichText)
        column_of((self.canvas, 1), self.legend, on=self, margins=0, spacing=4)
        self._mouse = pg.SignalProxy(
            self.canvas.scene().sigMouseMoved, rateLimit=CURSOR_HZ, slot=self._mouse_moved
        )
        self.box.clicked.connect(self._clicked)
        self.box.drawn.connect(control.marks.add_outline)
        self.canvas.key.connect(self._key)
        self._follow()

    def _follow(self) -> None:
        state = self._state
        state.result.follow(self._new_result)
        painted = (state.view, state.cloud_by, state.band, state.quality, state.picture, state.depth_limits)
        follow_any(self.paint, *painted, state.bands, state.levels)
        state.cursor.follow(self._show_cursor)
        state.marks.follow(self._show_marks)
        state.search.follow(lambda _: self._show_search())
        follow_any(self._show_materials, state.materials, state.view)
        state.tool.follow(self._take_tool)

    # Mouse and keys --------------------------------------------------------------------------------

    def _pixel(self, x: float, y: float) -> Pixel | None:
        pixel = (round(x), round(y))
        result = self._state.result.value
        return pixel if result is not None and result.holds(pixel) else None

    def _mouse_moved(self, event: tuple[Any]) -> None:
        if self.box.sceneBoundingRect().contains(event[0]):
            at = self.box.mapSceneToView(event[0])
            pixel = self._pixel(at.x(), at.y())
            if pixel is not None:
                self._control.point_at(pixel)

    def _clicked(self, x: float, y: float) -> None:
        pixel = self._pixel(x, y)
        if pixel is not None:
            self._control.point_at(pixel)
            self._control.marks.pin(pixel)

    def _take_tool(self, tool: Tool) -> None:
        self.box.set_tool("" if tool is Tool.PIN else tool.value)
        self.canvas.setCursor(Qt.CursorShape.ArrowCursor if tool is Tool.PIN else Qt.CursorShape.CrossCursor)

    def _key(self, event: QKeyEvent) -> None:
        key = Qt.Key(event.key())
        step = arrow_step(event)
        if step is not None:
            self._control.move_cursor(*step)
        elif key in (Qt.Key.Key_Return, Qt.Key.Key_Enter, Qt.Key.Key_P):
            if self.box.is_drawing:
                self.box.close_outline()
            elif self._state.cursor.value is not None:
                self._control.marks.pin(self._state.cursor.value)
        elif key == Qt.Key.Key_Escape and self.box.is_drawing:
            self.box.cancel_outline()
        elif key == Qt.Key.Key_Delete:
            self._control.marks.remove(self._state.selected.value)
        elif key == Qt.Key.Key_F:
            self.fit()
        else:
            return
        event.accept()

    # Paint -----------------------------------------------------------------------------------------

    def _new_result(self, result: ResultArrays | None) -> None:
        before = None if self._layers is None else self._layers.result.picture
        self._layers = None if result is None else Layers(result)
        self.paint()
        if result is None or result.picture != before:
            # The corners drawn so far are of another picture.
            self.box.cancel_outline()
            self.fit()

    def fit(self) -> None:
        """Show the whole image; also where its view has nothing to show."""
        result = self._state.result.value
        if self.image.image is None and result is not None:
            height, width = result.shape
            self.box.setRange(xRange=(-0.5, width - 0.5), yRange=(-0.5, height - 0.5), padding=0.01)
        else:
            self.canvas.fit()

    def paint(self) -> None:
        """Paint the view of the state."""
        layer = None if self._layers is None else self._layers.layer(self._state)
        if layer is None:
            self.image.clear()
            self.no_values.hide()
            self.bar.hide()
            lacks = "" if self._layers is None else self._layers.lacks(self._state.quality.value)
            self.legend.setText(lacks)
            self.legend.setVisible(bool(lacks))
            return
        levels = layer.levels if layer.levels is not None else (0, 255)
        table = layer.table
        if layer.colours:
            table = colour_map(layer.colours).getLookupTable(nPts=256)
        self.image.setImage(layer.image, levels=levels, lut=table, autoLevels=False)
        # Pixels have their centres at whole numbers.
        height, width = layer.image.shape[:2]
        self.image.setRect(-0.5, -0.5, width, height)
        if layer.table is None:
            self.no_values.lie_under(layer.image.shape)
        else:
            # A class is painted where there is nothing to tell, too.
            self.no_values.hide()
        self._show_bar(layer)

    def _show_bar(self, layer: Layer) -> None:
        self.bar.setVisible(bool(layer.colours))
        bar = (layer.colours, layer.levels, layer.label)
        # Its axis takes as long to paint as the picture: it is left alone while a band slider is dragged.
        if layer.colours and bar != self._bar:
            self._bar = bar
            self.bar.setColorMap(colour_map(layer.colours))
            self.bar.setLevels(layer.levels)
            self.bar.setLabel("left", layer.label)
        self.legend.setVisible(bool(layer.keys))
        if layer.keys:
            self.legend.setText(
                " &nbsp; ".join(
                    f"{_swatch(colour, self._theme.muted)}&nbsp;{name.replace(' ', '&nbsp;')}&nbsp;"
                    f'<span style="color:{self._theme.muted}">{100 * share:.1f}&nbsp;%</span>'
                    for colour, name, share in layer.keys
                )
            )

    def _show_cursor(self, pixel: Pixel | None) -> None:
        for line, value in ((self._vertical, 0), (self._horizontal, 1)):
            line.setVisible(pixel is not None)
            if pixel is not None:
                line.setPos(pixel[value])

    def _show_marks(self, marks: tuple[Mark, ...]) -> None:
        for item in self._mark_items:
            self.box.removeItem(item)
        self._mark_items = []
        seen = [mark for mark in marks if mark.shown and not mark.trouble]
        for mark in seen:
            if mark.kind == "region":
                self._mark_items.append(self._region_item(mark, self._theme.pin(mark.colour)))
        pins = [(mark.pixel, self._theme.pin(mark.colour)) for mark in seen if mark.pixel is not None]
        places = np.array([pixel for pixel, _ in pins]).reshape(-1, 2)
        self.pins.setData(pos=places, brush=[pg.mkBrush(colour) for _, colour in pins])
        for item in self._mark_items:
            self.box.addItem(item, ignoreBounds=True)

    def _region_item(self, mark: Mark, colour: str) -> Any:
        if mark.outline_px:
            x, y = zip(*mark.outline_px, mark.outline_px[0], strict=True)
            item = pg.PlotCurveItem(list(x), list(y), pen=pg.mkPen(colour, width=2))
            item.setZValue(10)
            return item
        result = self._state.result.value
        assert result is not None
        from dsl_core.evaluation.marks import mask_of_runs

        return tinted(mask_of_runs(mark.runs, result.shape), colour, 110, 8)

    def _show_search(self) -> None:
        search = self._state.search.value
        self.overlay.setVisible(search is not None)
        if search is not None:
            self.overlay.setImage(rgba_of(search.found, self._theme.accent, 190), autoLevels=False)
            height, width = search.likeness.delta_e.shape
            self.overlay.setRect(-0.5, -0.5, width, height)

    def _show_materials(self) -> None:
        """Lay the map over colours; over a band, depth or reasons it would hide what was asked for."""
        materials = self._state.materials.value
        is_over = self._state.view.value in (ResultView.COLOUR, ResultView.CLOUD)
        self.materials.setVisible(materials is not None and is_over)
        if materials is not None:
            shown = materials.found.shown
            table = materials_table(shown, self._theme.ground)
            self.materials.setImage(shown.values, levels=(0, 255), lut=table, autoLevels=False)
            height, width = shown.values.shape
            self.materials.setRect(-0.5, -0.5, width, height)

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.canvas.apply_theme(theme)
        self.no_values.apply_theme(theme)
        self.box.set_colour(theme.accent)
        for line in (self._vertical, self._horizontal):
            line.setPen(pg.mkPen(theme.accent, width=1))
        theme_bar(self.bar, theme)
        self._show_marks(self._state.marks.value)
        self._show_search()
        self._show_materials()
        self.paint()


def rgba_of(mask: np.ndarray[Any, np.dtype[np.bool_]], colour: str, alpha: int) -> Any:
    """A mask (rows, columns) as RGBA bytes in a colour."""
    rgba = np.zeros((*mask.shape, 4), np.uint8)
    rgba[mask] = (*bytes.fromhex(colour[1:]), alpha)
    return rgba


def tinted(mask: np.ndarray[Any, np.dtype[np.bool_]], colour: str, alpha: int, z: float) -> Any:
    """An image item that tints the pixels of a mask."""
    item = pg.ImageItem(rgba_of(mask, colour, alpha), axisOrder="row-major")
    item.setRect(-0.5, -0.5, mask.shape[1], mask.shape[0])
    item.setZValue(z)
    return item


def _swatch(colour: str, muted: str) -> str:
    """A square of a colour of the picture; hatched where that has none, an outline where it is faint."""
    if colour == NO_COLOUR:
        square, ink = "▨", muted
    else:
        square, ink = ("■", colour) if colour.startswith("#") else ("□", muted)
    return f'<span style="color:{ink}">{square}</span>'
