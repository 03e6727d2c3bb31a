"""A scan on disk: a folder ``NAME.dsl`` that survives crashes and says so when it is damaged.

``manifest.json``
    plan, rig, devices, versions; written once.
``frames/``
    raw mosaics, a Zarr v3 array with one frame a chunk.
``frames.jsonl``
    one line for every frame that is safely on disk.

A frame is done when its line and its chunk exist and agree.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Self

from dsl_core.devices.base import DeviceRig
from dsl_core.errors import StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.atomic import remove_partials
from dsl_core.io.scan.capture_log import CaptureLog, LogEntry
from dsl_core.io.scan.frame_store import checksum
from dsl_core.io.scan.lock import SessionLock
from dsl_core.io.scan.manifest import (
    Manifest,
    describe_scan,
    read_manifest,
    refuse_other_scan,
    write_manifest,
)
from dsl_core.io.scan.reader import FRAMES_NAME, LOG_NAME, SessionReader, store_of
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot

__all__ = ["SUFFIX", "SessionReader", "SessionWriter", "check_space", "needed_bytes"]

SUFFIX = ".dsl"
#: Share of the raw size that compressed frames take at most in practice (measured 0.27 to 0.5 on 12 bit
#: noise), and what is left free beside them.
COMPRESSED_SHARE = 0.6
MARGIN_BYTES = 64 << 20


def needed_bytes(plan: CapturePlan, frames: int) -> int:
    """Bytes to have free for that many frames of a plan."""
    return int(plan.raw_bytes * frames / plan.shot_count * COMPRESSED_SHARE) + MARGIN_BYTES


def check_space(folder: Path, plan: CapturePlan, frames: int) -> None:
    """Raise `StoreError` when the disk under ``folder`` cannot take that many frames of the plan."""
    place = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    need = needed_bytes(plan, frames)
    free = shutil.disk_usage(place).free
    if free < need:
        raise StoreError(
            f"The scan needs about {need / 1e6:.0f} MB for {frames} frames,"
            f" but {place} has {free / 1e6:.0f} MB free. Free some space or choose another drive."
        )


class SessionWriter:
    """A `FrameSink` that makes each frame durable before the next is taken."""

    def __init__(self, folder: Path, manifest: Manifest, lock: SessionLock) -> None:
        """Used by `create`, `resume` and `open`, which check what has to be checked before."""
        self.folder = folder
        self.manifest = manifest
        self._lock = lock
        self._store = store_of(folder, manifest.plan)
        self._log = CaptureLog(folder / LOG_NAME)
        self._run = 1 + max((e.run for e in self._log.entries), default=0)
        self._done: set[int] = set()

    @property
    def plan(self) -> CapturePlan:
        """The plan of the session."""
        return self.manifest.plan

    @classmethod
    def create(
        cls,
        folder: str | Path,
        plan: CapturePlan,
        rig: DeviceRig | None = None,
        notes: dict[str, str] | None = None,
    ) -> SessionWriter:
        """Start a session in a new folder; raises `StoreError` if there is one or the disk is too small."""
        folder = Path(folder)
        if (folder / MANIFEST_NAME).exists():
            raise StoreError(f"{folder} already holds a scan. Resume it, or choose a new name.")
        if folder.exists() and not _is_unborn(folder):
            raise StoreError(f"{folder} exists and is not a session. Choose a new name.")
        check_space(folder, plan, plan.shot_count)
        lock = _make_folder(folder)
        try:
            manifest = describe_scan(plan, rig, notes)
            store_of(folder, plan).create()
            # The manifest comes last: a folder without one never held a frame and may be started again.
            write_manifest(folder, manifest)
            return cls(folder, manifest, lock)
        except BaseException:
            lock.release()
            raise

    @classmethod
    def resume(
        cls, folder: str | Path, plan: CapturePlan | None = None, rig: DeviceRig | None = None
    ) -> SessionWriter:
        """Go on with a session; raises `StoreError` naming the field in which plan or devices differ.

        Every stored frame is checked against its checksum; those that do not agree are missing again.
        """
        folder = Path(folder)
        read_manifest(folder)
        lock = SessionLock(folder / "lock")
        try:
            reader = SessionReader(folder)
            refuse_other_scan(folder, reader.manifest, describe_scan(plan or reader.plan, rig))
            remove_partials(reader.store.folder)
            done = reader.sound()
            check_space(folder, reader.plan, reader.plan.shot_count - len(done))
            writer = cls(folder, reader.manifest, lock)
            writer._done = done
            return writer
        except BaseException:
            lock.release()
            raise

    @classmethod
    def open(
        cls,
        folder: str | Path,
        plan: CapturePlan,
        rig: DeviceRig | None = None,
        notes: dict[str, str] | None = None,
    ) -> SessionWriter:
        """Resume the session if there is one, start it otherwise; raises `StoreError`."""
        if (Path(folder) / MANIFEST_NAME).exists():
            return cls.resume(folder, plan, rig)
        return cls.create(folder, plan, rig, notes)

    def missing(self) -> Iterator[Shot]:
        """Shots of the plan that are not stored yet, in order."""
        return (shot for shot in self.plan.shots() if shot.index not in self._done)

    def write(self, shot: Shot, frame: Frame) -> None:
        """Store a frame so that it survives a crash or power cut from this moment on; raises `StoreError`."""
        self._store.write(shot.index, frame.pixels)
        entry = LogEntry(
            shot=shot.index,
            exposure_ms=frame.exposure_ms,
            timestamp_s=frame.timestamp_s,
            frame_id=frame.frame_id,
            crc32=checksum(frame.pixels),
            attempts=frame.attempts,
            run=self._run,
            darkest_dn=int(frame.pixels.min()),
            brightest_dn=int(frame.pixels.max()),
        )
        self._log.append(entry)
        self._done.add(shot.index)

    def close(self) -> None:
        """Finish and let other processes in; a second call does nothing."""
        self._log.close()
        self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()


def _is_unborn(folder: Path) -> bool:
    """Whether a folder holds at most what `SessionWriter.create` leaves when killed before its end."""
    return folder.is_dir() and all(
        path.name in {"lock", FRAMES_NAME} or path.name.startswith(MANIFEST_NAME) for path in folder.iterdir()
    )


def _make_folder(folder: Path) -> SessionLock:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return SessionLock(folder / "lock")
    except OSError as error:
        raise StoreError(
            f"The folder {folder} cannot be made ({error.strerror}). Check its parent folder's permissions."
        ) from error
