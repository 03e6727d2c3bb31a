"""The Scan page: plan on the left, forecast and frames in the middle, run on the right."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QEvent, Qt, Signal
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QFileDialog, QGroupBox, QVBoxLayout, QWidget

from dsl_app.scan.controller import ScanController
from dsl_app.scan.controls import banner_controls
from dsl_app.scan.effects.controller import EffectsController
from dsl_app.scan.effects.panel import EffectsPanel
from dsl_app.scan.effects.state import EffectsState
from dsl_app.scan.forecast.panel import ForecastPanel
from dsl_app.scan.frame_box import FrameBox
from dsl_app.scan.plan_editor import PlanEditor
from dsl_app.scan.run import CalibrationBox, RunBox, TargetBox
from dsl_app.scan.state import Phase, Reconnection, ScanState
from dsl_app.scan.view import ScanView
from dsl_app.shared.evented import follow_any
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.figure_file import PlotFigure
from dsl_app.shared.widgets.forms import Banner, show_button
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.layouts import STRETCH, SideArea, boxed, column_of, row_of, splitter, tabs_of
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shared.widgets.save_dialog import ask_place
from dsl_app.shared.widgets.ticker import Ticker

#: Interval at which the state of the scan is fetched, ms: ten pictures a second look live.
FETCH_MS = 100
LEFT_PX, RIGHT_PX, TALL_PX = 276, 292, 400
PLAN, PLAN_TIP = "Plan", "Patterns and exposures of the scan"
FRAMES, FRAMES_TIP = "Fra&mes", "Frames while the scan runs"
PLANS = "Plans and pattern sets (*.json)"


class ScanPage(PageWidget):
    """Shows a `ScanState` and calls its controller; ``open_result`` shows a finished scan elsewhere.

    ``awaits_result`` says whether a person who is on another page is there to see it.
    ``reconstruct_requested`` asks to reconstruct the finished scan with other parameters.
    """

    reconstruct_requested = Signal()

    def __init__(
        self,
        state: ScanState,
        controller: ScanController,
        forecast: ForecastPanel,
        rendered: EffectsState,
        effects: EffectsController,
        open_result: Callable[[Path], object],
        awaits_result: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__()
        self._state, self._controller, self._open_result = state, controller, open_result
        self._awaits_result = awaits_result
        self.banner = Banner("Resume", "", controller.resume)
        tip = "Stop reconnecting the rig automatically; saved frames are kept"
        self.stop = self.banner.add_button("Stop reconnecting", tip, controller.stop_reconnecting)
        self.plan = PlanEditor()
        self.plan.setObjectName("scan-plan")
        for box in (self.plan.preset, self.plan.code, self.plan.patterns):
            box.be_narrow()
        set_help(self.plan, "scanning#the-plan")
        self.forecast = forecast
        set_help(self.forecast, "accuracy-against-time")
        # The other tabs are built when first shown.
        self.view = Deferred(lambda: ScanView(state, controller))
        self.effects = Deferred(lambda: EffectsPanel(rendered, effects))
        set_help(self.effects, "effects-of-the-twin")
        self._rendered, self._effects = rendered, effects
        self.calibration = CalibrationBox(state, controller)
        set_help(self.calibration, "calibrating#using-a-calibration")
        self.target, self.run = TargetBox(state, controller), RunBox(state, controller)
        self.run.setObjectName("scan-run")
        self.frame = FrameBox(state)
        set_help(self.frame, "scanning#while-it-runs")
        set_help(self.target, "scanning#before-it-starts")
        set_help(self.run, "scanning#while-it-runs")
        self._timer = Ticker(self, FETCH_MS, controller.take_news)
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        self.middle = tabs_of(
            "Views of the scan",
            (self.forecast, "Accurac&y against time", "Expected accuracy and capture time of each plan"),
            (self.view, FRAMES, FRAMES_TIP),
            (self.effects, "Effec&ts", "Effects of light that the simulated rig renders"),
        )
        self._left, self._left_area = _side(LEFT_PX, self.plan, self.frame)
        self._figures = QGroupBox("Expected accuracy")
        column_of(on=self._figures)
        self._figures.hide()
        self._right, self._right_area = _side(RIGHT_PX, self.calibration, self.target, self.run)
        self._beside = QWidget()
        self._frames = column_of(on=self._beside, margins=0)
        self._views = splitter(Qt.Orientation.Horizontal, (self.middle, 1), (self._beside, 1))
        self._columns = row_of(self._left_area, (self._views, 1), self._right_area)
        # Below, so that no button moves when the rig is lost.
        column_of((self._columns, 1), self.banner, on=self)

    def arrange(self) -> None:
        """Show the frames next to the forecast, and all settings in one column, where there is room."""
        boxes: tuple[QGroupBox, ...] = (self.calibration, self.target, self.run)
        if self.is_small:
            # What comes next is seen without scrolling.
            boxes = (self.run, self.calibration, self.target)
        column, first = (self._left, 1) if self.is_wide else (self._right, 0)
        for place, box in enumerate(boxes, first):
            column.insertWidget(place, box)
        self._right_area.setVisible(not self.is_wide)
        self._place_plan()
        width_px = RIGHT_PX if self.is_wide else LEFT_PX
        self._left_area.set_width(TALL_PX if self.is_tall else width_px, may_grow=self.is_small)
        # In a high window the figures of the plan are in its column, and their curve takes their place.
        self._figures.setVisible(self.is_tall)
        self._left.insertWidget(self._left.count() - 1, self._figures)
        self.forecast.place_table(self._figures if self.is_tall else None)
        if self.is_wide:
            self.middle.removeTab(self.middle.indexOf(self.view))
            self._frames.addWidget(self.view, 1)
            # Below them, as the column of settings is as high as the window.
            self._frames.addWidget(self.frame)
            self._views.setSizes([1000, 1000])
            self.view.show()
        elif self.middle.indexOf(self.view) < 0:
            self._left.insertWidget(1, self.frame)
            place = self.middle.indexOf(self.forecast) + 1
            self.middle.insertTab(place, self.view, FRAMES)
            self.middle.setTabToolTip(place, plain_tip(FRAMES_TIP))
        self._beside.setVisible(self.is_wide)

    def _place_plan(self) -> None:
        """Show the plan as the first of the views where there is no room for a column of its own."""
        is_tab = self.middle.indexOf(self._left_area) >= 0
        if self.is_small and not is_tab:
            self.middle.insertTab(0, self._left_area, PLAN)
            self.middle.setTabToolTip(0, plain_tip(PLAN_TIP))
            self.middle.setCurrentIndex(0)
        elif is_tab and not self.is_small:
            self.middle.removeTab(self.middle.indexOf(self._left_area))
            self._columns.insertWidget(0, self._left_area)
            self._left_area.show()

    def _connect(self) -> None:
        state, controller = self._state, self._controller
        self.run.again.clicked.connect(self.reconstruct_requested)
        self.plan.preset_chosen.connect(controller.plans.choose_preset)
        self.plan.plan_changed.connect(self._change_plan)
        self.plan.open_requested.connect(self._open_plan)
        self.plan.save_requested.connect(self._save_plan)
        self.stops = [
            *follow_any(self._show_plan, state.plan, state.period_ms, state.longest_ms),
            state.interrupted.follow(lambda _: self._show_phase(state.phase.value)),
            state.interrupted.changed.connect(lambda _: self._show_reconnection(state.reconnection.value)),
            state.phase.follow(self._show_phase),
            state.is_reconstructing.changed.connect(lambda _: self._keep_time()),
            state.trouble.follow(self.banner.say),
            state.reconnection.follow(self._show_reconnection),
            state.result.connect(self._show_result),
            self._rendered.offered.follow(self._offer_effects),
        ]

    def _change_plan(self, plan: object) -> None:
        self._controller.plans.change_plan(plan)  # type: ignore[arg-type]
        # Show what was refused or rounded.
        self._show_plan()

    def _open_plan(self) -> None:
        folder = str(self._state.target.value.parent)
        name, _ = QFileDialog.getOpenFileName(self, "Open a plan or a pattern set", folder, PLANS)
        if name:
            self._controller.plans.open_plan(Path(name))

    def _save_plan(self) -> None:
        proposed = str(self._state.target.value.parent / "plan.json")
        path = ask_place(self, "Save the plan", proposed, PLANS)
        if path is not None:
            self._controller.plans.save_plan(path)

    def _show_plan(self) -> None:
        state = self._state
        self.plan.set_plan(state.plan.value, state.period_ms.value, state.longest_ms.value)

    def _show_phase(self, phase: Phase) -> None:
        fixed = phase.is_busy or self._state.interrupted.value is not None
        self.plan.setEnabled(not fixed)
        self.target.setEnabled(not fixed)
        self.calibration.setEnabled(not fixed)
        self.forecast.fix(fixed)
        if phase is Phase.STARTING and not self.is_wide:
            self.middle.setCurrentWidget(self.view)
        self._keep_time()

    def _show_reconnection(self, reconnection: Reconnection) -> None:
        shown = banner_controls(reconnection, self._state.interrupted.value is not None)
        show_button(self.banner.action, shown.action)
        show_button(self.stop, shown.stop)
        self._keep_time()

    def _keep_time(self) -> None:
        """Fetch the state of the scan while it may change."""
        state = self._state
        is_waiting = state.reconnection.value.is_trying or state.is_reconstructing.value
        self._timer.run_while(state.phase.value.is_busy or is_waiting)

    def _offer_effects(self, on: bool) -> None:
        """Show the Effects tab for simulated rigs only."""
        self.middle.setTabVisible(self.middle.indexOf(self.effects), on)

    def _show_result(self, path: Path) -> None:
        # Do not interrupt somebody who works on another page.
        if self.isVisible() or self._awaits_result():
            self._open_result(path)
        else:
            self._controller.offer_result(path, self._open_result)

    def showEvent(self, event: QShowEvent) -> None:
        """Refresh what may have changed on disk."""
        super().showEvent(event)
        self._state.is_seen.set(True)
        if not self._state.phase.value.is_busy:
            self._controller.plans.refresh()
            self._controller.plans.load_library()

    def event(self, event: QEvent) -> bool:
        """Refresh when a person comes back from another program, where room was made on the disk perhaps."""
        is_back = event.type() is QEvent.Type.WindowActivate
        if is_back and self.isVisible() and not self._state.phase.value.is_busy:
            self._controller.plans.refresh()
        return super().event(event)

    def hideEvent(self, event: QHideEvent) -> None:
        """What happens from now on is not seen here."""
        super().hideEvent(event)
        self._state.is_seen.set(False)

    def subject(self) -> Path | None:
        """The scan finished last."""
        return self._state.finished.value

    def open_path(self, path: Path) -> bool:
        """Open an interrupted scan, a plan or a pattern set."""
        return self._controller.open(path)

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """What the buttons do, for menus and keys."""
        return {
            "scan_start": self._controller.resume,
            "scan_pause": self.run.toggle_pause,
            "scan_stop": self._controller.cancel,
        }

    def command_line(self) -> str:
        """The command that captures this scan."""
        return self._controller.command_line()

    def figure(self) -> PlotFigure | None:
        """The curve of accuracy against time, once predicted."""
        curve = self.forecast.curve.made
        if curve is None or not curve.front():
            return None
        return PlotFigure("accuracy-against-time", curve.plot, curve.apply_theme)

    def release(self) -> None:
        """Disconnect from all state; the job runner stops the scan, whose frames are saved."""
        super().release()
        self._timer.stop()
        self.forecast.release()
        self._effects.close()
        self._controller.close()


def _side(width_px: int, *boxes: QWidget) -> tuple[QVBoxLayout, SideArea]:
    column = column_of(*boxes, STRETCH, margins=(0, 0, 4, 0))
    return column, SideArea(boxed(column), width_px)
