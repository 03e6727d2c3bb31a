"""Highlights: light that a glossy surface reflects without taking up its colour."""

from __future__ import annotations

from dataclasses import dataclass, replace

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
from dsl_core.simulation.effects.tolerance import EffectBound
from dsl_core.simulation.rendering.shading import surface_shading
from dsl_core.simulation.rendering.spectral_tables import NM
from dsl_core.simulation.scenes.truth import Finish, Materials, Parts

Floats = NDArray[np.float64]


class Specular(ExtraEffect):
    """The highlight of every glossy material by the GGX distribution of microfacets.

    ``D F G / (4 (n.l) (n.v))`` with Schlick's Fresnel term and Smith's masking (B. Walter et al., EGSR 2007),
    times pi to compare with a perfect diffuser. Light is taken to come from the projector's centre;
    diffracted light comes from the film up to 10 mm next to it, a small part of any highlight's width.
    """

    name = "specular"
    summary = "highlights of glossy surfaces"
    ns_per_pixel = 45.0

    def bound(self, limits: Limits) -> EffectBound:
        """The highlight of a white pattern."""
        if not glossy_materials(limits.path.truth.materials):
            return limits.of_dn(0.0, "no material is glossy")
        most = SLACK * (1 + limits.glare) * float(limits.specular.max())
        return limits.of_light(most, f"a white pattern's highlight is {most:.3g} DN/ms")

    def most_light(self, limits: Limits) -> Floats:
        """Highlights of a white pattern, the brightest colour, DN per ms, (rows * columns,)."""
        path = limits.path
        pixel, _, share = glossy_parts(path)
        white = limits.from_orders(np.ones((1, len(NM))), path.orders).max()
        shading = surface_shading(path.rig, path.truth, path.shaded).ravel()[pixel]
        light = np.bincount(pixel, shading * share * white, limits.pixel_count)
        return np.asarray(light, np.float64)

    def pixels_concerned(self, limits: Limits) -> int:
        """Those of glossy materials."""
        glossy = list(glossy_materials(limits.path.truth.materials))
        return int(np.isin(limits.path.truth.material, glossy).sum())

    def step(self, path: LightPath) -> ImageStep:
        """See `ExtraEffect`."""
        mirror = replace(path.truth, materials=Materials.of({"surface": np.ones(len(NM))}), mixed=None)
        parts = glossy_parts(path)
        return _SpecularStep(replace(path, truth=mirror).renderer(parts) if len(parts[0]) else None)


def glossy_materials(materials: Materials) -> dict[int, Finish]:
    """Finishes of the glossy materials by their index."""
    found = {i: materials.finishes.get(name, Finish()) for i, name in enumerate(materials.names)}
    return {i: finish for i, finish in found.items() if finish.gloss > 0}


def glossy_parts(path: LightPath) -> Parts:
    """Pixels with highlights; their reflectance relative to a perfect diffuser stands for the share."""
    pixel, material, share = path.truth.parts()
    points = (pixel_rays(path.rig.camera) * np.nan_to_num(path.truth.depth_mm)).reshape(3, -1)
    normals = path.truth.normals.reshape(3, -1)
    pixels, shares = [np.zeros(0, np.int64)], [np.zeros(0)]
    for index, finish in glossy_materials(path.truth.materials).items():
        mine = material == index
        at = pixel[mine]
        lobe = highlight(finish, points[:, at], normals[:, at], path.rig.pose.projector_centre_mm)
        pixels.append(at)
        shares.append(lobe * share[mine])
    found, shine = np.concatenate(pixels), np.concatenate(shares)
    return found, np.zeros(len(found), np.int32), shine


def highlight(finish: Finish, points_mm: Floats, normals: Floats, light_mm: Floats) -> Floats:
    """Reflectance of the surface relative to a perfect diffuser, seen from the origin; points (3, n)."""
    to_eye = -points_mm / np.linalg.norm(points_mm, axis=0)
    to_light = light_mm[:, None] - points_mm
    to_light /= np.linalg.norm(to_light, axis=0)
    half = to_eye + to_light
    half /= np.linalg.norm(half, axis=0)
    nl, nv, nh = ((normals * other).sum(0).clip(0, 1) for other in (to_light, to_eye, half))
    alpha_sq = finish.roughness**4
    facets = alpha_sq / (np.pi * (nh**2 * (alpha_sq - 1) + 1) ** 2)
    fresnel = finish.gloss + (1 - finish.gloss) * (1 - (to_eye * half).sum(0).clip(0, 1)) ** 5
    # Smith's masking over 4 (n.l) (n.v), in the form that stays finite at grazing angles.
    visible = 0.5 / np.maximum(
        nl * np.sqrt(alpha_sq + (1 - alpha_sq) * nv**2) + nv * np.sqrt(alpha_sq + (1 - alpha_sq) * nl**2),
        1e-6,
    )
    return np.asarray(np.pi * facets * fresnel * visible * (nl > 0))


@dataclass(frozen=True)
class _SpecularStep(ImageStep):
    shine: PatternView | None

    def apply(self, signal: Signal, image: Image) -> Signal:
        """See `ImageStep`."""
        if self.shine is None:
            return signal
        more = self.shine.expected(image)[None] if len(signal) == 1 else self.shine.planes(image)
        return signal + more

    def through(self, transmission: SpectralCurve | None) -> _SpecularStep:
        """See `ImageStep`."""
        return _SpecularStep(None if self.shine is None else self.shine.through(transmission))
