"""Settings and recent files: read tolerantly, written atomically. No Qt here."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from dsl_app.shared.evented import Value
from dsl_app.shared.paths import barrier, there
from dsl_core.errors import StoreError
from dsl_core.io.atomic import make_folder, set_aside, write_atomic
from dsl_core.io.reading import read_json
from dsl_core.resources import expanded, own_folder

_log = logging.getLogger(__name__)
RECENT_COUNT = 12
#: What a program that is killed must know next time; the page that was open is offered again.
EARLY = ("rig", "rig_options", "recent", "tour_seen", "campaign", "campaigns_folder", "calibration")
#: Options are of their rig.
_RIG = {"rig", "rig_options"}


class Settings(BaseModel):
    """Everything that is remembered between sessions; every field has a default."""

    model_config = ConfigDict(extra="ignore", validate_assignment=True)

    theme: Literal["system", "light", "dark"] = "system"
    page: str = "start"
    rig: str = "twin"
    rig_options: dict[str, str] = Field(default_factory=dict)
    recent: list[str] = Field(default_factory=list)
    output_folder: str = ""
    #: The campaign that was open, the folder of new ones, and when calibrations count as ageing.
    campaign: str = ""
    campaigns_folder: str = ""
    ageing_days: int = Field(default=90, ge=1)
    #: Name in the library of the calibration that scans use; empty for the rig's own.
    calibration: str = ""
    #: Geometry and docks of the main window, as Qt wrote them, base64.
    window_geometry: str = ""
    window_state: str = ""
    tour_seen: bool = False
    #: How many times as long as expected the last reconstruction took on this computer.
    reconstruction_pace: float = Field(default=1.0, gt=0.0)

    @property
    def scans(self) -> Path:
        """Folder that new scans are saved in: the one that was chosen, or one in the home folder."""
        return Path(self.output_folder or expanded(Path("~")) / "dsl-scans")

    @property
    def campaigns(self) -> Path:
        """Folder that new campaigns are begun in, likewise."""
        return Path(self.campaigns_folder or expanded(Path("~")) / "dsl-campaigns")

    def remember(self, path: Path) -> None:
        """Put a file first among the recent ones."""
        name = str(path.absolute())
        self.recent = [name, *(other for other in self.recent if other != name)][:RECENT_COUNT]


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
        """Remove a file from the list."""
        self._settings.recent = [name for name in self._settings.recent if Path(name) != path]
        self._tell()

    def _tell(self) -> None:
        self.paths.set(tuple(Path(name) for name in self._settings.recent))


def entry_text(path: Path) -> str:
    """How lists show a recent file: its name and folder, and whether it is missing or cannot be seen."""
    text = f"{path.name}  –  {path.parent}"
    if there(path):
        return text
    return f"{text}  ({'no access' if barrier(path) else 'missing'})"


def settings_folder() -> Path:
    """Folder of the settings on this system."""
    return own_folder("config")


def data_folder() -> Path:
    """Folder of the program's own data, such as the demo."""
    return own_folder()


def demo_folder() -> Path:
    """Folder of the examples and of live demos, in which nobody looks for files of their own."""
    return data_folder() / "demo"


def folder_for(path: Path) -> Path:
    """Where a person looks for what is written of a scan or result: next to it, at home for an example."""
    return expanded(Path("~")) if path.parent == demo_folder() else path.parent


def load_settings(path: Path) -> tuple[Settings, str]:
    """Settings and a sentence on what was wrong with the file (empty: nothing).

    An invalid field keeps its default; a damaged file is set aside, one that cannot be read now stays.
    Settings never keep the application from starting.
    """
    try:
        settings, trouble = _load(path)
    except OSError as error:
        return Settings(), f"The settings {path} could not be read ({error}); the defaults are used."
    return Settings() if settings is None else settings, trouble


def _load(path: Path) -> tuple[Settings | None, str]:
    """As `load_settings`, with None where there is no file; raises `OSError` for one that stays."""
    try:
        content = read_json(path)
    except FileNotFoundError:
        return None, ""
    except ValueError as error:
        aside = set_aside(path)
        return Settings(), f"The settings {path} could not be read ({error}); the defaults are used.{aside}"
    if not isinstance(content, dict):
        return Settings(), f"The file {path} contains no settings; the defaults are used.{set_aside(path)}"
    return _tolerant(content, path)


def save_settings(settings: Settings, path: Path) -> str:
    """Write the settings; returns a sentence on what went wrong (empty: nothing), never raises."""
    try:
        make_folder(path.parent)
        write_atomic(path, settings.model_dump_json(indent=1).encode())
    except (OSError, StoreError) as error:
        return _unsaved(error)
    return ""


def _unsaved(error: Exception) -> str:
    return f"The settings could not be saved: {error}"


def _tolerant(content: dict[str, Any], path: Path) -> tuple[Settings, str]:
    try:
        return Settings.model_validate(content), ""
    except ValidationError as error:
        wrong = {str(item["loc"][0]) for item in error.errors()}
        rest = {key: value for key, value in content.items() if key not in wrong}
        return Settings.model_validate(rest), (
            f"These fields of the settings {path} are invalid and were reset to their defaults:"
            f" {', '.join(sorted(wrong))}."
        )


class SettingsFile:
    """The file of settings: only what changed here is written, as other windows keep theirs in it, too."""

    def __init__(self, settings: Settings, path: Path) -> None:
        """``settings`` are as they were read, and change from now on."""
        self.path, self._settings = path, settings
        self._known = settings.model_copy(deep=True)

    def save(self) -> str:
        """Write what changed; all of it where the file is gone or wrong. Returns what went wrong, or ""."""
        return self._save(tuple(Settings.model_fields), may_replace=True)

    def save_early(self) -> str:
        """Write what must outlive a crash now; the rest stays as it was saved. Returns what went wrong."""
        return self._save(EARLY, may_replace=False)

    def _save(self, names: tuple[str, ...], *, may_replace: bool) -> str:
        try:
            saved, trouble = _load(self.path)
        except OSError as error:
            return _unsaved(error)  # it may be sound
        if trouble:
            return save_settings(self._settings, self.path) if may_replace else trouble
        return self._save_over(saved, names)

    def _save_over(self, saved: Settings | None, names: tuple[str, ...]) -> str:
        now, known = self._settings, self._known
        saved = saved or known
        changed = {name for name in names if getattr(now, name) != getattr(known, name)}
        if changed & _RIG:
            changed |= _RIG
        values = {name: getattr(now, name) for name in changed}
        if "recent" in changed:
            values["recent"] = _joined(now.recent, known.recent, saved.recent)
        trouble = save_settings(saved.model_copy(update=values), self.path)
        if not trouble:
            self._known = known.model_copy(deep=True, update={name: getattr(now, name) for name in names})
        return trouble


def _joined(now: list[str], known: list[str], saved: list[str]) -> list[str]:
    """Recent files of two windows: those opened here since ``known``, then those on disk.

    What was forgotten here is left out.
    """
    rest = list(now)
    while rest != [name for name in known if name in rest]:
        rest.pop(0)
    opened, forgotten = now[: len(now) - len(rest)], set(known) - set(now)
    others = (name for name in saved if name not in opened and name not in forgotten)
    return [*opened, *others][:RECENT_COUNT]
