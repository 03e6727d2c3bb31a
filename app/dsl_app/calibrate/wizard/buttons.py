"""The buttons below a wizard: which there are on a page, and what the main one does."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QProgressBar, QPushButton, QVBoxLayout, QWidget

from dsl_app.calibrate.wizard.commands import WizardCommands
from dsl_app.calibrate.wizard.state import Doing, Told, WizardState
from dsl_app.shared.notify import describe_seconds
from dsl_app.shared.widgets.forms import label


class WizardButtons(QWidget):
    """Follows a wizard's state and asks its controller; ``left`` tells that a person wants to leave."""

    left = Signal()

    def __init__(self, state: WizardState, commands: WizardCommands) -> None:
        super().__init__()
        self._state, self._commands = state, commands
        self.leave = _button("&Leave", "Close; captures and fits stay, and nothing that was accepted changes")
        self.back = _button("&Back", "The page before")
        self.check = _button("Chec&k", "Look again and again whether the target is right")
        self.check.setCheckable(True)
        self.all = _button("Capture a&ll", "Place, look at and capture every step that is left, then fit")
        self.capture = _button("&Capture", "")
        self.stop = _button("&Stop", "Stop at the next safe point; frames taken so far are kept")
        self.next = _button("&Next", "The page after")
        self.discard = _button("&Discard fit", "Forget this fit; captures and what was accepted stay")
        self.fit = _button("&Fit", "Calibrate from the captures of all steps")
        self.accept = _button("&Accept", "Let this fit be the campaign's calibration and write down the rig")
        self._text = label("", "muted")
        self._text.setAccessibleName("What goes on")
        self._bar = QProgressBar()
        self._bar.setAccessibleName("Progress")
        self._bar.setFixedWidth(220)
        # The page above must not jump when work begins.
        policy = self._bar.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self._bar.setSizePolicy(policy)
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        work = QHBoxLayout()
        work.addWidget(self._text, 1)
        work.addWidget(self._bar)
        row = QHBoxLayout()
        row.addWidget(self.leave)
        row.addStretch(1)
        early = (self.back, self.check, self.discard, self.all, self.stop)
        for button in (*early, self.capture, self.fit, self.accept, self.next):
            row.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addLayout(work)
        column.addLayout(row)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.leave.clicked.connect(self.left)
        self.back.clicked.connect(lambda: commands.go_to(state.at.value - 1))
        self.next.clicked.connect(lambda: commands.go_to(state.at.value + 1))
        self.check.clicked.connect(commands.check)
        self.all.clicked.connect(commands.capture_all)
        self.capture.clicked.connect(commands.capture)
        self.stop.clicked.connect(commands.stop)
        self.discard.clicked.connect(commands.discard)
        self.fit.clicked.connect(commands.fit)
        self.accept.clicked.connect(commands.accept)
        self.stops = [
            *(value.changed.connect(lambda _: self.show_page()) for value in (state.at, state.doing)),
            state.statuses.changed.connect(lambda _: self.show_page()),
            state.fit.changed.connect(lambda _: self.show_page()),
            state.look.changed.connect(lambda _: self.show_page()),
            state.note.changed.connect(lambda _: self._show_work()),
            state.progress.changed.connect(lambda _: self._show_work()),
            state.is_checking.follow(self.check.setChecked),
        ]
        self._may_accept = False
        self.show_page()

    def set_acceptable(self, on: bool) -> None:
        """Whether the fit may be accepted as it is."""
        self._may_accept = on
        self.show_page()

    def show_page(self) -> None:
        """Show the buttons of the page at hand."""
        state, doing = self._state, self._state.doing.value
        at, last, status = state.at.value, state.last, state.status
        on_fit, on_step, busy = at == last, status is not None, doing.is_long
        can_stop = doing in (Doing.CAPTURING, Doing.FITTING, Doing.STOPPING)
        fit = state.fit.value
        waits = fit is not None and not fit.is_accepted
        for button, shown in (
            (self.check, on_step and not can_stop),
            (self.capture, on_step and not can_stop),
            (self.all, state.places_itself.value and bool(state.lacking) and not can_stop),
            (self.stop, can_stop),
            (self.discard, on_fit and waits and not can_stop),
            (self.fit, on_fit and not can_stop),
            (self.accept, on_fit and not can_stop),
            (self.next, not on_fit),
        ):
            button.setVisible(shown)
        self.back.setEnabled(at > 0 and not busy)
        self.next.setEnabled(not busy)
        for button in (self.check, self.capture, self.all, self.discard):
            button.setEnabled(not busy)
        self.stop.setEnabled(doing is not Doing.STOPPING)
        self.fit.setText("&Fit again" if fit is not None else "&Fit")
        self.fit.setEnabled(not busy and not state.lacking)
        self.accept.setEnabled(not busy and waits and self._may_accept)
        self.leave.setText("&Close" if fit is not None and fit.is_accepted and on_fit else "&Leave")
        self._name_capture()
        self._choose_main(on_fit)
        self._show_work()

    def _name_capture(self) -> None:
        status, look = self._state.status, self._state.look.value
        if status is not None and status.state == "captured":
            text, tip = "&Redo this step", "Capture it anew; the old capture stays until the new one is whole"
        elif look is not None and not look.is_good:
            text, tip = "&Capture anyway", "Capture although the look says that something is not right"
        else:
            text, tip = "&Capture", "Capture this step; everything is safe on disk at once"
        self.capture.setText(text)
        self.capture.setToolTip(tip)

    def _choose_main(self, on_fit: bool) -> None:
        """Mark the button that goes on, and let the return key press it."""
        state = self._state
        status, fit = state.status, state.fit.value
        main = self.next
        if status is not None and status.state != "captured":
            main = self.all if state.places_itself.value else self.capture
        elif on_fit:
            main = (
                self.leave
                if fit is not None and fit.is_accepted
                else (self.fit if fit is None else self.accept)
            )
        for button in (self.next, self.all, self.capture, self.fit, self.accept, self.leave):
            role = "primary" if button is main else ""
            if button.property("role") != role:
                button.setProperty("role", role)
                button.style().unpolish(button)
                button.style().polish(button)
        main.setDefault(True)

    def _show_work(self) -> None:
        state, told = self._state, self._state.progress.value
        busy = state.doing.value.is_long
        self._bar.setVisible(busy)
        self._bar.setRange(0, told.total)
        self._bar.setValue(told.done)
        self._text.setText(_work_words(state.doing.value, told) if busy else state.note.value)


def _work_words(doing: Doing, told: Told) -> str:
    parts = [told.stage or doing.value]
    if doing is Doing.STOPPING:
        parts = ["stopping at the next safe point"]
    elif told.total:
        parts.append(f"{told.done} of {told.total}")
        if told.remaining_s is not None and told.remaining_s >= 2:
            parts.append(f"{describe_seconds(told.remaining_s)} left")
    return " · ".join(parts)


def _button(text: str, tip: str) -> QPushButton:
    made = QPushButton(text)
    made.setToolTip(tip)
    made.setAutoDefault(False)
    return made
