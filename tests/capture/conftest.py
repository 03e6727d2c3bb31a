"""A bench of fake devices that records what it is sent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot


@dataclass
class Bench:
    """What the fake devices were sent, and what the camera does instead of taking a picture."""

    shown: list[NDArray[np.uint8]] = field(default_factory=list)
    exposures_ms: list[float] = field(default_factory=list)
    snapped: list[tuple[int, int]] = field(default_factory=list)
    slept_s: list[float] = field(default_factory=list)
    before_snap: Callable[[int, int], Frame | None] = lambda shot, attempt: None
    before_show: Callable[[], None] = lambda: None


class BenchCamera(Camera):
    """Pictures are the mean of the pattern shown, plus noise of shot and attempt."""

    def __init__(self, bench: Bench) -> None:
        self.bench = bench
        self.exposure_ms = 0.0
        self.shot = self.attempt = self.count = 0

    @property
    def info(self) -> CameraInfo:
        return CameraInfo("fake", "1", 24, 16, "RGGB", 12, (1.0, 100.0))

    def configure(self, exposure_ms: float) -> float:
        self.bench.exposures_ms.append(exposure_ms)
        self.exposure_ms = exposure_ms
        return exposure_ms

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        self.shot, self.attempt = shot_index, attempt

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        self.bench.snapped.append((self.shot, self.attempt))
        instead = self.bench.before_snap(self.shot, self.attempt)
        if instead is not None:
            return instead
        self.count += 1
        rng = np.random.default_rng((self.shot, self.attempt))
        pixels = rng.integers(0, 50, (16, 24)) + int(self.bench.shown[-1].mean())
        return Frame(pixels.astype(np.uint16), self.exposure_ms, 0.1 * self.count, self.count)


class BenchProjector(Projector):
    def __init__(self, bench: Bench) -> None:
        self.bench = bench

    @property
    def info(self) -> ProjectorInfo:
        return ProjectorInfo("fake", "2", 32, 18, 5.0, 16.0)

    def show(self, image: NDArray[np.uint8]) -> None:
        self.bench.before_show()
        self.bench.shown.append(image)


@pytest.fixture
def bench() -> Bench:
    return Bench()


@pytest.fixture
def rig(bench: Bench) -> DeviceRig:
    return DeviceRig("bench", BenchCamera(bench), BenchProjector(bench), sleep=bench.slept_s.append)


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


def numbered_pattern(plan: CapturePlan, shot: Shot) -> NDArray[np.uint8]:
    width, height = plan.projector_size_px
    return np.full((height, width), shot.index + 1, np.uint8)


@pytest.fixture
def pattern() -> Callable[[CapturePlan, Shot], NDArray[np.uint8]]:
    """A pattern that says which shot it is for."""
    return numbered_pattern
