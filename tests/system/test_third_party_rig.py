"""A rig of a separate installed package goes through the same commands as our own."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from .conftest import SMALL_PLAN, Give

PACKAGE = '''
"""A laboratory's own camera and projector, here standing in front of a simulated scene."""
from dataclasses import replace

from dsl_core.devices.base import Camera, DeviceRig, Projector
from dsl_core.errors import DeviceError
from dsl_core.simulation.sim_devices import open_twin


class LabCamera(Camera):
    def __init__(self, eye):
        self.eye = eye

    @property
    def info(self):
        return replace(self.eye.info, model="LabCam", serial="42")

    def configure(self, exposure_ms):
        return self.eye.configure(exposure_ms)

    def prepare(self, shot_index, attempt=0):
        self.eye.prepare(shot_index, attempt)

    def snap(self, timeout_ms=5000.0):
        return self.eye.snap(timeout_ms)


class LabProjector(Projector):
    def __init__(self, lamp):
        self.lamp = lamp

    @property
    def info(self):
        return replace(self.lamp.info, model="LabBeam", serial="43")

    def show(self, image):
        self.lamp.show(image)


def open_lab(options):
    """A camera and projector of our own."""
    if options.get("cable") == "out":
        raise DeviceError("The lab camera does not answer. Plug in its cable.")
    world = open_twin({"size": "112x72"})
    return DeviceRig(
        "lab", LabCamera(world.camera), LabProjector(world.projector), calibration=world.calibration,
        sleep=world.sleep,
    )
'''


@pytest.fixture(autouse=True)
def _installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The package and its metadata, as an installer leaves them."""
    site = tmp_path / "site"
    (site / "lab_rig").mkdir(parents=True)
    (site / "lab_rig" / "__init__.py").write_text(PACKAGE)
    info = site / "lab_rig-2.1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab-rig\nVersion: 2.1\n")
    (info / "entry_points.txt").write_text("[dsl_scan.rigs]\nlab = lab_rig:open_lab\n")
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.delitem(sys.modules, "lab_rig", raising=False)


@pytest.mark.slow
def test_it_is_listed_scanned_resumed_and_reconstructed(give: Give, tmp_path: Path) -> None:
    listed = {rig["name"]: rig for rig in give("rigs", "--json").json["rigs"]}
    assert listed["lab"]["package"] == "lab-rig"
    assert listed["lab"]["version"] == "2.1"
    assert listed["lab"]["description"] == "A camera and projector of our own."

    scan = tmp_path / "scan.dsl"
    assert give("scan", scan, "--rig", "lab", *SMALL_PLAN).code == 0
    info = give("info", scan, "--json").json
    assert (info["rig"], info["camera"], info["projector"]) == ("lab", "LabCam", "LabBeam")
    (scan / "frames" / "c.7.0.0").unlink()
    assert give("resume", scan).code == 0

    said = give("reconstruct", scan, "--json").json
    assert said["pixels_with_depth"] > 0.3
    assert "has no ground truth" in give("evaluate", tmp_path / "scan.zarr").sentence
    truth = ["--truth-rig", "twin", "-O", "size=112x72"]
    figures = give("evaluate", tmp_path / "scan.zarr", *truth, "--json").json["figures"]
    assert figures["depth_rmse_mm"] < 2
    assert give("export", tmp_path / "scan.zarr", "ply", tmp_path / "a.ply").code == 0


def test_its_own_errors_speak_for_themselves(give: Give, tmp_path: Path) -> None:
    ending = give("scan", tmp_path / "scan.dsl", "--rig", "lab", "-O", "cable=out")
    assert ending.code == 2
    assert ending.sentence == "The lab camera does not answer. Plug in its cable."
