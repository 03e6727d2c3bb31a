"""What the page shows in place of a result: what to open, recent files, or a scan to reconstruct."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from dsl_app.shared.evented import Value
from dsl_app.shared.settings import RecentFiles
from dsl_app.shared.widgets.forms import label, push_button, set_role
from dsl_app.shared.widgets.layouts import STRETCH, Stretch, column_of, row_of
from dsl_app.shared.widgets.recent_list import RecentList

WIDTH_PX = 560
HINT = (
    "Open a result (a folder NAME.zarr) or a finished scan (NAME.dsl), or drop one on the window. The demo is"
    " a scan of a Color Checker with the simulated rig."
)
NOTHING_OPEN, AWAITED = "No result is open", "A result is being computed"
AWAITED_HINT = (
    "The result of the scan opens here when it is complete. The status bar says how long that takes."
)


class Welcome(QWidget):
    """Lists recent files; ``open_path`` opens one, ``demo`` the demo; the button ``choose`` asks for one.

    ``awaited`` is whether the result of a scan is being computed.
    """

    def __init__(
        self,
        recent: RecentFiles,
        open_path: Callable[[Path], object],
        demo: Callable[[], object],
        awaited: Value[bool],
    ) -> None:
        super().__init__()
        tip = "Choose the folder of a result or of a finished scan"
        self.choose = push_button("Open…", tip, role="primary")
        self.demo = push_button("Show the demo", "Open a finished scan of the simulated rig", lambda: demo())
        listed = RecentList(recent, open_path)
        self.files = listed.files
        self.title, self.hint = label(NOTHING_OPEN, "title"), label(HINT, "muted", wraps=True)
        buttons = row_of(self.choose, self.demo, STRETCH)
        column_of(self.title, self.hint, 6, buttons, 14, listed, on=self)
        self.setFixedWidth(WIDTH_PX)
        self.stops = [awaited.follow(self._show_awaited)]

    def _show_awaited(self, is_awaited: bool) -> None:
        """Say that the result of a scan is on its way: a person waits, and opens nothing."""
        self.title.setText(AWAITED if is_awaited else NOTHING_OPEN)
        self.hint.setText(AWAITED_HINT if is_awaited else HINT)
        set_role(self.choose, "" if is_awaited else "primary")


class Offer(QWidget):
    """A message in place of a result, with buttons to reconstruct a scan that has none."""

    def __init__(self) -> None:
        super().__init__()
        self.message = label("", "muted", wraps=True)
        self.message.setAlignment(Qt.AlignmentFlag.AlignCenter)
        tip = "Compute depth and spectra from the frames; the result is saved next to the scan"
        self.reconstruct = push_button("Reconstruct", tip, role="primary")
        self.otherwise = push_button(
            "With other parameters…", "Choose bands, solver, calibration and name first (Ctrl+R)"
        )
        self.later = push_button("Not now", "Show what was here before; the scan stays as it is")
        self._buttons = (self.reconstruct, self.otherwise, self.later)
        column_of(
            STRETCH,
            self.message,
            8,
            *((button, 0, Qt.AlignmentFlag.AlignHCenter) for button in self._buttons),
            Stretch(2),
            on=self,
        )

    def show_offer(self, message: str, can_reconstruct: bool) -> None:
        """Show a message; the buttons only where a scan can be reconstructed."""
        self.message.setText(message)
        for button in self._buttons:
            button.setVisible(can_reconstruct)
