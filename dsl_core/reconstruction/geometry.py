"""Columns, depth, points and normals of a scan, with the reasons why pixels fail."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.errors import DecodeError
from dsl_core.model.plan import CapturePlan
from dsl_core.model.projector.line_spread import zero_std_px
from dsl_core.model.result import DEPTH_INVALID, REASONS, Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import triangulate
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.pinhole import rays_in
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.progress import Progress
from dsl_core.reconstruction.columns.code_dispute import Settled, has_peak, is_dark, settle
from dsl_core.reconstruction.columns.lateral_colour import material_std_px
from dsl_core.reconstruction.columns.line_spread import wave_std_px
from dsl_core.reconstruction.columns.maps import CHUNK, WHOLE_PX_STD, ColumnFinder, ColumnMaps
from dsl_core.reconstruction.columns.pattern_column import radiance_profiles
from dsl_core.reconstruction.columns.spread_doubt import SpreadDoubt
from dsl_core.reconstruction.columns.two_surfaces import two_surfaces_std_px
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import LineStack
from dsl_core.reconstruction.rows.bands import some_rows
from dsl_core.reconstruction.surface import Surface, reconstruct_surface

#: A pixel is lit when white stands this many standard deviations above black.
LIT_SIGMAS = 8.0
#: Deviation of a column between two that two codes name.
EDGE_STD_PX = 0.15
#: Two surfaces that leave so many deviations of a column open, and so many px, are a depth edge.
MIXED_SIGMAS, MIXED_PX = 3.0, 1.5
#: With fewer pixels than this share a scan is taken as failed.
MIN_SHARE = 0.001
#: The gravest reason first: too much light also confuses the code.
_ADVICE = {
    Flag.SATURATED: "Lower the exposure or the drive level of the plan's settings, or dim the room.",
    Flag.NO_LIGHT: (
        "Check that the projector is on, the lens cap is off and the scene is in the beam; or expose longer."
    ),
    Flag.OUT_OF_RANGE: "Check that the calibration belongs to this rig, and the distance of the scene.",
    Flag.CODE_UNSURE: "Check that projector and camera are synchronised and nothing moved; expose longer.",
    Flag.CODES_DISAGREE: "Check focus and that nothing moved; separate surfaces that light each other.",
    Flag.NON_FINITE: "Check the calibration for values that are not numbers.",
}


@dataclass(frozen=True)
class Geometry:
    """Maps (rows, columns) of columns, depths, zero-order amplitudes, dark offsets, deviations, and flags.

    Where light comes from next to a pixel's centre, its column is ``displaced_px`` from that of the pixel,
    and depth is that of the pixel; ``seen_depth_mm`` is what the column alone leads to. ``highlight`` is the
    reflectance that gloss may add, None where surfaces are matt. Pixels are ``mixed`` whose neighbours lead
    to two surfaces.
    """

    column_px: NDArray[np.float32]
    column_std_px: NDArray[np.float32]
    depth_mm: NDArray[np.float64]
    depth_std_mm: NDArray[np.float64]
    amplitude: NDArray[np.float32]
    amplitude_std: NDArray[np.float32]
    offset: NDArray[np.float32]
    offset_std: NDArray[np.float32]
    flags: NDArray[np.uint16]
    surface: Surface
    displaced_px: NDArray[np.float32] | None = None
    seen_depth_mm: NDArray[np.float64] | None = None
    highlight: NDArray[np.float32] | None = None
    mixed: NDArray[np.bool_] | None = None

    def by(self, rig: Rig, column_error_px: NDArray[np.floating], window_px: int | None = None) -> Geometry:
        """Depth and surface from the same columns with another rig.

        ``column_error_px`` (rows, columns) is what their deviation has to hold besides; other arguments are
        those of `reconstruct_geometry`.
        """
        std_px = np.hypot(self.column_std_px, column_error_px).astype(np.float32)
        depth, depth_std = np.full_like(self.depth_mm, np.nan), np.full_like(self.depth_std_mm, np.nan)
        good = np.flatnonzero(np.isfinite(self.depth_mm))
        for start in range(0, good.size, CHUNK):
            some = good[start : start + CHUNK]
            column = torch.as_tensor(self.column_px.ravel()[some], dtype=torch.float64)
            if self.displaced_px is not None:
                column -= torch.as_tensor(self.displaced_px.ravel()[some])
            found, slope = (v.numpy() for v in triangulate(rig, torch.as_tensor(some), column))
            depth.ravel()[some], depth_std.ravel()[some] = found, slope * std_px.ravel()[some]
        surface = reconstruct_surface(rig, depth, depth_std, window_px, _beyond(self.flags), self.mixed)
        edge = np.where(surface.edge, int(Flag.DEPTH_EDGE), 0).astype(np.uint16)
        return replace(
            self,
            column_std_px=std_px,
            depth_mm=depth,
            depth_std_mm=depth_std,
            surface=surface,
            flags=(self.flags & ~np.uint16(int(Flag.DEPTH_EDGE))) | edge,
        )

    def displaced(
        self,
        rig: Rig,
        displaced_px: NDArray[np.float32],
        column_error_px: NDArray[np.floating],
        window_px: int | None = None,
    ) -> Geometry:
        """Depth and surface where columns are those of places next to pixels; arguments as for `by`."""
        seen = replace(self, displaced_px=displaced_px, seen_depth_mm=self.depth_mm)
        return seen.by(rig, column_error_px, window_px)

    def of_rows(self, rows: slice) -> Geometry:
        """That of some rows of the picture."""
        maps = {
            name: values[rows]
            for name, values in vars(self).items()
            if name != "surface" and values is not None
        }
        return Geometry(**maps, surface=some_rows(self.surface, rows))

    def points_mm(self, rig: Rig, rows: slice) -> NDArray[np.float32]:
        """Points in camera coordinates, (3, rows, columns), of these ``rows``; NaN without a depth."""
        return (rays_in(rig.camera, rows) * self.depth_mm).astype(np.float32)


def reconstruct_geometry(
    rig: Rig,
    plan: CapturePlan,
    code: DecodedCode,
    white: MergedFrame,
    stack: LineStack,
    *,
    refine_columns: bool = True,
    surface_window_px: int | None = None,
    shared_errors: bool = True,
    device: str = "cpu",
    progress: Progress | None = None,
) -> Geometry:
    """Refine decoded columns on the frames of the spectral patterns, triangulate, and fit the surface.

    Deviations leave out what all columns share, unless ``shared_errors`` are wanted.
    ``surface_window_px`` is the window of the plane fits; by default it follows from the image's width.
    """
    search = ColumnSearch(rig, plan, refine_columns, device)
    found = search.find(code, white, stack, 0, progress)
    return geometry_of(
        rig, search.lines, found, code.column.shape, surface_window_px, shared_errors=shared_errors
    )


@dataclass(frozen=True)
class FoundColumns:
    """What is found of the columns of some pixels (P,), and their flags (P,)."""

    maps: ColumnMaps
    flags: NDArray[np.uint16]

    @classmethod
    def empty(cls, count: int) -> FoundColumns:
        """Room for so many pixels."""
        return cls(ColumnMaps.empty(count), np.zeros(count, np.uint16))

    def put(self, where: slice, other: FoundColumns) -> None:
        """Replace some pixels by others."""
        self.maps.put(where, other.maps)
        self.flags[where] = other.flags


class ColumnSearch:
    """Refines and judges the columns of a picture, or of some rows of it."""

    def __init__(
        self,
        rig: Rig,
        plan: CapturePlan,
        refine_columns: bool = True,
        device: str = "cpu",
        peak_error: float | None = None,
    ) -> None:
        self.rig, self._device, self._peak_error = rig, device, peak_error
        self.lines = LineSet.of(plan) if refine_columns else None
        self._profiles = radiance_profiles(rig, plan) if refine_columns and plan.spectral_count else None

    def find(
        self,
        code: DecodedCode,
        white: MergedFrame,
        stack: LineStack,
        first: int = 0,
        progress: Progress | None = None,
    ) -> FoundColumns:
        """Columns of all pixels of some rows, the first of which is the ``first`` (flat) of the picture."""
        finder = ColumnFinder(
            self.rig, white, stack, self.lines, self._profiles, self._device, first, self._peak_error
        )
        start_px, start_std_px = _start(code)
        maps = finder.find(np.arange(start_px.size), start_px, start_std_px, progress)
        lit = _lit(white)
        settled = settle(code, maps, finder, lit, progress)
        return FoundColumns(
            maps, _flags(self.rig, code, white, maps, settled, lit, self._profiles is not None)
        )


def geometry_of(
    rig: Rig,
    lines: LineSet | None,
    found: FoundColumns,
    shape: tuple[int, ...],
    surface_window_px: int | None = None,
    spread_doubt: SpreadDoubt | None = None,
    shared_errors: bool = True,
    code_wave_px: float = 0.0,
) -> Geometry:
    """Depth and surface from the columns of a whole picture of a shape, which it takes over.

    ``spread_doubt`` is what columns may be off by through the line spread, ``code_wave_px`` what the binary
    code says that they are.
    """
    maps, flags = found.maps, found.flags
    column_px, noise_px = maps.column_px.reshape(shape), maps.column_std_px.reshape(shape)
    mosaic = rig.sensor.bayer != "MONO"
    waves = wave_std_px(column_px, noise_px, maps.refined.reshape(shape), lines, mosaic).ravel()
    if spread_doubt is not None:
        waves = np.hypot(waves, np.where(maps.refined, spread_doubt.at(maps.column_px), np.float32(0.0)))
    # It is of the same waves.
    waves = np.maximum(waves, np.where(maps.refined, np.float32(code_wave_px), np.float32(0.0)))
    common = math.hypot(rig.column_std_px, _zero_std_px(rig)) if shared_errors else 0.0
    colours = material_std_px(rig, maps.column_px)
    good = (flags & int(DEPTH_INVALID)) == 0
    seen_px = np.where(good, maps.column_px, np.float32(np.nan)).reshape(shape)
    # Without lines nobody could have seen a peak.
    without_peak = (~maps.refined & good & (lines is not None)).reshape(shape)
    unusual = (maps.unusual & good).reshape(shape)
    doubt = two_surfaces_std_px(seen_px, noise_px, unusual, without_peak).ravel()
    dq = np.hypot(np.hypot(maps.column_std_px, common), np.hypot(waves, np.hypot(colours, doubt)))
    # In place, because maps of a large picture are large.
    depth_mm, depth_std = maps.depth_mm.reshape(shape), maps.slope_mm_per_px.reshape(shape)
    maps.slope_mm_per_px[:] *= dq
    for values in (maps.depth_mm, maps.slope_mm_per_px):
        values[~good] = np.nan
    mixed = (doubt > np.maximum(MIXED_SIGMAS * maps.column_std_px, MIXED_PX)).reshape(shape)
    beyond = _beyond(flags.reshape(shape))
    surface = reconstruct_surface(rig, depth_mm, depth_std, surface_window_px, beyond, mixed)
    edge = np.where(surface.edge, int(Flag.DEPTH_EDGE), 0).astype(np.uint16)
    std = np.where(good, dq, np.nan).astype(np.float32).reshape(shape)
    light = (maps.amplitude, maps.amplitude_std, maps.offset, maps.offset_std)
    a, da, dark, dark_std = (m.reshape(shape) for m in light)
    return Geometry(
        seen_px, std, depth_mm, depth_std, a, da, dark, dark_std, flags.reshape(shape) | edge, surface,
        mixed=mixed,
    )  # fmt: skip


def _beyond(flags: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Pixels that see something, but out of the calibrated depths."""
    return np.asarray((flags & int(DEPTH_INVALID)) == int(Flag.OUT_OF_RANGE))


def _zero_std_px(rig: Rig) -> float:
    """Deviation of where lines of an uneven spread are counted from, px, unless the geometry has followed."""
    spread = rig.projector_response.spread
    return zero_std_px((0.0 if spread is None else spread.lean_px) - (rig.fitted_lean_px or 0.0))


def _start(code: DecodedCode) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Decoded columns and their deviation (px), flat, where refinement starts."""
    # Also where a bit is undecided: its two answers are neighbours, and the refinement tells them apart.
    if code.fine_column_px is not None and code.fine_std_px is not None:
        return code.fine_column_px.ravel().copy(), code.fine_std_px.ravel().copy()
    start = code.likely_column.astype(np.float32).ravel()
    std = np.full(start.size, WHOLE_PX_STD, np.float32)
    if code.at_edge is not None:
        at_edge = code.at_edge.ravel()
        start[at_edge] += np.float32(0.5)
        std[at_edge] = EDGE_STD_PX
    return start, std


def _lit(white: MergedFrame) -> NDArray[np.bool_]:
    """Where white stands above black, (pixels,)."""
    # Saturated white is bright: its radiance is a lower bound and its variance infinite.
    light = white.radiance.ravel()
    return np.asarray((light > LIT_SIGMAS * np.sqrt(white.variance.ravel())) | white.saturated.ravel())


def _flags(
    rig: Rig,
    code: DecodedCode,
    white: MergedFrame,
    maps: ColumnMaps,
    settled: Settled,
    lit: NDArray[np.bool_],
    has_patterns: bool,
) -> NDArray[np.uint16]:
    light, saturated = white.radiance.ravel(), white.saturated.ravel()
    finite = np.isfinite(light) & np.isfinite(maps.amplitude)
    flags = np.zeros(light.size, np.uint16)

    def mark(where: NDArray[np.bool_], flag: Flag) -> None:
        flags[where] |= np.uint16(int(flag))

    mark(~finite, Flag.NON_FINITE)
    mark(finite & ~lit, Flag.NO_LIGHT)
    # A bit at the edge of a stripe is close to its inverse, but then both answers are one column apart and
    # the refinement finds the right one; without it, or where it fails, the doubt stands.
    mark(code.undecided.ravel() & ~maps.refined & lit, Flag.CODE_UNSURE)
    if has_patterns:
        # The amplitude is a lower bound of nothing: first orders alone never reach this share of white.
        peak = has_peak(maps, slice(None), white) | settled.straight
        mark(lit & maps.refined & ~peak, Flag.NO_LIGHT)
        # Nor is a column right whose lines were measured and are dark.
        mark(lit & is_dark(maps, white) & ~settled.straight, Flag.NO_LIGHT)
        mark(lit & ~maps.refined, Flag.NOT_REFINED)
        mark(lit & maps.unusual, Flag.UNUSUAL_PEAK)
    mark(lit & settled.disagree, Flag.CODES_DISAGREE)
    low, high = rig.depth_range_mm
    mark(lit & ~((maps.depth_mm >= low) & (maps.depth_mm <= high)), Flag.OUT_OF_RANGE)
    mark(maps.saturated | (saturated & ~maps.refined), Flag.SATURATED)
    return flags


def require_pixels(flags: NDArray[np.uint16]) -> None:
    """Raise `DecodeError` when hardly any pixel has a depth, with the main reason and what to do."""
    good = float(np.mean((flags & int(DEPTH_INVALID)) == 0))
    if good >= MIN_SHARE:
        return
    shares = {flag: float(np.mean((flags & int(flag)) != 0)) for flag in _ADVICE}
    flag = next((f for f, share in shares.items() if share >= 0.5), max(shares, key=lambda f: shares[f]))
    raise DecodeError(
        f"Only {good:.2%} of the pixels could be decoded; for {shares[flag]:.0%} of them {REASONS[flag]}."
        f" {_ADVICE[flag]}"
    )


def require_light(
    white: NDArray[np.float32],
    saturated: NDArray[np.bool_],
    advice: str = _ADVICE[Flag.SATURATED],
    least_share: float = MIN_SHARE,
) -> None:
    """Raise `DecodeError` with advice when of the white frame (rows, columns) too small a share is sound."""
    share = float(np.mean(saturated | ~np.isfinite(white)))
    if share > 1 - least_share:
        raise DecodeError(
            f"The white frame is saturated in {share:.0%} of its pixels at every setting, so nothing can be"
            f" measured. {advice}"
        )
