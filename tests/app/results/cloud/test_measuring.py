"""Measurements on the points of a result, against its known shape."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from dsl_app.results.cloud.measuring import Measure, measure_plane, measure_points

from dsl_core.io.result.result_arrays import ResultArrays, load_arrays
from tests.app.support.small_result import write_small_result


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> ResultArrays:
    return load_arrays(write_small_result(tmp_path_factory.mktemp("measuring"), spectra=False))


def test_a_distance_has_its_deviation(result: ResultArrays) -> None:
    found = measure_points(result, Measure.DISTANCE, (3, 12), (33, 12))
    a, b = (result.at("points_mm", pixel) for pixel in ((3, 12), (33, 12)))
    assert f"{np.linalg.norm(b - a):.3f} ± " in found.text
    assert found.section is None
    assert found.ends is not None


@pytest.mark.parametrize(("std_mm", "told"), [(np.nan, "± unknown mm"), (1e-5, "± 0.001 mm")])
def test_a_distance_claims_no_more_than_is_known_of_its_ends(
    result: ResultArrays, std_mm: float, told: str
) -> None:
    std = np.full(result.shape, 1e-5, np.float32)
    std[12, 33] = std_mm
    stated = replace(result, arrays={**result.arrays, "depth_std_mm": std})
    assert measure_points(stated, Measure.DISTANCE, (3, 12), (33, 12)).text.endswith(told)


def test_a_section_of_a_flat_wall_is_flat(result: ResultArrays) -> None:
    found = measure_points(result, Measure.SECTION, (3, 12), (33, 12))
    assert found.section is not None
    assert len(found.section.along_mm) == 31
    assert np.abs(found.section.height_mm).max() < 3
    assert "height from −" in found.text
    assert "two that are apart" in measure_points(result, Measure.SECTION, (3, 12), (3, 12)).text


def test_a_plane_tells_how_flat_and_how_tilted(result: ResultArrays) -> None:
    mask = np.zeros(result.shape, bool)
    mask[4:20, 4:30] = True
    found = measure_plane(result, mask)
    assert "Plane of 416 points" in found.text
    assert "noise alone 0.25" in found.text
    # The tilt is as exact as its deviation.
    tilt, std = re.findall(r"tilt (\S+) ± (\S+)°", found.text)[0]
    assert len(tilt.partition(".")[2]) == len(std.partition(".")[2])
    mask[:] = False
    assert "at least four points" in measure_plane(result, mask).text
