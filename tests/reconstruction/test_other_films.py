"""Spectra are right whatever the film's lines and the projector's columns."""

from __future__ import annotations

import pytest

from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Setting
from dsl_core.planning import references
from dsl_core.simulation.published_rig import published_rig
from tests.cases.trial import PLACES, run_trial

PLAN = CapturePlan(
    code=GrayCode(rows=False),
    spectral=ScanLines(width_px=5, step_px=4),
    settings=(Setting(exposure_ms=1000 / 6, level=0.2), Setting(exposure_ms=1000 / 3, level=0.8)),
)


@pytest.mark.slow
@pytest.mark.parametrize(("lines_per_mm", "columns"), [(500, 640), (300, 640), (480, 320)])
def test_a_chart_keeps_its_colours(lines_per_mm: float, columns: int) -> None:
    rig = published_rig()
    rig = rig.model_copy(
        update={
            "film": rig.film.model_copy(update={"lines_per_mm": lines_per_mm}),
            "projector": rig.projector.resized(columns, columns * 9 // 16),
        }
    )
    found = run_trial(rig, PLAN, references.chart(), places=PLACES[:1])
    assert found.rmse < 0.004
