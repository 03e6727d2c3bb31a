"""Trial pictures on the projector: fields, crosshair, checkerboard, one line; and the screen to use."""

from __future__ import annotations

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QGuiApplication, QScreen
from PySide6.QtWidgets import QFormLayout, QGroupBox, QSlider

from dsl_app.rig.state import LEVEL, panel_view
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, WholeBox, check_box, label, push_button, quiet
from dsl_app.shared.widgets.layouts import column_of, row_of
from dsl_core.devices.base import ProjectorInfo
from dsl_core.patterns.trial_pictures import KINDS, LINE_PX, PictureKind

#: How fast a looped line moves, ms a step.
LOOP_MS = 120
NO_SCREEN = "The rig's own"
#: Stands for a screen that was disconnected while it was used; choosing it changes nothing.
LOST = "lost"


class ProjectorPanel(QGroupBox):
    """Requests pictures by ``requested(kind, level, column)`` and screens by name ("" for none)."""

    requested = Signal(str, float, int)
    screen_chosen = Signal(str)
    identify = Signal()

    def __init__(self) -> None:
        super().__init__("Projector")
        self._screen = ChoiceBox("Projector screen", "The projector's screen; never the one with this window")
        # Names of screens are longer than the box.
        self._screen.view().setMinimumWidth(260)
        self._identify = push_button("Identify screens", "Show each screen's name on it for three seconds")
        self._kind = ChoiceBox("Picture", "What the projector shows")
        for kind in KINDS:
            self._kind.addItem(kind.capitalize(), kind)
        self._level = NumberBox("Intensity", 0, 1, LEVEL, decimals=2, tip="Drive level of lit parts, 0 to 1")
        self._level.setSingleStep(0.05)
        self._column = WholeBox("Line column", 0, 639, 320, "px", "First column of the line")
        self._slider = QSlider(Qt.Orientation.Horizontal)
        self._slider.setAccessibleName("Line column")
        self._slider.setToolTip("Move the line across the projector's columns")
        self._loop = check_box("Loop", "Sweep the line across the frame")
        self._timer = QTimer(self)
        self._timer.setInterval(LOOP_MS)
        self._note = label("", "muted", wraps=True)
        self._info: ProjectorInfo | None = None
        self._user = ""
        self._lay_out()
        self._connect()
        self.refresh_screens("")
        self._show_state()

    def _lay_out(self) -> None:
        line = row_of((self._slider, 1), self._loop)
        form = QFormLayout()
        form.addRow("Screen", self._screen)
        form.addRow("", self._identify)
        form.addRow("Picture", self._kind)
        form.addRow("Intensity", self._level)
        form.addRow("Line column", self._column)
        form.addRow("", line)
        column_of(form, self._note, on=self)

    def _connect(self) -> None:
        self._kind.currentIndexChanged.connect(self._ask)
        self._level.valueChanged.connect(self._ask)
        self._column.valueChanged.connect(self._slider.setValue)
        self._slider.valueChanged.connect(self._column.setValue)
        self._column.valueChanged.connect(self._line_moved)
        self._loop.toggled.connect(self._switch_loop)
        self._timer.timeout.connect(self._step)
        self._identify.clicked.connect(self.identify)
        self._screen.currentIndexChanged.connect(
            lambda _index: self.screen_chosen.emit(str(self._screen.currentData()))
        )

    def set_projector(self, info: ProjectorInfo | None) -> None:
        """Adapt to what this projector can show."""
        self._info = info
        if info is not None:
            last = info.width_px - LINE_PX
            self._column.setMaximum(last)
            self._slider.setRange(0, last)
        self._show_state()

    def set_level(self, level: float) -> None:
        """Show the intensity that is projected, whoever chose it."""
        with quiet(self._level):
            self._level.setValue(level)

    def set_user(self, title: str) -> None:
        """Leave the projector to a job of this title, whose frames a picture would spoil; empty for none."""
        self._user = title
        self._show_state()

    def _show_state(self) -> None:
        view = panel_view(self._info, self._user)
        if not view.can_show:
            self._loop.setChecked(False)
        for shown in (self._kind, self._level, self._column, self._slider, self._loop):
            shown.setEnabled(view.can_show)
        self._screen.setEnabled(view.can_choose_screen)
        self._identify.setEnabled(view.can_choose_screen)
        self._note.setText(view.note)

    def refresh_screens(self, chosen: str, lost: str = "") -> None:
        """List the current screens, and select the chosen one, or the one that is ``lost``."""
        with quiet(self._screen):
            self._screen.clear()
            self._screen.addItem(NO_SCREEN, "")
            for screen in QGuiApplication.screens():
                self._screen.addItem(_describe(screen), screen.name())
            if lost:
                self._screen.addItem(f"Disconnected: {lost}", LOST)
            index = self._screen.findData(LOST if lost else chosen)
            self._screen.setCurrentIndex(max(index, 0))

    def _ask(self) -> None:
        kind: PictureKind = self._kind.currentData()
        self.requested.emit(kind, self._level.value(), self._column.value())

    def _line_moved(self) -> None:
        if self._kind.currentData() == "line":
            self._ask()

    def _switch_loop(self, on: bool) -> None:
        if on:
            self._kind.choose("line")
            self._timer.start()
        else:
            self._timer.stop()

    def _step(self) -> None:
        following = self._column.value() + LINE_PX
        self._column.setValue(following if following <= self._column.maximum() else 0)


def _describe(screen: QScreen) -> str:
    size, ratio = screen.geometry(), screen.devicePixelRatio()
    return f"{screen.name()}, {round(size.width() * ratio)} × {round(size.height() * ratio)}"
