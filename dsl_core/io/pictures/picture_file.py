"""One picture of another program as an array of whole numbers, whatever its format."""

from __future__ import annotations

import errno
import struct
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import MissingPackageError, StoreError
from dsl_core.io.pictures import array_file, camera_raw, open_exr
from dsl_core.io.pictures.decoders import decode
from dsl_core.io.pictures.heads import Head, heads_of
from dsl_core.io.pictures.mapping import MOST_PICTURES, Mapping, RawLayout
from dsl_core.io.pictures.value_scale import SPARKS
from dsl_core.io.png_parts import declares_too_much
from dsl_core.io.reading import read_bounded, require_plain
from dsl_core.model.conditions import BayerPattern
from dsl_core.model.plan import MOST_PX
from dsl_core.optics.colour import srgb_decode

T = TypeVar("T")

PICTURES = {
    *(".png", ".tif", ".tiff", ".bmp", ".jpg", ".jpeg", ".pgm", ".ppm", ".pfm", ".webp", ".exr"),
    *camera_raw.SUFFIXES,
}
ARRAYS, RAWS = array_file.SUFFIXES, {".raw", ".bin"}
#: Formats whose files may hold several pictures as pages.
PAGED = {".tif", ".tiff"}
#: Formats whose values are linear in light by their definition.
LINEAR = {".exr", ".pfm", *camera_raw.SUFFIXES}
#: What holds pictures and is not read, and what makes readable ones of it.
_FRAMES = "Save its frames as pictures without loss, such as PNG"
NOT_READ = {
    **dict.fromkeys((".avi", ".mp4", ".mov", ".mkv", ".wmv", ".mjpg", ".gif"), ("a video", _FRAMES)),
    **dict.fromkeys((".h5", ".hdf5"), ("a file of HDF5", "Save its pictures as PNG or as one file .npy")),
    **dict.fromkeys((".heic", ".jxl", ".jp2"), ("a picture", "Save it as PNG or TIFF")),
    **dict.fromkeys((".zip", ".7z", ".rar", ".gz"), ("an archive", "Unpack it")),
}
#: What a library raises for the head of a damaged picture.
_UNREADABLE = (
    OSError, EOFError, ValueError, SyntaxError, TypeError, LookupError, ArithmeticError, struct.error,
)  # fmt: skip
#: Larger than any camera's picture, in bytes of its file and in pixels.
MOST_BYTES, MOST_PIXELS = 1 << 30, 200_000_000
_FULL = 65535
#: Where colours are separate planes, OpenCV takes more bits for interleaved ones, without a word.
_MOST_BITS_APART = 8
#: Filters of renderers overshoot at edges by less than this share of white.
FILTERED = 0.02
#: What noise leaves below 0 where a dark picture is subtracted: nothing reaches this share of white. Numbers
#: that ran over their type, and differences of pictures, go far below it.
_NOISE = 0.1
#: Bits of frames decoded from sRGB: the steps of dark values are as fine as those of 12 bits.
DECODED_BITS = 16


@dataclass(frozen=True)
class Picture:
    """A file with a picture, or one picture of an array or TIFF of several."""

    path: Path
    index: int | None = None

    def __str__(self) -> str:
        return str(self.path) if self.index is None else f"{self.path}[{self.index}]"


def pictures_in(path: Path) -> list[Picture]:
    """The pictures of a file: one, all pages of a TIFF, or all of an array (pictures, rows, columns).

    Raises `StoreError` when there are too many, or the file cannot be read.
    """
    if path.suffix.lower() in PAGED:
        count = _page_count(path, _stamp(path))
        return [Picture(path)] if count == 1 else [Picture(path, index) for index in range(count)]
    if path.suffix.lower() not in ARRAYS:
        return [Picture(path)]
    shape = _array(path, _stamp(path)).shape
    if len(shape) < 3 or (len(shape) == 3 and shape[2] in (3, 4)):
        return [Picture(path)]
    if shape[0] > MOST_PICTURES:
        raise _too_many(path, shape[0])
    return [Picture(path, index) for index in range(shape[0])]


def load_values(picture: Picture, raw: RawLayout | None = None) -> NDArray[Any]:
    """Values as stored, (rows, columns) or (rows, columns, 3) in the order R, G, B; true is 255.

    Raises `StoreError` that names the file, says what is wrong with it and what to do.
    """
    path, suffix = picture.path, picture.path.suffix.lower()
    if suffix in ARRAYS:
        values = _array(path, _stamp(path))
        values = values if picture.index is None else values[picture.index]
    elif suffix in RAWS:
        values = _raw(path, raw)
    elif suffix in camera_raw.SUFFIXES:
        values = _from_camera(path, camera_raw.read_mosaic)
    elif suffix == ".exr":
        values = _from_exr(path)
    else:
        values = _image(path, picture.index)
    if values.dtype.kind == "b":
        # As pictures of one bit are read.
        values = values.astype(np.uint8) * np.uint8(255)
    if values.dtype == np.float16:
        # Numbers of so few bits end at 65504, below what white may be.
        values = values.astype(np.float32)
    if values.dtype.kind == "f" and (unknown := int(np.count_nonzero(np.isnan(values)))):
        raise StoreError(
            f"{picture} holds NaN in place of {unknown} of its values. Replace what was too bright by white,"
            " and what is unknown by 0 in all pictures."
        )
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    if values.ndim == 3 and values.shape[2] in (3, 4):
        values = values[..., :3]
    elif values.ndim != 2:
        raise StoreError(
            f"{picture} has shape {values.shape}; a picture is (rows, columns) or (rows, columns, 3)."
            " Save it in that shape."
        )
    if not 0 < values.shape[0] * values.shape[1] <= MOST_PIXELS or max(values.shape) > MOST_PX:
        raise StoreError(f"{picture} is {values.shape[1]} x {values.shape[0]} px, which no camera has.")
    return values


def holds_sensor_values(kind: np.dtype[Any]) -> bool:
    """Whether numbers are as a sensor gives them, not fractions or sums, whose white is any number."""
    return kind.kind in "ui" and kind.itemsize <= 2


def bayer_of(picture: Picture) -> BayerPattern | None:
    """The mosaic that a file itself states, None where its format states none; raises `StoreError`."""
    if picture.path.suffix.lower() not in camera_raw.SUFFIXES:
        return None
    return _from_camera(picture.path, camera_raw.bayer_of)


def load_mosaic(picture: Picture, mapping: Mapping, bit_depth: int) -> NDArray[np.uint16]:
    """A picture as a frame, (rows, columns), DN in ``bit_depth`` bits; raises `StoreError`.

    Pictures in sRGB become linear frames of `DECODED_BITS`.
    """
    return as_mosaic(load_values(picture, mapping.raw), picture, mapping, bit_depth)


def as_mosaic(values: NDArray[Any], picture: Picture, mapping: Mapping, bit_depth: int) -> NDArray[np.uint16]:
    """The same of the values of a picture."""
    if mapping.encoding == "srgb":
        return np.asarray(np.rint(_one_channel(_decoded(values, picture, mapping), mapping)), np.uint16)
    is_scaled = not holds_sensor_values(values.dtype)
    if values.ndim == 3:
        values = _one_channel(values, mapping)
    if is_scaled and mapping.full_scale is not None:
        values = _share_of_white(values, mapping.full_scale) * (2**bit_depth - 1)
    return _whole(values, picture, mapping, bit_depth)


def _share_of_white(values: NDArray[Any], white: float) -> NDArray[Any]:
    """Values as shares of white; sparks become white, and what a filter of a renderer left below 0 black."""
    share = _without_noise(values / white, 1.0)
    if np.count_nonzero(share > 1) <= SPARKS * share.size and share.min() > -FILTERED:
        share = share.clip(0, 1)
    return np.asarray(share)


def _without_noise(values: NDArray[Any], white: float) -> NDArray[Any]:
    """Values below 0 as black where they are so near to it, for a ``white``, as noise of dark pixels is."""
    below = values[values < 0]
    if below.size and below.min() > -_NOISE * white:
        # The square root of the mean square: a few pixels may be further away than noise usually is.
        spread = float(np.sqrt(np.mean(np.square(below, dtype=np.float64))))
        return np.maximum(values, 0) if spread < FILTERED * white else values
    return values


def _one_channel(values: NDArray[Any], mapping: Mapping) -> NDArray[Any]:
    if values.ndim == 2:
        return values
    if mapping.channel != "grey":
        return np.asarray(values[..., ("red", "green", "blue").index(mapping.channel)])
    return np.asarray(values.mean(axis=2, dtype=np.float64))


def _decoded(values: NDArray[Any], picture: Picture, mapping: Mapping) -> NDArray[np.uint16]:
    """Values of sRGB as linear ones, of the same shape, by a table of all that their bits allow."""
    bits = mapping.bit_depth or (8 if values.dtype.itemsize == 1 else 16)
    if values.dtype.kind == "f":
        values = _share_of_white(values, mapping.full_scale or 1.0) * (2**bits - 1)
    return np.asarray(_decoding_table(bits)[_whole(values, picture, mapping, bits)])


@lru_cache(maxsize=4)
def _decoding_table(bits: int) -> NDArray[np.uint16]:
    light = srgb_decode(np.arange(2**bits) / (2**bits - 1))
    return np.asarray(np.rint(light * (2**DECODED_BITS - 1)), np.uint16)


def _whole(values: NDArray[Any], picture: Picture, mapping: Mapping, bit_depth: int) -> NDArray[np.uint16]:
    """Values as whole numbers that fit into the bits, at their lower end; raises `StoreError`."""
    if values.dtype.kind == "f":
        values = np.rint(values)
    if values.dtype.kind in "if":
        values = _without_noise(values, _FULL if mapping.left_aligned else 2**bit_depth - 1)
    if not np.isfinite(values).all() or values.max() > _FULL:
        raise StoreError(
            f"{picture} holds values from {values.min():g} to {values.max():g}; 0 to {_FULL} are possible."
            " State full_scale, the value of white, in the mapping, or save whole numbers."
        )
    if values.min() < 0:
        raise StoreError(
            f"{picture} holds values from {values.min():g} to {values.max():g}, further below 0 than noise"
            " gets. Add one offset to all pictures of the capture, that of black included, so that none is"
            " below 0."
        )
    frame = values.astype(np.uint16)
    if mapping.left_aligned:
        frame = np.right_shift(frame, np.uint16(16 - bit_depth))
    if frame.max() >= 2**bit_depth:
        raise StoreError(
            f"{picture} holds values up to {frame.max()}, more than {bit_depth} bits have. Correct bit_depth"
            " or left_aligned of the mapping."
        )
    return frame


def _stamp(path: Path) -> tuple[int, int]:
    """What tells a file from its earlier content."""
    try:
        size = require_plain(path)
        return size, path.stat().st_mtime_ns
    except OSError as error:
        raise _unread(path, error) from error


@lru_cache(maxsize=1)
def _array(path: Path, stamp: tuple[int, int]) -> NDArray[Any]:
    """An array of pictures; the last is kept, because one file may hold all pictures."""
    return array_file.read_pictures(path)


def _raw(path: Path, layout: RawLayout | None) -> NDArray[Any]:
    if layout is None:
        raise StoreError(
            f"{path} holds pixels without their size. State raw (width_px, height_px, bits) in the mapping."
        )
    kind = np.dtype(np.uint8 if layout.bits == 8 else (">u2" if layout.big_endian else "<u2"))
    wanted = layout.header_bytes + layout.width_px * layout.height_px * kind.itemsize
    data = _bytes(path)
    if len(data) != wanted:
        raise StoreError(
            f"{path} has {len(data)} bytes, {wanted} are wanted for {layout.width_px} x {layout.height_px} px"
            f" of {layout.bits} bits. Correct raw in the mapping."
        )
    values = np.frombuffer(data, kind, offset=layout.header_bytes)
    return values.reshape(layout.height_px, layout.width_px).astype(kind.newbyteorder("="))


def _from_camera(path: Path, read: Callable[[bytes, int], T]) -> T:
    """What is read of a file of camera raw; raises `StoreError`."""
    advice = "Convert it to TIFF of 16 bits without a curve"
    try:
        return read(_bytes(path), MOST_PIXELS)
    except MissingPackageError as error:
        raise StoreError(f"{path} is camera raw. {error} {advice}, or install that.") from error
    except (ValueError, OSError) as error:
        raise StoreError(
            f"{path} cannot be read as camera raw ({error}). {advice}, or leave it out."
        ) from error


def _from_exr(path: Path) -> NDArray[Any]:
    try:
        return open_exr.read_exr(path, MOST_PIXELS)
    except OSError as error:
        raise _unread(path, error) from error
    except ValueError as error:
        raise StoreError(f"{path} cannot be read as OpenEXR ({error}). Save it again, or as TIFF.") from error


def _too_many(path: Path, count: int) -> StoreError:
    return StoreError(f"{path} holds {count} pictures; at most {MOST_PICTURES} are possible. Split it.")


@lru_cache(maxsize=MOST_PICTURES)
def _page_count(path: Path, stamp: tuple[int, int]) -> int:
    """Pages of one size in a file; 1 where a page is a preview, or whoever loads it says what is wrong."""
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            # Of damaged tags, too; whoever loads the picture says what is wrong.
            warnings.simplefilter("ignore")
            with Image.open(path) as head:
                count, sizes = int(getattr(head, "n_frames", 1)), set()
                for page in range(count if count <= MOST_PICTURES else 0):
                    head.seek(page)
                    sizes.add(head.size)
    except UnidentifiedImageError:
        heads = heads_of(_paged_bytes(path, stamp), MOST_PICTURES + 1)
        count, sizes = max(len(heads), 1), {(head.width_px, head.height_px) for head in heads}
    except (*_UNREADABLE, Image.DecompressionBombError):
        return 1
    if count > MOST_PICTURES:
        raise _too_many(path, count)
    return count if len(sizes) == 1 else 1


@lru_cache(maxsize=1)
def _paged_bytes(path: Path, stamp: tuple[int, int]) -> bytes:
    """The bytes of a file of several pictures; the last is kept, because each page is asked for."""
    return _bytes(path)


def _image(path: Path, index: int | None = None) -> NDArray[Any]:
    from PIL import Image

    data = _bytes(path) if index is None else _paged_bytes(path, _stamp(path))
    if declares_too_much(data):
        raise _damaged(path)
    heads = heads_of(data, 1 if index is None else index + 1)
    if heads and heads[-1].is_apart and heads[-1].bits > _MOST_BITS_APART:
        raise StoreError(
            f"{path} stores its colours as separate planes of {heads[-1].bits} bits, which cannot be read."
            " Save it with interleaved colours (planar configuration: contiguous)."
        )
    try:
        # The head is read first: a small file may claim a picture that no memory holds.
        width, height = _claimed_px(data, heads)
        if width * height > MOST_PIXELS:
            raise StoreError(f"{path} claims {width} x {height} px, which no camera has. Leave it out.")
        # Through memory, because OpenCV cannot open every path on Windows.
        found = decode(data, index, heads[-1] if heads else None)
    except (OSError, ValueError, SyntaxError) as error:
        raise _damaged(path) from error
    except (Warning, Image.DecompressionBombError) as error:
        raise StoreError(f"{path} claims more pixels than a camera has. Leave it out.") from error
    if found is None:
        raise _damaged(path)
    if heads and heads[-1].is_negative and found.dtype == np.uint16:
        # OpenCV turns those of 8 bits into positives, but not these.
        found = np.iinfo(np.uint16).max - found
    return np.asarray(found[..., 2::-1] if found.ndim == 3 and found.shape[2] >= 3 else found)


def _claimed_px(data: bytes, heads: list[Head]) -> tuple[int, int]:
    """Width and height as the head of a file says; raises what Pillow raises."""
    import io

    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(data)) as head:
                return head.size
    except UnidentifiedImageError:
        # Pillow knows neither PFM in colour nor TIFF of 64 bits; OpenCV does.
        if not heads:
            raise
        return heads[-1].width_px, heads[-1].height_px


def _bytes(path: Path) -> bytes:
    try:
        return read_bounded(path, MOST_BYTES)
    except OSError as error:
        raise _unread(path, error) from error


def _damaged(path: Path) -> StoreError:
    return StoreError(
        f"{path} cannot be decoded as a picture: it is damaged, or of a kind that is not read. Copy it again,"
        " save it as plain PNG or TIFF, or name only good pictures with files of the mapping."
    )


def _unread(path: Path, error: OSError) -> StoreError:
    reason = error.strerror or str(error)
    if error.errno == errno.ENOENT and path.is_symlink():
        reason = "it is a link to a file that does not exist"
    return StoreError(
        f"{path} cannot be read ({reason}). Replace it with a plain picture file, or remove it."
    )
