"""Evidence of the self-test: linearity, gamma, the beat of the light's colour cycle, and latency."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyqtgraph as pg
from PySide6.QtWidgets import QGridLayout

from dsl_app.calibrate.evidence.base import BackgroundReader, Evidence
from dsl_app.calibrate.evidence.charts import (
    BAR,
    CHANNELS,
    DASHES,
    DOT,
    LINE,
    ChartBox,
    draw_points,
    level_line,
    range_about_zero,
)
from dsl_app.calibrate.evidence.tables import with_spread
from dsl_app.shared.widgets.plots import RGB_COLOURS
from dsl_core.calibration.selftest.figures import BEAT_PERCENT, LINEARITY_PERCENT, RAMP_PERCENT
from dsl_core.model.calibration.selftest import CycleCheck, SelfTest
from dsl_core.solve.normal import BAND_95

if TYPE_CHECKING:
    from dsl_core.calibration.selftest.record import SelfTestCurves
    from dsl_core.campaign.session import CalibrationSession

#: Drive level below which the light is mostly noise.
DIM = 0.15
#: What a monochrome camera has in the place of colours.
THIRDS = ("rows 1, 4, 7…", "rows 2, 5, 8…", "rows 3, 6, 9…")
READING = "Reading the means of the frames…"


class SelfTestEvidence(Evidence[SelfTest]):
    """Four plots; what the record does not hold is read from the captures in another thread."""

    def __init__(self) -> None:
        super().__init__(SelfTest)
        self._curves: SelfTestCurves | Exception | None = None
        self.linearity = ChartBox(
            "Linearity of the camera",
            "Distance of each channel's mean from a straight line over exposure, with 95 % bars.",
            "Off the line (% of full)",
            "Signal (DN)",
        )
        self.gamma = ChartBox(
            "Gamma of the projector",
            "Distance of each colour's light from its power law, or from its curve where the projector has"
            " another, by drive level; the legend gives mean exponents.",
            "Off the law (%)",
            "Drive (of full)",
        )
        self.beat = ChartBox(
            "Modulation of the light",
            "Spread of the colour ratios over repeats at one exposure, with 95 % bars. Exposures of whole"
            " cycles have none; the advised ones are marked.",
            "Spread of ratios (%)",
            "Exposure (ms)",
        )
        self.latency = ChartBox(
            "Latency",
            "Share of the frames that showed the new picture, by the wait after it was shown.",
            "New picture seen (%)",
            "Wait after show (ms)",
        )
        boxes = (self.linearity, self.gamma, self.beat, self.latency)
        self._reader = BackgroundReader(self)
        grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(10)
        for index, box in enumerate(boxes):
            grid.addWidget(box, index // 2, index % 2)
            grid.setRowStretch(index // 2, 1)
            grid.setColumnStretch(index % 2, 1)

    def _begin(self, record: SelfTest, session: CalibrationSession) -> None:
        self._curves = None
        folder = session.bench.step_folder(session.steps[0])

        def read() -> SelfTestCurves:
            from dsl_core.calibration.selftest.record import selftest_curves
            from dsl_core.campaign.selftest.capture import load_capture

            return selftest_curves(load_capture(folder))

        self._reader.read(read, self._take)

    def _take(self, curves: SelfTestCurves | Exception) -> None:
        self._curves = curves
        self._draw()

    def _draw_record(self, record: SelfTest) -> None:
        curves = self._curves
        self.beat.draw(lambda: self._draw_beat(record.cycle))
        if curves is None or isinstance(curves, Exception):
            words = READING if curves is None else str(curves)
            for box in (self.linearity, self.gamma, self.latency):
                box.say(words)
            return
        self.linearity.draw(lambda: self._draw_linearity(record, curves))
        self.gamma.draw(lambda: self._draw_gamma(record, curves))
        self.latency.draw(lambda: self._draw_latency(record, curves))

    def _draw_linearity(self, record: SelfTest, curves: SelfTestCurves) -> None:
        box, percent = self.linearity, 100 / curves.full_scale_dn
        box.begin()
        for line, colour in zip(curves.lines, RGB_COLOURS, strict=True):
            draw_points(box, line.value_dn, percent * line.residual_dn, percent * line.std_dn, colour, size=5)
        reach = max(float(np.abs(percent * line.residual_dn).max()) for line in curves.lines)
        box.item.setXRange(0, max(float(line.value_dn.max()) for line in curves.lines), padding=0.03)
        range_about_zero(box, max(1.3 * reach, 0.02), LINEARITY_PERCENT, self._theme)
        names = THIRDS if record.camera.is_monochrome else CHANNELS
        checks = zip(names, record.camera.linearity_percent, RGB_COLOURS, strict=True)
        box.name_curves(
            *((f"{name}, at most {each.value:.3f} %", colour, DOT) for name, each, colour in checks)
        )

    def _draw_gamma(self, record: SelfTest, curves: SelfTestCurves) -> None:
        box = self.gamma
        box.begin()
        colours = dict(zip(("white", *CHANNELS), (self._theme.text, *RGB_COLOURS), strict=True))
        checks = {check.colour: check for check in record.projector.ramps}
        span = 1.5 * RAMP_PERCENT
        for ramp in curves.ramps:
            ratio = ramp.light / checks[ramp.colour].light(ramp.level)
            off = 100 * (ratio / np.median(ratio[ramp.level > DIM]) - 1)
            order = np.argsort(ramp.level)
            pen = pg.mkPen(colours[ramp.colour], width=1)
            box.item.addItem(pg.PlotCurveItem(ramp.level[order], off[order], pen=pen))
            draw_points(box, ramp.level, off, None, colours[ramp.colour], size=5)
            span = max(span, 1.1 * float(np.abs(off[ramp.level > DIM]).max(initial=0)))
        for limit in (-RAMP_PERCENT, RAMP_PERCENT):
            level_line(box, limit, self._theme.bad, "limit, RMS" if limit > 0 else "")
        box.item.setRange(xRange=(0, 1), yRange=(-span, span), padding=0.02)
        box.name_curves(
            *(
                (f"{name} {with_spread(check.gamma.value, check.gamma.std)}", colours[name], LINE)
                for name, check in checks.items()
            )
        )

    def _draw_beat(self, cycle: CycleCheck) -> None:
        box, beats = self.beat, sorted(cycle.beats, key=lambda beat: beat.exposure_ms)
        if not beats:
            box.say("No exposures were repeated, so nothing is known about modulation of the light.")
            return
        box.begin()
        theme, at = self._theme, np.arange(len(beats))
        heights = np.array([beat.ratio_percent.value for beat in beats])
        std = np.array([beat.ratio_percent.std for beat in beats])
        brushes = [theme.good if cycle.is_advised(beat.exposure_ms) else theme.muted for beat in beats]
        box.item.addItem(
            pg.BarGraphItem(x=at, height=heights, width=0.55, brushes=brushes, pen=pg.mkPen(None))
        )
        bars = pg.ErrorBarItem(x=at, y=heights, height=2 * BAND_95 * std, beam=0.12, pen=theme.text)
        box.item.addItem(bars)
        level_line(box, BEAT_PERCENT, theme.bad, "limit")
        box.item.getAxis("bottom").setTicks(
            [[(i, f"{beat.exposure_ms:.1f}") for i, beat in enumerate(beats)]]
        )
        top = max(float((heights + BAND_95 * std).max()), 1.2 * BEAT_PERCENT)
        box.item.setRange(xRange=(-0.6, len(beats) - 0.4), yRange=(0, 1.1 * top), padding=0)
        period = cycle.period_ms
        words = "steady light" if period is None else f"cycle of {with_spread(period.value, period.std)} ms"
        box.name_curves(("advised", theme.good, BAR), ("others", theme.muted, BAR), (words, theme.text, ""))

    def _draw_latency(self, record: SelfTest, curves: SelfTestCurves) -> None:
        box, theme, latency = self.latency, self._theme, record.latency
        box.begin()
        share = 100 * curves.right_share
        box.item.plot(curves.waits_ms, share, pen=pg.mkPen(theme.pins[0], width=1))
        draw_points(box, curves.waits_ms, share, None, theme.pins[0])
        wait = pg.InfiniteLine(latency.wait_ms.value, movable=False, pen=pg.mkPen(theme.accent, dash=[4, 4]))
        box.item.addItem(wait, ignoreBounds=True)
        box.item.setXRange(0, max(float(curves.waits_ms.max()), 1.0), padding=0.04)
        box.item.setYRange(0, 105, padding=0.02)
        safe = f"safe after {with_spread(latency.wait_ms.value, latency.wait_ms.std)} ms"
        box.name_curves(
            (safe, theme.accent, DASHES),
            (f"show takes {latency.blocking_ms.value:.1f} ms", theme.text, ""),
            (f"stale {latency.stale_frames} of {latency.checked}", theme.text, ""),
        )
