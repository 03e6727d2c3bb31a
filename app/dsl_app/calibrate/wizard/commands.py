"""What a wizard's window asks of its controller."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol


class WizardCommands(Protocol):
    """One calibration, a step after the other."""

    def go_to(self, page: int) -> None:
        """Show a page: 0 the settings, then the steps, then the fit."""

    def check(self, on: bool) -> None:
        """Look at the step again and again, or stop that."""

    def take_news(self) -> None:
        """Bring frames and progress to the state."""

    def capture(self) -> None:
        """Capture the step that is shown, or capture it anew."""

    def capture_all(self) -> None:
        """Capture every step that lacks captures, and fit."""

    def stop(self) -> None:
        """Stop what runs."""

    def fit(self) -> None:
        """Calibrate from the captures."""

    def accept(self) -> None:
        """Accept the fit."""

    def discard(self) -> None:
        """Forget the fit."""

    def change_settings(self, values: Mapping[str, str], then_fit: bool = False) -> None:
        """Use other settings."""

    def reconnect(self) -> None:
        """Open the rig anew."""

    def leave(self) -> None:
        """End and close."""
