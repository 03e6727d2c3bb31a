"""What a scan will take, said before it starts."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from dsl_core.io.scan.session import needed_bytes
from dsl_core.model.plan import CapturePlan


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
    """What a plan takes on a rig whose projector needs ``latency_ms`` a frame, stored in ``folder``."""
    place = next(p for p in (folder, *folder.absolute().parents) if p.exists())
    return Estimate(
        plan.shot_count,
        plan.duration_s(latency_ms),
        needed_bytes(plan, plan.shot_count),
        shutil.disk_usage(place).free,
    )
