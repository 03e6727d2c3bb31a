"""A calibration as a window over the page: steps at the left, the page, and buttons below."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QDialog,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QStackedWidget,
    QWidget,
)

from dsl_app.calibrate.wizard.fit_page import FitPage
from dsl_app.calibrate.wizard.presentation import (
    Buttons,
    PageLine,
    activity,
    buttons,
    leaving_text,
    page_before,
    page_lines,
)
from dsl_app.calibrate.wizard.settings_page import SettingsPage
from dsl_app.calibrate.wizard.state import Doing, WizardState
from dsl_app.calibrate.wizard.step_page import StepPage
from dsl_app.shared.evented import follow_any
from dsl_app.shared.plain_tip import plain_tip
from dsl_app.shared.theme import DARK, Theme
from dsl_app.shared.widgets.dialogs import confirm
from dsl_app.shared.widgets.forms import (
    Banner,
    check_box,
    label,
    named,
    progress_bar,
    push_button,
    quiet,
    show_button,
)
from dsl_app.shared.widgets.help_window import add_help_key
from dsl_app.shared.widgets.inside import apply_theme_inside, stop_following
from dsl_app.shared.widgets.layouts import STRETCH, column_of, row_of
from dsl_app.shared.widgets.ticker import Ticker

if TYPE_CHECKING:
    from dsl_app.calibrate.wizard.controller import WizardController

#: How often frames and progress are fetched, ms.
FETCH_MS = 100
SMALLEST, USUAL = QSize(900, 600), QSize(1120, 720)
HELP = "calibrating"
LIST_PX, BAR_PX = 250, 220


class CalibrationWizard(QDialog):
    """Follows a `WizardState` and asks its controller; modal to the window it belongs to."""

    def __init__(self, state: WizardState, commands: WizardController, theme: Theme, parent: QWidget) -> None:
        super().__init__(parent)
        self._state, self._commands = state, commands
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setWindowTitle(f"Calibrate: {state.title}")
        self.setWindowFlag(Qt.WindowType.WindowMaximizeButtonHint, True)
        room = parent.window().size()
        self.setMinimumSize(SMALLEST.boundedTo(room))
        self.resize(_fitting(room))
        self.banner = Banner(
            "Connect the rig again", "Open all devices of the rig again and continue here", commands.reconnect
        )
        # The return key presses the main button of the page, not the first that is in the dialog.
        self.banner.action.setAutoDefault(False)
        self.steps = PageList()
        self.settings, self.step, self.fit = SettingsPage(), StepPage(state), FitPage(state)
        self.stack = QStackedWidget()
        self.buttons = WizardButtons(state, commands)
        self._timer = Ticker(self, FETCH_MS, commands.take_news)
        self._lay_out()
        self._connect()
        self.apply_theme(theme)
        self._timer.start()

    def _lay_out(self) -> None:
        for page in (self.settings, self.step, self.fit):
            self.stack.addWidget(page)
        row = row_of(self.steps, (self.stack, 1))
        # Where it comes, nothing moves that a person clicks.
        column_of((row, 1), self.banner, self.buttons, on=self)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.steps.chosen.connect(self._choose)
        self.settings.edited.connect(lambda key, text: commands.change_settings({key: text}))
        self.fit.settings_requested.connect(lambda values: commands.change_settings(values, then_fit=True))
        self.buttons.leave.clicked.connect(self.reject)
        self.buttons.following.clicked.connect(self._go_on)
        add_help_key(self, HELP)
        self.stops = [
            *follow_any(self._show_steps, state.statuses, state.fit),
            state.at.changed.connect(lambda _: self._show_page()),
            state.settings.follow(self.settings.show_settings),
            state.settings_trouble.follow(self.settings.say),
            state.trouble.follow(self.banner.say),
            state.can_reconnect.follow(self._offer_reconnection),
            state.doing.follow(self._show_doing),
        ]

    def _choose(self, page: int) -> None:
        self._commands.go_to(page)
        # While something runs the page stays as it is.
        self.steps.mark(self._state.at.value)

    def _show_steps(self) -> None:
        self.steps.show_pages(page_lines(self._state))
        self._show_page()

    def _show_page(self) -> None:
        at = self._state.at.value
        pages = {0: self.settings, self._state.last: self.fit}
        self.stack.setCurrentWidget(pages.get(at, self.step))
        self.steps.mark(at)

    def _offer_reconnection(self, on: bool) -> None:
        self.banner.action.setVisible(on)
        # What the return key presses; the buttons below have none that is blue meanwhile.
        self.banner.action.setDefault(on)

    def _show_doing(self, doing: Doing) -> None:
        # Reading settings again takes a moment in which a field must not lose the focus.
        self.settings.setEnabled(doing is Doing.OPENING or not doing.is_long)

    def reject(self) -> None:
        """Leave; what runs is stopped only if the person agrees."""
        if self._state.doing.value.is_long and not self._may_stop():
            return
        self._timer.stop()
        stop_following(self)
        self._commands.leave()
        super().reject()

    def _go_on(self) -> None:
        """Leave for the calibration that comes next."""
        self._state.goes_on = True
        self.reject()

    def _may_stop(self) -> bool:
        return confirm(
            self,
            f"{self._state.title} is {self._state.doing.value.value}",
            leaving_text(self._state),
            go="Stop and leave",
            stay="Stay",
        )

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        apply_theme_inside(self, theme)


def _fitting(room: QSize) -> QSize:
    """A size for a wizard over a window: most of it, with its edges still visible."""
    most = QSize(round(0.84 * room.width()), round(0.88 * room.height()))
    inside = QSize(room.width() - 40, room.height() - 40)
    return most.expandedTo(USUAL).boundedTo(inside).expandedTo(SMALLEST.boundedTo(room))


class PageList(QListWidget):
    """The pages of a wizard: steps, fit, settings; ``chosen`` tells the page that a person chose."""

    chosen = Signal(int)

    def __init__(self) -> None:
        super().__init__()
        self._theme, self._lines = DARK, tuple[PageLine, ...]()
        named(self, "Steps", "Steps of this calibration: ○ to capture, ✓ captured, ✗ refused")
        self.setFixedWidth(LIST_PX)
        self.setSpacing(2)
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.currentRowChanged.connect(self._choose)

    def _choose(self, row: int) -> None:
        if row >= 0:
            self.chosen.emit(self._lines[row].page)

    def show_pages(self, lines: tuple[PageLine, ...]) -> None:
        """Show the state of every step; the current page stays."""
        self._lines = lines
        row = self.currentRow()
        with quiet(self):
            self.clear()
            for line in lines:
                item = QListWidgetItem(line.text)
                item.setForeground(QColor(getattr(self._theme, line.role or "text")))
                item.setToolTip(plain_tip(line.tip))
                item.setData(Qt.ItemDataRole.AccessibleTextRole, line.accessible_text)
                self.addItem(item)
            self.setCurrentRow(max(row, 0))

    def mark(self, page: int) -> None:
        """Show a page as the current one."""
        rows = [row for row, line in enumerate(self._lines) if line.page == page]
        with quiet(self):
            self.setCurrentRow(rows[0] if rows else -1)

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._theme = theme
        self.show_pages(self._lines)


class WizardButtons(QWidget):
    """The buttons of every page, and above them what the wizard is doing."""

    def __init__(self, state: WizardState, commands: WizardController) -> None:
        super().__init__()
        self._state, self._commands = state, commands
        self.leave = _button("&Leave", "Close the wizard; captures, fits and what was accepted are kept")
        self.back = _button("&Back", "Show the previous page")
        self.check = _button("Chec&k", "Check repeatedly whether the target is right")
        self.check.setCheckable(True)
        self.itself = check_box(
            "Capture by itself", "While checking, capture a target that is right, in its outline and still"
        )
        self.itself.setChecked(True)
        self.all = _button("Capture a&ll", "Place, look at and capture every step that is left, then fit")
        self.capture = _button("&Capture", "")
        self.stop = _button("&Stop", "Stop at the next safe point; frames captured so far are kept")
        self.next = _button("&Next", "Show the next page")
        self.discard = _button("&Discard fit", "Discard this fit; captures and what was accepted are kept")
        self.fit = _button("&Fit", "Calibrate from the captures of all steps")
        self.accept = _button("&Accept", "Make this fit the campaign's calibration and write the rig")
        self.following = _button("&Next", "Close this wizard and open that of the next calibration")
        self._text = label("", "muted", name="Current activity")
        self._bar = progress_bar("Progress")
        self._bar.setFixedWidth(BAR_PX)
        # The page above must not jump when work begins; a sentence has the whole width when it has ended.
        self._text.setMinimumHeight(self._bar.sizeHint().height())
        self._lay_out()
        self._connect()

    def _lay_out(self) -> None:
        work = row_of((self._text, 1), self._bar)
        early = (self.back, self.itself, self.check, self.discard, self.all, self.stop)
        late = (self.capture, self.fit, self.accept, self.next, self.following)
        row = row_of(self.leave, STRETCH, *early, *late)
        column_of(work, row, on=self, margins=0)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self.back.clicked.connect(lambda: commands.go_to(page_before(state)))
        self.next.clicked.connect(lambda: commands.go_to(state.at.value + 1))
        self.check.clicked.connect(commands.check)
        self.itself.toggled.connect(commands.capture_itself)
        self.all.clicked.connect(commands.capture_all)
        self.capture.clicked.connect(commands.capture)
        self.stop.clicked.connect(commands.stop)
        self.discard.clicked.connect(commands.discard)
        self.fit.clicked.connect(commands.fit)
        self.accept.clicked.connect(commands.accept)
        shown = (
            *(state.at, state.doing, state.statuses, state.fit, state.allowed, state.look),
            *(state.outlines, state.places_itself, state.trouble, state.can_reconnect),
        )
        self.stops = [
            *follow_any(self._show, *shown),
            *follow_any(self._show_activity, state.note, state.progress),
            state.is_checking.follow(self.check.setChecked),
        ]

    def _show(self) -> None:
        shown = buttons(self._state)
        for each in fields(Buttons):
            button, how = getattr(self, each.name), getattr(shown, each.name)
            show_button(button, how)
            if how.is_primary and isinstance(button, QPushButton):
                button.setDefault(True)
        self._show_activity()

    def _show_activity(self) -> None:
        shown = activity(self._state)
        self._bar.setVisible(shown.is_busy)
        self._bar.setRange(0, shown.total)
        self._bar.setValue(shown.done)
        self._text.setText(shown.text)
        self._text.setToolTip(plain_tip(shown.text))


def _button(text: str, tip: str) -> QPushButton:
    made = push_button(text, tip)
    made.setAutoDefault(False)
    return made
