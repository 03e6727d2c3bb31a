"""What a probe finds of a pixel does not depend on the pixels that are worked out together with it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.projector.spread_field import SpreadField
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.spectral.probing.probe import _probe_some, probe_targets
from dsl_core.reconstruction.spectral.probing.probed_light import ProbedScan
from dsl_core.reconstruction.spectral.spectra import SpectralReconstruction
from tests.cases.twin_scan import solver_input, twin_scan


def wider_in_corners(rig: Rig) -> Rig:
    """The rig with lines whose width rises by a third towards the corners of the frame."""
    half = (rig.projector.width_px / 2, rig.projector.height_px / 2)
    field = SpreadField(centre_px=half, half_px=half, coefficients=(0.0, 0.0, 0.0, 0.15, 0.0, 0.15))
    response = rig.projector_response.model_copy(update={"field": field})
    return rig.model_copy(update={"projector_response": response})


@pytest.fixture(scope="module")
def scan() -> ProbedScan:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=5))
    devices, taken = twin_scan(plan, size="112x72", scene="color-checker")
    assert devices.calibration is not None
    rig = wider_in_corners(devices.calibration)
    stack, pixels = solver_input(rig, taken)
    grid = WavelengthGrid(step_nm=10.0)
    data = (rig, taken.plan, grid, correspondence(rig), stack.radiance, stack.std, pixels)
    return SpectralReconstruction(*data).probed


def test_pixels_say_the_same_in_whatever_company(scan: ProbedScan) -> None:
    targets = probe_targets(scan.pixels.valid)
    some = targets[:: len(targets) // 20]
    # The pixels beside each other and those at opposite ends of the picture see other lines and widths.
    together = _probe_some(scan, some)
    apart: list[NDArray[np.intp]] = [some[::2], some[1::2], some[:3], some[:1]]
    for group in apart:
        at = np.searchsorted(some, group)
        for name, values in _probe_some(scan, group).items():
            wanted = together[name][at]
            scale = np.abs(wanted).max() if wanted.size else 1.0
            assert values == pytest.approx(wanted, rel=1e-6, abs=1e-7 * float(scale)), name
