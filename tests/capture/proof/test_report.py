"""A finished scan is judged as a whole: wrong pictures are named, one by one, and nothing else."""

from __future__ import annotations

import pytest

from dsl_core.capture.proof.finding import Verdict
from dsl_core.capture.proof.report import prove
from dsl_core.model.plan import describe_shot
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


def test_a_sound_scan_has_no_wrong_pictures(scene: RenderedScene, frames: MemorySink) -> None:
    report = prove(frames, scene.calibration)
    assert (report.judged, report.wrong) == (scene.plan.shot_count, ())


def test_pictures_in_the_places_of_others_are_named(scene: RenderedScene, frames: MemorySink) -> None:
    shots = list(scene.plan.shots())
    report = prove(_with(frames, {7: 6, 26: 27, 27: 26}), scene.calibration)
    named = [shot.index for finding in report.wrong for shot in finding.again]
    assert named == [6, 7, 26, 27]
    assert report.sentences[0].startswith(
        f"{describe_shot(shots[6]).capitalize()} or {describe_shot(shots[7])}"
    )


def test_one_wrong_pair_leaves_the_lines_to_be_judged(scene: RenderedScene, frames: MemorySink) -> None:
    sound, spoiled = prove(frames, scene.calibration), prove(_with(frames, {0: 5}), scene.calibration)
    assert [shot.index for finding in spoiled.wrong for shot in finding.again] == [0, 1]
    assert spoiled.untold <= sound.untold + 3
    assert spoiled.wrong[0].verdict is not Verdict.RIGHT
