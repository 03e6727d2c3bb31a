"""The Start page: three ways to begin, and recent files."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QResizeEvent, QShowEvent
from PySide6.QtWidgets import QFrame, QPushButton, QStyle

from dsl_app.shared.evented import follow_any
from dsl_app.shared.settings import RecentFiles
from dsl_app.shared.widgets.forms import keep_height, label, push_button, set_role
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, scrolled
from dsl_app.shared.widgets.page import PageWidget
from dsl_app.shared.widgets.recent_list import RecentList
from dsl_app.start.examples import EXAMPLES
from dsl_app.start.unfinished import UnfinishedController
from dsl_app.start.unfinished_list import UnfinishedList

#: Height of what is shown at least, px: a third of what a window has beyond that is above it.
CONTENT_PX = 520
#: Width of a card, and that in a wide window, px.
CARD_PX, WIDE_CARD_PX, GAP_PX = 286, 380, 16
#: Width of a card at least, and what is left free around everything, px.
LEAST_CARD_PX, MARGIN_PX = 180, 12


class StartPage(PageWidget):
    """Three cards, whose buttons call what they are made with, and the files that were open last."""

    def __init__(
        self,
        recent: RecentFiles,
        open_path: Callable[[Path], object],
        show_example: Callable[[str], object],
        start_live: Callable[[], object],
        choose_rig: Callable[[], object],
        choose_file: Callable[[], object],
        import_folder: Callable[[], object],
        unfinished: UnfinishedController,
    ) -> None:
        super().__init__()
        self._unfinished = unfinished
        self.examples = {
            each.key: push_button(
                each.title, each.about, partial(show_example, each.key), "" if place else "primary"
            )
            for place, each in enumerate(EXAMPLES)
        }
        # As high as a primary button, which it is not while something else comes first.
        first = self.examples[EXAMPLES[0].key]
        keep_height(first)
        self.live = push_button(
            "Start the live view",
            "Connect the rig, expose and show its camera",
            start_live,
        )
        self.connect_rig = push_button(
            "Choose a rig…", "Open the Rig page, where installed rigs and rig profiles are listed", choose_rig
        )
        self.choose = push_button("Open a file…", "Choose the folder of a result or of a scan", choose_file)
        self.captures = push_button(
            "Import…",
            "Make a scan of pictures that another structured-light program took (Ctrl+I)",
            import_folder,
        )
        self.files = RecentList(recent, open_path)
        self.unfinished = UnfinishedList(unfinished)
        self._lay_out()
        self.stops = [
            *follow_any(self._mark_next, unfinished.found, unfinished.is_resuming, unfinished.comes_second),
            # Without recent files, what is unfinished takes their place.
            recent.paths.follow(lambda paths: self.files.setVisible(bool(paths))),
        ]

    def _mark_next(self) -> None:
        """What was interrupted comes before an example; while it continues, so does waiting for it."""
        control = self._unfinished
        others = (control.found, control.is_resuming, control.comes_second)
        is_first = not any(each.value for each in others)
        set_role(self.examples[EXAMPLES[0].key], "primary" if is_first else "")

    def showEvent(self, event: QShowEvent) -> None:
        """Look for what was interrupted, soon."""
        super().showEvent(event)
        self.unfinished.look_soon()

    def _lay_out(self) -> None:
        cards = (
            _card(
                "Look at a finished scan",
                "Scans of the simulated rig, ready to explore: point at the picture to see a spectrum with"
                " its band, click to pin it, turn the point cloud.",
                *self.examples.values(),
            ),
            _card(
                "Try the simulated rig",
                "A digital twin of the published prototype behaves like the hardware: live picture,"
                " calibration wizards, scans. Nothing has to be plugged in.",
                self.live,
            ),
            _card(
                "Connect my rig",
                "Camera, projector and, for calibrations, stage and spectroradiometer. The self-test then"
                " tells whether they are set up well.",
                self.connect_rig,
            ),
        )
        self._cards = cards
        # What is found late has a place of its own next to recent files: nothing moves under a click.
        below = row_of(
            (self.files, 0, Qt.AlignmentFlag.AlignTop),
            (self.unfinished, 0, Qt.AlignmentFlag.AlignTop),
            STRETCH,
            spacing=GAP_PX,
            margins=0,
        )
        self._column = column_of(
            label("dsl-scan", "title"),
            label("Hyperspectral 3D scans with a camera, a projector and a diffraction film", "muted"),
            14,
            row_of(*cards, spacing=GAP_PX),
            14,
            row_of(self.choose, self.captures, STRETCH),
            8,
            below,
            STRETCH,
        )
        self._middle = boxed(self._column)
        content = boxed(row_of(STRETCH, self._middle, STRETCH, margins=MARGIN_PX))
        column_of(scrolled(content), on=self, margins=0)
        self.arrange()

    def arrange(self) -> None:
        """Larger cards where there is room, and smaller ones where there is not."""
        usual = WIDE_CARD_PX if self.is_wide else CARD_PX
        # All three are seen on a small screen, too: their texts take more lines there.
        room = self.width() - 2 * MARGIN_PX - self.style().pixelMetric(QStyle.PixelMetric.PM_ScrollBarExtent)
        card = min(usual, max((room - 2 * GAP_PX) // 3, LEAST_CARD_PX))
        for each in self._cards:
            each.setFixedWidth(card)
        width = 3 * card + 2 * GAP_PX
        self._middle.setFixedWidth(width)
        for part in (self.files, self.unfinished):
            part.setFixedWidth((width - GAP_PX) // 2)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Leave room above by the height of the window alone, whatever is listed or told below."""
        super().resizeEvent(event)
        self.arrange()
        above = max((self.window().height() - CONTENT_PX) // 3, 0)
        self._column.setContentsMargins(0, above, 0, 0)


def _card(title: str, text: str, *buttons: QPushButton) -> QFrame:
    """A raised panel: what it is for, and buttons at its lower edge."""
    card = QFrame()
    card.setProperty("role", "card")
    about = label(text, wraps=True)
    about.setAlignment(Qt.AlignmentFlag.AlignTop)
    column_of(label(title, "heading"), 4, about, STRETCH, *buttons, on=card, margins=16, spacing=8)
    return card
