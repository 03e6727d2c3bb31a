"""The most light that a scene can send to the camera: what the bounds of effects are made of.

Light is linear in the pattern and never negative, so no pattern gives a pixel more than a white one gives it
through all orders; and no effect that only moves light about makes the brightest pixel brighter.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan, Setting
from dsl_core.optics.sensor import raw_variance
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.effects.bound import EffectBound
from dsl_core.simulation.effects.path import LightPath
from dsl_core.simulation.rendering.spectral_tables import NM
from dsl_core.simulation.rendering.surface_light import surface_shading

Floats = NDArray[np.float64]
#: For what the renderer's tables add by rounding and interpolation.
SLACK = 1.02


class AddsLight(Protocol):
    """An effect that adds light to what pixels get from the projector."""

    def most(self, limits: Limits) -> Floats:
        """The most light that it adds, DN per ms, (rows * columns,)."""


class Exchanges(AddsLight, Protocol):
    """One that adds light from other surfaces."""

    def amplification(self, path: LightPath) -> float:
        """Light that a place gets from others when all are lit evenly, relative to that light."""


class Spreads(Protocol):
    """One that gives every pixel a share of the mean light."""

    @property
    def share(self) -> float:
        """That share."""


class Limits:
    """The most light in a world where everything happens; ``settings`` are those of the plan."""

    def __init__(self, path: LightPath, settings: Sequence[Setting] = CapturePlan().settings) -> None:
        self.path = path
        self.settings = tuple(settings)

    @property
    def pixel_count(self) -> int:
        """Pixels of the camera."""
        return self.path.truth.depth_mm.size

    @property
    def exposure_ms(self) -> float:
        """The longest exposure."""
        return max(setting.exposure_ms for setting in self.settings)

    @property
    def light_ms(self) -> float:
        """The most light of the projector in an exposure, ms of full drive."""
        response = self.path.rig.projector_response
        return max(s.exposure_ms * float(response.radiance(s.level)) for s in self.settings)

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
        return cast(AddsLight, effect).most(self)

    @cached_property
    def amplification(self) -> float:
        """Factor by which reflections among surfaces and glare raise the largest change of direct light."""
        effect = self.path.extra("interreflection")
        bounced = 0.0 if effect is None else cast(Exchanges, effect).amplification(self.path)
        return (1 + bounced) * (1 + self.glare)

    @cached_property
    def specular(self) -> Floats:
        """Light of highlights, DN per ms, (rows * columns,)."""
        effect = self.path.extra("specular")
        return np.zeros(self.pixel_count) if effect is None else cast(AddsLight, effect).most(self)

    @property
    def glare(self) -> float:
        """Share of the mean light that every pixel gets."""
        effect = self.path.extra("glare")
        return 0.0 if effect is None else cast(Spreads, effect).share

    @cached_property
    def total(self) -> Floats:
        """Light of all kinds without glare, DN per ms, (rows * columns,)."""
        return self.direct + self.indirect + self.specular

    @cached_property
    def ceiling(self) -> float:
        """The brightest pixel with all light, DN per ms; nothing exceeds it in any pixel."""
        return SLACK * (1 + self.glare) * float(self.total.max(initial=0.0))

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
        return self.of_dn(dn_per_ms * self.light_ms, reason)

    def of_share(self, share: float, reason: str) -> EffectBound:
        """A bound as a share of the brightest pixel."""
        return self.of_light(min(share, 1.0) * self.ceiling, reason)
