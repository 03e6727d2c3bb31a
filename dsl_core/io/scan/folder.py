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

import logging
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DriveError, StoreError
from dsl_core.io import MANIFEST_NAME
from dsl_core.io.atomic import make_folder, remove_partials, store_error
from dsl_core.io.kinds import whose_inside
from dsl_core.io.neighbours import SCAN_SUFFIX, named
from dsl_core.io.patience import drive_error, is_away, patiently
from dsl_core.io.records import replace_record
from dsl_core.io.scan.capture_log import CaptureLog, LogEntry, read_log
from dsl_core.io.scan.estimate import check_space
from dsl_core.io.scan.frame_store import ChunkError, FrameStore, checksum
from dsl_core.io.scan.lock import FolderLock
from dsl_core.io.scan.manifest import Manifest, describe_scan, read_manifest, refuse_other_scan
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot, describe_shot, spoken_number
from dsl_core.model.rig import Rig

_logger = logging.getLogger(__name__)
SUFFIX = SCAN_SUFFIX
LOG_NAME = "frames.jsonl"
FRAMES_NAME = "frames"


def require_name(folder: Path) -> None:
    """Raise `StoreError` unless the name of a new scan is that of one, by which it is found again."""
    folder = named(folder)
    if folder.suffix != SUFFIX:
        # An ending of letters is that of a file; "leaf 1.5" has none.
        stem = folder.with_suffix("") if folder.suffix[1:].isalpha() else folder
        raise StoreError(
            f"{folder} is not the name of a scan: those end in {SUFFIX}. Name it {stem}{SUFFIX}."
        )


def store_of(folder: Path, plan: CapturePlan) -> FrameStore:
    """The frames folder of a scan with this plan."""
    width, height = plan.camera_size_px
    return FrameStore(folder / FRAMES_NAME, plan.shot_count, height, width)


class ScanReader:
    """A `FrameSource` over a scan folder, complete or not; safe to use from several threads."""

    def __init__(self, folder: str | Path) -> None:
        """Open the scan; raises `StoreError` when it is not one or its metadata are damaged."""
        self.folder = Path(folder)
        self.manifest: Manifest = read_manifest(self.folder)
        self.store = store_of(self.folder, self.plan)
        self.store.check()
        self.entries: dict[int, LogEntry] = {e.shot: e for e in read_log(self.folder / LOG_NAME)[0]}

    def __repr__(self) -> str:
        return f"ScanReader({str(self.folder)!r}: {len(self.entries)} of {self.plan.shot_count} frames)"

    @property
    def plan(self) -> CapturePlan:
        """The plan the frames belong to."""
        return self.manifest.plan

    @property
    def calibration(self) -> Rig | None:
        """The rig's calibration at the time of the scan, when it was known."""
        return self.manifest.calibration

    def missing(self) -> list[Shot]:
        """Shots without a finished frame, in order; pixels are not looked at."""
        stored = self.store.stored()
        return [s for s in self.plan.shots() if s.index not in self.entries or s.index not in stored]

    def sound(self) -> set[int]:
        """Indices of the frames that are there to the bit: every pixel is read and compared.

        Raises `DriveError` where nobody can tell.
        """

        def is_sound(shot: Shot) -> bool:
            try:
                self.read(shot)
            except DriveError:
                raise
            except StoreError:
                return False
            return True

        logged = [shot for shot in self.plan.shots() if shot.index in self.entries]
        with ThreadPoolExecutor(2) as pool:
            return {s.index for s, sound in zip(logged, pool.map(is_sound, logged), strict=True) if sound}

    def read(
        self, shot: Shot, out: NDArray[np.uint16] | None = None, verify: bool = True
    ) -> NDArray[np.uint16]:
        """The raw mosaic of a shot, shape (rows, columns), into ``out`` if given.

        With ``verify`` its checksum is compared with the log. Raises `StoreError` naming frame and file.
        """
        entry = self.entries.get(shot.index)
        if entry is None:
            raise StoreError(self._sentence(shot, "it was never finished"))
        try:
            pixels = self.store.read(shot.index, out)
        except ChunkError as error:
            raise StoreError(self._sentence(shot, str(error))) from error
        if verify and (found := checksum(pixels)) != entry.crc32:
            raise StoreError(self._sentence(shot, self._mismatch(shot, found)))
        return pixels

    def read_rows(self, shot: Shot, rows: slice) -> NDArray[np.uint16]:
        """Some rows of a mosaic, shape (rows, columns), without a look at its checksum: `read` compares that.

        Raises `StoreError` naming frame and file.
        """
        if shot.index not in self.entries:
            raise StoreError(self._sentence(shot, "it was never finished"))
        try:
            return self.store.read_rows(shot.index, rows)
        except ChunkError as error:
            raise StoreError(self._sentence(shot, str(error))) from error

    def corrected(self, shot: Shot) -> str:
        """What an earlier picture showed instead of the pattern of a shot; empty if there was none."""
        entry = self.entries.get(shot.index)
        return "" if entry is None else entry.corrected

    @property
    def strangers(self) -> str:
        """A sentence on frames that belong to another scan than the manifest; empty if none do."""
        begun = self.manifest.created
        others = [entry for entry in self.entries.values() if entry.scan not in ("", begun)]
        if not others:
            return ""
        return (
            f"{len(others)} of {self.plan.shot_count} frames in {self.folder} belong to a scan that began at"
            f" {others[0].scan}, and {MANIFEST_NAME} to one that began at {begun}: files of two scans were"
            " mixed. Restore them from copies."
        )

    def _mismatch(self, shot: Shot, found: int) -> str:
        twins = [e.shot for e in self.entries.values() if e.crc32 == found and e.shot != shot.index]
        path = self.store.path(shot.index)
        if twins:
            return (
                f"its file {path} contains the picture of frame {spoken_number(twins[0])} (swapped or copied)"
            )
        return f"the pixels in {path} do not match their checksum (damaged)"

    def _sentence(self, shot: Shot, what: str) -> str:
        name = describe_shot(shot).capitalize()
        return f"{name} of {self.folder} cannot be used: {what}. Resume the scan to capture it again."


class ScanWriter:
    """A `FrameSink` that makes each frame durable before the next is taken."""

    def __init__(self, folder: Path, manifest: Manifest, lock: FolderLock) -> None:
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
        """The plan of the scan."""
        return self.manifest.plan

    @classmethod
    def create(
        cls,
        folder: str | Path,
        plan: CapturePlan,
        rig: DeviceRig | None = None,
        notes: dict[str, str] | None = None,
    ) -> ScanWriter:
        """Start a scan in a new folder; raises `StoreError` if there is one or the disk is too small."""
        folder = Path(folder)
        if (folder / MANIFEST_NAME).exists():
            raise StoreError(f"{folder} already contains a scan. Resume it, or choose a new name.")
        if folder.exists() and not _is_unborn(folder):
            raise StoreError(f"{folder} exists and is not a scan. Choose a new name.")
        if whose := whose_inside(folder):
            raise StoreError(f"{folder} would be inside {whose}. Choose another place.")
        check_space(folder, plan, plan.shot_count)
        make_folder(folder)
        lock = FolderLock(folder / "lock")
        try:
            manifest = describe_scan(plan, rig, notes)
            store_of(folder, plan).create()
            # The manifest comes last: a folder without one never held a frame and may be started again.
            replace_record(folder / MANIFEST_NAME, manifest)
            return cls(folder, manifest, lock)
        except BaseException:
            lock.release()
            raise

    @classmethod
    def resume(
        cls, folder: str | Path, plan: CapturePlan | None = None, rig: DeviceRig | None = None
    ) -> ScanWriter:
        """Resume a scan; raises `StoreError` naming the field in which plan or devices differ.

        Every stored frame is checked against its checksum; those that do not agree are missing again.
        """
        folder = Path(folder)
        read_manifest(folder)
        lock = FolderLock(folder / "lock")
        try:
            reader = ScanReader(folder)
            if reader.strangers:
                raise StoreError(reader.strangers)
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
    ) -> ScanWriter:
        """Resume the scan if there is one, start it otherwise; raises `StoreError`."""
        if (Path(folder) / MANIFEST_NAME).exists():
            return cls.resume(folder, plan, rig)
        return cls.create(folder, plan, rig, notes)

    def missing(self) -> Iterator[Shot]:
        """Shots of the plan that are not saved yet, in order."""
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
            corrected=frame.corrected,
            shown_s=round(frame.shown_s, 3),
            run=self._run,
            darkest_dn=int(frame.pixels.min()),
            brightest_dn=int(frame.pixels.max()),
            scan=self.manifest.created,
        )
        self._log.append(entry)
        self._done.add(shot.index)

    def withdraw(self, shots: Iterable[Shot]) -> None:
        """Remove frames that nobody believes any more, so that they are missing; raises `StoreError`.

        Their lines stay in the log, as those of frames that somebody deleted.
        """
        indices = {shot.index for shot in shots} & self._done
        self._done -= indices
        self._store.remove(indices)

    def read_back(self) -> list[Shot]:
        """Shots whose frames are not on the disk as they were written; manifest and log are written again.

        Every pixel is read and compared. Raises `StoreError` when the folder itself is gone or fails.
        """
        try:
            is_there = patiently(self.folder.is_dir, self.folder)
        except OSError as error:
            raise (drive_error if is_away(error) else store_error)(self.folder, error) from error
        if not is_there:
            raise StoreError(
                f"{self.folder} was moved or deleted while it was written. Put it back: what is missing is"
                " then captured again."
            )
        restored = [
            name
            for name, restore in (
                (MANIFEST_NAME, self._restore_manifest),
                (LOG_NAME, self._log.restore),
                (FRAMES_NAME, self._restore_metadata),
            )
            if restore()
        ]
        if restored:
            _logger.warning(
                "%s of %s changed while scanning and was written again."
                " Keep other programs out of the folder.",
                " and ".join(restored),
                self.folder,
            )
        self._done = ScanReader(self.folder).sound()
        return list(self.missing())

    def _restore_manifest(self) -> bool:
        """Write the manifest again unless the disk has it; says whether that was necessary."""
        try:
            if read_manifest(self.folder) == self.manifest:
                return False
        except StoreError:
            pass
        replace_record(self.folder / MANIFEST_NAME, self.manifest)
        return True

    def _restore_metadata(self) -> bool:
        """Describe the frames again unless the disk has it; says whether that was necessary."""
        try:
            self._store.check()
        except StoreError:
            self._store.create()
            return True
        return False

    def close(self) -> None:
        """Finish and let other processes in; a second call does nothing."""
        self._log.close()
        self._lock.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *failure: object) -> None:
        self.close()


def _is_unborn(folder: Path) -> bool:
    """Whether a folder holds at most what `ScanWriter.create` leaves when killed before its end."""
    return folder.is_dir() and all(
        path.name in {"lock", FRAMES_NAME} or path.name.startswith(MANIFEST_NAME) for path in folder.iterdir()
    )
