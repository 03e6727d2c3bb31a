"""The projector's window as a program: it shows, refuses and ends with whoever started it."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator

import numpy as np
import pytest

from dsl_core.devices.drivers.screen import ScreenProjector, ScreenSettings
from dsl_core.errors import DeviceError

ALONE = ScreenSettings(platform="offscreen", latency_ms=20.0, mode="6500 K")


@pytest.fixture(scope="module")
def projector() -> Iterator[ScreenProjector]:
    with ScreenProjector(ALONE) as opened:
        yield opened


def test_it_shows_grey_and_colour_and_refuses_the_rest(projector: ScreenProjector) -> None:
    height, width = projector.info.height_px, projector.info.width_px
    for shape in ((height, width), (height, width, 3)):
        projector.show(np.full(shape, 7, np.uint8))
    with pytest.raises(DeviceError, match="Make the pattern for its size"):
        projector.show(np.zeros((height, width + 1), np.uint8))


def test_a_pattern_is_painted_before_it_counts_as_shown(projector: ScreenProjector) -> None:
    info = projector.info
    assert (info.mode, info.latency_ms) == ("6500 K", 20.0)
    before_s = time.monotonic()
    projector.show(np.zeros((info.height_px, info.width_px), np.uint8))
    assert before_s <= projector.shown_at_s <= time.monotonic() - 0.02


@pytest.mark.slow
def test_a_screen_that_is_not_there_is_named() -> None:
    with pytest.raises(DeviceError, match=r"no screen 'HDMI-9'; screens: .*change screen in the profile"):
        ScreenProjector(ALONE.model_copy(update={"screen": "HDMI-9"}))


@pytest.mark.parametrize(("period_ms", "is_told"), [(16.71, False), (33.3, True)])
def test_a_screen_that_changes_its_rate_is_told(period_ms: float, is_told: bool) -> None:
    said = {"model": "m", "serial": "", "width_px": 4, "height_px": 3, "frame_period_ms": 16.7}
    shown = {"painted_s": 0.0, "frame_period_ms": period_ms}
    program = (
        f"import sys; print({json.dumps(json.dumps(said))}, flush=True); sys.stdin.buffer.readline();"
        f" print({json.dumps(json.dumps(shown))}, flush=True); sys.stdin.buffer.read()"
    )
    with ScreenProjector(ALONE, [sys.executable, "-c", program]) as projector:
        before = projector.info
        projector.show(np.zeros((3, 4), np.uint8))
        assert (projector.info != before) == is_told
        assert projector.info.frame_period_ms == (period_ms if is_told else 16.7)


def test_a_program_that_ended_is_told_and_closes_twice() -> None:
    said = {"model": "m", "serial": "", "width_px": 4, "height_px": 3, "frame_period_ms": 16.7}
    command = [sys.executable, "-c", f"print({json.dumps(json.dumps(said))})"]
    projector = ScreenProjector(ALONE, command)
    with pytest.raises(DeviceError, match="has ended"):
        projector.show(np.zeros((3, 4), np.uint8))
    projector.close()
    projector.close()
