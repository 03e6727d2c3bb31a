"""What effects of the twin are made of: the path of light, what the camera sees of it, and its limits.

`LightPath` is what light goes through from the projector to the camera's numbers; an `Effect` is one thing
that happens to it, and leaving it out gives another path. `Limits` is the most light that a scene can send to
the camera, of which the bounds of effects are made: light is linear in the pattern and never negative, so no
pattern gives a pixel more than a white one gives it through all orders; and no effect that only moves light
about makes the brightest pixel brighter.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.base import Record
from dsl_core.model.plan import CapturePlan, Setting
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.sensor import bayer_channels, raw_variance
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.effects.cost import slowness
from dsl_core.simulation.effects.demand import Demand
from dsl_core.simulation.effects.tolerance import EffectBound
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.rendering.shading import surface_shading
from dsl_core.simulation.rendering.spectral_tables import NM, ORDERS
from dsl_core.simulation.scenes.truth import Parts, Scene, SceneTruth

if TYPE_CHECKING:
    # They import torch, which whoever only asks for a rig's options need not wait for.
    from dsl_core.simulation.foreign.renderer import ForeignRenderer
    from dsl_core.simulation.rendering.renderer import Renderer

Image = NDArray[np.uint8]
Signal = NDArray[np.float32]
Floats = NDArray[np.float64]


class PatternView(Protocol):
    """What the camera sees of any pattern, DN per ms above black, without ambient light."""

    def expected(self, image: Image) -> Signal:
        """Signal of the mosaic (rows, columns) for drive levels (height, width, 3) or (height, width)."""

    def planes(self, image: Image) -> Signal:
        """Signal as without a mosaic, (3, rows, columns)."""

    def through(self, transmission: SpectralCurve | None) -> PatternView:
        """The same view through a filter in front of the camera."""


class ImageStep(ABC):
    """What an effect does to a picture of the direct light."""

    @abstractmethod
    def apply(self, signal: Signal, image: Image) -> Signal:
        """The picture with the effect: the mosaic as (1, rows, columns), or (3, rows, columns) of colours."""

    def through(self, transmission: SpectralCurve | None) -> ImageStep:
        """The same behind a filter in front of the camera: itself where it only moves light about."""
        return self


@dataclass(frozen=True)
class LightPath:
    """A rig before a scene, with everything that is to be rendered.

    ``extras`` are the effects beyond the plain renderer, in the order in which light meets them. Leaving an
    effect out gives another path. With ``foreign`` variants ``rig`` is the true one.
    """

    rig: Rig
    scene: Scene
    truth: SceneTruth
    film: bool = True
    device: str = "cpu"
    orders: tuple[int, ...] = ORDERS
    shaded: bool = True
    ambient_dn_per_ms: float = 0.0
    led_cycle_ms: float | None = None
    defocus_px: float = 0.0
    extras: tuple[ExtraEffect, ...] = ()
    foreign: Foreign | None = None

    def extra(self, name: str) -> ExtraEffect | None:
        """An effect beyond the plain renderer, if the path has it."""
        return next((effect for effect in self.extras if effect.name == name), None)

    def with_value(self, name: str, value: object) -> LightPath:
        """The path with another value of ``shaded``, ``rig.sensor.bit_depth`` or the like."""
        changed: LightPath = _with_value(self, name, value)
        return changed

    def renderer(self, parts: Parts | None = None) -> Renderer:
        """The plain renderer, of all that the scene consists of or of some ``parts``."""
        from dsl_core.simulation.rendering.renderer import Renderer

        return Renderer(
            self.rig, self.truth, film=self.film, device=self.device, orders=self.orders, shaded=self.shaded,
            parts=parts,
        )  # fmt: skip

    def foreign_renderer(self) -> ForeignRenderer | None:
        """The renderer of foreign variants, which has no depth of field, if the path has any."""
        from dsl_core.simulation.foreign.renderer import ForeignRenderer

        if self.foreign is None:
            return None
        return ForeignRenderer(
            self.rig, self.scene, self.foreign, film=self.film, device=self.device, orders=self.orders,
            shaded=self.shaded,
        )  # fmt: skip


def _with_value(record: Any, name: str, value: object) -> Any:
    field, _, rest = name.partition(".")
    inner = _with_value(getattr(record, field), rest, value) if rest else value
    if isinstance(record, Record):
        return record.model_copy(update={field: inner})
    return replace(record, **{field: inner})


class Effect(ABC):
    """One thing that light or electronics do, which a scene may or may not call for.

    ``needed`` effects cannot be left out. A path without another has the values of ``ideal``, named as from
    the path (``rig.sensor.bit_depth``), unless the effect overrides `leave_out`. ``ns_per_pixel`` is the CPU
    time of a frame on the reference machine (see `slowness`) that grows with the image, ``ms_per_frame`` what
    does not.
    """

    name: str
    summary: str
    needed: ClassVar[bool] = False
    ideal: ClassVar[Mapping[str, object]] = MappingProxyType({})
    ns_per_pixel: ClassVar[float] = 0.0
    ms_per_frame: ClassVar[float] = 0.0

    @abstractmethod
    def bound(self, limits: Limits) -> EffectBound:
        """The most that leaving it out changes, whatever else is left out with it."""

    def leave_out(self, path: LightPath) -> LightPath:
        """The path without it."""
        for name, value in self.ideal.items():
            path = path.with_value(name, value)
        return path

    def needs_colours(self, path: LightPath) -> bool:
        """Whether it mixes neighbouring pixels, for which every pixel is rendered in three colours."""
        return False

    def cost_s(self, limits: Limits) -> float:
        """CPU seconds of a frame with a line that it takes, besides the rendering of further colours."""
        seconds = 1e-9 * self.ns_per_pixel * self.pixels_concerned(limits) + 1e-3 * self.ms_per_frame
        return seconds * slowness()

    def pixels_concerned(self, limits: Limits) -> int:
        """Pixels for which there is something to compute."""
        return limits.pixel_count


class ExtraEffect(Effect):
    """An effect beyond the plain renderer, which changes the picture by a step of its own."""

    @abstractmethod
    def step(self, path: LightPath) -> ImageStep:
        """Its rendering in a path."""

    def direct_light(self, path: LightPath) -> PatternView | None:
        """The direct light if the effect changes how it is rendered; None for the plain renderer's."""
        return None

    def most_light(self, limits: Limits) -> Floats:
        """The most light that it adds to the projector's, DN per ms, (rows * columns,)."""
        return np.zeros(limits.pixel_count)

    def amplification(self, path: LightPath) -> float:
        """Light that a place gets from others when all are lit evenly, relative to that light."""
        return 0.0

    @property
    def veil(self) -> float:
        """Share of the mean light that it gives every pixel."""
        return 0.0

    def leave_out(self, path: LightPath) -> LightPath:
        """The path without this step."""
        return replace(path, extras=tuple(extra for extra in path.extras if extra.name != self.name))


#: For what the renderer's tables add by rounding and interpolation.
SLACK = 1.02


class Limits:
    """The most light in a world where everything happens; ``settings`` are those of the plan."""

    def __init__(self, path: LightPath, settings: Sequence[Setting] = CapturePlan().settings) -> None:
        self.path = path
        self.settings = tuple(settings)

    @property
    def pixel_count(self) -> int:
        """Pixels of the camera."""
        return self.path.truth.depth_mm.size

    @cached_property
    def demand(self) -> Demand:
        """The longest exposure, and the most light of the projector in one."""
        return Demand.of(self.settings, self.path.rig.projector_response, self.path.led_cycle_ms)

    @cached_property
    def halo(self) -> float:
        """Light that the halo adds inside a wide white band, as a share of the zero order."""
        response = self.path.rig.projector_response
        return 2 * response.halo_peak_per_px * response.halo_decay_px if self.path.film else 0.0

    def white(self, reflectance: Floats, orders: Sequence[int]) -> Floats:
        """Signal of white through some orders at unit shading, DN per ms, (materials, channels)."""
        chain = np.zeros((3, len(NM)))
        for order in orders:
            chain += chain_response(self.path.rig, order, NM).sum(1)
        signal: Floats = reflectance @ chain.T
        return signal

    def from_orders(self, reflectance: Floats, orders: Sequence[int]) -> Floats:
        """The same with the halo of the zero order, which is always there."""
        orders = orders if self.path.film else ()
        direct = (1 + self.halo) * self.white(reflectance, (0,))
        return np.asarray(direct + self.white(reflectance, orders))

    def share(self, light: Floats, reflectance: Floats) -> float:
        """Largest share of some light in all of it; where materials and colours are black, there is none."""
        total = self.from_orders(reflectance, self.path.orders)
        return float(np.divide(light, total, out=np.zeros_like(total), where=total > 0).max(initial=0.0))

    @cached_property
    def table(self) -> Floats:
        """Brightest colour of every material at unit shading, DN per ms, (materials,)."""
        signal = self.from_orders(self.path.truth.materials.at(NM), self.path.orders)
        return np.asarray(signal.max(1), np.float64)

    @cached_property
    def brightest(self) -> float:
        """Signal of the brightest material, facing the projector at the reference distance, DN per ms."""
        gain = 1.0 if self.path.rig.flat_field is None else float(np.max(self.path.rig.flat_field.gain))
        return float(self.table[np.unique(self.path.truth.parts()[1])].max(initial=0.0)) * gain

    def per_pixel(self, shading: Floats) -> Floats:
        """Direct light for a shading, the brightest colour, DN per ms, (rows * columns,)."""
        pixel, material, share = self.path.truth.parts()
        light = shading.ravel()[pixel] * share * self.table[material]
        return np.asarray(np.bincount(pixel, light, shading.size), np.float64)

    @cached_property
    def direct(self) -> Floats:
        """Direct light, DN per ms, (rows * columns,)."""
        return self.per_pixel(surface_shading(self.path.rig, self.path.truth, self.path.shaded))

    @cached_property
    def indirect(self) -> Floats:
        """Light that other surfaces send, DN per ms, (rows * columns,)."""
        effect = self.path.extra("interreflection")
        if effect is None:
            return np.zeros(self.pixel_count)
        return effect.most_light(self)

    @cached_property
    def amplification(self) -> float:
        """Factor by which reflections among surfaces and glare raise the largest change of direct light."""
        effect = self.path.extra("interreflection")
        bounced = 0.0 if effect is None else effect.amplification(self.path)
        return (1 + bounced) * (1 + self.glare)

    @cached_property
    def specular(self) -> Floats:
        """Light of highlights, DN per ms, (rows * columns,)."""
        effect = self.path.extra("specular")
        return np.zeros(self.pixel_count) if effect is None else effect.most_light(self)

    @property
    def glare(self) -> float:
        """Share of the mean light that every pixel gets."""
        effect = self.path.extra("glare")
        return 0.0 if effect is None else effect.veil

    @cached_property
    def total(self) -> Floats:
        """Light of all kinds without glare, DN per ms, (rows * columns,)."""
        return self.direct + self.indirect + self.specular

    @cached_property
    def ceiling(self) -> float:
        """The brightest pixel with all light, DN per ms; nothing exceeds it in any pixel."""
        return SLACK * (1 + self.glare) * float(self.total.max(initial=0.0))

    @cached_property
    def most_dn(self) -> float:
        """The brightest signal that an exposure can expect, the room's light included, DN above black."""
        room_dn = self.path.ambient_dn_per_ms * self.demand.exposure_ms
        return self.ceiling * self.demand.light_ms + room_dn

    @cached_property
    def floor_dn(self) -> float:
        """Noise of a pixel without light, DN."""
        return float(np.sqrt(raw_variance(self.path.rig.sensor, np.zeros(1))[0]))

    def of_dn(self, dn: float, reason: str) -> EffectBound:
        """A bound in counts; no picture has more than the sensor's full scale."""
        dn = min(dn, float(self.path.rig.sensor.full_scale_dn))
        return EffectBound(dn, dn / self.floor_dn, reason)

    def of_light(self, dn_per_ms: float, reason: str) -> EffectBound:
        """A bound from the signal of white at full drive."""
        return self.of_dn(dn_per_ms * self.demand.light_ms, reason)

    def of_share(self, share: float, reason: str) -> EffectBound:
        """A bound as a share of the brightest pixel."""
        return self.of_light(min(share, 1.0) * self.ceiling, reason)


def make_view(path: LightPath) -> PatternView:
    """What the camera sees in a path."""
    own = (light for extra in path.extras if (light := extra.direct_light(path)))
    direct: PatternView = path.foreign_renderer() or next(own, None) or path.renderer()
    if not path.extras:
        return direct
    mosaic = bayer_channels(path.rig.sensor.bayer, *path.truth.depth_mm.shape)
    steps = tuple(extra.step(path) for extra in path.extras)
    return ProcessedView(direct, steps, mosaic, any(extra.needs_colours(path) for extra in path.extras))


@dataclass(frozen=True)
class ProcessedView:
    """Direct light that goes through steps; in all ``colours`` where light of neighbours is mixed."""

    direct: PatternView
    steps: tuple[ImageStep, ...]
    mosaic: NDArray[np.int64]
    colours: bool

    def expected(self, image: Image) -> Signal:
        """See `PatternView`."""
        if self.colours:
            return np.asarray(np.take_along_axis(self.planes(image), self.mosaic[None], 0)[0])
        return np.asarray(self._processed(self.direct.expected(image)[None], image)[0])

    def planes(self, image: Image) -> Signal:
        """See `PatternView`."""
        return self._processed(self.direct.planes(image), image)

    def _processed(self, signal: Signal, image: Image) -> Signal:
        for step in self.steps:
            signal = step.apply(signal, image)
        return signal

    def through(self, transmission: SpectralCurve | None) -> ProcessedView:
        """See `PatternView`."""
        steps = tuple(step.through(transmission) for step in self.steps)
        return ProcessedView(self.direct.through(transmission), steps, self.mosaic, self.colours)
