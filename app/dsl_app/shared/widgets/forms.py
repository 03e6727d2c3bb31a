"""Form controls that behave alike everywhere: units, no accidental wheel changes, accessible names."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar

from PySide6.QtCore import QLocale, QObject, Qt, SignalInstance
from PySide6.QtGui import QKeyEvent, QStandardItemModel, QValidator, QWheelEvent
from PySide6.QtWidgets import (
    QAbstractButton,
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFrame,
    QLabel,
    QProgressBar,
    QPushButton,
    QSpinBox,
    QStyle,
    QWidget,
)

from dsl_app.shared.plain_tip import plain_tip, text_of_tip
from dsl_app.shared.widget_state import ButtonState, LabelState
from dsl_app.shared.widgets.layouts import row_of
from dsl_app.shared.wording import in_window

W = TypeVar("W", bound=QWidget)
#: A function or signal that a click calls.
Clicked = Callable[..., object] | SignalInstance | None
#: By how much a primary button is higher than its text, px.
PRIMARY_MORE_PX = 12
#: How numbers are written in all widgets, as in all texts: other digits beside these would be a riddle.
NUMBERS = QLocale.c()
#: Where a button keeps the tooltip that it has while it can be pressed.
_OWN_TIP = "own-tip"
_SCROLL = QStyle.PixelMetric.PM_ScrollBarExtent

# A class has one base of Qt at most, so at run time the mixin is a plain class.
if TYPE_CHECKING:
    _Base = QWidget
else:
    _Base = object


class CalmWheel(_Base):
    """Mixin before a widget class: the wheel changes the value only while the widget has the focus."""

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Scroll the page instead, unless the widget has the focus."""
        if self.hasFocus():
            super().wheelEvent(event)
        else:
            event.ignore()


class NumberBox(CalmWheel, QDoubleSpinBox):
    """A number with its unit, written with a point as in all texts; a comma that is typed is a point, too.

    In the language of the system, Qt would leave the other sign out: 55.5 ms would become 555 ms.
    """

    def __init__(
        self,
        name: str,
        low: float,
        high: float,
        value: float,
        unit: str = "",
        decimals: int = 2,
        tip: str = "",
    ) -> None:
        super().__init__()
        self.setLocale(NUMBERS)
        self.setRange(low, high)
        self.setDecimals(decimals)
        self.setValue(value)
        self.setKeyboardTracking(False)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        named(self, name, tip or name)
        if unit:
            self.setSuffix(f" {unit}")

    def fit(self, low: float, high: float, decimals: int) -> None:
        """Take values of a span: far beyond its end, and to a hundredth of it; at least these decimals."""
        span = high - low
        self.setDecimals(max(decimals, 2 - math.floor(math.log10(span))) if span > 0 else decimals)
        self.setMaximum(max(self.maximum(), 10 * high))

    def validate(self, text: str, place: int) -> tuple[QValidator.State, str, int]:
        """Take a comma for the point that it means."""
        return super().validate(text.replace(",", "."), place)


class WholeBox(CalmWheel, QSpinBox):
    """A whole number with its unit."""

    def __init__(self, name: str, low: int, high: int, value: int, unit: str = "", tip: str = "") -> None:
        super().__init__()
        self.setLocale(NUMBERS)
        self.setRange(low, high)
        self.setValue(value)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        named(self, name, tip or name)
        if unit:
            self.setSuffix(f" {unit}")


class ChoiceBox(CalmWheel, QComboBox):
    """A choice of a list of texts, each with the data that it stands for."""

    def __init__(
        self,
        name: str,
        tip: str = "",
        choices: Iterable[tuple[str, object]] = (),
        do: Callable[[Any], object] | None = None,
    ) -> None:
        """``do`` gets the data of an entry that a person chooses."""
        super().__init__()
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        named(self, name, tip or name)
        for text, data in choices:
            self.addItem(text, data)
        if do is not None:
            self.activated.connect(lambda index: do(self.itemData(index)))

    def choose(self, data: object) -> None:
        """Show the entry of some data as the chosen one."""
        self.setCurrentIndex(self.findData(data))

    def offer(self, data: object, offered: bool) -> None:
        """Let the entry of some data be chosen, or not."""
        model = self.model()
        assert isinstance(model, QStandardItemModel)
        model.item(self.findData(data)).setEnabled(offered)

    def be_narrow(self, least_px: int = 80) -> None:
        """Let the box be narrower than its longest entry, which its list still shows whole."""
        self.setMinimumWidth(least_px)
        self.view().setMinimumWidth(self.view().sizeHintForColumn(0) + self.style().pixelMetric(_SCROLL))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Emit ``activated`` for an entry found by typing, too; Qt does so only for the arrow keys."""
        before = self.currentIndex()
        super().keyPressEvent(event)
        if self.currentIndex() != before and event.text().isprintable() and event.text():
            self.activated.emit(self.currentIndex())


def label(
    text: str, role: str = "", wraps: bool = False, name: str = "", can_be_copied: bool = False
) -> QLabel:
    """A label in a role of the style sheet (muted, title, heading, good, warn, bad); may break its lines.

    Screen readers tell the ``name`` before the text. The text is never read as markup: it may come from a
    file of a stranger.
    """
    made = QLabel()
    made.setTextFormat(Qt.TextFormat.PlainText)
    made.setText(text)
    made.setWordWrap(wraps)
    made.setAccessibleName(name)
    if can_be_copied:
        made.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
    if role:
        made.setProperty("role", role)
    return made


def remark_line() -> QLabel:
    """A label for the current status; hidden, it still takes up one line, so that nothing below it moves."""
    made = label(" ", "muted", wraps=True)
    policy = made.sizePolicy()
    policy.setRetainSizeWhenHidden(True)
    made.setSizePolicy(policy)
    return made


def push_button(text: str, tip: str, do: Clicked = None, role: str = "") -> QPushButton:
    """A button with its tooltip, what a click does, and its role of the style sheet."""
    made = QPushButton(text)
    made.setToolTip(plain_tip(tip))
    if do is not None:
        made.clicked.connect(do)
    if role:
        made.setProperty("role", role)
    return made


def keep_height(*buttons: QPushButton) -> None:
    """Make buttons as high as a primary one, which they are at times: nothing around them moves then."""
    for button in buttons:
        button.setMinimumHeight(button.fontMetrics().height() + PRIMARY_MORE_PX)


def check_box(text: str, tip: str) -> QCheckBox:
    """A check box with its tooltip."""
    made = QCheckBox(text)
    made.setToolTip(plain_tip(tip))
    return made


def named(widget: W, name: str, tip: str = "") -> W:
    """A widget with the name that screen readers tell, and its tooltip."""
    widget.setAccessibleName(name)
    if tip:
        widget.setToolTip(plain_tip(tip))
    return widget


def progress_bar(name: str) -> QProgressBar:
    """A bar that tells how far work has come, per cent, with the name that screen readers tell."""
    made = named(QProgressBar(), name)
    made.setLocale(NUMBERS)
    return made


@contextmanager
def quiet(*objects: QObject) -> Iterator[None]:
    """Change objects without their signals."""
    before = [(each, each.blockSignals(True)) for each in objects]
    try:
        yield
    finally:
        for each, was_blocked in before:
            each.blockSignals(was_blocked)


def show_button(button: QAbstractButton, state: ButtonState) -> None:
    """Draw a button as it was decided."""
    if state.text is not None:
        button.setText(state.text)
    if state.tip is not None:
        button.setToolTip(plain_tip(state.tip))
        button.setProperty(_OWN_TIP, None)
    if state.name is not None:
        button.setAccessibleName(state.name)
    button.setVisible(state.is_visible)
    allow(button, state.is_enabled, state.why)
    set_role(button, "primary" if state.is_primary else "")


def allow(button: QWidget, on: bool, why: str = "") -> None:
    """Let a button be pressed or a value be set; else its tooltip begins with the reason ``why`` not."""
    button.setEnabled(on)
    own = button.property(_OWN_TIP)
    if not on and why:
        if own is None:
            own = text_of_tip(button.toolTip())
            button.setProperty(_OWN_TIP, own)
        button.setToolTip(plain_tip(f"{why} {own}"))
    elif own is not None:
        button.setToolTip(plain_tip(own))


def show_label(line: QLabel, state: LabelState) -> None:
    """Draw a label as it was decided."""
    # One that keeps its line while it is hidden needs a text to know how high that is.
    line.setText(in_window(state.text) or " " * line.sizePolicy().retainSizeWhenHidden())
    line.setToolTip(plain_tip(state.tip))
    line.setVisible(bool(state.text))
    set_role(line, state.role)


def show_parts(page: QWidget, view: Any) -> None:
    """Draw a record that was decided without Qt: each of its fields on the part of a page with its name.

    A plain text is that of a label; a truth value says whether the part can be used.
    """
    for field in fields(view):
        part = getattr(page, field.name)
        match getattr(view, field.name):
            case ButtonState() as state:
                show_button(part, state)
            case LabelState() as state:
                show_label(part, state)
            case bool(is_enabled):
                part.setEnabled(is_enabled)
            case text:
                part.setText(text)


def set_role(widget: QWidget, role: str) -> None:
    """Give a widget another role and let the style sheet see it."""
    if widget.property("role") != role:
        widget.setProperty("role", role)
        # What was never on screen is styled when it comes there: doing so twice makes a page late.
        if widget.testAttribute(Qt.WidgetAttribute.WA_WState_Polished):
            widget.style().unpolish(widget)
            widget.style().polish(widget)


class Banner(QFrame):
    """A message across the page that stays until it is resolved; ``action`` is the button that does that."""

    def __init__(self, action: str, tip: str, do: Clicked) -> None:
        super().__init__()
        self.setProperty("role", "banner")
        self._text = label("", wraps=True, can_be_copied=True)
        self._text.setTextFormat(Qt.TextFormat.PlainText)
        self.action = push_button(action, tip, do)
        self._row = row_of((self._text, 1), self.action, on=self, margins=(12, 8, 8, 8))
        self.say("")

    def add_button(self, text: str, tip: str, do: Clicked) -> QPushButton:
        """Another button, after ``action``."""
        button = push_button(text, tip, do)
        self._row.addWidget(button)
        return button

    @property
    def text(self) -> str:
        """The message that is shown."""
        return self._text.text()

    def say(self, text: str) -> None:
        """Show a sentence, or hide for none."""
        text = in_window(text)
        self._text.setText(text)
        self.setAccessibleName(text)
        self.setVisible(bool(text))
