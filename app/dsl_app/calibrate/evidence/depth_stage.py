"""Evidence of the depth stage: planes and film, held-out first orders, columns over depth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from dsl_app.calibrate.evidence.base import BackgroundReader, Evidence, side_by_side
from dsl_app.calibrate.evidence.charts import (
    DASHES,
    DOT,
    LINE,
    Bars,
    ChartBox,
    Floats,
    Key,
    draw_bars,
    draw_points,
    level_line,
    range_about_zero,
)
from dsl_app.calibrate.evidence.tables import Cell, NumberTable
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import label
from dsl_app.shared.widgets.layouts import boxed, column_of, tabs_of
from dsl_core.campaign.depth_stage.figures import MAX_HELD_OUT_PX
from dsl_core.model.calibration.depth_stage import DepthStageCalibration
from dsl_core.model.rig import Film
from dsl_core.solve.normal import BAND_95

if TYPE_CHECKING:
    from dsl_core.calibration.film.depth_stage import StageCurve
    from dsl_core.campaign.session import CalibrationSession

FILM = (
    ("Lines", "lines_per_mm", "1/mm", 2),
    ("Distance from the projector", "distance_mm", "mm", 3),
    ("Tilt about x", "tilt_x_deg", "°", 3),
    ("Tilt about y", "tilt_y_deg", "°", 3),
    ("Roll", "roll_deg", "°", 3),
    ("Bend", "bend_per_mm", "1/mm", 6),
)
#: Room for all of its rows.
FILM_PX = 166
FILM_HEADS = (
    ("Film", "Parameters of the diffraction film"),
    ("Before", "Value before this calibration"),
    ("Found", "Value after this calibration"),
    ("Deviation", "One standard deviation, including what the geometry leaves open"),
    ("Unit", ""),
)


class DepthStageEvidence(Evidence[DepthStageCalibration]):
    """Three tabs: planes and film, first orders, columns over depth."""

    def __init__(self) -> None:
        super().__init__(DepthStageCalibration)
        self._before = Film()
        self._curves: tuple[StageCurve, ...] | Exception | None = None
        self.planes = ChartBox(
            "Scatter about the plane",
            "RMS distance of the columns seen from those of their plane, by position of the stage.",
            "RMS (px)",
            "Position (mm)",
            left_width=64,
        )
        self.steps = ChartBox(
            "Error of the stage's steps",
            "Distance of each plane from the position of the stage, relative to the others, with 95 % bars.",
            "Found − stage (mm)",
            "Position (mm)",
        )
        self.film = NumberTable("Film", FILM_HEADS, words=(0, 4))
        self.held_out = ChartBox(
            "Error of held-out first orders",
            "RMS error, in columns of the projector, of what was held out of the fit in turn; all include the"
            " noise of the samples.",
            "RMS (px)",
            "",
        )
        self.shifts = ChartBox(
            "First orders against the film's model",
            "Median over the image of measured minus modelled columns, away from the zero order.",
            "Shift (px)",
            "Position (mm)",
        )
        self.curve = ChartBox(
            "Columns over depth, middle of the image",
            "Projector column of each filter's light; points are measured, lines are the film's model.",
            "Projector column (px)",
            "Depth (mm)",
            left_width=60,
        )
        self.difference = ChartBox(
            "Difference from the film's model",
            "Measured points and the data-driven curve q = αzᵝ + γ minus the film's model.",
            "Difference (px)",
            "Depth (mm)",
            left_width=60,
        )
        self.warnings = label("", "warn", wraps=True)
        self._reader = BackgroundReader(self)
        self.film.setMinimumHeight(FILM_PX)
        planes = _tab(side_by_side(self.planes, self.steps), self.film)
        orders = _tab(side_by_side(self.held_out, self.shifts))
        columns = _tab(side_by_side(self.curve, self.difference))
        self.tabs = tabs_of(
            "Evidence of the depth stage",
            (planes, "Planes and film", "How flat the planes came out, and where the film was found"),
            (orders, "First orders", "How far first orders are from where the film puts them"),
            (columns, "Columns over depth", "Where lines are seen at each depth, against the model"),
        )
        column_of(self.warnings, (self.tabs, 1), on=self, margins=0)

    def _begin(self, record: DepthStageCalibration, session: CalibrationSession) -> None:
        rig = session.bench.rig
        self._before, self._curves = rig.film, None

        def read() -> tuple[StageCurve, ...]:
            from dsl_core.calibration.film.depth_stage import stage_curves

            return stage_curves(record, rig)

        self._reader.read(read, self._take)

    def _take(self, curves: tuple[StageCurve, ...] | Exception) -> None:
        self._curves = curves
        self._draw_later()

    def _draw_record(self, record: DepthStageCalibration) -> None:
        self.warnings.setText(" ".join(f"{warning}." for warning in record.warnings))
        self.warnings.setVisible(bool(record.warnings))
        self.planes.draw(lambda: self._draw_planes(record))
        self.steps.draw(lambda: self._draw_steps(record))
        self.film.fill(_film_rows(record, self._before))
        self.held_out.draw(lambda: self._draw_held_out(record))
        self.shifts.draw(lambda: self._draw_shifts(record))
        self._draw_later()

    # Planes and film -------------------------------------------------------------------------------

    def _draw_planes(self, record: DepthStageCalibration) -> None:
        box, theme = self.planes, self._theme
        heights = np.array([position.column_rms_px for position in record.positions])
        limit_px = min(position.column_limit_px for position in record.positions)
        names = [f"{p.position_mm:g}" for p in record.positions]
        left_open = f"standard deviation of depth from the geometry {record.depth_std_mm:.3f} mm"
        bars = Bars("", theme.pins[0], heights)
        draw_bars(box, [bars], names, limit_px, theme, (left_open, theme.text, ""))

    def _draw_steps(self, record: DepthStageCalibration) -> None:
        box, theme = self.steps, self._theme
        box.begin()
        at = np.array([position.position_mm for position in record.positions])
        error = np.array([position.step_error_mm for position in record.positions])
        std = np.array([position.step_std_mm for position in record.positions])
        draw_points(box, at, error, std, theme.pins[0])
        box.item.setXRange(at.min(), at.max(), padding=0.1)
        limit_mm = record.positions[0].step_limit_mm
        range_about_zero(box, 1.2 * float((np.abs(error) + BAND_95 * std).max()), limit_mm, theme)
        pull = f"correction of the geometry by the planes {record.geometry_pull:.2f} standard deviations"
        box.name_curves((pull, theme.text, ""))

    # First orders ----------------------------------------------------------------------------------

    def _draw_held_out(self, record: DepthStageCalibration) -> None:
        box, theme = self.held_out, self._theme
        if not record.held_out:
            box.say("Nothing could be held out: that needs more positions or filters.")
            return
        kinds = (
            Bars("film alone", theme.pins[1], np.array([each.grating_px for each in record.held_out])),
            Bars("with residual", theme.pins[0], np.array([each.hybrid_px for each in record.held_out])),
            Bars("noise", theme.line, np.array([each.noise_px for each in record.held_out])),
        )
        names = [_short(each.kept_out) for each in record.held_out]
        needless = () if record.residual.degrees else (("no residual was needed", theme.text, ""),)
        draw_bars(box, kinds, names, MAX_HELD_OUT_PX, theme, *needless)
        box.plot.setLabel("bottom", "Held out: positions (mm), filters (nm), tiles")

    def _draw_shifts(self, record: DepthStageCalibration) -> None:
        box, theme = self.shifts, self._theme
        box.begin()
        at = np.array([position.position_mm for position in record.positions])
        keys: list[Key] = []
        reach = 0.0
        for each, colour in zip(record.filters, _colours(record, theme), strict=True):
            shift = np.array(each.shift_px)
            reach = max(reach, float(np.abs(shift).max()))
            box.item.addItem(pg.PlotCurveItem(at, shift, pen=pg.mkPen(colour, width=1)))
            draw_points(box, at, shift, None, colour)
            keys.append((f"{each.filter_nm:g} nm, {each.tiles} tiles", colour, DOT))
        level_line(box, 0.0, theme.muted)
        box.item.setXRange(at.min(), at.max(), padding=0.1)
        box.item.setYRange(-1.3 * reach, 1.3 * reach, padding=0)
        box.name_curves(*keys)

    # Columns over depth ----------------------------------------------------------------------------

    def _draw_later(self) -> None:
        """The two boxes are drawn together, with the first of them."""
        self.curve.draw(self._draw_curves)
        self.difference.draw(lambda: self.curve.plot)

    def _draw_curves(self) -> None:
        record, curves = self._record, self._curves
        if record is None:
            return
        if curves is None or isinstance(curves, Exception):
            words = "Computing the columns…" if curves is None else str(curves)
            self.curve.say(words)
            self.difference.say(words)
            return
        theme = self._theme
        colours = dict(zip((f.filter_nm for f in record.filters), _colours(record, theme), strict=True))
        for box in (self.curve, self.difference):
            box.begin()
        reach = 0.0
        for each in curves:
            colour, symbol = colours[each.filter_nm], "o" if each.order > 0 else "t"
            self.curve.item.addItem(
                pg.PlotCurveItem(
                    each.depth_mm, each.film_px, pen=pg.mkPen(colour, width=1.2), connect="finite"
                )
            )
            draw_points(self.curve, each.seen_mm, each.seen_px, None, colour, symbol)
            shift = each.seen_px - each.seen_film_px
            draw_points(self.difference, each.seen_mm, shift, None, colour, symbol)
            reach = max(reach, _largest(shift))
            if each.grid_px is not None:
                off = each.grid_px - each.film_px
                reach = max(reach, _largest(off))
                pen = pg.mkPen(colour, width=1.2, style=Qt.PenStyle.DashLine)
                self.difference.item.addItem(pg.PlotCurveItem(each.depth_mm, off, pen=pen, connect="finite"))
        level_line(self.difference, 0.0, theme.muted)
        if not reach:
            for box in (self.curve, self.difference):
                box.say("In the middle of the image no first order comes from within the projector's frame.")
            return
        self.difference.item.setYRange(-1.2 * reach, 1.2 * reach, padding=0)
        keys: list[Key] = [(f"{nm:g} nm", colour, LINE) for nm, colour in colours.items()]
        orders: list[Key] = [("order +1", theme.text, "●"), ("order −1", theme.text, "▼")]
        self.curve.name_curves(*keys, *orders)
        grid = "data-driven curve" if record.correspondence is not None else "no data-driven curve was fitted"
        sign = DASHES if record.correspondence else ""
        self.difference.name_curves(("measured", theme.text, DOT), (grid, theme.text, sign))


def _tab(charts: QWidget, below: QWidget | None = None) -> QWidget:
    """A tab of charts, with something below them."""
    return boxed(column_of((charts, 3), *(((below, 2),) if below is not None else ()), margins=(0, 8, 0, 0)))


def _film_rows(record: DepthStageCalibration, before: Film) -> list[list[Cell]]:
    return [
        [
            name,
            (f"{getattr(before, field):.{digits}f}", "muted"),
            f"{getattr(record.film, field):.{digits}f}",
            f"± {max(record.film_std[field], 10.0**-digits):.{digits}f}",
            (unit, "muted"),
        ]
        for name, field, unit, digits in FILM
    ]


def _largest(values: Floats) -> float:
    """The largest absolute value of those that are not NaN; zero without any."""
    known = values[np.isfinite(values)]
    return float(np.abs(known).max()) if len(known) else 0.0


def _short(kept_out: str) -> str:
    """What was held out, short enough for an axis."""
    kind, _, value = kept_out.partition(" ")
    return value.partition(" ")[0] if kind in ("position", "filter") else "tiles"


def _colours(record: DepthStageCalibration, theme: Theme) -> list[str]:
    """A colour for each filter, in their order."""
    return [theme.pins[index % len(theme.pins)] for index in range(len(record.filters))]
