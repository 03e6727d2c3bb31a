"""Raw mosaics on disk: a Zarr v3 array with one frame a chunk, written safely and read fast.

The chunks are written and read here directly, because Zarr's own local store does not sync its files
and costs more than the decompression; any Zarr v3 reader opens the folder as an ordinary array.
Format: https://zarr-specs.readthedocs.io/en/latest/v3/core/index.html, chunk header:
https://github.com/Blosc/c-blosc/blob/main/README_CHUNK_FORMAT.rst
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.atomic import make_folder, store_error, sync_folder, write_atomic
from dsl_core.io.patience import drive_error, is_away, is_refused, patiently, says_nothing
from dsl_core.io.reading import parts_of, read_bounded, read_json
from dsl_core.io.scan.blosc_blocks import HEADER, Bytes, blocks_of
from dsl_core.model.plan import spoken_number

#: Bands of rows are read by whole blocks. Frames in blocks of 64 KiB are 1.5 % larger than in ones of 256 KiB
#: and decompress as fast, and a band of half a megapixel then needs half as much.
_BLOSC = {"typesize": 2, "cname": "zstd", "clevel": 1, "shuffle": "bitshuffle", "blocksize": 1 << 16}
_BITSHUFFLE = 2
_PIXEL = np.dtype("<u2")
T = TypeVar("T")


def checksum(pixels: NDArray[np.uint16]) -> int:
    """CRC-32 of a mosaic's pixels, little-endian, row by row."""
    return zlib.crc32(np.ascontiguousarray(pixels, _PIXEL).data)


class ChunkError(Exception):
    """What is wrong with the file of a frame, as half a sentence; `ScanReader` makes it whole."""


@dataclass(frozen=True)
class FrameStore:
    """The frames folder of a scan: ``count`` mosaics of ``height_px`` x ``width_px``."""

    folder: Path
    count: int
    height_px: int
    width_px: int

    def create(self) -> None:
        """Write the array's metadata; frames follow one by one."""
        make_folder(self.folder)
        write_atomic(self._metadata_path, json.dumps(self._metadata(), indent=2).encode())

    def check(self) -> None:
        """Raise `StoreError` unless the metadata on disk describe exactly this array."""
        try:
            found = read_json(self._metadata_path)
            if not isinstance(found, dict):
                raise ValueError("not an object")
        except (OSError, ValueError) as error:
            if isinstance(error, OSError) and says_nothing(error):
                raise drive_error(self._metadata_path, error) from error
            raise StoreError(
                f"{self._metadata_path} is missing or damaged, so the frames cannot be read."
                " Restore it from a copy of the scan."
            ) from error
        wanted = self._metadata()
        for key in ("zarr_format", "shape", "data_type", "chunk_grid", "chunk_key_encoding", "codecs"):
            if _comparable(found.get(key)) != _comparable(wanted[key]):
                raise StoreError(
                    f"{self._metadata_path} gives {key} as {found.get(key)}, but the plan needs"
                    f" {wanted[key]}. The frames do not belong to this plan;"
                    " restore the file from a copy of the scan."
                )

    def path(self, index: int) -> Path:
        """The file of a frame."""
        return self.folder / f"c.{index}.0.0"

    def stored(self) -> set[int]:
        """Indices of all frame files in the folder, also of those that the plan does not know.

        Raises `StoreError` where the folder cannot be listed.
        """
        try:
            names = [path.name.split(".") for path in self.folder.glob("c.*.0.0")]
        except OSError as error:
            raise (drive_error if says_nothing(error) else store_error)(self.folder, error) from error
        return {int(name[1]) for name in names if name[1].isdigit()}

    def write(self, index: int, pixels: NDArray[np.uint16]) -> None:
        """Store a mosaic, shape (height, width), so that it survives a power cut; raises `StoreError`."""
        if pixels.shape != (self.height_px, self.width_px) or pixels.dtype != np.uint16:
            raise StoreError(
                f"Frame {spoken_number(index)} is {pixels.dtype} of shape {pixels.shape}, but the scan needs"
                f" uint16 of shape {(self.height_px, self.width_px)}. Make a plan for this camera's size."
            )
        from numcodecs import blosc  # type: ignore[import-untyped]

        codec = blosc.Blosc(
            cname=_BLOSC["cname"], clevel=_BLOSC["clevel"], shuffle=_BITSHUFFLE, blocksize=_BLOSC["blocksize"]
        )
        chunk = codec.encode(np.ascontiguousarray(pixels, _PIXEL))
        patiently(lambda: write_atomic(self.path(index), chunk), self.path(index))

    def remove(self, indices: Iterable[int]) -> None:
        """Delete mosaics, also for a power cut that follows; raises `StoreError`."""
        try:
            for index in indices:
                self.path(index).unlink(missing_ok=True)
            sync_folder(self.folder)
        except OSError as error:
            raise store_error(self.folder, error) from error

    def read(self, index: int, out: NDArray[np.uint16] | None = None) -> NDArray[np.uint16]:
        """Load a mosaic, shape (height, width), into ``out`` if given; raises `ChunkError`, `DriveError`."""
        chunk = self._patiently(index, lambda: read_bounded(self.path(index), self._most_bytes))
        self._check_header(index, chunk)
        if out is None:
            out = np.empty((self.height_px, self.width_px), np.uint16)
        from numcodecs import blosc

        try:
            blosc.decompress(chunk, out)
        except (RuntimeError, ValueError) as error:
            raise ChunkError(f"its file {self.path(index)} does not decompress ({error})") from error
        return out

    def read_rows(self, index: int, rows: slice) -> NDArray[np.uint16]:
        """Some rows of a mosaic, shape (rows, width); only the blocks that hold them are decompressed.

        Raises `ChunkError`, `DriveError`.
        """
        first, last, _ = rows.indices(self.height_px)
        row_bytes = self.width_px * _PIXEL.itemsize
        from numcodecs import blosc

        def blocks() -> tuple[bytes, int]:
            with parts_of(self.path(index), self._most_bytes) as chunk:
                self._check_header(index, chunk)
                return blocks_of(chunk, first * row_bytes, last * row_bytes)

        try:
            part, begins = self._patiently(index, blocks)
            raw = np.frombuffer(blosc.decompress(part), np.uint8)
        except (RuntimeError, ValueError) as error:
            raise ChunkError(f"its file {self.path(index)} does not decompress ({error})") from error
        wanted = raw[first * row_bytes - begins : last * row_bytes - begins]
        return wanted.view(_PIXEL).reshape(last - first, self.width_px)

    def _patiently(self, index: int, read: Callable[[], T]) -> T:
        """What ``read`` finds in the file of a frame, asked again while its drive does not answer."""
        try:
            return patiently(read, self.path(index), self._is_gone)
        except OSError as error:
            if is_away(error) and self._is_gone():
                raise drive_error(self.folder, error) from error
            if is_refused(error):
                raise drive_error(self.path(index), error) from error
            reason = error.strerror or error
            raise ChunkError(f"its file {self.path(index)} cannot be read ({reason})") from error

    def _is_gone(self) -> bool:
        """Whether the drive does not answer: where one frame alone cannot be read, that file is damaged."""
        try:
            read_bounded(self._metadata_path)
        except OSError as error:
            return is_away(error)
        return False

    def _check_header(self, index: int, chunk: Bytes) -> None:
        """Refuse a chunk that is cut off or holds another size or type, before the decoder touches it."""
        path = self.path(index)
        if len(chunk) < HEADER.size:
            raise ChunkError(f"its file {path} is cut off after {len(chunk)} bytes")
        _, _, _, typesize, raw_bytes, _, chunk_bytes = HEADER.unpack(chunk[: HEADER.size])
        if chunk_bytes != len(chunk):
            raise ChunkError(f"its file {path} has {len(chunk)} of {chunk_bytes} bytes")
        wanted = self.height_px * self.width_px * _PIXEL.itemsize
        if typesize != _PIXEL.itemsize or raw_bytes != wanted:
            raise ChunkError(
                f"its file {path} contains {raw_bytes} bytes of {8 * typesize} bit values"
                f" instead of {wanted} bytes of 16 bit values"
            )

    @property
    def _most_bytes(self) -> int:
        """More than a chunk takes: Blosc adds only a little to what it cannot compress."""
        return self.height_px * self.width_px * _PIXEL.itemsize * 2 + (1 << 16)

    @property
    def _metadata_path(self) -> Path:
        return self.folder / "zarr.json"

    def _metadata(self) -> dict[str, Any]:
        return {
            "zarr_format": 3,
            "node_type": "array",
            "shape": [self.count, self.height_px, self.width_px],
            "data_type": "uint16",
            "chunk_grid": {
                "name": "regular",
                "configuration": {"chunk_shape": [1, self.height_px, self.width_px]},
            },
            # Flat names: one folder to sync instead of three new ones a frame.
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "."}},
            "fill_value": 0,
            "codecs": [
                {"name": "bytes", "configuration": {"endian": "little"}},
                {"name": "blosc", "configuration": _BLOSC},
            ],
            "attributes": {"unit": "DN"},
            "dimension_names": ["shot", "y", "x"],
        }


def _comparable(value: Any) -> Any:
    """A value of the metadata without the size of blocks, which each frame states itself."""
    if isinstance(value, dict):
        return {key: _comparable(each) for key, each in value.items() if key != "blocksize"}
    return [_comparable(each) for each in value] if isinstance(value, list) else value
