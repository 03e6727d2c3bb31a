"""Nothing is captured again in clean scans, whatever their patterns."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core.capture.preflight import fit_plan
from dsl_core.model.presets import preset_plan
from dsl_core.pipeline import scan
from dsl_core.simulation.sim_devices import open_twin


@pytest.mark.parametrize("preset", ["preview", "comb", "coarse"])
def test_every_picture_of_a_white_wall_shows_its_pattern(preset: str, tmp_path: Path) -> None:
    plan = preset_plan(preset)
    assert plan is not None
    rig = open_twin({"size": "48x32", "scene": "plane"})
    assert scan(rig, fit_plan(plan, rig), tmp_path / "scan.dsl").corrected == 0
