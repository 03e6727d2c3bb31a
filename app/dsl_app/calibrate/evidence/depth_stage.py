"""Evidence of the depth stage: planes and film, first orders that fits never saw, columns over depth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QHBoxLayout, QTabWidget, QVBoxLayout, QWidget

from dsl_app.calibrate.evidence.base import Evidence
from dsl_app.calibrate.evidence.curves import COVER, draw_points, level_line
from dsl_app.calibrate.evidence.parts import BAR, DOT, LINE, Aside, Cell, ChartBox, Floats, Key, NumberTable
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import label
from dsl_core.campaign.depth_stage.figures import MAX_HELD_OUT_PX, MAX_PLANE_MM, MAX_STEP_MM
from dsl_core.model.calibration.depth_stage import DepthStageCalibration
from dsl_core.model.rig import Film

if TYPE_CHECKING:
    from dsl_core.calibration.film.depth_stage import StageCurve
    from dsl_core.campaign.session import CalibrationSession
    from dsl_core.model.base import Record
    from dsl_core.model.calibration.accepted import AcceptedCalibration

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
    ("Film", "What is known of the diffraction film"),
    ("Before", "As it was before this calibration"),
    ("Found", "As it is now"),
    ("Deviation", "One standard deviation, what the geometry leaves open included"),
    ("Unit", ""),
)


class DepthStageEvidence(Evidence):
    """Three tabs: planes and film, first orders, columns over depth."""

    def __init__(self) -> None:
        super().__init__()
        self._record: DepthStageCalibration | None = None
        self._before = Film()
        self._curves: tuple[StageCurve, ...] | Exception | None = None
        self.planes = ChartBox(
            "Scatter about the plane",
            "Rms distance of the triangulated points from their plane, by position of the stage.",
            "Rms (mm)",
            "Position (mm)",
        )
        self.steps = ChartBox(
            "Error of the stage's steps",
            "How far each plane stands from where the stage says, relative to the others, with 95 % bars.",
            "Found − said (mm)",
            "Position (mm)",
        )
        self.film = NumberTable("Film", FILM_HEADS, words=(0, 4))
        self.held_out = ChartBox(
            "Error of first orders that the fit never saw",
            "Rms error in columns of the projector of what was left out in turn; the noise of the samples is"
            " part of all of them.",
            "Rms (px)",
            "",
        )
        self.shifts = ChartBox(
            "First orders beside the film's model",
            "Median over the picture of measured minus modelled columns, away from the zero order.",
            "Shift (px)",
            "Position (mm)",
        )
        self.curve = ChartBox(
            "Columns over depth, middle of the picture",
            "Where each filter's light leaves the projector; points are measured, lines the film's model.",
            "Projector column (px)",
            "Depth (mm)",
            left_width=60,
        )
        self.difference = ChartBox(
            "Beside the film's model",
            "Measured points and the data-driven curve q = αzᵝ + γ minus the film's model.",
            "Difference (px)",
            "Depth (mm)",
            left_width=60,
        )
        self.warnings = label("", "warn")
        self.warnings.setWordWrap(True)
        self._aside = Aside(self)
        self.tabs = QTabWidget()
        self.tabs.setDocumentMode(True)
        self.tabs.setAccessibleName("Evidence of the depth stage")
        below = QVBoxLayout()
        below.addWidget(self.film)
        self.film.setMinimumHeight(FILM_PX)
        self.tabs.addTab(_beside(self.planes, self.steps, below), "Planes and film")
        self.tabs.addTab(_beside(self.held_out, self.shifts), "First orders")
        self.tabs.addTab(_beside(self.curve, self.difference), "Columns over depth")
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self.warnings)
        column.addWidget(self.tabs, 1)

    @property
    def _boxes(self) -> tuple[ChartBox, ...]:
        return (self.planes, self.steps, self.held_out, self.shifts, self.curve, self.difference)

    def show_fit(self, fitted: AcceptedCalibration, record: Record, session: CalibrationSession) -> None:
        """Show a fit; columns over depth are computed aside."""
        assert isinstance(record, DepthStageCalibration)
        rig = session.bench.rig
        self._record, self._before, self._curves = record, rig.film, None
        self._draw()

        def read() -> tuple[StageCurve, ...]:
            from dsl_core.calibration.film.depth_stage import stage_curves

            return stage_curves(record, rig)

        self._aside.read(read, self._take)

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        super().apply_theme(theme)
        for box in self._boxes:
            box.apply_theme(theme)
        self.film.apply_theme(theme)
        self._draw()

    def _take(self, curves: tuple[StageCurve, ...] | Exception) -> None:
        self._curves = curves
        self._draw_later()

    def _draw(self) -> None:
        record = self._record
        if record is None:
            return
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
        heights = np.array([position.plane_rms_mm for position in record.positions])
        _draw_bars(box, [("", theme.pins[0], heights)], [f"{p.position_mm:g}" for p in record.positions])
        _limit(box, float(heights.max()), MAX_PLANE_MM, theme)
        box.name_curves([(f"depth left open by the geometry {record.depth_std_mm:.3f} mm", theme.text, "")])

    def _draw_steps(self, record: DepthStageCalibration) -> None:
        box, theme = self.steps, self._theme
        box.begin()
        at = np.array([position.position_mm for position in record.positions])
        error = np.array([position.step_error_mm for position in record.positions])
        std = np.array([position.step_std_mm for position in record.positions])
        draw_points(box, at, error, std, theme.pins[0])
        level_line(box, 0.0, theme.muted)
        span = 1.2 * float((np.abs(error) + COVER * std).max())
        if span > MAX_STEP_MM / 2:
            span = max(span, 1.2 * MAX_STEP_MM)
            level_line(box, MAX_STEP_MM, theme.bad, "limit")
            level_line(box, -MAX_STEP_MM, theme.bad)
        box.item.setXRange(at.min(), at.max(), padding=0.1)
        box.item.setYRange(-span, span, padding=0)
        box.name_curves(
            [(f"pull of the planes on the geometry {record.geometry_pull:.2f} deviations", theme.text, "")]
        )

    # First orders ----------------------------------------------------------------------------------

    def _draw_held_out(self, record: DepthStageCalibration) -> None:
        box, theme = self.held_out, self._theme
        if not record.held_out:
            box.say("Nothing could be left out: more positions or filters are needed for that.")
            return
        kinds = (
            ("film alone", theme.pins[1], np.array([each.grating_px for each in record.held_out])),
            ("with residual", theme.pins[0], np.array([each.hybrid_px for each in record.held_out])),
            ("noise", theme.line, np.array([each.noise_px for each in record.held_out])),
        )
        names = [_short(each.kept_out) for each in record.held_out]
        _draw_bars(box, kinds, names)
        _limit(box, max(float(heights.max()) for _, _, heights in kinds), MAX_HELD_OUT_PX, theme)
        box.plot.setLabel("bottom", "Left out: positions (mm), filters (nm), tiles")
        keys: list[Key] = [(name, colour, BAR) for name, colour, _ in kinds]
        if not record.residual.degrees:
            keys.append(("no residual was needed", theme.text, ""))
        box.name_curves(keys)

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
        box.name_curves(keys)

    # Columns over depth ----------------------------------------------------------------------------

    def _draw_later(self) -> None:
        """The two boxes stand side by side and are drawn together, with the first of them."""
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
                box.say(
                    "In the middle of the picture no first order comes from within the projector's frame."
                )
            return
        self.difference.item.setYRange(-1.2 * reach, 1.2 * reach, padding=0)
        keys: list[Key] = [(f"{nm:g} nm", colour, LINE) for nm, colour in colours.items()]
        orders: list[Key] = [("order +1", theme.text, "●"), ("order −1", theme.text, "▼")]
        self.curve.name_curves([*keys, *orders])
        grid = "data-driven curve" if record.correspondence is not None else "no data-driven curve was fitted"
        self.difference.name_curves(
            [("measured", theme.text, DOT), (grid, theme.text, "┅" if record.correspondence else "")]
        )


def _beside(left: QWidget, right: QWidget, below: QVBoxLayout | None = None) -> QWidget:
    """A tab of two charts side by side, with something below them."""
    tab = QWidget()
    column = QVBoxLayout(tab)
    column.setContentsMargins(0, 8, 0, 0)
    row = QHBoxLayout()
    row.addWidget(left, 1)
    row.addWidget(right, 1)
    column.addLayout(row, 3)
    if below is not None:
        column.addLayout(below, 2)
    return tab


def _draw_bars(box: ChartBox, kinds: Sequence[tuple[str, str, Floats]], names: Sequence[str]) -> None:
    """Groups of bars with their names below."""
    box.begin()
    at, width = np.arange(len(names)), 0.8 / len(kinds)
    for index, (_, colour, heights) in enumerate(kinds):
        place = at + width * (index - (len(kinds) - 1) / 2)
        box.item.addItem(
            pg.BarGraphItem(x=place, height=heights, width=0.9 * width, brush=colour, pen=pg.mkPen(None))
        )
    box.item.getAxis("bottom").setTicks([list(enumerate(names))])
    box.item.setXRange(-0.6, len(names) - 0.4, padding=0)


def _limit(box: ChartBox, top: float, limit: float, theme: Theme) -> None:
    """A range from zero, and the limit where it is near."""
    if top > limit / 2:
        level_line(box, limit, theme.bad, "limit")
        top = max(top, 1.1 * limit)
    box.item.setYRange(0, 1.1 * top, padding=0)


def _film_rows(record: DepthStageCalibration, before: Film) -> list[list[Cell | str]]:
    return [
        [
            name,
            Cell(f"{getattr(before, field):.{digits}f}", "muted"),
            f"{getattr(record.film, field):.{digits}f}",
            f"± {record.film_std[field]:.{digits}f}",
            Cell(unit, "muted"),
        ]
        for name, field, unit, digits in FILM
    ]


def _largest(values: Floats) -> float:
    """The largest size of numbers some of which are NaN; zero without numbers."""
    known = values[np.isfinite(values)]
    return float(np.abs(known).max()) if len(known) else 0.0


def _short(kept_out: str) -> str:
    """What was left out, short enough for an axis."""
    kind, _, value = kept_out.partition(" ")
    return value.partition(" ")[0] if kind in ("position", "filter") else "tiles"


def _colours(record: DepthStageCalibration, theme: Theme) -> list[str]:
    """A colour for each filter."""
    return [theme.pins[index % len(theme.pins)] for index in range(len(record.filters))]
