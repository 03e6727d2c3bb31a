"""Small results of the twin on disk, for tests of the Compare page."""

from __future__ import annotations

from pathlib import Path

from dsl_core import pipeline
from dsl_core.devices.registry import open_rig
from dsl_core.io.result.result_file import save_result
from dsl_core.io.scan.origin import rig_notes
from dsl_core.model.presets import PRESETS
from dsl_core.workflows import scans

QUICK = next(preset.plan for preset in PRESETS if preset.key == "quick")


def make_result(folder: Path, name: str, scene: str = "color-checker", size: str = "64x48") -> Path:
    """Scan a scene of the twin quickly and save its result."""
    options = {"scene": scene, "size": size}
    with open_rig("twin", options) as rig:
        session = folder / f"{name}.dsl"
        pipeline.scan(rig, pipeline.fit_plan(QUICK, rig), session, notes=rig_notes("twin", options))
    target = folder / f"{name}.zarr"
    save_result(scans.reconstruct_scan(session), target)
    return target
