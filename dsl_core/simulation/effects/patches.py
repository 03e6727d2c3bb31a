"""What the camera sees as a few hundred flat patches that exchange light."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.simulation.scenes.surfaces import HeightField, Shape
from dsl_core.simulation.scenes.truth import Parts, SceneTruth

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
#: Blocks of pixels in an image, about; samples across a block.
BLOCKS, SAMPLES = 500, 4
#: Directions into which a block's surfaces are sorted: plus and minus each axis.
_SIDES = 6
#: Grazing pixels see no larger area than this cosine makes of it.
_GRAZING = 0.02
#: Form factors below this are rounding.
_FAINT = 1e-9
#: Ends of a line of sight that cannot be blocked, as a share of it; places looked at over a height field, and
#: how deep in it they must be, mm.
_ENDS, _STEPS, _DEEP_MM = 0.02, 12, 1.0


@dataclass(frozen=True)
class Patches:
    """Patches of a view; N of them, from S sampled pixels.

    ``of_sample`` (S,) names each sample's patch, ``areas_mm2`` (S,) what each stands for; ``centres_mm`` and
    ``normals`` (3, N); ``patch_areas_mm2`` (N,). ``index`` (block rows, block columns, 6) finds patches, -1
    where there is none.
    """

    pixels: Indices
    of_sample: Indices
    areas_mm2: Floats
    centres_mm: Floats
    normals: Floats
    patch_areas_mm2: Floats
    index: Indices
    block_px: int

    @classmethod
    def of(cls, rig: Rig, truth: SceneTruth) -> Patches:
        """Patches of what a camera sees: blocks of pixels, divided where surfaces face another side."""
        rows, columns = truth.depth_mm.shape
        block = max(1, math.ceil(math.sqrt(rows * columns / BLOCKS)))
        stride = max(1, block // SAMPLES)
        row, column = np.mgrid[stride // 2 : rows : stride, stride // 2 : columns : stride].reshape(2, -1)
        pixels = row * columns + column
        pixels = pixels[np.isfinite(truth.depth_mm.ravel()[pixels])]
        rays, depth = pixel_rays(rig.camera).reshape(3, -1)[:, pixels], truth.depth_mm.ravel()[pixels]
        normals = truth.normals.reshape(3, -1)[:, pixels]
        grazing = np.maximum(np.abs((normals * rays).sum(0)), _GRAZING)
        areas = stride**2 * depth**2 / (rig.camera.fx_px * rig.camera.fy_px) / grazing
        blocks = (-(-rows // block), -(-columns // block))
        key = _block_of(pixels, columns, block, blocks) * _SIDES + _side(normals)
        kinds, of_sample = np.unique(key, return_inverse=True)
        total = np.bincount(of_sample, areas, len(kinds)).astype(np.float64)

        def mean(values: Floats) -> Floats:
            return np.stack([np.bincount(of_sample, areas * v, len(kinds)) for v in values]) / total

        facing = mean(normals)
        index = np.full(blocks[0] * blocks[1] * _SIDES, -1)
        index[kinds] = np.arange(len(kinds))
        return cls(
            pixels, of_sample, areas, mean(rays * depth), facing / np.linalg.norm(facing, axis=0), total,
            index.reshape(*blocks, _SIDES), block,
        )  # fmt: skip

    @property
    def count(self) -> int:
        """Number of patches."""
        return len(self.patch_areas_mm2)

    def mean(self, values: Floats) -> Floats:
        """Means over each patch of values of samples (S, k), shape (N, k)."""
        from scipy.sparse import csr_array

        weights = self.areas_mm2 / self.patch_areas_mm2[self.of_sample]
        places = (self.of_sample, np.arange(len(self.of_sample)))
        return np.asarray(csr_array((weights, places), (self.count, len(weights))) @ values)

    def form_factors(self) -> Floats:
        """Share of the light on each patch (row) that another (column) would send if nothing stood between.

        That of a small disc, ``cos cos' A / (pi r^2 + A)``; no patch gets more from all others than there is.
        """
        between = self.centres_mm[:, None, :] - self.centres_mm[:, :, None]
        square = (between**2).sum(0)
        leaves = np.maximum(-np.einsum("iq,ipq->pq", self.normals, between), 0)
        arrives = np.maximum(np.einsum("ip,ipq->pq", self.normals, between), 0)
        area = self.patch_areas_mm2
        with np.errstate(invalid="ignore", divide="ignore"):
            factors = np.nan_to_num(leaves * arrives / square) * area / (np.pi * square + area)
        factors[factors < _FAINT] = 0.0
        return np.asarray(factors / np.maximum(factors.sum(1, keepdims=True), 1.0))

    def visible(self, factors: Floats, surfaces: tuple[Shape, ...]) -> NDArray[np.bool_]:
        """Which patches see each other past the surfaces of a scene, (N, N), where they exchange light."""
        seen = np.ones(factors.shape, bool)
        meet = (factors > 0) | (factors.T > 0)
        for patch in range(self.count):
            others = np.flatnonzero(meet[patch, patch + 1 :]) + patch + 1
            if len(others):
                start = self.centres_mm[:, patch]
                lines = self.centres_mm[:, others] - start[:, None]
                clear = ~np.any([blocks(surface, start, lines) for surface in surfaces], 0)
                seen[patch, others] = seen[others, patch] = clear
        return seen

    def around(self, truth: SceneTruth, parts: Parts) -> tuple[Indices, Floats]:
        """The patches around each part and their bilinear weights, both (parts, 4).

        Only patches that face the part's side count; where there is none, the part gets nothing.
        """
        row, column = np.divmod(parts[0], truth.depth_mm.shape[1])
        side = _side(truth.normals.reshape(3, -1)[:, parts[0]])
        down, across = ((at + 0.5) / self.block_px - 0.5 for at in (row, column))
        top, left = np.floor(down).astype(np.int64), np.floor(across).astype(np.int64)
        found, weights = [], []
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            block = [
                np.clip(at, 0, size - 1)
                for at, size in zip((top + i, left + j), self.index.shape[:2], strict=True)
            ]
            found.append(self.index[block[0], block[1], side])
            weights.append(np.abs(1 - i - (down - top)) * np.abs(1 - j - (across - left)))
        patches, shares = np.stack(found, 1), np.stack(weights, 1)
        shares[patches < 0] = 0.0
        return patches.clip(min=0), shares / np.maximum(shares.sum(1, keepdims=True), 1e-12)


def _block_of(pixels: Indices, columns: int, block: int, blocks: tuple[int, int]) -> Indices:
    row, column = np.divmod(pixels, columns)
    return np.asarray((row // block) * blocks[1] + column // block)


def _side(normals: Floats) -> Indices:
    """Which of the six directions a normal (3, n) is nearest to."""
    axis = np.abs(normals).argmax(0)
    return np.asarray(2 * axis + (np.take_along_axis(normals, axis[None], 0)[0] > 0))


def blocks(surface: Shape, start_mm: Floats, lines_mm: Floats) -> NDArray[np.bool_]:
    """Whether a surface stands on lines (3, n) from a place, ends aside."""
    if isinstance(surface, HeightField):
        # A height field is made for rays from the front, so lines inside it are looked at place by place.
        shares = np.linspace(_ENDS, 1 - _ENDS, _STEPS)[:, None]
        x, y, z = (start_mm[i] + shares * lines_mm[i] for i in range(3))
        under = z - surface.height(x.ravel(), y.ravel()).reshape(z.shape)
        return np.asarray((under > _DEEP_MM).any(0))
    with np.errstate(invalid="ignore", divide="ignore"):
        t = surface.intersect(start_mm, lines_mm)
    return np.asarray((t > _ENDS) & (t < 1 - _ENDS))
