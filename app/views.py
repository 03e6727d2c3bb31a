"""What controllers ask of the window, as protocols; no Qt, so that tests give a list instead."""

from __future__ import annotations

from typing import Literal, Protocol

Level = Literal["info", "warning", "error"]


class Notifier(Protocol):
    """Tells the person at the window something in a sentence."""

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Show a sentence; ``details`` are there for who asks."""


class RecordingNotifier:
    """Keeps what it is told: for tests and scripts."""

    def __init__(self) -> None:
        self.told: list[tuple[Level, str]] = []

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Keep the sentence."""
        self.told.append((level, text))
