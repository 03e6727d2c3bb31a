"""Files that were opened last, first the latest; those that vanished stay until somebody asks for them."""

from __future__ import annotations

from pathlib import Path

from dsl_app.shared.evented import Value
from dsl_app.shared.settings import Settings


class RecentFiles:
    """The recent files of the settings, for menus and pages that follow them."""

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.paths: Value[tuple[Path, ...]] = Value(tuple(Path(name) for name in settings.recent))

    def add(self, path: Path) -> None:
        """Put a file first."""
        self._settings.remember(path)
        self._tell()

    def forget(self, path: Path) -> None:
        """Leave a file out from now on."""
        self._settings.recent = [name for name in self._settings.recent if Path(name) != path]
        self._tell()

    def _tell(self) -> None:
        self.paths.set(tuple(Path(name) for name in self._settings.recent))
