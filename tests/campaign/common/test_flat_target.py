"""Columns of a flat target, by the line spread that its own scan shows."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.colour.color_checker import LIGHTS
from dsl_core.campaign.common.flat_target import middle, read_uniform, scanned_geometry
from dsl_core.errors import CalibrationError
from dsl_core.model.plan import CapturePlan, Columns, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.progress import NoProgress
from dsl_core.simulation.published_rig import published_rig
from tests.cases.twin_scan import MemoryScan, twin_scan


@pytest.fixture(scope="module")
def scanned() -> tuple[Rig, MemoryScan]:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=3))
    devices, scan = twin_scan(plan, size="64x42", scene="plane")
    assert devices.calibration is not None
    return devices.calibration, scan


def test_columns_do_not_depend_on_the_blur_that_is_stated(scanned: tuple[Rig, MemoryScan]) -> None:
    rig, scan = scanned
    response = rig.projector_response
    wrong = response.with_gaussian(1.25 * response.blur_px)
    _, _, right = scanned_geometry(scan, rig)
    _, _, found = scanned_geometry(scan, rig.model_copy(update={"projector_response": wrong}))
    assert np.nanmean(np.abs(found.column_px - right.column_px)) < 0.002
    assert np.nanmedian(found.column_std_px / right.column_std_px) == pytest.approx(1.0, abs=0.02)


def test_errors_that_all_columns_share_are_left_out_where_they_are_not_wanted(
    scanned: tuple[Rig, MemoryScan],
) -> None:
    rig, scan = scanned
    unsure = rig.model_copy(update={"column_std_px": 0.5})
    _, _, own = scanned_geometry(scan, unsure, shared_errors=False)
    _, _, all_of_it = scanned_geometry(scan, unsure)
    assert np.nanmedian(own.column_std_px) < 0.1
    np.testing.assert_allclose(all_of_it.column_std_px, np.hypot(own.column_std_px, 0.5), rtol=1e-5)


@pytest.mark.parametrize(("depth_mm", "share"), [(1000.0, 1.0), (1100.0, 1.0), (2400.0, 0.0)])
def test_a_target_beside_the_depths_of_a_rig_is_one(depth_mm: float, share: float) -> None:
    levels = tuple((tuple(map(float, light)),) * published_rig().projector.width_px for light in LIGHTS)
    plan = CapturePlan(code=GrayCode(rows=False), spectral=Columns.model_validate({"levels": levels}))
    devices, scan = twin_scan(plan, size="64x42", scene="plane", depth_mm=str(depth_mm), film="off")
    rig = devices.calibration
    assert rig is not None
    target = read_uniform(scan, rig, NoProgress())
    inside = middle(target.lit.shape)
    assert target.lit[inside].mean() == pytest.approx(share, abs=0.02)
    if share:
        assert target.plane(rig, inside).plane.depth_mm(rig)[inside].mean() == pytest.approx(
            depth_mm, rel=5e-3
        )
    else:
        with pytest.raises(
            CalibrationError, match=r"to be 2\d\d\d mm from the camera; this rig is for 500 to"
        ):
            target.plane(rig, inside)
