"""Columns of a flat target, by the line spread that its own scan shows."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.campaign.common.flat_target import scanned_geometry
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
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
