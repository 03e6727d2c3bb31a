"""How a button is drawn, decided without Qt; `show_button` of the forms sets it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ButtonState:
    """What a button shows; a text or tip of None leaves the one that it was made with.

    ``is_primary`` marks the button that does what a person most likely wants next.
    """

    is_visible: bool = True
    is_enabled: bool = True
    is_primary: bool = False
    text: str | None = None
    tip: str | None = None
