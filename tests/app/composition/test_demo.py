from __future__ import annotations

import shutil
from collections import namedtuple
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from dsl_app.composition import demo
from dsl_app.composition import window as window_module
from dsl_app.composition.demo import DemoController
from dsl_app.composition.window import Composition, StartOptions
from dsl_app.connection.state import Link, RigChoice
from dsl_app.scan.state import Phase
from dsl_app.start.examples import EXAMPLES, Example
from pytestqt.qtbot import QtBot

from dsl_core.errors import DeviceError
from dsl_core.io.result.result_file import load_result
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.frames import Frame
from dsl_core.simulation.sim_devices import SimCamera
from tests.app.support.doubles import InlineRunner
from tests.app.support.scan_bench import ScanBench, make_bench
from tests.app.support.small_result import write_small_result

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


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    """A bench whose live scan is a short one of few pixels."""
    monkeypatch.setattr(demo, "LIVE_RIG", RigChoice("twin", tuple(SMALL.items())))
    return Bench(tmp_path)


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda each: each.key)
def test_the_examples_open_from_a_folder_of_the_person(
    bench: Bench, tmp_path: Path, example: Example
) -> None:
    bench.demo.show(example.key)
    (path,) = bench.opened
    assert path == tmp_path / "demo" / f"{example.key}.zarr"
    result = load_result(path)
    assert result.sizes["wavelength_nm"] == 47
    assert float((result["flags"] == 0).mean()) > 0.5
    assert "Start a live scan" in bench.scans.notifier.offers


def test_a_start_with_the_demo_makes_no_page_but_that_of_its_result(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(window_module, "demo_folder", lambda: tmp_path / "demo")
    composition = Composition(StartOptions(demo=True))
    window = composition.open_window(tmp_path)
    qtbot.addWidget(window)
    assert (window.page, list(window._made)) == ("results", ["results"])
    composition.start()
    page = window.page_of("results")
    qtbot.waitUntil(lambda: page.subject() is not None, timeout=60_000)
    assert page.subject() == tmp_path / "demo" / f"{EXAMPLES[0].key}.zarr"
    window.close()


def test_what_is_said_of_a_picture_leaves_with_it(qtbot: QtBot, tmp_path: Path) -> None:
    composition = Composition(StartOptions())
    window = composition.open_window(tmp_path)
    qtbot.addWidget(window)
    assert composition.demo is not None
    window.toasts.offer("Another.", {"Do": lambda: None})
    window.toasts.offer(demo.PRESENTED, {"Start a live scan": lambda: None})
    window.open_page("results")
    assert [toast.text for toast in window.toasts.shown] == ["Another.", demo.PRESENTED]
    window.open_page("start")
    assert [toast.text for toast in window.toasts.shown] == ["Another."]
    window.close()


def test_what_is_said_of_a_finished_scan_leaves_when_another_is_opened(
    qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(window_module, "demo_folder", lambda: tmp_path / "demo")
    composition = Composition(StartOptions())
    window = composition.open_window(tmp_path)
    qtbot.addWidget(window)
    window.open_page("results")
    results = composition.session.results
    assert results is not None
    state = results.state
    for folder, stays in ((tmp_path / "demo", True), (tmp_path, False)):
        folder.mkdir(exist_ok=True)
        window.toasts.offer(demo.PRESENTED, {"Start a live scan": lambda: None})
        path = write_small_result(folder)
        window.open_path(path)

        def is_open(path: Path = path) -> bool:
            shown = state.saved_result
            return shown is not None and shown.path == path

        qtbot.waitUntil(is_open)
        said = [toast.text for toast in window.toasts.shown]
        assert (demo.PRESENTED in said) is stays
    window.close()


def test_a_damaged_example_is_replaced_and_marks_next_to_it_stay(bench: Bench, tmp_path: Path) -> None:
    bench.demo.show()
    (path,) = bench.opened
    marks = path.with_suffix(".marks.json")
    marks.write_text("{}")
    next(path.glob("depth_mm/c/*/*")).write_bytes(b"cut off")
    bench.demo.show()
    assert bench.opened == [path, path]
    assert np.isfinite(load_result(path)["depth_mm"].values).any()
    assert marks.exists()


def test_a_failure_is_told(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "demo").write_text("a file where a folder is needed")
    bench.demo.show()
    kind, text = bench.scans.notifier.told[-1]
    assert kind == "error"
    assert text.startswith("The example could not be opened: ")


@pytest.mark.slow
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
    snap, taken = SimCamera.snap, list[Frame]()

    def lost(camera: SimCamera, timeout_ms: float = 5000.0) -> Frame:
        if len(taken) == 5:
            raise DeviceError("The power failed.")
        taken.append(snap(camera, timeout_ms))
        return taken[-1]

    monkeypatch.setattr(SimCamera, "snap", lost)
    bench.demo.scan_live()
    session = bench.scans.state.interrupted.value
    assert session is not None
    assert session.folder.parent == tmp_path / "demo"
    bench.scans.scans.plan_new_scan()
    assert bench.scans.state.target.value == tmp_path / "scan-20260301-1020.dsl"


def test_after_a_live_demo_of_which_nothing_was_saved(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def lost(camera: SimCamera, timeout_ms: float = 5000.0) -> Frame:
        raise DeviceError("The power failed.")

    monkeypatch.setattr(SimCamera, "snap", lost)
    bench.demo.scan_live()
    assert bench.scans.state.interrupted.value is None
    assert "Nothing is saved yet" in bench.scans.state.trouble.value
    assert bench.scans.state.target.value.parent == tmp_path


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
