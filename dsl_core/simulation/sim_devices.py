"""Camera, projector, stage and spectroradiometer of the twin, and how the twin is opened by name."""

from __future__ import annotations

import logging
import time
from dataclasses import replace

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
from dsl_core.devices.registry import with_options
from dsl_core.errors import DecodeError, DeviceError, PlanError
from dsl_core.extras import require_package
from dsl_core.model.frames import Frame
from dsl_core.model.plan import CapturePlan
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.simulation.bandpass_filters import measured_transmissions
from dsl_core.simulation.effects.catalogue import USUAL_CHOICE
from dsl_core.simulation.effects.planner import describe
from dsl_core.simulation.effects.specular import Specular, glossy_materials
from dsl_core.simulation.placing import TwinHand
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.simulation.rendered_scene import EffectRequest, Setup
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.scenes.surfaces import Rectangle
from dsl_core.simulation.twin_options import TwinOptions, number
from dsl_core.simulation.world import Clock, World
from dsl_core.solve.torch_device import torch_device

_log = logging.getLogger(__name__)

LATENCY_MS = 50.0
#: What the projector says of its frames, whatever its LEDs do.
CLAIMED_PERIOD_MS = 1000.0 / 60.0
EXPOSURE_RANGE_MS = (0.019, 30_000.0)
STAGE_RANGE_MM = (500.0, 1000.0)
#: Scenes that a stage can carry towards and away from the camera.
STAGED = ("plane", "stage")
#: Options of the scene `stage` that say where it stands.
STAGE_SAYS = ("position_mm", "index")


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
                f"An exposure of {exposure_ms:g} ms was requested; the camera supports {low:g} to {high:g}"
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
        # A second look without announcing a shot has other noise.
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
                f"A position of {position_mm:g} mm was requested; the stage travels from {low:g} to"
                f" {high:g} mm."
            )
        self.world.position_mm = float(position_mm)
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
        from dsl_core.simulation.spot_light import spot_light

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


@with_options(TwinOptions)
def open_twin(options: dict[str, str]) -> DeviceRig:
    """The twin of the published rig; scenes, noise and image size as options.

    See `TwinOptions`; all other options are those of the scene. Raises `DeviceError` for a value that makes
    no sense, and `PlanError` for an option that the scene does not have.
    """
    require_package("torch")  # imported with the first picture
    chosen, of_scene = TwinOptions.of(options)
    nominal = published_rig()
    if chosen.size:
        nominal = nominal.model_copy(update={"camera": nominal.camera.resized(*chosen.size)})
    world = World(
        Setup(
            _true_rig(nominal, chosen),
            film=chosen.film,
            ambient_dn_per_ms=chosen.ambient_dn_per_ms,
            led_cycle_ms=1000.0 / chosen.led_cycle_hz if chosen.led_cycle_hz else None,
            defocus_px=chosen.defocus_px,
            device=_device(chosen.device),
            foreign=chosen.foreigners,
        ),
        scene_at=lambda position_mm: make_scene(chosen.scene, **of_scene),
        request=EffectRequest(chosen.choice, chosen.limit),
        seed=chosen.seed,
        noise=chosen.noise,
        clock=Clock(sleep=time.sleep) if chosen.realtime else Clock(),
    )
    if chosen.scene in STAGED:
        world.position_mm = _taken_position_mm(chosen.scene, of_scene)
        world.scene_at = lambda position_mm: make_scene("plane", depth_mm=position_mm, **of_scene)
    # Built once now, so that a wrong name or option is told before anything is captured.
    try:
        scene = world.scene_at(world.position_mm)
    except PlanError as error:
        raise PlanError(f"{error}{TwinOptions.meant(of_scene)}") from error
    names = chosen.choice.names
    if "gloss" in of_scene and glossy_materials(scene.materials) and names and Specular.name not in names:
        _log.warning(
            "Surfaces look matt: effects are '%s', which leave out highlights of glossy ones. To have them,"
            " add the option effects=auto, which renders what the scene calls for.",
            chosen.effects,
        )
    devices = assemble(world)
    drawn = chosen.truth or 0
    devices.nominal, devices.filters = nominal, measured_transmissions(drawn)
    hand = TwinHand(world, drawn, chosen)
    devices.place, devices.put_back, devices.standing = hand, hand.put_back, hand.standing
    if chosen.choice != USUAL_CHOICE:
        devices.expect = lambda plan: _expected(world, plan, chosen.effects)
    if chosen.truth is not None:
        devices.calibration = None
    return devices


def _expected(world: World, plan: CapturePlan, effects: str) -> dict[str, str]:
    """Decide on effects for the settings of a plan, and note what was decided."""
    if plan.settings != world.request.settings:
        world.request = replace(world.request, settings=plan.settings)
    return {"effects": describe(world.effect_plan(), effects).model_dump_json()}


def _device(name: str) -> str:
    """Where pictures are computed, told now if it is not there, not with the first picture of a scan."""
    try:
        return torch_device(name)
    except DecodeError as error:
        raise DeviceError(f"The twin cannot compute pictures on {name!r}. {error}") from error


def _taken_position_mm(scene: str, of_scene: dict[str, str]) -> float:
    """Where the stage stands by the options of the scene, which lose those that say so."""
    said = [name for name in ("depth_mm", *(STAGE_SAYS if scene == "stage" else ())) if name in of_scene]
    if len(said) > 1:
        raise PlanError(f"Options {' and '.join(said)} all say where the stage stands. Give one of them.")
    if said in ([], ["depth_mm"]):
        return number("depth_mm", of_scene.pop("depth_mm", "700"))
    (surface,) = make_scene("stage", **{said[0]: of_scene.pop(said[0])}).surfaces
    assert isinstance(surface, Rectangle)
    return float(surface.centre_mm[2])


def _true_rig(nominal: Rig, chosen: TwinOptions) -> Rig:
    """The rig that pictures are rendered with: what a calibration should find."""
    rig = nominal if chosen.truth is None else random_rig(chosen.truth, nominal)
    if chosen.led_cycle_hz:
        rig = rig.model_copy(update={"frame_period_ms": 1000.0 / chosen.led_cycle_hz})
    if chosen.sigma:
        noise_dn = np.hypot(rig.sensor.read_noise_dn, chosen.sigma * rig.sensor.full_scale_dn)
        rig = rig.model_copy(
            update={"sensor": rig.sensor.model_copy(update={"read_noise_dn": float(noise_dn)})}
        )
    if chosen.brightness != 1:
        rig = rig.model_copy(update={"white_scale": rig.white_scale * chosen.brightness})
    # What is true leaves nothing open in its columns.
    return rig.model_copy(update={"column_std_px": 0.0})


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
