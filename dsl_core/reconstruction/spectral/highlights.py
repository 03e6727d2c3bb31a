"""Highlights of glossy surfaces, which the model of a matt surface takes for reflectance.

A highlight sends on the light of all orders alike, so that no pixel tells it from a brighter surface. But it
is white, and grows as the surface turns towards the direction that mirrors the projector into the camera:
where brightness does that from place to place by the same amount in all colours, surfaces are glossy. Each
surface between depth edges is judged by itself: a matt wall behind a glossy object says nothing of it.

Normals are noisy, and from one pair of neighbours to the next that is most of how they turn on a flat
surface: a highlight fitted to it would be too faint. So directions are smoothed as well, and what then
surely explains most is told. On a curved surface smoothing hides how it turns; there places far apart tell
more, as directions then differ by more than their noise.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsl_core.model.conditions import colour_sites
from dsl_core.model.fit import FitFinding
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import rays_in
from dsl_core.optics.sensor import bayer_channels, relative_gain
from dsl_core.optics.spectra import chain_response
from dsl_core.reconstruction.geometry import Geometry

Floats = NDArray[np.float64]

#: Widths of highlights: roughness, whose square is the alpha of B. Walter et al. (EGSR 2007).
ROUGHNESS = (0.2, 0.3, 0.4, 0.5, 0.6)
#: A highlight of so much reflectance matters, if it is so many deviations of its own from none, and every
#: colour alone shows at least this share of it.
LEAST, SIGMAS, WHITE_SHARE = 0.01, 6.0, 0.3
#: Cells of 2 x 2 pixels, one of each colour, are compared with those so many cells away; with at most so
#: many pairs. Neighbouring pairs err alike: deviations are those between blocks of so many cells a side.
LAG, MOST_PAIRS, BLOCK = 2, 40_000, 8
#: Cells farther apart are this share of the picture's width from each other: two windows of the normals.
FAR = 1 / 37
#: Widths (px) by which directions are smoothed, and what a highlight must then have of reflectance: smoothed
#: ones are off where surfaces curve, and brightness with them by 0.01.
SMOOTHED_PX, LEAST_SMOOTHED = (0.0, 6.0, 12.0), 0.03
#: A pixel is at most so many deviations brighter than it was seen.
SEEN_SIGMAS = 2.0
#: Rows of a picture that are looked at together.
SLAB = 128
#: What differs from cell to cell without any highlight: a share of reflectance, and reflectance.
TEXTURE, FLOOR = 0.02, 0.002
#: Beyond so many deviations a pair is at an edge, and pulls no more than there.
HUBER, ROUNDS = 2.0, 6
#: Pairs and blocks of a surface that say something.
FEWEST_PAIRS, FEWEST_BLOCKS = 100, 5
#: Pixels whose brightness or normal means nothing, and the least light that falls on a surface.
_DOUBTFUL = Flag.DEPTH_EDGE | Flag.NOT_REFINED | Flag.CODES_DISAGREE | Flag.UNUSUAL_PEAK
LEAST_SHADING = 0.1
_NM = np.arange(400.0, 701.0)


@dataclass(frozen=True)
class Highlight:
    """A highlight of reflectance ``peak`` in the mirror direction, with deviation, and its ``roughness``.

    ``colours`` are what red, green and blue say of the peak by themselves, ``left`` is what it leaves over,
    and ``brightest`` its reflectance where it is brightest of the pairs.
    """

    roughness: float
    peak: float
    peak_std: float
    colours: tuple[float, float, float]
    left: float = 0.0
    brightest: float = np.inf

    @property
    def is_white(self) -> bool:
        """Whether all colours show it."""
        return min(self.colours) > WHITE_SHARE * self.peak

    @property
    def is_sure(self) -> bool:
        """Whether it is white, matters, and is none by chance."""
        return self.is_white and self.brightest > LEAST and self.peak > SIGMAS * self.peak_std

    def at(self, towards: NDArray[np.floating]) -> NDArray[np.floating]:
        """Its reflectance where the cosine between normal and mirror direction is ``towards``."""
        return np.asarray(self.peak * _lobe(towards, self.roughness))


#: The number of a surface, its highlight, and the cosines to the mirror direction that it was found by.
_Found = tuple[int, Highlight, NDArray[np.float32]]


def follow_highlights(rig: Rig, geometry: Geometry) -> tuple[Geometry, list[FitFinding]]:
    """Geometry that says what highlights add to reflectance, and what is told of them."""
    towards = towards_mirror(rig, geometry)
    surfaces = surfaces_between_edges(geometry, towards)
    found = _surest(rig, geometry, towards, surfaces)
    if not found:
        return geometry, []
    added = np.zeros(towards.shape, np.float32)
    own = _everywhere(surfaces, towards.shape)
    for surface, light, facing in found:
        here = own == surface
        # Noise of directions makes a highlight too faint: of two that are sure, the brighter one counts.
        added[here] = np.maximum(added[here], np.nan_to_num(light.at(facing[here])))
    # What a surface sends on of its own is not less than nothing.
    added = np.fmin(added, _seen(rig, geometry))
    brightest = float(added.max(initial=0.0))
    surest = min(light.peak_std / light.peak for _, light, _ in found)
    concerned = float((added > LEAST).sum() / max(np.isfinite(geometry.depth_mm).sum(), 1))
    told = FitFinding.judged(
        "surfaces",
        "highlights",
        (brightest, brightest * surest),
        "reflectance",
        LEAST,
        f"Surfaces are glossy: towards the direction that mirrors the projector they look brighter, by up to"
        f" {brightest:.2f} of reflectance and by more than {LEAST:g} in {concerned:.1%} of the pixels."
        " Deviations of reflectance contain it.",
        "Turn the object or move the projector so that the highlight falls elsewhere; a matt coat, such as"
        " chalk spray, shows the surface itself.",
    )
    return replace(geometry, highlight=added), [told]


def _seen(rig: Rig, geometry: Geometry) -> NDArray[np.float32]:
    """The most reflectance (rows, columns) that the light of each pixel allows in its colour; NaN unknown."""
    white = chain_response(rig, 0, _NM).sum((1, 2))
    shape = geometry.depth_mm.shape
    channel, gain = bayer_channels(rig.sensor.bayer, *shape), np.broadcast_to(relative_gain(rig), shape)
    shading = np.maximum(geometry.surface.shading, LEAST_SHADING)
    most = np.maximum(geometry.amplitude, 0) + SEEN_SIGMAS * geometry.amplitude_std
    return np.asarray(most / (shading * white[channel] * gain), np.float32)


def _surest(
    rig: Rig, geometry: Geometry, towards: NDArray[np.float32], surfaces: NDArray[np.int32]
) -> list[_Found]:
    """Highlights by places near each other and by such as are far apart."""
    far = max(round(FAR * towards.shape[1]), LAG)
    directions = [(by_px, smoothed(towards, by_px)) for by_px in SMOOTHED_PX]
    # Smoothing serves neighbours, which hardly differ.
    return [
        *_sure_of(rig, geometry, directions, surfaces, LAG),
        *_sure_of(rig, geometry, directions[:1], surfaces, far),
    ]


def _sure_of(
    rig: Rig,
    geometry: Geometry,
    directions: list[tuple[float, NDArray[np.float32]]],
    surfaces: NDArray[np.int32],
    lag: int,
) -> list[_Found]:
    """Of pairs so many cells apart, what surely explains most by directions smoothed by some widths (px)."""
    fits: dict[int, list[tuple[Highlight, NDArray[np.float32], float]]] = {}
    for by_px, facing in directions:
        for surface, light in fit_highlights(rig, geometry, facing, surfaces, lag).items():
            fits.setdefault(surface, []).append((light, facing, by_px))
    found = []
    for surface, each in fits.items():
        each.sort(key=lambda one: one[0].left)
        sure = [
            (surface, light, facing)
            for light, facing, by_px in each
            if light.is_sure and (by_px == 0 or light.brightest > LEAST_SMOOTHED)
        ]
        # What has a colour by the directions that explain it best is no highlight by others either.
        if sure and each[0][0].is_white:
            found.append(sure[0])
    return found


def towards_mirror(rig: Rig, geometry: Geometry) -> NDArray[np.float32]:
    """Cosine between the normal and the direction that mirrors the projector into the camera, NaN unknown."""
    towards = np.empty(geometry.depth_mm.shape, np.float32)
    for rows in _slabs(len(towards)):
        points = rays_in(rig.camera, rows) * geometry.depth_mm[rows]
        to_light = rig.pose.projector_centre_mm[:, None, None] - points
        half = to_light / np.linalg.norm(to_light, axis=0) - points / np.linalg.norm(points, axis=0)
        half /= np.linalg.norm(half, axis=0)
        towards[rows] = (geometry.surface.normals[:, rows] * half).sum(0).clip(0, 1)
    return towards


def smoothed(towards: NDArray[np.float32], by_px: float) -> NDArray[np.float32]:
    """`towards_mirror` (rows, columns) smoothed by a width (rms, px); NaN stays where it is."""
    from scipy.ndimage import gaussian_filter

    known = np.isfinite(towards)
    if by_px == 0 or not known.any():
        return towards
    total, weight = (gaussian_filter(np.where(known, each, 0.0), by_px) for each in (towards, 1.0))
    return np.where(known, total / np.maximum(weight, 1e-12), np.nan).astype(np.float32)


def surfaces_between_edges(geometry: Geometry, towards: NDArray[np.floating]) -> NDArray[np.int32]:
    """Number from 1 of the surface that each cell of 2 x 2 pixels is on; 0 at depth edges and without depth.

    ``towards`` is NaN where there is no depth.
    """
    from scipy.ndimage import label

    inside = ((geometry.flags & int(Flag.DEPTH_EDGE)) == 0) & np.isfinite(towards)
    rows, columns = (size // 2 for size in inside.shape)
    whole = inside[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2).all((1, 3))
    return np.asarray(label(whole)[0], np.int32)


def _everywhere(surfaces: NDArray[np.int32], shape: tuple[int, ...]) -> NDArray[np.int32]:
    """The surface of each pixel of a picture: its cell's, or else that of the nearest cell which has one."""
    from scipy.ndimage import distance_transform_edt

    row, column = distance_transform_edt(surfaces == 0, return_distances=False, return_indices=True)
    near = surfaces[row, column]
    y, x = (np.minimum(np.arange(size) // 2, most - 1) for size, most in zip(shape, near.shape, strict=True))
    return np.asarray(near[y[:, None], x])


def fit_highlights(
    rig: Rig,
    geometry: Geometry,
    towards: NDArray[np.floating],
    surfaces: NDArray[np.int32],
    lag: int = LAG,
) -> dict[int, Highlight]:
    """By the number of a surface, the highlight that explains best how brightness changes, sure or not.

    ``lag`` is how many cells apart the places are that are compared.
    """
    pairs = _pairs(rig, geometry, towards, surfaces, lag)
    if pairs is None:
        return {}
    counts = np.bincount(pairs.surface)
    each = {int(one): _highlight_of(pairs.on(int(one))) for one in np.flatnonzero(counts >= FEWEST_PAIRS)}
    return {one: found for one, found in each.items() if found is not None}


def _highlight_of(pairs: _Pairs) -> Highlight | None:
    """The highlight of one surface; None where too few pairs say anything."""
    if len(np.unique(pairs.block)) < FEWEST_BLOCKS:
        return None
    found = min((_fitted(pairs, roughness) for roughness in ROUGHNESS), key=lambda each: each.left)
    return replace(found, brightest=float(found.at(np.append(pairs.here, pairs.there)).max()))


@dataclass(frozen=True)
class _Pairs:
    """Pairs (n,) of cells: `towards_mirror` of each, and how reflectance differs (3, n) with its deviation.

    With their block, and the surface that both are on.
    """

    here: Floats
    there: Floats
    differs: Floats
    std: Floats
    block: NDArray[np.int64]
    surface: NDArray[np.int32]

    def on(self, surface: int) -> _Pairs:
        """Those on one surface."""
        mine = self.surface == surface
        return _Pairs(*(getattr(self, field.name)[..., mine] for field in fields(self)))


def _lobe(towards: NDArray[np.floating], roughness: float) -> NDArray[np.floating]:
    """The GGX distribution over its value in the mirror direction."""
    alpha_sq = roughness**4
    return np.asarray((alpha_sq / (towards**2 * (alpha_sq - 1) + 1)) ** 2)


def _pairs(
    rig: Rig,
    geometry: Geometry,
    towards: NDArray[np.floating],
    surfaces: NDArray[np.int32],
    lag: int = LAG,
) -> _Pairs | None:
    """Pairs of cells so many apart of which all is known; None if too few, or if a camera has no colours."""
    if len(set(colour_sites(rig.sensor.bayer))) < 3:
        return None
    gain = np.broadcast_to(relative_gain(rig), towards.shape)
    white = chain_response(rig, 0, _NM).sum((1, 2))
    # Of large pictures some pairs are enough, and all of them much memory.
    every = max(1, towards.size // 2 // MOST_PAIRS)
    parts = [
        _pairs_of(
            rig,
            white,
            gain[rows],
            geometry.of_rows(rows),
            towards[rows],
            surfaces[rows.start // 2 : rows.stop // 2],
            rows.start,
            every,
            lag,
        )
        for rows in _slabs(len(towards))
    ]
    found = _Pairs(*(np.concatenate(each, -1) for each in zip(*parts, strict=True)))
    return found if len(found.here) >= FEWEST_PAIRS else None


def _slabs(rows: int) -> list[slice]:
    """Slices of rows, an even number each, so that maps of a large picture need no room of their own."""
    return [slice(top, min(top + SLAB, rows)) for top in range(0, rows, SLAB)]


def _pairs_of(
    rig: Rig,
    white: Floats,
    gain: Floats,
    geometry: Geometry,
    towards: NDArray[np.floating],
    surfaces: NDArray[np.int32],
    top: int,
    every: int,
    lag: int,
) -> tuple[NDArray[Any], ...]:
    """What `_Pairs` holds, of the rows of a picture from ``top`` on: one of so many pairs."""
    channel, shading = bayer_channels(rig.sensor.bayer, *towards.shape), geometry.surface.shading
    usable = ((geometry.flags & int(_DOUBTFUL)) == 0) & np.isfinite(towards) & (shading > LEAST_SHADING)
    usable &= np.isfinite(geometry.amplitude) & np.isfinite(geometry.amplitude_std)
    per_white = np.where(usable, 1 / np.where(usable, shading * white[channel] * gain, 1.0), 0.0)
    light = geometry.amplitude, geometry.amplitude_std
    seen, std = (_cells(np.where(usable, each, 0.0) * per_white) for each in light)
    of = [_cells(channel == colour) for colour in range(3)]
    colours = np.stack([(seen * mine).sum(-1) / mine.sum(-1) for mine in of])
    noise = np.stack([np.sqrt((std**2 * mine).sum(-1)) / mine.sum(-1) for mine in of])
    known: NDArray[np.bool_] = _cells(usable).min(-1) > 0
    facing = _cells(np.where(usable, towards, 0.0)).mean(-1)
    # A normal that is off makes a surface look brighter or darker, too.
    unsure = _cells(np.where(usable, geometry.surface.shading_rel_std, 0.0)).mean(-1)
    rows, columns = known.shape
    parts = []
    for down, across in ((lag, 0), (0, lag)):
        first = slice(down, None), slice(across, None)
        second = slice(None, max(rows - down, 0)), slice(None, max(columns - across, 0))
        alike = known[first] & known[second] & (surfaces[first] == surfaces[second])
        row, column = (each[::every] for each in np.nonzero(alike))
        a, b = (colours[:, *part][:, row, column] for part in (first, second))
        da, db = (noise[:, *part][:, row, column] for part in (first, second))
        by_normals = (unsure[first][row, column] * a) ** 2 + (unsure[second][row, column] * b) ** 2
        own = np.sqrt(da**2 + db**2 + by_normals + (TEXTURE * (a + b) / 2) ** 2 + FLOOR**2)
        # Pairs that share a cell, or an edge between theirs, err alike.
        side = max(BLOCK, 2 * lag)
        block = (top // 2 + row) // side * columns + column // side
        on = surfaces[first][row, column]
        parts.append((facing[first][row, column], facing[second][row, column], a - b, own, block, on))
    return tuple(np.concatenate(part, -1) for part in zip(*parts, strict=True))


def _cells(values: NDArray[np.generic]) -> Floats:
    """Cells of 2 x 2 pixels: (rows / 2, columns / 2, 4)."""
    rows, columns = (n // 2 for n in values.shape)
    cells = values[: 2 * rows, : 2 * columns].reshape(rows, 2, columns, 2)
    return np.asarray(cells.transpose(0, 2, 1, 3).reshape(rows, columns, 4))


def _fitted(pairs: _Pairs, roughness: float) -> Highlight:
    """The highlight of a roughness that fits best, robustly."""
    rise = _lobe(pairs.here, roughness) - _lobe(pairs.there, roughness)
    peak = 0.0
    for _ in range(ROUNDS):
        off = np.abs(pairs.differs - peak * rise) / pairs.std
        weight = np.minimum(1.0, HUBER / np.maximum(off, 1e-12)) / pairs.std**2
        of_colour = (weight * rise**2).sum(1)
        peak = float((weight * rise * pairs.differs).sum() / max(of_colour.sum(), 1e-12))
    pull = weight * (pairs.differs - peak * rise) * rise
    by_block = np.bincount(np.unique(pairs.block, return_inverse=True)[1], pull.sum(0))
    # Pulls of a few blocks may cancel by chance: no peak is surer than pairs that err independently make it.
    variance = max(float((by_block**2).sum()), float((pull**2).sum()))
    # Pairs at edges pull no more, whatever the peak.
    near = np.abs(pairs.differs - peak * rise) < HUBER * pairs.std
    std = float(np.sqrt(variance) / max(float((near / pairs.std**2 * rise**2).sum()), 1e-12))
    red, green, blue = ((weight * rise * pairs.differs).sum(1) / np.maximum(of_colour, 1e-12)).tolist()
    off = np.abs(pairs.differs - peak * rise) / pairs.std
    left = float(np.where(off < HUBER, off**2, HUBER * (2 * off - HUBER)).sum())
    return Highlight(roughness, peak, std, (red, green, blue), left)
