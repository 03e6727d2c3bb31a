"""A, B and their difference as three pictures with one cursor and one zoom, and what the pictures show."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QSlider, QWidget

from dsl_app.compare.pair.controller import PairController
from dsl_app.compare.pair.state import Pair, PairQuantity, PairState, cursor_text
from dsl_app.shared.evented import follow_any
from dsl_app.shared.spectrum import Pixel
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.deferred import call_deferred
from dsl_app.shared.widgets.forms import ChoiceBox, label, named, quiet
from dsl_app.shared.widgets.hints import FocusRing
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.pictures import (
    DEPTH,
    DIFFERENCE,
    GREY,
    Canvas,
    NoValues,
    arrow_step,
    colour_map,
    moved_within,
)
from dsl_app.shared.widgets.plots import theme_bar
from dsl_app.shared.wording import short_name
from dsl_core.optics.levels import spread_of

BAND_PX = 260
#: Where the widths of the pictures start from before they share what is left, px.
EVEN_PX = 200


class PairPictures(QWidget):
    """Paints the pair of a state, whose cursor follows the mouse and the arrow keys."""

    def __init__(self, state: PairState, control: PairController) -> None:
        super().__init__()
        self._state, self._control, self._theme = state, control, DARK
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        tip = "A, B and A minus B. Drag to pan, wheel to zoom; arrow keys move the cursor."
        self.canvas = Canvas("A, B and their difference", tip)
        # The keyboard comes to this widget, so that it is this one's name that is read.
        self.setAccessibleName("A, B and their difference")
        self.setAccessibleDescription(tip)
        self.canvas.setFocusProxy(self)
        FocusRing(self, self.canvas)
        self.titles = [pg.LabelItem(text, justify="left") for text in ("A", "B", "A − B")]
        self.boxes = [pg.ViewBox(lockAspect=True, invertY=True, enableMenu=False) for _ in range(3)]
        self.no_values = [NoValues(box) for box in self.boxes]
        self.images = [pg.ImageItem(axisOrder="row-major") for _ in range(3)]
        self.crosses = [pg.TargetItem(size=13, movable=False) for _ in range(3)]
        #: The colour bar of both pictures and that of their difference; slow to make, so only for a pair.
        self.bars: tuple[Any, ...] = ()
        self._lay_out()
        self._mouse = pg.SignalProxy(self.canvas.scene().sigMouseMoved, rateLimit=60, slot=self._hover)
        self.stops = [
            state.pair.follow(self._new_pair),
            *follow_any(self.paint, state.shown, state.band),
            state.cursor.follow(self._show_cursor),
        ]

    def _lay_out(self) -> None:
        # Columns: A, B, the colour bar of both, their difference, its colour bar.
        for i, place in enumerate((0, 1, 3)):
            self.canvas.addItem(self.titles[i], 0, place)
            self.canvas.addItem(self.boxes[i], 1, place)
            self.boxes[i].addItem(self.images[i])
            self.boxes[i].addItem(self.crosses[i], ignoreBounds=True)
            self.crosses[i].hide()
            if i:
                self.boxes[i].setXLink(self.boxes[0])
                self.boxes[i].setYLink(self.boxes[0])
            # Equal widths: the narrowest sets the zoom of all.
            self.canvas.ci.layout.setColumnPreferredWidth(place, EVEN_PX)
            self.canvas.ci.layout.setColumnStretchFactor(place, 1)
        column_of(self.canvas, on=self, margins=0)

    # Mouse and keys --------------------------------------------------------------------------------

    def _hover(self, event: tuple[Any]) -> None:
        for box in self.boxes:
            if box.sceneBoundingRect().contains(event[0]):
                at = box.mapSceneToView(event[0])
                self._control.point_at((round(at.x()), round(at.y())))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Arrow keys move the cursor, with Shift by ten."""
        step, pair = arrow_step(event), self._state.pair.value
        if step is None or pair is None:
            super().keyPressEvent(event)
            return
        height, width = pair.first.arrays.shape
        at = self._state.cursor.value or (width // 2, height // 2)
        self._control.point_at(moved_within(at, step, (width, height)))

    # Paint -----------------------------------------------------------------------------------------

    def _new_pair(self, pair: Pair | None) -> None:
        for item, hatching in zip(self.images, self.no_values, strict=True):
            item.clear()
            hatching.hide()
        if pair is not None and not self.bars:
            call_deferred(self, self._make_bars)
        for bar in self.bars:
            bar.setVisible(pair is not None)
        self._title(pair)
        if pair is not None:
            self._paint_whole()

    def _paint_whole(self) -> None:
        self.paint()
        self.boxes[0].autoRange(padding=0.01, items=[self.images[0]])

    def _make_bars(self) -> None:
        if self.bars or self._state.pair.value is None:
            return
        self.bars = tuple(
            pg.ColorBarItem(interactive=False, width=12, colorMap=colour_map(name))
            for name in (DEPTH, DIFFERENCE)
        )
        for bar, place in zip(self.bars, (2, 4), strict=True):
            self.canvas.addItem(bar, 1, place)
        self._theme_bars()
        self._paint_whole()

    def _title(self, pair: Pair | None) -> None:
        names = ("", "", "")
        if pair is not None:
            names = f"A  {short_name(pair.first.name)}", f"B  {short_name(pair.second.name)}", "A − B"
        for title, name in zip(self.titles, names, strict=True):
            title.setText(escape(name), color=self._theme.text)

    def paint(self) -> None:
        """Paint what the state shows."""
        state = self._state
        pair = state.pair.value
        images = None if pair is None else pair.images(state.shown.value, state.band.value)
        if images is None:
            return
        first, second = images
        levels = common_levels(first, second, state.shown.value)
        colours = DEPTH if state.shown.value is PairQuantity.DEPTH else GREY
        gap = first - second
        reach = max(spread_of(np.abs(gap), 0, 99)[1], 1e-6)
        table = colour_map(colours).getLookupTable(nPts=256)
        self._paint(0, first, levels, table)
        self._paint(1, second, levels, table)
        self._paint(2, gap, (-reach, reach), colour_map(DIFFERENCE).getLookupTable(nPts=256))
        if self.bars:
            self._show_scales(levels, reach, colours)

    def _show_scales(self, levels: tuple[float, float], reach: float, colours: str) -> None:
        scale, difference = self.bars
        scale.setColorMap(colour_map(colours))
        scale.setLevels(levels)
        difference.setLevels((-reach, reach))
        depth = self._state.shown.value is PairQuantity.DEPTH
        texts = ("Depth (mm)", "Difference (mm)") if depth else ("Reflectance", "Difference")
        for bar, text in zip(self.bars, texts, strict=True):
            bar.setLabel("left", text, color=self._theme.muted)

    def _paint(self, i: int, image: Any, levels: tuple[float, float], table: Any) -> None:
        self.images[i].setImage(image, levels=levels, lut=table, autoLevels=False)
        height, width = image.shape
        self.images[i].setRect(-0.5, -0.5, width, height)
        self.no_values[i].lie_under(image.shape)

    def _show_cursor(self, pixel: Pixel | None) -> None:
        for cross in self.crosses:
            cross.setVisible(pixel is not None)
            if pixel is not None:
                cross.setPos(*pixel)

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self._theme = theme
        self.canvas.setBackground(theme.surround)
        for hatching in self.no_values:
            hatching.apply_theme(theme)
        for cross in self.crosses:
            cross.setPen(pg.mkPen(theme.accent, width=2))
        self._theme_bars()
        self._title(self._state.pair.value)
        self.paint()

    def _theme_bars(self) -> None:
        for bar in self.bars:
            theme_bar(bar, self._theme)


def common_levels(first: Any, second: Any, shown: PairQuantity) -> tuple[float, float]:
    """One scale for both pictures; reflectance starts at zero."""
    spreads = [spread_of(image) for image in (first, second)]
    low = min(spread[0] for spread in spreads) if shown is PairQuantity.DEPTH else 0.0
    return low, max(spread[1] for spread in spreads)


class PairControls(QWidget):
    """The row under the pictures: depth or a band, and the values under the cursor."""

    def __init__(self, state: PairState, control: PairController) -> None:
        super().__init__()
        self._state, self._control = state, control
        self.shown = ChoiceBox(
            "Quantity",
            "What the pictures show: depth, or reflectance in one band",
            [(each.value, each) for each in PairQuantity],
            self._choose_shown,
        )
        tip = "The band shown, of those that both results have"
        self.band = named(QSlider(Qt.Orientation.Horizontal), "Band", tip)
        self.band.setFixedWidth(BAND_PX)
        self.nm, self.readout = label("", "muted"), label("", "muted", name="Values under the cursor")
        row_of(self.shown, self.band, self.nm, STRETCH, self.readout, on=self, margins=0)
        self.band.valueChanged.connect(control.set_band)
        self.stops = [
            state.pair.follow(self._show_pair),
            *follow_any(self._show, state.shown, state.band),
            state.cursor.follow(lambda _: self._show_readout()),
        ]

    def _choose_shown(self, shown: PairQuantity) -> None:
        self._control.show(shown)
        # The controller may have refused it.
        self._show()

    def _show_pair(self, pair: Pair | None) -> None:
        self.band.setRange(0, max(len(pair.bands) - 1, 0) if pair else 0)
        self._show()

    def _show(self) -> None:
        state = self._state
        pair, in_band = state.pair.value, state.shown.value is PairQuantity.BAND
        self.shown.choose(state.shown.value)
        self.band.setVisible(in_band)
        self.nm.setVisible(in_band)
        if pair is not None and pair.bands:
            with quiet(self.band):
                self.band.setValue(state.band.value)
            self.nm.setText(f"{pair.nm(state.band.value):g} nm")
        self._show_readout()

    def _show_readout(self) -> None:
        self.readout.setText(cursor_text(self._state))
