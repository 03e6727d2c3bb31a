"""What labels and buttons show, decided without Qt; `show_parts` of the forms sets them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ButtonState:
    """What a button shows; a text, tip or name of None leaves the one that it was made with.

    ``why`` is said before the tip while the button cannot be pressed. ``is_primary`` marks the button that
    does what a person most likely wants next. Screen readers tell the ``name`` in place of the text.
    """

    is_visible: bool = True
    is_enabled: bool = True
    is_primary: bool = False
    text: str | None = None
    tip: str | None = None
    name: str | None = None
    why: str = ""


@dataclass(frozen=True)
class LabelState:
    """What a label shows, hidden while it has no text; ``role`` is one of the style sheet."""

    text: str = ""
    role: str = ""
    tip: str = ""
