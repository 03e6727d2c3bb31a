"""Black that changes during a scan is told as such, and not taken for light that drifts."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, ScanLines, Sentinels, Setting
from dsl_core.reconstruction.light.told import black_wander
from dsl_core.reconstruction.light.witnesses import blacks_again
from dsl_core.reconstruction.rows.frames import ScanFrames
from tests.cases.small_rig import small_rig
from tests.cases.twin_scan import MemoryScan, twin_scan

PLAN = CapturePlan(
    spectral=ScanLines(step_px=4),
    settings=(Setting(exposure_ms=20.0, level=0.5), Setting(exposure_ms=333.0, level=0.8)),
    code_settings=(0,),
    sentinels=Sentinels(),
)


@pytest.mark.slow
def test_black_that_wanders_is_named_and_the_light_is_not_blamed() -> None:
    devices, scan = twin_scan(PLAN, size="80x52", scene="color-checker")
    assert devices.calibration is not None
    count = len(scan.frames)
    wander = [round(2 * np.sin(7 * np.pi * k / count)) for k in range(count)]
    moved = [
        (frame.astype(np.int64) + dn).astype(np.uint16) for frame, dn in zip(scan.frames, wander, strict=True)
    ]
    result = pipeline.reconstruct(
        MemoryScan(scan.plan, tuple(moved)), devices.calibration, pipeline.Options(spectra=False)
    )
    fit = Fit.read(result.attrs)
    assert fit is not None
    significant = {finding.name for finding in fit.significant}
    assert "black taken again" in significant
    assert not significant & {"drift of the light", "settings against each other"}


@pytest.mark.parametrize(("more_dn", "told"), [(0.0, False), (1.0, True)])
def test_black_is_compared_with_the_first_one(more_dn: float, told: bool) -> None:
    plan = PLAN.model_copy(update={"camera_size_px": (8, 6), "projector_size_px": (16, 9)})
    rng = np.random.default_rng(0)
    frames = [rng.integers(99, 102, (6, 8)).astype(np.uint16) for _ in plan.shots()]
    for shot in plan.shots():
        if shot.role == "sentinel":
            frames[shot.index] = frames[shot.index] + np.uint16(more_dn)
    found = black_wander(blacks_again(ScanFrames(MemoryScan(plan, tuple(frames)), small_rig(), ())))
    assert found is not None
    assert found.significant == told
    assert found.value == pytest.approx(more_dn, abs=0.4)


def test_scans_that_take_nothing_again_say_nothing_of_black() -> None:
    plan = PLAN.model_copy(update={"camera_size_px": (8, 6), "sentinels": None})
    assert black_wander(blacks_again(ScanFrames(MemoryScan(plan, ()), small_rig(), ()))) is None
