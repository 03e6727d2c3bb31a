"""Folders as another program lays them out, made from a small scan of the twin."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from dsl_core import pipeline
from dsl_core.devices.registry import open_rig
from dsl_core.io.published.calibration import export_calibration
from dsl_core.io.rig_file import save_rig
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.presets import PRESETS
from dsl_core.workflows import exchange

QUICK = next(preset.plan for preset in PRESETS if preset.key == "quick")


@dataclass(frozen=True)
class Folders:
    """``scene`` is a dataset, ``rig`` a calibration, ``own`` the file of the rig that took the scan."""

    folder: Path

    @property
    def scan(self) -> Path:
        """What the dataset was written from."""
        return self.folder / "scan.dsl"

    @property
    def scene(self) -> Path:
        """A complete dataset."""
        return self.folder / "scene"

    @property
    def rig(self) -> Path:
        """A complete calibration."""
        return self.folder / "rig"

    @property
    def own(self) -> Path:
        """The rig as this program writes it."""
        return self.folder / "own.json"


def make_folders(folder: Path) -> Folders:
    """Scan quickly, and write scan and rig in the published layout."""
    made = Folders(folder)
    with open_rig("twin", {"scene": "plane", "size": "64x48"}) as devices:
        pipeline.scan(devices, pipeline.fit_plan(QUICK, devices), made.scan)
    calibration = ScanReader(made.scan).calibration
    assert calibration is not None
    exchange.export_scan(made.scan, made.scene)
    export_calibration(calibration, made.rig)
    save_rig(calibration, made.own)
    return made
