"""A scan without its film, or without columns by its lines, says so, and nothing that follows from it."""

from __future__ import annotations

import pytest

from dsl_core import pipeline
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines
from tests.cases.twin_scan import twin_scan


@pytest.mark.parametrize(
    "spectral", [ScanLines(width_px=5, step_px=4), LineComb(width_px=5, step_px=4, period_px=96)]
)
def test_a_missing_film_is_named_first(spectral: ScanLines | LineComb) -> None:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=spectral)
    devices, scan = twin_scan(plan, size="112x72", scene="color-checker", film="off")
    assert devices.calibration is not None
    fit = Fit.read(pipeline.reconstruct(scan, devices.calibration).attrs)
    assert fit is not None
    assert fit.significant[0].part == "film"
    assert "film is missing" in fit.significant[0].sentence


def test_columns_of_the_code_alone_judge_no_lines() -> None:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4))
    devices, scan = twin_scan(plan, size="112x72", scene="color-checker")
    assert devices.calibration is not None
    fit = Fit.read(
        pipeline.reconstruct(scan, devices.calibration, pipeline.Options(refine_columns=False)).attrs
    )
    assert fit is not None
    assert not {"response", "light", "orders", "film"} & {each.part for each in fit.significant}
