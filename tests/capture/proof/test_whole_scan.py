"""What the pictures of a scan say only together, of scans that the twin renders."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.devices.base import DeviceRig
from dsl_core.model.plan import CapturePlan, GrayCode, NoSpectral
from tests.cases.rendered_rig import RenderedScene, render, token_image

PLAN = CapturePlan(code=GrayCode(rows=True), spectral=NoSpectral())


def said_of(scene: RenderedScene, sharpened: float = 0.0, flicker: float = 0.0) -> str:
    """What is wrong from the first picture on, by a camera that sharpens its pictures by so much.

    Every fourth pair of the code has so much more light, as a share, and every fourth so much less.
    """
    proof = FrameProof(scene.plan, scene.calibration)
    rig: DeviceRig = scene.open()
    for shot in scene.plan.shots():
        rig.camera.configure(shot.exposure_ms)
        rig.projector.show(token_image(scene.plan, shot))
        pixels = rig.camera.snap().pixels.astype(np.float64)
        black_dn = scene.calibration.sensor.black_level_dn
        light = 1 + flicker * (shot.role == "code") * (0, 1, 0, -1)[shot.pattern // 2 % 4]
        pixels = black_dn + light * (pixels - black_dn)
        pixels += sharpened * (pixels - gaussian_filter(pixels, 1.5))
        proof.judge(shot, np.rint(pixels).clip(0, scene.calibration.sensor.full_scale_dn).astype(np.uint16))
    return " ".join(proof.whole.lasting())


@pytest.mark.parametrize(("defocus_px", "is_soft"), [("0", False), ("2", True)])
def test_a_scan_says_that_its_camera_is_out_of_focus(defocus_px: str, is_soft: bool) -> None:
    scene = render(PLAN, scene="color-checker", size="112x72", defocus_px=defocus_px)
    assert ("out of focus" in said_of(scene)) == is_soft


@pytest.mark.parametrize(("sharpened", "is_told"), [(0.0, False), (0.3, True)])
def test_a_scan_says_that_its_camera_sharpens(sharpened: float, is_told: bool) -> None:
    said = said_of(render(PLAN, scene="color-checker", size="112x72"), sharpened)
    assert said.startswith("Edges of the code's stripes are brighter than white") == is_told


def test_a_scan_says_that_its_light_flickers() -> None:
    said = said_of(render(PLAN, scene="color-checker", size="112x72"), flicker=0.05)
    assert "The light flickers: pairs of the code have between 0.95 and 1.05 times the light of white" in said
