"""A finished scan is judged as a whole: wrong pictures are named, one by one, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest

from dsl_core.capture.proof.again.lit_again import LitAgain
from dsl_core.capture.proof.again.single_pixels import SinglePixels
from dsl_core.capture.proof.colour_again import ColourAgain
from dsl_core.capture.proof.finding import ProofReport, Verdict
from dsl_core.capture.proof.lasting.black_light import LitBlack
from dsl_core.capture.proof.lines.line_sum import LineSum
from dsl_core.capture.proof.report import SeenFrames, prove
from dsl_core.capture.proof.whole_scan import WholeScan
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, Sentinels, describe_shot
from tests.cases.memory_sink import MemorySink
from tests.cases.rendered_rig import RenderedScene, token_image


@pytest.fixture(scope="module")
def frames(scene: RenderedScene) -> MemorySink:
    """A finished scan."""
    rig, sink = scene.open(2), MemorySink(scene.plan)
    for shot in scene.plan.shots():
        rig.camera.configure(shot.exposure_ms)
        rig.projector.show(token_image(scene.plan, shot))
        sink.write(shot, rig.camera.snap())
    return sink


def _with(frames: MemorySink, changes: dict[int, int]) -> MemorySink:
    changed = MemorySink(frames.plan)
    changed.frames = frames.frames | {at: frames.frames[source] for at, source in changes.items()}
    return changed


def _judged(scene: RenderedScene, frames: MemorySink) -> ProofReport:
    seen = SeenFrames(frames.plan)
    seen.read_missing(frames)
    return seen.report(scene.calibration)


def test_a_sound_scan_has_no_wrong_pictures(scene: RenderedScene, frames: MemorySink) -> None:
    report = _judged(scene, frames)
    assert (report.judged, report.wrong) == (scene.plan.shot_count, ())


def test_pictures_of_a_code_that_fits_are_judged_by_each_other(
    scene: RenderedScene, frames: MemorySink
) -> None:
    shots = list(scene.plan.shots())
    assert _judged(scene, frames).untold == 0
    dark = next(shot.index for shot in shots if shot.role == "black")
    unlike = _with(frames, {shot.index: dark for shot in shots if shot.role in ("code", "white")})
    assert _judged(scene, unlike).untold > sum(shot.role == "code" for shot in shots) / 2


def test_light_is_not_judged_where_exposures_are_not_known(scene: RenderedScene, frames: MemorySink) -> None:
    """A projector whose black glows, by what its calibration says."""
    glowing = MemorySink(frames.plan)
    ends = {
        (shot.role, shot.setting): frames.read(shot).astype(float)
        for shot in scene.plan.shots()
        if shot.role in ("white", "black")
    }
    for shot in scene.plan.shots():
        glow = 0.1 * (ends["white", shot.setting] - ends["black", shot.setting])
        seen_dn = np.rint(frames.read(shot) + glow).clip(0, 4095).astype(np.uint16)
        glowing.write(shot, replace(frames.frames[shot.index], pixels=seen_dn))
    seen = SeenFrames(glowing.plan)
    seen.read_missing(glowing)
    assert "In black pictures" in " ".join(seen.report(scene.calibration).sentences)
    assert not seen.report(scene.calibration, knows_light=False).sentences


def test_pictures_in_the_places_of_others_are_named(scene: RenderedScene, frames: MemorySink) -> None:
    shots = list(scene.plan.shots())
    report = _judged(scene, _with(frames, {7: 6, 26: 27, 27: 26}))
    named = [shot.index for finding in report.wrong for shot in finding.again]
    assert named == [6, 7, 26, 27]
    assert report.sentences[0].startswith(
        f"{describe_shot(shots[6]).capitalize()} or {describe_shot(shots[7])}"
    )


def test_lines_that_do_not_add_up_to_white_are_told(
    scene: RenderedScene, frames: MemorySink, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(WholeScan, "line_sum", lambda scan: LineSum(0.8, 0.01, 0.1))
    (sentence,) = _judged(scene, frames).sentences
    assert sentence.startswith("All lines together have 0.80 ± 0.01 times the light of white")


def test_white_of_another_colour_is_told(
    scene: RenderedScene, frames: MemorySink, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = ColourAgain(next(iter(scene.plan.shots())), (1.1, 1.0, 0.9), 0.1)
    monkeypatch.setattr(WholeScan, "colour_again", lambda scan: seen)
    assert _judged(scene, frames).sentences == (seen.sentence,)


def test_a_window_that_came_in_is_told_instead_of_what_it_does_to_white(
    scene: RenderedScene, frames: MemorySink, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = next(iter(scene.plan.shots()))
    seen = LitAgain(first, LitBlack(9, (3, 7), (2, 5), False))
    monkeypatch.setattr(WholeScan, "lit_again", lambda scan: seen)
    monkeypatch.setattr(WholeScan, "colour_again", lambda scan: ColourAgain(first, (1.1, 1.0, 0.9), 0.1))
    assert _judged(scene, frames).sentences == (seen.sentence,)


def test_single_pixels_of_black_are_told(
    scene: RenderedScene, frames: MemorySink, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = SinglePixels(next(iter(scene.plan.shots())), 0.003, 256.0)
    monkeypatch.setattr(WholeScan, "single_pixels", lambda scan: seen)
    assert _judged(scene, frames).sentences == (seen.sentence,)


def test_one_wrong_pair_leaves_the_lines_to_be_judged(scene: RenderedScene, frames: MemorySink) -> None:
    sound, spoiled = _judged(scene, frames), _judged(scene, _with(frames, {0: 5}))
    assert [shot.index for finding in spoiled.wrong for shot in finding.again] == [0, 1]
    assert spoiled.untold <= sound.untold + 3
    assert spoiled.wrong[0].verdict is not Verdict.RIGHT


def test_a_proof_says_what_frames_show_that_were_kept_while_they_were_taken(
    scene: RenderedScene, frames: MemorySink
) -> None:
    spoiled = _with(frames, {7: 6})
    seen = SeenFrames(frames.plan)
    for shot in islice(scene.plan.shots(), 20):
        seen.keep(shot, spoiled.read(shot))
    seen.read_missing(frames)
    found = prove(frames, seen, scene.calibration)
    assert found.wrong == found.doubts == _judged(scene, spoiled).sentences
    assert (found.judged, found.moved) == (scene.plan.shot_count, ())


def test_what_was_wrong_from_the_first_picture_on_is_told_of_the_darkest_setting(
    scene: RenderedScene, frames: MemorySink
) -> None:
    dead = MemorySink(frames.plan)
    levels = [setting.level for setting in scene.plan.settings]
    for shot in scene.plan.shots():
        frame = frames.frames[shot.index]
        if shot.setting == levels.index(min(levels)):
            pixels = frame.pixels.copy()
            pixels[1::2, 1::2] = int(scene.calibration.sensor.black_level_dn)
            frame = replace(frame, pixels=pixels)
        dead.frames[shot.index] = frame
    told = [sentence for sentence in _judged(scene, dead).sentences if "no blue light" in sentence]
    assert len(told) == 1


def test_sentinels_whose_pictures_were_altered_say_so_rather_than_that_something_moved() -> None:
    plan = CapturePlan(
        camera_size_px=(64, 48), projector_size_px=(64, 48), code=GrayCode(rows=False), sentinels=Sentinels()
    )
    rng, frames = np.random.default_rng(1), MemorySink(plan)
    light = {"white": 900 * rng.uniform(0.3, 1, (48, 64)), "black": np.zeros((48, 64))}
    again = {shot.index: plan.original(shot) for shot in plan.shots() if shot.role == "sentinel"}
    for shot in plan.shots():
        old = again.get(shot.index, shot)
        seen = light.get(old.role, light["white"] * (np.arange(64) // 4 % 2))
        # The camera of the sentinels blends a picture with that before it, which is a white one.
        seen = 0.8 * seen + (0.2 * light["white"] if old.role == "black" else 0) if shot is not old else seen
        pixels = np.rint(260 + seen + rng.normal(0, 2, seen.shape)).astype(np.uint16)
        frames.write(shot, Frame(pixels, shot.exposure_ms))
    said = prove(frames, SeenFrames(plan), missing=())
    last = max(index for index, old in again.items() if old.role == "white")
    assert [
        each for each in said.wrong if f"By frame {last + 1}: Black, captured after white, holds 0." in each
    ]
    assert said.wrong[-1].endswith("in camera, projector and computer. Then scan again.")
    assert not said.moved
    assert not prove(frames, SeenFrames(plan), missing=[last]).wrong
