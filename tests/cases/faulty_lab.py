"""A rig of another package: the twin behind drivers that fail in one way, chosen by option.

`installed` puts it into a folder as an installer would; then ``open_rig("faulty-lab", ...)`` finds it. What
goes wrong depends on the options alone.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import (
    Camera,
    CameraInfo,
    DeviceRig,
    Patience,
    Projector,
    ProjectorInfo,
    Spectroradiometer,
    Stage,
)
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan
from dsl_core.model.spectral import SpectralCurve
from dsl_core.patterns.images import pattern_image
from dsl_core.simulation.sim_devices import open_twin
from tests.cases.lab_everyday import CAMERA_EVERYDAY, PROJECTOR_EVERYDAY
from tests.cases.lab_links import CAMERA_LINKS, PROJECTOR_LINKS, CameraLink
from tests.cases.lab_mishaps import CAMERA_MISHAPS, PROJECTOR_MISHAPS, CameraMishap
from tests.cases.lab_oddities import CAMERA_ODDITIES, PROJECTOR_ODDITIES
from tests.cases.lab_surprises import CAMERA_SURPRISES, PROJECTOR_SURPRISES
from tests.cases.lab_whims import CAMERA_WHIMS, PROJECTOR_WHIMS
from tests.cases.pattern_faults import LASTING, SINGLE, PatternFault, PatternFaults
from tests.cases.rig_habits import ALWAYS, CAMERA_HABITS, PROJECTOR_HABITS
from tests.cases.spoiled_pictures import SPOILED, Spoil, squared

Change = Callable[[Frame, "LabCamera"], object]


def installed(folder: Path) -> Path:
    """Make a folder that, on ``sys.path``, holds this rig as a separate installed package."""
    (folder / "faulty_lab_rig").mkdir(parents=True)
    (folder / "faulty_lab_rig" / "__init__.py").write_text(
        "from tests.cases.faulty_lab import open_lab\n\n__all__ = ['open_lab']\n"
    )
    info = folder / "faulty_lab_rig-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: faulty-lab-rig\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[dsl_scan.rigs]\nfaulty-lab = faulty_lab_rig:open_lab\n")
    return folder


def open_lab(options: dict[str, str]) -> DeviceRig:
    """The twin with ``fault`` from shot ``at`` of ``plan`` (a file) on; all other options are the twin's."""
    rest = dict(options)
    kind, at = rest.pop("fault", ""), int(rest.pop("at", "0"))
    tear, plan_file = float(rest.pop("tear", "0.5")), rest.pop("plan", "")
    if kind == "cannot be opened":
        raise OSError(19, "No such device")
    rig = open_twin(rest)
    if kind == "swapped at the lines":
        kind = "swapped"
    if kind.endswith(ALWAYS):
        kind, at = kind.removesuffix(ALWAYS), 0
    if kind in (*SINGLE, *LASTING):
        plan = CapturePlan.model_validate_json(Path(plan_file).read_text())
        rig = PatternFaults(rig, plan, pattern_image, (PatternFault(kind, at, tear),)).rig
    rig = replace(
        rig,
        name="faulty-lab",
        camera=LabCamera(rig.camera, kind, at),
        projector=LabProjector(rig.projector, kind, at),
        place=None,
        put_back=None,
        standing=None,
        # On a busy machine, the twin may take minutes for what it should return at once.
        patience=Patience(answer_s=1.5 if "hangs" in kind else 900.0),
    )
    assert rig.stage is not None
    assert rig.spectroradiometer is not None
    rig.stage = LabStage(rig.stage, kind)
    rig.spectroradiometer = LabInstrument(rig.spectroradiometer, kind)
    return rig


class LabCamera(Camera):
    """Passes everything on, and spoils frames from the time of shot ``at`` on, or that one only once."""

    def __init__(self, camera: Camera, kind: str, at: int) -> None:
        self.camera, self.kind, self.at = camera, kind, at
        self.shot = self.snaps = 0
        self.happened = 0
        self.last: Frame | None = None
        self.buffer: NDArray[np.uint16] | None = None
        self.pictures: list[NDArray[np.uint16]] = []

    @property
    def info(self) -> CameraInfo:
        info = self.camera.info
        if self.kind == "bit depth changes" and self.shot >= self.at and self.snaps:
            return replace(info, bit_depth=8)
        return info

    def configure(self, exposure_ms: float) -> float:
        actual = self.camera.configure(exposure_ms)
        return 1.3 * actual if self.kind == "exposure rounded by a third" else actual

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        self.shot = shot_index
        self.camera.prepare(shot_index, attempt)

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        frame = self.camera.snap(timeout_ms)
        self.snaps += 1
        found = CAMERA.get(self.kind)
        if found is not None and (self.shot >= self.at or self.happened):
            is_single, change = found
            if not (is_single and self.happened):
                self.happened += 1
                frame = change(frame, self)  # type: ignore[assignment]
        self.last = frame
        return frame

    def close(self) -> None:
        if self.kind == "camera hangs when closed":
            threading.Event().wait()
        if self.kind == "camera fails to close":
            raise RuntimeError("handle is invalid")
        self.camera.close()


def _raise(error: Exception) -> Change:
    def change(frame: Frame, camera: LabCamera) -> object:
        raise error

    return change


def _hang(frame: Frame, camera: LabCamera) -> object:
    threading.Event().wait()
    return frame


def _pixels(change: Callable[[NDArray[np.uint16]], NDArray[np.generic]]) -> Change:
    return lambda frame, camera: replace(frame, pixels=change(frame.pixels))  # type: ignore[arg-type]


def _spoiled(spoil: Spoil) -> Change:
    return lambda frame, camera: replace(frame, pixels=spoil(frame.pixels, camera.happened - 1))


def _mishap(change: CameraMishap) -> Change:
    return lambda frame, camera: replace(
        frame, pixels=change(frame.pixels, (camera.last or frame).pixels, camera.happened - 1)
    )


def _link(change: CameraLink) -> Change:
    def changed(frame: Frame, camera: LabCamera) -> object:
        camera.pictures.append(frame.pixels)
        return replace(frame, pixels=change(camera.pictures))

    return changed


def _fill(frame: Frame, camera: LabCamera) -> object:
    if camera.buffer is None:
        camera.buffer = frame.pixels.copy()
    camera.buffer[:] = frame.pixels
    return replace(frame, pixels=camera.buffer)


def _cut(pixels: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """A picture whose transfer broke off."""
    cut = pixels.copy()
    cut[2 * len(cut) // 3 :] = 0
    return cut


#: Faults of the camera: whether they happen once, and what they make of a frame.
CAMERA: dict[str, tuple[bool, Change]] = {
    "frame lost": (True, _raise(DeviceError("No frame arrived in time. Check the cable."))),
    "driver raises once": (True, _raise(ValueError("bad register"))),
    "driver raises for good": (False, _raise(OSError(5, "Input/output error"))),
    "driver ends the program": (False, _raise(SystemExit(1))),  # type: ignore[arg-type]
    "camera hangs": (False, _hang),
    "old frame again": (True, lambda frame, camera: camera.last or frame),
    "no picture": (True, lambda frame, camera: None),
    "left-aligned": (False, _pixels(lambda p: p << 4)),
    "8 bits": (False, _pixels(lambda p: p >> 4)),
    "another size": (False, _pixels(lambda p: p[:, :-2])),
    "another type": (False, _pixels(lambda p: (p >> 4).astype(np.uint8))),
    "NaN": (True, _pixels(lambda p: np.full(p.shape, np.nan))),
    "cut off": (True, _pixels(_cut)),
    "cut off from": (False, _pixels(_cut)),
    "mirrored": (False, _pixels(lambda p: p[:, ::-1].copy())),
    "upside down": (False, _pixels(lambda p: p[::-1].copy())),
    "gain doubles": (False, _pixels(lambda p: np.minimum(2 * p, 4095).astype(np.uint16))),
    "moves 4 px": (False, _pixels(lambda p: np.roll(p, 4, 1))),
    "counter wraps": (False, lambda frame, camera: replace(frame, frame_id=(frame.frame_id + 65500) % 65536)),
    "counter skips": (False, lambda frame, camera: replace(frame, frame_id=frame.frame_id + 7)),
    "counter restarts": (
        False,
        lambda frame, camera: replace(frame, frame_id=camera.happened, timestamp_s=0.1 * camera.happened),
    ),
    "clock jumps back": (False, lambda frame, camera: replace(frame, timestamp_s=frame.timestamp_s - 1e4)),
    "no clock": (False, lambda frame, camera: replace(frame, timestamp_s=float("nan"))),
    "exposure told": (False, lambda frame, camera: replace(frame, exposure_ms=frame.exposure_ms / 2)),
    "clock in ms": (False, lambda frame, camera: replace(frame, timestamp_s=1e3 * frame.timestamp_s)),
    "memory used again": (False, _fill),
    **{kind: (is_single, _spoiled(spoil)) for kind, (is_single, spoil) in SPOILED.items()},
    **{kind: (False, _spoiled(spoil)) for kind, spoil in CAMERA_HABITS.items()},
    **{kind: (False, _link(change)) for kind, change in CAMERA_LINKS.items()},
    **{
        kind: (False, _mishap(change))
        for each in (CAMERA_MISHAPS, CAMERA_SURPRISES, CAMERA_ODDITIES, CAMERA_WHIMS, CAMERA_EVERYDAY)
        for kind, change in each.items()
    },
}


_OF_PROJECTOR = (
    PROJECTOR_MISHAPS | PROJECTOR_SURPRISES | PROJECTOR_ODDITIES | PROJECTOR_WHIMS | PROJECTOR_EVERYDAY
)


class LabProjector(Projector):
    """Passes patterns on, until it does not."""

    def __init__(self, projector: Projector, kind: str, at: int) -> None:
        self.projector, self.kind, self.at = projector, kind, at
        self.shown = 0
        self.last: NDArray[np.uint8] | None = None
        self.images: list[NDArray[np.uint8]] = []

    @property
    def info(self) -> ProjectorInfo:
        info = self.projector.info
        if self.kind == "projector changes its size" and self.shown >= self.at:
            return replace(info, width_px=info.width_px // 2)
        return info

    def show(self, image: NDArray[np.uint8]) -> None:
        self.shown += 1
        if image.ndim == 2:
            image = np.repeat(image[..., None], 3, axis=2)  # as is black between pictures
        last, self.last = image if self.last is None else self.last, image
        if self.shown >= self.at:
            match self.kind:
                case "projector hangs":
                    threading.Event().wait()
                case "projector raises once" if self.shown == self.at:
                    raise RuntimeError("context lost")
                case "projector raises for good":
                    raise RuntimeError("context lost")
                case "projector inverts":
                    image = 255 - image
                case "projector mirrors":
                    image = image[:, ::-1].copy()
                case kind if kind in SHIFTS:
                    image = np.roll(image, SHIFTS[kind], 1)
                case "projector squares its picture":
                    image = squared(image)
                case kind if kind in PROJECTOR_HABITS:
                    image = PROJECTOR_HABITS[kind](image, self.shown - max(self.at, 1))
                case kind if kind in PROJECTOR_LINKS:
                    self.images.append(image)
                    image = PROJECTOR_LINKS[kind](self.images)
                case kind if kind in _OF_PROJECTOR:
                    image = _OF_PROJECTOR[kind](image, last, self.shown - max(self.at, 1))
                case "projector dims":
                    image = (0.75 * image).astype(np.uint8)
        self.projector.show(image)


class LabStage(Stage):
    """A stage that does not go where it is sent."""

    def __init__(self, stage: Stage, kind: str) -> None:
        self.stage, self.kind, self.moves = stage, kind, 0
        self.range_mm_ = stage.range_mm

    @property
    def range_mm(self) -> tuple[float, float]:
        return self.range_mm_

    @property
    def position_mm(self) -> float:
        return float("nan") if self.kind == "stage says NaN" else self.stage.position_mm

    def move_to(self, position_mm: float) -> float:
        self.moves += 1
        match self.kind:
            case "stage sticks":
                return self.stage.position_mm
            case "stage sticks and denies it":
                return position_mm
            case "stage overshoots":
                return self.stage.move_to(min(position_mm + 15.0, self.range_mm_[1]))
            case "stage sticks once" if self.moves == 2:
                return self.stage.position_mm
            case "stage raises once" if self.moves == 2:
                raise RuntimeError("encoder lost")
            case "stage says NaN":
                self.stage.move_to(position_mm)
                return float("nan")
        return self.stage.move_to(position_mm)


class LabInstrument(Spectroradiometer):
    """A spectroradiometer that sends nonsense."""

    def __init__(self, instrument: Spectroradiometer, kind: str) -> None:
        self.instrument, self.kind, self.first, self.count = instrument, kind, None, 0

    first: SpectralCurve | None

    def measure(self) -> SpectralCurve:
        curve = self.instrument.measure()
        self.count += 1
        value = np.array(curve.values)
        nm = np.array(curve.wavelengths_nm)
        match self.kind:
            case "spectrum NaN":
                return SpectralCurve.of(nm, np.full_like(value, np.nan), unit=curve.unit)
            case "spectrum NaN once" if self.count == 1:
                return SpectralCurve.of(nm, np.full_like(value, np.nan), unit=curve.unit)
            case "spectrum negative":
                return SpectralCurve.of(nm, -value, unit=curve.unit)
            case "spectrum zero":
                return SpectralCurve.of(nm, 0 * value, unit=curve.unit)
            case "spectrum constant":
                return SpectralCurve.of(nm, 0 * value + 0.2, unit=curve.unit)
            case "spectrum saturated":
                return SpectralCurve.of(nm, np.minimum(value, 0.3 * value.max()), unit=curve.unit)
            case "spectrum in µm":
                return SpectralCurve.of(nm / 1000, value, unit=curve.unit)
            case "spectrum cut":
                return SpectralCurve.of(nm[: len(nm) // 2], value[: len(nm) // 2], unit=curve.unit)
            case "spectrum empty":
                return SpectralCurve.of([], [], unit=curve.unit)
            case "spectrum never changes":
                self.first = self.first or curve
                return self.first
        return curve


#: By how many columns pictures are displaced.
SHIFTS = {
    "projector shifts by 8": 8,
    "projector shifts by 1": 1,
    "projector shifts by 1 in the code": 1,
    "projector shifts by -1 in the code": -1,
    "projector shifts by 2 in the code": 2,
    "projector shifts by 1 in the last lines": 1,
    "projector shifts by -2 in the last lines": -2,
}
PROJECTOR = (
    "projector hangs",
    "projector raises once",
    "projector raises for good",
    "projector changes its size",
    "projector inverts",
    "projector mirrors",
    *SHIFTS,
    "projector squares its picture",
    "projector dims",
    *PROJECTOR_HABITS,
    *_OF_PROJECTOR,
    *PROJECTOR_LINKS,
)
#: Faults of the whole of a scan, that need no shot.
OTHER = (
    "cannot be opened",
    "bit depth changes",
    "exposure rounded by a third",
    "camera hangs when closed",
    "camera fails to close",
)
STAGE = (
    "stage sticks",
    "stage sticks and denies it",
    "stage overshoots",
    "stage says NaN",
    "stage sticks once",
    "stage raises once",
)
SPECTRUM = (
    "spectrum NaN",
    "spectrum NaN once",
    "spectrum negative",
    "spectrum zero",
    "spectrum constant",
    "spectrum saturated",
    "spectrum in µm",
    "spectrum cut",
    "spectrum empty",
    "spectrum never changes",
)
