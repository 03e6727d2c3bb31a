"""The Calibrate page: the campaign's calibrations in their order, and the library below."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QBoxLayout, QFrame, QGridLayout, QGroupBox, QWidget

from dsl_app.calibrate.campaign_box import CampaignBox
from dsl_app.calibrate.library_panel import LIBRARY, LibraryPanel
from dsl_app.calibrate.presentation import main_button, row_display
from dsl_app.calibrate.state import CalibrateState, Row
from dsl_app.calibrate.wizard.step_page import LiveFrameView
from dsl_app.connection.state import RigState
from dsl_app.shared.evented import follow_any
from dsl_app.shared.widgets.deferred import Deferred
from dsl_app.shared.widgets.forms import Banner, label, push_button, show_parts
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, scrolled, splitter
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shared.widgets.ticker import Ticker

if TYPE_CHECKING:
    from dsl_app.calibrate.controller import CalibrateController
    from dsl_app.calibrate.wizard.state import Seen

#: How often the progress of a calibration of everything is fetched, ms.
FETCH_MS = 200
#: Height of the rows, as far as there is room.
ROWS_PX = 316
#: Shares of a wide window for the rows, whose figures are lines to read, and for the library.
WIDE_SHARES = (5, 4)
#: The most that a row takes where there is more room, and in a high window.
HIGHEST_PX, TALL_ROW_PX = 84, 110
#: Width of what the camera sees while everything is calibrated, and of that beside rows of a high window.
PICTURE_PX, WIDE_PICTURE_PX = 236, 480
#: No limit to a width.
LARGEST_PX = 16_777_215
_NAME_PX, _STATE_PX, _DATE_PX, _BUTTON_PX = 236, 154, 118, 100


class CalibratePage(PageWidget):
    """Follows a `CalibrateState` and asks a controller; ``home`` is where new campaigns are proposed.

    ``scan_requested`` asks for the Scan page.
    """

    scan_requested = Signal()

    def __init__(
        self, state: CalibrateState, rig: RigState, commands: CalibrateController, home: Path
    ) -> None:
        super().__init__()
        self._state, self._rig, self._commands = state, rig, commands
        self.banner = Banner(
            "Connect the campaign's rig",
            "Open the rig that the campaign was begun with",
            commands.connect_rig,
        )
        self.head = CampaignBox(state, rig, commands, home)
        self.head.scan.clicked.connect(self.scan_requested)
        self.rows = {
            row.name: CalibrationRow(row, number, self.run) for number, row in enumerate(state.rows.value, 1)
        }
        self.picture = Deferred(LiveFrameView)
        self.picture.setFixedWidth(PICTURE_PX)
        self._library = Deferred(self._make_library)
        self._timer = Ticker(self, FETCH_MS, commands.take_news)
        # Once the page is on screen, which starting workers would delay.
        self._read = QTimer(self)
        self._read.setSingleShot(True)
        self._read.setInterval(0)
        self._read.timeout.connect(self._read_again)
        self._lay_out()
        self._connect()

    def _read_again(self) -> None:
        self._commands.refresh()
        self._commands.library.load()

    def _lay_out(self) -> None:
        parts = ((row, 20) for row in self.rows.values())
        self.area = scrolled(boxed(column_of(*parts, STRETCH, margins=0, spacing=4)))
        self._top = row_of((self.area, 1), self.picture, margins=0)
        # In a high window the list of calibrations is below the rows, and their details fill the right side.
        self._listed = QGroupBox(LIBRARY)
        column_of(on=self._listed)
        top = boxed(column_of((boxed(self._top), 1), (self._listed, 1), margins=0))
        self._split = splitter(Qt.Orientation.Vertical, (top, 0), (self._library, 1), sizes=(ROWS_PX, 300))
        column_of(self.head, (self._split, 1), self.banner, on=self)
        self.arrange()

    def arrange(self) -> None:
        """Show the library next to the calibrations where there is room, else below them."""
        self._split.setOrientation(Qt.Orientation.Horizontal if self.is_wide else Qt.Orientation.Vertical)
        shares = WIDE_SHARES if self.is_wide else (0, 1)
        for place, share in enumerate(shares):
            self._split.setStretchFactor(place, share)
        self._split.setSizes(
            [self.width() * share // sum(shares) for share in shares] if self.is_wide else [ROWS_PX, 300]
        )
        if self._library.made is not None:
            self._arrange_library(self._library.made)
        self._listed.setVisible(self.is_tall)
        # They take the room that there is, up to a height at which they still read as rows.
        for row in self.rows.values():
            row.setMaximumHeight(TALL_ROW_PX if self.is_tall else HIGHEST_PX)
            # Where its button would be beyond the edge, the library still says when each was accepted.
            row.date.setVisible(not self.is_small)
        # What the camera sees is below the rows where those are narrow and alone.
        is_below, direction = self.is_wide and not self.is_tall, QBoxLayout.Direction
        self._top.setDirection(direction.TopToBottom if is_below else direction.LeftToRight)
        # Where there is most room of all, it is large enough to see what is wrong with a target.
        beside_px = WIDE_PICTURE_PX if self.is_wide else PICTURE_PX
        self.picture.setMinimumWidth(0 if is_below else beside_px)
        self.picture.setMaximumWidth(LARGEST_PX if is_below else beside_px)

    @property
    def library(self) -> LibraryPanel:
        """The calibrations kept, made when they are first seen: the rows above are read first."""
        return self._library.content

    def _make_library(self) -> LibraryPanel:
        panel = LibraryPanel(self._state, self._commands.library)
        self._arrange_library(panel)
        return panel

    def _arrange_library(self, panel: LibraryPanel) -> None:
        panel.place_table(self._listed if self.is_tall else None)
        panel.stack(self.is_wide)

    def _connect(self) -> None:
        state = self._state
        self.stops = [
            state.trouble.follow(self.banner.say),
            *follow_any(
                self._show_rows,
                state.rows,
                state.opening,
                state.everything,
                state.running,
                state.campaign,
                state.foreign,
                state.refused,
                state.library,
                state.in_use,
                self._rig.usable,
            ),
            state.everything.follow(lambda progress: self.picture.setVisible(bool(progress))),
            state.seen.follow(self._show_seen),
            # Once its row has its new words, which may need another line.
            state.running.follow(lambda name: QTimer.singleShot(0, self, lambda: self._scroll_to(name))),
            state.everything.follow(lambda progress: self._timer.run_while(bool(progress))),
        ]

    def run(self, name: str) -> None:
        """Open the wizard of a calibration; a campaign is begun first where none is open."""
        if self._state.campaign.value is None and not self.head.ask_new():
            return
        self._commands.run(name)

    def _show_rows(self) -> None:
        following = main_button(self._state, self._rig.usable.value)
        for row in self._state.rows.value:
            if row.name in self.rows:
                is_running = row.name == self._state.running.value
                running = self._state.everything.value if is_running else ""
                words = running.partition("  ·  ")[0]
                self.rows[row.name].show_row(
                    row, self._state.is_busy, words, row.name == following, self._state.opening.value
                )

    def _scroll_to(self, name: str) -> None:
        """Keep the calibration that runs in view."""
        if name in self.rows:
            self.area.ensureWidgetVisible(self.rows[name], 0, 0)

    def _show_seen(self, seen: Seen | None) -> None:
        """Show what is captured just now."""
        if self.picture.made is not None:
            self.picture.made.show_seen(seen)

    def showEvent(self, event: QShowEvent) -> None:
        """Read campaign and library again, soon: other programs may have changed them."""
        super().showEvent(event)
        self._read.start()

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """A wizard for each calibration, and all of them."""
        found: dict[str, Callable[[], object]] = {
            f"calibrate_{name}": partial(self.run, name) for name in self.rows
        }
        return found | {
            "calibrate_new": self.head.new.click,
            "calibrate_open": self.head.open.click,
            "calibrate_everything": self._commands.run_everything,
        }

    def open_path(self, path: Path) -> bool:
        """Open a campaign, or import a calibration's file into the library."""
        return self._commands.open(path)

    def command_line(self) -> str:
        """The commands that calibrate everything of this campaign, or one after the other."""
        return "\n".join(self._commands.command_line(name) for name in ("", *self.rows))

    def release(self) -> None:
        """Stop what runs; everything captured is kept."""
        super().release()
        self._timer.stop()
        self._read.stop()
        self._commands.close()


class CalibrationRow(QFrame):
    """One calibration: state, key figure, date, and the button that opens its wizard by ``run``."""

    def __init__(self, row: Row, number: int, run: Callable[[str], object]) -> None:
        super().__init__()
        self.setProperty("role", "card")
        self._title = label(f"{number}   {row.about.title}", "heading")
        self._purpose = label(row.about.purpose, "muted", wraps=True)
        self.state, self.figure, self.date = label(""), label("", wraps=True), label("", "muted")
        self.date.setToolTip("When it was accepted")
        self.reason = label("", "muted", wraps=True)
        self.run = push_button("", "", lambda: run(row.name))
        self._lay_out()
        self.show_row(row)

    def _lay_out(self) -> None:
        grid = QGridLayout(self)
        grid.setContentsMargins(12, 6, 8, 6)
        grid.setHorizontalSpacing(12)
        grid.setVerticalSpacing(1)
        # One part: a figure of two lines does not come between them.
        name = boxed(column_of(self._title, self._purpose, margins=0, spacing=1))
        grid.addWidget(name, 1, 0, 2, 1, Qt.AlignmentFlag.AlignTop)
        top: tuple[tuple[QWidget, int], ...] = (
            (self.state, _STATE_PX),
            (self.figure, 0),
            (self.date, _DATE_PX),
        )
        for column, (widget, width) in enumerate(top, 1):
            widget.setMinimumWidth(width)
            grid.addWidget(widget, 1, column, Qt.AlignmentFlag.AlignTop)
        grid.setColumnStretch(2, 1)
        grid.addWidget(self.reason, 2, 1, 1, 3, Qt.AlignmentFlag.AlignTop)
        # Both lines stay together in the middle of a high row.
        for edge in (0, 3):
            grid.setRowStretch(edge, 1)
        self.run.setFixedWidth(_BUTTON_PX)
        grid.addWidget(self.run, 0, 4, 4, 1, Qt.AlignmentFlag.AlignVCenter)
        self._purpose.setFixedWidth(_NAME_PX)

    def show_row(
        self, row: Row, is_busy: bool = False, running: str = "", is_next: bool = False, opening: str = ""
    ) -> None:
        """Show the state of the calibration; while ``is_busy`` its wizard cannot be opened."""
        show_parts(self, row_display(row, is_busy, running, is_next, opening))
        self.setAccessibleName(f"{row.about.title}: {row.state.value}. {row.reason}".strip())
