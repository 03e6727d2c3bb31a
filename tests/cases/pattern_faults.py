"""Devices whose pictures do not show what was asked for, while numbers, sizes and exposures look right.

What goes wrong depends only on the fault and on the shots taken, so that every run is the same.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import Camera, CameraInfo, DeviceRig, Projector, ProjectorInfo
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan, Shot

Image = NDArray[np.uint8]
PatternImage = Callable[[CapturePlan, Shot], Image]

#: What may be wrong with single pictures: only the first exposure of a shot, so that a second one is right.
SINGLE = ("late", "repeated", "swapped", "torn", "band", "half", "dark", "saturated")
#: What stays wrong from a shot on, also where earlier shots are captured again.
LASTING = ("frozen", "projector late", "camera late", "camera repeats", "half from", "dark from")
#: Of these, those that a second take of the same shot makes good.
CURABLE = ("projector late", "camera late")


@dataclass(frozen=True)
class PatternFault:
    """One thing of `SINGLE` or `LASTING` that goes wrong ``at`` a shot; ``tear`` is where it tears."""

    kind: str
    at: int
    tear: float = 0.5


class PatternFaults:
    """The devices of a rig, some of whose pictures show another pattern; ``wrong`` collects which."""

    def __init__(
        self, rig: DeviceRig, plan: CapturePlan, pattern_image: PatternImage, faults: tuple[PatternFault, ...]
    ) -> None:
        """``pattern_image`` says what each shot should show."""
        self._camera, self._projector = rig.camera, rig.projector
        self._images = pattern_image
        self._plan, self._shots = plan, tuple(plan.shots())
        self._single: dict[int, PatternFault] = {}
        self._lasting = [fault for fault in faults if fault.kind in LASTING]
        for fault in faults:
            if fault.kind in SINGLE:
                self._single[fault.at] = fault
                if fault.kind == "swapped":
                    self._single[fault.at + 1] = replace(fault, at=fault.at + 1)
        self.shot, self._latest, self._exposure_ms = 0, 0, 0.0
        self._asked: list[Image] = []
        self._snaps: dict[int, int] = {}
        self._last: Frame | None = None
        #: Numbers of frames that do not show their pattern as they should, with the fault.
        self.wrong: dict[int, PatternFault] = {}
        self.first_takes = 0
        self.rig = replace(rig, camera=_Camera(self), projector=_Projector(self))

    def prepare(self, shot: int) -> None:
        self.shot, self._latest = shot, max(self._latest, shot)

    def show(self, image: Image) -> None:
        self._asked.append(image)
        if self._is_lasting("frozen"):
            return
        late = self._is_lasting("projector late") and len(self._asked) > 1
        self._projector.show(self._asked[-2] if late else image)

    def snap(self, timeout_ms: float) -> Frame:
        count = self._snaps[self.shot] = self._snaps.get(self.shot, 0) + 1
        fault = self._single.get(self.shot) if count == 1 else None
        if fault is None:
            fault = next((each for each in self._lasting if self._latest >= each.at), None)
        frame = self._camera.snap(timeout_ms)
        if fault is not None:
            frame, is_wrong = self._spoiled(fault, frame, timeout_ms)
            if is_wrong:
                self.wrong[frame.frame_id] = fault
        self._last = frame
        return frame

    def _spoiled(self, fault: PatternFault, frame: Frame, timeout_ms: float) -> tuple[Frame, bool]:
        shot, last = self._shots[self.shot], self._last
        before = self._asked[-2] if len(self._asked) > 1 else np.zeros_like(self._asked[-1])
        match fault.kind:
            case "late":
                return self._other(before, frame, timeout_ms), True
            case "swapped":
                first = self._single.get(shot.index - 1)
                step = (
                    -1 if first is not None and first.kind == "swapped" and first.at == shot.index - 1 else 1
                )
                other = self._shots[min(shot.index + step, len(self._shots) - 1)]
                return self._other(self._images(self._plan, other), frame, timeout_ms), True
            case "torn":
                late = self._other(before, frame, timeout_ms)
                row = int(fault.tear * frame.pixels.shape[0])
                pixels = np.concatenate([frame.pixels[:row], late.pixels[row:]])
                return replace(frame, pixels=pixels), True
            case "band":
                # What was in memory where packets were lost.
                rows, count = slice(int(fault.tear * len(frame.pixels)), None), len(frame.pixels) // 8
                mixed = frame.pixels.copy()
                mixed[rows][:count] = self._other(before, frame, timeout_ms).pixels[rows][:count]
                return replace(frame, pixels=mixed), True
            case "half" | "half from":
                self._camera.configure(frame.exposure_ms / 2)
                dim = self._camera.snap(timeout_ms)
                self._camera.configure(frame.exposure_ms)
                return replace(dim, exposure_ms=frame.exposure_ms), shot.role != "black"
            case "dark" | "dark from":
                black = self._images(self._plan, Shot(-1, "black", 0, 0, 1.0, 1.0))
                return self._other(black, frame, timeout_ms), shot.role != "black"
            case "saturated":
                full = 2**self._camera.info.bit_depth - 1
                return replace(frame, pixels=np.full_like(frame.pixels, full)), True
            case "frozen":
                return frame, True
            case "projector late":
                return frame, before is not self._asked[-1] and self._snaps[self.shot] == 1
            case _ if last is None:
                return frame, False
            case "camera late":
                kept, self._held = getattr(self, "_held", last), frame
                return replace(frame, pixels=kept.pixels), self._snaps[self.shot] == 1
            case _:  # the camera repeats
                return replace(frame, pixels=last.pixels.copy()), True

    def _other(self, image: Image, frame: Frame, timeout_ms: float) -> Frame:
        self._projector.show(image)
        other = self._camera.snap(timeout_ms)
        self._projector.show(self._asked[-1])
        return other

    def _is_lasting(self, kind: str) -> bool:
        # A pattern is shown before its shot is announced.
        return any(fault.kind == kind and self._latest + 1 >= fault.at for fault in self._lasting)


class _Camera(Camera):
    def __init__(self, faults: PatternFaults) -> None:
        self._faults, self._camera = faults, faults._camera

    @property
    def info(self) -> CameraInfo:
        return self._camera.info

    def configure(self, exposure_ms: float) -> float:
        return self._camera.configure(exposure_ms)

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        self._faults.prepare(shot_index)
        self._camera.prepare(shot_index, attempt)

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        return self._faults.snap(timeout_ms)

    def close(self) -> None:
        self._camera.close()


class _Projector(Projector):
    def __init__(self, faults: PatternFaults) -> None:
        self._faults, self._projector = faults, faults._projector

    @property
    def info(self) -> ProjectorInfo:
        return self._projector.info

    def show(self, image: Image) -> None:
        self._faults.show(image)

    def close(self) -> None:
        self._projector.close()
