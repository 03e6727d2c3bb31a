"""Pictures of another program as a source of frames."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.pictures.arrange import Arrangement, arrange
from dsl_core.io.pictures.mapping import Mapping
from dsl_core.io.pictures.picture_file import (
    DECODED_BITS,
    Picture,
    as_mosaic,
    holds_sensor_values,
    load_mosaic,
    load_values,
)
from dsl_core.model.plan import CapturePlan, NoSpectral, Setting, Shot
from dsl_core.words import readable

#: Nobody notes exposures next to pictures; ratios within a capture are all that decoding needs.
EXPOSURE_MS = 1.0


@dataclass(frozen=True)
class PictureScan:
    """A `FrameSource` that reads the pictures of a mapping when they are requested.

    Where white or black was not captured, the brightest or darkest value of each pixel stands for it.
    ``limit_dn`` is where values end, None if at the largest number of ``bit_depth``.
    """

    root: Path
    mapping: Mapping
    arrangement: Arrangement
    plan: CapturePlan
    bit_depth: int
    limit_dn: int | None = None

    @property
    def full_scale_dn(self) -> int:
        """The value of a saturated pixel."""
        return 2**self.bit_depth - 1 if self.limit_dn is None else self.limit_dn

    @property
    def made_up(self) -> tuple[str, ...]:
        """What of white and black was not captured."""
        found = {"white": self.arrangement.white, "black": self.arrangement.black}
        return tuple(name for name, picture in found.items() if picture is None)

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The frame of a shot, (rows, columns), DN; raises `StoreError` naming the picture that is wrong."""
        if shot.role == "white":
            return self.load(self.arrangement.white) if self.arrangement.white else self._extremes[1]
        if shot.role == "black":
            return self.load(self.arrangement.black) if self.arrangement.black else self._extremes[0]
        return self.load(self.arrangement.frames[shot.pattern])

    @cached_property
    def _extremes(self) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
        """The darkest and the brightest value of each pixel."""
        low = high = self.load(self.arrangement.frames[0])
        for picture in self.arrangement.frames[1:]:
            frame = self.load(picture)
            low, high = np.minimum(low, frame), np.maximum(high, frame)
        return low, high

    def load(self, picture: Picture) -> NDArray[np.uint16]:
        """A picture as a frame, (rows, columns), DN; raises `StoreError` naming it when it is wrong."""
        frame = load_mosaic(picture, self.mapping, self.bit_depth)
        width, height = self.plan.camera_size_px
        if frame.shape != (height, width):
            raise StoreError(
                f"{picture} is {frame.shape[1]} x {frame.shape[0]} px, the first {width} x {height} px."
                " Name only pictures of one camera and size with files of the mapping."
            )
        return frame

    def fingerprint(self) -> str:
        """What tells these pictures, mapped like this, from all others."""
        # Mappings of earlier versions, which had no encoding, keep their fingerprint.
        told = {"unsure", "name"} | ({"encoding"} if self.mapping.encoding == "linear" else set())
        digest = hashlib.sha256(self.mapping.model_dump_json(exclude=told).encode())
        for shot in self.plan.shots():
            digest.update(self.read(shot).tobytes())
        return digest.hexdigest()


def open_pictures(root: Path, mapping: Mapping) -> PictureScan:
    """The pictures of a folder as a scan; raises `StoreError` saying which are missing or wrong."""
    found = arrange(root, mapping)
    first = load_values(found.frames[0], mapping.raw)
    plan = CapturePlan(
        name=mapping.name or readable(root.absolute().name),
        camera_size_px=(first.shape[1], first.shape[0]),
        projector_size_px=mapping.projector_size_px,
        code=found.code,
        spectral=NoSpectral(),
        settings=(Setting(exposure_ms=EXPOSURE_MS, level=1.0),),
        code_settings=(0,),
    )
    stored_bits = 8 if first.dtype.itemsize == 1 else 16
    bits = DECODED_BITS if mapping.encoding == "srgb" else mapping.bit_depth or stored_bits
    return PictureScan(
        root, mapping, found, plan, bits, _limit_dn(found.frames[0], first.dtype, mapping, bits)
    )


def _limit_dn(picture: Picture, kind: np.dtype[Any], mapping: Mapping, bit_depth: int) -> int | None:
    """Where the values of frames end, DN, by the mapping; None if at the largest number of their bits."""
    most = 2 ** (16 if mapping.left_aligned else mapping.bit_depth or 8 * kind.itemsize) - 1
    if mapping.full_scale is None or not holds_sensor_values(kind) or mapping.full_scale >= most:
        return None
    end = np.full((1, 1), mapping.full_scale, kind)
    return max(int(as_mosaic(end, picture, mapping, bit_depth)[0, 0]), 1)
