"""A scan takes pictures again that do not show their pattern, says so, and stops where that does not help."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof import contest
from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.lasting.levels import at_half_level
from dsl_core.capture.proof.raster import Counts
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.capture.proven.doubted import JUST_BEFORE
from dsl_core.capture.proven.shots import SETTLE_MS
from dsl_core.capture.runner import Runner, State
from dsl_core.errors import DeviceError
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting, Shot
from tests.cases.memory_sink import MemorySink
from tests.cases.pattern_faults import PatternFault, PatternFaults
from tests.cases.rendered_rig import RenderedScene, render, token_image


@pytest.fixture(scope="module")
def scene() -> RenderedScene:
    plan = CapturePlan(
        code=GrayCode(rows=False),
        spectral=LineComb(step_px=4, period_px=64),
        settings=(Setting(exposure_ms=500 / 3, level=0.2),),
        code_settings=(0,),
    )
    return render(plan, scene="plane", size="64x48")


def _run(scene: RenderedScene, sink: MemorySink, *faults: PatternFault) -> tuple[Runner, PatternFaults]:
    spoiled = PatternFaults(scene.open(), scene.plan, token_image, faults)
    proof = FrameProof(scene.plan, scene.calibration)
    runner = Runner(spoiled.rig, scene.plan, sink, token_image, proof=proof, stored=sink)
    return runner, spoiled


def _wrong(sink: MemorySink, spoiled: PatternFaults) -> list[int]:
    return [index for index, frame in sink.frames.items() if frame.frame_id in spoiled.wrong]


@pytest.mark.parametrize("kind", ["late", "swapped", "torn", "band", "half", "dark", "saturated"])
@pytest.mark.parametrize("at", [5, 20, 30])
def test_a_wrong_picture_is_taken_again_and_noted(scene: RenderedScene, kind: str, at: int) -> None:
    sink = MemorySink(scene.plan)
    runner, spoiled = _run(scene, sink, PatternFault(kind, at))
    status = runner.run()
    assert status.state is State.FINISHED
    assert spoiled.wrong
    assert _wrong(sink, spoiled) == []
    assert status.corrected > 0
    assert "captured again, because a picture did not show its pattern" in status.message
    assert sink.frames[at].corrected
    assert sink.frames[at].attempts > 1


def test_right_pictures_are_taken_once(scene: RenderedScene) -> None:
    sink = MemorySink(scene.plan)
    status = _run(scene, sink)[0].run()
    assert status.corrected == 0
    assert status.message == f"All {scene.plan.shot_count} frames are saved."
    assert {(frame.attempts, frame.corrected) for frame in sink.frames.values()} == {(1, "")}


@pytest.mark.parametrize("kind", ["projector late", "camera late"])
@pytest.mark.parametrize("at", [5, 8, 21, 24, 30])
def test_devices_that_are_always_one_picture_late_still_give_a_right_scan(
    scene: RenderedScene, kind: str, at: int
) -> None:
    sink = MemorySink(scene.plan)
    runner, spoiled = _run(scene, sink, PatternFault(kind, at))
    status = runner.run()
    assert _wrong(sink, spoiled) == []
    assert "Everything was captured twice" in status.message


@pytest.mark.parametrize(
    ("kind", "what"),
    [
        ("frozen", "pattern before"),
        ("camera repeats", "pixel by pixel"),
        ("half from", "brightness is wrong"),
        ("dark from", "pattern is missing"),
    ],
)
def test_what_stays_wrong_stops_the_scan_and_is_named(scene: RenderedScene, kind: str, what: str) -> None:
    sink = MemorySink(scene.plan)
    runner, spoiled = _run(scene, sink, PatternFault(kind, 30))
    with pytest.raises(DeviceError, match=f"^Frame 31 .* after {len(SETTLE_MS) + 1} exposures: .*{what}"):
        runner.run()
    assert runner.status.state is State.FAILED
    assert sorted(sink.frames) == list(range(30 - JUST_BEFORE))
    assert _wrong(sink, spoiled) == []


def test_a_resumed_scan_learns_from_saved_frames_and_takes_wrong_ones_again(scene: RenderedScene) -> None:
    whole = MemorySink(scene.plan)
    _run(scene, whole)[0].run()
    sink = MemorySink(scene.plan)
    for index in range(28):
        # What an older program saved: frame 25 shows the pattern of frame 24.
        sink.frames[index] = replace(whole.frames[24 if index == 25 else index], frame_id=-1)
    runner, spoiled = _run(scene, sink, PatternFault("late", 30))
    assert runner.run().corrected == 2
    assert spoiled.wrong
    assert _wrong(sink, spoiled) == []
    assert sink.frames[25].corrected
    assert sink.frames[30].corrected
    assert sink.frames[26].frame_id == -1


@pytest.fixture
def blind(monkeypatch: pytest.MonkeyPatch) -> int:
    """Number of the first shot of which nothing can be told."""
    judge, first = FrameProof.judge_raster, 27

    def untold(self: FrameProof, shot: Shot, seen: Counts) -> Finding:
        found = judge(self, shot, seen)
        return Finding(shot, Verdict.UNTOLD) if shot.index >= first else found

    monkeypatch.setattr(FrameProof, "judge_raster", untold)
    return first


def test_shots_nobody_can_judge_before_the_stop_are_taken_again_on_resuming(
    scene: RenderedScene, blind: int
) -> None:
    whole = MemorySink(scene.plan)
    _run(scene, whole)[0].run()
    sink = MemorySink(scene.plan)
    sink.frames.update({index: replace(whole.frames[index], frame_id=-1) for index in range(30)})
    _run(scene, sink)[0].run()
    assert [index for index in range(30) if sink.frames[index].frame_id != -1] == list(range(blind, 30))


@pytest.mark.usefixtures("blind")
@pytest.mark.parametrize("kind", ["half from", "dark from"])
def test_all_since_the_code_is_withdrawn_where_the_end_cannot_be_judged_and_a_control_fails(
    scene: RenderedScene, kind: str
) -> None:
    sink = MemorySink(scene.plan)
    runner, spoiled = _run(scene, sink, PatternFault(kind, 31))
    last = scene.plan.shot_count - 1
    first = next(shot.index for shot in scene.plan.shots() if shot.role == "spectral")
    said = f"captured once more as a control.*{last + 1 - first} frames between {first + 1} and {last + 1}"
    with pytest.raises(DeviceError, match=said):
        runner.run()
    assert spoiled.wrong
    assert sorted(sink.frames) == list(range(first))
    assert _run(scene, sink)[0].run().state is State.FINISHED
    assert _wrong(sink, spoiled) == []


def test_a_scan_whose_last_pictures_cannot_be_judged_ends_with_a_control(
    scene: RenderedScene, blind: int
) -> None:
    sink = MemorySink(scene.plan)
    runner, _ = _run(scene, sink)
    assert runner.run().corrected == 0
    assert len(sink.frames) == scene.plan.shot_count


@pytest.mark.parametrize("at", [25, 30])
def test_a_picture_torn_in_its_last_rows_is_taken_again(
    scene: RenderedScene, monkeypatch: pytest.MonkeyPatch, at: int
) -> None:
    # One line in a small picture has so few pixels in these rows; ten lines of a comb have more.
    monkeypatch.setattr(contest, "TORN_VOTES", 100.0)
    sink = MemorySink(scene.plan)
    runner, spoiled = _run(scene, sink, PatternFault("torn", at, 0.965))
    assert runner.run().corrected == 1
    assert _wrong(sink, spoiled) == []
    assert "a few rows" in sink.frames[at].corrected


@pytest.mark.parametrize("is_changed", [True, False])
def test_a_control_tells_whether_everything_is_as_it_was(scene: RenderedScene, is_changed: bool) -> None:
    rig = scene.open()
    proof = FrameProof(scene.plan, scene.calibration)
    assert proof.scene.controls() == ()

    def picture(shot: Shot, shift_px: int = 0) -> NDArray[np.uint16]:
        rig.projector.show(token_image(scene.plan, shot))
        rig.camera.configure(shot.exposure_ms)
        return np.roll(rig.camera.snap().pixels, shift_px, 1)

    for shot in scene.plan.shots():
        proof.judge(shot, picture(shot))
    for control in proof.scene.controls():
        assert control.role == "code"
        assert proof.scene.is_as_before(control, picture(control, 6 if is_changed else 0)) is not is_changed
        inverse = next(s for s in scene.plan.shots() if (s.role, s.pattern) == ("code", control.pattern ^ 1))
        assert not proof.scene.is_as_before(control, picture(inverse))
    assert len(proof.scene.controls()) == 2


@pytest.mark.parametrize(("light", "is_told"), [(0.95, False), (0.8, True)])
def test_a_projector_that_changes_levels_is_told_even_in_a_scan_at_one_level(
    scene: RenderedScene, light: float, is_told: bool
) -> None:
    """Its scan is darker or brighter throughout, as of another scene."""
    white = next(shot for shot in scene.plan.shots() if shot.role == "white")
    dim = token_image(scene.plan, at_half_level(white)).tobytes()
    spoiled = replace(scene, rates={**scene.rates, dim: scene.rates[dim] * np.float32(light)})
    sink = MemorySink(scene.plan)
    runner, _ = _run(spoiled, sink)
    message = runner.run().message
    assert ("At half the drive level, white has another share of its light" in message) == is_told
    # Of light above black, which a dark projector gives as well.
    assert ("0.78 in green" in message) == is_told
