"""Light that comes and goes with some lines is told by what parts of the picture gain and lose at once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.devices.registry import open_rig
from dsl_core.model.plan import CapturePlan
from dsl_core.model.presets import preset_plan
from dsl_core.patterns.images import pattern_image
from dsl_core.pipeline import fit_plan

OPTIONS = {"size": "112x72", "scene": "color-checker"}
Pixels = NDArray[np.uint16]
#: A picture with what is wrong with it, from it and from black.
Fault = Callable[[Pixels, Pixels], NDArray[np.floating]]


@pytest.fixture(scope="module")
def frames() -> tuple[CapturePlan, list[Pixels]]:
    rig = open_rig("twin", OPTIONS)
    preset = preset_plan("quick")
    assert preset is not None
    plan, taken = fit_plan(preset, rig), []
    for shot in plan.shots():
        rig.camera.configure(shot.exposure_ms)
        rig.projector.show(pattern_image(plan, shot))
        rig.camera.prepare(shot.index)
        taken.append(rig.camera.snap().pixels)
    return plan, taken


def _lamp(seen: Pixels, black: Pixels) -> NDArray[np.floating]:
    return seen + 66.0 * np.linspace(0.5, 1.5, seen.shape[0])[:, None]


def _spot(seen: Pixels, black: Pixels) -> NDArray[np.floating]:
    return seen + 33.0 * np.exp(-((np.linspace(-2.5, 2.5, seen.shape[1])) ** 2))


def _hand(seen: Pixels, black: Pixels) -> NDArray[np.floating]:
    return np.where(np.abs(np.linspace(-0.5, 0.5, seen.shape[1])) < 0.15, black, seen)


@pytest.mark.parametrize(
    ("fault", "lines", "is_told"),
    [
        (_lamp, range(61, 62), True),
        (_spot, range(61, 63), True),
        (_lamp, range(61, 66), True),
        (_hand, range(51, 54), True),
        (_lamp, range(61, 150), False),
        (_lamp, range(0), False),
    ],
)
def test_lines_with_light_that_comes_and_goes_are_taken_again(
    frames: tuple[CapturePlan, list[Pixels]], fault: Fault, lines: range, is_told: bool
) -> None:
    plan, taken = frames
    black = next(taken[shot.index] for shot in plan.shots() if shot.role == "black")
    proof, wrong = FrameProof(plan, open_rig("twin", OPTIONS).calibration, 12, "RGGB"), []
    for shot in plan.shots():
        seen = taken[shot.index]
        if shot.index in lines:
            seen = np.rint(fault(seen, black)).clip(0, 4095).astype(np.uint16)
        assert not proof.judge(shot, seen).is_wrong or shot.role == "sentinel"
        if (passed := proof.passed) is not None:
            wrong.append((passed.verdict, [each.index for each in passed.again]))
            first, *others = passed.again
            as_before = np.rint(fault(taken[first.index], black)).clip(0, 4095).astype(np.uint16)
            assert not proof.is_past(as_before), "the scene is like that"
            assert proof.is_past(taken[first.index])
            assert not any(proof.judge(each, taken[each.index]).is_wrong for each in (first, *others))
            assert proof.passed is None
    assert wrong == ([(Verdict.PASSING, list(lines))] if is_told else [])
