"""What the Calibrate page asks of its controllers."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol


class LibraryCommands(Protocol):
    """The calibrations of this computer; ``key`` is a name, or NAME@STAMP of one version."""

    @property
    def must_be_placed(self) -> bool:
        """Whether a person has to place the target of a drift check."""

    def load(self) -> None:
        """List every version."""

    def use(self, key: str) -> None:
        """Scan with a calibration from now on."""

    def restore(self, name: str, stamp: str) -> None:
        """Make a version the current one."""

    def export(self, key: str, target: Path, form: str, overwrite: bool) -> None:
        """Write it for another computer or program."""

    def take_in(self, path: Path) -> None:
        """Take a file into the library."""

    def report(self, key: str) -> None:
        """Show the report."""

    def check(self, key: str, spectralon: bool = True, override: bool = False) -> None:
        """Compare the rig with it by one quick shot, although settings differ where that is overridden."""


class CalibrateCommands(Protocol):
    """Campaigns and their calibrations."""

    @property
    def library(self) -> LibraryCommands:
        """The calibrations of this computer."""

    def open(self, path: Path) -> bool:
        """Open a campaign, or take a calibration's file."""

    def open_campaign(self, folder: Path) -> None:
        """Open a campaign that was begun before."""

    def begin_campaign(self, folder: Path) -> None:
        """Begin a campaign of the rig at hand."""

    def connect_rig(self) -> None:
        """Connect the campaign's own rig."""

    def refresh(self) -> None:
        """Read anew where everything stands."""

    def run(self, name: str) -> None:
        """Open the wizard of a calibration."""

    def run_everything(self) -> None:
        """Run all of them in order."""

    def cancel_everything(self) -> None:
        """Stop that."""

    def keep(self) -> None:
        """Keep the rig as far as it is calibrated in the library."""

    def take_news(self) -> None:
        """Say how far everything is."""

    def command_line(self, name: str = "") -> str:
        """The command that does the same."""

    def close(self) -> None:
        """End what runs."""
