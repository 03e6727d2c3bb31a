"""The Scan page: the plan at the left, what it costs and sees in the middle, the run at the right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import (
    QFileDialog,
    QFrame,
    QHBoxLayout,
    QScrollArea,
    QTabWidget,
    QVBoxLayout,
    QWidget,
)

from dsl_app.scan.commands import ScanCommands
from dsl_app.scan.effects.panel import EffectsCommands, EffectsPanel
from dsl_app.scan.effects.state import EffectsState
from dsl_app.scan.forecast.operating_curve import OperatingCurve
from dsl_app.scan.forecast.panel import ForecastPanel
from dsl_app.scan.plan_editor import PlanEditor
from dsl_app.scan.run import CalibrationBox, RunBox, TargetBox
from dsl_app.scan.state import Phase, Rescue, ScanState
from dsl_app.scan.view import ScanView
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.figure_file import Figure
from dsl_app.shared.widgets.forms import Banner
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.page import PageWidget

#: How often news of the scan is fetched, ms: ten pictures a second look alive.
FETCH_MS = 100
LEFT_PX, RIGHT_PX = 276, 292
RESUME = "Go on at the next missing frame, after a look at whether anything moved"
RECONNECT = "Open the rig again, and go on at the next missing frame after a look at whether anything moved"
PLANS = "Plans and pattern sets (*.json)"


class ScanPage(PageWidget):
    """Follows a `ScanState` and asks a controller; ``open_result`` shows a finished scan elsewhere.

    ``again_wanted`` tells that the finished scan is to be reconstructed in another way.
    """

    again_wanted = Signal()

    def __init__(
        self,
        state: ScanState,
        commands: ScanCommands,
        forecast: ForecastPanel,
        rendered: EffectsState,
        effects: EffectsCommands,
        open_result: Callable[[Path], object],
    ) -> None:
        super().__init__()
        self._state, self._commands, self._open_result = state, commands, open_result
        self.banner = Banner("Resume")
        self.stop = self.banner.add_button("Stop trying")
        self.stop.setToolTip("Connect the rig no more by itself; everything stored stays")
        self.plan = PlanEditor()
        self.plan.setObjectName("scan-plan")
        for box in (self.plan.preset, self.plan.code, self.plan.patterns):
            box.be_narrow()
        set_help(self.plan, "scanning#the-plan")
        self.forecast = forecast
        set_help(self.forecast, "accuracy-against-time")
        # Tabs behind the first are made when somebody looks.
        self.view = Deferred(lambda: ScanView(state, commands))
        self.effects = Deferred(lambda: EffectsPanel(rendered, effects))
        set_help(self.effects, "effects-of-the-twin")
        self._rendered, self._effects = rendered, effects
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

    @property
    def curve(self) -> OperatingCurve:
        """Accuracy against time."""
        return self.forecast.curve.content

    def _lay_out(self) -> None:
        self.middle = QTabWidget()
        self.middle.setDocumentMode(True)
        self.middle.tabBar().setDrawBase(False)
        self.middle.tabBar().setAccessibleName("What is shown of the scan")
        for tab, title, tip in (
            (self.forecast, "&Accuracy against time", "What plans are expected to reach, and what they take"),
            (self.view, "&Frames", "What the scan sees while it runs"),
            (self.effects, "&Effects", "What the simulated rig renders of all that light does"),
        ):
            self.middle.setTabToolTip(self.middle.addTab(tab, title), tip)
        row = QHBoxLayout()
        row.addWidget(_side(LEFT_PX, self.plan))
        row.addWidget(self.middle, 1)
        row.addWidget(_side(RIGHT_PX, self.calibration, self.target, self.run))
        column = QVBoxLayout(self)
        column.addWidget(self.banner)
        column.addLayout(row, 1)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.banner.action.clicked.connect(commands.resume)
        self.stop.clicked.connect(commands.stop_reconnecting)
        self.run.again.clicked.connect(self.again_wanted)
        self.plan.preset_chosen.connect(commands.plans.choose_preset)
        self.plan.plan_changed.connect(self._change_plan)
        self.plan.open_wanted.connect(self._open_plan)
        self.plan.save_wanted.connect(self._save_plan)
        self._stops = [
            *self.calibration.stops,
            *self.target.stops,
            *self.run.stops,
            state.plan.follow(lambda _: self._show_plan()),
            state.period_ms.follow(lambda _: self._show_plan()),
            state.interrupted.follow(lambda _: self._show_phase(state.phase.value)),
            state.phase.follow(self._show_phase),
            state.trouble.follow(self.banner.say),
            state.rescue.follow(self._show_rescue),
            state.result.connect(self._show_result),
            self._rendered.offered.follow(self._offer_effects),
        ]

    def _change_plan(self, plan: object) -> None:
        self._commands.plans.change_plan(plan)  # type: ignore[arg-type]
        # What was refused or rounded is shown as it is.
        self._show_plan()

    def _open_plan(self) -> None:
        folder = str(self._state.target.value.parent)
        name, _ = QFileDialog.getOpenFileName(self, "Open a plan or a pattern set", folder, PLANS)
        if name:
            self._commands.plans.open_plan(Path(name))

    def _save_plan(self) -> None:
        proposed = str(self._state.target.value.parent / "plan.json")
        name, _ = QFileDialog.getSaveFileName(self, "Save the plan", proposed, PLANS)
        if name:
            self._commands.plans.save_plan(Path(name))

    def _show_plan(self) -> None:
        state = self._state
        self.plan.set_plan(state.plan.value, state.period_ms.value)

    def _show_phase(self, phase: Phase) -> None:
        fixed = phase.is_busy or self._state.interrupted.value is not None
        self.plan.setEnabled(not fixed)
        self.target.setEnabled(not fixed)
        self.calibration.setEnabled(not fixed)
        self.forecast.fix(fixed)
        if phase is Phase.STARTING:
            self.middle.setCurrentWidget(self.view)
        self._keep_time()

    def _show_rescue(self, rescue: Rescue) -> None:
        self.banner.action.setText("Reconnect and resume" if rescue.is_away else "Resume")
        self.banner.action.setToolTip(RECONNECT if rescue.is_away else RESUME)
        self.banner.action.setEnabled(rescue is not Rescue.RESUMING)
        self.stop.setVisible(rescue.is_trying)
        self._keep_time()

    def _keep_time(self) -> None:
        """Fetch news while there may be some."""
        if self._state.phase.value.is_busy or self._state.rescue.value.is_trying:
            self._timer.start()
        else:
            self._timer.stop()

    def _offer_effects(self, on: bool) -> None:
        """Only a simulated rig can leave out what light does."""
        self.middle.setTabVisible(self.middle.indexOf(self.effects), on)

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

    def subject(self) -> Path | None:
        """The scan that was finished last."""
        return self._state.finished.value

    def open_path(self, path: Path) -> bool:
        """Take an interrupted scan, a plan or a pattern set."""
        return self._commands.open(path)

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """What the buttons do, for menus and keys."""
        return {
            "scan_start": self._commands.resume,
            "scan_pause": self.run.toggle_pause,
            "scan_stop": self._commands.cancel,
        }

    def command_line(self) -> str:
        """The command that takes this scan."""
        return self._commands.command_line()

    def figure(self) -> Figure | None:
        """What accuracy costs in time, once that is predicted."""
        curve = self.forecast.curve.made
        if curve is None or not curve.front():
            return None
        return Figure("accuracy-against-time", curve.plot, curve.apply_theme)

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        for part in (self.forecast, self.view, self.effects):
            part.apply_theme(theme)

    def release(self) -> None:
        """Follow nothing more; the runner ends the scan, whose frames are safe."""
        self._timer.stop()
        for stop in self._stops:
            stop()
        self.forecast.release()
        for part in (self.view.made, self.effects.made):
            if part is not None:
                part.release()
        self._effects.close()
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
