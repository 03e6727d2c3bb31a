"""What a scene is, and what is known of it: palettes of materials, and maps seen by one camera."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from dsl_core.errors import PlanError
from dsl_core.model.geometry import Lens
from dsl_core.model.spectral import band_weights, band_widths_nm
from dsl_core.optics.pinhole import pixel_rays, rays_at
from dsl_core.simulation.scenes.surfaces import Shape, materials_along, trace

#: Fine grid of all palettes, nm: 400 to 700 in steps of 1, shape (301,).
FINE_NM: NDArray[np.float64] = np.arange(400.0, 701.0)
FINE_NM.setflags(write=False)

#: The published camera's optical centre is not in the middle of its image; at 700 mm it is off by this much.
IMAGE_CENTRE_MM = (6.0, -2.0)
#: What light comes from: pixel, material and share of the pixel, each (n,).
Parts = tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float64]]

#: Rays into a pixel on an edge, which tell the shares of its two materials.
EDGE_RAYS = 256
#: Pixels whose rays are followed together: few enough that they stay in the processor's cache.
EDGES_AT_ONCE = 64


@dataclass(frozen=True)
class Finish:
    """Gloss and translucency of a material; the defaults are matte and opaque.

    ``gloss`` is the reflectance of its surface at normal incidence (0.04 for a refractive index of 1.5),
    ``roughness`` the width of the highlight, 0..1, whose square is the alpha of the GGX distribution.
    ``spread_mm`` says how far red, green and blue light wander inside before they leave: the length d of
    Burley's diffusion profile, whose mean distance is 2.5 d.
    """

    gloss: float = 0.0
    roughness: float = 0.3
    spread_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)


#: Skin: diffuse mean free paths of 3.67, 1.37 and 0.68 mm (H. W. Jensen, J. Buhler, SIGGRAPH 2002, "skin 1")
#: by 3.5 (P. H. Christensen, B. Burley, Approximate Reflectance Profiles, 2015); oily sheen of index 1.4.
SKIN = Finish(gloss=0.028, roughness=0.5, spread_mm=(1.05, 0.39, 0.19))
#: Paraffin wax, index 1.43; its spread is an assumption between skin and marble.
WAX = Finish(gloss=0.031, roughness=0.45, spread_mm=(2.0, 1.6, 1.2))


@dataclass(frozen=True)
class Materials:
    """A palette of reflectance spectra on the Spectralon scale.

    ``wavelengths_nm`` has shape (L,), ``reflectance`` shape (M, L), 0..1, one row per name.
    ``surroundings`` names the materials that are in view but not what the scene is about; ``finishes`` says
    which materials are glossy or translucent, by name. All others are matte and opaque.
    """

    names: tuple[str, ...]
    wavelengths_nm: NDArray[np.float64]
    reflectance: NDArray[np.float64]
    surroundings: tuple[str, ...] = ()
    finishes: Mapping[str, Finish] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        spectra: dict[str, NDArray[np.float64]],
        surroundings: tuple[str, ...] = (),
        finishes: Mapping[str, Finish] | None = None,
    ) -> Materials:
        """Make a palette from named spectra on the fine grid, in the order of the dictionary."""
        return cls(tuple(spectra), FINE_NM, np.stack(list(spectra.values())), surroundings, finishes or {})

    @property
    def targets(self) -> tuple[int, ...]:
        """Indices of the materials that the scene is about."""
        return tuple(i for i, name in enumerate(self.names) if name not in self.surroundings)

    def at(self, wavelengths_nm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Reflectance at other wavelengths (nm), linear between samples, shape (M, bands)."""
        rows = [np.interp(wavelengths_nm, self.wavelengths_nm, row) for row in self.reflectance]
        return np.stack(rows)

    def over_bands(self, bands_nm: NDArray[np.float64], width_nm: float | None = None) -> NDArray[np.float64]:
        """Mean reflectance over the triangle of each band, shape (M, bands); as `at` beyond the palette.

        ``width_nm`` is how wide bands are at half height; as far as they are apart, unless it is known.
        """
        weights = band_weights(self.wavelengths_nm, bands_nm, band_widths_nm(bands_nm, width_nm))
        means = self.reflectance @ weights.T
        return np.where(np.isfinite(means), means, self.at(bands_nm))


@dataclass(frozen=True)
class MixedPixels:
    """Pixels on an edge: flat indices, their second material and its share (below or at one half), (n,)."""

    pixels: NDArray[np.int64]
    material: NDArray[np.int32]
    share: NDArray[np.float64]


@dataclass(frozen=True)
class SceneTruth:
    """A scene seen by one camera; h and w are the camera's rows and columns.

    ``depth_mm`` (h, w) along the camera axis, NaN where there is no surface; ``normals`` (3, h, w), unit,
    camera coordinates, towards the camera, NaN where there is no surface; ``material`` (h, w), index into
    ``materials``, -1 where there is no surface; ``lit`` (h, w): the projector's centre sees the point.
    ``mixed`` are pixels of two materials, both at the pixel's one depth; `material` holds the larger one.
    """

    depth_mm: NDArray[np.float64]
    normals: NDArray[np.float64]
    material: NDArray[np.int32]
    materials: Materials
    lit: NDArray[np.bool_]
    mixed: MixedPixels | None = None

    def parts(self) -> Parts:
        """What light comes from: pixel, material and share of the pixel, (n,); mixed pixels come twice."""
        solid = np.flatnonzero(np.isfinite(self.depth_mm) & (self.material >= 0))
        material, share = self.material.ravel()[solid], np.ones(self.depth_mm.size)
        if self.mixed is None:
            return solid, material, share[solid]
        share[self.mixed.pixels] -= self.mixed.share
        return (
            np.concatenate([solid, self.mixed.pixels]),
            np.concatenate([material, self.mixed.material]),
            np.concatenate([share[solid], self.mixed.share]),
        )

    def reflectance(self, wavelengths_nm: NDArray[np.float64]) -> NDArray[np.float32]:
        """Reflectance cube, shape (bands, h, w), NaN where there is no surface."""
        table = self.materials.at(wavelengths_nm).astype(np.float32)
        # A last column of NaN is what index -1 picks.
        table = np.concatenate([table, np.full((1, table.shape[1]), np.nan, np.float32)])
        return np.ascontiguousarray(table.T)[:, self.material]


@dataclass(frozen=True)
class Scene:
    """Surfaces in camera coordinates (mm) and the palette they are painted with.

    With ``mixed_edges`` a pixel on an edge takes a share of both its materials, as where edges are measured
    below one pixel; without, it is all of the material in its middle.
    """

    name: str
    description: str
    surfaces: tuple[Shape, ...]
    materials: Materials
    mixed_edges: bool = False

    def render(self, camera: Lens, projector_centre_mm: NDArray[np.float64]) -> SceneTruth:
        """The truth at every pixel of a camera, lens distortion included; centre in camera mm, shape (3,)."""
        shape = (camera.height_px, camera.width_px)
        centre = np.asarray(projector_centre_mm, np.float64)
        hits = trace(self.surfaces, pixel_rays(camera).reshape(3, -1), centre)
        material = hits.material.reshape(shape)
        mixed = self._mixed(camera, material) if self.mixed_edges else None
        return SceneTruth(
            depth_mm=hits.depth_mm.reshape(shape),
            normals=hits.normals.reshape(3, *shape),
            material=material,
            materials=self.materials,
            lit=hits.lit.reshape(shape),
            mixed=mixed,
        )

    def _mixed(self, camera: Lens, material: NDArray[np.int32]) -> MixedPixels:
        """Shares of two materials at pixels next to others; writes the larger one into ``material``."""
        edges = np.flatnonzero(_next_to_others(material))
        row, column = np.divmod(edges, camera.width_px)
        across, down = _spots(EDGE_RAYS)
        counts = np.zeros((len(edges), len(self.materials.names)), np.int64)
        for start in range(0, len(edges), EDGES_AT_ONCE):
            some = slice(start, start + EDGES_AT_ONCE)
            rays = rays_at(camera, column[some, None] + across, row[some, None] + down)
            seen = materials_along(self.surfaces, rays.reshape(3, -1)).reshape(-1, EDGE_RAYS)
            for index in range(counts.shape[1]):
                counts[some, index] = (seen == index).sum(1)
        order = np.argsort(-counts, 1, kind="stable")[:, :2]
        first, second = np.take_along_axis(counts, order, 1).T
        solid = first > 0
        material.ravel()[edges[solid]] = order[solid, 0]
        two = second > 0
        share = second[two] / (first + second)[two]
        return MixedPixels(edges[two], order[two, 1].astype(np.int32), share)


def _next_to_others(material: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Pixels one of whose eight neighbours is of another material."""
    padded = np.pad(material, 1, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(padded, (3, 3))
    return np.asarray((around != material[:, :, None, None]).any((2, 3)))


def _spots(count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places in a pixel, -0.5 to 0.5: Hammersley's points, all of whose columns and rows differ."""
    index = np.arange(count)
    bits = count.bit_length() - 1
    reverse = sum(((index >> bit) & 1) << (bits - 1 - bit) for bit in range(bits))
    return (index + 0.5) / count - 0.5, (np.asarray(reverse) + 0.5) / count - 0.5


def check_range(name: str, value: float, low: float, high: float, unit: str = "") -> None:
    """Raise `PlanError` unless ``low <= value <= high``."""
    if not low <= value <= high:
        allowed = f"{low:g} and {high:g} {unit}".rstrip()
        raise PlanError(f"Option {name} must be between {allowed}, not {value:g}.")
