"""What the Scan page asks of its controllers."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from dsl_app.scan.state import CalibrationChoice
from dsl_core.model.plan import CapturePlan


class PlanCommands(Protocol):
    """The scan before it is taken."""

    def choose_preset(self, key: str) -> None:
        """Take the plan of a preset."""

    def change_plan(self, plan: CapturePlan) -> None:
        """Take a plan of any kind."""

    def open_plan(self, path: Path) -> None:
        """Plan what a file says."""

    def save_plan(self, path: Path) -> None:
        """Write the plan into a file."""

    def set_target(self, target: Path) -> None:
        """Store the scan there."""

    def load_library(self) -> None:
        """List the calibrations of the library."""

    def choose_calibration(self, choice: CalibrationChoice) -> None:
        """Scan with a calibration."""

    def set_override(self, on: bool) -> None:
        """Use it although settings differ."""

    def refresh(self) -> None:
        """Say anew what the plan takes."""


class ScanCommands(Protocol):
    """The scan while it is taken."""

    @property
    def plans(self) -> PlanCommands:
        """What is planned."""

    def start(self) -> None:
        """Start, or go on with the interrupted session."""

    def resume(self) -> None:
        """Go on with the interrupted session, connecting a rig before that was lost."""

    def stop_reconnecting(self) -> None:
        """Connect a rig no more that was lost."""

    def pause(self) -> None:
        """Wait before the next frame."""

    def go_on(self) -> None:
        """Go on after `pause`."""

    def cancel(self) -> None:
        """End before the next frame."""

    def take_news(self) -> None:
        """Hand over what happened meanwhile."""

    def point_at(self, pixel: tuple[int, int] | None) -> None:
        """Show the intensity graph of a pixel."""

    def open(self, path: Path) -> bool:
        """Offer to go on with an interrupted scan."""

    def leave_session(self) -> None:
        """Plan a new scan."""

    def command_line(self) -> str:
        """The command that does the same."""

    def close(self) -> None:
        """Follow the rig no more."""
