"""The twin of a scene with every pattern of a plan rendered once: scans of it cost little but their noise."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.proof.lasting.levels import at_half_level
from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import digitise
from dsl_core.patterns.images import pattern_image
from dsl_core.pipeline import fit_plan
from dsl_core.simulation.sim_devices import open_twin

Key = tuple[str, int, float]


def token_image(plan: CapturePlan, shot: Shot) -> NDArray[np.uint8]:
    """Instead of the pattern of a shot, its name: role, pattern and level as bytes of a tiny image."""
    shot = plan.original(shot)
    if shot.role == "black":
        return np.zeros((1, 8), np.uint8)
    role = ("code", "spectral", "white").index(shot.role) + 1
    return np.array([[role, *divmod(shot.pattern, 256), round(255 * shot.level), 0, 0, 0, 0]], np.uint8)


@dataclass
class RenderedScene:
    """Light of every pattern of ``plan`` on a scene, DN per ms above black."""

    plan: CapturePlan
    calibration: Rig
    rates: dict[bytes, NDArray[np.float32]]

    def open(self, seed: int = 0) -> DeviceRig:
        """A rig that is shown `token_image` and takes pictures with noise of this seed."""
        state = _State(self, np.random.Generator(np.random.SFC64(seed)))
        return DeviceRig(
            "rendered", _Camera(state), _Projector(state), calibration=self.calibration, sleep=lambda s: None
        )


def render(plan: CapturePlan, **options: str) -> RenderedScene:
    """Render what a twin with these options sees of every pattern of a plan, fitted to it."""
    with open_twin(options) as rig:
        plan, world, calibration = fit_plan(plan, rig), rig.camera.world, rig.calibration  # type: ignore[attr-defined]
        assert calibration is not None
        rates: dict[bytes, NDArray[np.float32]] = {}
        for shot in (*plan.shots(), *(at_half_level(each) for each in plan.shots() if each.role == "white")):
            key = token_image(plan, shot).tobytes()
            if key not in rates:
                world.show(pattern_image(plan, shot))
                rates[key] = world.rate()
    return RenderedScene(plan, calibration, rates)


@dataclass
class _State:
    scene: RenderedScene
    rng: np.random.Generator
    shown: bytes = field(default_factory=lambda: bytes(8))
    exposure_ms: float = 1.0
    count: int = 0


class _Camera(Camera):
    def __init__(self, state: _State) -> None:
        self._state = state

    @property
    def info(self) -> CameraInfo:
        width, height = self._state.scene.plan.camera_size_px
        sensor = self._state.scene.calibration.sensor
        return CameraInfo("rendered", "1", width, height, sensor.bayer, sensor.bit_depth, (0.01, 1e5))

    def configure(self, exposure_ms: float) -> float:
        self._state.exposure_ms = exposure_ms
        return exposure_ms

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        state = self._state
        state.count += 1
        rate = state.scene.rates[state.shown]
        pixels = digitise(state.scene.calibration.sensor, rate * np.float32(state.exposure_ms), state.rng)
        return Frame(pixels, state.exposure_ms, float(state.count), state.count)


class _Projector(Projector):
    def __init__(self, state: _State) -> None:
        self._state = state

    @property
    def info(self) -> ProjectorInfo:
        width, height = self._state.scene.plan.projector_size_px
        return ProjectorInfo("rendered", "1", width, height, 50.0, 1000.0 / 60.0)

    def show(self, image: NDArray[np.uint8]) -> None:
        self._state.shown = image.tobytes()
