"""What a scan will take, said before it starts, and whether the disk has room for it."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from dsl_core.errors import StoreError
from dsl_core.io.reading import there
from dsl_core.model.plan import CapturePlan

#: Share of the raw size that compressed frames take at most in practice (measured 0.27 to 0.5 on 12 bit
#: noise), and what is left free besides.
COMPRESSED_SHARE = 0.6
MARGIN_BYTES = 64 << 20


def needed_bytes(plan: CapturePlan, frames: int) -> int:
    """Bytes to have free for that many frames of a plan."""
    return int(plan.raw_bytes * frames / plan.shot_count * COMPRESSED_SHARE) + MARGIN_BYTES


def check_space(folder: Path, plan: CapturePlan, frames: int) -> None:
    """Raise `StoreError` when the disk under ``folder`` cannot take that many frames of the plan."""
    place, need = _existing(folder), needed_bytes(plan, frames)
    free = shutil.disk_usage(place).free
    if free < need:
        raise StoreError(
            f"The scan needs about {need / 1e6:.0f} MB for {frames} frames,"
            f" but {place} has {free / 1e6:.0f} MB free. Free some space or choose another drive."
        )


@dataclass(frozen=True)
class Estimate:
    """Frames, seconds on the rig, bytes on disk (compressed, with a margin) and bytes free there."""

    frames: int
    seconds: float
    needed_bytes: int
    free_bytes: int

    def __str__(self) -> str:
        return (
            f"{self.frames} frames, {self.seconds / 60:.1f} min on the rig, {self.needed_bytes / 1e6:.0f} MB"
            f" of {self.free_bytes / 1e6:.0f} MB free"
        )


def estimate(plan: CapturePlan, folder: Path, latency_ms: float) -> Estimate:
    """What a plan takes on a rig whose projector needs ``latency_ms`` per frame, saved in ``folder``."""
    return Estimate(
        plan.shot_count,
        plan.duration_s(latency_ms),
        needed_bytes(plan, plan.shot_count),
        shutil.disk_usage(_existing(folder)).free,
    )


def _existing(folder: Path) -> Path:
    """The folder, or the nearest one above it that can be seen."""
    return next(path for path in (folder, *folder.absolute().parents) if there(path))
