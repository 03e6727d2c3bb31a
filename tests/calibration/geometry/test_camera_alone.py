"""The lens of a camera from a board without code, and pictures it cannot come from."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.calibration.geometry.camera_alone import calibrate_camera
from dsl_core.errors import CalibrationError
from tests.cases.board_sets import BOARD, CAMERA_FX_PX, board_set

PLAIN = ("k1", "k2", "k3", "tangential")


def whites() -> list[tuple[str, NDArray[np.float32]]]:
    return [(f"{k}.png", np.asarray(pose[-2], np.float32)) for k, pose in enumerate(board_set())]


@pytest.mark.slow
def test_the_lens_comes_with_deviations_that_hold() -> None:
    found = calibrate_camera([*whites(), ("empty.png", np.full((180, 240), 50, np.float32))], BOARD, PLAIN)
    off = found.lens.fx_px - CAMERA_FX_PX
    assert abs(off) < max(4 * found.deviation.fx_px, 0.5)
    assert found.deviation.fx_px < 0.02 * CAMERA_FX_PX
    assert found.lens.distortion == found.deviation.distortion == (0.0,) * 5
    assert found.rms_px < 0.15
    assert [name for name, _, _ in found.pictures] == ["0.png", "1.png", "2.png", "3.png"]
    assert [each.name for each in found.left_out] == ["empty.png"]
    assert any("empty.png is left out" in warning for warning in found.warnings)


@pytest.mark.slow
def test_pictures_that_say_too_little_are_refused() -> None:
    with pytest.raises(CalibrationError, match="The board was found in 2 of 2 pictures; 3 are needed"):
        calibrate_camera(whites()[:2], BOARD)
    with pytest.raises(CalibrationError, match="All boards are nearly parallel"):
        calibrate_camera([("a.png", whites()[1][1])] * 3, BOARD, PLAIN)
    with pytest.raises(CalibrationError, match=r"b\.png is 239 x 180 px, the first picture 240 x 180 px"):
        calibrate_camera([whites()[0], ("b.png", whites()[0][1][:, 1:])], BOARD)
