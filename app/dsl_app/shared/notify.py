"""How controllers tell the person at the window something; no Qt, so that tests keep a list instead."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, Protocol

Level = Literal["info", "warning", "error"]


class Notifier(Protocol):
    """Tells the person at the window something in a sentence."""

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Show a sentence; ``details`` are there for who asks."""


class Offerer(Notifier, Protocol):
    """A notifier that can offer something to do."""

    def offer(self, text: str, offers: Mapping[str, Callable[[], object]]) -> None:
        """Show a sentence with buttons by their texts; it stays until one is used or it is closed."""


class RecordingNotifier:
    """Keeps what it is told: for tests and scripts."""

    def __init__(self) -> None:
        self.told: list[tuple[Level, str]] = []
        self.offers: dict[str, Callable[[], object]] = {}

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Keep the sentence."""
        self.told.append((level, text))

    def offer(self, text: str, offers: Mapping[str, Callable[[], object]]) -> None:
        """Keep the sentence and what it offers."""
        self.told.append(("info", text))
        self.offers.update(offers)
