from __future__ import annotations

import gc
import threading
import time
import weakref
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest
from dsl_app.connection.controller import RIG, RigController
from dsl_app.connection.state import Link, RigChoice, RigState
from dsl_app.rig.controller import LOST_AFTER, LiveController
from dsl_app.rig.state import FrameCounts
from dsl_app.shared.jobs.base import Job
from dsl_app.shared.jobs.qt_runner import QtRunner
from numpy.typing import NDArray
from pytestqt.qtbot import QtBot

from dsl_core.capture.auto_exposure import MOST_FRAMES
from dsl_core.errors import Cancelled, DeviceError
from dsl_core.model.frames import Frame
from dsl_core.patterns.trial_pictures import PictureKind
from dsl_core.progress import CallbackProgress, NoProgress
from dsl_core.simulation.sim_devices import SimCamera, SimProjector
from tests.app.support.doubles import InlineRunner, RecordingNotifier

Start = Callable[[], tuple[LiveController, RecordingNotifier, QtRunner]]
TWIN = RigChoice("twin", (("scene", "plane"), ("size", "64x48")))


def controller(runner: object = None) -> tuple[LiveController, RecordingNotifier]:
    notifier = RecordingNotifier()
    rig = RigController(RigState(TWIN), runner or InlineRunner(), notifier)  # type: ignore[arg-type]
    return LiveController(rig, notifier), notifier


def test_what_is_shown_reaches_the_camera() -> None:
    live, _ = controller()
    live.rig.connect(TWIN)
    devices = live.rig.state.devices.value
    assert devices is not None
    means = []
    kinds: tuple[PictureKind, ...] = ("black", "white")
    for kind in kinds:
        live.show(kind)
        means.append(float(devices.camera.snap().pixels.mean()))
    assert means[1] > means[0] + 50


def test_a_rig_that_was_let_go_leaves_the_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    runner = InlineRunner()
    live, _ = controller(runner)
    monkeypatch.setattr(live.rig, "start_live", lambda work: None)
    live.rig.connect(TWIN)
    live.begin()
    gone = weakref.ref(live.rig.state.devices.value)
    live.rig.disconnect()
    # The window's runner keeps no jobs.
    runner.finished.clear()
    gc.collect()
    assert gone() is None


def test_the_exposure_stays_within_the_camera() -> None:
    live, _ = controller()
    live.set_exposure(1e9)
    assert live.state.exposure_ms.value == 1e9
    live.rig.connect(TWIN)
    assert live.state.exposure_ms.value == 30_000.0
    live.set_exposure(1e9)
    assert live.state.exposure_ms.value == 30_000.0


def test_showing_without_a_rig_says_what_to_do() -> None:
    live, notifier = controller()
    live.show("white")
    live.start()
    live.expose_automatically(None)
    assert all("Connect a rig first" in text for _, text in notifier.told)
    assert len(notifier.told) == 3


@pytest.mark.parametrize(
    ("is_cut_off", "is_set_by_hand", "searches_again"),
    [(False, False, False), (True, False, True), (True, True, False)],
)
def test_a_live_view_lights_the_scene_and_is_exposed_for_it_once(
    monkeypatch: pytest.MonkeyPatch, is_cut_off: bool, is_set_by_hand: bool, searches_again: bool
) -> None:
    live, _ = controller()
    live.rig.connect(TWIN)
    shown: list[object] = []

    def start(_look: object) -> None:
        live.rig.state.live.set(True)
        shown.append(live._wanted)

    monkeypatch.setattr(live.rig, "start_live", start)
    exposes = []
    for _ in range(2):
        live.look()
        exposes.append(live.state.is_exposing.value)
        if not is_cut_off:
            live._exposer.end()
        live.rig.state.live.set(False)
        if is_set_by_hand:
            live.set_exposure(50.0)
    assert exposes == [True, searches_again], "an exposure that was set by hand stays"
    assert shown == [live._picture] * 2


@pytest.fixture
def start(qtbot: QtBot) -> Start:
    def begin() -> tuple[LiveController, RecordingNotifier, QtRunner]:
        runner = QtRunner()
        live, notifier = controller(runner)
        live.rig.connect(TWIN)
        qtbot.waitUntil(lambda: live.rig.state.link.value is Link.OPEN, timeout=60_000)
        live.start()
        return live, notifier, runner

    return begin


def test_live_frames_arrive_until_the_view_stops(qtbot: QtBot, start: Start) -> None:
    live, _, runner = start()
    frames: list[Frame | None] = []
    live.state.frame.changed.connect(frames.append)

    def seen() -> bool:
        live.fetch_frame()
        return len(frames) >= 3

    qtbot.waitUntil(seen)
    live.stop()
    qtbot.waitUntil(lambda: not live.rig.state.live.value)
    assert isinstance(frames[0], Frame)
    assert frames[0].pixels.dtype == np.uint16
    runner.shut_down()


def test_only_frames_lost_in_a_row_lose_the_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    live, _ = controller()
    good = Frame(np.zeros((4, 4), np.uint16), 1.0, 0.0, 1)
    answers = [None, None, good, None, None, good, None, None, None, good]
    monkeypatch.setattr("dsl_app.rig.controller.LIVE_PERIOD_S", 0.0)

    class Camera:
        def configure(self, exposure_ms: float) -> float:
            return exposure_ms

        def snap(self) -> Frame:
            answer = answers.pop(0)
            if answer is None:
                raise DeviceError("No frame arrived.")
            return answer

    with pytest.raises(DeviceError, match="No frame arrived"):
        live._look(SimpleNamespace(camera=Camera(), put_back=None), NoProgress())  # type: ignore[arg-type]
    assert answers == [good]
    assert live._counts == FrameCounts(shown=1, lost=7, skipped=1)


def test_a_camera_that_goes_silent_is_lost_and_told(
    qtbot: QtBot, start: Start, monkeypatch: pytest.MonkeyPatch
) -> None:
    def silent(self: SimCamera, timeout_ms: float = 0.0) -> Frame:
        time.sleep(0.001)
        raise DeviceError("The camera sent no frame. Check its cable.")

    monkeypatch.setattr(SimCamera, "snap", silent)
    live, notifier, runner = start()
    qtbot.waitUntil(lambda: live.rig.state.link.value is Link.LOST)
    assert live._counts.lost == LOST_AFTER
    assert "Check its cable" in notifier.told[-1][1]
    assert not live.rig.state.live.value
    runner.shut_down()


def test_one_click_exposes_for_whole_cycles_of_what_the_camera_sees(qtbot: QtBot, start: Start) -> None:
    live, notifier, _ = start()
    live.show("white", 0.3)
    live.set_exposure(900.0)
    live.expose_automatically((8, 8, 40, 30))
    state = live.state
    assert state.is_exposing.value

    def is_done() -> bool:
        live.fetch_frame()
        return not state.is_exposing.value

    qtbot.waitUntil(is_done, timeout=20_000)
    cycle_ms, frame = live.rig.state.cycle_ms, state.frame.value
    assert cycle_ms is not None
    assert frame is not None
    cycles = state.exposure_ms.value / cycle_ms
    assert cycles == pytest.approx(round(cycles), abs=1e-6)
    assert notifier.told[-1][1].startswith("Exposed for")
    part = frame.pixels[8:38, 8:48]
    assert np.quantile(part, 0.99) < 4095
    live.stop()


def test_the_search_ends_on_a_camera_that_rounds_exposures(monkeypatch: pytest.MonkeyPatch) -> None:
    live, notifier = controller()
    live.rig.connect(TWIN)
    devices = live.rig.state.devices.value
    assert devices is not None
    configure = devices.camera.configure
    # By up to 5 %, as the conformance test lets it: 33.3 ms become 32.
    monkeypatch.setattr(devices.camera, "configure", lambda ms: configure(4.0 * max(round(ms / 4.0), 1)))
    monkeypatch.setattr("dsl_app.rig.controller.LIVE_PERIOD_S", 0.0)
    live.set_exposure(100 / 3)
    live.show("white", 0.2)
    live._exposer.begin(None)

    def fetch(_stage: str, done: int, _total: int) -> None:
        live.fetch_frame()
        if not live.state.is_exposing.value or done > 2 * MOST_FRAMES:
            raise Cancelled("enough")

    with pytest.raises(Cancelled):
        live._look(devices, CallbackProgress(fetch))
    assert not live.state.is_exposing.value
    assert notifier.told[-1][1].startswith("Exposed for")


def test_a_search_for_the_exposure_ends_with_the_live_view(qtbot: QtBot, start: Start) -> None:
    live, _, runner = start()
    live.expose_automatically(None)
    assert live.state.is_exposing.value
    live.stop()
    qtbot.waitUntil(lambda: not live.state.is_exposing.value)
    runner.shut_down()


def expose_in(live: LiveController, dn_per_ms: float) -> None:
    """Expose automatically for an even scene that bright."""
    live._exposer.begin(None)
    while live.state.is_exposing.value:
        exposure_ms = live.state.exposure_ms.value
        level = min(200 + dn_per_ms * exposure_ms, 4095)
        live._exposer.judge(Frame(np.full((8, 8), level, np.uint16), exposure_ms, 0.0, 1), exposure_ms)


@pytest.mark.parametrize(
    ("picture", "says"),
    [("black", "The projector shows black"), ("white", "The scene is too dark: even 2 s of exposure")],
)
def test_in_the_dark_nothing_is_exposed_for_and_what_to_do_is_said(picture: PictureKind, says: str) -> None:
    live, notifier = controller()
    live.rig.connect(TWIN)
    live.show(picture)
    live.set_exposure(100.0)
    # Seventeen seconds would do, but nobody waits so long for a live picture.
    expose_in(live, dn_per_ms=0.1)
    kind, text = notifier.told[-1]
    assert kind == "warning"
    assert text.startswith(says)
    assert live.state.exposure_ms.value == 100.0


@pytest.mark.parametrize(("picture", "says"), [("black", "shows black"), ("white", "open the aperture")])
def test_a_dim_scene_is_exposed_for_and_what_would_light_it_is_said(picture: PictureKind, says: str) -> None:
    live, notifier = controller()
    live.rig.connect(TWIN)
    live.show(picture)
    expose_in(live, dn_per_ms=0.6)
    assert live.state.exposure_ms.value == pytest.approx(2000, rel=0.01)
    kind, text = notifier.told[-1]
    assert kind == "warning"
    assert "reach only 30 % of full scale" in text
    assert says in text
    expose_in(live, dn_per_ms=10.0)
    kind, text = notifier.told[-1]
    assert kind == "info"
    assert "full scale" not in text


def test_frames_that_were_not_fetched_are_counted_as_skipped() -> None:
    live, _ = controller()
    for number in range(3):
        live._post(Frame(np.zeros((4, 4), np.uint16), 10.0, frame_id=number), 10.0)
    live.fetch_frame()
    assert live.state.counts.value == FrameCounts(shown=1, lost=0, skipped=2)
    frame = live.state.frame.value
    assert frame is not None
    assert frame.frame_id == 2


def test_the_picture_of_a_frame_is_made_in_the_thread_that_took_it(qtbot: QtBot, start: Start) -> None:
    live, _, runner = start()
    threads: list[int] = []

    def draw(pixels: NDArray[np.uint16]) -> NDArray[np.uint8]:
        threads.append(threading.get_ident())
        return np.full((1, 1, 3), pixels[0, 0] % 256, np.uint8)

    live.state.draw.set(draw)
    live.start()
    qtbot.waitUntil(lambda: len(threads) > 1, timeout=60_000)
    live.stop()
    live.fetch_frame()
    drawn, frame = live.state.drawn, live.state.frame.value
    assert threading.get_ident() not in threads
    assert drawn is not None
    assert frame is not None
    assert drawn[0] is draw
    assert drawn[1][0, 0, 0] == frame.pixels[0, 0] % 256
    runner.shut_down()


def test_no_picture_reaches_the_projector_while_a_job_has_the_rig(qtbot: QtBot) -> None:
    runner, gate = QtRunner(), threading.Event()
    live, notifier = controller(runner)
    rig = live.rig
    rig.connect(TWIN)
    qtbot.waitUntil(lambda: rig.state.link.value is Link.OPEN, timeout=60_000)
    devices = rig.state.devices.value
    assert devices is not None
    world = devices.camera.world  # type: ignore[attr-defined]
    live.show("black")
    qtbot.waitUntil(lambda: runner.active == ())
    before = world.image
    rig.run(Job("Scan first", lambda progress: gate.wait(60), exclusive=RIG))
    assert rig.state.used_by.value == "Scan first"
    live.show("white")
    assert world.image is before
    assert notifier.told[-1] == (
        "info",
        "Scan first is using the projector. Wait until it ends, or cancel it.",
    )
    gate.set()
    qtbot.waitUntil(lambda: runner.active == ())
    assert rig.state.used_by.value == ""
    live.show("white")
    qtbot.waitUntil(lambda: runner.active == ())
    assert world.image is not before
    runner.shut_down()


def test_a_projector_that_hangs_holds_up_neither_the_window_nor_what_comes_next(
    qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    runner, gate = QtRunner(), threading.Event()
    live, notifier = controller(runner)
    live.rig.connect(TWIN)
    qtbot.waitUntil(lambda: live.rig.state.link.value is Link.OPEN and runner.active == (), timeout=60_000)
    shown: list[float] = []

    def show(self: SimProjector, image: NDArray[np.uint8]) -> None:
        assert gate.wait(30)
        shown.append(float(image.max()))

    monkeypatch.setattr(SimProjector, "show", show)
    live.show("white", 0.2)
    live.start()
    scanned: list[int] = []
    scan = Job("Scan first", lambda _: scanned.append(len(shown)), exclusive=RIG)
    live.rig.run(scan)
    assert live.rig.waits(scan)
    assert live.rig.gives_way(runner.active[0])
    gate.set()
    qtbot.waitUntil(lambda: scanned == [1])
    assert notifier.told == []
    qtbot.waitUntil(lambda: runner.active == ())
    runner.shut_down()


@pytest.mark.parametrize("is_live", [False, True])
def test_a_projector_that_fails_is_lost_like_a_camera(
    qtbot: QtBot, start: Start, monkeypatch: pytest.MonkeyPatch, is_live: bool
) -> None:
    def gone(self: SimProjector, image: NDArray[np.uint8]) -> None:
        raise DeviceError("The projector is gone. Check its cable.")

    live, notifier, runner = start()
    if not is_live:
        live.stop()
        qtbot.waitUntil(lambda: runner.active == ())
    monkeypatch.setattr(SimProjector, "show", gone)
    live.show("white")
    qtbot.waitUntil(lambda: live.rig.state.link.value is Link.LOST and runner.active == ())
    assert "Check its cable" in live.rig.state.trouble.value
    assert "Check its cable" in notifier.told[-1][1]
    assert not live.rig.state.live.value
    runner.shut_down()
