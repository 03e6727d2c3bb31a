"""Which pixels are red, green and blue is told by where lines light them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from dsl_core.model.fit import FitFinding
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.rig import BayerPattern, Rig
from dsl_core.optics.correspondence import correspondence
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.merge import PickedLines
from dsl_core.reconstruction.spectral.colour_sites import colour_sites_finding
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels
from tests.cases.twin_scan import solver_input, twin_scan


@dataclass
class Lines:
    """The line frames of a small scan."""

    rig: Rig
    lines: LineSet
    picked: PickedLines
    pixels: Pixels

    def found(self, rig: Rig, picked: PickedLines | None = None) -> FitFinding | None:
        model = correspondence(self.rig)
        return colour_sites_finding(rig, self.lines, model, picked or self.picked, self.pixels)


@pytest.fixture(scope="module")
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


def with_bayer(rig: Rig, bayer: BayerPattern) -> Rig:
    return rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": bayer})})


def test_a_right_mosaic_is_not_talked_of(chart: Lines) -> None:
    assert chart.rig.sensor.bayer == "RGGB"
    assert chart.found(chart.rig) is None


@pytest.mark.parametrize("bayer", ["BGGR", "GRBG", "GBRG"])
def test_a_wrong_mosaic_is_told_with_the_right_one(chart: Lines, bayer: BayerPattern) -> None:
    found = chart.found(with_bayer(chart.rig, bayer))
    assert found is not None
    assert found.significant
    assert f"a mosaic of RGGB do, and not of {bayer}" in found.sentence
    assert '"bayer": "RGGB"' in found.advice
    assert found.value == (0.5 if bayer == "BGGR" else 1.0)


def test_red_and_blue_exchanged_in_the_curves_are_told(chart: Lines) -> None:
    red, green, blue = chart.rig.response
    found = chart.found(chart.rig.model_copy(update={"response": (blue, green, red)}))
    assert found is not None
    assert "BGGR" in found.sentence


def test_nothing_is_told_by_few_pixels_by_noise_or_of_a_camera_without_colour(chart: Lines) -> None:
    wrong = with_bayer(chart.rig, "BGGR")
    few = chart.picked.pick(np.arange(1500, 1560))
    assert chart.found(wrong, few) is None
    assert chart.found(wrong, replace(chart.picked, std=100 * chart.picked.std)) is None
    assert chart.found(with_bayer(chart.rig, "MONO")) is None
