"""What the pictures of a scan say only together, of scans that the twin renders."""

from __future__ import annotations

import pytest

from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.devices.base import DeviceRig
from dsl_core.model.plan import CapturePlan, GrayCode, NoSpectral
from tests.cases.rendered_rig import RenderedScene, render, token_image

PLAN = CapturePlan(code=GrayCode(rows=True), spectral=NoSpectral())


def said_of(scene: RenderedScene) -> str:
    """What is wrong from the first picture on."""
    proof = FrameProof(scene.plan, scene.calibration)
    rig: DeviceRig = scene.open()
    for shot in scene.plan.shots():
        rig.camera.configure(shot.exposure_ms)
        rig.projector.show(token_image(scene.plan, shot))
        proof.judge(shot, rig.camera.snap().pixels)
    return " ".join(proof.whole.lasting())


@pytest.mark.parametrize(("defocus_px", "is_soft"), [("0", False), ("2", True)])
def test_a_scan_says_that_its_camera_is_out_of_focus(defocus_px: str, is_soft: bool) -> None:
    scene = render(PLAN, scene="color-checker", size="112x72", defocus_px=defocus_px)
    assert ("out of focus" in said_of(scene)) == is_soft
