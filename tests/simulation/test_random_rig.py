"""Drawn rigs: repeatable, each part within its range, and really different."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import relative_gain
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig

NM = np.arange(430.0, 661.0, 5.0)
SEEDS = range(20)


@pytest.fixture(scope="module")
def rigs() -> list[Rig]:
    return [random_rig(seed, published_rig()) for seed in SEEDS]


def assert_spread(values: list[float], low: float, high: float) -> None:
    """Twenty uniform draws stay inside their range and fill more than half of it."""
    assert low <= min(values) < max(values) <= high
    assert max(values) - min(values) > 0.5 * (high - low)


def test_a_seed_is_a_rig(rigs: list[Rig]) -> None:
    assert random_rig(3, published_rig()) == rigs[3]
    assert len({rig.model_dump_json() for rig in rigs}) == len(rigs)
    assert len({rig.provenance.camera_serial for rig in rigs}) == len(rigs)
    assert Rig.model_validate_json(rigs[3].model_dump_json()) == rigs[3]


def test_geometry_is_drawn_around_the_published(rigs: list[Rig]) -> None:
    start = published_rig()
    for lens in ("camera", "projector"):
        focal = [getattr(rig, lens).fx_px / getattr(start, lens).fx_px for rig in rigs]
        assert_spread(focal, 0.99, 1.01)
        radial = [getattr(rig, lens).distortion[0] / getattr(start, lens).distortion[0] for rig in rigs]
        assert_spread(radial, 0.9, 1.1)
    assert_spread([rig.camera.cx_px - start.camera.cx_px for rig in rigs], -8, 8)
    assert_spread([rig.pose.translation_mm[0] - start.pose.translation_mm[0] for rig in rigs], -3, 3)
    turns = [np.degrees(np.arccos((np.trace(rig.pose.matrix @ start.pose.matrix.T) - 1) / 2)) for rig in rigs]
    assert 0.3 < max(turns) < 1.8
    assert_spread([rig.film.lines_per_mm for rig in rigs], 470, 510)
    assert_spread([rig.film.roll_deg for rig in rigs], -0.3, 0.3)


def test_light_and_sensor_are_drawn_around_the_published(rigs: list[Rig]) -> None:
    start = published_rig()
    assert_spread([rig.projector_response.gamma for rig in rigs], 2.0, 2.4)
    assert_spread([rig.projector_response.blur_px for rig in rigs], 0.5, 0.7)
    assert_spread([rig.sensor.electrons_per_dn / start.sensor.electrons_per_dn for rig in rigs], 0.85, 1.15)
    assert_spread([rig.white_scale / start.white_scale for rig in rigs], 0.9, 1.1)
    for rig in rigs:
        for curve, known in zip(
            (*rig.response, *rig.emission), (*start.response, *start.emission), strict=True
        ):
            values, nm = np.array(curve.values), np.array(curve.wavelengths_nm)
            assert values.min() >= 0
            centroids = [float((nm * each.at(nm)).sum() / each.at(nm).sum()) for each in (curve, known)]
            assert abs(centroids[0] - centroids[1]) < 8
        first = rig.efficiency[1].at(NM) / start.efficiency[1].at(NM)
        assert 0.8 < first.min() < first.max() < 1.2
        assert np.abs(np.diff(first)).max() < 0.06


def test_corners_are_darker_by_a_few_percent(rigs: list[Rig]) -> None:
    for rig in rigs:
        gain = relative_gain(rig)
        corners = gain[[0, 0, -1, -1], [0, -1, 0, -1]]
        assert 0.9 - 1e-9 <= corners.min() <= 0.95
        assert 0.99 < gain.max() <= 1.0
