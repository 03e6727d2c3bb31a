"""The simulated world: a rig, a scene on a stage, a clock, and what the projector shows right now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, Setting
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.led_cycle import led_weights
from dsl_core.optics.sensor import digitise
from dsl_core.simulation.effects.catalogue import EXTRAS, USUAL_CHOICE, Choice, with_effects
from dsl_core.simulation.effects.path import LightPath, View
from dsl_core.simulation.effects.planner import EffectPlan, plan_effects
from dsl_core.simulation.effects.tolerance import ONE_DN, Tolerance
from dsl_core.simulation.effects.view import make_view
from dsl_core.simulation.scenes.truth import Scene, SceneTruth
from dsl_core.solve.threads import one_kernel_thread

#: Largest delay between asking the camera for an exposure and its start, ms, where it matters.
JITTER_MS = 1.0
#: Light of a darkened room.
AMBIENT_DN_PER_MS = 0.002


@dataclass
class Clock:
    """Simulated time: waiting costs nothing unless ``sleep`` is a real one."""

    now_s: float = 0.0
    sleep: Callable[[float], None] = lambda seconds: None

    def wait(self, seconds: float) -> None:
        """Let time pass."""
        self.now_s += seconds
        self.sleep(seconds)


def _only(led: int) -> Callable[[NDArray[np.uint8]], NDArray[np.uint8]]:
    """Takes the other LEDs out of an image."""
    kept = (np.arange(3) == led).astype(np.uint8)
    return lambda image: image * kept


@dataclass
class World:
    """State shared by the simulated devices.

    ``scene_at`` gives the scene for a stage position (mm). ``filter`` stands before the camera. Noise depends
    only on the seed, on what stands where (``noise_key``), on the shot and the attempt, never on what was
    captured before, so that an interrupted scan continues bit for bit.

    ``effects`` says what of all that happens is rendered. Where the scene decides, pictures differ from those
    with everything by less than the ``tolerance``, for all patterns at the ``settings``; a brighter exposure
    adds its own setting.

    With ``led_cycle_ms`` the projector flashes its LEDs one after the other, running freely on the world's
    clock; None is steady light. Light of a dark projector is taken as steady.
    """

    rig: Rig
    scene_at: Callable[[float], Scene]
    position_mm: float = 700.0
    seed: int = 0
    noise: bool = True
    ambient_dn_per_ms: float = AMBIENT_DN_PER_MS
    film: bool = True
    filter: SpectralCurve | None = None
    led_cycle_ms: float | None = None
    defocus_px: float = 0.0
    noise_key: tuple[int, ...] = ()
    device: str = "cpu"
    effects: Choice = USUAL_CHOICE
    tolerance: Tolerance = ONE_DN
    settings: tuple[Setting, ...] = CapturePlan().settings
    clock: Clock = field(default_factory=Clock)
    image: NDArray[np.uint8] | None = None
    _scene: Scene | None = None
    _truth: SceneTruth | None = None
    _path: LightPath | None = None
    _bare: View | None = None
    _renderer: View | None = None
    _rates: dict[str, NDArray[np.float32]] = field(default_factory=dict)

    def show(self, image: NDArray[np.uint8]) -> None:
        """Change what the projector shows."""
        self.image, self._rates = image.copy(), {}

    def move_to(self, position_mm: float) -> None:
        """Move the stage; the scene changes with it."""
        if position_mm != self.position_mm:
            self.position_mm = position_mm
            self._forget()

    def place(self, scene_at: Callable[[float], Scene], position_mm: float) -> None:
        """Put another scene before the camera."""
        self.scene_at, self.position_mm = scene_at, position_mm
        self._forget()

    def insert(self, film: bool, filter: SpectralCurve | None) -> None:
        """Change what is in the beams; a new filter costs far less than a new film."""
        if film != self.film:
            self.film, self._path, self._bare = film, None, None
        self.filter, self._renderer, self._rates = filter, None, {}

    def _forget(self) -> None:
        self._scene, self._truth, self._path = None, None, None
        self._bare, self._renderer, self._rates = None, None, {}

    @property
    def scene(self) -> Scene:
        """What stands before the camera."""
        if self._scene is None:
            self._scene = self.scene_at(self.position_mm)
        return self._scene

    @property
    def truth(self) -> SceneTruth:
        """Depth, normals, materials and shadow of the scene as it stands."""
        if self._truth is None:
            self._truth = self.scene.render(self.rig.camera, self.rig.pose.projector_centre_mm)
        return self._truth

    def everything(self) -> LightPath:
        """All that happens to light before the scene as it stands."""
        return replace(self._usual(), extras=EXTRAS)

    def _usual(self) -> LightPath:
        """What the plain renderer has."""
        return LightPath(
            self.rig, self.scene, self.truth, self.film, self.device, led_cycle_ms=self.led_cycle_ms,
            ambient_dn_per_ms=self.ambient_dn_per_ms, defocus_px=self.defocus_px,
        )  # fmt: skip

    def effect_plan(self) -> EffectPlan:
        """Which effects are rendered of the scene as it stands, and why."""
        return plan_effects(self.everything(), self.tolerance, self.settings, self.effects.names)

    @property
    def path(self) -> LightPath:
        """What is rendered of the scene as it stands."""
        if self.effects == USUAL_CHOICE:
            return self._usual()
        if self._path is None:
            names = self.effects.names
            if names is None:
                names = self.effect_plan().names
            self._path = with_effects(self.everything(), names)
        return self._path

    @property
    def renderer(self) -> View:
        """Renderer of the scene as it stands."""
        if self._renderer is None:
            with one_kernel_thread():
                if self._bare is None:
                    self._bare = make_view(self.path)
                self._renderer = self._bare.through(self.filter) if self.filter else self._bare
        return self._renderer

    def rate(self) -> NDArray[np.float32]:
        """Expected signal of the camera for the pattern shown, DN per ms, shape (rows, columns)."""
        return self._rendered("all", lambda image: image)

    def _rendered(
        self, key: str, choose: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]
    ) -> NDArray[np.float32]:
        """Expected signal of a part of the pattern shown, ambient light included; kept until it changes."""
        if key not in self._rates:
            shape = (self.rig.projector.height_px, self.rig.projector.width_px, 3)
            image = (
                np.zeros(shape, np.uint8) if self.image is None else np.broadcast_to(self._colour(), shape)
            )
            with one_kernel_thread():
                rate = self.renderer.expected(choose(image)) + np.float32(self.path.ambient_dn_per_ms)
            if self.path.defocus_px:
                from scipy.ndimage import gaussian_filter

                rate = gaussian_filter(rate, self.path.defocus_px, mode="nearest")
            self._rates[key] = rate
        return self._rates[key]

    def _colour(self) -> NDArray[np.uint8]:
        assert self.image is not None
        return self.image if self.image.ndim == 3 else self.image[..., None]

    def _noise_key(self) -> tuple[int, ...]:
        """What stands where, once something was placed; a moved stage counts."""
        return (*self.noise_key, round(1000 * self.position_mm)) if self.noise_key else ()

    def _light(self, exposure_ms: float, jitter_ms: float) -> NDArray[np.float32]:
        """Expected signal of an exposure that starts now, DN per ms."""
        cycle_ms = self.path.led_cycle_ms
        if cycle_ms is None:
            return self.rate()
        weights = led_weights(1000 * self.clock.now_s + jitter_ms, exposure_ms, cycle_ms)
        if (weights == 1).all():
            return self.rate()
        dark = self._rendered("dark", np.zeros_like)
        light = dark.copy()
        for led, weight in enumerate(weights):
            light += np.float32(weight) * (self._rendered(f"LED {led}", _only(led)) - dark)
        return light

    def _allow_for(self, exposure_ms: float) -> None:
        """Decide anew on effects for an exposure that brings more light than those allowed for."""
        if self.effects.names is not None:
            return
        level = 0.0 if self.image is None else float(self.image.max()) / 255
        radiance = self.rig.projector_response.radiance
        brightest = max(s.exposure_ms * float(radiance(s.level)) for s in self.settings)
        longest = max(s.exposure_ms for s in self.settings)
        if exposure_ms > longest or exposure_ms * float(radiance(level)) > brightest:
            more = Setting(exposure_ms=exposure_ms, level=max(level, 1 / 255))
            self.settings = (*self.settings, more)
            self._path, self._bare, self._renderer, self._rates = None, None, None, {}

    def expose(self, exposure_ms: float, shot: int, attempt: int = 0) -> NDArray[np.uint16]:
        """Raw mosaic of one exposure."""
        self._allow_for(exposure_ms)
        rng = np.random.Generator(np.random.SFC64([self.seed, shot, attempt, *self._noise_key()]))
        jitter_ms = JITTER_MS * rng.random() if self.led_cycle_ms else 0.0
        signal = self._light(exposure_ms, jitter_ms) * np.float32(exposure_ms)
        return digitise(self.path.rig.sensor, signal, rng if self.noise else None)
