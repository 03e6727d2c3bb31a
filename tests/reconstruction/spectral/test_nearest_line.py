"""The simpler reconstructions read the same scan, and the best one is closer to the truth."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core import pipeline
from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.planning import references
from dsl_core.reconstruction.spectral.nearest_line import basis_solution, chart_basis
from dsl_core.simulation.published_rig import published_rig
from tests.cases.trial import PLACES, Trial, run_trial

PLAN = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=4))


def trial(solver: str) -> Trial:
    options = pipeline.Options(grid=WavelengthGrid(step_nm=10), solver=solver)
    return run_trial(published_rig(), PLAN, references.chart(), options=options, places=PLACES[:1])


def test_each_baseline_is_sane_and_the_best_is_closer() -> None:
    best, nearest, basis = (trial(name).rmse for name in ("best", "nearest-line", "colour-basis"))
    assert best < 0.5 * min(nearest, basis)
    assert max(nearest, basis) < 0.1


def test_the_basis_gives_back_a_grey() -> None:
    grid = WavelengthGrid()
    moments = np.stack([np.exp(-0.5 * ((grid.centres_nm - c) / 30) ** 2) for c in (610, 540, 460)])
    found = basis_solution(moments, chart_basis(grid)) @ (moments @ np.full(grid.count, 0.5))
    assert np.abs(found - 0.5).max() < 0.1


def test_an_unknown_solver_is_refused() -> None:
    with pytest.raises(PlanError, match="nearest-line"):
        trial("magic")
