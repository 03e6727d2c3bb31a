"""Pictures of a small scene are judged one by one: right ones pass, wrong ones are named."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.finding import Finding, Verdict
from dsl_core.capture.proof.verifier import FrameProof
from dsl_core.devices.base import DeviceRig
from dsl_core.model.plan import Shot
from tests.cases.rendered_rig import RenderedScene, token_image

Counts = NDArray[np.uint16]


def _take(rig: DeviceRig, scene: RenderedScene, shot: Shot, shown: Shot | None = None) -> Counts:
    rig.camera.configure(shot.exposure_ms)
    pattern = shown or shot
    level = Shot(shot.index, pattern.role, pattern.pattern, shot.setting, shot.exposure_ms, shot.level)
    rig.projector.show(token_image(scene.plan, level))
    return rig.camera.snap().pixels


def _judge_with(scene: RenderedScene, wrong: dict[int, Counts]) -> list[Finding]:
    """All that is found wrong when some pictures are replaced; what is wrong is taken again."""
    rig, proof = scene.open(3), FrameProof(scene.plan, scene.calibration)
    found = []
    enough = max(_shot(scene, "black", 0, 0).index, *wrong) + 1
    for shot in list(scene.plan.shots())[:enough]:
        finding = proof.judge(shot, wrong.get(shot.index, _take(rig, scene, shot)))
        if finding.is_wrong:
            found.append(finding)
            for again in finding.again:
                finding = proof.judge(again, _take(rig, scene, again))
            assert not finding.is_wrong, "a second take is right"
    return found


def _shot(scene: RenderedScene, role: str, pattern: int, setting: int) -> Shot:
    return next(s for s in scene.plan.shots() if (s.role, s.pattern, s.setting) == (role, pattern, setting))


@pytest.mark.parametrize("is_calibrated", [True, False])
def test_nothing_is_wrong_with_right_pictures_and_most_can_be_told(
    scene: RenderedScene, is_calibrated: bool
) -> None:
    rig, proof = scene.open(1), FrameProof(scene.plan, scene.calibration if is_calibrated else None)
    verdicts = [proof.judge(shot, _take(rig, scene, shot)).verdict for shot in scene.plan.shots()]
    assert set(verdicts) == {Verdict.RIGHT, Verdict.UNTOLD}
    # Of a code, patterns are judged with their inverse; nothing is known at the first.
    assert verdicts.count(Verdict.UNTOLD) <= scene.plan.code_count // 2 + 2


@pytest.mark.parametrize(
    ("role", "pattern", "setting"),
    [
        ("code", 6, 0), ("code", 1, 0), ("white", 0, 0), ("black", 0, 0), ("spectral", 0, 0),
        ("spectral", 9, 0), ("code", 6, 1), ("black", 0, 1), ("spectral", 9, 1),
    ],
)  # fmt: skip
def test_a_late_picture_is_found_whatever_its_shot(
    scene: RenderedScene, role: str, pattern: int, setting: int
) -> None:
    shot = _shot(scene, role, pattern, setting)
    before = list(scene.plan.shots())[shot.index - 1]
    late = _take(scene.open(5), scene, shot, before)
    found = _judge_with(scene, {shot.index: late})
    assert found
    assert shot in found[0].again


@pytest.mark.parametrize("number", [0, 4, 9])
def test_a_pattern_and_its_inverse_that_changed_places_are_found(scene: RenderedScene, number: int) -> None:
    shots = [_shot(scene, "code", 2 * number + inverse, 0) for inverse in (0, 1)]
    rig = scene.open(5)
    wrong = {shots[i].index: _take(rig, scene, shots[i], shots[1 - i]) for i in (0, 1)}
    found = _judge_with(scene, wrong)
    assert [finding.verdict for finding in found] == [Verdict.SWAPPED]
    assert set(shots) <= set(found[0].again)


@pytest.mark.parametrize(("role", "pattern", "setting"), [("code", 8, 0), ("spectral", 6, 0), ("code", 8, 1)])
def test_a_torn_picture_is_found(scene: RenderedScene, role: str, pattern: int, setting: int) -> None:
    shot, rig = _shot(scene, role, pattern, setting), scene.open(5)
    other = list(scene.plan.shots())[shot.index - 1]
    torn = _take(rig, scene, shot)
    torn[36:] = _take(rig, scene, shot, other)[36:]
    found = _judge_with(scene, {shot.index: torn})
    assert shot in found[0].again


@pytest.mark.parametrize(
    ("role", "pattern", "setting"), [("code", 9, 0), ("spectral", 6, 0), ("code", 8, 1), ("spectral", 6, 1)]
)
def test_half_the_exposure_is_found_and_said(
    scene: RenderedScene, role: str, pattern: int, setting: int
) -> None:
    shot, rig = _shot(scene, role, pattern, setting), scene.open(5)
    rig.camera.configure(shot.exposure_ms / 2)
    rig.projector.show(token_image(scene.plan, shot))
    found = _judge_with(scene, {shot.index: rig.camera.snap().pixels})
    assert [finding.verdict for finding in found] == [Verdict.EXPOSURE]
    told = re.search(r"([\d.]+) times", found[0].sentence)
    assert told is not None
    assert float(told[1]) == pytest.approx(0.5, abs=0.05)


def test_a_window_brighter_than_white_is_found_in_a_line(scene: RenderedScene) -> None:
    rig, white, line = scene.open(5), _shot(scene, "white", 0, 0), _shot(scene, "spectral", 6, 0)
    window = _take(rig, scene, line).astype(np.int64)
    black = _take(rig, scene, _shot(scene, "black", 0, 0)).astype(np.int64)
    place = np.s_[20:26, 28:36]
    window[place] = (1.8 * _take(rig, scene, white).astype(np.int64) - 0.8 * black)[place]
    found = _judge_with(scene, {line.index: np.clip(window, 0, 4094).astype(np.uint16)})
    assert [finding.verdict for finding in found] == [Verdict.OTHER]
    assert "brighter than white" in found[0].sentence


@pytest.mark.parametrize("factor", [0.62, 1.6])
def test_the_first_picture_of_a_setting_says_how_bright_the_others_are(
    scene: RenderedScene, factor: float
) -> None:
    rig, proof = scene.open(1), FrameProof(scene.plan, scene.calibration)
    verdicts = []
    for shot in scene.plan.shots():
        if shot.role == "spectral" and shot.pattern > 2:
            continue
        rig.camera.configure(shot.exposure_ms * (factor if shot.setting else 1))
        rig.projector.show(token_image(scene.plan, shot))
        verdicts.append(proof.judge(shot, rig.camera.snap().pixels).verdict)
    assert set(verdicts) <= {Verdict.RIGHT, Verdict.UNTOLD}


def test_a_picture_given_twice_is_called_repeated(scene: RenderedScene) -> None:
    shot, rig = _shot(scene, "spectral", 6, 0), scene.open(3)
    pictures = {s.index: _take(rig, scene, s) for s in scene.plan.shots() if s.index < shot.index}
    proof = FrameProof(scene.plan, scene.calibration)
    for each in scene.plan.shots():
        if each.index < shot.index:
            proof.judge(each, pictures[each.index])
    found = proof.judge(shot, pictures[shot.index - 1])
    assert found.verdict is Verdict.REPEATED
    assert "pixel by pixel" in found.sentence


def test_a_first_picture_given_twice_is_taken_again_and_completes_its_pair(scene: RenderedScene) -> None:
    rig, proof = scene.open(3), FrameProof(scene.plan, scene.calibration)
    shots = [shot for shot in scene.plan.shots() if shot.index < 4]
    pictures = [_take(rig, scene, shot) for shot in shots]
    proof.judge(shots[0], pictures[0])
    found = proof.judge(shots[1], pictures[0])
    assert (found.verdict, found.again) == (Verdict.REPEATED, (shots[1],))
    for shot, picture in zip(shots[1:], pictures[1:], strict=True):
        assert not proof.judge(shot, picture).is_wrong
    assert not {0, 1} & set(proof.lacking_pairs)


def test_where_nothing_is_lit_the_second_pair_says_so(scene: RenderedScene) -> None:
    proof, rng = FrameProof(scene.plan, scene.calibration), np.random.default_rng(0)
    shots = [shot for shot in scene.plan.shots() if shot.index < 4]
    found = [proof.judge(s, rng.integers(258, 264, (48, 64)).astype(np.uint16)) for s in shots]
    assert [each.verdict for each in found] == 3 * [Verdict.UNTOLD] + [Verdict.DARK]
    assert found[-1].again == tuple(shots)
    assert "nor its inverse lights anything" in found[-1].sentence


def test_dark_scenes_are_not_judged_once_all_pictures_are_there(scene: RenderedScene) -> None:
    proof = FrameProof(scene.plan, scene.calibration, at_the_end=True)
    rng = np.random.default_rng(0)
    for shot in scene.plan.shots():
        pixels = rng.integers(258, 264, (48, 64)).astype(np.uint16)
        assert proof.judge(shot, pixels).verdict is Verdict.UNTOLD


@pytest.mark.parametrize(("across", "rises"), [(1.0, True), (-1.0, False)])
def test_columns_rise_unless_the_projector_is_mirrored(
    scene: RenderedScene, across: float, rises: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []

    def noted(*parts: object) -> None:
        asked.append(parts[-2])

    monkeypatch.setattr("dsl_core.capture.proof.judging.known.FirstCode", noted)
    rig = scene.calibration
    turned = np.diag([across, 1.0, across])
    pose = rig.pose.model_copy(update={"rotation": tuple(map(tuple, (turned @ rig.pose.matrix).tolist()))})
    FrameProof(scene.plan, rig.model_copy(update={"pose": pose}))
    FrameProof(scene.plan, None)
    assert asked == [rises, None]


def test_a_picture_of_the_code_is_unchanged_only_in_the_same_light(scene: RenderedScene) -> None:
    rig, proof = scene.open(3), FrameProof(scene.plan, scene.calibration)
    code, white = _shot(scene, "code", 8, 0), _shot(scene, "white", 0, 0)
    assert not proof.scene.is_unchanged(code, _take(rig, scene, code)), "nothing is known of it yet"
    for shot in list(scene.plan.shots())[: _shot(scene, "black", 0, 0).index + 1]:
        proof.judge(shot, _take(rig, scene, shot))
    now = _take(rig, scene, code)
    assert proof.scene.is_unchanged(code, now)
    mist = (now.mean() + 0.95 * (now - now.mean())).astype(np.uint16)
    assert proof.scene.is_as_before(code, mist)
    assert not proof.scene.is_unchanged(code, mist)
    assert not proof.scene.is_unchanged(white, _take(rig, scene, white)), "it does not show what has moved"


def test_only_pictures_of_the_code_are_its_finest(scene: RenderedScene) -> None:
    proof, last = FrameProof(scene.plan, scene.calibration), scene.plan.code_count - 1
    fine = _shot(scene, "code", last, 0)
    assert proof.are_finest([fine])
    assert not proof.are_finest([])
    assert not proof.are_finest([fine, _shot(scene, "code", 0, 0)])
    # Lines have numbers of their own.
    assert not proof.are_finest([fine, _shot(scene, "spectral", 15, 0)])
