"""The simpler reconstructions read the same scan, and the best one is closer to the truth."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core import pipeline
from dsl_core.errors import PlanError
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines
from dsl_core.model.spectral import WavelengthGrid
from dsl_core.planning import references
from dsl_core.reconstruction.spectral.nearest_line import SMOOTHNESS, _filled, basis_solution, chart_basis
from dsl_core.simulation.published_rig import published_rig
from tests.cases.trial import PLACES, Trial, run_trial

PLAN = CapturePlan(code=GrayCode(rows=False), spectral=ScanLines(step_px=4))


def trial(solver: str) -> Trial:
    options = pipeline.Options(grid=WavelengthGrid(step_nm=10), solver=solver)
    return run_trial(published_rig(), PLAN, references.chart(), options=options, places=PLACES[:1])


@pytest.mark.slow
def test_each_baseline_is_sane_and_the_best_is_closer() -> None:
    best, nearest, basis = (trial(name).rmse for name in ("best", "nearest-line", "colour-basis"))
    assert best < 0.5 * min(nearest, basis)
    assert max(nearest, basis) < 0.1


def test_the_basis_gives_back_a_grey() -> None:
    grid = WavelengthGrid()
    moments = np.stack([np.exp(-0.5 * ((grid.centres_nm - c) / 30) ** 2) for c in (610, 540, 460)])
    found = basis_solution(moments, chart_basis(grid)) @ (moments @ np.full(grid.count, 0.5))
    assert np.abs(found - 0.5).max() < 0.1


@pytest.mark.slow
def test_an_unknown_solver_is_refused() -> None:
    with pytest.raises(PlanError, match="nearest-line"):
        trial("magic")


def test_a_basis_is_fitted_to_colours_with_curvature_over_the_whole_range_as_a_penalty() -> None:
    """Against least squares with a row for each second difference, in units of the range, mean square."""
    rng, bands = np.random.default_rng(2), 24
    moments, basis = rng.random((3, bands)), rng.standard_normal((bands, 5))
    curvature = np.diff(basis, 2, axis=0) * bands
    rows = np.concatenate([moments @ basis, np.sqrt(SMOOTHNESS / bands) * curvature])
    colours = np.concatenate([np.eye(3), np.zeros((bands - 2, 3))])
    wanted = basis @ np.linalg.lstsq(rows, colours)[0]
    assert basis_solution(moments, basis) == pytest.approx(wanted, rel=1e-8)


def test_bands_that_nothing_tells_of_take_the_nearest_that_is_known() -> None:
    values = torch.tensor([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [7.0, 8.0]])
    known = torch.tensor([[False, False], [True, False], [False, False], [True, False]])
    assert _filled(values, known).tolist() == [[3.0, 0.0], [3.0, 0.0], [3.0, 0.0], [7.0, 0.0]]
