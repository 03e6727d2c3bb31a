"""Reading a session: a scan on disk, complete or not, with every frame checked as it is read."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.scan.capture_log import LogEntry, read_log
from dsl_core.io.scan.frame_store import ChunkError, FrameStore, checksum
from dsl_core.io.scan.manifest import Manifest, read_manifest
from dsl_core.model.plan import CapturePlan, Shot, describe_shot
from dsl_core.model.rig import Rig

LOG_NAME = "frames.jsonl"
FRAMES_NAME = "frames"
_FRAMES_A_BLOCK = 8


def store_of(folder: Path, plan: CapturePlan) -> FrameStore:
    """The frames folder of a session with this plan."""
    width, height = plan.camera_size_px
    return FrameStore(folder / FRAMES_NAME, plan.shot_count, height, width)


class SessionReader:
    """A `FrameSource` over a session folder, complete or not; safe to use from several threads."""

    def __init__(self, folder: str | Path) -> None:
        """Open the session; raises `StoreError` when it is not one or its metadata are damaged."""
        self.folder = Path(folder)
        self.manifest: Manifest = read_manifest(self.folder)
        self.store = store_of(self.folder, self.plan)
        self.store.check()
        self.entries: dict[int, LogEntry] = {e.shot: e for e in read_log(self.folder / LOG_NAME)[0]}

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
        """Indices of the frames that are there to the bit: every pixel is read and compared."""

        def is_sound(shot: Shot) -> bool:
            try:
                self.read(shot)
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

    def read_many(
        self, shots: Iterable[Shot], threads: int = 2, verify: bool = True
    ) -> Iterator[tuple[Shot, NDArray[np.uint16]]]:
        """Shots with their mosaics, in the order asked, a few read ahead by ``threads`` threads."""
        pending: deque[tuple[Shot, Future[NDArray[np.uint16]]]] = deque()
        buffers = self._buffers()
        with ThreadPoolExecutor(threads) as pool:
            try:
                for shot in shots:
                    pending.append((shot, pool.submit(self.read, shot, next(buffers), verify)))
                    if len(pending) > 2 * threads:
                        first, future = pending.popleft()
                        yield first, future.result()
                while pending:
                    first, future = pending.popleft()
                    yield first, future.result()
            finally:
                for _, future in pending:
                    future.cancel()

    def read_stack(
        self,
        shots: Iterable[Shot],
        out: NDArray[np.uint16] | None = None,
        threads: int = 2,
        verify: bool = True,
    ) -> NDArray[np.uint16]:
        """Mosaics of several shots, shape (shots, rows, columns), decompressed straight into place.

        A stack handed in as ``out`` (C order) is reused, which saves a third of the time.
        """
        wanted = list(shots)
        if out is None:
            out = np.empty((len(wanted), self.store.height_px, self.store.width_px), np.uint16)
        with ThreadPoolExecutor(threads) as pool:
            futures = [pool.submit(self.read, s, o, verify) for s, o in zip(wanted, out, strict=True)]
            try:
                for future in futures:
                    future.result()
            finally:
                for future in futures:
                    future.cancel()
        return out

    def _buffers(self) -> Iterator[NDArray[np.uint16]]:
        """Empty mosaics, cut from blocks that huge pages fit in."""
        # First touching a lone mosaic of 1 MB, in small pages, takes longer than decompressing into it.
        while True:
            yield from np.empty((_FRAMES_A_BLOCK, self.store.height_px, self.store.width_px), np.uint16)

    def _mismatch(self, shot: Shot, found: int) -> str:
        twins = [e.shot for e in self.entries.values() if e.crc32 == found and e.shot != shot.index]
        path = self.store.path(shot.index)
        if twins:
            return f"its file {path} holds the picture of frame {twins[0]} (swapped or copied)"
        return f"the pixels in {path} do not match their checksum (damaged)"

    def _sentence(self, shot: Shot, what: str) -> str:
        name = describe_shot(shot).capitalize()
        return f"{name} of {self.folder} cannot be used: {what}. Resume the scan to take it again."
