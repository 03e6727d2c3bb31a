"""A calibration as a window over the page: settings, steps, fit, verdict."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import QSize, Qt, QTimer
from PySide6.QtWidgets import QDialog, QHBoxLayout, QMessageBox, QStackedWidget, QVBoxLayout, QWidget

from dsl_app.calibrate.wizard.buttons import WizardButtons
from dsl_app.calibrate.wizard.commands import WizardCommands
from dsl_app.calibrate.wizard.fit_page import FitPage
from dsl_app.calibrate.wizard.settings_page import SettingsPage
from dsl_app.calibrate.wizard.state import Doing, WizardState
from dsl_app.calibrate.wizard.step_list import StepList
from dsl_app.calibrate.wizard.step_page import StepPage
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.forms import Banner
from dsl_app.shared.widgets.help_window import add_help_key

#: How often frames and progress are fetched, ms.
FETCH_MS = 100
SMALLEST, USUAL = QSize(900, 600), QSize(1120, 720)
HELP = "calibrating"


class CalibrationWizard(QDialog):
    """Follows a `WizardState` and asks its controller; modal to the window it belongs to."""

    def __init__(self, state: WizardState, commands: WizardCommands, theme: Theme, parent: QWidget) -> None:
        super().__init__(parent)
        self._state, self._commands = state, commands
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(f"Calibrate: {state.title}")
        self.setWindowFlag(Qt.WindowType.WindowMaximizeButtonHint, True)
        self.setMinimumSize(SMALLEST)
        self.resize(_fitting(parent.window().size()))
        self.banner = Banner("Connect the rig again")
        self.banner.action.setToolTip("Open all devices of the rig anew and go on here")
        self.steps = StepList()
        self.settings, self.step, self.fit = SettingsPage(), StepPage(state), FitPage(state)
        self.stack = QStackedWidget()
        self.buttons = WizardButtons(state, commands)
        self._timer = QTimer(self)
        self._timer.setInterval(FETCH_MS)
        self._timer.timeout.connect(commands.take_news)
        self._lay_out()
        self._connect()
        self.apply_theme(theme)
        self._timer.start()

    def _lay_out(self) -> None:
        for page in (self.settings, self.step, self.fit):
            self.stack.addWidget(page)
        row = QHBoxLayout()
        row.addWidget(self.steps)
        row.addWidget(self.stack, 1)
        column = QVBoxLayout(self)
        column.addWidget(self.banner)
        column.addLayout(row, 1)
        column.addWidget(self.buttons)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.banner.action.clicked.connect(commands.reconnect)
        self.steps.chosen.connect(self._choose)
        self.settings.edited.connect(lambda key, text: commands.change_settings({key: text}))
        self.fit.settings_wanted.connect(lambda values: commands.change_settings(values, then_fit=True))
        self.fit.allowed.connect(self._show_acceptable)
        self.buttons.left.connect(self.reject)
        add_help_key(self, HELP)
        self._stops: list[Callable[[], None]] = [
            *self.step.stops,
            *self.fit.stops,
            *self.buttons.stops,
            state.statuses.follow(lambda _: self._show_steps()),
            state.fit.follow(lambda _: self._show_steps()),
            state.at.follow(self._show_page),
            state.settings.follow(self.settings.show_settings),
            state.settings_trouble.follow(self.settings.say),
            state.trouble.follow(lambda _: self._show_trouble()),
            state.can_reconnect.follow(lambda _: self._show_trouble()),
            state.doing.follow(
                lambda doing: self.settings.setEnabled(not doing.is_long or doing.value == "opening")
            ),
        ]

    def _choose(self, page: int) -> None:
        self._commands.go_to(page)
        # While something runs the page stays as it is.
        self.steps.mark(self._state.at.value)

    def _show_steps(self) -> None:
        self.steps.show_steps(self._state.statuses.value, self._state.fit.value is not None)
        self.steps.mark(self._state.at.value)
        self._show_page(self._state.at.value)
        self._show_acceptable()

    def _show_page(self, at: int) -> None:
        pages = {0: self.settings, self._state.last: self.fit}
        self.stack.setCurrentWidget(pages.get(at, self.step))
        self.steps.mark(at)

    def _show_acceptable(self) -> None:
        self.buttons.set_acceptable(self.fit.may_accept)

    def _show_doing(self, doing: Doing) -> None:
        # Reading settings anew takes a moment in which a field must not lose the focus.
        self.settings.setEnabled(doing is Doing.OPENING or not doing.is_long)

    def _show_trouble(self) -> None:
        self.banner.say(self._state.trouble.value)
        self.banner.action.setVisible(self._state.can_reconnect.value)

    def reject(self) -> None:
        """Leave; what runs is stopped only when the person agrees."""
        doing = self._state.doing.value
        if doing.is_long and not self._may_stop():
            return
        self._timer.stop()
        for stop in self._stops:
            stop()
        self._commands.leave()
        super().reject()

    def _may_stop(self) -> bool:
        answer = QMessageBox.question(
            self,
            f"{self._state.title} is {self._state.doing.value.value}",
            "Stop it and leave? Frames taken so far are kept, and the wizard goes on from here another time.",
        )
        return answer == QMessageBox.StandardButton.Yes

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        for part in (self.steps, self.step, self.fit):
            part.apply_theme(theme)


def _fitting(room: QSize) -> QSize:
    """A size for a wizard over a window: most of it, its edges still seen."""
    most = QSize(round(0.84 * room.width()), round(0.88 * room.height()))
    inside = QSize(room.width() - 40, room.height() - 40)
    return most.expandedTo(USUAL).boundedTo(inside).expandedTo(SMALLEST)
