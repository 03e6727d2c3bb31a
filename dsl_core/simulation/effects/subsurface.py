"""Subsurface scattering: light that leaves a translucent material next to where it entered."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.simulation.effects.base import SLACK, ExtraEffect, Image, ImageStep, LightPath, Limits, Signal
from dsl_core.simulation.effects.tolerance import EffectBound
from dsl_core.simulation.scenes.truth import Finish, Materials

Floats = NDArray[np.float64]
#: Light that wanders farther than 99.9 % of it, or than this, is taken to leave nearer, px.
_TAIL, _FARTHEST_PX = 1e-3, 128
#: Radius of a disc of one pixel's area.
_PIXEL_RADIUS = 1 / math.sqrt(math.pi)


class Subsurface(ExtraEffect):
    """Each translucent material's light is spread over it by Burley's normalised diffusion profile.

    ``(exp(-r/d) + exp(-r/3d)) / (8 pi d r)`` (P. H. Christensen, B. Burley, 2015), one length d a colour, at
    the scale of the material's median depth, within the material's own pixels: even light stays as it is.
    """

    name = "subsurface"
    summary = "light that spreads inside translucent materials"
    ns_per_pixel = 110.0

    def bound(self, limits: Limits) -> EffectBound:
        """Light that leaves through other pixels than it entered, of the most there is."""
        if not translucent(limits.path.truth.materials):
            return limits.of_dn(0.0, "no material is translucent")
        spreads = [spread for _, of_colours in _spreads_px(limits.path) for spread in of_colours]
        leaves = max((1 - stays(spread) for spread in spreads), default=0.0)
        reason = f"{100 * leaves:.2g} % of a pixel's light may come from its neighbours"
        light = float((limits.direct + limits.indirect).max())
        return limits.of_light(SLACK * leaves * light * (1 + limits.glare), reason)

    def needs_colours(self, path: LightPath) -> bool:
        """Where there is anything translucent."""
        return bool(_spreads_px(path))

    def pixels_concerned(self, limits: Limits) -> int:
        """Those of translucent materials."""
        clear = list(translucent(limits.path.truth.materials))
        return int(np.isin(limits.path.truth.material, clear).sum())

    def step(self, path: LightPath) -> ImageStep:
        """See `ExtraEffect`."""
        return _SubsurfaceStep(
            tuple(
                _Region.of(path.truth.material == index, of_colours)
                for index, of_colours in _spreads_px(path)
            )
        )


def translucent(materials: Materials) -> dict[int, Finish]:
    """Finishes of the translucent materials by their index."""
    found = {i: materials.finishes.get(name, Finish()) for i, name in enumerate(materials.names)}
    return {i: finish for i, finish in found.items() if max(finish.spread_mm) > 0}


def _spreads_px(path: LightPath) -> list[tuple[int, tuple[float, ...]]]:
    """Length d of each translucent material in view for each colour, px."""
    found = []
    for index, finish in translucent(path.truth.materials).items():
        depth = path.truth.depth_mm[path.truth.material == index]
        if len(depth):
            px_per_mm = path.rig.camera.fx_px / float(np.median(depth))
            found.append((index, tuple(spread * px_per_mm for spread in finish.spread_mm)))
    return found


def within(radius_px: float, spread_px: float) -> float:
    """Share of the light that leaves within a distance of where it entered."""
    if spread_px == 0:
        return 1.0
    return 1 - 0.25 * math.exp(-radius_px / spread_px) - 0.75 * math.exp(-radius_px / (3 * spread_px))


def stays(spread_px: float) -> float:
    """Share of the light that leaves through the pixel where it entered, at least."""
    return within(_PIXEL_RADIUS, spread_px)


def profile(spread_px: float) -> Floats:
    """Share of a pixel's light that leaves through each pixel around it, odd square, sum 1."""
    radius = 0
    while radius < _FARTHEST_PX and within(radius + _PIXEL_RADIUS, spread_px) < 1 - _TAIL:
        radius += 1
    if radius == 0:
        return np.ones((1, 1))
    x = np.arange(-radius, radius + 1, dtype=np.float64)
    r = np.hypot(x, x[:, None])
    r[radius, radius] = 1.0
    weights = (np.exp(-r / spread_px) + np.exp(-r / (3 * spread_px))) / r
    weights[radius, radius] = 0.0
    weights *= (1 - stays(spread_px)) / weights.sum()
    weights[radius, radius] = stays(spread_px)
    return np.asarray(weights)


@dataclass(frozen=True)
class _Region:
    """One translucent material: the window that holds it, its pixels there, profiles and their sums."""

    window: tuple[slice, slice]
    inside: NDArray[np.bool_]
    profiles: tuple[Floats, ...]
    sums: tuple[Floats, ...]

    @classmethod
    def of(cls, mask: NDArray[np.bool_], spreads_px: tuple[float, ...]) -> _Region:
        """The region of a mask (rows, columns)."""
        from scipy.signal import fftconvolve

        rows, columns = (np.flatnonzero(mask.any(axis)) for axis in (1, 0))
        window = (slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1))
        inside = mask[window]
        profiles = tuple(profile(spread) for spread in spreads_px)
        sums = tuple(fftconvolve(inside.astype(float), one, "same") for one in profiles)
        return cls(window, inside, profiles, sums)

    def spread(self, plane: Signal, colour: int) -> Signal:
        """One colour with the light of this material spread, (rows, columns)."""
        from scipy.signal import fftconvolve

        profile = self.profiles[colour]
        if profile.size == 1:
            return plane
        light = np.where(self.inside, plane[self.window], 0.0)
        # Rounding of the transform must not turn darkness negative.
        moved = fftconvolve(light, profile, "same").clip(min=0)
        result = plane.copy()
        result[self.window][self.inside] = (moved / self.sums[colour].clip(min=1e-9))[self.inside]
        return result


@dataclass(frozen=True)
class _SubsurfaceStep(ImageStep):
    regions: tuple[_Region, ...]

    def apply(self, signal: Signal, image: Image) -> Signal:
        """See `ImageStep`."""
        planes = list(signal)
        for region in self.regions:
            planes = [region.spread(plane, colour) for colour, plane in enumerate(planes)]
        return np.stack(planes)
