"""What controllers ask of the window, as protocols; no Qt, so that tests give a list instead."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Literal, Protocol

from app.state.rig import RigChoice

if TYPE_CHECKING:
    from dsl_core.patterns.trial_pictures import PictureKind

Level = Literal["info", "warning", "error"]


class Notifier(Protocol):
    """Tells the person at the window something in a sentence."""

    def tell(self, level: Level, text: str, details: str = "") -> None:
        """Show a sentence; ``details`` are there for who asks."""


class Offerer(Notifier, Protocol):
    """A notifier that can offer something to do."""

    def offer(self, text: str, offers: Mapping[str, Callable[[], object]]) -> None:
        """Show a sentence with buttons by their texts; it stays until one is used or it is closed."""


class RigCommands(Protocol):
    """What the Rig page asks for."""

    def connect(self, choice: RigChoice) -> None:
        """Open a rig."""

    def disconnect(self) -> None:
        """Close it."""

    def start_live(self) -> None:
        """Show frames as they come."""

    def stop_live(self) -> None:
        """Stop that."""

    def take_frame(self) -> None:
        """Hand over the newest frame."""

    def set_exposure(self, exposure_ms: float) -> None:
        """Expose live frames so long."""

    def expose_automatically(self, region_px: tuple[int, int, int, int] | None) -> None:
        """Find the exposure that suits a region of the picture (x, y, width, height), or all of it."""

    def show(self, kind: PictureKind, level: float = 1.0, column_px: int = 0) -> None:
        """Project a picture."""


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
