"""The Scan page: the plan at the left, what it costs and sees in the middle, the run at the right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QFrame, QHBoxLayout, QScrollArea, QSplitter, QVBoxLayout, QWidget

from app.panels.operating_curve import OperatingCurve
from app.panels.plan_editor import PlanEditor
from app.panels.scan_commands import ScanCommands
from app.panels.scan_run import CalibrationBox, RunBox, TargetBox
from app.panels.scan_view import FramePicture, GraphPlot
from app.state.scan import Phase, ScanState
from app.theme import Theme
from app.widgets.banner import Banner
from app.widgets.help_window import set_help
from app.widgets.page import PageWidget
from dsl_core.evaluation.operating_points import OperatingPoints
from dsl_core.model.presets import PRESETS, on_cycles

#: How often news of the scan is fetched, ms: ten pictures a second look alive.
FETCH_MS = 100
LEFT_PX, RIGHT_PX = 276, 292


class ScanPage(PageWidget):
    """Follows a `ScanState` and asks a controller; ``open_result`` shows a finished scan elsewhere."""

    def __init__(
        self,
        state: ScanState,
        commands: ScanCommands,
        points: OperatingPoints | None,
        open_result: Callable[[Path], object],
    ) -> None:
        super().__init__()
        self._state, self._commands, self._open_result = state, commands, open_result
        self.banner = Banner("Resume")
        self.banner.action.setToolTip(
            "Go on at the next missing frame, after a look at whether anything moved"
        )
        self.plan = PlanEditor()
        self.plan.setObjectName("scan-plan")
        set_help(self.plan, "scanning#the-plan")
        self.curve = OperatingCurve(points)
        set_help(self.curve, "scanning#accuracy-against-time")
        self.picture, self.graph = FramePicture(), GraphPlot()
        set_help(self.picture, "scanning#while-it-runs")
        set_help(self.graph, "reading-an-intensity-graph")
        self.calibration = CalibrationBox(state, commands)
        set_help(self.calibration, "calibrating#using-a-calibration")
        self.target, self.run = TargetBox(state, commands), RunBox(state, commands)
        self.run.setObjectName("scan-run")
        set_help(self.target, "scanning#before-it-starts")
        set_help(self.run, "scanning#while-it-runs")
        self._timer = QTimer(self)
        self._timer.setInterval(FETCH_MS)
        self._timer.timeout.connect(commands.take_news)
        self._stops: list[Callable[[], None]] = []
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        self.middle = QSplitter(Qt.Orientation.Vertical)
        self.middle.setChildrenCollapsible(False)
        for widget, stretch in ((self.curve, 4), (self.picture, 5), (self.graph, 4)):
            widget.setMinimumHeight(120)
            self.middle.addWidget(widget)
            self.middle.setStretchFactor(self.middle.count() - 1, stretch)
        row = QHBoxLayout()
        row.addWidget(_side(LEFT_PX, self.plan))
        row.addWidget(self.middle, 1)
        row.addWidget(_side(RIGHT_PX, self.calibration, self.target, self.run))
        column = QVBoxLayout(self)
        column.addWidget(self.banner)
        column.addLayout(row, 1)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.banner.action.clicked.connect(commands.start)
        self.plan.preset_chosen.connect(commands.plans.choose_preset)
        self.plan.plan_changed.connect(self._change_plan)
        self.curve.chosen.connect(commands.plans.choose_preset)
        self.picture.pointed.connect(commands.point_at)
        self._stops = [
            *self.calibration.stops,
            *self.target.stops,
            *self.run.stops,
            state.plan.follow(lambda _: self._show_plan()),
            state.period_ms.follow(lambda _: self._show_plan()),
            state.latency_ms.follow(lambda _: self._show_plan()),
            state.interrupted.follow(lambda _: self._show_phase(state.phase.value)),
            state.phase.follow(self._show_phase),
            state.trouble.follow(self.banner.say),
            state.picture.follow(lambda shown: self.picture.show_picture(shown, state.plan.value)),
            state.cursor.follow(self.picture.show_cursor),
            state.graph.follow(self.graph.show_graph),
            state.result.connect(self._show_result),
        ]

    def _change_plan(self, plan: object) -> None:
        self._commands.plans.change_plan(plan)  # type: ignore[arg-type]
        # What was refused or rounded is shown as it is.
        self._show_plan()

    def _show_plan(self) -> None:
        state = self._state
        plan, period_ms, latency_ms = state.plan.value, state.period_ms.value, state.latency_ms.value
        self.plan.set_plan(plan, period_ms)
        preset = state.preset
        seconds = {each.key: on_cycles(each.plan, period_ms).duration_s(latency_ms) for each in PRESETS}
        self.curve.show_plans(seconds, "" if preset is None else preset.key, plan.duration_s(latency_ms))

    def _show_phase(self, phase: Phase) -> None:
        fixed = phase.is_busy or self._state.interrupted.value is not None
        self.plan.setEnabled(not fixed)
        self.target.setEnabled(not fixed)
        self.calibration.setEnabled(not fixed)
        self.curve.marker.movable = not fixed
        if phase.is_busy:
            self._timer.start()
        else:
            self._timer.stop()

    def _show_result(self, path: Path) -> None:
        # Who works elsewhere meanwhile is not torn away.
        if self.isVisible():
            self._open_result(path)

    def showEvent(self, event: QShowEvent) -> None:
        """Disks and libraries change while nobody looks."""
        super().showEvent(event)
        if not self._state.phase.value.is_busy:
            self._commands.plans.refresh()
            self._commands.plans.load_library()

    def open_path(self, path: Path) -> bool:
        """Take an interrupted scan."""
        return self._commands.open(path)

    def command_line(self) -> str:
        """The command that takes this scan."""
        return self._commands.command_line()

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        for part in (self.curve, self.picture, self.graph):
            part.apply_theme(theme)

    def release(self) -> None:
        """Follow nothing more; the runner ends the scan, whose frames are safe."""
        self._timer.stop()
        for stop in self._stops:
            stop()
        self._commands.close()


def _side(width_px: int, *boxes: QWidget) -> QScrollArea:
    content = QWidget()
    column = QVBoxLayout(content)
    column.setContentsMargins(0, 0, 4, 0)
    for box in boxes:
        column.addWidget(box)
    column.addStretch(1)
    area = QScrollArea()
    area.setWidget(content)
    area.setWidgetResizable(True)
    area.setFrameShape(QFrame.Shape.NoFrame)
    area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
    area.setFixedWidth(width_px)
    return area
