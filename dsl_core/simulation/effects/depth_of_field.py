"""Depth of field: camera and projector are sharp at one depth only."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.effects.base import (
    SLACK,
    ExtraEffect,
    Image,
    ImageStep,
    LightPath,
    Limits,
    PatternView,
    Signal,
)
from dsl_core.simulation.effects.cost import PLAIN_MS, PLAIN_NS, slowness
from dsl_core.simulation.effects.tolerance import EffectBound
from dsl_core.simulation.scenes.truth import Parts

Floats = NDArray[np.float64]
#: Blurs are rendered in steps of this standard deviation, px, and mixed between.
STEP_PX = 0.25
#: Standard deviation of a uniform disc along an axis, as a share of its diameter.
_DISC = 0.25


class Blurs(NamedTuple):
    """Standard deviation of the defocus at every pixel, (rows, columns), in the device's own pixels."""

    camera_px: Floats
    projector_px: Floats


@dataclass(frozen=True)
class DepthOfField(ExtraEffect):
    """A circle of confusion ``aperture focal_px |1/z - 1/focus|`` in both lenses, as a Gaussian.

    The Gaussian has the disc's variance. Both lenses are focused on the median depth of what they see; their
    apertures are those of a 12 mm lens at f/4 and of a small projector.
    """

    camera_aperture_mm: float = 3.0
    projector_aperture_mm: float = 3.5

    name = "depth-of-field"
    summary = "defocus of camera and projector away from the scene's median depth"
    ns_per_pixel = 4.0

    def bound(self, limits: Limits) -> EffectBound:
        """The largest change of a pattern's edge by the projector, and a pixel's light by the camera."""
        blurs = self.blurs(limits.path)
        sharp = limits.path.rig.projector_response.blur_px
        share = gaussian_distance(sharp, math.hypot(sharp, float(blurs.projector_px.max())))
        share += 1 - _CameraStep.of(blurs.camera_px).kept()
        widest = float(blurs.camera_px.max()) / _DISC
        reason = (
            f"circles of confusion reach {widest:.2g} px" if share else "everything in view is at one depth"
        )
        return limits.of_share(SLACK * share, reason)

    def needs_colours(self, path: LightPath) -> bool:
        """Where the camera mixes pixels at all."""
        return _CameraStep.of(self.blurs(path).camera_px).kept() < 1

    def blurs(self, path: LightPath) -> Blurs:
        """Defocus at every pixel; none where there is no surface."""
        depth = path.truth.depth_mm
        points = pixel_rays(path.rig.camera) * np.nan_to_num(depth, nan=1.0)
        axis = path.rig.pose.matrix[2]
        to_projector = np.where(
            np.isfinite(depth),
            np.tensordot(axis, points, 1) + path.rig.pose.translation_mm[2],
            np.nan,
        )
        return Blurs(
            _blur(depth, self.camera_aperture_mm * path.rig.camera.fx_px),
            _blur(to_projector, self.projector_aperture_mm * path.rig.projector.fx_px),
        )

    def direct_light(self, path: LightPath) -> PatternView:
        """See `ExtraEffect`: the direct light of a projector that is out of focus here and there."""
        levels, weights = layers(self.blurs(path).projector_px)
        views = []
        for level, weight in zip(levels, weights, strict=True):
            blurred = path.with_value("rig.projector_response", path.rig.projector_response.blurred(level))
            views.append(blurred.renderer(_parts_in(path, weight > 0)))
        return LayeredView(tuple(views), tuple(weights))

    def step(self, path: LightPath) -> ImageStep:
        """See `ExtraEffect`: what the camera makes of it."""
        return _CameraStep.of(self.blurs(path).camera_px)

    def cost_s(self, limits: Limits) -> float:
        """That of pixels which are rendered with two blurs, and of blurring the picture."""
        blurs = self.blurs(limits.path)
        _, weights = layers(blurs.projector_px)
        twice = sum(int((weight > 0).sum()) for weight in weights) - limits.pixel_count
        pictures = len(layers(blurs.camera_px)[0])
        colours = 3 if self.needs_colours(limits.path) else 1
        ns = PLAIN_NS * twice + self.ns_per_pixel * pictures * limits.pixel_count
        return colours * (1e-9 * ns + 1e-3 * PLAIN_MS * (len(weights) - 1)) * slowness()


def _blur(depth_mm: Floats, scale: float) -> Floats:
    """Standard deviation (px) at a depth; ``scale`` is aperture (mm) times focal length (px)."""
    known = depth_mm[np.isfinite(depth_mm)]
    if not len(known):
        return np.zeros(depth_mm.shape)
    circle = scale * np.abs(1 / depth_mm - 1 / float(np.median(known)))
    # Depths of a plane that differ by rounding are not defocus.
    return np.asarray(np.where(circle > 1e-9, _DISC * np.nan_to_num(circle), 0.0))


def layers(sigma_px: Floats) -> tuple[list[float], list[NDArray[np.float32]]]:
    """Blurs to render, and at every pixel the weights by which they are mixed; the first is 0.

    Mixed are neighbouring blurs, so that the variance is that of the pixel.
    """
    count = math.ceil(float(sigma_px.max(initial=0.0)) / STEP_PX)
    steps = sigma_px / STEP_PX
    whole = np.minimum(np.floor(steps), max(count - 1, 0))
    share = (steps**2 - whole**2) / (2 * whole + 1)
    weights = [np.where(whole == k, 1 - share, np.where(whole == k - 1, share, 0)) for k in range(count + 1)]
    return [k * STEP_PX for k in range(count + 1)], [weight.astype(np.float32) for weight in weights]


def gaussian_distance(narrow_px: float, wide_px: float) -> float:
    """The most by which two Gaussian blurs of any picture of 0 to 1 differ: half the area between them."""
    if wide_px <= narrow_px:
        return 0.0
    ratio = wide_px / narrow_px
    crossing = narrow_px * math.sqrt(2 * math.log(ratio) / (1 - 1 / ratio**2))
    inner, outer = (math.erf(crossing / (math.sqrt(2) * sigma)) for sigma in (narrow_px, wide_px))
    return inner - outer


def _parts_in(path: LightPath, mask: NDArray[np.bool_]) -> Parts:
    pixel, material, share = path.truth.parts()
    inside = mask.ravel()[pixel]
    return pixel[inside], material[inside], share[inside]


@dataclass(frozen=True)
class LayeredView:
    """Views that are mixed by weights at every pixel."""

    views: tuple[PatternView, ...]
    weights: tuple[NDArray[np.float32], ...]

    def expected(self, image: Image) -> Signal:
        """See `PatternView`."""
        return np.asarray(sum(w * v.expected(image) for v, w in zip(self.views, self.weights, strict=True)))

    def planes(self, image: Image) -> Signal:
        """See `PatternView`."""
        return np.asarray(sum(w * v.planes(image) for v, w in zip(self.views, self.weights, strict=True)))

    def through(self, transmission: SpectralCurve | None) -> LayeredView:
        """See `PatternView`."""
        return LayeredView(tuple(view.through(transmission) for view in self.views), self.weights)


@dataclass(frozen=True)
class _CameraStep(ImageStep):
    """Each layer's light is blurred by its own Gaussian; where layers meet, their shares are made one."""

    sigmas_px: tuple[float, ...]
    weights: tuple[NDArray[np.float32], ...]
    shares: NDArray[np.float32]

    @classmethod
    def of(cls, sigma_px: Floats) -> _CameraStep:
        """The step of a map of blurs."""
        sigmas, weights = layers(sigma_px)
        shares = sum(_gaussian(w, s) for s, w in zip(sigmas, weights, strict=True))
        return cls(tuple(sigmas), tuple(weights), np.asarray(shares, np.float32))

    def apply(self, signal: Signal, image: Image) -> Signal:
        """See `ImageStep`."""
        return np.stack([self._blurred(plane) for plane in signal])

    def _blurred(self, plane: Signal) -> Signal:
        layers = zip(self.sigmas_px, self.weights, strict=True)
        return np.asarray(sum(_gaussian(w * plane, s) for s, w in layers) / self.shares)

    def kept(self) -> float:
        """Share of its own light that every pixel keeps, at least."""
        own = [_centre(sigma) * w for sigma, w in zip(self.sigmas_px, self.weights, strict=True)]
        return float((sum(own) / self.shares).min())


def _gaussian(plane: NDArray[np.float32], sigma_px: float) -> NDArray[np.float32]:
    from scipy.ndimage import gaussian_filter

    return np.asarray(gaussian_filter(plane, sigma_px, mode="nearest")) if sigma_px else plane


def _centre(sigma_px: float) -> float:
    """What a pixel keeps of its own light under `_gaussian`."""
    spot = np.zeros((65, 65), np.float32)
    spot[32, 32] = 1.0
    return float(_gaussian(spot, sigma_px)[32, 32])
