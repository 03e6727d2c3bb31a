"""A rig whose light, room or scene changes during a scan, while all that the devices say looks right."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.model.frames import Frame
from dsl_core.optics.sensor import digitise
from tests.cases.rendered_rig import RenderedScene


def steady(shot: int) -> float:
    """No change."""
    return 1.0


def from_shot(at: int, before: float, after: float) -> Callable[[int], float]:
    """A change that stays: also for old shots that are taken once more after it."""
    seen = 0

    def value(shot: int) -> float:
        nonlocal seen
        seen = max(seen, shot)
        return after if seen >= at else before

    return value


@dataclass(frozen=True)
class Change:
    """What happens at each shot: factors of the projector's light, the room's and the exposure.

    ``scene`` says which of the scenes of `changing` is there, ``most_dn`` what counts end at.
    """

    light: Callable[[int], float] = steady
    room: Callable[[int], float] = steady
    exposure: Callable[[int], float] = steady
    scene: Callable[[int], int] = lambda shot: 0
    most_dn: Callable[[int], float] = lambda shot: 65535


@dataclass
class _State:
    scenes: Sequence[RenderedScene]
    change: Change
    rng: np.random.Generator
    shown: bytes = field(default_factory=lambda: bytes(8))
    exposure_ms: float = 1.0
    count: int = 0
    shot: int = 0


def changing(scenes: Sequence[RenderedScene], change: Change, seed: int = 0) -> DeviceRig:
    """A rig over rendered scenes (`tests.cases.rendered_rig`) that changes as told."""
    state = _State(scenes, change, np.random.Generator(np.random.SFC64(seed)))
    rig = scenes[0].open(seed)
    return replace(
        rig, camera=_Camera(state, rig.camera.info), projector=_Projector(state, rig.projector.info)
    )


def shifted(scene: RenderedScene, x_px: int, y_px: int = 0) -> RenderedScene:
    """The scene as a camera sees it that has turned by whole pixels (even: the mosaic stays)."""
    rates = {key: np.roll(rate, (y_px, x_px), (0, 1)) for key, rate in scene.rates.items()}
    return replace(scene, rates=rates)


class _Camera(Camera):
    def __init__(self, state: _State, info: CameraInfo) -> None:
        self._state, self._info = state, info

    @property
    def info(self) -> CameraInfo:
        return self._info

    def configure(self, exposure_ms: float) -> float:
        self._state.exposure_ms = exposure_ms
        return exposure_ms

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        self._state.shot = shot_index

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        state = self._state
        state.count += 1
        scene = state.scenes[state.change.scene(state.shot)]
        dark = scene.rates[bytes(8)]
        light: NDArray[np.float32] = scene.rates[state.shown] - dark
        rate = dark * np.float32(state.change.room(state.shot)) + light * np.float32(
            state.change.light(state.shot)
        )
        exposure_ms = state.exposure_ms * state.change.exposure(state.shot)
        pixels = digitise(scene.calibration.sensor, rate * np.float32(exposure_ms), state.rng)
        pixels = np.minimum(pixels, np.uint16(state.change.most_dn(state.shot)))
        return Frame(pixels, state.exposure_ms, float(state.count), state.count)


class _Projector(Projector):
    def __init__(self, state: _State, info: ProjectorInfo) -> None:
        self._state, self._info = state, info

    @property
    def info(self) -> ProjectorInfo:
        return self._info

    def show(self, image: NDArray[np.uint8]) -> None:
        self._state.shown = image.tobytes()
