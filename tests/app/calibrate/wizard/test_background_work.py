"""The camera that a wizard watches: which of its frames are worth showing."""

from __future__ import annotations

import numpy as np
import pytest
from dsl_app.calibrate.wizard.background_work import MEMORY_S, WatchedCamera

from dsl_core.devices.base import Camera, CameraInfo
from dsl_core.model.frames import Frame
from dsl_core.simulation.sim_devices import open_twin

FULL_DN = 4095


class Scripted(Camera):
    """A camera that takes the frames it is given."""

    def __init__(self, frames: list[Frame], info: CameraInfo) -> None:
        self._frames, self._info = frames, info

    @property
    def info(self) -> CameraInfo:
        return self._info

    def configure(self, exposure_ms: float) -> float:
        return exposure_ms

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        return self._frames.pop(0)

    def close(self) -> None:
        self._frames.clear()


def frame(level_dn: int) -> Frame:
    return Frame(np.full((14, 14), level_dn, np.uint16), 10.0)


@pytest.fixture(scope="module")
def info() -> CameraInfo:
    return open_twin({"size": "32x24"}).camera.info


def shown(levels_dn: list[int], info: CameraInfo) -> list[int | None]:
    """The level that is shown after each frame, None where nothing new is."""
    assert info.bit_depth == 12
    camera = WatchedCamera(Scripted([frame(level) for level in levels_dn], info))
    found: list[int | None] = []
    for level in levels_dn:
        assert camera.snap().pixels[0, 0] == level, "every frame is passed on"
        taken = camera.take_frame()
        found.append(None if taken is None else int(taken.pixels[0, 0]))
    return found


def test_dark_frames_between_patterns_are_not_shown(info: CameraInfo) -> None:
    assert shown([1000, 20, 900, 400, 600], info) == [1000, None, 900, None, 600]


def test_what_a_camera_adds_to_black_does_not_make_black_worth_showing(info: CameraInfo) -> None:
    # A small target: its picture is hardly twice as bright as the black before and after it.
    assert shown([450, 232, 450, 232, 440], info) == [450, None, 450, None, 440]
    assert shown([2121, 232, 457, 232], info)[-1] is None


def test_black_does_not_flash_while_the_target_stays_as_bright(info: CameraInfo) -> None:
    now = 100.0
    levels = (1000, 900, 50)
    camera = WatchedCamera(Scripted([frame(level) for level in levels], info), clock=lambda: now)
    found = []
    for _ in levels:
        camera.snap()
        taken = camera.take_frame()
        found.append(None if taken is None else int(taken.pixels[0, 0]))
        now += 0.6 * MEMORY_S
    assert found == [1000, 900, None]


def test_a_saturated_frame_is_shown_only_where_there_is_no_other(info: CameraInfo) -> None:
    assert shown([FULL_DN], info) == [FULL_DN]
    assert shown([1000, FULL_DN, 900], info) == [1000, None, 900]
    # A test shot begins bright; the black after it is not worth more.
    assert shown([FULL_DN, 230, 1200, 230], info) == [FULL_DN, None, 1200, None]


def test_the_brightest_frame_is_forgotten_after_a_while(info: CameraInfo) -> None:
    now = 100.0
    frames = [frame(level) for level in (1000, 50, 50)]
    camera = WatchedCamera(Scripted(frames, info), clock=lambda: now)
    camera.snap()
    assert camera.take_frame() is not None
    camera.snap()
    assert camera.take_frame() is None
    now += MEMORY_S + 0.1
    camera.snap()
    assert camera.take_frame() is not None
    assert camera.take_frame() is None, "a frame is taken once"


def test_a_darker_target_is_shown_at_once_after_another_one(info: CameraInfo) -> None:
    camera = WatchedCamera(Scripted([frame(level) for level in (1000, 400, 1000, 400)], info))
    for forgets in (False, True):
        camera.snap()
        if forgets:
            camera.forget()
        camera.snap()
        taken = camera.take_frame()
        assert taken is not None
        assert taken.pixels[0, 0] == (400 if forgets else 1000)
