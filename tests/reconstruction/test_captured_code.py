"""Scans whose code others captured, in an order that no plan of ours has, are reconstructed as well."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.model.captured_code import CapturedCode, Stripes
from dsl_core.model.plan import CapturePlan, LineComb, NoSpectral, Sentinels, SpectralSet
from tests.cases.twin_scan import twin_scan


@pytest.mark.parametrize("bits", [1, 2, 10])
@pytest.mark.parametrize("inverse", [True, False])
def test_a_code_from_elsewhere_has_a_frame_that_shows_a_motion(bits: int, inverse: bool) -> None:
    code = CapturedCode(column_sets=(Stripes(bits=bits, inverse=inverse),))
    plan = CapturePlan(code=code, spectral=NoSpectral(), sentinels=Sentinels(every=8))
    shots = {(shot.role, shot.pattern) for shot in plan.shots()}
    assert {(role, shot.pattern) for role, shot in plan.references().items()} <= shots
    assert set(plan.references()) == {"white", "black", "code"}


@pytest.mark.parametrize("spectral", [NoSpectral(), LineComb(width_px=5, step_px=4, period_px=96)])
def test_depth_is_found_with_a_code_from_elsewhere(spectral: SpectralSet) -> None:
    plan = CapturePlan(code=CapturedCode(column_sets=(Stripes(bits=10, inverse=False),)), spectral=spectral)
    devices, scan = twin_scan(plan, size="112x72", scene="plane")
    assert devices.calibration is not None
    result = pipeline.reconstruct(scan, devices.calibration, pipeline.Options(spectra=False))
    assert np.isfinite(result["depth_mm"].values).mean() > 0.9
