"""Linear light and the names of channels in OpenEXR."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from dsl_core.io.export.envi import IGNORE_VALUE
from dsl_core.io.export.exr import export_exr
from dsl_core.optics.colour import srgb_decode
from tests.cases.small_result import small_result


def test_srgb_is_straight_up_to_its_knee_and_a_power_above() -> None:
    values = np.array([0.0, 0.02, 0.04, 0.0404, 0.0405, 0.05, 0.055, 0.5, 1.0], np.float32)
    wanted = [v / 12.92 if v <= 0.04045 else ((v + 0.055) / 1.055) ** 2.4 for v in values.astype(float)]
    assert srgb_decode(values) == pytest.approx(np.array(wanted), rel=1e-6)


def test_light_in_a_file_is_not_scaled_and_depth_in_millimetres(tmp_path: Path) -> None:
    import OpenEXR

    asked: list[int] = []
    (path,) = export_exr(small_result(), tmp_path / "x.exr", check=lambda: asked.append(1))
    header = OpenEXR.File(str(path)).header()
    assert (header["EV"], header["depthUnit"], header["spectralLayoutVersion"]) == (0.0, "mm", "1.0")
    assert len(asked) == 3, "before colours, depth and writing"


def test_what_envi_ignores_is_far_below_any_value() -> None:
    assert IGNORE_VALUE == -9999.0, "the usual value, which readers know"
