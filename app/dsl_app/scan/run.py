"""The right side of the Scan page: calibration, target, cost, start and progress."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import (
    QCheckBox,
    QFileDialog,
    QFormLayout,
    QGroupBox,
    QLineEdit,
    QPushButton,
)

from dsl_app.scan.command_line import named_target
from dsl_app.scan.controller import ScanController
from dsl_app.scan.controls import NO_SCAN, RESUME, progress_text, run_controls
from dsl_app.scan.forecast.figures import minutes, volume
from dsl_app.scan.reconstruction_time import about
from dsl_app.scan.state import CalibrationChoice, Facts, Phase, ScanState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.known_files import breakable
from dsl_app.shared.paths import there
from dsl_app.shared.widgets.forms import (
    ChoiceBox,
    allow,
    check_box,
    label,
    named,
    progress_bar,
    push_button,
    set_role,
    show_parts,
)
from dsl_app.shared.widgets.layouts import column_of, row_of
from dsl_core.capture.runner import Status
from dsl_core.io.neighbours import result_beside
from dsl_core.model.plan import Columns


class CalibrationBox(QGroupBox):
    """The calibration that the scan uses."""

    def __init__(self, state: ScanState, controller: ScanController) -> None:
        super().__init__("Calibration")
        self._state, self._controller = state, controller
        self.choice = ChoiceBox("Calibration in use", "The rig's own calibration, or one from the library")
        self.override = QCheckBox("Use despite different settings")
        self.override.setToolTip("Scan with this calibration despite the differences listed below")
        self._remark = label("", "warn", wraps=True)
        column_of(self.choice, self.override, self._remark, on=self)
        self.choice.activated.connect(self._choose)
        self.override.toggled.connect(controller.plans.set_override)
        self.stops = [
            *follow_any(self._list, state.calibrations, state.interrupted),
            state.calibration.follow(self._mark),
            state.refused.connect(lambda _: self._mark(state.calibration.value)),
            state.override.follow(self.override.setChecked),
            state.facts.follow(self._show_facts),
        ]

    def _list(self) -> None:
        self.choice.clear()
        session = self._state.interrupted.value
        for each in self._state.calibrations.value if session is None else ():
            self.choice.addItem(each.text, each.key)
        if session is not None:
            # It is resumed with its own, whatever the next scan uses.
            self.choice.addItem(session.calibration)
        self._mark(self._state.calibration.value)

    def _mark(self, chosen: CalibrationChoice) -> None:
        # A resumed scan has one of its own alone.
        own = self._state.interrupted.value is not None
        self.choice.setCurrentIndex(0 if own else self.choice.findData(chosen.key))

    def _choose(self, index: int) -> None:
        self._controller.plans.choose_calibration(self._state.calibrations.value[index])

    def _show_facts(self, facts: Facts | None) -> None:
        self.override.setVisible(facts is not None and (facts.settings_differ or self.override.isChecked()))
        remarks = () if facts is None else facts.remarks
        self._remark.setText("\n".join(remarks))
        self._remark.setVisible(bool(remarks))


class TargetBox(QGroupBox):
    """Where the scan is saved and what it costs."""

    def __init__(self, state: ScanState, controller: ScanController) -> None:
        super().__init__("Save in")
        self._state, self._controller = state, controller
        self.name = named(QLineEdit(), "Name of the scan", "Name of the scan's folder, NAME.dsl")
        self.folder = push_button("Folder…", "Choose the folder in which scans are saved", self._browse)
        self._where = label("", "muted", wraps=True)
        self._frames, self._time, self._then, self._disk = label("–"), label("–"), label(""), label("–")
        self._split = label("", "muted")
        row = row_of((self.name, 1), self.folder)
        form = QFormLayout(self)
        form.addRow(row)
        form.addRow(self._where)
        for title, widget in (
            ("Frames", self._frames),
            ("Time", self._time),
            ("", self._then),
            ("Disk", self._disk),
        ):
            form.addRow(title, widget)
        form.addRow("", self._split)
        # A scan that is started by a key takes the name as far as it is typed.
        self.name.textEdited.connect(controller.name_scan)
        self.name.editingFinished.connect(self._show_name)
        self.stops = [
            state.target.follow(self._show_target),
            state.facts.follow(self._show_facts),
            *follow_any(self._show_then, state.reconstruction_s, state.then_reconstruct, state.facts),
        ]

    def _browse(self) -> None:
        target = self._state.target.value
        name = QFileDialog.getExistingDirectory(self, "Save scans in", str(target.parent))
        if name:
            self._controller.plans.set_target(Path(name) / target.name)

    def _show_target(self, target: Path) -> None:
        # Whoever types keeps the text and the place in it.
        if not self.name.text().strip() or named_target(target.parent, self.name.text()) != target:
            self._show_name()
        self._where.setText(f"in {breakable(target.parent)}")

    def _show_name(self) -> None:
        self.name.setText(self._state.target.value.stem)

    def _show_then(self) -> None:
        expected_s, facts = self._state.reconstruction_s.value, self._state.facts.value
        follows = self._state.then_reconstruct.value and (facts is None or facts.is_calibrated)
        self._then.setText(f"then {about(expected_s)} to reconstruct" if expected_s and follows else "")

    def _show_facts(self, facts: Facts | None) -> None:
        if facts is None:
            return
        plan = self._state.plan.value
        self._frames.setText(str(facts.frames))
        kind = "designed" if isinstance(plan.spectral, Columns) else "line"
        self._split.setText(f"{plan.code_count} code, {plan.spectral_count} {kind} patterns")
        self._time.setText(f"{minutes(facts.seconds)} on the rig")
        self._disk.setText(f"{volume(facts.needed_bytes)} of {volume(facts.free_bytes)} free")
        set_role(self._disk, "bad" if facts.free_bytes < facts.needed_bytes else "")


class RunBox(QGroupBox):
    """Start, pause, cancel, and progress."""

    def __init__(self, state: ScanState, controller: ScanController) -> None:
        super().__init__("Scan")
        self._state, self._controller = state, controller
        self.connect_rig = push_button(
            "Connect the rig",
            "Open the devices of the rig that is chosen on the Rig page",
            controller.connect_rig,
        )
        tip = "Capture all frames of the plan; each is saved before the next is captured"
        self.start = push_button("Start sca&n", tip, controller.start)
        self.resume = push_button("Resume sca&n", RESUME, controller.start)
        self.pause = push_button("&Pause", "Pause before the next frame; nothing is lost", self.toggle_pause)
        self.cancel = push_button("Cance&l", "Stop after the current frame; the scan can be resumed later")
        self.renew = push_button("Plan a ne&w scan", "Keep the interrupted scan on disk and plan another")
        self.again = QPushButton("Reconstruct a&gain…")
        self.again.setToolTip("Reconstruct the finished scan with other parameters, without scanning again")
        self.drift = check_box(
            "Check for movement first",
            "Capture two old frames again and compare before resuming. Without this check, a scan whose scene"
            " or light has changed is resumed and its frames do not fit together",
        )
        self.meter = check_box(
            "Match exposures to the scene",
            "Measure white first, and scale all exposures of the preset so that it is neither overexposed nor"
            " dark. Exposures that you choose yourself, or open from a file, are kept",
        )
        self.then = QCheckBox("Reconstruct at the end")
        self.then.setToolTip("Reconstruct and open the result as soon as all frames are saved")
        self.phase, self.frames, self.time = label(""), label(""), label("")
        self._bar = progress_bar("Progress of the scan")
        self.remarks = label("", wraps=True)
        self._lay_out()
        self.cancel.clicked.connect(controller.cancel)
        self.renew.clicked.connect(controller.plan_new_scan)
        self.then.toggled.connect(state.then_reconstruct.set)
        self.drift.toggled.connect(state.check_drift.set)
        self.meter.toggled.connect(state.meters.set)
        self.stops = [
            state.then_reconstruct.follow(self.then.setChecked),
            state.check_drift.follow(self.drift.setChecked),
            state.meters.follow(self.meter.setChecked),
            *follow_any(self._show_meter, state.plan, state.plan_file, state.interrupted, state.period_ms),
            *follow_any(
                self._show,
                state.phase,
                state.interrupted,
                state.facts,
                state.note,
                state.finished,
                state.trouble,
                state.is_reconstructing,
                state.is_seen,
                state.lacks_calibration,
                state.calibrations,
            ),
            state.status.follow(self._show_status),
        ]

    def _lay_out(self) -> None:
        buttons = row_of(self.pause, self.cancel)
        column_of(
            self.then,
            self.meter,
            self.drift,
            self.connect_rig,
            self.start,
            self.resume,
            buttons,
            self.renew,
            self.again,
            self.phase,
            self._bar,
            self.frames,
            self.time,
            self.remarks,
            on=self,
        )

    def toggle_pause(self) -> None:
        """Pause, or continue."""
        self._controller.pause(self._state.phase.value is not Phase.PAUSED)

    def _show(self) -> None:
        state = self._state
        finished = state.finished.value
        # It may have been reconstructed from another page.
        has_result = finished is not None and there(result_beside(finished))
        shown = run_controls(
            state.phase.value,
            state.interrupted.value,
            state.facts.value,
            state.note.value,
            finished is not None,
            has_result,
            state.trouble.value,
            state.is_reconstructing.value,
            state.lacks_calibration.value and not state.has_library,
        )
        show_parts(self, shown)
        allow(self.cancel, shown.cancel, NO_SCAN)
        facts = state.facts.value
        # What is ticked is remembered for the next scan that has a calibration.
        self.then.setEnabled(facts is None or facts.is_calibrated)

    def _show_meter(self) -> None:
        self.meter.setVisible(self._state.interrupted.value is None)
        self.meter.setEnabled(self._state.can_be_metered)

    def _show_status(self, status: Status) -> None:
        self._bar.setRange(0, max(status.total, 1))
        self._bar.setValue(status.done)
        self._bar.setVisible(status.total > 0)
        show_parts(self, progress_text(status))
