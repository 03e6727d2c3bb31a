from __future__ import annotations

import shutil
import threading
from collections import namedtuple
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest
from dsl_app.connection.state import Link, RigChoice
from dsl_app.scan import reconstruction_time
from dsl_app.scan.job import ScanJob
from dsl_app.scan.plan import connect_first, was_taken_with
from dsl_app.scan.reconnect import ATTEMPTS, RETRY_S
from dsl_app.scan.state import CalibrationChoice, InterruptedScan, Phase, Reconnection
from dsl_app.shared.notify import NO_RIG

from dsl_core import pipeline
from dsl_core.capture.metering import Metered
from dsl_core.capture.proven.wrong_pictures import PictureError
from dsl_core.capture.runner import State, Status
from dsl_core.cli.options import PlanChoice
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import Cancelled, DecodeError, DeviceError, DslError, StoreError
from dsl_core.io.calibration_library import LibraryEntry
from dsl_core.io.scan.folder import ScanReader, ScanWriter
from dsl_core.model.frames import Frame
from dsl_core.model.plan import LineComb, Shot
from dsl_core.model.presets import PRESETS
from dsl_core.model.result_sink import Maps, SeenGeometry
from dsl_core.progress import Progress
from dsl_core.simulation.sim_devices import SimCamera
from dsl_core.workflows import scans
from tests.app.support.scan_bench import (
    BRIEF,
    FRAMES,
    PATTERNS,
    SHORT,
    SMALL,
    TWIN,
    ScanBench,
    make_bench,
    planned_bench,
)


@pytest.fixture
def bench(tmp_path: Path) -> ScanBench:
    return planned_bench(tmp_path)


def phase(bench: ScanBench) -> Phase:
    return bench.state.phase.value


def is_metered(bench: ScanBench) -> bool:
    return bench.state.is_metered


def fail_from(monkeypatch: pytest.MonkeyPatch, shot: int) -> None:
    snap = SimCamera.snap

    def failing(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        if self._shot >= shot:
            raise DeviceError("The camera sent no frame. Check its cable.")
        return snap(self, timeout_ms)

    monkeypatch.setattr(SimCamera, "snap", failing)


def test_without_a_rig_nothing_starts_and_the_reason_is_told(tmp_path: Path) -> None:
    bench = make_bench(tmp_path)
    bench.scans.start()
    assert phase(bench) is Phase.PLANNING
    assert "Connect one on the Rig page" in bench.notifier.told[-1][1]


def test_on_a_lost_rig_nothing_starts_until_it_is_connected_again(bench: ScanBench) -> None:
    bench.rig.lose("The camera no longer answers.")
    facts = bench.state.facts.value
    assert facts is not None
    assert facts.obstacles == (NO_RIG,)
    bench.scans.start()
    assert (phase(bench), bench.notifier.told[-1]) == (Phase.PLANNING, ("warning", NO_RIG))
    bench.scans.connect_rig()
    facts = bench.state.facts.value
    assert facts is not None
    assert facts.obstacles == ()


def test_a_plan_is_fitted_to_the_rig_and_its_cost_is_known(bench: ScanBench) -> None:
    facts = bench.state.facts.value
    assert facts is not None
    assert bench.state.plan.value.camera_size_px == (64, 48)
    assert (facts.frames, facts.obstacles, facts.remarks) == (FRAMES, (), ())
    assert facts.seconds == pytest.approx(BRIEF.duration_s(50.0))
    assert 0 < facts.needed_bytes < facts.free_bytes


def test_presets_can_be_chosen_and_taken_back(bench: ScanBench) -> None:
    bench.plan(SHORT)
    bench.scans.plans.choose_preset("reference")
    assert bench.state.preset is PRESETS[-1]
    bench.undo.undo()
    assert bench.state.preset is PRESETS[0]


def test_the_plan_of_a_scan_at_hand_is_not_taken_back(bench: ScanBench) -> None:
    bench.plan(SHORT)
    bench.scans.plans.choose_preset("reference")
    bench.state.phase.set(Phase.RUNNING)
    assert "keeps its plan" in bench.undo.undo()
    assert bench.state.preset is PRESETS[-1]
    bench.state.phase.set(Phase.DONE)
    assert bench.undo.undo() == ""
    assert bench.state.preset is PRESETS[0]


def test_a_plan_that_comes_back_suits_the_rig_that_is_connected_now(bench: ScanBench) -> None:
    bench.plan(SHORT)
    bench.scans.plans.choose_preset("reference")
    bench.rig.connect(SMALL)
    bench.undo.undo()
    facts = bench.state.facts.value
    assert bench.state.preset is PRESETS[0]
    assert bench.state.plan.value.camera_size_px == (32, 24)
    assert facts is not None
    assert facts.obstacles == ()


def test_a_plan_that_comes_back_has_whole_cycles_of_the_projector_of_now(bench: ScanBench) -> None:
    bench.plan(SHORT)
    bench.scans.plans.choose_preset("reference")
    bench.state.period_ms.set(20.0)
    bench.undo.undo()
    assert bench.state.preset is PRESETS[0]
    assert all(setting.exposure_ms % 20 == 0 for setting in bench.state.plan.value.settings)


def test_an_impossible_plan_says_why(bench: ScanBench) -> None:
    plan = SHORT.model_copy(update={"spectral": LineComb(period_px=700)})
    bench.scans.plans.change_plan(plan)
    bench.scans.start()
    assert phase(bench) is Phase.PLANNING
    assert "at most one line" in bench.notifier.told[-1][1]


def test_a_scan_is_stored_and_the_next_has_another_name(bench: ScanBench, tmp_path: Path) -> None:
    bench.scans.start()
    assert phase(bench) is Phase.DONE
    assert bench.state.status.value.done == FRAMES
    assert ScanReader(tmp_path / "first.dsl").missing() == []
    assert bench.state.target.value == tmp_path / "scan-20260301-1020.dsl"
    assert bench.state.picture.value is not None


def test_the_graph_of_a_pixel_shows_the_lines_that_are_there(bench: ScanBench) -> None:
    bench.scans.point_at((30, 20))
    bench.scans.start()
    graph = bench.state.graph.value
    assert graph is not None
    assert graph.mean_dn.shape == (len(BRIEF.settings), PATTERNS, 3)
    brightest = graph.mean_dn[-1]
    assert (brightest.max(0) > brightest.min(0) + 20).all()


@pytest.mark.slow
def test_a_result_follows_and_is_told(
    bench: ScanBench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    depths: list[tuple[str, int, float]] = []
    real = scans.reconstruct_to

    def watched(target: Path, session: Path, *, seen_geometry: SeenGeometry, progress: Progress) -> Path:
        def see(maps: Maps) -> None:
            seen_geometry(maps)
            bench.scans.take_news()
            shown = bench.state.depth.value
            assert shown is not None
            depths.append((bench.state.note.value, shown.size, float(np.nanmedian(shown))))

        return real(target, session, progress=progress, seen_geometry=see)

    monkeypatch.setattr(scans, "reconstruct_to", watched)
    # The first reconstruction of a busy computer compiles for a minute.
    monkeypatch.setattr(reconstruction_time, "MOST", np.inf)
    expected_s = bench.state.reconstruction_s.value
    results: list[Path] = []
    bench.state.result.connect(results.append)
    working: list[bool] = []
    bench.state.is_reconstructing.changed.connect(working.append)
    bench.scans.plans.choose_preset("quick")
    bench.state.then_reconstruct.set(True)
    bench.scans.start()
    assert results == [tmp_path / "first.zarr"]
    assert results[0].is_dir()
    assert working == [True, False]
    ((note, pixels, middle_mm),) = depths
    assert note.endswith("Reconstructing; the depth is shown first.")
    assert pixels == 64 * 48
    assert 600 < middle_mm < 800
    assert bench.state.depth.value is None
    assert bench.state.reconstruction_s.value != expected_s


@pytest.mark.slow
def test_a_scan_without_calibration_is_not_reconstructed_but_says_what_to_do(bench: ScanBench) -> None:
    own, devices = bench.calibration, bench.rig.state.devices.value
    assert devices is not None
    bench.rig.state.devices.set(replace(devices, calibration=None))
    facts = bench.state.facts.value
    assert facts is not None
    assert not facts.is_calibrated
    bench.state.then_reconstruct.set(True)
    results: list[Path] = []
    bench.state.result.connect(results.append)
    bench.scans.start()
    assert phase(bench) is Phase.DONE
    assert "first calibrate the rig on the Calibrate page, then press Reconstruct…" in bench.state.note.value
    assert bench.state.lacks_calibration.value
    bench.library.store("lab", own)
    bench.scans.plans.load_library()
    bench.scans.start()
    assert "no calibration: press Reconstruct… and choose" in bench.state.note.value
    assert results == []
    assert "The reconstruction" not in bench.state.note.value
    assert bench.notifier.told == []


@pytest.mark.parametrize(
    ("error", "how"), [(Cancelled("Stopped."), "was cancelled"), (DecodeError("No light."), "failed")]
)
def test_a_reconstruction_that_does_not_end_well_is_not_announced_for_ever(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, error: DslError, how: str
) -> None:
    def ending(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr(scans, "reconstruct_scan", ending)
    bench.state.then_reconstruct.set(True)
    bench.scans.start()
    note = bench.state.note.value
    assert note.startswith(f"All {FRAMES} frames are saved in ")
    assert "Reconstructing" not in note
    assert f"The reconstruction {how}. Press Reconstruct… to begin again" in note


@pytest.mark.slow
def test_a_lost_camera_keeps_all_frames_and_the_scan_goes_on_later(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, 30)
        bench.scans.start()
    session = bench.state.interrupted.value
    assert phase(bench) is Phase.LOST
    assert session is not None
    assert (session.done, session.total) == (30, FRAMES)
    assert "Check its cable" in bench.state.trouble.value
    assert f"30 of {FRAMES} frames are saved" in bench.state.trouble.value
    assert bench.state.trouble.value.count(" saved") == 1, "nobody is told twice"
    assert bench.scans.command_line() == f"dsl-scan resume {tmp_path / 'first.dsl'}"
    bench.scans.start()
    assert phase(bench) is Phase.DONE
    assert bench.state.status.value.earlier == 30
    assert bench.state.trouble.value == ""
    assert ScanReader(tmp_path / "first.dsl").missing() == []


def test_a_folder_that_is_gone_with_a_resumed_scan_is_not_said_to_hold_its_frames(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, 5)
        bench.scans.start()
    write = ScanWriter.write

    def away(self: ScanWriter, shot: Shot, frame: Frame) -> None:
        if shot.index >= 9:
            (tmp_path / "first.dsl").rename(tmp_path / "moved.dsl")
            raise StoreError("The drive is gone.")
        write(self, shot, frame)

    with monkeypatch.context() as going:
        going.setattr(ScanWriter, "write", away)
        bench.rig.connect(TWIN)
        bench.scans.start()
    assert phase(bench) is Phase.LOST
    assert "The drive is gone" in bench.state.trouble.value
    assert "can no longer be read" in bench.state.trouble.value
    assert "frames are saved" not in bench.state.trouble.value
    session = bench.state.interrupted.value
    assert session is not None
    assert session.done == 9


def test_frames_of_the_scan_before_are_not_shown_as_those_of_one_that_saved_none(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.scans.start()
    bench.scans.take_news()
    assert (bench.state.status.value.done, bench.state.picture.value is None) == (FRAMES, False)
    fail_from(monkeypatch, 0)
    bench.scans.start()
    assert phase(bench) is Phase.LOST
    assert (bench.state.status.value.done, bench.state.picture.value) == (0, None)


@pytest.mark.slow
def test_a_scan_goes_on_over_a_damaged_frame(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, FRAMES - 3)
        bench.scans.start()
    reader = ScanReader(tmp_path / "first.dsl")
    damaged = next(shot for shot in reader.plan.shots() if shot.role == "spectral")
    path = reader.store.path(damaged.index)
    path.write_bytes(path.read_bytes()[:-5])
    bench.scans.start()
    assert phase(bench) is Phase.DONE
    assert len(ScanReader(tmp_path / "first.dsl").sound()) == FRAMES


def test_a_scene_that_moved_meanwhile_is_refused(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, 30)
        bench.scans.start()
    told = len(bench.notifier.told)
    bench.rig.connect(TWIN.__class__("twin", (("scene", "box"), ("size", "64x48"))))
    # It is the same rig, with another thing before it.
    bench.rig.state.choice.set(TWIN)
    bench.scans.start()
    assert phase(bench) is Phase.LOST
    assert "changed since the scan stopped" in bench.state.trouble.value
    # Its devices answer, and connecting them again would move nothing back.
    assert (bench.rig.state.link.value, bench.state.reconnection.value) == (Link.OPEN, Reconnection.NONE)
    assert len(bench.notifier.told) == told + 1
    assert "--no-drift-check" not in bench.scans.command_line()
    # Who knows better goes on all the same.
    bench.state.check_drift.set(False)
    assert bench.scans.command_line().endswith("first.dsl --no-drift-check")
    bench.scans.start()
    assert [phase(bench)] == [Phase.DONE]
    assert bench.state.check_drift.value


@pytest.mark.slow
def test_an_interrupted_session_is_offered_and_a_complete_one_is_not(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, 10)
        bench.scans.start()
    other = make_bench(tmp_path)
    assert other.scans.open(tmp_path / "first.dsl")
    facts, session = other.state.facts.value, other.state.interrupted.value
    assert session is not None
    assert facts is not None
    # The twin may be opened because a file names it, so that nobody has to connect it first.
    assert facts.obstacles == ()
    assert facts.connects
    assert session.rig == TWIN
    assert session.calibration == bench.calibration.name
    other.rig.state.choice.set(SMALL)
    other.state.then_reconstruct.set(False)
    other.scans.start()
    assert phase(other) is Phase.DONE
    assert other.rig.state.choice.value == TWIN
    assert not other.scans.open(tmp_path / "first.dsl")
    assert not other.scans.open(tmp_path)


def test_another_rig_that_is_connected_makes_way_for_that_of_the_scan(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, 10)
        bench.scans.start()
    other = make_bench(tmp_path)
    other.rig.connect(SMALL)
    other.state.then_reconstruct.set(False)
    assert other.scans.open(tmp_path / "first.dsl")
    facts = other.state.facts.value
    assert facts is not None
    assert facts.connects, "frames of another size would be asked for again and again"
    other.scans.start()
    assert phase(other) is Phase.DONE
    assert other.rig.state.choice.value == TWIN


@pytest.mark.slow
def test_a_click_while_another_rig_is_connected_is_not_forgotten(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, 10)
        bench.scans.start()
    other = make_bench(tmp_path)
    other.state.then_reconstruct.set(False)
    assert other.scans.open(tmp_path / "first.dsl")
    other.rig.state.link.set(Link.OPENING)
    other.scans.start()
    other.scans.start()
    assert phase(other) is Phase.PLANNING
    other.rig.state.link.set(Link.CLOSED)
    assert phase(other) is Phase.DONE
    assert other.rig.state.choice.value == TWIN


def test_a_rig_is_the_same_whatever_the_order_of_its_options(tmp_path: Path) -> None:
    rig = RigChoice("twin", (("scene", "plane"), ("size", "32x24")))
    session = InterruptedScan(tmp_path / "first.dsl", 3, 76, rig, may_open=True)
    assert was_taken_with(session, RigChoice("twin", rig.options[::-1]))
    assert not was_taken_with(session, RigChoice("twin", rig.options[:1]))
    assert not was_taken_with(session, RigChoice("lab", rig.options))
    assert was_taken_with(InterruptedScan(tmp_path / "first.dsl", 3, 76), rig)


@pytest.mark.parametrize("named", [True, False])
def test_a_rig_of_another_computer_is_not_opened_unasked(tmp_path: Path, named: bool) -> None:
    bench = make_bench(tmp_path)
    rig = RigChoice("lab", (("port", "3"),)) if named else None
    session = InterruptedScan(tmp_path / "first.dsl", 3, 76, rig)
    bench.state.interrupted.set(session)
    bench.scans.plans.refresh()
    facts = bench.state.facts.value
    assert facts is not None
    assert facts.obstacles == (connect_first(session),)
    assert ("lab, port 3" in facts.obstacles[0]) == named
    bench.scans.start()
    assert bench.rig.state.link.value is Link.CLOSED


def test_a_rig_that_cannot_be_connected_is_told_and_not_tried_again(tmp_path: Path) -> None:
    bench = make_bench(tmp_path)
    gone = RigChoice("twin", (("scene", "moon"),))
    bench.state.interrupted.set(InterruptedScan(tmp_path / "first.dsl", 3, 76, gone, may_open=True))
    bench.scans.start()
    assert phase(bench) is Phase.PLANNING
    assert "The rig of first.dsl could not be connected" in bench.notifier.told[-1][1]
    told = len(bench.notifier.told)
    bench.scans.take_news()
    assert len(bench.notifier.told) == told


def test_a_damaged_session_is_told(bench: ScanBench, tmp_path: Path) -> None:
    (tmp_path / "odd.dsl").mkdir()
    (tmp_path / "odd.dsl" / "manifest.json").write_text("{")
    assert bench.scans.open(tmp_path / "odd.dsl")
    assert "damaged" in bench.notifier.told[-1][1]


@pytest.mark.slow
def test_a_typed_name_stays_until_a_scan_has_it(bench: ScanBench, tmp_path: Path) -> None:
    target = bench.state.target
    bench.scans.name_scan("leaf 1/2.dsl ")
    assert target.value == tmp_path / "leaf 1-2.dsl"
    # As for the scan of the demo, which has its own name.
    bench.scans.plan_new_scan()
    assert target.value == tmp_path / "leaf 1-2.dsl"
    bench.scans.plans.set_target(tmp_path / "demo" / "own.dsl")
    bench.scans.start()
    assert target.value == tmp_path / "leaf 1-2.dsl"
    bench.scans.name_scan(" ")
    assert target.value == tmp_path / "leaf 1-2.dsl"
    bench.scans.start()
    assert ScanReader(tmp_path / "leaf 1-2.dsl").missing() == []
    assert target.value == tmp_path / "scan-20260301-1020.dsl"


def test_leaving_a_session_plans_a_new_one(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, 10)
        bench.scans.start()
    bench.scans.plan_new_scan()
    assert bench.state.interrupted.value is None
    assert phase(bench) is Phase.PLANNING
    assert bench.state.target.value != tmp_path / "first.dsl"
    assert (tmp_path / "first.dsl").is_dir()


@pytest.mark.parametrize("completes", [False, True])
def test_exposures_measured_for_a_scan_that_stopped_are_not_those_of_the_next(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, completes: bool
) -> None:
    exposed = bench.state.plan.value
    monkeypatch.setattr(pipeline, "meter", lambda *asked: Metered(exposed, "Exposures are shortened.", True))
    bench.plan(SHORT)
    preset = bench.state.plan.value
    with monkeypatch.context() as lost:
        fail_from(lost, 10)
        bench.scans.start()
    assert bench.state.plan.value == exposed
    if completes:
        bench.scans.start()
        assert phase(bench) is Phase.DONE
    else:
        bench.scans.plan_new_scan()
    assert bench.state.plan.value == preset
    assert is_metered(bench)


def test_scans_that_are_opened_leave_the_plan_of_a_person_for_the_next(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    with monkeypatch.context() as lost:
        fail_from(lost, 10)
        bench.scans.start()
    shutil.copytree(tmp_path / "first.dsl", tmp_path / "second.dsl")
    bench.scans.plan_new_scan()
    own = SHORT.model_copy(update={"spectral": LineComb(period_px=32)})
    bench.scans.plans.change_plan(own)
    bench.state.plan_file.set(tmp_path / "own.json")
    for name in ("first", "second"):
        assert bench.scans.open(tmp_path / f"{name}.dsl")
        assert len(bench.state.plan.value.settings) == 1
    bench.rig.connect(SMALL)
    bench.scans.plan_new_scan()
    assert bench.state.plan.value.spectral == own.spectral
    assert bench.state.plan.value.camera_size_px == (32, 24)
    bench.undo.undo()
    assert len(bench.state.plan.value.settings) == 1


def test_a_full_disk_is_said_before_the_start(bench: ScanBench, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(10, 9, 1))
    bench.scans.start()
    assert phase(bench) is Phase.PLANNING
    assert "not enough disk space" in bench.notifier.told[-1][1]


def test_a_place_that_is_taken_is_refused(bench: ScanBench, tmp_path: Path) -> None:
    (tmp_path / "taken.dsl").mkdir()
    bench.scans.plans.set_target(tmp_path / "taken")
    facts = bench.state.facts.value
    assert facts is not None
    assert "exists and is not a scan" in facts.obstacles[0]


@pytest.mark.parametrize("folder", ["", "not there yet"])
def test_a_name_that_is_too_long_is_said_before_the_start(
    bench: ScanBench, tmp_path: Path, folder: str
) -> None:
    bench.scans.plans.set_target(tmp_path / folder / "scan")
    bench.scans.name_scan("ä" * 130)
    facts = bench.state.facts.value
    assert facts is not None
    assert "The name is too long" in facts.obstacles[0]
    bench.scans.start()
    assert phase(bench) is Phase.PLANNING
    assert bench.notifier.told[-1] == ("warning", facts.obstacles[0])
    bench.scans.plan_new_scan()
    bench.scans.name_scan("short")
    assert bench.state.facts.value is not None
    assert bench.state.facts.value.obstacles == ()


def test_a_scan_is_not_begun_whose_result_could_not_be_saved(bench: ScanBench, tmp_path: Path) -> None:
    (tmp_path / "cup.zarr").mkdir()
    bench.state.then_reconstruct.set(True)
    bench.scans.plans.set_target(tmp_path / "cup")
    bench.scans.start()
    assert phase(bench) is Phase.PLANNING
    assert "cup.zarr, the result of this scan, already exists" in bench.notifier.told[-1][1]
    bench.state.then_reconstruct.set(False)
    facts = bench.state.facts.value
    assert facts is not None
    assert not facts.obstacles
    bench.state.then_reconstruct.set(True)
    bench.scans.plans.set_target(tmp_path / "bowl")
    facts = bench.state.facts.value
    assert facts is not None
    assert not facts.obstacles


def test_a_calibration_of_other_settings_needs_an_override(bench: ScanBench, tmp_path: Path) -> None:
    devices = bench.rig.state.devices.value
    assert devices is not None
    assert devices.calibration is not None
    from dsl_core.devices.conditions import current_conditions

    now = current_conditions(devices)
    other = now.model_copy(update={"camera": now.camera.model_copy(update={"gain_db": 6.0})})
    bench.library.store("bench", devices.calibration.model_copy(update={"conditions": other}))
    bench.scans.plans.load_library()
    choice = bench.state.calibrations.value[1]
    assert choice.name == "bench"
    bench.scans.plans.choose_calibration(choice)
    facts = bench.state.facts.value
    assert facts is not None
    assert facts.settings_differ
    assert "gain" in facts.obstacles[0]
    bench.scans.plans.set_override(True)
    assert "--calibration bench --override-calibration" in bench.scans.command_line()
    bench.scans.start()
    assert phase(bench) is Phase.DONE
    assert "gain" in ScanReader(tmp_path / "first.dsl").manifest.notes["calibration_overridden"]
    assert devices.calibration.conditions is None


def test_a_calibration_chosen_during_a_scan_is_for_the_next(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    own, snap = bench.calibration, SimCamera.snap
    bench.library.store("bench", own.model_copy(update={"name": "bench"}))

    def choosing(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        bench.scans.plans.choose_calibration(CalibrationChoice("bench", "bench"))
        return snap(self, timeout_ms)

    with monkeypatch.context() as meanwhile:
        meanwhile.setattr(SimCamera, "snap", choosing)
        bench.scans.start()
    assert [text for _, text in bench.notifier.told] == [
        "The running scan keeps its calibration. Later scans use bench."
    ]
    taken = ScanReader(tmp_path / "first.dsl").calibration
    assert taken is not None
    assert taken.name == own.name
    assert bench.state.calibration.value.key == "bench"
    assert bench.scans.plans.calibration is not None
    assert bench.scans.plans.calibration.name == "bench"


def test_a_calibration_that_is_read_when_a_scan_starts_waits_for_its_end(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.library.store("bench", bench.calibration)
    find = bench.library.find

    def slow(key: str) -> LibraryEntry:
        bench.state.phase.set(Phase.STARTING)
        return find(key)

    with monkeypatch.context() as reading:
        reading.setattr(bench.library, "find", slow)
        bench.scans.plans.choose_calibration(CalibrationChoice("bench", "bench"))
    assert bench.state.calibration.value.key == ""
    bench.state.phase.set(Phase.DONE)
    assert bench.state.calibration.value.key == "bench"


def test_a_calibration_that_cannot_be_read_leaves_the_one_in_use(bench: ScanBench) -> None:
    before, refused = bench.state.calibration.value, list[CalibrationChoice]()
    bench.state.refused.connect(refused.append)
    bench.scans.plans.choose_calibration(CalibrationChoice("gone", "gone"))
    assert [choice.key for choice in refused] == ["gone"]
    assert bench.state.calibration.value is before
    level, text = bench.notifier.told[-1]
    assert level == "error"
    assert "no calibration 'gone'" in text
    assert text.endswith("Scans use the calibration of the rig itself, if it has one.")


def test_of_two_calibrations_that_are_read_at_once_the_one_chosen_last_counts(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench.library.store("slow", bench.calibration)
    bench.library.store("quick", bench.calibration)
    find, plans = bench.library.find, bench.scans.plans

    def overtaken(key: str) -> LibraryEntry:
        if key == "slow":
            plans.choose_calibration(CalibrationChoice("quick", "quick"))
        return find(key)

    with monkeypatch.context() as reading:
        reading.setattr(bench.library, "find", overtaken)
        plans.choose_calibration(CalibrationChoice("slow", "slow"))
    assert bench.state.calibration.value.key == "quick"


@pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.key)
def test_the_command_line_makes_the_same_plan(bench: ScanBench, preset: object, tmp_path: Path) -> None:
    bench.scans.plans.choose_preset(preset.key)  # type: ignore[attr-defined]
    words = bench.scans.command_line().split()
    assert words[:3] == ["dsl-scan", "scan", str(tmp_path / "first.dsl")]
    options = dict(zip(words[3::2], words[4::2], strict=False))
    settings = [words[i + 1] for i, word in enumerate(words) if word == "--setting"]
    made = PlanChoice(
        None, options.get("--code"), options.get("--lines"), options.get("--comb"), settings
    ).build()
    wanted = bench.state.plan.value
    assert (made.code, made.spectral, made.code_settings) == (
        wanted.code,
        wanted.spectral,
        wanted.code_settings,
    )
    assert [s.exposure_ms for s in made.settings] == pytest.approx(
        [s.exposure_ms for s in wanted.settings], rel=1e-11
    )


def test_a_preset_is_exposed_for_the_scene_and_the_next_scan_measures_anew(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    exposed = bench.state.plan.value
    monkeypatch.setattr(pipeline, "meter", lambda *asked: Metered(exposed, "Exposures are shortened.", True))
    bench.plan(SHORT)
    preset = bench.state.plan.value
    assert bench.scans.command_line().endswith(" --match-exposure")
    bench.scans.start()
    assert bench.state.finished.value is not None
    taken = ScanReader(bench.state.finished.value)
    assert taken.plan == exposed
    assert taken.manifest.notes["exposures"] == "Exposures are shortened."
    bench.scans.take_news()
    assert ("info", "Exposures are shortened.") in bench.notifier.told
    assert bench.state.plan.value == preset, "the next scan starts from the preset again"


def test_exposures_that_a_person_chose_are_kept(bench: ScanBench, tmp_path: Path) -> None:
    bench.plan(SHORT)
    assert is_metered(bench)
    bench.state.meters.set(False)
    assert not is_metered(bench)
    assert "--match-exposure" not in bench.scans.command_line()
    bench.state.meters.set(True)
    bench.state.plan_file.set(tmp_path / "plan.json")
    assert not is_metered(bench)
    bench.plan(BRIEF)
    assert not is_metered(bench)


def test_a_disk_that_fills_up_on_the_way_interrupts_and_loses_nothing(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    write = ScanWriter.write

    def full(self: ScanWriter, shot: Shot, frame: Frame) -> None:
        if shot.index >= 20:
            raise StoreError("The disk is full. Free some space.")
        write(self, shot, frame)

    with monkeypatch.context() as filling:
        filling.setattr(ScanWriter, "write", full)
        bench.scans.start()
    assert phase(bench) is Phase.LOST
    assert "The disk is full" in bench.state.trouble.value
    assert (bench.rig.state.link.value, bench.state.reconnection.value) == (Link.OPEN, Reconnection.NONE)
    assert f"20 of {FRAMES} frames are saved" in bench.state.trouble.value
    bench.scans.start()
    assert ScanReader(tmp_path / "first.dsl").missing() == []


def test_a_scan_whose_pictures_are_wrong_closes_no_device(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def covered(self: ScanWriter, shot: Shot, frame: Frame) -> None:
        raise PictureError("Frame 36 does not show its pattern. Check projector and camera.")

    monkeypatch.setattr(ScanWriter, "write", covered)
    bench.scans.start()
    assert phase(bench) is Phase.LOST
    assert "does not show its pattern" in bench.state.trouble.value
    assert (bench.rig.state.link.value, bench.state.reconnection.value) == (Link.OPEN, Reconnection.NONE)


@dataclass
class Outage:
    """A scan whose camera is gone after two frames, and stays so until it is plugged in."""

    bench: ScanBench
    now_s: float = 0.0
    is_gone: bool = True
    links: list[Link] = field(default_factory=list)

    @property
    def reconnection(self) -> Reconnection:
        return self.bench.state.reconnection.value

    @property
    def link(self) -> Link:
        return self.bench.rig.state.link.value

    @property
    def told(self) -> str:
        return self.bench.state.trouble.value

    def wait(self, seconds: float) -> None:
        self.now_s += seconds
        self.bench.scans.take_news()


@pytest.fixture
def outage(bench: ScanBench, monkeypatch: pytest.MonkeyPatch) -> Outage:
    made, snap = Outage(bench), SimCamera.snap

    def failing(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        if made.is_gone and not 0 <= self._shot < 2:
            raise DeviceError("The camera sent no frame. Check its cable.")
        return snap(self, timeout_ms)

    monkeypatch.setattr(SimCamera, "snap", failing)
    monkeypatch.setattr(bench.scans._reconnector, "_clock", lambda: made.now_s)
    bench.rig.state.link.changed.connect(made.links.append)
    bench.scans.start()
    return made


def test_a_lost_rig_is_connected_again_a_few_times_and_no_more(outage: Outage) -> None:
    bench = outage.bench
    devices = bench.rig.state.devices
    assert outage.links == [Link.LOST, Link.OPENING, Link.LOST]
    assert (outage.reconnection, devices.value) == (Reconnection.TRYING, None)
    assert "Check its cable" in bench.rig.state.trouble.value
    assert outage.told.endswith(f"Reconnecting the rig, attempt 1 of {ATTEMPTS}.")
    outage.wait(RETRY_S / 2)
    assert "attempt 1" in outage.told
    for attempt in range(2, ATTEMPTS + 1):
        outage.wait(RETRY_S)
        assert (outage.link, f"attempt {attempt} of" in outage.told) == (Link.LOST, attempt < ATTEMPTS)
    assert outage.reconnection is Reconnection.GIVEN_UP
    assert outage.told.endswith("could not be reconnected: The camera sent no frame. Check its cable.")
    # The page tells all of it; one message leads there who is on another page.
    assert [text for _, text in bench.notifier.told] == ["The scan first.dsl was interrupted."]
    wanted: list[None] = []
    bench.state.wanted.connect(wanted.append)
    bench.notifier.offers["Show the scan"]()
    assert wanted == [None]
    outage.is_gone = False
    outage.wait(10 * RETRY_S)
    assert outage.reconnection is Reconnection.GIVEN_UP
    bench.scans.resume()
    assert (phase(bench), outage.reconnection, outage.link) == (Phase.DONE, Reconnection.NONE, Link.OPEN)


def test_a_rig_that_comes_back_goes_on_only_when_asked(outage: Outage) -> None:
    bench = outage.bench
    outage.is_gone = False
    outage.wait(RETRY_S)
    assert (phase(bench), outage.reconnection, outage.link) == (Phase.LOST, Reconnection.BACK, Link.OPEN)
    assert f"2 of {FRAMES} frames are saved" in outage.told
    assert outage.told.endswith("The rig is reconnected.")
    bench.scans.resume()
    assert (phase(bench), outage.told) == (Phase.DONE, "")


def test_another_rig_does_not_pass_for_the_one_that_was_lost(outage: Outage) -> None:
    outage.is_gone = False
    outage.bench.rig.connect(RigChoice("twin", (("scene", "sphere"), ("size", "32x24"))))
    assert outage.reconnection is Reconnection.BACK
    assert outage.told.endswith("Another rig is connected instead: twin, scene sphere, size 32x24.")
    assert phase(outage.bench) is Phase.LOST
    outage.bench.scans.resume()
    assert phase(outage.bench) is Phase.DONE
    assert outage.bench.rig.state.choice.value.name == "twin"
    assert dict(outage.bench.rig.state.choice.value.options)["scene"] != "sphere"


def test_who_wishes_so_finds_the_scan_gone_on(outage: Outage) -> None:
    bench = outage.bench
    bench.scans.resume()
    assert outage.reconnection is Reconnection.RESUMING
    assert "attempt 2 of" in outage.told
    assert outage.told.endswith("The scan resumes automatically when it responds.")
    outage.is_gone = False
    outage.wait(RETRY_S)
    assert phase(bench) is Phase.DONE
    assert ("info", "The rig is reconnected. The scan resumes.") in bench.notifier.told


def test_no_attempt_follows_a_stop(outage: Outage) -> None:
    outage.bench.scans.stop_reconnecting()
    outage.is_gone = False
    outage.wait(RETRY_S)
    assert (outage.reconnection, outage.link) == (Reconnection.GIVEN_UP, Link.LOST)
    assert outage.told.endswith("Reconnecting was stopped.")


def test_a_rig_that_a_person_connects_is_back_too(outage: Outage) -> None:
    outage.bench.scans.resume()
    outage.is_gone = False
    outage.bench.rig.connect(TWIN)
    # It may be another rig than the one that was wished for.
    assert (phase(outage.bench), outage.reconnection) == (Phase.LOST, Reconnection.BACK)


def test_a_rig_is_not_connected_again_for_a_scan_that_was_left(outage: Outage) -> None:
    outage.bench.scans.plan_new_scan()
    outage.is_gone = False
    outage.wait(RETRY_S)
    assert (outage.reconnection, outage.link, outage.told) == (Reconnection.NONE, Link.LOST, "")


def test_who_stops_a_lost_scan_does_not_find_it_gone_on(outage: Outage) -> None:
    bench = outage.bench
    bench.scans.resume()
    assert outage.reconnection is Reconnection.RESUMING
    bench.scans.cancel()
    outage.is_gone = False
    outage.wait(10 * RETRY_S)
    assert (phase(bench), outage.link) == (Phase.LOST, Link.LOST)
    assert "No scan is running." not in [text for _, text in bench.notifier.told]


@pytest.mark.slow
def test_a_pause_while_a_scan_is_prepared_holds_its_first_frame(
    bench: ScanBench, monkeypatch: pytest.MonkeyPatch
) -> None:
    states: list[State] = []
    calibrated, listen = ScanJob._calibrated, ScanJob._listen

    def prepare(job: ScanJob) -> tuple[DeviceRig, dict[str, str]]:
        job.pause()
        threading.Timer(0.3, lambda: job.pause(False)).start()
        return calibrated(job)

    def hear(job: ScanJob, status: Status) -> None:
        states.append(status.state)
        listen(job, status)

    monkeypatch.setattr(ScanJob, "_calibrated", prepare)
    monkeypatch.setattr(ScanJob, "_listen", hear)
    bench.scans.start()
    assert states.index(State.PAUSED) < states.index(State.RUNNING)
    assert phase(bench) is Phase.DONE


def test_another_scan_that_is_opened_does_not_go_on_by_itself(outage: Outage, tmp_path: Path) -> None:
    bench = outage.bench
    shutil.copytree(tmp_path / "first.dsl", tmp_path / "other.dsl")
    bench.scans.resume()
    assert not bench.scans.open(tmp_path)
    assert outage.reconnection is Reconnection.RESUMING
    assert bench.scans.open(tmp_path / "other.dsl")
    outage.is_gone = False
    outage.wait(RETRY_S)
    assert (phase(bench), outage.reconnection, outage.told) == (Phase.LOST, Reconnection.NONE, "")
