"""Which folders may be replaced as a whole: those that hold what their writer wrote, and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dsl_core.io.file_names import CAMPAIGN_NAME, MANIFEST_NAME

#: What is nowhere else, by the file that tells it.
_IRREPLACEABLE = {MANIFEST_NAME: "holds a scan", CAMPAIGN_NAME: "holds the captures of a campaign"}
#: Files that systems put into folders that a person looks at.
_OF_THE_SYSTEM = {".DS_Store", "Thumbs.db", "desktop.ini"}


@dataclass(frozen=True)
class FolderKind:
    """A kind of folder: how to call one, how it is recognised, and which entries of it are its own."""

    name: str
    is_one: Callable[[Path], bool]
    owns: Callable[[Path], bool]

    def refusal(self, folder: Path) -> str:
        """Why another of this kind must not replace a folder; empty when nothing else would be lost."""
        for file, what in _IRREPLACEABLE.items():
            if (folder / file).exists():
                return what
        entries = [entry for entry in folder.iterdir() if entry.name not in _OF_THE_SYSTEM]
        if entries and not self.is_one(folder):
            return f"is not {self.name}"
        foreign = sorted(entry.name for entry in entries if not self.owns(entry))
        return f"holds {foreign[0]} beside {self.name}" if foreign else ""
