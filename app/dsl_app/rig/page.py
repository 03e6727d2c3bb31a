"""The Rig page: devices at the left, the live picture in the middle, the projector at the right."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QTimer, Signal
from PySide6.QtWidgets import (
    QFormLayout,
    QGroupBox,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from dsl_app.connection.controller import RigController
from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.rig.live_view import LiveView
from dsl_app.rig.projector_panel import ProjectorPanel
from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, label, set_role
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.page import PageWidget
from dsl_core.devices.base import CameraInfo, DeviceRig, ProjectorInfo

#: How often the newest live frame is fetched, ms.
FETCH_MS = 15
SIDE_PX = 268
_ROLES = {Link.OPEN: "good", Link.OPENING: "warn", Link.LOST: "bad", Link.CLOSED: "muted"}


class RigPage(PageWidget):
    """Follows a `RigState` and asks a controller; ``selftest_wanted`` asks for the self-test's wizard."""

    selftest_wanted = Signal()

    def __init__(self, state: RigState, commands: RigController, rigs: Sequence[str]) -> None:
        """``rigs`` are the names of the rigs that are installed."""
        super().__init__()
        self._state, self._commands = state, commands
        self._stops: list[Callable[[], None]] = []
        self._live = Deferred(self._make_live)
        self._live.setObjectName("live-view")
        set_help(self._live, "rig#live-picture")
        self.projector = ProjectorPanel()
        set_help(self.projector, "rig#projector")
        self._rig = ChoiceBox("Rig", "The rig to connect")
        for name in rigs:
            self._rig.addItem(name, name)
        self._options = QLineEdit()
        self._options.setAccessibleName("Options of the rig")
        self._options.setPlaceholderText("scene=color-checker size=445x290")
        self._options.setToolTip("Options as key=value, separated by spaces; see Help on this page")
        self._connect_button = QPushButton("Connect")
        self._connect_button.setProperty("role", "primary")
        self._connect_button.setToolTip("Open the devices of this rig, or let them go")
        self._light = label("")
        self._trouble = label("")
        self._trouble.setProperty("role", "bad")
        self._trouble.setWordWrap(True)
        self._camera_text, self._projector_text = label("–"), label("–")
        self._live_button = QPushButton("Start live view")
        self._live_button.setToolTip("Look through the camera until it is needed for something else")
        self.selftest = QPushButton("Self-&test…")
        self.selftest.setToolTip("Test camera, projector, timing, focus and room, and say what to do (F4)")
        self.selftest.clicked.connect(self.selftest_wanted)
        low, high = 0.01, 30_000.0
        self._exposure = NumberBox(
            "Exposure", low, high, state.exposure_ms.value, "ms", 2, "Exposure of live frames"
        )
        self.auto = QPushButton("&Auto exposure")
        self.auto.setToolTip(
            "Expose as long as nothing that matters saturates, for whole LED cycles; only the region counts,"
            " where one is shown"
        )
        self._cycles = label("", "muted")
        self._cycles.setWordWrap(True)
        self._timer = QTimer(self)
        self._timer.setInterval(FETCH_MS)
        self._timer.timeout.connect(commands.take_frame)
        self._lay_out()
        self._connect()

    @property
    def live(self) -> LiveView:
        """What the camera sees."""
        return self._live.content

    def _make_live(self) -> LiveView:
        state, made = self._state, LiveView()
        made.set_camera(state.camera)
        self._stops += [state.frame.follow(made.show_frame), state.counts.follow(made.show_counts)]
        return made

    def _lay_out(self) -> None:
        devices = QGroupBox("Devices")
        form = QFormLayout(devices)
        form.addRow("Rig", self._rig)
        form.addRow("Options", self._options)
        form.addRow("", self._connect_button)
        form.addRow("State", self._light)
        form.addRow(self._trouble)
        form.addRow("Camera", self._camera_text)
        form.addRow("Projector", self._projector_text)
        form.addRow("", self.selftest)
        camera = QGroupBox("Camera")
        camera_form = QFormLayout(camera)
        camera_form.addRow("Exposure", self._exposure)
        camera_form.addRow("", self._cycles)
        camera_form.addRow("", self.auto)
        camera_form.addRow("", self._live_button)
        left, right = QWidget(), QWidget()
        for side, boxes in ((left, (devices, camera)), (right, (self.projector,))):
            side.setFixedWidth(SIDE_PX)
            column = QVBoxLayout(side)
            column.setContentsMargins(0, 0, 0, 0)
            for box in boxes:
                column.addWidget(box)
            column.addStretch(1)
        row = QHBoxLayout(self)
        row.addWidget(left)
        row.addWidget(self._live, 1)
        row.addWidget(right)

    def _connect(self) -> None:
        state, commands = self._state, self._commands
        self._connect_button.clicked.connect(self._toggle_link)
        self._live_button.clicked.connect(self._toggle_live)
        self._exposure.valueChanged.connect(commands.set_exposure)
        self.auto.clicked.connect(self._expose)
        self.projector.wanted.connect(commands.show)
        self._stops += [
            state.choice.follow(self._show_choice),
            state.link.follow(self._show_link),
            state.devices.follow(self._show_devices),
            state.trouble.follow(self._show_trouble),
            state.live.follow(self._show_live),
            state.exposure_ms.follow(self._show_exposure),
            state.used_by.follow(self.projector.set_user),
            state.is_exposing.follow(lambda _: self._show_auto()),
        ]

    def _toggle_link(self) -> None:
        if self._state.link.value is Link.OPEN:
            self._commands.disconnect()
            return
        self._commands.connect(RigChoice(str(self._rig.currentData()), parse_options(self._options.text())))

    def _toggle_live(self) -> None:
        if self._state.live.value:
            self._commands.stop_live()
        else:
            self._commands.start_live()

    def _expose(self) -> None:
        self._commands.expose_automatically(self.live.region)

    def _show_choice(self, choice: RigChoice) -> None:
        """Show what is connected, whoever asked for it."""
        self._rig.setCurrentIndex(max(self._rig.findData(choice.name), 0))
        self._options.setText(" ".join(f"{key}={value}" for key, value in choice.options))

    def _show_link(self, link: Link) -> None:
        self._light.setText(f"● {link.value}")
        set_role(self._light, _ROLES[link])
        self._connect_button.setText("Disconnect" if link is Link.OPEN else "Connect")
        self._connect_button.setEnabled(link is not Link.OPENING)

    def _show_devices(self, devices: DeviceRig | None) -> None:
        camera, projector = self._state.camera, self._state.projector
        self._camera_text.setText("–" if camera is None else _describe(camera))
        self._projector_text.setText("–" if projector is None else _describe(projector))
        if self._live.made is not None:
            self._live.made.set_camera(camera)
        self.projector.set_projector(projector)
        self._live_button.setEnabled(devices is not None)
        self.selftest.setEnabled(devices is not None)
        self._exposure.setEnabled(devices is not None)
        self._show_exposure(self._state.exposure_ms.value)
        self._show_auto()
        if camera is not None:
            self._exposure.setRange(*camera.exposure_range_ms)

    def _show_exposure(self, exposure_ms: float) -> None:
        # The box shows two decimals; what was asked for stays exact.
        self._exposure.blockSignals(True)
        self._exposure.setValue(exposure_ms)
        self._exposure.setSingleStep(self._state.cycle_ms or 1.0)
        self._exposure.blockSignals(False)
        text = cycles_text(exposure_ms, self._state.cycle_ms)
        self._cycles.setText(text)
        self._cycles.setVisible(bool(text))

    def _show_auto(self) -> None:
        self.auto.setEnabled(self._state.devices.value is not None and not self._state.is_exposing.value)

    def _show_trouble(self, text: str) -> None:
        self._trouble.setText(text)
        self._trouble.setVisible(bool(text))

    def _show_live(self, on: bool) -> None:
        self._live_button.setText("Stop live view" if on else "Start live view")
        if on:
            self._timer.start()
        else:
            self._timer.stop()

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """What the buttons do, for menus and keys."""
        return {
            "rig_connect": self._toggle_link,
            "rig_live": self._toggle_live,
            "rig_expose": self._expose,
        }

    def command_line(self) -> str:
        """How the command line tests this rig."""
        return f"dsl-scan selftest {self._state.choice.value.command}"

    def apply_theme(self, theme: Theme) -> None:
        """Take the colours of a theme."""
        self._live.apply_theme(theme)

    def release(self) -> None:
        """Stop looking and let the devices go."""
        for stop in self._stops:
            stop()
        self._timer.stop()
        self._commands.stop_live()


def _describe(info: CameraInfo | ProjectorInfo) -> str:
    return f"{info.model}\n{info.width_px} × {info.height_px} px"


def parse_options(text: str) -> tuple[tuple[str, str], ...]:
    """Options from ``key=value`` texts separated by spaces; a word without ``=`` is switched on."""
    pairs = [part.partition("=") for part in text.split()]
    return tuple((key, value if sign else "on") for key, sign, value in pairs)


def cycles_text(exposure_ms: float, cycle_ms: float | None) -> str:
    """How many LED cycles an exposure holds, and what is wrong with a part of one.

    >>> cycles_text(50.0, 1000 / 60)
    '3 LED cycles'
    """
    if not cycle_ms:
        return ""
    cycles = exposure_ms / cycle_ms
    whole = round(cycles)
    # The box rounds to a hundredth of a millisecond.
    if whole and abs(exposure_ms - whole * cycle_ms) < 0.006:
        return f"{whole} LED cycle{'' if whole == 1 else 's'}"
    return f"{cycles:.2f} LED cycles: colours vary"
