"""Light in all pixels of a comb is a lamp of the room; what is usual of a scan, or only scaled, is not."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.capture.proof.judging.common_light import CommonLight
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.devices.registry import open_rig
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.presets import preset_plan

OPTIONS = {"size": "112x72", "scene": "face"}


def _later(index: int) -> Shot:
    plan = preset_plan("preview")
    assert plan is not None
    return next(shot for shot in plan.shots() if shot.index == index)


def test_a_step_is_one_from_what_was_usual_and_is_not_remembered() -> None:
    seen, shot = CommonLight(), _later(61)
    assert [seen.step(shot, each) for each in (210.0, 202.0, 206.0)] == [0.0, 0.0, 0.0]
    assert seen.step(shot, 300.0) == pytest.approx(94.0)
    kept = seen.copy()
    assert seen.step(shot, 300.0) == pytest.approx(94.0)
    assert seen.step(shot, 240.0) == 0.0, "first orders differ by so much"
    assert kept.step(shot, 100.0) == pytest.approx(-106.0)
    assert seen.step(_later(25), 300.0) == 0.0, "another setting"


@pytest.fixture(scope="module")
def frames() -> tuple[CapturePlan, dict[int, NDArray[np.uint16]]]:
    rig = open_rig("twin", OPTIONS)
    preset = preset_plan("preview")
    assert preset is not None
    plan = pipeline.fit_plan(preset, rig)
    return plan, dict(_taken(plan))


def _taken(plan: CapturePlan) -> Iterator[tuple[int, NDArray[np.uint16]]]:
    from dsl_core.patterns.images import pattern_image

    rig = open_rig("twin", OPTIONS)
    for shot in plan.shots():
        rig.camera.configure(shot.exposure_ms)
        rig.projector.show(pattern_image(plan, shot))
        rig.camera.prepare(shot.index)
        yield shot.index, rig.camera.snap().pixels


@pytest.mark.parametrize("more_dn", [0, 60])
def test_a_lamp_that_goes_on_for_a_few_combs_is_seen(
    frames: tuple[CapturePlan, dict[int, NDArray[np.uint16]]], more_dn: int
) -> None:
    plan, pixels = frames
    calibration = open_rig("twin", OPTIONS).calibration
    assert calibration is not None
    proof = FrameProof(plan, calibration, 12, "RGGB")
    lines = [s for s in plan.shots() if (s.role, s.setting) == ("spectral", 1)]
    lit, wrong = {shot.index for shot in lines[6:9]}, set[int]()
    for shot in plan.shots():
        seen = pixels[shot.index]
        if shot.index in lit:
            seen = np.minimum(seen + more_dn, 4095).astype(np.uint16)
        found = proof.judge(shot, seen)
        if found.is_wrong:
            wrong.add(shot.index)
            told = re.search(r"all of it has \+(\d+) DN", found.detail)
            assert told is not None
            assert int(told[1]) == pytest.approx(more_dn, abs=6)
    assert wrong == (lit if more_dn else set())
