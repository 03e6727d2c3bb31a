"""Small results of the simulated rig on disk, for tests that need a scan next to its result."""

from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from dsl_core import pipeline
from dsl_core.devices.registry import open_rig
from dsl_core.io.result.result_file import load_result, save_result
from dsl_core.io.scan.origin import rig_notes
from dsl_core.model.presets import PRESETS
from dsl_core.workflows import scans

QUICK = next(preset.plan for preset in PRESETS if preset.key == "quick")
OPTIONS = {"scene": "color-checker", "size": "64x48"}


@cache
def _made() -> TemporaryDirectory[str]:
    """A folder with ``made.dsl`` and ``made.zarr``, scanned once per process."""
    folder = TemporaryDirectory(prefix="small_scan_")
    session = Path(folder.name) / "made.dsl"
    with open_rig("twin", OPTIONS) as rig:
        pipeline.scan(rig, pipeline.fit_plan(QUICK, rig), session, notes=rig_notes("twin", OPTIONS))
    save_result(scans.reconstruct_scan(session), session.with_suffix(".zarr"))
    return folder


def make_result(folder: Path, name: str) -> Path:
    """A quick scan of the simulated rig as ``name.dsl``, next to its result, which is returned."""
    for suffix in (".dsl", ".zarr"):
        shutil.copytree(Path(_made().name) / f"made{suffix}", folder / f"{name}{suffix}")
    return folder / f"{name}.zarr"


def make_variant(result: Path, name: str, nearer_mm: float) -> Path:
    """A result of the same size next to another one, but nearer and darker."""
    data = load_result(result).load()
    data["depth_mm"] -= nearer_mm
    data["reflectance"] *= 0.8
    return save_result(data, result.with_name(f"{name}.zarr"))
