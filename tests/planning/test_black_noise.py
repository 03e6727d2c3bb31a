"""Stated deviations hold what the black frames' noise shifts, also on surfaces that are almost black."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, ScanLines, Setting
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.planning.noise import Bracket
from dsl_core.planning.prediction import predict
from dsl_core.planning.references import chart
from dsl_core.planning.samples import plane_samples
from dsl_core.planning.virtual import VirtualPixels
from dsl_core.simulation.published_rig import published_rig
from dsl_core.solve.threads import one_kernel_thread
from tests.cases.trial import trial_samples

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


def test_a_bright_room_costs_as_much_as_scans_in_it() -> None:
    rig = published_rig()
    rig = rig.model_copy(update={"camera": rig.camera.resized(222, 145)})
    comb = LineComb(width_px=6, step_px=4, period_px=64)
    plan = CapturePlan(code=GrayCode(rows=False), spectral=comb, settings=SETTINGS, code_settings=(0, 1))
    view = trial_samples(rig, chart())
    dark, least, bright = (
        predict(rig, plan, replace(view, black_dn_per_ms=room), peaks=False)
        for room in (None, (0.0,) * 3, (5.1,) * 3)
    )
    assert least == dark, "no room is darker than the projector's own black"
    # What a trial of this plan found in a room of 5 DN/ms; in a dark one less than half of that.
    assert bright.pixel_rmse == pytest.approx(0.0144, rel=0.2)
    assert bright.depth_std_mm == pytest.approx(0.938, rel=0.25)
    assert dark.pixel_rmse < 0.0072
    assert dark.depth_std_mm < 0.469


def test_noise_does_not_choose_the_settings_that_measure_a_light() -> None:
    rig = published_rig()
    bracket = Bracket.of(rig, SETTINGS)
    # So bright that the bright setting is saturated, and read as if it were not.
    true, read, black = torch.tensor([18.5]), torch.tensor([10.0]), torch.tensor([5.0])
    assert not bracket.information(true, black)[1]
    assert bracket.information(read, black)[1]
    assert not bracket.information(read, black, true)[1]
    assert bracket.variance(read, black, true) > 0.8 * bracket.variance(true, black)
