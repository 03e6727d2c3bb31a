"""A scan resumes over damaged frames: they are taken again, and the rest still tells what moved."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from dsl_core.capture.movement import pick_reference_shots
from dsl_core.devices.replay import replay_rig
from dsl_core.errors import DecodeError, DeviceError, StoreError
from dsl_core.io.export.common import provenance_of
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.io.scan.origin import rig_notes
from dsl_core.model.fit import Fit
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.model.rig import Provenance, Rig
from dsl_core.patterns.images import pattern_image
from dsl_core.workflows import scans
from dsl_core.workflows.scans import prepare_resume, reopen_rig, resume
from dsl_core.workflows.truths import truth_of
from tests.cases.memory_sink import MemorySink
from tests.cases.small_result import small_result
from tests.cases.small_rig import small_rig

PLAN = CapturePlan(
    camera_size_px=(24, 16),
    projector_size_px=(32, 18),
    code=GrayCode(rows=False),
    spectral=LineComb(width_px=2, step_px=2, period_px=8),
    settings=(Setting(exposure_ms=10.0, level=0.4),),
    code_settings=(0,),
)


def _taken(scene: int) -> MemorySink:
    """A scan of one of many scenes, the same each time."""
    sink = MemorySink(PLAN)
    light = np.random.default_rng(scene).integers(500, 3500, (16, 24))
    for shot in PLAN.shots():
        shown = pattern_image(PLAN, shot)[:16, :24, 1] > 0
        noise = np.random.default_rng((scene, shot.index)).integers(200, 230, (16, 24))
        pixels = (light * shown + noise).astype(np.uint16)
        # Frame numbers that no two shots share, as a camera counts them.
        sink.write(shot, Frame(pixels, shot.exposure_ms, 0.5 * shot.index, shot.index + 1))
    return sink


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A finished scan of scene 1."""
    taken = _taken(1)
    with ScanWriter.create(tmp_path / "scan.dsl", PLAN, replay_rig(taken)) as writer:
        for shot in PLAN.shots():
            writer.write(shot, taken.frames[shot.index])
    return tmp_path / "scan.dsl"


def _damage(folder: Path, index: int) -> None:
    path = ScanReader(folder).store.path(index)
    path.write_bytes(path.read_bytes()[:-5])


def test_a_damaged_frame_that_would_show_drift_is_taken_again(folder: Path) -> None:
    for shot in pick_reference_shots(PLAN.shots()):
        _damage(folder, shot.index)
    ScanReader(folder).store.path(PLAN.shot_count - 1).unlink()
    resume(replay_rig(_taken(1)), folder)
    assert ScanReader(folder).sound() == set(range(PLAN.shot_count))


def test_damage_alone_calls_for_a_look_at_the_scene(folder: Path) -> None:
    _damage(folder, PLAN.shot_count - 1)
    with pytest.raises(DeviceError, match="changed since the scan stopped"):
        resume(replay_rig(_taken(2)), folder)
    assert ScanReader(folder).sound() == set(range(PLAN.shot_count - 1))


def test_a_resumed_scan_has_its_own_calibration_and_the_rig_of_the_caller_stays(tmp_path: Path) -> None:
    own, other = (small_rig().model_copy(update={"name": name}) for name in ("own", "other"))
    taken = _taken(1)
    with ScanWriter.create(tmp_path / "scan.dsl", PLAN, replay_rig(taken, own)):
        pass
    mine = replay_rig(taken, other)
    resumed, plan = prepare_resume(mine, tmp_path / "scan.dsl")
    assert resumed.calibration == own
    assert resumed.camera is mine.camera
    assert plan == PLAN
    assert mine.calibration is other


def test_another_camera_is_told_before_its_picture_is_taken_for_another_scene(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ScanReader(folder).store.path(PLAN.shot_count - 1).unlink()
    rig = replay_rig(_taken(2))
    other = dataclasses.replace(rig.camera.info, bit_depth=16)
    monkeypatch.setattr(type(rig.camera), "info", property(lambda self: other))
    with pytest.raises(StoreError, match="bit depth"):
        prepare_resume(rig, folder)


def test_a_whole_scan_is_left_as_it_is(folder: Path) -> None:
    resume(replay_rig(_taken(2)), folder)
    assert ScanReader(folder).sound() == set(range(PLAN.shot_count))


@pytest.mark.parametrize("on", ["", "another computer"])
def test_a_scan_from_elsewhere_does_not_open_devices(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, on: str
) -> None:
    opened: list[str] = []
    monkeypatch.setattr(scans, "open_rig", lambda name, options: opened.append(name))
    own = rig_notes("laboratory", {"port": "/dev/ttyS0"})
    received = {key: value for key, value in own.items() if value != own["scanned_on"]}
    ScanWriter.create(tmp_path / "a.dsl", PLAN, None, received | ({"scanned_on": on} if on else {})).close()
    with pytest.raises(StoreError, match=r"captured on another computer with the rig 'laboratory'.*--rig"):
        reopen_rig(tmp_path / "a.dsl")
    with pytest.raises(DecodeError, match="'laboratory' has no ground truth"):
        truth_of(small_result().assign_attrs(received))
    assert opened == []
    ScanWriter.create(tmp_path / "b.dsl", PLAN, None, own).close()
    reopen_rig(tmp_path / "b.dsl")
    assert opened == ["laboratory"]


@pytest.mark.parametrize(("notes", "told"), [({}, True), ({"imported_sensor": "{}"}, False)])
def test_a_result_says_that_its_calibration_is_old_unless_its_pictures_have_no_date(
    folder: Path, notes: dict[str, str], told: bool
) -> None:
    reader = ScanReader(folder)
    reader.manifest.notes.update(notes)
    rig = small_rig().model_copy(update={"provenance": Provenance(created="2020-01-01")})
    found = Fit.read({**scans._dated(small_result().assign_attrs(fit=Fit().model_dump_json()), rig, reader)})
    assert found is not None
    assert ("days older than this scan" in found.words) == (found.level_rel_std > 0.1) == told


def test_dates_do_not_hide_what_a_scan_itself_leaves_open(folder: Path) -> None:
    reader = ScanReader(folder)
    rig = small_rig().model_copy(update={"provenance": Provenance(created=reader.manifest.created)})
    made = Fit(level_rel_std=0.03, unseen="The film may have moved.")
    found = Fit.read({**scans._dated(small_result().assign_attrs(fit=made.model_dump_json()), rig, reader)})
    assert found is not None
    assert found.model_copy(update={"scale_rel_std": None, "scale": ""}) == made
    assert found.scale_rel_std == made.level_rel_std


@pytest.mark.parametrize("notes", [{}, {"imported_sensor": "{}"}])
def test_a_result_states_the_scale_of_its_reflectance_which_no_pixel_shows(
    folder: Path, notes: dict[str, str]
) -> None:
    """In its verdict, and as a figure that all exports carry; a result of depth alone has no such scale."""
    reader = ScanReader(folder)
    reader.manifest.notes.update(notes)
    rig = small_rig().model_copy(update={"provenance": Provenance(created=reader.manifest.created)})
    judged = small_result().assign_attrs(fit=Fit().model_dump_json())
    noted = scans._dated(judged, rig, reader)
    found = Fit.read(noted)
    assert found is not None
    assert found.scale_rel_std == noted["reflectance_scale_rel_std"] == 0.03
    assert "known to 5.9%" in found.words
    assert not found.significant
    origin = provenance_of(noted)
    assert origin["reflectance_scale_rel_std"] == "0.03"
    assert "Scale of reflectance: known to 5.9%" in origin["verdict"]
    assert "reflectance_scale_rel_std" not in scans._dated(judged, rig, reader, has_spectra=False)


@pytest.mark.parametrize(("notes", "told"), [({}, True), ({"imported_sensor": "{}"}, False)])
def test_a_scan_long_after_its_calibration_is_reconstructed_with_a_light_that_is_less_known(
    folder: Path, monkeypatch: pytest.MonkeyPatch, notes: dict[str, str], told: bool
) -> None:
    given: list[Rig] = []

    def reconstruct(source: object, rig: Rig, *rest: object) -> object:
        given.append(rig)
        return small_result()

    monkeypatch.setattr(scans, "reconstruct", reconstruct)
    monkeypatch.setattr(scans, "is_import", lambda reader: bool(notes))
    rig = small_rig().model_copy(update={"provenance": Provenance(created="2020-01-01")})
    scans.reconstruct_scan(folder, rig)
    assert (given[0].reference_rel_std > 0.1) == told
