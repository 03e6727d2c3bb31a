"""Cameras of any width, and without colours, are judged as all others are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.judging.known import Known
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.model.plan import CapturePlan, Columns, GrayCode, ScanLines, Sentinels, Setting, Shot
from dsl_core.model.rig import BayerPattern
from dsl_core.optics.sensor import bayer_channels
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.published_rig import published_rig

COLUMNS = 64
NM = np.arange(400.0, 701.0)


def plan_of(width: int, height: int) -> CapturePlan:
    return CapturePlan(
        camera_size_px=(width, height),
        projector_size_px=(COLUMNS, 8),
        code=GrayCode(rows=False),
        spectral=ScanLines(width_px=4, step_px=2),
        settings=(Setting(exposure_ms=100, level=0.5),),
        code_settings=(0,),
        sentinels=Sentinels(every=20),
    )


class FlatScene:
    """A flat surface whose columns are the projector's, seen by a camera with noise."""

    def __init__(
        self,
        plan: CapturePlan,
        bayer: BayerPattern,
        led: tuple[float, float, float] = (1, 1, 1),
        shares: tuple[float, float, float] = (1, 1, 1),
        light_dn: float = 2000.0,
        ends_dn: int = 4095,
        blur_px: int = 1,
    ) -> None:
        width, height = plan.camera_size_px
        self._light_dn, self._ends_dn, self._blur_px = light_dn, ends_dn, blur_px
        self._plan, self._rng = plan, np.random.default_rng(width)
        self._column = np.arange(width) * COLUMNS // width
        self._gain = (np.array([0.8, 1.0, 0.6]) * led)[bayer_channels(bayer, height, width)]
        self._shares = np.array(shares) / sum(shares)

    def take(self, shot: Shot) -> NDArray[np.uint16]:
        image = pattern_image(self._plan, self._plan.original(shot)).astype(float)
        share = (image.reshape(8, COLUMNS, -1).mean(0) / max(image.max(), 1)) @ self._shares
        seen = uniform_filter1d(share[self._column], self._blur_px, mode="nearest")
        light = 100 + self._light_dn * seen[None] * self._gain
        values = self._rng.normal(light, np.sqrt(4 + 0.1 * light))
        return np.asarray(values.round().clip(0, self._ends_dn), np.uint16)


@pytest.mark.parametrize(
    ("width", "height", "bayer"),
    [(640, 71, "RGGB"), (1000, 36, "MONO"), (1280, 36, "RGGB"), (2048, 36, "GRBG"), (4096, 36, "MONO")],
)
def test_right_pictures_of_any_camera_pass(width: int, height: int, bayer: BayerPattern) -> None:
    plan = plan_of(width, height)
    proof, scene = FrameProof(plan, None, 12, bayer), FlatScene(plan, bayer)
    found = [proof.judge(shot, scene.take(shot)).verdict for shot in plan.shots()]
    assert set(found) <= {Verdict.RIGHT, Verdict.UNTOLD}
    assert found.count(Verdict.RIGHT) > len(found) / 2


@pytest.mark.parametrize("ends_dn", [4095, 4094, 4080])
@pytest.mark.parametrize("bayer", ["RGGB", "MONO"])
def test_bright_pictures_pass_wherever_their_values_end(bayer: BayerPattern, ends_dn: int) -> None:
    plan = plan_of(640, 72)
    proof = FrameProof(plan, None, 12, bayer)
    scene = FlatScene(plan, bayer, light_dn=20_000, ends_dn=ends_dn, blur_px=15)
    found = [proof.judge(shot, scene.take(shot)) for shot in plan.shots()]
    assert [each for each in found if each.is_wrong] == []


def coloured(width: int, height: int) -> CapturePlan:
    """A plan whose pictures after the code are all red, all green, all blue, white and black."""
    lights = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0), (0.0, 0.0, 0.0))
    spectral = Columns(levels=tuple((light,) * COLUMNS for light in lights))
    return plan_of(width, height).model_copy(update={"spectral": spectral})


@pytest.mark.parametrize("shares", [(1.0, 1.0, 1.0), (0.11, 0.8, 0.09), (0.6, 0.3, 0.1)])
def test_a_camera_without_colours_and_calibration_may_see_any_light_of_each_led(
    shares: tuple[float, float, float],
) -> None:
    plan = coloured(1000, 36)
    proof, scene = FrameProof(plan, None, 12, "MONO"), FlatScene(plan, "MONO", shares=shares)
    found = {shot.index: proof.judge(shot, scene.take(shot)) for shot in plan.shots()}
    assert [each for each in found.values() if each.is_wrong] == []


def test_a_calibration_says_how_much_of_white_each_colour_is() -> None:
    plan, rig = coloured(1000, 36), published_rig()
    mono = rig.model_copy(update={"sensor": rig.sensor.model_copy(update={"bayer": "MONO"})})
    pictures = [shot for shot in plan.shots() if shot.role == "spectral"]
    seen = []
    for each in (mono, rig):
        known = Known(plan, each, 12, "RGGB", at_the_end=False, knows_light=False)
        seen.append([known.profile(shot) for shot in pictures])
    light = np.array([profile[0] for profile in seen[0] if profile is not None])
    parts = [np.trapezoid(c.at(NM) * rig.response[1].at(NM), NM) for c in rig.emission]
    assert light == pytest.approx([*(np.array(parts) / sum(parts)), 1.0, 0.0], abs=1e-3)
    assert seen[1][2] is not None
    assert seen[1][2][:3].tolist() == [0.0, 0.0, 1.0]


@pytest.mark.parametrize("width", [640, 1280])
def test_a_blue_that_fails_is_seen_by_a_camera_of_any_width(width: int) -> None:
    plan = plan_of(width, 36)
    proof, scene, dim = FrameProof(plan, None, 12, "RGGB"), FlatScene(plan, "RGGB"), None
    told = []
    for shot in plan.shots():
        if shot.role == "spectral" and dim is None:
            dim = FlatScene(plan, "RGGB", (1.0, 1.0, 0.2))
        told.append(proof.judge(shot, (dim or scene).take(shot)))
    assert any(each.is_wrong or each.is_doubtful for each in told if each.shot.role != "code")
