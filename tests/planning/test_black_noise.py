"""Stated deviations hold what the black frames' noise shifts, also on surfaces that are almost black."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Setting
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.planning.samples import plane_samples
from dsl_core.planning.virtual import VirtualPixels
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.threads import one_kernel_thread

DARK = np.array([0.02, 0.05])
SETTINGS = (Setting(exposure_ms=1000 / 6, level=0.2), Setting(exposure_ms=1000 / 3, level=0.8))


@pytest.mark.parametrize(
    "spectral",
    [LineComb(width_px=5, step_px=2, period_px=80), ScanLines(width_px=5, step_px=4)],
    ids=["comb", "lines"],
)
def test_the_truth_lies_in_the_band_that_is_stated(spectral: LineComb | ScanLines) -> None:
    rig = published_rig()
    plan = CapturePlan(code=GrayCode(rows=False), spectral=spectral, settings=SETTINGS)
    pixels = VirtualPixels(rig, plan, WavelengthGrid(), plane_samples(rig, 700.0))
    nodes = np.tile(np.repeat(DARK[:, None], pixels.bands.count, 1), (len(pixels.pixels), 1, 1))
    with one_kernel_thread():
        found = pixels.run(nodes, *pixels.signals(torch.as_tensor(nodes, dtype=torch.float32)))
    z = (found.mean - found.truth) / found.std
    assert ((np.abs(z) < 1.96).mean((0, 1)) > 0.95).all()
    size = np.sqrt((z**2).mean((0, 1)))
    assert ((size > 0.6) & (size < 0.95)).all()
