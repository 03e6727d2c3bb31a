"""Evidence of the Color Checker: the chart as seen, its patches against expectation, refined curves."""

from __future__ import annotations

import json
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QPushButton, QSplitter, QTabWidget, QVBoxLayout, QWidget

from dsl_app.calibrate.evidence.base import Evidence
from dsl_app.calibrate.evidence.chart_picture import ChartPicture, corners_in
from dsl_app.calibrate.evidence.curves import Named, draw_curves, level_line
from dsl_app.calibrate.evidence.parts import BAR, DOT, Aside, Cell, ChartBox, NumberTable
from dsl_app.calibrate.evidence.swatches import Swatches
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import label, set_role
from dsl_app.shared.widgets.plots import RGB_COLOURS
from dsl_core.calibration.colour.color_checker import WORST_PERCENT
from dsl_core.model.calibration.color_checker import TURNS, ColorCheckerCalibration
from dsl_core.model.rig import Rgb

if TYPE_CHECKING:
    from dsl_core.campaign.color_checker.recipe import ChartView
    from dsl_core.campaign.session import CalibrationSession
    from dsl_core.model.base import Record
    from dsl_core.model.calibration.accepted import AcceptedCalibration

CHANNELS = ("red", "green", "blue")
#: What a person does where no chart was found.
HELP = (
    "No fit came of this picture. Drag the four corners to the outer corners of the 24 patches, in any order"
    " round the chart, until all outlines lie inside patches; then fit."
)
NO_FIT = "There is no fit yet."
HEADS = (
    ("Patch", "Name of the patch"),
    *(
        (f"{name.capitalize()}, %", "Measured under white, of a perfect white, with its deviation")
        for name in CHANNELS
    ),
    ("Expected, %", "What the refined curves expect: red, green, blue"),
    ("In fit", "Rms of measured minus modelled signals, % of the patch's white"),
    ("Held out", "The same with curves that never saw the patch"),
)


class ColorCheckerEvidence(Evidence):
    """Three tabs; moved corners are asked for as settings of the next fit."""

    def __init__(self) -> None:
        super().__init__()
        self._record: ColorCheckerCalibration | None = None
        self._before: tuple[Rgb, Rgb] | None = None
        self._view: ChartView | None = None
        self._by_hand: tuple[tuple[float, float], ...] | None = None
        self.chart = ChartPicture()
        self.swatches = Swatches()
        self.words = label("", "muted")
        self.words.setWordWrap(True)
        self.again = QPushButton("Fit with these corners")
        self.again.setToolTip("Measure the patches anew where the corners are now, and refine again")
        self.back = QPushButton("Put corners back")
        self.back.setToolTip("Put the corners where the shown fit has them")
        self.table = NumberTable("Patches", HEADS)
        self.residuals = ChartBox(
            "Residuals of the patches",
            "Rms of measured minus modelled signals; held out: by curves that never saw the patch.",
            "Of white (%)",
            "",
        )
        self.response = ChartBox(
            "Response of the camera", "Solid after, dotted before the chart; 95 % bands.", "Response",
            "Wavelength (nm)",
        )  # fmt: skip
        self.emission = ChartBox(
            "Emission of the LEDs", "Solid after, dotted before the chart; 95 % bands.", "Emission",
            "Wavelength (nm)",
        )  # fmt: skip
        self._aside = Aside(self)
        self.tabs = QTabWidget()
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName("Evidence of the Color Checker")
        self.again.setAccessibleName("Fit with these corners")
        self.back.setAccessibleName("Put corners back")
        self.tabs.addTab(self._chart_tab(), "Chart")
        self.tabs.addTab(self._patches_tab(), "Patches")
        self.tabs.addTab(self._curves_tab(), "Curves")
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.tabs)
        self.chart.moved.connect(self._corner_moved)
        self.again.clicked.connect(self._ask)
        self.back.clicked.connect(self._put_back)

    def _chart_tab(self) -> QWidget:
        tab, right = QWidget(), QVBoxLayout()
        right.addWidget(label("Measured beside expected", "heading"))
        right.addWidget(label("Numbers: residual when held out, % of white", "muted"))
        right.addWidget(self.swatches, 1)
        row = QHBoxLayout()
        row.addWidget(self.chart, 3)
        row.addLayout(right, 2)
        foot = QHBoxLayout()
        foot.addWidget(self.words, 1)
        foot.addWidget(self.back)
        foot.addWidget(self.again)
        column = QVBoxLayout(tab)
        column.setContentsMargins(0, 8, 0, 0)
        column.addLayout(row, 1)
        column.addLayout(foot)
        return tab

    def _patches_tab(self) -> QWidget:
        parts = QSplitter(Qt.Orientation.Vertical)
        parts.setChildrenCollapsible(False)
        parts.addWidget(self.residuals)
        parts.addWidget(self.table)
        parts.setSizes([250, 210])
        parts.setContentsMargins(0, 8, 0, 0)
        return parts

    def _curves_tab(self) -> QWidget:
        tab = QWidget()
        row = QHBoxLayout(tab)
        row.setContentsMargins(0, 8, 0, 0)
        row.addWidget(self.response, 1)
        row.addWidget(self.emission, 1)
        return tab

    def show_fit(self, fitted: AcceptedCalibration, record: Record, session: CalibrationSession) -> None:
        """Show a fit; the picture of the chart is read aside."""
        assert isinstance(record, ColorCheckerCalibration)
        bench, step = session.bench, session.steps[0]
        self._record, self._view = record, None
        self._before = (bench.rig.response, bench.rig.emission)
        self._say("Reading the picture…")
        self._put_back()
        self._draw()

        def read() -> ChartView:
            from dsl_core.campaign.color_checker.recipe import chart_view

            return chart_view(record, bench, step)

        self._aside.read(read, self._take)

    def show_captures(self, session: CalibrationSession) -> bool:
        """Show the picture in which no chart was found, for its corners to be set by hand."""
        bench, step = session.bench, session.steps[0]
        self._record, self._view = None, None
        self._by_hand = getattr(session.recipe, "corners_px", None)
        for box in (self.residuals, self.response, self.emission):
            box.say(NO_FIT)
        self.table.fill([])
        self.swatches.clear(NO_FIT)
        self.tabs.setCurrentIndex(0)
        self._say("Reading the picture…")

        def read() -> NDArray[np.uint8]:
            from dsl_core.campaign.color_checker.recipe import white_picture

            return white_picture(bench, step)

        self._aside.read(read, self._take_picture)
        return True

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        super().apply_theme(theme)
        for part in (self.chart, self.swatches, self.table, self.residuals, self.response, self.emission):
            part.apply_theme(theme)
        self._draw()

    # Corners ---------------------------------------------------------------------------------------

    def _take(self, view: ChartView | Exception) -> None:
        if isinstance(view, Exception):
            self._say(str(view), "bad")
            return
        self._view = view
        self.chart.show_picture(view.picture)
        self._put_back()
        self._draw_patches()

    def _take_picture(self, picture: NDArray[np.uint8] | Exception) -> None:
        if isinstance(picture, Exception):
            self._say(str(picture), "bad")
            return
        self.chart.show_picture(picture)
        self._put_back()

    def _put_back(self) -> None:
        record, picture = self._record, self.chart.image.image
        for button in (self.again, self.back):
            button.setEnabled(False)
        if record is None and picture is not None:
            self.chart.show_corners(np.array(self._by_hand or corners_in(picture.shape).tolist()))
            self._say(HELP, "warn")
        if record is None:
            return
        self.chart.show_corners(np.array(record.corners_px))
        if self._view is not None:
            self._say(
                f"The chart is {TURNS[record.quarter_turns]}, {record.distance_mm:.0f} mm away, tilted by"
                f" {record.tilt_deg:.1f}°. Drag corners that are wrong."
            )

    def _corner_moved(self) -> None:
        self._say("All outlines must lie inside patches.")
        for button in (self.again, self.back):
            button.setEnabled(True)

    def _ask(self) -> None:
        corners = [[round(float(x), 2), round(float(y), 2)] for x, y in self.chart.corners_px]
        self.settings_requested.emit({"corners_px": json.dumps(corners)})

    def _say(self, words: str, role: str = "muted") -> None:
        self.words.setText(words)
        set_role(self.words, role)

    # Charts ----------------------------------------------------------------------------------------

    def _draw(self) -> None:
        if self._record is None or self._before is None:
            return
        self._draw_patches()
        self.residuals.draw(partial(self._draw_residuals, self._record))
        for box, after, before in (
            (self.response, self._record.response, self._before[0]),
            (self.emission, self._record.emission, self._before[1]),
        ):
            box.draw(partial(self._draw_pair, box, after, before))

    def _draw_pair(self, box: ChartBox, after: Rgb, before: Rgb) -> None:
        box.begin()
        old = [
            Named(f"{name} before", colour, curve.model_copy(update={"std": None}), dashed=True)
            for name, colour, curve in zip(CHANNELS, RGB_COLOURS, before, strict=True)
        ]
        new = [
            Named(name, colour, curve)
            for name, colour, curve in zip(CHANNELS, RGB_COLOURS, after, strict=True)
        ]
        draw_curves(box, [*old, *new])
        keys = [(name, colour, DOT) for name, colour in zip(CHANNELS, RGB_COLOURS, strict=True)]
        box.name_curves([*keys, ("after", self._theme.text, "━"), ("before", self._theme.text, "┅")])

    def _draw_patches(self) -> None:
        record, view = self._record, self._view
        if record is None:
            return
        rows: list[list[Cell | str]] = []
        for index, patch in enumerate(record.patches):
            measured, expected = ["", "", ""], ""
            if view is not None:
                share = 100 * view.measured[index]
                white = np.array([patch.signal[c][-1] for c in range(3)]) / np.maximum(share, 1e-12)
                std = np.array([patch.std[c][-1] for c in range(3)]) / np.maximum(white, 1e-12)
                measured = [f"{value:.2f} ± {spread:.2f}" for value, spread in zip(share, std, strict=True)]
                expected = " / ".join(f"{value:.1f}" for value in 100 * view.expected[index])
            held = 100 * patch.held_out
            rows.append(
                [
                    patch.name,
                    *measured,
                    expected,
                    f"{100 * patch.residual:.2f}",
                    Cell(f"{held:.2f}", "bad" if held > WORST_PERCENT else ""),
                ]
            )
        self.table.fill(rows)
        if view is not None:
            held_out = [patch.held_out for patch in record.patches]
            self.swatches.show_colours(
                view.measured, view.expected, held_out, [p.name for p in record.patches]
            )

    def _draw_residuals(self, record: ColorCheckerCalibration) -> None:
        box, theme = self.residuals, self._theme
        box.begin()
        at = np.arange(len(record.patches))
        kinds = (
            ("before the refinement", theme.line, [patch.start for patch in record.patches]),
            ("held out", theme.pins[1], [patch.held_out for patch in record.patches]),
            ("in the fit", theme.pins[0], [patch.residual for patch in record.patches]),
        )
        top = 0.0
        for side, (_, colour, values) in enumerate(kinds):
            heights = 100 * np.array(values)
            top = max(top, float(heights.max()))
            box.item.addItem(
                pg.BarGraphItem(
                    x=at + 0.27 * (side - 1), height=heights, width=0.25, brush=colour, pen=pg.mkPen(None)
                )
            )
        if top > WORST_PERCENT / 2:
            level_line(box, WORST_PERCENT, theme.bad, "limit")
            top = max(top, 1.1 * WORST_PERCENT)
        box.item.getAxis("bottom").setTicks([[(i, str(i + 1)) for i in range(len(at))]])
        box.plot.setLabel("bottom", "Patch, in reading order")
        box.item.setRange(xRange=(-0.6, len(at) - 0.4), yRange=(0, 1.08 * top), padding=0)
        totals = (record.start, record.held_out, record.residual)
        box.name_curves(
            [
                (f"{name}, {100 * total:.2f} % in all", colour, BAR)
                for (name, colour, _), total in zip(kinds, totals, strict=True)
            ]
        )
