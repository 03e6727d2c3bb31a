"""The line frames of a small scan of the twin, as what each first order brings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.merge import PickedLines
from dsl_core.reconstruction.spectral.first_order_light import FirstOrderLight
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from tests.cases.twin_scan import solver_input, twin_scan


@dataclass
class Lines:
    """The line frames of a small scan."""

    rig: Rig
    lines: LineSet
    picked: PickedLines
    pixels: Pixels

    def light(self, picked: PickedLines | None = None) -> FirstOrderLight:
        """What all or some pixels receive."""
        return FirstOrderLight.of(self.lines, correspondence(self.rig), picked or self.picked, self.pixels)


@pytest.fixture(scope="package")
def chart() -> Lines:
    plan = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(width_px=5, step_px=4))
    devices, scan = twin_scan(plan, size="64x48", scene="color-checker")
    assert devices.calibration is not None
    stack, pixels = solver_input(devices.calibration, scan)
    lines, size = LineSet.of(scan.plan), pixels.valid.size
    assert lines is not None
    radiance, std = (each.reshape(-1, size) for each in (stack.radiance, stack.std))
    picked = PickedLines(np.arange(size), radiance, std, stack.black_std.ravel())
    return Lines(devices.calibration, lines, picked, pixels)
