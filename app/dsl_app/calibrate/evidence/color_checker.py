"""Evidence of the Color Checker: the chart as seen, its patches against expectation, refined curves."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PySide6.QtWidgets import QWidget

from dsl_app.calibrate.evidence.base import BackgroundReader, Evidence, side_by_side, stacked
from dsl_app.calibrate.evidence.chart_picture import ChartPicture, Swatches, corners_in
from dsl_app.calibrate.evidence.charts import (
    CHANNELS,
    DASHES,
    DOT,
    LINE,
    Bars,
    ChartBox,
    channel_curves,
    draw_bars,
    draw_curves,
)
from dsl_app.calibrate.evidence.tables import Cell, NumberTable, with_spread
from dsl_app.shared.widgets.forms import label, push_button, set_role
from dsl_app.shared.widgets.layouts import boxed, column_of, row_of, tabs_of
from dsl_app.shared.widgets.plots import RGB_COLOURS
from dsl_core.calibration.colour.color_checker import WORST_PERCENT
from dsl_core.model.calibration.color_checker import ORIENTATIONS, ColorCheckerCalibration
from dsl_core.model.rig import Rgb

if TYPE_CHECKING:
    from dsl_core.campaign.color_checker.recipe import ChartView
    from dsl_core.campaign.session import CalibrationSession

#: What a person does where no chart was found.
HELP = (
    "This picture could not be fitted. Drag the four corners to the outer corners of the 24 patches,"
    " beginning at any of them, until all outlines are inside patches; then fit."
)
NO_FIT = "There is no fit yet."
HEADS = (
    ("Patch", "Name of the patch"),
    *(
        (f"{name.capitalize()}, %", "Measured under white, relative to a perfect white, with its deviation")
        for name in CHANNELS
    ),
    ("Expected, %", "Expected from the refined curves: red, green, blue"),
    ("In fit", "RMS of measured minus modelled signals, % of the patch's white"),
    ("Held out", "The same with curves fitted without the patch"),
)


class ColorCheckerEvidence(Evidence[ColorCheckerCalibration]):
    """Three tabs; moved corners become settings of the next fit."""

    def __init__(self) -> None:
        super().__init__(ColorCheckerCalibration)
        self._before: tuple[Rgb, Rgb] | None = None
        self._view: ChartView | None = None
        self._by_hand: tuple[tuple[float, float], ...] | None = None
        self.chart = ChartPicture()
        self.swatches = Swatches()
        self.words = label("", "muted", wraps=True)
        self.again = push_button(
            "Fit with these corners", "Measure the patches again at the current corners, and refine again"
        )
        self.back = push_button("Reset corners", "Move the corners back to those of the fit shown here")
        self.table = NumberTable("Patches", HEADS)
        self.residuals = ChartBox(
            "Residuals of the patches",
            "RMS of measured minus modelled signals; held out: with curves fitted without the patch.",
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
        self._reader = BackgroundReader(self)
        self.again.setAccessibleName("Fit with these corners")
        self.back.setAccessibleName("Reset corners")
        self.tabs = tabs_of(
            "Evidence of the Color Checker",
            (
                self._chart_tab(),
                "Chart",
                "Where the chart was found, and its patches next to what they should be",
            ),
            (self._patches_tab(), "Patches", "What was measured on each patch, and how far off it is"),
            (self._curves_tab(), "Curves", "What was found from the patches, over wavelength"),
        )
        column_of(self.tabs, on=self, margins=0)
        self.chart.moved.connect(self._corner_moved)
        self.again.clicked.connect(self._ask)
        self.back.clicked.connect(self._put_back)

    def _chart_tab(self) -> QWidget:
        right = column_of(
            label("Measured next to expected", "heading"),
            label("Numbers: held-out residual, % of white", "muted"),
            (self.swatches, 1),
        )
        row = row_of((self.chart, 3), (right, 2))
        foot = row_of((self.words, 1), self.back, self.again)
        return boxed(column_of((row, 1), foot, margins=(0, 8, 0, 0)))

    def _patches_tab(self) -> QWidget:
        tab = stacked(self.residuals, self.table, (250, 210))
        tab.setContentsMargins(0, 8, 0, 0)
        return tab

    def _curves_tab(self) -> QWidget:
        tab = side_by_side(self.response, self.emission)
        tab.setContentsMargins(0, 8, 0, 0)
        return tab

    def _begin(self, record: ColorCheckerCalibration, session: CalibrationSession) -> None:
        bench, step = session.bench, session.steps[0]
        self._view = None
        self._before = (bench.rig.response, bench.rig.emission)
        self._say("Reading the picture…")
        self._put_back()

        def read() -> ChartView:
            from dsl_core.campaign.color_checker.recipe import chart_view

            return chart_view(record, bench, step)

        self._reader.read(read, self._take)

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

        self._reader.read(read, self._take_picture)
        return True

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
                f"The chart is {ORIENTATIONS[record.quarter_turns]}, {record.distance_mm:.0f} mm away, tilted"
                f" by {record.tilt_deg:.1f}°. Drag any corner that is wrong."
            )

    def _corner_moved(self) -> None:
        self._say("All outlines must be inside patches.")
        for button in (self.again, self.back):
            button.setEnabled(True)

    def _ask(self) -> None:
        corners = [[round(float(x), 2), round(float(y), 2)] for x, y in self.chart.corners_px]
        self.settings_requested.emit({"corners_px": json.dumps(corners)})

    def _say(self, words: str, role: str = "muted") -> None:
        self.words.setText(words)
        set_role(self.words, role)

    # Charts ----------------------------------------------------------------------------------------

    def _draw_record(self, record: ColorCheckerCalibration) -> None:
        assert self._before is not None
        self._draw_patches()
        self.residuals.draw(partial(self._draw_residuals, record))
        for box, after, before in (
            (self.response, record.response, self._before[0]),
            (self.emission, record.emission, self._before[1]),
        ):
            box.draw(partial(self._draw_pair, box, after, before))

    def _draw_pair(self, box: ChartBox, after: Rgb, before: Rgb) -> None:
        box.begin()
        bare = [curve.model_copy(update={"std": None}) for curve in before]
        old = [replace(each, name=f"{each.name} before", dashed=True) for each in channel_curves(bare)]
        draw_curves(box, [*old, *channel_curves(after)])
        keys = [(name, colour, DOT) for name, colour in zip(CHANNELS, RGB_COLOURS, strict=True)]
        box.name_curves(*keys, ("after", self._theme.text, LINE), ("before", self._theme.text, DASHES))

    def _draw_patches(self) -> None:
        record, view = self._record, self._view
        if record is None:
            return
        rows: list[list[Cell]] = []
        for index, patch in enumerate(record.patches):
            measured, expected = ["", "", ""], ""
            if view is not None:
                share = 100 * view.measured[index]
                white = np.array([patch.signal[c][-1] for c in range(3)]) / np.maximum(share, 1e-12)
                std = np.array([patch.std[c][-1] for c in range(3)]) / np.maximum(white, 1e-12)
                measured = [with_spread(value, spread) for value, spread in zip(share, std, strict=True)]
                expected = " / ".join(f"{value:.1f}" for value in 100 * view.expected[index])
            held = 100 * patch.held_out
            rows.append(
                [
                    patch.name,
                    *measured,
                    expected,
                    f"{100 * patch.residual:.2f}",
                    (f"{held:.2f}", "bad" if held > WORST_PERCENT else ""),
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
        kinds = [
            Bars(
                f"{name}, {100 * getattr(record, field):.2f} % in all",
                colour,
                100 * np.array([getattr(patch, field) for patch in record.patches]),
            )
            for name, field, colour in (
                ("before the refinement", "start", theme.line),
                ("held out", "held_out", theme.pins[1]),
                ("in the fit", "residual", theme.pins[0]),
            )
        ]
        numbers = [str(number) for number in range(1, len(record.patches) + 1)]
        draw_bars(box, kinds, numbers, WORST_PERCENT, theme)
        box.plot.setLabel("bottom", "Patch, in reading order")
