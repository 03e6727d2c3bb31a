"""Camera, projector, stage and spectroradiometer of the twin, and how the twin is opened by name."""

from __future__ import annotations

import json
import time

import numpy as np
from numpy.typing import NDArray

from dsl_core.devices.base import (
    Camera,
    CameraInfo,
    DeviceRig,
    Projector,
    ProjectorInfo,
    Spectroradiometer,
    Stage,
)
from dsl_core.errors import DeviceError
from dsl_core.model.frames import Frame
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.bandpass_filters import measured_transmissions
from dsl_core.simulation.effects.catalogue import USUAL_CHOICE, Choice
from dsl_core.simulation.effects.planner import describe
from dsl_core.simulation.effects.tolerance import Tolerance
from dsl_core.simulation.placing import Mishaps, TwinHand
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.spot import spot_light
from dsl_core.simulation.world import AMBIENT_DN_PER_MS, Clock, World

LATENCY_MS = 50.0
#: What the projector says of its frames, whatever its LEDs do.
CLAIMED_PERIOD_MS = 1000.0 / 60.0
EXPOSURE_RANGE_MS = (0.019, 30_000.0)
STAGE_RANGE_MM = (500.0, 1000.0)
#: Scenes that a stage can carry towards and away from the camera.
STAGED = ("plane", "stage")


class SimCamera(Camera):
    """Looks at the world through the calibrated optics."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._exposure_ms = 100.0
        self._shot, self._attempt, self._frame_id = -1, 0, 0
        lens, sensor = world.rig.camera, world.rig.sensor
        self._info = CameraInfo(
            "twin of GS3-U3-32S4C", world.rig.provenance.camera_serial or "TWIN-C", lens.width_px,
            lens.height_px, sensor.bayer, sensor.bit_depth, EXPOSURE_RANGE_MS,
        )  # fmt: skip

    @property
    def info(self) -> CameraInfo:
        """Identity and capabilities."""
        return self._info

    def configure(self, exposure_ms: float) -> float:
        """Set the exposure; raises `DeviceError` outside the range."""
        low, high = EXPOSURE_RANGE_MS
        if not low <= exposure_ms <= high:
            raise DeviceError(
                f"The camera was asked for an exposure of {exposure_ms:g} ms; it can do {low:g} to {high:g}"
                " ms. Change the plan's settings."
            )
        self._exposure_ms = exposure_ms
        return exposure_ms

    def prepare(self, shot_index: int, attempt: int = 0) -> None:
        """Announce the shot; its noise depends on nothing else."""
        self._shot, self._attempt = shot_index, attempt

    def snap(self, timeout_ms: float = 5000.0) -> Frame:
        """Expose and return the frame."""
        world = self.world
        pixels = world.expose(self._exposure_ms, self._shot + 1, self._attempt)
        # Whoever looks twice without announcing a shot sees other noise.
        self._attempt += 1
        world.clock.wait(self._exposure_ms / 1000)
        self._frame_id += 1
        return Frame(pixels, self._exposure_ms, world.clock.now_s, self._frame_id)


class SimProjector(Projector):
    """Changes the world."""

    def __init__(self, world: World) -> None:
        self.world = world
        lens = world.rig.projector
        self._info = ProjectorInfo(
            "twin of PH30N", world.rig.provenance.projector_serial or "TWIN-P", lens.width_px, lens.height_px,
            LATENCY_MS, CLAIMED_PERIOD_MS,
        )  # fmt: skip

    @property
    def info(self) -> ProjectorInfo:
        """Identity and capabilities."""
        return self._info

    def show(self, image: NDArray[np.uint8]) -> None:
        """Show drive levels; raises `DeviceError` for another size or type."""
        self._info.require_image(image)
        self.world.show(image)
        self.world.clock.wait(LATENCY_MS / 1000)


class SimStage(Stage):
    """Moves the scene along the camera axis."""

    def __init__(self, world: World) -> None:
        self.world = world

    @property
    def range_mm(self) -> tuple[float, float]:
        """Smallest and largest position, mm."""
        return STAGE_RANGE_MM

    @property
    def position_mm(self) -> float:
        """Where the stage is, mm."""
        return self.world.position_mm

    def move_to(self, position_mm: float) -> float:
        """Move; raises `DeviceError` outside the range."""
        low, high = STAGE_RANGE_MM
        if not low <= position_mm <= high:
            raise DeviceError(
                f"The stage was asked for {position_mm:g} mm; it travels from {low:g} to {high:g} mm."
            )
        self.world.move_to(float(position_mm))
        return self.world.position_mm


class SimSpectroradiometer(Spectroradiometer):
    """Measures the spot in the middle of the camera's view, over whole LED cycles.

    Through the film it sees the first orders of other columns too. The scale is that of the rig's emission
    curves, not absolute; ``NOISE`` is relative to the peak.
    """

    NOISE = 0.002

    def __init__(self, world: World) -> None:
        self.world = world
        self._count = 0

    def measure(self) -> SpectralCurve:
        """Spectral radiance of the spot in relative units of W/(sr m2 nm)."""
        world, truth = self.world, self.world.truth
        nm = truth.materials.wavelengths_nm
        spot = (truth.depth_mm.shape[0] // 2, truth.depth_mm.shape[1] // 2)
        material = int(truth.material[spot])
        reflectance = truth.materials.reflectance[material] if material >= 0 else np.zeros(len(nm))
        value = reflectance * spot_light(world, spot, nm)
        if world.noise:
            self._count += 1
            rng = np.random.Generator(np.random.SFC64([world.seed, 1 << 20, self._count]))
            value = value + self.NOISE * value.max() * rng.standard_normal(len(nm))
        return SpectralCurve.of(nm, value, unit="W/(sr m2 nm)")


def open_twin(options: dict[str, str]) -> DeviceRig:
    """The twin of the published rig; scenes, noise and image size as options.

    ``scene`` (default ``color-checker``) and its own options, ``size`` (``890x580``), ``seed``, ``noise``
    (``on``, ``off``), ``sigma`` (extra Gaussian noise as a share of full scale, known to the calibration),
    ``film`` (``on``, ``off``), ``device`` (``cpu``, ``cuda``), ``realtime`` (``on`` waits as long as real
    devices would).

    ``effects`` says what is rendered of all that light does: ``usual`` (the default, what the plain renderer
    has), ``all``, ``none``, names, or ``auto``: what the scene calls for, within a ``tolerance`` (``1DN``,
    ``0.5sigma``).

    For calibrations: ``truth`` (a number draws a rig around the published one, whose calibration nobody
    knows), ``led_cycle_hz`` (the LEDs flash in turn instead of shining steadily), ``ambient_dn_per_ms``. For
    mishaps: ``defocus_px``, ``brightness`` (the light is so many times as bright), ``wrong_filter_nm``,
    ``filter_tilt_deg``, ``bow_mm``, ``stage_scale``, ``chart_roll_deg``, ``board_shift_mm``, ``print_scale``,
    ``target_missing`` (``on``, ``off``).

    Raises `DeviceError` for a value that makes no sense.
    """
    rest = dict(options)
    nominal = rig = published_rig()
    size = rest.pop("size", "")
    if size:
        nominal = rig = rig.model_copy(update={"camera": rig.camera.resized(*_size(size))})
    truth = rest.pop("truth", None)
    drawn = 0 if truth is None else int(_number("truth", truth))
    if truth is not None:
        rig = random_rig(drawn, rig)
    cycle_hz = _number("led_cycle_hz", rest.pop("led_cycle_hz", "0"))
    if cycle_hz:
        rig = rig.model_copy(update={"frame_period_ms": 1000.0 / cycle_hz})
    sigma = _number("sigma", rest.pop("sigma", "0"))
    if sigma:
        noise_dn = np.hypot(rig.sensor.read_noise_dn, sigma * rig.sensor.full_scale_dn)
        rig = rig.model_copy(
            update={"sensor": rig.sensor.model_copy(update={"read_noise_dn": float(noise_dn)})}
        )
    brightness = _number("brightness", rest.pop("brightness", "1"))
    if brightness != 1:
        rig = rig.model_copy(update={"white_scale": rig.white_scale * brightness})
    # What is true leaves nothing open in its columns.
    rig = rig.model_copy(update={"column_std_px": 0.0})
    mishaps = _mishaps(rest)
    name = rest.pop("scene", "color-checker")
    world = World(
        rig,
        scene_at=lambda position_mm: make_scene(name, **rest),
        seed=int(_number("seed", rest.pop("seed", "0"))),
        noise=_switch("noise", rest.pop("noise", "on")),
        film=_switch("film", rest.pop("film", "on")),
        device=rest.pop("device", "cpu"),
        effects=Choice.of(rest.pop("effects", "usual")),
        tolerance=Tolerance.of(rest.pop("tolerance", "1DN")),
        ambient_dn_per_ms=_number("ambient_dn_per_ms", rest.pop("ambient_dn_per_ms", str(AMBIENT_DN_PER_MS))),
        led_cycle_ms=1000.0 / cycle_hz if cycle_hz else None,
        defocus_px=_number("defocus_px", rest.pop("defocus_px", "0")),
        clock=Clock(sleep=time.sleep) if _switch("realtime", rest.pop("realtime", "off")) else Clock(),
    )
    if name in STAGED:
        world.position_mm = _number("depth_mm", rest.pop("depth_mm", "700"))
        world.scene_at = lambda position_mm: make_scene("plane", depth_mm=position_mm, **rest)
    # Built once now, so that a wrong name or option is told before anything is captured.
    world.scene_at(world.position_mm)
    devices = assemble(world)
    devices.nominal, devices.filters = nominal, measured_transmissions(drawn)
    devices.place = TwinHand(world, drawn, mishaps)
    if world.effects != USUAL_CHOICE:
        devices.notes["effects"] = json.dumps(describe(world.effect_plan(), world.effects.text))
    if truth is not None:
        devices.calibration = None
    return devices


def _mishaps(options: dict[str, str]) -> Mishaps:
    """Take the options of mishaps out of all options."""
    wrong = options.pop("wrong_filter_nm", None)
    return Mishaps(
        None if wrong is None else _number("wrong_filter_nm", wrong),
        _number("filter_tilt_deg", options.pop("filter_tilt_deg", "0")),
        _number("bow_mm", options.pop("bow_mm", "0")),
        _number("stage_scale", options.pop("stage_scale", "1")),
        _number("chart_roll_deg", options.pop("chart_roll_deg", "0")),
        _number("board_shift_mm", options.pop("board_shift_mm", "0")),
        _number("print_scale", options.pop("print_scale", "1")),
        _switch("target_missing", options.pop("target_missing", "off")),
    )


def assemble(world: World) -> DeviceRig:
    """The devices of a world as a rig; its true calibration is known."""
    return DeviceRig(
        name="twin",
        camera=SimCamera(world),
        projector=SimProjector(world),
        stage=SimStage(world),
        spectroradiometer=SimSpectroradiometer(world),
        calibration=world.rig,
        sleep=world.clock.wait,
    )


def _size(text: str) -> tuple[int, int]:
    try:
        width, height = (int(part) for part in text.lower().split("x"))
    except ValueError:
        width = height = 0
    if not (16 <= width <= 4096 and 16 <= height <= 4096):
        raise DeviceError(f"The twin's size must be like 890x580 (16 to 4096 pixels a side), not {text!r}.")
    return width, height


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value) or value < 0:
        raise DeviceError(f"The twin's option {name} must be a number of at least 0, not {text!r}.")
    return value


def _switch(name: str, text: str) -> bool:
    if text not in ("on", "off"):
        raise DeviceError(f"The twin's option {name} must be 'on' or 'off', not {text!r}.")
    return text == "on"
