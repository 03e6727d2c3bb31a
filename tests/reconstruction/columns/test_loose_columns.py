"""Columns in the middle of wide lines: as unsure as the places that explain the light."""

import math

import pytest
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.reconstruction.columns.loose_columns import CODE_STD_PX, FARTHEST_PX, loose_columns

LINES = LineSet(5, 5, 2.0, 20, 20)
RESPONSE = ProjectorResponse(blur_px=0.4)
ONE = torch.ones(1, dtype=torch.float64)


def weighed(column_px: float, coarse_px: float, noise: float) -> tuple[float, float]:
    """Mean and deviation of one column that lines of five columns light, without gaps or overlap."""
    centres = 2.0 + 5.0 * torch.arange(20, dtype=torch.float64)[:, None]
    light = zero_order_profile(column_px - centres, -2.5, 2.5, RESPONSE)
    peaks = LinePeaks(coarse_px * ONE, light, torch.full_like(light, noise), LINES, RESPONSE)
    mean, deviation = loose_columns(peaks, 0.0 * ONE, ONE)
    return float(mean), float(deviation)


def test_in_the_middle_of_a_line_the_code_alone_says_where_a_column_is() -> None:
    mean, deviation = weighed(42.2, 42.0, 0.02)
    # Anywhere in the decoded column, whose ends are not sure.
    assert mean == pytest.approx(42.0, abs=0.01)
    assert deviation == pytest.approx(math.sqrt(1 / 12 + CODE_STD_PX**2), rel=0.05)


def test_where_a_line_ends_its_light_says_where_a_column_is() -> None:
    mean, deviation = weighed(44.4, 44.0, 0.01)
    assert abs(mean - 44.4) < 1.96 * deviation < 0.1


def test_no_column_is_surer_than_the_places_it_is_weighed_over_are_apart() -> None:
    mean, deviation = weighed(44.4, 44.0, 1e-5)
    apart_px = 2 * FARTHEST_PX / 48
    assert mean == pytest.approx(44.4, abs=1e-6)
    assert deviation == pytest.approx(apart_px / math.sqrt(12), rel=1e-6)
