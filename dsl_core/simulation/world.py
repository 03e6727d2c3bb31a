"""The simulated world: devices before a scene on a stage, a clock, and what the projector shows right now."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import digitise
from dsl_core.simulation.effects.base import LightPath, PatternView
from dsl_core.simulation.effects.planner import EffectPlan
from dsl_core.simulation.effects.sensor import out_of_focus
from dsl_core.simulation.foreign.exposure import exposed
from dsl_core.simulation.foreign.lenses import truth_of_colours
from dsl_core.simulation.led_cycle import led_weights
from dsl_core.simulation.rendered_scene import EffectRequest, RenderedScene, SceneInView, Setup
from dsl_core.simulation.scenes.truth import Scene, SceneTruth
from dsl_core.solve.threads import one_kernel_thread

Value = TypeVar("Value")
#: Largest delay between asking the camera for an exposure and its start, ms, where it matters.
JITTER_MS = 1.0


class Kept(Generic[Value]):
    """The last value made, with what it was made from; made again when that is no longer the same.

    What it was made from is compared by identity: replace it rather than change it. The old value is released
    first, and all that is ``resting`` on it, so that two of a kind never fill the memory.
    """

    def __init__(self, *resting: Kept[Any]) -> None:
        self._resting = resting
        self._held: tuple[tuple[object, ...], Value] | None = None

    def of(self, made_from: tuple[object, ...], make: Callable[[], Value]) -> Value:
        """The value for what it is made from, by ``make`` if that is new."""
        held = self._held
        if held is not None and all(a is b for a, b in zip(held[0], made_from, strict=True)):
            return held[1]
        self._drop()
        value = make()
        self._held = (made_from, value)
        return value

    def _drop(self) -> None:
        self._held = None
        for each in self._resting:
            each._drop()


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

    def choose(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
        kept = np.zeros_like(image)
        kept[..., led] = image[..., led]
        return kept

    return choose


@dataclass
class World:
    """State shared by the simulated devices.

    ``scene_at`` gives the scene for a stage position (mm). Noise depends only on the seed, on what stands
    where (``noise_key``), on the shot and the attempt, never on what was captured before, so that an
    interrupted scan continues bit for bit.

    ``request`` says what of all that happens is rendered; an exposure in which effects may change more
    than in those of its settings adds a setting. Light of a dark projector is taken as steady, whatever the
    LEDs do.
    """

    setup: Setup
    scene_at: Callable[[float], Scene]
    position_mm: float = 700.0
    request: EffectRequest = field(default_factory=EffectRequest)
    seed: int = 0
    noise: bool = True
    noise_key: tuple[int, ...] = ()
    clock: Clock = field(default_factory=Clock)
    image: NDArray[np.uint8] | None = None

    def __post_init__(self) -> None:
        self._rates: Kept[dict[str, NDArray[np.float32]]] = Kept()
        self._view: Kept[PatternView] = Kept(self._rates)
        self._rendered: Kept[RenderedScene] = Kept(self._view)
        self._seen: Kept[SceneInView] = Kept(self._rendered)

    @property
    def rig(self) -> Rig:
        """The calibration of the devices: true as far as nothing about the setup is foreign."""
        return self.setup.rig

    def show(self, image: NDArray[np.uint8]) -> None:
        """Change what the projector shows."""
        self.image = image.copy()

    def place(self, scene_at: Callable[[float], Scene], position_mm: float) -> None:
        """Put another scene in front of the camera."""
        self.scene_at, self.position_mm = scene_at, position_mm

    def insert(self, film: bool, filter: SpectralCurve | None) -> None:
        """Change what is in the beams; a new filter costs far less than a new film."""
        self.setup = replace(self.setup, film=film, filter=filter)

    @property
    def _in_view(self) -> SceneInView:
        return self._seen.of(
            (self.scene_at, self.position_mm, self.rig),
            lambda: SceneInView(self.rig, self.scene_at(self.position_mm)),
        )

    @property
    def rendered(self) -> RenderedScene:
        """The scene as it stands, as it is rendered."""
        seen, setup = self._in_view, self.setup
        made_from = (
            seen, setup.film, setup.device, setup.ambient_dn_per_ms, setup.led_cycle_ms, setup.defocus_px,
            setup.foreign, self.request,
        )  # fmt: skip
        return self._rendered.of(made_from, lambda: RenderedScene(seen, setup, self.request))

    @property
    def scene(self) -> Scene:
        """What is in front of the camera."""
        return self._in_view.scene

    @property
    def truth(self) -> SceneTruth:
        """Depth, normals, materials and shadow of the scene as it stands."""
        return self._in_view.truth

    @property
    def truth_of_colours(self) -> SceneTruth:
        """The same as each pixel's own colour of the mosaic sees it, through lenses that may differ."""
        foreign = self.setup.foreign
        if foreign is None or not foreign.has("lateral-colour"):
            return self.truth
        return truth_of_colours(self.setup.true_rig, self.scene, foreign)

    def everything(self) -> LightPath:
        """All that happens to light before the scene as it stands."""
        return self.rendered.everything()

    def effect_plan(self, request: EffectRequest | None = None) -> EffectPlan:
        """Which effects are rendered of the scene as it stands, and why; or would be, for another request."""
        return self.rendered.effect_plan(request)

    @property
    def path(self) -> LightPath:
        """What is rendered of the scene as it stands."""
        return self.rendered.path

    @property
    def renderer(self) -> PatternView:
        """What the camera sees of any pattern on the scene as it stands, through the filter."""
        rendered, filter = self.rendered, self.setup.filter
        return self._view.of((rendered, filter), lambda: rendered.through(filter))

    def rate(self) -> NDArray[np.float32]:
        """Expected signal of the camera for the pattern shown, DN per ms, shape (rows, columns)."""
        return self._rate("all", lambda image: image)

    def _rate(
        self, key: str, choose: Callable[[NDArray[np.uint8]], NDArray[np.uint8]]
    ) -> NDArray[np.float32]:
        """Expected signal of a part of the pattern shown, ambient light included; kept until it changes."""
        renderer = self.renderer
        rates = self._rates.of((renderer, self.image), dict)
        if key not in rates:
            shape = (self.rig.projector.height_px, self.rig.projector.width_px, 3)
            image = (
                np.zeros(shape, np.uint8) if self.image is None else np.broadcast_to(self._colour(), shape)
            )
            shown, blur_px = choose(image), self.path.defocus_px
            with one_kernel_thread():
                if blur_px:
                    rate = out_of_focus(renderer, shown, blur_px, self.rig.sensor.bayer)
                else:
                    rate = renderer.expected(shown)
            rates[key] = rate + np.float32(self.path.ambient_dn_per_ms)
        return rates[key]

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
        dark = self._rate("dark", np.zeros_like)
        light = dark.copy()
        for led, weight in enumerate(weights):
            light += np.float32(weight) * (self._rate(f"LED {led}", _only(led)) - dark)
        return light

    def expose(self, exposure_ms: float, shot: int, attempt: int = 0) -> NDArray[np.uint16]:
        """Raw mosaic of one exposure."""
        level = 0.0 if self.image is None else float(self.image.max()) / 255
        self.request = self.request.allowing(exposure_ms, level, self.setup)
        rng = np.random.Generator(np.random.SFC64([self.seed, shot, attempt, *self._noise_key()]))
        jitter_ms = JITTER_MS * rng.random() if self.setup.led_cycle_ms else 0.0
        light = self._light(exposure_ms, jitter_ms)
        if self.setup.foreign is not None:
            light = exposed(
                self.setup.foreign, light, self.path.ambient_dn_per_ms, self.clock.now_s, exposure_ms
            )
        signal = light * np.float32(exposure_ms)
        return digitise(self.path.rig.sensor, signal, rng if self.noise else None)
