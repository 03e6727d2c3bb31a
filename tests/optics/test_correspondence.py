"""Where a column and a ray meet: the closed form without distortion, and the iteration with it."""

from __future__ import annotations

import pytest
import torch

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import _closed_form, triangulate, zero_order
from dsl_core.simulation.published_rig import published_rig

PIXELS = torch.arange(1000, 890 * 580, 9973)
DEPTH = torch.linspace(450.0, 1000.0, len(PIXELS), dtype=torch.float64)


def straight(rig: Rig) -> Rig:
    """The rig with a projector lens that does not distort."""
    lens = rig.projector.model_copy(update={"distortion": (0.0,) * 5})
    return rig.model_copy(update={"projector": lens})


def test_the_closed_form_is_the_depth_where_nothing_distorts() -> None:
    rig = straight(published_rig())
    column, _ = zero_order(rig, PIXELS, DEPTH)
    assert _closed_form(rig, PIXELS, column) == pytest.approx(DEPTH, rel=1e-9)


def test_the_closed_form_starts_within_a_few_percent_of_the_depth() -> None:
    rig = published_rig()
    column, _ = zero_order(rig, PIXELS, DEPTH)
    assert _closed_form(rig, PIXELS, column) == pytest.approx(DEPTH, rel=0.1)


def test_depth_and_its_slope_are_those_of_the_projected_columns() -> None:
    rig = published_rig()
    column, _ = zero_order(rig, PIXELS, DEPTH)
    found, slope = triangulate(rig, PIXELS, column)
    assert found == pytest.approx(DEPTH, abs=1e-4)
    moved, _ = triangulate(rig, PIXELS, column + 0.01)
    assert ((moved - found).abs() / 0.01) == pytest.approx(slope, rel=0.01)
