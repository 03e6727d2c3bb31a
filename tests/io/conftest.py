"""A small plan and frames with noise, so that no two agree."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from dsl_core.io.scan.folder import ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot

FrameOf = Callable[[Shot], Frame]


@pytest.fixture
def plan() -> CapturePlan:
    return CapturePlan(
        camera_size_px=(24, 16),
        projector_size_px=(32, 18),
        code=GrayCode(rows=False),
        spectral=LineComb(width_px=2, step_px=2, period_px=8),
        settings=(Setting(exposure_ms=10.0, level=0.4), Setting(exposure_ms=20.0, level=0.8)),
        code_settings=(0,),
    )


@pytest.fixture
def frame_of() -> FrameOf:
    def make(shot: Shot) -> Frame:
        rng = np.random.default_rng((7, shot.index))
        pixels = rng.integers(200, 4000, (16, 24)).astype(np.uint16)
        return Frame(pixels, shot.exposure_ms, 0.5 * shot.index + 1.0, shot.index + 1)

    return make


@pytest.fixture
def session(tmp_path: Path, plan: CapturePlan, frame_of: FrameOf) -> Path:
    """A finished session."""
    folder = tmp_path / "scan.dsl"
    with ScanWriter.create(folder, plan) as writer:
        for shot in writer.missing():
            writer.write(shot, frame_of(shot))
    return folder
