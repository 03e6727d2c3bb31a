"""A whole plan through real camera libraries: is every stored frame the twin's own, bit by bit?

``python -m tests.benchmarks.bench_cameras [--quick] [--size 112x72] [--library pylon] [--minutes 10]``

The twin is scanned once by itself. Then its pictures are what Aravis' own GigE Vision camera on loopback
delivers; the scan is killed three times and resumed from the disk, and the camera is killed three times more
and started again. Then the same plan goes through pylon's emulator, with 50 bad buffers forced between its
frames. What is not installed is left out, and said so. With ``--minutes``, Aravis' camera is instead asked
for one new picture after the other for so long.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.capture.exposure import RetryPolicy, ShotTaker
from dsl_core.devices.base import Camera, CameraInfo, DeviceRig
from dsl_core.devices.drivers import aravis, aravis_library, basler
from dsl_core.devices.drivers.genicam.camera import GenicamCamera
from dsl_core.devices.drivers.genicam.settings import GenicamSettings
from dsl_core.devices.registry import open_rig
from dsl_core.errors import DeviceError, DslError
from dsl_core.io.scan.folder import ScanReader
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, GrayCode, LineComb, Setting
from dsl_core.patterns.images import pattern_image
from dsl_core.pipeline import fit_plan, scan
from tests.benchmarks.common import options, print_table, write_json

SERIAL = "TWIN"
SERVER = Path(__file__).parents[1] / "devices" / "drivers" / "aravis_server.py"
_SHIFT = 4
_BAD = 50
LIBRARIES = ("aravis", "pylon")
_COUNTS = ("asked", "delivered", "bad", "late", "reopened")


class FedCamera(Camera):
    """A camera of a library that is shown, for each shot, what the twin sees."""

    def __init__(
        self, camera: GenicamCamera, twin: Camera, feed: Callable[[NDArray[np.uint16]], None]
    ) -> None:
        self.camera, self._twin, self._feed = camera, twin, feed

    @property
    def info(self) -> CameraInfo:
        """As the library's camera says, with the twin's mosaic."""
        return self._twin.info

    def configure(self, exposure_ms: float) -> float:
        """The twin exposes as the plan says; the camera itself takes its time from a short exposure."""
        self.camera.configure(1.0)
        return self._twin.configure(exposure_ms)

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        """Render the shot and give it to the camera.

        A frame that was lost comes again with the same noise; one that was judged wrong with other noise.
        """
        self._twin.prepare(shot_index, attempt - attempt % RetryPolicy().attempts)
        self._is_fed = False
        self._next()

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """The frame as the library delivers it; one more of the same shot has noise of its own."""
        if not self._is_fed:
            self._next()
        frame = self.camera.snap(timeout_ms)
        self._is_fed = False
        return Frame(frame.pixels, self._seen.exposure_ms, frame.timestamp_s, frame.frame_id)

    def _next(self) -> None:
        self._seen, self._is_fed = self._twin.snap(), True
        self._feed(self._seen.pixels)

    def close(self) -> None:
        """Close the library's camera."""
        self.camera.close()


def plan_of(quick: bool) -> CapturePlan:
    """The published plan, or a short one of combs."""
    if not quick:
        return CapturePlan()
    return CapturePlan(
        code=GrayCode(rows=False),
        spectral=LineComb(width_px=5, step_px=4, period_px=212),
        settings=(Setting(exposure_ms=166.7, level=0.8),),
        code_settings=(0,),
    )


def twin(size: str) -> DeviceRig:
    """The twin that is looked at."""
    return open_rig("twin", {"size": size})


def settings(size: str) -> GenicamSettings:
    """A camera of the twin's picture size, whose 12 bits are moved up as those of the published camera."""
    width, height = map(int, size.split("x"))
    chosen = {"region_px": (0, 0, width, height), "pixel_format": "Mono16", "adc_bits": 12}
    return GenicamSettings.model_validate(chosen)


def work(library: str, size: str, quick: bool, folder: Path, file: Path) -> None:
    """Scan, or resume, in a process that may be killed; a line of counts for every frame."""
    rig, chosen = twin(size), settings(size)
    width, height = map(int, size.split("x"))
    if library == "aravis":
        picture = np.memmap(file, np.uint16, "r+", shape=(height, width))

        def fill(pixels: NDArray[np.uint16]) -> None:
            picture[:] = pixels << _SHIFT

        feed: Callable[[NDArray[np.uint16]], None] = fill
        camera = aravis.open_camera(chosen.model_copy(update={"id": SERIAL}))
    else:
        camera, feed = emulated(chosen, file)
    plan = plan_of(quick)
    rig.camera = FedCamera(camera, rig.camera, feed)

    class Lines:
        def report(self, stage: str, done: int, total: int) -> None:
            print(*(getattr(camera.counts, name) for name in _COUNTS), flush=True)

    with rig:
        scan(rig, fit_plan(plan, rig), folder, Lines())


def emulated(
    chosen: GenicamSettings, file: Path
) -> tuple[GenicamCamera, Callable[[NDArray[np.uint16]], None]]:
    """Pylon's emulator, fed by a picture file, a bad buffer forced before each of the first 50 frames."""
    import cv2

    path = file.with_suffix(".png")
    cv2.imwrite(str(path), np.zeros(chosen.region_px[:1:-1] if chosen.region_px else (1, 1), np.uint16))
    features: dict[str, float | str] = {
        "TestImageSelector": "Off",
        "ImageFileMode": "On",
        "ImageFilename": str(path),
    }
    camera = basler.open_camera(chosen.model_copy(update={"features": features}))
    fed = 0

    def feed(pixels: NDArray[np.uint16]) -> None:
        nonlocal fed
        cv2.imwrite(str(path), pixels << _SHIFT)
        # The emulator reads its file when it is named.
        camera.restart(lambda port: port.write("ImageFilename", str(path)))
        if fed < _BAD:
            port = camera._ready_port()
            port.write("ForceFailedBufferCount", 1)
            port.execute("ForceFailedBuffer")
        fed += 1

    return camera, feed


class Killer:
    """Runs a scan in processes that are killed at some of its frames, and so is the camera."""

    def __init__(self, arguments: argparse.Namespace, library: str, folder: Path, file: Path) -> None:
        self._own = [sys.executable, "-m", "tests.benchmarks.bench_cameras", "--size", arguments.size]
        self._own += ["--quick"] if arguments.quick else []
        self._library, self._folder, self._file = library, folder, file
        self._size = arguments.size
        self.counts = dict.fromkeys(_COUNTS, 0)
        self.killed_scans = self.killed_cameras = 0
        self._camera: subprocess.Popen[str] | None = None

    def run(self, scans_at: list[int], cameras_at: list[int]) -> float:
        """Do the whole scan; frames at which the scan and the camera are killed. Returns seconds."""
        if self._library == "aravis":
            self._serve()
        start, done = time.monotonic(), 0
        while True:
            worker = self._start([*self._own, "--work", self._library, str(self._folder), str(self._file)])
            latest, is_killed = [0] * len(_COUNTS), False
            assert worker.stdout is not None
            for line in worker.stdout:
                latest = [int(each) for each in line.split()]
                done += 1
                if cameras_at and done >= cameras_at[0]:
                    cameras_at.pop(0)
                    self._serve()
                if scans_at and done >= scans_at[0]:
                    scans_at.pop(0)
                    worker.kill()
                    is_killed = True
                    break
            worker.communicate()
            for name, value in zip(_COUNTS, latest, strict=True):
                self.counts[name] += value
            self.killed_scans += is_killed
            if not is_killed:
                break
        self._end_camera()
        if worker.returncode:
            raise DslError(f"The scan through {self._library} ended with code {worker.returncode}.")
        return time.monotonic() - start

    def _serve(self) -> None:
        """Start the camera; one that runs is killed first."""
        if self._camera is not None:
            self.killed_cameras += 1
            self._end_camera()
        self._camera = self._start(
            [sys.executable, str(SERVER), SERIAL, str(self._file), *self._size.split("x")]
        )
        assert self._camera.stdout is not None
        self._camera.stdout.readline()

    def _end_camera(self) -> None:
        if self._camera is not None:
            self._camera.kill()
            self._camera.communicate()
            self._camera = None

    def _start(self, command: list[str]) -> subprocess.Popen[str]:
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYLON_CAMEMU": "1"},
        )


def equal_frames(known: Path, found: Path, size: str) -> tuple[int, int]:
    """How many frames of a scan are the twin's, and of how many that is another exposure than in its scan.

    A killed scan, once resumed, captures again what it cannot judge: then the twin's picture of that exposure
    is what the frame has to equal.
    """
    first, second = ScanReader(known), ScanReader(found)
    same, others = 0, []
    for shot in first.plan.shots():
        with suppress(DslError):
            if np.array_equal(first.read(shot), second.read(shot)):
                same += 1
            else:
                others.append(shot)
    again = 0
    with twin(size) as rig:
        taker = ShotTaker(rig, second.plan, pattern_image, RetryPolicy())
        for shot in others:
            rounds = (second.entries[shot.index].attempts - 1) // RetryPolicy().attempts
            again += np.array_equal(taker.take(shot, rounds).pixels, second.read(shot))
    return same + again, again


def through(library: str, arguments: argparse.Namespace, home: Path, known: Path) -> dict[str, object]:
    """Scan through one library, and compare."""
    width, height = map(int, arguments.size.split("x"))
    file = home / f"{library}.raw"
    np.zeros((height, width), np.uint16).tofile(file)
    killer = Killer(arguments, library, home / f"{library}.dsl", file)
    count = len(list(ScanReader(known).plan.shots()))
    kills = [count * (i + 1) // 4 for i in range(3)] if library == "aravis" else []
    cameras = [count * (2 * i + 1) // 8 for i in range(3)] if library == "aravis" else []
    seconds = killer.run(kills, cameras)
    same, again = equal_frames(known, home / f"{library}.dsl", arguments.size)
    return {
        "library": library, "frames": count, "identical": same, "exposed again": again, **killer.counts,
        "killed scans": killer.killed_scans, "killed cameras": killer.killed_cameras,
        "s per frame": round(seconds / count, 3),
    }  # fmt: skip


def installed() -> list[str]:
    """Libraries to measure; says which are missing, and what brings them."""
    found = []
    loaders: dict[str, Callable[[], object]] = {"aravis": aravis_library.aravis, "pylon": basler.pylon}
    for name, load in loaders.items():
        try:
            load()
            found.append(name)
        except DeviceError as error:
            print(f"{name} is left out: {error}")
    return found


def at_full_rate(size: str, minutes: float) -> dict[str, object]:
    """Frames of noise, each a new one, as fast as the camera gives them."""
    width, height = map(int, size.split("x"))
    noise, asked, wrong, lost = np.random.default_rng(0), 0, 0, 0
    with tempfile.TemporaryDirectory() as home:
        file = Path(home) / "picture.raw"
        np.zeros((height, width), np.uint16).tofile(file)
        picture = np.memmap(file, np.uint16, "r+", shape=(height, width))
        command = [sys.executable, str(SERVER), SERIAL, str(file), *size.split("x")]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
            assert server.stdout is not None
            server.stdout.readline()
            camera = aravis.open_camera(settings(size).model_copy(update={"id": SERIAL}))
            camera.configure(1.0)
            start = time.monotonic()
            while time.monotonic() < start + 60 * minutes:
                shown = noise.integers(0, 1 << 12, picture.shape, np.uint16)
                picture[:] = shown << _SHIFT
                asked += 1
                try:
                    wrong += not np.array_equal(camera.snap().pixels, shown)
                except DeviceError:
                    lost += 1
            seconds = time.monotonic() - start
            camera.close()
            server.kill()
    return {
        "minutes": round(seconds / 60, 2), "frames asked": asked, "wrong": wrong, "lost": lost,
        "frames per s": round(asked / seconds, 1),
    }  # fmt: skip


def main() -> None:
    """Measure all that is installed."""
    parser = options(__doc__)
    parser.add_argument("--size", default="112x72", help="picture size (default 112x72)")
    parser.add_argument("--library", choices=LIBRARIES, help="only this one")
    parser.add_argument("--minutes", type=float, help="how long to ask for frames at full rate")
    parser.add_argument("--work", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.work:
        library, folder, file = arguments.work
        work(library, arguments.size, arguments.quick, Path(folder), Path(file))
        return
    if arguments.minutes:
        row = at_full_rate(arguments.size, arguments.minutes)
        print_table(list(row), [list(row.values())])
        write_json(arguments.json, row)
        return
    libraries = [name for name in installed() if arguments.library in (None, name)]
    with tempfile.TemporaryDirectory() as made:
        home = Path(made)
        with twin(arguments.size) as rig:
            scan(rig, fit_plan(plan_of(arguments.quick), rig), home / "twin.dsl")
        rows = [through(library, arguments, home, home / "twin.dsl") for library in libraries]
    if rows:
        print_table(list(rows[0]), [list(row.values()) for row in rows])
    write_json(arguments.json, {"size": arguments.size, "libraries": rows})


if __name__ == "__main__":
    main()
