"""A calibration campaign on disk: which rig, which captures, what was accepted and what came before.

``campaign.json``
    rig, its options and those of the calibrations; written when the campaign is begun.
``NAME/STEP/``
    the captures of a step of one calibration, with its note and perhaps a scan; the rest is the recipe's own.
``candidates/NAME.json``
    a fit that nobody accepted yet.
``NAME.json``
    the accepted calibration; ``history/NAME/`` keeps the ones it replaced.
``rig.json``
    the rig with all of them.

Every file is written whole or not at all, so that a campaign can be left and continued at any moment.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Literal, Self

from pydantic import Field

from dsl_core.errors import StoreError
from dsl_core.io import CAMPAIGN_NAME
from dsl_core.io.atomic import PARTIAL_SUFFIX, store_error
from dsl_core.io.records import read_record, replace_record
from dsl_core.io.scan.lock import FolderLock
from dsl_core.model.base import Record
from dsl_core.model.calibration.accepted import AcceptedCalibration

#: The rig as calibrated by the campaign.
RIG_NAME = "rig.json"
#: What the folder of a step has: when and how it was captured, and its scan.
NOTE_NAME, SCAN_NAME = "capture.json", "scan.dsl"


class CampaignInfo(Record):
    """The rig and options a campaign was begun with; ``settings`` are those of each calibration."""

    schema_version: Literal[1] = 1
    created: str
    rig: str
    options: dict[str, str] = Field(default_factory=dict)
    settings: dict[str, dict[str, str]] = Field(default_factory=dict)


class CampaignFolder:
    """The files of a campaign by what they mean."""

    def __init__(self, path: Path, info: CampaignInfo) -> None:
        """Used by `begin`, `prepare` and `open`."""
        self.path, self.info = path, info

    @classmethod
    def open(cls, path: Path) -> Self:
        """A campaign that was begun before; raises `StoreError`."""
        if not (path / CAMPAIGN_NAME).is_file():
            if not path.exists():
                raise StoreError(
                    f"{path} is not a campaign: there is no such folder. Connect its drive if it is on one,"
                    " or give the folder of a campaign."
                )
            if is_lost_campaign(path):
                raise StoreError(
                    f"{path} holds the captures of a campaign, but no {CAMPAIGN_NAME}. Begin a campaign of"
                    " this name with its rig and options: what was captured is kept."
                )
            raise StoreError(
                f"{path} is not a campaign: it has no {CAMPAIGN_NAME}. Give the folder of a campaign."
            )
        remedy = (
            "Restore it from a copy, or delete it and begin the campaign in this folder again, with its rig"
            " and options: what was captured is kept."
        )
        return cls(path, read_record(path / CAMPAIGN_NAME, CampaignInfo, remedy))

    @classmethod
    def begin(
        cls,
        path: Path,
        rig: str | None,
        options: Mapping[str, str],
        settings: Mapping[str, Mapping[str, str]] | None = None,
    ) -> Self:
        """Begin or continue a campaign: `prepare` and `save`."""
        campaign = cls.prepare(path, rig, options, settings)
        campaign.save()
        return campaign

    @classmethod
    def prepare(
        cls,
        path: Path,
        rig: str | None,
        options: Mapping[str, str],
        settings: Mapping[str, Mapping[str, str]] | None = None,
    ) -> Self:
        """A campaign, new or begun, as it would be; nothing is written before `save`.

        ``rig`` None means the rig the campaign was begun with, for a new one the twin. ``settings`` add to
        those the campaign has. One whose ``campaign.json`` is lost is begun again and keeps its captures.
        Raises `StoreError` when the campaign was begun with another rig or options, when no rig is named for
        one that lost its file, or when the folder contains something else.
        """
        if not (path / CAMPAIGN_NAME).exists():
            _require_room(path, rig)
            info = CampaignInfo(created=now(), rig=rig or "twin", options=dict(options))
        else:
            info = cls.open(path).info
            _refuse_other_rig(path, info, rig, options)
        merged = {name: dict(values) for name, values in info.settings.items()}
        for name, values in (settings or {}).items():
            merged[name] = {**merged.get(name, {}), **values}
        return cls(path, info.model_copy(update={"settings": merged}))

    def save(self) -> None:
        """Write what the campaign was begun with; raises `StoreError`."""
        replace_record(self.path / CAMPAIGN_NAME, self.info)

    def with_settings(self, name: str, values: Mapping[str, str]) -> Self:
        """The campaign with these settings of a calibration, and no others of it; `save` writes them down."""
        settings = {key: each for key, each in self.info.settings.items() if key != name}
        if values:
            settings[name] = dict(values)
        return type(self)(self.path, self.info.model_copy(update={"settings": settings}))

    def home(self, name: str) -> Path:
        """Where the captures of a calibration are."""
        return self.path / name

    def accepted(self, name: str) -> AcceptedCalibration | None:
        """The accepted calibration of a name; raises `StoreError` when its file is damaged."""
        return self._calibration(self.path / f"{name}.json")

    def candidate(self, name: str) -> AcceptedCalibration | None:
        """A fit that is not accepted yet; raises `StoreError` when its file is damaged."""
        return self._calibration(self._candidate_path(name))

    def history(self, name: str) -> tuple[AcceptedCalibration, ...]:
        """The accepted calibrations that were replaced, oldest first."""
        paths = sorted((self.path / "history" / name).glob("*.json"))
        return tuple(read_record(path, AcceptedCalibration) for path in paths)

    def propose(self, fitted: AcceptedCalibration) -> None:
        """Keep a fit until it is accepted or discarded."""
        replace_record(self._candidate_path(fitted.name), fitted)

    def accept(self, name: str) -> AcceptedCalibration:
        """Accept the candidate; the one it replaces goes into the history.

        Raises `StoreError` when there is none, or the campaign is gone.
        """
        candidate = self.candidate(name)
        if candidate is None:
            # A folder that is gone has no fit either.
            self.open(self.path)
            raise StoreError(f"There is no fit of {name} in {self.path} to be accepted. Fit it first.")
        old = self.accepted(name)
        if old is not None:
            replace_record(self.path / "history" / name / f"{_as_name(old.accepted)}.json", old)
        fresh = candidate.model_copy(update={"accepted": now()})
        replace_record(self.path / f"{name}.json", fresh)
        self.discard(name)
        return fresh

    def discard(self, name: str) -> None:
        """Delete the candidate; the accepted calibration stays. Nothing happens when there is none.

        Raises `StoreError` where the drive refuses.
        """
        path = self._candidate_path(name)
        try:
            path.unlink(missing_ok=True)
        except OSError as error:
            raise store_error(path, error) from error

    def _candidate_path(self, name: str) -> Path:
        return self.path / "candidates" / f"{name}.json"

    def _calibration(self, path: Path) -> AcceptedCalibration | None:
        return read_record(path, AcceptedCalibration) if path.exists() else None


def take_campaign(path: Path) -> FolderLock:
    """The lock of a campaign's folder for whoever writes to it; what a killed writer left half done goes.

    Raises `StoreError` where another process writes to it, or the disk fails.
    """
    lock = FolderLock(path / "lock")
    try:
        for leftover in path.rglob("*" + PARTIAL_SUFFIX):
            if leftover.is_file():
                leftover.unlink()
    except OSError as error:
        lock.release()
        raise store_error(path, error) from error
    return lock


def is_lost_campaign(path: Path) -> bool:
    """Whether a folder holds the captures of a campaign whose own file is not there any more."""
    return not (path / CAMPAIGN_NAME).exists() and any(path.glob(f"*/*/{NOTE_NAME}"))


def _require_room(path: Path, rig: str | None) -> None:
    """Raise `StoreError` where a campaign would take other files, or captures of another rig, for its own."""
    if is_lost_campaign(path):
        if rig is None:
            raise StoreError(
                f"{path} holds the captures of a campaign, but no {CAMPAIGN_NAME}. To continue it, name its"
                " rig with --rig, and with --option and --set what it was begun with."
            )
    elif path.is_dir() and not all(_is_unborn(each) for each in path.iterdir()):
        raise StoreError(f"{path} is neither empty nor a campaign. Choose a new folder.")


def _is_unborn(path: Path) -> bool:
    """Whether a file may be left by a campaign that was killed while it was created."""
    return path.name == "lock" or path.name.startswith(CAMPAIGN_NAME)


def _as_name(time: str) -> str:
    """A time as the name of a file; a campaign from elsewhere may hold any text, also a path.

    >>> _as_name("2026-03-01T10:20:30.000400+00:00")
    '2026-03-01T102030.000400+0000'
    """
    return re.sub(r"[^0-9A-Za-z.+-]", "", time).lstrip(".")[:64] or "unknown"


def now() -> str:
    """The time as it is written into files: UTC, to the microsecond, so that two never agree."""
    return datetime.now(UTC).isoformat(timespec="microseconds")


def later_than(before: str) -> str:
    """The time, or that of ``before`` and a little, if a clock was set back since: new is never older.

    ``before`` is what `now` wrote, or any other text, which then counts for nothing.
    """
    time = now()
    if time > before:
        return time
    try:
        return (datetime.fromisoformat(before) + timedelta(microseconds=1)).isoformat(timespec="microseconds")
    except (ValueError, OverflowError):
        return time


def _refuse_other_rig(path: Path, info: CampaignInfo, rig: str | None, options: Mapping[str, str]) -> None:
    same_options = not options or dict(options) == info.options
    if (rig in (None, info.rig)) and same_options:
        return
    known = " ".join([info.rig, *(f"{key}={value}" for key, value in sorted(info.options.items()))])
    raise StoreError(
        f"The campaign {path} was begun with the rig {known}. Leave out --rig and --option, or begin a new"
        " campaign for another rig."
    )
