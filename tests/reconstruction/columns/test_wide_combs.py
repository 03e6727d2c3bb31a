"""Combs whose lines move farther than their slopes reach tell columns by all of their patterns together."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb
from dsl_core.model.result import Flag
from dsl_core.optics.lines.line_set import LineSet
from tests.cases.twin_scan import twin_scan


@pytest.mark.parametrize(
    ("width_px", "step_px", "is_told_by_lines"),
    [(5, 4, True), (10, 4, True), (9, 6, True), (5, 5, False), (12, 6, False), (20, 8, False), (7, 4, True)],
)
def test_lines_tell_columns_where_their_edges_are_close(
    width_px: int, step_px: int, is_told_by_lines: bool
) -> None:
    plan = CapturePlan(spectral=LineComb(width_px=width_px, step_px=step_px, period_px=10 * step_px))
    assert (LineSet.of(plan) is not None) == is_told_by_lines


def test_depth_of_a_wide_comb_is_as_stated() -> None:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=LineComb(width_px=12, step_px=6, period_px=96))
    devices, scan = twin_scan(plan, size="112x72", scene="color-checker")
    assert devices.calibration is not None
    result = pipeline.reconstruct(scan, devices.calibration, pipeline.Options(spectra=False))
    off = result["depth_mm"].values - devices.camera.world.truth.depth_mm  # type: ignore[attr-defined]
    known = np.isfinite(off) & ((result["flags"].values.astype(int) & ~int(Flag.BANDS_UNREACHED)) == 0)
    ratio = np.abs(off / result["depth_std_mm"].values)[known]
    assert known.mean() > 0.2
    assert np.quantile(ratio, 0.95) < 1.96
    assert (ratio > 3).mean() < 0.02
    assert np.sqrt(np.mean(off[known] ** 2)) < 1.0
