from __future__ import annotations

import shutil
from collections import namedtuple
from datetime import datetime
from pathlib import Path

import pytest
from dsl_app.composition import demo
from dsl_app.composition.demo import DemoController
from dsl_app.connection.state import Link, RigChoice
from dsl_app.scan.state import Phase

from dsl_core import pipeline
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DeviceError
from dsl_core.io.result.result_file import load_result
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan
from dsl_core.simulation.sim_devices import SimCamera
from dsl_core.workflows import scans
from tests.app.support.doubles import InlineRunner
from tests.app.support.scan_bench import SHORT, ScanBench, make_bench

SMALL = {"scene": "color-checker", "size": "64x48"}


class Bench:
    def __init__(self, folder: Path) -> None:
        self.scans: ScanBench = make_bench(folder)
        self.runner = InlineRunner()
        self.opened: list[Path] = []
        self.demo = DemoController(
            folder / "demo",
            self.scans.rig,
            self.runner,
            self.scans.notifier,
            self.opened.append,
            lambda: self.scans.scans,
            lambda: datetime(2026, 3, 1, 10, 20),
        )


def patch_small(patch: pytest.MonkeyPatch) -> None:
    """Let the demo be a short scan of few pixels."""
    patch.setattr(demo, "SCENE", SMALL)
    patch.setattr(demo, "LIVE_RIG", RigChoice("twin", tuple(SMALL.items())))
    patch.setattr(demo, "demo_plan", lambda: SHORT)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """A bench whose demo has been made: the one real reconstruction of these tests."""
    made = Bench(tmp_path_factory.mktemp("finished"))
    with pytest.MonkeyPatch.context() as patch:
        patch_small(patch)
        made.demo.show()
    return made


@pytest.fixture
def bench(tmp_path: Path, finished: Bench, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A bench without a demo; new demos are copies of the finished one."""
    patch_small(monkeypatch)
    result, capture = finished.opened[0], pipeline.scan

    def copy_scan(rig: DeviceRig, plan: CapturePlan, session: Path, *rest: object) -> object:
        if session.exists():
            return capture(rig, plan, session, *rest)  # type: ignore[arg-type]
        return shutil.copytree(result.with_suffix(".dsl"), session)

    monkeypatch.setattr(pipeline, "scan", copy_scan)
    monkeypatch.setattr(scans, "reconstruct_scan", lambda session, progress: load_result(result))
    return Bench(tmp_path)


def test_the_demo_is_made_once_and_offers_a_live_one(finished: Bench) -> None:
    result = finished.opened[0]
    assert result.name == "demo.zarr"
    assert "reflectance" in load_result(result)
    assert "Start a live scan" in finished.scans.notifier.offers
    finished.demo.show()
    assert [job.title for job in finished.runner.finished] == ["Make the demo"]
    assert finished.opened[:2] == [result, result]


def test_a_demo_of_another_version_is_made_again(bench: Bench, tmp_path: Path) -> None:
    session = tmp_path / "demo" / "demo.dsl"
    session.mkdir(parents=True)
    (session / "manifest.json").write_text("{ cut off")
    bench.demo.show()
    assert bench.opened == [tmp_path / "demo" / "demo.zarr"]
    assert not ScanReader(session).missing()


def test_a_failure_is_told_and_can_be_tried_again(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError("no room")

    with monkeypatch.context() as broken:
        broken.setattr(demo, "take_demo", fail)
        bench.demo.show()
    assert bench.scans.notifier.told[-1] == ("error", "The demo could not be made: no room")
    bench.demo.show()
    assert len(bench.opened) == 1


def test_the_live_demo_connects_the_twin_and_scans(bench: Bench, tmp_path: Path) -> None:
    bench.demo.scan_live()
    assert bench.scans.rig.state.link.value is Link.OPEN
    state = bench.scans.state
    assert state.phase.value is Phase.DONE
    assert state.preset is not None
    assert state.preset.key == "preview"
    folder = tmp_path / "demo" / "scan-20260301-1020.dsl"
    assert not ScanReader(folder).missing()
    # Scans of a person go where they went before.
    assert state.target.value == tmp_path / "scan-20260301-1020.dsl"


def test_after_a_live_demo_that_was_interrupted_too(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def lost(camera: SimCamera, timeout_ms: float = 5000.0) -> Frame:
        raise DeviceError("The power failed.")

    monkeypatch.setattr(SimCamera, "snap", lost)
    bench.demo.scan_live()
    session = bench.scans.state.interrupted.value
    assert session is not None
    assert session.folder.parent == tmp_path / "demo"
    bench.scans.scans.plan_new_scan()
    assert bench.scans.state.target.value == tmp_path / "scan-20260301-1020.dsl"


def test_a_live_demo_that_cannot_start_leaves_the_folder(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(10, 9, 1))
    bench.demo.scan_live()
    assert "not enough disk space" in bench.scans.notifier.told[-1][1]
    assert bench.scans.state.target.value.parent == tmp_path


def test_the_rig_of_a_person_is_not_taken_away(bench: Bench) -> None:
    rig = bench.scans.rig
    rig.connect(rig.state.choice.value)
    rig.state.choice.set(RigChoice("room-12"))
    bench.demo.scan_live()
    assert bench.scans.state.phase.value is Phase.PLANNING
    assert "room-12 is connected" in bench.scans.notifier.told[-1][1]
