"""A published dataset as a source of frames, and a scan written as a published dataset.

The published frames are demosaiced, this engine works on raw mosaics. On import a mosaic is put
together again from the channel that the Bayer pattern has at each pixel; where the demosaicing kept
measured samples (ours does; OpenCV's bilinear one does away from the border) this is the raw frame. The
published frames are cropped, so the pattern may start at any phase: it is an argument, not a guess. Values
are left-aligned in 16 bit in the files and right-aligned in ``bit_depth`` bits here.
"""

from __future__ import annotations

import hashlib
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import StoreError
from dsl_core.io.published.layout import (
    DEPTH_NAME,
    FOLDERS,
    FileRecord,
    FolderSurvey,
    Place,
    PngInfo,
    file_name,
    find_folder,
    folder_name,
    probe_png,
    survey,
)
from dsl_core.io.records import read_record
from dsl_core.io.staging import FolderKind, staged
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Setting, Shot
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.demosaic import demosaic
from dsl_core.optics.sensor import bayer_channels
from dsl_core.progress import NoProgress, Progress

#: Our addition to the layout, so that patterns and settings need not be told again.
PLAN_NAME = "plan.json"
PUBLISHED_SETTINGS = (Setting(exposure_ms=160, level=0.2), Setting(exposure_ms=320, level=0.8))
_CONTAINER_BITS = 16
#: The end of a PNG with the checksums of its pixels and whatever a program may have noted after them.
_END_BYTES = 256


@dataclass(frozen=True)
class PublishedScan:
    """A `FrameSource` that reads the files of a published dataset when they are requested."""

    root: Path
    plan: CapturePlan
    bayer: BayerPattern
    bit_depth: int
    found: FolderSurvey = field(repr=False)

    @property
    def table(self) -> list[FileRecord]:
        """Every file that the plan needs or that is in its way."""
        return self.found.records

    def require_frames(self) -> None:
        """Raise `StoreError` naming the first frame of the plan that cannot be used, and how many more."""
        lacking = [s for s in self.plan.shots() if (s.role, s.setting, s.pattern) not in self.found.files]
        if lacking:
            first = self.found.by_place[lacking[0].role, lacking[0].setting, lacking[0].pattern]
            raise StoreError(
                f"{self.root} lacks {len(lacking)} of {self.plan.shot_count} frames: {first.expected} is"
                f" {first.status} ({first.advice}). Complete the folder; the import's table lists every file."
            )
        self._require_left_aligned()

    def _require_left_aligned(self) -> None:
        """Raise `StoreError` when values end where ``bit_depth`` does, with bits that left-aligned ones lack.

        The brightest frames come first, so that the first one settles it as a rule.
        """
        most, unused = 2**self.bit_depth - 1, 2 ** (_CONTAINER_BITS - self.bit_depth) - 1
        bits = 0
        for _, path in sorted(self.found.files.items(), key=lambda each: each[0][0] != "white"):
            rgb = _read_rgb(path)
            if rgb.dtype.itemsize == 1 or rgb.max() > most:
                return
            # What a program put between the samples may have any bits, at the border everywhere.
            bits |= int(np.bitwise_or.reduce(self._sampled(rgb)[1:-1, 1:-1], axis=None))
        if bits & unused:
            raise StoreError(
                f"No image of {self.root} holds a value above {most}, and their lowest bits are in use: their"
                f" {self.bit_depth} bits are right-aligned, but the published layout has them left-aligned in"
                f" 16. Multiply all values by {unused + 1} and save the images again."
            )

    def read(self, shot: Shot) -> NDArray[np.uint16]:
        """The mosaic of a shot, shape (rows, columns), DN; raises `StoreError` when it is not there."""
        place: Place = (shot.role, shot.setting, shot.pattern)
        path = self.found.files.get(place)
        if path is None:
            record = self.found.by_place[place]
            raise StoreError(f"{self.root / record.expected} is {record.status}: {record.advice}.")
        return self._sampled(_right_aligned(_read_rgb(path), self.bit_depth))

    def _sampled(self, rgb: NDArray[Any]) -> NDArray[Any]:
        """What the mosaic has at each pixel, (rows, columns), of an image (rows, columns, 3)."""
        channels = bayer_channels(self.bayer, *rgb.shape[:2])
        return np.take_along_axis(rgb, channels[..., None], axis=-1)[..., 0]

    def fingerprint(self) -> str:
        """What tells this dataset from every other, whatever its folder is called.

        Of each file size and end are looked at: a PNG ends with checksums of its pixels.
        """
        digest = hashlib.sha256()
        for place, path in sorted(self.found.files.items()):
            with path.open("rb") as file:
                size = file.seek(0, os.SEEK_END)
                file.seek(max(size - _END_BYTES, 0))
                digest.update(repr((place, size, file.read())).encode())
        return digest.hexdigest()


def open_dataset(root: Path, bayer: BayerPattern = "RGGB", bit_depth: int = 12) -> PublishedScan:
    """Open a dataset folder; look at ``table`` for what is missing or misnamed.

    The plan is that of ``plan.json``, otherwise the published one (640 x 360 projector, 318
    lines, 160 ms at level 0.2 and 320 ms at 0.8) with the size of the first scan-line image. Raises
    `StoreError` when the folder holds no such image or its plan is damaged.
    """
    if not root.is_dir():
        raise StoreError(f"{root} is not a folder. Give the folder that contains ldr_exposure1.")
    stored = root / PLAN_NAME
    plan = (
        read_record(stored, CapturePlan, "Correct it, or delete it.", fault="is not a capture plan")
        if stored.is_file()
        else _published_plan(root)
    )
    plan = plan.model_copy(update={"sentinels": None})
    return PublishedScan(root, plan, bayer, bit_depth, survey(root, plan))


def export_dataset(
    source: FrameSource,
    folder: Path,
    *,
    bayer: BayerPattern = "RGGB",
    bit_depth: int = 12,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> list[Path]:
    """Write a scan in the published layout; return the files.

    The published code reads two settings; more are numbered on. Raises `StoreError`, also for frames the
    source does not have, and `Cancelled`; then nothing is written.
    """
    progress = progress or NoProgress()
    # Sentinels have no place in that layout, and are not needed for the result.
    plan = source.plan.model_copy(update={"sentinels": None})
    with staged([folder], overwrite=overwrite, kind=DATASET_FOLDER) as (draft,):
        own = [shot for shot in source.plan.shots() if shot.role != "sentinel"]
        for done, shot in enumerate(own):
            progress.report("export", done, len(own))
            target = draft / folder_name(shot.role, shot.setting) / file_name(shot.role, shot.pattern)
            _write_rgb(source.read(shot), target, bayer, bit_depth)
        (draft / PLAN_NAME).write_text(plan.model_dump_json(indent=1) + "\n", encoding="utf-8")
        names = sorted(file.relative_to(draft) for file in draft.rglob("*") if file.is_file())
    return [folder / name for name in names]


def _is_dataset(folder: Path) -> bool:
    return (folder / folder_name("spectral", 0)).is_dir()


def _is_of_dataset(entry: Path) -> bool:
    ours = "|".join(name.format(k=r"\d+") for name in FOLDERS.values())
    return entry.name in {PLAN_NAME, DEPTH_NAME} or re.fullmatch(ours, entry.name) is not None


#: What an exported dataset may replace.
DATASET_FOLDER = FolderKind("a published dataset", _is_dataset, _is_of_dataset)


def _write_rgb(mosaic: NDArray[np.uint16], path: Path, bayer: BayerPattern, bit_depth: int) -> None:
    import cv2

    # float32 holds 16 bit exactly, so measured samples are restored to the bit.
    image = np.moveaxis(demosaic(mosaic.astype(np.float32), bayer), 0, -1)
    values = np.left_shift(np.rint(image).astype(np.uint16), np.uint16(_CONTAINER_BITS - bit_depth))
    path.parent.mkdir(parents=True, exist_ok=True)
    data = cv2.imencode(".png", np.ascontiguousarray(values[..., ::-1]), [cv2.IMWRITE_PNG_COMPRESSION, 1])[1]
    path.write_bytes(data.tobytes())


def _read_rgb(path: Path) -> NDArray[Any]:
    """An image as stored, (rows, columns, 3) in the order R, G, B; raises `StoreError`."""
    import cv2

    # Through memory, because OpenCV cannot open every path on Windows.
    try:
        image = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    except (OSError, cv2.error):
        image = None
    if image is None or image.ndim != 3:
        raise StoreError(f"{path} is damaged: it cannot be decoded. Copy it again or capture it again.")
    return np.asarray(image)[..., ::-1]


def _right_aligned(image: NDArray[np.generic], bit_depth: int) -> NDArray[np.uint16]:
    stored_bits = 8 * image.dtype.itemsize
    values = image.astype(np.uint16)
    if stored_bits >= bit_depth:
        return np.right_shift(values, np.uint16(stored_bits - bit_depth))
    return np.left_shift(values, np.uint16(bit_depth - stored_bits))


def _published_plan(root: Path) -> CapturePlan:
    for setting, values in enumerate(PUBLISHED_SETTINGS):
        folder = find_folder(root, "spectral", setting, values)
        for path in sorted(folder.glob("*.png")) if folder else []:
            info = probe_png(path)
            if isinstance(info, PngInfo):
                return CapturePlan(
                    name=root.name,
                    camera_size_px=(info.width_px, info.height_px),
                    settings=PUBLISHED_SETTINGS,
                )
    raise StoreError(
        f"{root} is not a published dataset: no image was found in ldr_exposure1 or ldr_exposure2."
        " Give the folder that contains them."
    )
