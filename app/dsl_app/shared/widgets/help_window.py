"""The help window, and which help page explains a widget."""

from __future__ import annotations

import re
from pathlib import Path

from PySide6.QtCore import QSize, Qt, QUrl
from PySide6.QtGui import QKeySequence, QShortcut, QTextBlock, QTextCursor
from PySide6.QtWidgets import (
    QDialog,
    QLineEdit,
    QListWidget,
    QListWidgetItem,
    QPushButton,
    QTextBrowser,
    QWidget,
)

from dsl_app.shared.widgets.forms import Clicked, label, named, push_button, quiet
from dsl_app.shared.widgets.layouts import STRETCH, boxed, column_of, row_of, splitter
from dsl_core.errors import StoreError
from dsl_core.resources import resource_path

FOLDER = "help"
SEARCH_PX = 270
#: Room right of the titles of pages, px.
LIST_MARGIN_PX = 16
#: The pages in reading order; others follow.
ORDER = (
    "rig",
    "calibrating",
    "scanning",
    "accuracy-against-time",
    "designed-patterns",
    "effects-of-the-twin",
    "reconstructing-again",
    "collections",
    "numbers",
    "materials",
    "hard-cases",
    "reading-an-intensity-graph",
    "comparing",
    "exporting",
    "scripting",
    "importing",
    "connecting-devices",
    "adding-a-rig",
    "adding-a-format",
    "files",
    "how-it-measures",
    "glossary",
)
_PROPERTY = "help"


def set_help(widget: QWidget, topic: str) -> None:
    """F1 on a widget or anything in it opens this topic: ``PAGE`` or ``PAGE#heading-in-small-letters``."""
    widget.setProperty(_PROPERTY, topic)


def help_of(widget: QWidget | None) -> str:
    """The topic of a widget or of the nearest one around it; empty where there is none."""
    while widget is not None:
        topic = widget.property(_PROPERTY)
        if topic:
            return str(topic)
        widget = widget.parentWidget()
    return ""


def add_help_key(window: QWidget, topic: str) -> None:
    """Add F1 to a separate window, which the shortcuts of the main window do not reach."""
    set_help(window, topic)
    key = QShortcut(QKeySequence(Qt.Key.Key_F1), window)
    key.activated.connect(lambda: help_window(help_of(window.focusWidget() or window), window).open())


def help_window(topic: str, parent: QWidget) -> HelpWindow:
    """A help window at a topic."""
    window = HelpWindow(parent)
    window.show_topic(topic)
    return window


class HelpWindow(QDialog):
    """All pages on the left, one on the right; Back and Forward as in a browser."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self.setModal(False)
        self.setWindowTitle("Help")
        # A window's frame needs some of a small screen.
        self.resize(QSize(960, 720).boundedTo(self.screen().availableSize() * 0.92))
        self.pages = named(QListWidget(), "Help pages", "All pages of the help")
        self.pages.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.text = named(QTextBrowser(), "Help", "Links open other pages (Alt+Left goes back)")
        self.text.setOpenExternalLinks(True)
        self.text.document().setDocumentMargin(14)
        self.back = _button("&Back", "Previous page (Alt+Left)", self.text.backward, "Alt+Left")
        self.forward = _button("&Forward", "Next page (Alt+Right)", self.text.forward, "Alt+Right")
        self.close_button = _button("&Close", "Close the help (Escape)", self.accept)
        tip = "Lists only pages that contain all of these words; Enter shows where, again the next place"
        self.search = named(QLineEdit(), "Search the help", tip)
        self.search.setPlaceholderText("Search")
        self.search.setClearButtonEnabled(True)
        self.search.setMaximumWidth(SEARCH_PX)
        self.search.textChanged.connect(lambda _: self._filter())
        self.search.returnPressed.connect(self.find_next)
        self.nothing = label("No page contains all of these words. Try fewer or other words.", wraps=True)
        self.nothing.hide()
        for page in help_pages():
            item = QListWidgetItem(title_of(page))
            item.setData(Qt.ItemDataRole.UserRole, page.stem)
            self.pages.addItem(item)
        self._lay_out()
        self.pages.currentItemChanged.connect(self._choose)
        self.text.backwardAvailable.connect(self.back.setEnabled)
        self.text.forwardAvailable.connect(self.forward.setEnabled)
        self.text.sourceChanged.connect(self._arrived)
        for button in (self.back, self.forward):
            button.setEnabled(False)

    def _lay_out(self) -> None:
        head = row_of((self.search, 1), self.back, self.forward, STRETCH, self.close_button)
        # The longest title is read whole.
        width = self.pages.sizeHintForColumn(0) + 4 * self.pages.frameWidth() + LIST_MARGIN_PX
        sizes = (width, self.width() - width)
        left = boxed(column_of(self.nothing, (self.pages, 1), margins=0))
        parts = splitter(Qt.Orientation.Horizontal, (left, 0), (self.text, 1), sizes=sizes)
        column_of(head, (parts, 1), on=self)

    @property
    def page(self) -> str:
        """Name of the page that is shown."""
        return Path(self.text.source().path()).stem

    def show_topic(self, topic: str) -> None:
        """Show a page, at one of its headings if the topic names one; shows an error if it is missing."""
        name, _, heading = topic.partition("#")
        try:
            url = QUrl.fromLocalFile(str(resource_path(f"{FOLDER}/{name}.md")))
        except StoreError as error:
            self.text.setPlainText(str(error))
            return
        url.setFragment(heading)
        self.text.setSource(url)

    @property
    def _words(self) -> list[str]:
        return self.search.text().lower().split()

    def _filter(self) -> None:
        texts = {page.stem: page.read_text(encoding="utf-8").lower() for page in help_pages()}
        hits = 0
        for i in range(self.pages.count()):
            item = self.pages.item(i)
            text = texts[str(item.data(Qt.ItemDataRole.UserRole))]
            is_hit = all(word in text for word in self._words)
            item.setHidden(not is_hit)
            hits += is_hit
        self.nothing.setVisible(hits == 0)

    def find_next(self) -> None:
        """Show the next place of the first word, on a listed page."""
        listed = [item for i in range(self.pages.count()) if not (item := self.pages.item(i)).isHidden()]
        if not listed or not self._words:
            return
        if self.pages.currentItem() not in listed:
            self.pages.setCurrentItem(listed[0])
        if not self.text.find(self._words[0]):
            self.text.moveCursor(QTextCursor.MoveOperation.Start)
            self.text.find(self._words[0])

    def _choose(self, item: QListWidgetItem | None) -> None:
        if item is not None and item.data(Qt.ItemDataRole.UserRole) != self.page:
            self.show_topic(str(item.data(Qt.ItemDataRole.UserRole)))

    def _arrived(self, url: QUrl) -> None:
        name = Path(url.path()).stem
        for i in range(self.pages.count()):
            item = self.pages.item(i)
            if item.data(Qt.ItemDataRole.UserRole) == name:
                with quiet(self.pages):
                    self.pages.setCurrentItem(item)
                self.setWindowTitle(f"Help – {item.text()}")
        if url.fragment():
            self._scroll_to(url.fragment())

    def _scroll_to(self, heading: str) -> None:
        """Show a heading at the top; Markdown has no anchors of its own."""
        block: QTextBlock = self.text.document().begin()
        while block.isValid():
            if block.blockFormat().headingLevel() and slug(block.text()) == heading:
                self.text.moveCursor(QTextCursor.MoveOperation.End)
                self.text.setTextCursor(QTextCursor(block))
                return
            block = block.next()


def help_pages() -> list[Path]:
    """Files of all pages, in the order of reading."""
    found = {path.stem: path for path in sorted(resource_path(FOLDER).glob("*.md"))}
    first = [found[name] for name in ORDER if name in found]
    return [*first, *(path for name, path in found.items() if name not in ORDER)]


def title_of(page: Path) -> str:
    """The first heading of a page."""
    first = page.read_text(encoding="utf-8").splitlines()[0]
    return first.lstrip("# ").strip()


def slug(heading: str) -> str:
    """A heading as links name it.

    >>> slug("Pins, regions, references")
    'pins-regions-references'
    """
    return re.sub(r"[^\w]+", "-", heading.lower()).strip("-")


def _button(text: str, tip: str, do: Clicked, keys: str = "") -> QPushButton:
    button = push_button(text, tip, do)
    button.setAutoDefault(False)
    button.setShortcut(QKeySequence(keys))
    return button
