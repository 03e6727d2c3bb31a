from __future__ import annotations

import pytest

from dsl_core.errors import CalibrationError, PlanError
from dsl_core.model.options import MODELS, SOLVERS, SpectralChoice
from dsl_core.model.plan import CapturePlan, LineComb
from dsl_core.optics.correspondence import correspondence
from dsl_core.reconstruction.spectral.solvers import check_solver
from dsl_core.simulation.published_rig import published_rig


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_every_model_that_is_offered_is_known(model: SpectralChoice) -> None:
    if model.name in ("auto", "grating"):
        correspondence(published_rig(), model.name)
        return
    with pytest.raises(CalibrationError, match="run the depth-stage calibration"):
        correspondence(published_rig(), model.name)


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda solver: solver.name)
def test_every_solver_that_is_offered_is_known(solver: SpectralChoice) -> None:
    check_solver(solver.name, published_rig(), CapturePlan(), "auto")


def test_a_solver_that_cannot_read_the_patterns_says_so() -> None:
    with pytest.raises(PlanError, match="one line per frame"):
        check_solver("nearest-line", published_rig(), CapturePlan(spectral=LineComb()), "auto")
