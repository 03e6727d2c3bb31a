"""The interface of all pages, by which the main window uses them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from PySide6.QtCore import QMimeData
from PySide6.QtGui import QResizeEvent
from PySide6.QtWidgets import QWidget

from dsl_app.shared.theme import Theme
from dsl_app.shared.widgets.figure_file import PlotFigure
from dsl_app.shared.widgets.inside import apply_theme_inside, stop_following

#: A page of this width, px, has room for views and controls next to each other.
WIDE_PX = 1600
#: A wide page of this height, px, has room for everything that is set or read in one column.
TALL_PX = 1200
#: Below this width or height, px, a page has no room for three columns, or for all boxes below each other.
NARROW_PX, LOW_PX = 900, 520


class PageWidget(QWidget):
    """A page. Everything is optional: a page overrides what applies to it."""

    #: Whether the page is laid out for a wide window, for one that is high, too, or for a small screen.
    is_wide = is_tall = is_small = False

    def arrange(self) -> None:
        """Lay the page out as `is_wide`, `is_tall` and `is_small` say; called when one of them changes."""

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Lay the page out for the size that it has now."""
        super().resizeEvent(event)
        is_wide = event.size().width() >= WIDE_PX
        is_tall = is_wide and event.size().height() >= TALL_PX
        is_small = not is_wide and (event.size().width() < NARROW_PX or event.size().height() < LOW_PX)
        if (is_wide, is_tall, is_small) != (self.is_wide, self.is_tall, self.is_small):
            self.is_wide, self.is_tall, self.is_small = is_wide, is_tall, is_small
            self.arrange()

    def page_actions(self) -> dict[str, Callable[[], object]]:
        """Actions of the table, by key, that the page does while it is open."""
        return {}

    def command_line(self) -> str:
        """The command that does what the page does now; empty when there is none."""
        return ""

    def figure(self) -> PlotFigure | None:
        """The plot of the page that can be saved as a figure; None when there is none."""
        return None

    def subject(self) -> Path | None:
        """The scan or result that the page shows, for actions on it; None when there is none."""
        return None

    def open_path(self, path: Path) -> bool:
        """Open a file or folder that was chosen or dropped; False when the page cannot open it."""
        return False

    @property
    def is_reading(self) -> bool:
        """Whether what was opened last is still being read; further files wait for that."""
        return False

    def unsaved(self) -> str:
        """What would be lost if the window closed now and cannot be saved, and why; empty for nothing."""
        return ""

    def apply_theme(self, theme: Theme) -> None:
        """Apply the colours of a theme."""
        apply_theme_inside(self, theme)

    def release(self) -> None:
        """Stop following states, and release devices, files and threads, before the window closes."""
        stop_following(self)


def dropped_paths(data: QMimeData) -> list[Path]:
    """Files and folders of this computer among what is dropped."""
    return [Path(url.toLocalFile()) for url in data.urls() if url.isLocalFile()]
