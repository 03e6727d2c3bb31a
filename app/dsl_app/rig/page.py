"""The Rig page: devices at the left, the live picture in the middle, the projector at the right."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from PySide6.QtCore import QTimer, Signal
from PySide6.QtGui import QHideEvent, QShowEvent
from PySide6.QtWidgets import QFormLayout, QGroupBox, QScrollArea, QStyle

from dsl_app.connection.state import Link, RigChoice
from dsl_app.rig.controller import LiveController
from dsl_app.rig.live_view import LiveView
from dsl_app.rig.options_form import OptionsForm
from dsl_app.rig.projector_panel import ProjectorPanel
from dsl_app.rig.state import CONNECT, CONNECT_FIRST, rig_view
from dsl_app.rig.traits import TraitsReader
from dsl_app.shared.evented import follow_any
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import ChoiceBox, NumberBox, allow, label, push_button, quiet, show_parts
from dsl_app.shared.widgets.help_window import set_help
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, scrolled
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shared.widgets.ticker import Ticker
from dsl_core.capture.overexposure import full_scale_dn
from dsl_core.devices.base import DeviceRig
from dsl_core.io.rig_profile import profile_path

#: How often the newest live frame is fetched, ms.
FETCH_MS = 15
#: Widths of the columns next to the picture, and of that with its figures in a wide window, px.
SIDE_PX, WIDE_SIDE_PX, WIDEST_SIDE_PX = 268, 440, 640


#: A step of exposures that are shorter than any cycle of the LEDs.
FREE_STEP = 1.25


class ExposureBox(NumberBox):
    """An exposure in steps of whole LED cycles: steps from what is rounded would add up."""

    def stepBy(self, steps: int) -> None:
        """Go so many whole cycles on, from the one that was passed last; below the first one by shares."""
        cycle, last_digit = self.singleStep(), 10.0 ** -self.decimals()
        # What is shown is rounded: a whole number of cycles stays the one it was.
        hair = last_digit / cycle * (1 if steps > 0 else -1)
        at = self.value() / cycle + hair
        to = (math.floor(at) if steps > 0 else math.ceil(at)) + steps
        if to >= 1 and self.maximum() >= cycle:
            self.setValue(to * cycle)
            return
        share = self.value() * FREE_STEP**steps
        self.setValue(
            max(share, self.value() + last_digit) if steps > 0 else min(share, self.value() - last_digit)
        )


class RigPage(PageWidget):
    """Follows the states of rig and live view; ``selftest_requested`` asks for the self-test's wizard.

    ``scan_requested`` asks for the Scan page, ``profile_requested`` to edit the profile of a rig by its name;
    an empty one begins a new profile.
    """

    selftest_requested = Signal()
    scan_requested = Signal()
    profile_requested = Signal(str)

    def __init__(self, live: LiveController, rigs: Sequence[str], traits: TraitsReader | None = None) -> None:
        """``rigs`` are the names of installed ones; ``traits`` tells what is unusual in the connected one."""
        super().__init__()
        self._rig_commands, self._commands = live.rig, live
        self._state, self._live_state, self._traits = live.rig.state, live.state, traits
        self._looks_again = False
        #: What the form showed when it was told last what is connected.
        self._told: RigChoice | None = None
        self.stops: list[Callable[[], None]] = []
        self.live = Deferred(self._make_live)
        self.live.setObjectName("live-view")
        set_help(self.live, "rig#live-picture")
        self.projector = ProjectorPanel()
        set_help(self.projector, "rig#projector")
        self._make_choice(rigs)
        self.link = label("")
        self.trouble = label("", wraps=True)
        self.camera_text, self.projector_text = label("–"), label("–")
        self.traits = label("", "muted", wraps=True)
        self.live_button = push_button(
            "Start live view",
            "Show the camera's picture until something else needs the camera",
            self._toggle_live,
        )
        self.selftest = push_button(
            "Self-&test…",
            "Test camera, projector, timing, focus and room, with advice (F4)",
            self.selftest_requested,
        )
        self.scan = push_button(
            "Plan a scan…",
            "Open the Scan page, which says how long a scan of this scene takes",
            self.scan_requested,
        )
        self.exposure = ExposureBox(
            "Exposure", 0.01, 30_000.0, live.state.exposure_ms.value, "ms", 2, "Exposure of live frames"
        )
        self.auto = push_button(
            "&Auto exposure",
            "Find the longest exposure, in whole LED cycles, that saturates nothing important; if a region is"
            " shown, only that counts",
            self._expose,
        )
        self.cycles = label("", wraps=True)
        self._timer = Ticker(self, FETCH_MS, live.fetch_frame)
        self._show_profile()
        self._lay_out()
        self._connect()

    def _make_choice(self, rigs: Sequence[str]) -> None:
        """What chooses a rig, its options and its profile, and connects it."""
        self._rig = ChoiceBox("Rig", "The rig to connect", [(name, name) for name in rigs])
        self.options = OptionsForm()
        self._rig.currentIndexChanged.connect(lambda _: self.options.set_rig(str(self._rig.currentData())))
        self.options.set_rig(str(self._rig.currentData()))
        self.options.chosen.connect(self._change_options)
        self.new_profile = push_button(
            "&New…",
            "Put a rig together from devices that are found, and save it as a profile",
            lambda: self.profile_requested.emit(""),
        )
        self.edit_profile = push_button(
            "E&dit…",
            "Change the drivers, addresses and settings of this rig's profile",
            lambda: self.profile_requested.emit(str(self._rig.currentData())),
        )
        self._rig.currentIndexChanged.connect(lambda _: self._show_profile())
        self.connect_button = push_button("Connect", CONNECT, self._toggle_link, "primary")

    def _make_live(self) -> LiveView:
        state, made = self._live_state, LiveView()
        made.set_camera(self._state.camera, self._full_scale_dn)
        if self.is_wide:
            made.place_controls(self.beside)
        self.stops += [
            made.draw.follow(state.draw.set),
            state.frame.follow(lambda frame: made.show_frame(frame, state.drawn)),
            *follow_any(
                lambda: made.show_rig(self._state),
                *(self._state.link, self._state.live, self._state.choice, self._state.devices),
            ),
            state.counts.follow(made.show_counts),
        ]
        return made

    def _lay_out(self) -> None:
        devices = QGroupBox("Devices")
        form = QFormLayout(devices)
        form.addRow("Rig", self._rig)
        form.addRow("", row_of(self.new_profile, self.edit_profile))
        form.addRow(self.options)
        form.addRow("", self.connect_button)
        form.addRow("State", self.link)
        form.addRow(self.trouble)
        form.addRow("Camera", self.camera_text)
        form.addRow("Projector", self.projector_text)
        form.addRow(self.traits)
        form.addRow("", self.selftest)
        camera = QGroupBox("Camera")
        camera_form = QFormLayout(camera)
        camera_form.addRow("Exposure", self.exposure)
        camera_form.addRow("", self.cycles)
        camera_form.addRow("", self.auto)
        camera_form.addRow("", self.live_button)
        camera_form.addRow("", self.scan)
        # In a wide window the projector is below the camera, and figures are next to the picture; in a high
        # one they are below the projector.
        self.beside = QGroupBox("Picture")
        column_of(on=self.beside)
        self.beside.hide()
        self._camera = camera
        self._left = column_of(devices, camera, STRETCH, margins=0)
        self._right = column_of(self.projector, (self.beside, 20), STRETCH, margins=0)
        self._left_side, self._right_side = boxed(self._left), boxed(self._right)
        for side in (self._left_side, self._right_side):
            side.setFixedWidth(SIDE_PX)
        # Of a very wide window the figures get a quarter of what the left side leaves.
        self._scrolled: QScrollArea | None = None
        self._columns = row_of(self._left_side, (self.live, 3), (self._right_side, 1), on=self)

    def arrange(self) -> None:
        """Show controls and figures next to the picture where there is room."""
        self.beside.setVisible(self.is_wide)
        self._right_side.setMinimumWidth(WIDE_SIDE_PX if self.is_wide else SIDE_PX)
        self._right_side.setMaximumWidth(WIDEST_SIDE_PX if self.is_wide else SIDE_PX)
        if self.is_wide:
            self._left.insertWidget(2, self.projector)
        else:
            self._right.insertWidget(0, self.projector)
        if self.is_small:
            # The picture gets the room on the right; what comes next is seen without scrolling.
            self._left.insertWidget(0, self._camera)
            self._left.insertWidget(2, self.projector)
        else:
            self._left.insertWidget(1, self._camera)
        self._scroll_left(self.is_small)
        room_px = self.style().pixelMetric(QStyle.PixelMetric.PM_ScrollBarExtent) if self.is_small else 0
        self._left_side.setFixedWidth(WIDE_SIDE_PX if self.is_tall else SIDE_PX - room_px)
        self._right_side.setVisible(not (self.is_tall or self.is_small))
        column, place = (self._left, 3) if self.is_tall else (self._right, self._right.count() - 1)
        if self.beside.parentWidget() is not column.parentWidget():
            column.insertWidget(place, self.beside, 20)
        if self.live.made is not None:
            self.live.made.place_controls(self.beside if self.is_wide else None)

    def _scroll_left(self, on: bool) -> None:
        """Let the left side scroll, which would take more height than it needs where it need not."""
        if on and self._scrolled is None:
            self._scrolled = scrolled(self._left_side)
            self._scrolled.setFixedWidth(SIDE_PX)
            self._columns.insertWidget(0, self._scrolled)
        elif self._scrolled is not None and not on:
            self._columns.insertWidget(0, self._scrolled.takeWidget())
            self._left_side.show()
            self._scrolled.deleteLater()
            self._scrolled = None

    def _connect(self) -> None:
        state, live, commands = self._state, self._live_state, self._commands
        self.exposure.valueChanged.connect(commands.set_exposure)
        self._rig.currentIndexChanged.connect(lambda _: self._show())
        self.options.text.textChanged.connect(lambda _: self._show())
        self.options.text.returnPressed.connect(self._connect_form)
        self.projector.requested.connect(commands.show)
        # Once whoever serves the choice has made the screen the projector's.
        self.projector.screen_chosen.connect(lambda _: QTimer.singleShot(0, self, commands.show_again))
        self.stops += [
            state.choice.follow(self._show_choice),
            state.devices.follow(self._show_devices),
            state.live.follow(self._switch_timer),
            live.exposure_ms.follow(self._show_exposure),
            live.level.follow(self.projector.set_level),
            state.used_by.follow(self.projector.set_user),
            *follow_any(self._show, state.link, state.trouble, live.is_exposing),
        ]
        if self._traits is None:
            self._show_traits("")
        else:
            self.stops.append(self._traits.words.follow(self._show_traits))

    def offer_rig(self, name: str) -> None:
        """Choose a rig, which is added to the list if it is new."""
        if self._rig.findData(name) < 0:
            self._rig.addItem(name, name)
            self._rig.be_narrow()
        self._rig.choose(name)

    def _show_profile(self) -> None:
        """Only rigs of a profile can be edited."""
        has_profile = profile_path(str(self._rig.currentData())) is not None
        allow(self.edit_profile, has_profile, "This rig comes with the program and has no profile.")

    def _toggle_link(self) -> None:
        if self._state.link.value is Link.OPEN and not self._is_other:
            self._rig_commands.disconnect()
        else:
            self._connect_form()

    def _connect_form(self) -> None:
        """Connect what the form shows."""
        self._rig_commands.connect(self._choice)
        self._commands.begin_when_open()

    @property
    def _is_other(self) -> bool:
        """Whether the form was changed since it was told what is connected."""
        return self._told is not None and self._choice != self._told

    @property
    def _choice(self) -> RigChoice:
        return RigChoice(str(self._rig.currentData()), self.options.options)

    def _change_options(self) -> None:
        """Put another scene in front of a connected camera at once, unless a job needs it as it is."""
        if self._state.link.value is Link.OPEN and not self._state.used_by.value:
            self._connect_form()
        # The button says what a click on it does for what the form shows now.
        self._show()

    def _toggle_live(self) -> None:
        if self._state.live.value:
            self._commands.stop()
        else:
            self._commands.look()

    def _expose(self) -> None:
        self._commands.expose_automatically(self.live.content.region)

    def _show(self) -> None:
        told = self._state.choice.value.name
        view = rig_view(self._state, self._live_state, self._is_other, told != self._rig.currentData())
        show_parts(self, view)
        allow(self.auto, view.auto, CONNECT_FIRST)

    def _show_choice(self, choice: RigChoice) -> None:
        """Show what is connected, whichever page requested it."""
        # It may have been given by the path of its profile, or its profile may be gone.
        self.offer_rig(choice.name)
        self.options.show_options(choice.options)
        self._told = self._choice
        self._show()

    @property
    def _full_scale_dn(self) -> int | None:
        devices = self._state.devices.value
        return None if devices is None else full_scale_dn(devices)

    def _show_devices(self, devices: DeviceRig | None) -> None:
        camera = self._state.camera
        if self.live.made is not None:
            self.live.made.set_camera(camera, self._full_scale_dn)
        self.projector.set_projector(self._state.projector)
        if camera is not None:
            with quiet(self.exposure):
                # Shown to a tenth of the shortest exposure.
                self.exposure.fit(0.0, 10 * camera.exposure_range_ms[0], 2)
                self.exposure.setRange(*camera.exposure_range_ms)
        self._show_exposure(self._live_state.exposure_ms.value)
        if self._traits is not None and self.isVisible():
            self._traits.read()

    def _show_traits(self, words: str) -> None:
        self.traits.setText(words)
        self.traits.setVisible(bool(words))

    def _show_exposure(self, exposure_ms: float) -> None:
        # The box rounds; the state keeps the exact value.
        with quiet(self.exposure):
            self.exposure.setValue(exposure_ms)
            self.exposure.setSingleStep(self._state.cycle_ms or 1.0)
        self._show()

    def _switch_timer(self, is_live: bool) -> None:
        self._timer.run_while(is_live)
        self._show()

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

    def hideEvent(self, event: QHideEvent) -> None:
        """Let the camera rest while another page is open."""
        super().hideEvent(event)
        if self._state.live.value and not event.spontaneous():
            self._looks_again = True
            self._commands.stop()

    def showEvent(self, event: QShowEvent) -> None:
        """Look again, if the page was left while it did and nobody needs the rig."""
        super().showEvent(event)
        if self._traits is not None:
            self._traits.read()
        looks_again, self._looks_again = self._looks_again, False
        if looks_again and self._state.link.value is Link.OPEN and not self._state.used_by.value:
            self._commands.look()

    def release(self) -> None:
        """Stop the live view and follow nothing more."""
        super().release()
        self._timer.stop()
        self._commands.stop()
