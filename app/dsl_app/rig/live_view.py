"""The live picture with histogram, saturation, focus and the raw value under the cursor."""

from __future__ import annotations

import time
from functools import partial

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QCheckBox, QWidget

from dsl_app.connection.state import RigState
from dsl_app.rig.display_row import DisplayRow
from dsl_app.rig.histogram import CountsHistogram
from dsl_app.rig.state import NO_RIG, Draw, Drawn, FrameCounts, picture_note, rate_text
from dsl_app.shared.evented import Value
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import check_box, label, push_button, set_role, show_label
from dsl_app.shared.widgets.hints import FocusRing
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of
from dsl_app.shared.widgets.pictures import PictureView, Region, RegionBox, arrow_step, cut, moved_within
from dsl_app.shared.widgets.ticker import Ticker
from dsl_core.capture.preview import MANY_SATURATED, quick_picture, site_colour, statistics
from dsl_core.devices.base import CameraInfo
from dsl_core.model.frames import Frame

#: How often figures change, s; the picture follows every frame.
FIGURES_S = 0.25
#: Height of the histogram below the picture, and the most that it takes next to it, px.
LOW_PX, HIGH_PX = 130, 640
#: How often it is looked whether frames still come, ms.
RATE_MS = 500
#: Side of the cell of raw pixels that is shown as one, px.
CELL_PX = 2
_CHANNELS = ("R", "G", "B")


class LiveView(QWidget):
    """Shows frames of a camera; what it shows never changes what is saved.

    ``draw`` is how it makes a picture of a frame now, for a thread that does so before the frame is shown.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._full_scale_dn = 4095
        self._camera: CameraInfo | None = None
        self.draw: Value[Draw | None] = Value(None)
        self._is_live = False
        self._frame: Frame | None = None
        self._times: list[float] = []
        self._figures_at = 0.0
        #: Pixels of each colour by counts, as shown last.
        self._pixels: NDArray[np.int64] | None = None
        self.view = PictureView(
            "Live picture",
            "Wheel to zoom, drag to pan, F to fit; arrow keys move the pixel that is read, with Shift by ten",
        )
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setAccessibleName("Live picture")
        self.view.setFocusProxy(self)
        FocusRing(self, self.view)
        self._box, self._item = self.view.box, self.view.image
        self._read: tuple[int, int] | None = None
        self.rectangle = RegionBox(CELL_PX)
        self._box.addItem(self.rectangle, ignoreBounds=True)
        self.rectangle.hide()
        self.rectangle.sigRegionChangeFinished.connect(self._repaint)
        self.view.scene().sigMouseMoved.connect(self._hover)
        self.display = DisplayRow()
        self.display.changed.connect(self._redraw)
        self.saturation = QCheckBox("Saturation")
        self.saturation.setToolTip("Mark in red the cells that contain a raw pixel at full scale")
        self.saturation.setChecked(True)
        self.saturation.toggled.connect(self._redraw)
        self.region_box = QCheckBox("Region")
        self.region_box.setToolTip("Limit histogram, figures and auto exposure to a rectangle; drag it")
        self.region_box.toggled.connect(self._show_region)
        self.fit = push_button("Fit", "Show the whole picture (F)", self.show_all)
        self.logarithmic = check_box("Logarithmic", "Show the histogram's counts on a logarithmic scale")
        self.logarithmic.toggled.connect(self._repaint)
        # Half of the time that all of this takes to make; the picture does not wait for it.
        self.histogram = Deferred(self._make_histogram)
        self.histogram.setMinimumHeight(LOW_PX)
        self.histogram.setMaximumHeight(LOW_PX)
        self._rate = label("", "muted")
        self._rate_clock = Ticker(self, RATE_MS, self._show_rate)
        self._counts = label("", "muted")
        self._saturated = label("", wraps=True)
        self._focus = label("", "muted")
        self._pixel = label("Point at the picture to read raw counts.", "muted")
        self.note = label(NO_RIG, "muted", wraps=True)
        self.note.setObjectName("over-picture")
        self._lay_out()

    def _lay_out(self) -> None:
        column_of(
            (self.note, 0, Qt.AlignmentFlag.AlignTop), on=self.view.viewport(), margins=(16, 12, 16, 12)
        )
        figures = row_of((self._saturated, 1), (self._focus, 0, Qt.AlignmentFlag.AlignTop), spacing=16)
        switches = row_of(self.saturation, self.logarithmic, self.region_box, self.fit, STRETCH, spacing=6)
        frames = row_of(self._rate, STRETCH, self._counts)
        parts = (self.display, self._pixel, figures, frames, switches, self.histogram)
        #: What is said and set below the picture; a page with room shows it elsewhere.
        self.controls = boxed(column_of(*parts[:-1], (self.histogram, 1), STRETCH, margins=0))
        column_of((self.view, 1), self.controls, on=self, margins=0)

    def place_controls(self, beside: QWidget | None) -> None:
        """Put what is below the picture on another widget with a layout, or below the picture for None."""
        self.histogram.setMaximumHeight(LOW_PX if beside is None else HIGH_PX)
        layout = (self if beside is None else beside).layout()
        assert layout is not None
        layout.addWidget(self.controls)
        self.controls.show()

    def set_camera(self, camera: CameraInfo | None, full_scale_dn: int | None = None) -> None:
        """Show frames of this camera from now on, whose pixels are saturated at ``full_scale_dn``.

        Without that, saturated is the largest number of the camera's bits.
        """
        self._camera, self._frame, self._times = camera, None, []
        largest_dn = 4095 if camera is None else 2**camera.bit_depth - 1
        self._full_scale_dn = largest_dn if full_scale_dn is None else full_scale_dn
        self._choose_draw()
        self._item.clear()
        self._read = None
        self.region_box.setChecked(False)
        self.region_box.setEnabled(camera is not None)
        for figure in (self._saturated, self._focus, self._rate, self._counts):
            figure.clear()
        self._pixels = None
        self._show_histogram()

    def show_rig(self, rig: RigState) -> None:
        """Say over the picture what a person would else take for the present: no rig, a lost one, a stop."""
        if rig.live.value and not self._is_live:
            # The pause before does not count.
            self._times = []
        self._is_live = rig.live.value
        show_label(self.note, picture_note(rig, self._frame is not None))
        self._rate_clock.run_while(self._is_live)
        self._show_rate()

    def show_frame(self, frame: Frame | None, drawn: Drawn | None = None) -> None:
        """Show a frame; ``drawn`` is its picture if somebody has made one, and how."""
        if frame is None or self._camera is None:
            return
        first = self._frame is None
        self._frame = frame
        now = time.monotonic()
        self._times = [*self._times[-29:], now]
        self._paint(drawn)
        if first:
            self.note.hide()
            self.show_all()
        if now - self._figures_at >= FIGURES_S:
            self._figures_at = now
            self._show_figures()

    def show_counts(self, counts: FrameCounts) -> None:
        """Show how many frames were lost and skipped."""
        none = counts == FrameCounts()
        self._counts.setText("" if none else f"{counts.lost} lost, {counts.skipped} skipped")
        set_role(self._counts, "warn" if counts.lost else "muted")

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        self.rectangle.apply_theme(theme)
        self.view.apply_theme(theme)
        self.histogram.apply_theme(theme)

    def _show_rate(self) -> None:
        self._rate.setText(rate_text(self._times, time.monotonic(), self._is_live))

    def _repaint(self) -> None:
        if self._frame is not None:
            self._paint()
            self._show_figures()

    def _redraw(self) -> None:
        self._choose_draw()
        self._repaint()

    def _choose_draw(self) -> None:
        camera = self._camera
        if camera is None:
            self.draw.set(None)
            return
        draw = partial(
            quick_picture,
            bayer=camera.bayer,
            full_scale_dn=self._full_scale_dn,
            show_saturation=self.saturation.isChecked(),
            display=self.display.display,
        )
        self.draw.set(draw)

    def _paint(self, drawn: Drawn | None = None) -> None:
        draw = self.draw.value
        assert draw is not None
        assert self._frame is not None
        # A picture that was made before a setting changed is made again.
        picture = drawn[1] if drawn is not None and drawn[0] is draw else draw(self._frame.pixels)
        self._item.setImage(picture, autoLevels=False, levels=None)

    def _show_figures(self) -> None:
        assert self._camera is not None
        assert self._frame is not None
        pixels = cut(self._frame.pixels, self.region)
        found = statistics(pixels, self._camera.bayer, self._full_scale_dn)
        is_mono = self._camera.bayer == "MONO"
        self._pixels = found.histogram.sum(0, keepdims=True) if is_mono else found.histogram
        self._show_histogram()
        worst = max(found.saturated)
        self._saturated.setText(f"saturated  {_saturated_text(found.saturated, is_mono)}")
        set_role(self._saturated, "bad" if worst > MANY_SATURATED else "muted")
        self._focus.setText(f"focus score {found.focus:.3g}")
        self._show_rate()
        self._show_pixel()

    def _make_histogram(self) -> CountsHistogram:
        self.histogram.made = CountsHistogram()
        self._show_histogram()
        return self.histogram.made

    def _show_histogram(self) -> None:
        if self.histogram.made is not None:
            levels = 1 << self._full_scale_dn.bit_length()
            self.histogram.made.show_counts(self._pixels, levels, self.logarithmic.isChecked())

    def _hover(self, position: QPointF) -> None:
        if self._frame is None or self._camera is None:
            return
        at = self._box.mapSceneToView(position)
        column, row = int(CELL_PX * at.x()), int(CELL_PX * at.y())
        rows, columns = self._frame.pixels.shape
        if 0 <= row < rows and 0 <= column < columns:
            self._read = (column, row)
            self._show_pixel()

    def _show_pixel(self) -> None:
        if self._read is not None and self._frame is not None:
            column, row = self._read
            assert self._camera is not None
            seen = f"column {column} px, row {row} px: {self._frame.pixels[row, column]} DN"
            colour = site_colour(column, row, self._camera.bayer)
            self._pixel.setText(f"{seen}, {colour} pixel" if colour else seen)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Arrow keys move the pixel that is read, F shows the whole picture."""
        step = arrow_step(event)
        if event.key() == Qt.Key.Key_F:
            self.show_all()
        elif step is not None and self._frame is not None:
            rows, columns = self._frame.pixels.shape
            self._read = moved_within(self._read or (columns // 2, rows // 2), step, (columns, rows))
            self._show_pixel()
        else:
            super().keyPressEvent(event)

    # Region ----------------------------------------------------------------------------------------

    @property
    def region(self) -> Region | None:
        """The region that counts, in pixels of the camera; None for the whole picture."""
        if self._camera is None or not self.region_box.isChecked():
            return None
        return self.rectangle.region(self._camera.width_px, self._camera.height_px)

    def _show_region(self, on: bool) -> None:
        if on and self._camera is not None:
            self.rectangle.put_in_middle(self._camera.width_px, self._camera.height_px)
        self.rectangle.setVisible(on and self._camera is not None)
        self._repaint()

    def show_all(self) -> None:
        """Show the whole picture."""
        self.view.fit()


def _saturated_text(shares: tuple[float, float, float], is_mono: bool) -> str:
    """The share of saturated pixels of each colour, or of all where there is one: two of four are green."""
    if is_mono:
        return f"{100 * (shares[0] + 2 * shares[1] + shares[2]) / 4:.2f} %"
    return "  ".join(f"{name} {100 * share:.2f} %" for name, share in zip(_CHANNELS, shares, strict=True))
