"""How controllers tell the person at the window something, and sentences that several of them use. No Qt."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, Protocol

from dsl_app.shared.wording import in_window
from dsl_core.errors import DslError

Level = Literal["info", "warning", "error"]

NO_RIG = "No rig is connected. Connect one on the Rig page."


class Notifier(Protocol):
    """Tells the person at the window something in a sentence."""

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Show a sentence, with ``details`` on request."""

    def offer(self, text: str, offers: Mapping[str, Callable[[], object]], stay_s: float = 0.0) -> None:
        """Show a sentence with buttons by their texts until one is used or it is closed.

        With ``stay_s`` it leaves by itself after that time.
        """

    def withdraw(self, text: str) -> None:
        """Take a sentence back, if it is still there: it has lost its sense."""


def sentence_of(error: Exception) -> str:
    """What went wrong, for people."""
    return in_window(str(error)) if isinstance(error, DslError) else f"{type(error).__name__}: {error}"


def describe_seconds(seconds: float) -> str:
    """A duration as people say it: ``45 s``, ``3 min``, ``1 h 20 min``."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"
