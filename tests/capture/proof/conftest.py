"""A small scene of the twin, rendered once: every pattern of a plan of two settings."""

from __future__ import annotations

import pytest

from dsl_core.model.plan import CapturePlan, GrayCode, LineComb
from tests.cases.rendered_rig import RenderedScene, render


@pytest.fixture(scope="session")
def scene() -> RenderedScene:
    """A box under the columns of a code and a comb, at the published two settings."""
    plan = CapturePlan(code=GrayCode(rows=False), spectral=LineComb(step_px=4, period_px=64))
    return render(plan, scene="box", size="64x48")
