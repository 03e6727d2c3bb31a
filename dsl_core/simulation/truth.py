"""What a scene is and what is known of it: palettes of spectra and maps seen by one camera."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.geometry import Lens
from dsl_core.simulation.surfaces import Surface, trace

#: Fine grid of all palettes, nm: 400 to 700 in steps of 1, shape (301,).
FINE_NM: NDArray[np.float64] = np.arange(400.0, 701.0)
FINE_NM.setflags(write=False)


@dataclass(frozen=True)
class Materials:
    """A palette of reflectance spectra on the Spectralon scale.

    ``wavelengths_nm`` has shape (L,), ``reflectance`` shape (M, L), 0..1, one row per name.
    ``surroundings`` names the materials that are in view but not what the scene is about.
    """

    names: tuple[str, ...]
    wavelengths_nm: NDArray[np.float64]
    reflectance: NDArray[np.float64]
    surroundings: tuple[str, ...] = ()

    @classmethod
    def of(cls, spectra: dict[str, NDArray[np.float64]], surroundings: tuple[str, ...] = ()) -> Materials:
        """Make a palette from named spectra on the fine grid, in the order of the dictionary."""
        return cls(tuple(spectra), FINE_NM, np.stack(list(spectra.values())), surroundings)

    @property
    def targets(self) -> tuple[int, ...]:
        """Indices of the materials that the scene is about."""
        return tuple(i for i, name in enumerate(self.names) if name not in self.surroundings)

    def at(self, wavelengths_nm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Reflectance at other wavelengths (nm), linear between samples, shape (M, bands)."""
        rows = [np.interp(wavelengths_nm, self.wavelengths_nm, row) for row in self.reflectance]
        return np.stack(rows)


@dataclass(frozen=True)
class SceneTruth:
    """A scene seen by one camera; h and w are the camera's rows and columns.

    ``depth_mm`` (h, w) along the camera axis, NaN where there is no surface; ``normals`` (3, h, w), unit,
    camera coordinates, towards the camera, NaN where there is no surface; ``material`` (h, w), index into
    ``materials``, -1 where there is no surface; ``lit`` (h, w): the projector's centre sees the point.
    """

    depth_mm: NDArray[np.float64]
    normals: NDArray[np.float64]
    material: NDArray[np.int32]
    materials: Materials
    lit: NDArray[np.bool_]

    def reflectance(self, wavelengths_nm: NDArray[np.float64]) -> NDArray[np.float32]:
        """Reflectance cube, shape (bands, h, w), NaN where there is no surface."""
        table = self.materials.at(wavelengths_nm).astype(np.float32)
        # A last column of NaN is what index -1 picks.
        table = np.concatenate([table, np.full((1, table.shape[1]), np.nan, np.float32)])
        return np.ascontiguousarray(table.T)[:, self.material]


@dataclass(frozen=True)
class Scene:
    """Surfaces in camera coordinates (mm) and the palette they are painted with."""

    name: str
    description: str
    surfaces: tuple[Surface, ...]
    materials: Materials

    def render(self, camera: Lens, projector_centre_mm: NDArray[np.float64]) -> SceneTruth:
        """The truth at every pixel of a camera, lens distortion included; centre in camera mm, shape (3,)."""
        shape = (camera.height_px, camera.width_px)
        hits = trace(self.surfaces, camera, np.asarray(projector_centre_mm, np.float64))
        return SceneTruth(
            depth_mm=hits.depth_mm.reshape(shape),
            normals=hits.normals.reshape(3, *shape),
            material=hits.material.reshape(shape),
            materials=self.materials,
            lit=hits.lit.reshape(shape),
        )
