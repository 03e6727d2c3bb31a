"""Which pixels are red, green and blue is told by where lines light them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.model.rig import BayerPattern, Rig
from dsl_core.reconstruction.spectral.colour_sites import colour_sites_finding

from .conftest import Lines


def with_bayer(rig: Rig, bayer: BayerPattern) -> Rig:
    return rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": bayer})})


def test_a_right_mosaic_is_not_talked_of(chart: Lines) -> None:
    assert chart.rig.sensor.bayer == "RGGB"
    assert colour_sites_finding(chart.rig, chart.light()) is None


@pytest.mark.parametrize("bayer", ["BGGR", "GRBG", "GBRG"])
def test_a_wrong_mosaic_is_told_with_the_right_one(chart: Lines, bayer: BayerPattern) -> None:
    found = colour_sites_finding(with_bayer(chart.rig, bayer), chart.light())
    assert found is not None
    assert found.significant
    assert f"a mosaic of RGGB do, and not of {bayer}" in found.sentence
    assert '"bayer": "RGGB"' in found.advice
    assert found.value == (0.5 if bayer == "BGGR" else 1.0)


def test_red_and_blue_exchanged_in_the_curves_are_told(chart: Lines) -> None:
    red, green, blue = chart.rig.response
    found = colour_sites_finding(chart.rig.model_copy(update={"response": (blue, green, red)}), chart.light())
    assert found is not None
    assert "BGGR" in found.sentence


def test_nothing_is_told_by_few_pixels_by_noise_or_of_a_camera_without_colour(chart: Lines) -> None:
    wrong = with_bayer(chart.rig, "BGGR")
    few, noisy = chart.picked.pick(np.arange(1500, 1560)), replace(chart.picked, std=100 * chart.picked.std)
    assert colour_sites_finding(wrong, chart.light(few)) is None
    assert colour_sites_finding(wrong, chart.light(noisy)) is None
    assert colour_sites_finding(with_bayer(chart.rig, "MONO"), chart.light()) is None
