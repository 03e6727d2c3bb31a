"""A camera without a colour mosaic gives depth, and spectra from brightness alone."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.fit import Fit
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve, WavelengthGrid
from dsl_core.pipeline import Options, evaluate, reconstruct
from dsl_core.simulation import sim_devices
from dsl_core.simulation.published_rig import published_rig
from dsl_core.workflows.truths import twin_truth
from tests.cases.twin_scan import twin_scan

PLAN = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4))


def monochrome_rig() -> Rig:
    known = published_rig()
    even = SpectralCurve.of(np.array([390.0, 710.0]), np.array([0.5, 0.5]))
    sensor = known.sensor.model_copy(update={"bayer": "MONO"})
    return known.model_copy(update={"sensor": sensor, "response": (even, even, even)})


@pytest.mark.slow
def test_depth_and_spectra_come_from_brightness_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = monochrome_rig()
    monkeypatch.setattr(sim_devices, "published_rig", lambda: rig)
    devices, scan = twin_scan(PLAN, size="32x24", scene="plane")
    assert devices.camera.info.bayer == "MONO"
    assert devices.calibration is not None
    options = Options(grid=WavelengthGrid(start_nm=430, stop_nm=660, step_nm=10))
    result = reconstruct(scan, devices.calibration, options)
    truth = twin_truth(devices, options.grid)
    assert truth is not None
    assert truth.spectra is not None
    assert truth.material is not None
    found = evaluate(result, truth)
    assert found.depth is not None
    assert found.depth.coverage > 0.9
    assert found.depth.rmse_mm < 0.5
    spectra = np.moveaxis(result["reflectance"].values, 0, -1)
    errors = spectra - truth.spectra[truth.material]
    assert np.sqrt(np.nanmean(errors**2)) < 0.05
    # Each pixel has few samples, which its spectrum does not use up; and no colours that could disagree.
    assert (result["flags"].values & int(Flag.POOR_FIT) != 0).mean() < 0.05
    fit = Fit.read(result.attrs)
    assert fit is not None
    assert not {"profile", "surfaces"} & set(fit.parts)
    assert not any(finding.part == "curves" for finding in fit.findings)
