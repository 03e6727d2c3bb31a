"""A scan of a small picture."""

from __future__ import annotations

from pathlib import Path

import pytest

from dsl_core import pipeline
from dsl_core.devices.registry import open_rig
from dsl_core.model.presets import PRESETS


@pytest.fixture(scope="session")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """To be copied, not changed."""
    folder = tmp_path_factory.mktemp("scans") / "a.dsl"
    with open_rig("twin", {"scene": "plane", "size": "48x32"}) as devices:
        plan = next(p.plan for p in PRESETS if p.key == "quick")
        pipeline.scan(devices, pipeline.fit_plan(plan, devices), folder)
    return folder
