"""The right side of the Scan page: calibration, target, what it takes, start, and how far it is."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtWidgets import (
    QCheckBox,
    QFileDialog,
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
)

from dsl_app.scan.commands import ScanCommands
from dsl_app.scan.forecast.words import minutes, volume
from dsl_app.scan.state import CalibrationChoice, Facts, Phase, ScanState
from dsl_app.shared.notify import describe_seconds
from dsl_app.shared.widgets.forms import ChoiceBox, label, set_role
from dsl_core.capture.status import Status
from dsl_core.model.plan import Columns

_PHASE_ROLES = {Phase.LOST: "bad", Phase.DONE: "good", Phase.PAUSED: "warn", Phase.STOPPED: "warn"}


class CalibrationBox(QGroupBox):
    """The calibration that the scan uses."""

    def __init__(self, state: ScanState, commands: ScanCommands) -> None:
        super().__init__("Calibration")
        self._state, self._commands = state, commands
        self.choice = ChoiceBox("Calibration in use", "The rig's own, or one of the library")
        self.override = QCheckBox("Use it although settings differ")
        self.override.setToolTip("Scan with this calibration in spite of the differences named below")
        self._remark = label("", "warn")
        self._remark.setWordWrap(True)
        column = QVBoxLayout(self)
        for widget in (self.choice, self.override, self._remark):
            column.addWidget(widget)
        self.choice.activated.connect(self._choose)
        self.override.toggled.connect(commands.plans.set_override)
        self.stops = [
            state.calibrations.follow(self._list),
            state.calibration.follow(self._mark),
            state.override.follow(self.override.setChecked),
            state.facts.follow(self._show_facts),
        ]

    def _list(self, choices: tuple[CalibrationChoice, ...]) -> None:
        self.choice.clear()
        for each in choices:
            self.choice.addItem(each.text, each.key)
        self._mark(self._state.calibration.value)

    def _mark(self, chosen: CalibrationChoice) -> None:
        self.choice.setCurrentIndex(max(self.choice.findData(chosen.key), 0))

    def _choose(self, index: int) -> None:
        self._commands.plans.choose_calibration(self._state.calibrations.value[index])

    def _show_facts(self, facts: Facts | None) -> None:
        self.override.setVisible(facts is not None and (facts.settings_differ or self.override.isChecked()))
        remarks = () if facts is None else facts.remarks
        self._remark.setText("\n".join(remarks))
        self._remark.setVisible(bool(remarks))


class TargetBox(QGroupBox):
    """Where the scan is stored and what it takes."""

    def __init__(self, state: ScanState, commands: ScanCommands) -> None:
        super().__init__("Store in")
        self._state, self._commands = state, commands
        self.name = QLineEdit()
        self.name.setAccessibleName("Name of the scan")
        self.name.setToolTip("Name of the folder that the scan makes, NAME.dsl")
        self.folder = QPushButton("Folder…")
        self.folder.setToolTip("Choose the folder in which the scan is stored")
        self._where = label("", "muted")
        self._where.setWordWrap(True)
        self._frames, self._time, self._disk = label("–"), label("–"), label("–")
        self._split = label("", "muted")
        row = QHBoxLayout()
        row.addWidget(self.name, 1)
        row.addWidget(self.folder)
        form = QFormLayout(self)
        form.addRow(row)
        form.addRow(self._where)
        for title, widget in (("Frames", self._frames), ("Time", self._time), ("Disk", self._disk)):
            form.addRow(title, widget)
        form.addRow("", self._split)
        self.name.editingFinished.connect(self._rename)
        self.folder.clicked.connect(self._browse)
        self.stops = [state.target.follow(self._show_target), state.facts.follow(self._show_facts)]

    def _rename(self) -> None:
        text = self.name.text().strip()
        target = self._state.target.value
        if text and text != target.stem:
            self._commands.plans.set_target(target.parent / text.replace("/", "-"))

    def _browse(self) -> None:
        target = self._state.target.value
        name = QFileDialog.getExistingDirectory(self, "Store scans in", str(target.parent))
        if name:
            self._commands.plans.set_target(Path(name) / target.name)

    def _show_target(self, target: Path) -> None:
        self.name.setText(target.stem)
        # Zero-width spaces let long paths break at their slashes.
        self._where.setText(f"in {str(target.parent).replace('/', '/' + chr(0x200B))}")

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
    """Start, pause, cancel, and how far the scan is."""

    def __init__(self, state: ScanState, commands: ScanCommands) -> None:
        super().__init__("Scan")
        self._state, self._commands = state, commands
        self.start = QPushButton("&Start scan")
        self.start.setProperty("role", "primary")
        self.start.setToolTip("Take every frame of the plan; each is safe on disk before the next is taken")
        self.pause = QPushButton("&Pause")
        self.pause.setToolTip("Wait before the next frame; nothing is lost")
        self.cancel = QPushButton("&Cancel")
        self.cancel.setToolTip("End after the frame at hand; what is stored can be resumed")
        self.renew = QPushButton("Plan a &new scan")
        self.renew.setToolTip("Leave the interrupted scan as it is on disk")
        self.again = QPushButton("Reconstruct a&gain…")
        self.again.setToolTip("Make a result of the finished scan with other parameters, without scanning")
        self.drift = QCheckBox("Compare old frames first")
        self.drift.setToolTip(
            "Take two old frames again before going on. Without it the scan goes on although scene or light"
            " changed; half of it then shows something else"
        )
        self.then = QCheckBox("Reconstruct at the end")
        self.then.setToolTip("Make and open the result as soon as all frames are stored")
        self._phase, self._what, self._time = label(""), label("", "muted"), label("", "muted")
        self._bar = QProgressBar()
        self._bar.setAccessibleName("Progress of the scan")
        self._text = label("", "muted")
        self._text.setWordWrap(True)
        self._lay_out()
        self.start.clicked.connect(commands.start)
        self.pause.clicked.connect(self.toggle_pause)
        self.cancel.clicked.connect(commands.cancel)
        self.renew.clicked.connect(commands.leave_session)
        self.then.toggled.connect(state.then_reconstruct.set)
        self.drift.toggled.connect(state.check_drift.set)
        self.stops = [
            state.then_reconstruct.follow(self.then.setChecked),
            state.check_drift.follow(self.drift.setChecked),
            state.phase.follow(lambda _: self._show()),
            state.interrupted.follow(lambda _: self._show()),
            state.facts.follow(lambda _: self._show()),
            state.note.follow(lambda _: self._show()),
            state.finished.follow(lambda _: self._show()),
            state.status.follow(self._show_status),
        ]

    def _lay_out(self) -> None:
        buttons = QHBoxLayout()
        for button in (self.pause, self.cancel):
            buttons.addWidget(button)
        column = QVBoxLayout(self)
        column.addWidget(self.then)
        column.addWidget(self.drift)
        column.addWidget(self.start)
        column.addLayout(buttons)
        column.addWidget(self.renew)
        column.addWidget(self.again)
        for widget in (self._phase, self._bar, self._what, self._time, self._text):
            column.addWidget(widget)

    def toggle_pause(self) -> None:
        """Pause, or go on."""
        if self._state.phase.value is Phase.PAUSED:
            self._commands.go_on()
        else:
            self._commands.pause()

    def _show(self) -> None:
        phase, session, facts = (
            self._state.phase.value, self._state.interrupted.value, self._state.facts.value,
        )  # fmt: skip
        self.start.setText("&Start scan" if session is None else "&Resume scan")
        obstacles = () if facts is None or phase.is_busy else facts.obstacles
        self.start.setEnabled(not phase.is_busy and not obstacles)
        self.pause.setText("&Go on" if phase is Phase.PAUSED else "&Pause")
        self.pause.setEnabled(phase in (Phase.RUNNING, Phase.PAUSED))
        self.cancel.setEnabled(phase.is_busy and phase is not Phase.STOPPING)
        for widget in (self.renew, self.drift):
            widget.setVisible(session is not None and not phase.is_busy)
        self.again.setVisible(self._state.finished.value is not None and not phase.is_busy)
        ready = phase is not Phase.PLANNING or not obstacles
        self._phase.setText(f"● {phase.value}" if ready else "● not ready")
        set_role(self._phase, _PHASE_ROLES.get(phase, "muted"))
        lines = list(obstacles)
        if session is not None and not phase.is_busy:
            lines.insert(0, f"{session.folder.name} holds {session.done} of {session.total} frames.")
        if self._state.note.value:
            lines.append(self._state.note.value)
        self._text.setText("\n".join(lines))
        self._text.setVisible(bool(lines))
        set_role(self._text, "warn" if obstacles else "muted")

    def _show_status(self, status: Status) -> None:
        self._bar.setRange(0, max(status.total, 1))
        self._bar.setValue(status.done)
        self._bar.setVisible(status.total > 0)
        for widget in (self._what, self._time):
            widget.setVisible(status.total > 0)
        self._what.setText(f"{status.done} of {status.total} frames stored")
        spent, left = describe_seconds(status.elapsed_s), describe_seconds(status.remaining_s)
        self._time.setText(f"took {spent}" if status.state.is_final else f"{spent} so far, {left} left")
