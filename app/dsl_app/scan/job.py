"""A scan running in a job's thread, and what the window may ask of it meanwhile."""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from dsl_app.scan.state import LivePicture
from dsl_core.capture.overexposure import full_scale_dn
from dsl_core.capture.preview import BlockGraph, BlockGraphs, quick_picture
from dsl_core.capture.runner import Runner, Status
from dsl_core.devices.base import DeviceRig
from dsl_core.model.conditions import BayerPattern
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot
from dsl_core.model.rig import Rig
from dsl_core.progress import CancelToken, Progress

#: Pictures wider than this are thinned before they are painted, cells.
PICTURE_CELLS = 800
#: The share of pixels that may be brighter than the brightest told: hot ones say nothing of the exposure.
BRIGHTEST = 0.995


@dataclass(frozen=True)
class ScanRequest:
    """What to scan: with which devices, plan and calibration, and into which folder.

    With ``meters`` a new scan measures the scene first and scales the exposures of its plan to it.
    """

    devices: DeviceRig
    plan: CapturePlan
    folder: Path
    notes: dict[str, str]
    calibration: Rig | None
    override: bool
    is_resumed: bool
    check_drift: bool = True
    meters: bool = False


class ScanJob:
    """Runs a request once; `work` belongs to the job's thread, everything else to the window's."""

    def __init__(self, request: ScanRequest) -> None:
        self.request = request
        self.token = CancelToken()
        #: Whether the finished scan contains a calibration, without which it cannot be reconstructed.
        self.is_calibrated = True
        self._lock = threading.Lock()
        self._runner: Runner | None = None
        #: A lock of its own: the runner reports its status under a lock, and that takes the other one.
        self._pausing = threading.Lock()
        self._is_paused = False
        self._graphs: BlockGraphs | None = None
        self._status: Status | None = None
        self._picture: LivePicture | None = None
        self._left_s: float | None = None
        self._exposed = ""

    # In the job's thread ---------------------------------------------------------------------------

    def work(self, progress: Progress) -> Status:
        """Capture every missing frame; raises what the engine raises."""
        from dsl_core import pipeline
        from dsl_core.io.scan.folder import ScanReader
        from dsl_core.workflows import scans

        request = self.request
        if request.devices.put_back is not None:
            request.devices.put_back()  # a calibration may have left its target before the camera
        if request.is_resumed:
            progress.report("check for movement", 0, 0)
            devices, plan = scans.prepare_resume(request.devices, request.folder, request.check_drift)
            notes = {}
        else:
            devices, overridden = self._calibrated()
            plan, notes = request.plan, request.notes | overridden
            if request.meters:
                plan, metered = self._metered(devices, progress)
                notes |= metered
        graphs = BlockGraphs(plan, devices.camera.info.bayer)
        if request.is_resumed:
            self._read_before(graphs, progress)
        self._graphs = graphs
        bayer, full_dn = devices.camera.info.bayer, full_scale_dn(devices)
        with pipeline.open_scan(
            devices, plan, request.folder, progress, notes, self.token,
            lambda shot, frame: self._watch(plan, shot, frame, bayer, full_dn),
            prove=not request.is_resumed or request.check_drift, waits=True,
        ) as runner:  # fmt: skip
            runner.listen(self._listen)
            with self._pausing:
                self._runner = runner
                if self._is_paused:
                    runner.pause()
            status = runner.run()
        self.is_calibrated = ScanReader(request.folder).calibration is not None
        return status

    def _calibrated(self) -> tuple[DeviceRig, dict[str, str]]:
        """The devices with the calibration ordered, and what was overridden, as notes of the scan."""
        from dsl_core.devices.conditions import with_calibration

        request = self.request
        if request.calibration is None:
            return replace(request.devices, calibration=None), {}
        devices, overridden = with_calibration(request.devices, request.calibration, request.override)
        return devices, {"calibration_overridden": "; ".join(overridden)} if overridden else {}

    def _metered(self, devices: DeviceRig, progress: Progress) -> tuple[CapturePlan, dict[str, str]]:
        """The plan with exposures for the scene, and what was measured, as notes of the scan."""
        from dsl_core import pipeline

        progress.report("measure the light", 0, 0)
        found = pipeline.meter(devices, self.request.plan, self.token)
        with self._lock:
            self._exposed = found.sentence if found.is_told else ""
        return found.plan, found.notes

    def _read_before(self, graphs: BlockGraphs, progress: Progress) -> None:
        """Add the frames of earlier runs to the graphs."""
        from dsl_core.io.scan.folder import ScanReader

        reader = ScanReader(self.request.folder)
        sound = reader.sound()
        there = [s for s in reader.plan.shots() if s.role == "spectral" and s.index in sound]
        for done, shot in enumerate(there):
            progress.report("read saved frames", done, len(there))
            graphs.add(shot, reader.read(shot))

    def _watch(
        self, plan: CapturePlan, shot: Shot, frame: Frame, bayer: BayerPattern, full_scale_dn: int
    ) -> None:
        assert self._graphs is not None
        self._graphs.add(shot, frame.pixels)
        if self._picture is not None:
            return
        picture = quick_picture(frame.pixels, bayer, full_scale_dn)
        thin = -(-picture.shape[1] // PICTURE_CELLS)
        with self._lock:
            self._picture = LivePicture(
                plan, shot, picture[::thin, ::thin], 2 * thin, *_exposed(frame, full_scale_dn)
            )

    def _listen(self, status: Status) -> None:
        with self._lock:
            self._status, self._left_s = status, status.remaining_s if status.done else None

    # In the window's thread ------------------------------------------------------------------------

    def take_news(self) -> tuple[Status | None, LivePicture | None]:
        """The latest status and picture since the last call."""
        with self._lock:
            news = self._status, self._picture
            self._status = self._picture = None
        return news

    def take_exposed(self) -> str:
        """What is to be said of the exposures, once; empty where they are as planned."""
        with self._lock:
            said, self._exposed = self._exposed, ""
        return said

    def left_s(self) -> float | None:
        """Seconds left of the whole scan, which stand still in a pause; None before the first frame."""
        with self._lock:
            return self._left_s

    def graph(self, pixel: tuple[int, int]) -> BlockGraph | None:
        """The intensity graph of a pixel, as far as captured."""
        return None if self._graphs is None else self._graphs.graph(pixel)

    def pause(self, on: bool = True) -> None:
        """Wait before the next frame, or continue; a scan still in preparation waits before its first."""
        with self._pausing:
            self._is_paused = on
            if self._runner is not None:
                (self._runner.pause if on else self._runner.resume)()


def _exposed(frame: Frame, full_scale_dn: int) -> tuple[float, float]:
    """What the brightest pixels reach of full scale, and the share of pixels there; of every ninth pixel."""
    # An odd step meets all colours of the mosaic.
    some = frame.pixels[::3, ::3]
    return float(np.quantile(some, BRIGHTEST)) / full_scale_dn, float((some >= full_scale_dn).mean())
