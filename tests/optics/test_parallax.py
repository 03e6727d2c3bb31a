"""What a column stands for decides how sure depths are; a rig without parallax is called by its name."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.capture.preflight import find_remarks
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import triangulate, zero_order
from dsl_core.optics.parallax import parallax_at, parallax_of
from dsl_core.reconstruction.findings.fit import fit_of
from dsl_core.simulation.published_rig import published_rig


def moved(rig: Rig, x_mm: float, y_mm: float) -> Rig:
    """The rig with its camera elsewhere."""
    pose = rig.pose.model_copy(update={"translation_mm": (x_mm, y_mm, 0.0)})
    return rig.model_copy(update={"pose": pose, "camera": rig.camera.resized(89, 58)})


SIDE, ABOVE = moved(published_rig(), 80.0, 0.0), moved(published_rig(), 2.0, -120.0)


def test_a_column_stands_for_what_triangulation_makes_of_it() -> None:
    pixels = torch.arange(89 * 58)
    depth = torch.full((89 * 58,), 700.0, dtype=torch.float64)
    slope = triangulate(SIDE, pixels, zero_order(SIDE, pixels, depth)[0])[1]
    found = parallax_of(SIDE, depth.reshape(58, 89).numpy())
    assert found.mm_per_column == pytest.approx(float(slope.median()), rel=0.02)
    # Farther away a column stands for more; places without a depth do not count.
    far = np.full((58, 89), 1400.0)
    far[20:] = np.nan
    assert parallax_of(SIDE, far).mm_per_column == pytest.approx(4 * found.mm_per_column, rel=0.1)


def test_without_depths_the_middle_of_the_rigs_own_counts() -> None:
    middle = float(np.mean(SIDE.depth_range_mm))
    wanted = parallax_of(SIDE, np.full((58, 89), middle))
    assert parallax_of(SIDE) == parallax_of(SIDE, np.full((58, 89), np.nan)) == wanted


def test_a_camera_above_the_projector_is_told_before_the_scan_and_with_its_result() -> None:
    assert find_remarks(None) == find_remarks(SIDE) == []
    (remark,) = find_remarks(ABOVE)
    assert "A column of the projector stands for" in remark
    assert "Move the camera to the side" in remark
    depth, flags = np.full((58, 89), 700.0), np.zeros((58, 89), np.uint16)
    verdicts = [fit_of(rig, CapturePlan(), WavelengthGrid(), depth, flags, None) for rig in (SIDE, ABOVE)]
    assert not verdicts[0].parts
    assert verdicts[1].parts == ("geometry",)
    assert f"{parallax_of(ABOVE, depth).mm_per_column:.0f} mm of depth" in verdicts[1].words


def test_a_calibration_knows_the_parallax_of_its_lenses_before_there_is_a_rig() -> None:
    for rig in (SIDE, ABOVE):
        wanted = parallax_of(rig, np.full((58, 89), 600.0))
        found = parallax_at(rig.camera, rig.projector, rig.pose, 600.0)
        assert found.mm_per_column == pytest.approx(wanted.mm_per_column, rel=0.01)
        assert found.most_mm == pytest.approx(wanted.most_mm)
