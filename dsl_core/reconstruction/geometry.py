"""Columns, depth, points and normals of a scan, with the reasons why pixels fail."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.plan import CapturePlan
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.patterns.gray_code import DecodedCode
from dsl_core.reconstruction.column import Column, dark_offset, refine
from dsl_core.reconstruction.depth import triangulate
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.line_set import LineSet
from dsl_core.reconstruction.merge import LineStack
from dsl_core.reconstruction.pattern_column import radiance_profiles, refine_by_profiles
from dsl_core.reconstruction.surface import Surface, reconstruct_surface

#: A pixel is lit when white stands this many standard deviations above black.
LIT_SIGMAS = 8.0
#: The zero order must carry this share of the white signal; with less, only first orders reach the pixel.
ZERO_ORDER_SHARE = 0.4
CHUNK = 16384


@dataclass(frozen=True)
class Geometry:
    """Maps (rows, columns) of columns, depths and deviations, zero-order amplitude, dark offset and flags."""

    column_px: NDArray[np.float32]
    column_std_px: NDArray[np.float32]
    depth_mm: NDArray[np.float64]
    depth_std_mm: NDArray[np.float64]
    amplitude: NDArray[np.float32]
    amplitude_std: NDArray[np.float32]
    offset: NDArray[np.float32]
    flags: NDArray[np.uint16]
    surface: Surface

    def points_mm(self, rig: Rig) -> NDArray[np.float32]:
        """Points in camera coordinates, (3, rows, columns), NaN where there is no depth."""
        return (pixel_rays(rig.camera) * self.depth_mm).astype(np.float32)


def reconstruct_geometry(
    rig: Rig,
    plan: CapturePlan,
    code: DecodedCode,
    white: MergedFrame,
    stack: LineStack,
    *,
    refine_columns: bool = True,
    surface_window_px: int | None = None,
    device: str = "cpu",
) -> Geometry:
    """Refine decoded columns on the frames of the spectral patterns, triangulate, and fit the surface.

    ``surface_window_px`` is the window of the plane fits; by default it follows from the image's width.
    """
    shape = code.column.shape
    # Also where a bit is undecided: its two answers are neighbours, and the refinement tells them apart.
    coarse = code.likely_column.astype(np.float32).ravel()
    maps = {name: np.empty(coarse.size, np.float32) for name in ("q", "dq", "a", "da", "offset")}
    refined = np.zeros(coarse.size, bool)
    depth, slope = np.empty(coarse.size), np.empty(coarse.size)
    lines = LineSet.of(plan) if refine_columns else None
    profiles = radiance_profiles(rig, plan) if refine_columns and plan.spectral_count else None

    def work(start: int) -> None:
        part = slice(start, min(start + CHUNK, coarse.size))
        column, offset = _columns(rig, coarse, white, stack, lines, profiles, part, device)
        for name, values in zip(maps, (*_of(column), offset), strict=True):
            maps[name][part] = values.cpu().numpy()
        refined[part] = column.refined.cpu().numpy()
        pixels = torch.arange(part.start, part.stop, device=device)
        z, s = triangulate(rig, pixels, column.column_px.double())
        depth[part], slope[part] = z.cpu().numpy(), s.cpu().numpy()

    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with ThreadPoolExecutor(2) as pool:
            list(pool.map(work, range(0, coarse.size, CHUNK)))
    finally:
        torch.set_num_threads(before)
    dq = np.hypot(maps["dq"], rig.column_std_px)
    flags = _flags(rig, code, white, maps["a"], refined, depth, profiles is not None)
    good = (flags & int(Flag.NO_LIGHT | Flag.CODE_UNSURE | Flag.OUT_OF_RANGE | Flag.NON_FINITE)) == 0
    depth_mm = np.where(good, depth, np.nan).reshape(shape)
    depth_std = np.where(good, dq * slope, np.nan).reshape(shape)
    surface = reconstruct_surface(rig, depth_mm, depth_std, surface_window_px)
    edge = np.where(surface.edge, int(Flag.DEPTH_EDGE), 0).astype(np.uint16)
    q, a, da, offset = (maps[name].reshape(shape) for name in ("q", "a", "da", "offset"))
    q = np.where(good.reshape(shape), q, np.float32(np.nan))
    std = np.where(good, dq, np.nan).astype(np.float32).reshape(shape)
    return Geometry(q, std, depth_mm, depth_std, a, da, offset, flags.reshape(shape) | edge, surface)


def _of(column: Column) -> tuple[torch.Tensor, ...]:
    return column.column_px, column.std_px, column.amplitude, column.amplitude_std


def _columns(
    rig: Rig,
    coarse: NDArray[np.float32],
    white: MergedFrame,
    stack: LineStack,
    lines: LineSet | None,
    profiles: NDArray[np.float64] | None,
    part: slice,
    device: str,
) -> tuple[Column, torch.Tensor]:
    start = torch.as_tensor(coarse[part], device=device)
    if profiles is None:
        amplitude = torch.as_tensor(white.radiance.ravel()[part], device=device)
        spread = torch.as_tensor(white.variance.ravel()[part], device=device).sqrt()
        none = torch.zeros_like(start, dtype=torch.bool)
        return Column(start, torch.full_like(start, 12**-0.5), amplitude, spread, none), torch.zeros_like(
            start
        )
    y = torch.as_tensor(stack.radiance.reshape(len(stack.radiance), -1)[:, part], device=device)
    std = torch.as_tensor(stack.std.reshape(len(stack.std), -1)[:, part], device=device)
    if lines is None:
        column = refine_by_profiles(start, y, std, profiles, rig.projector_response)
        return column, torch.zeros_like(start)
    column = refine(start, y, std, lines, rig.projector_response)
    return column, dark_offset(column.column_px, column.amplitude, y, std, lines, rig.projector_response)


def _flags(
    rig: Rig,
    code: DecodedCode,
    white: MergedFrame,
    amplitude: NDArray[np.float32],
    refined: NDArray[np.bool_],
    depth: NDArray[np.float64],
    has_patterns: bool,
) -> NDArray[np.uint16]:
    light, noise = white.radiance.ravel(), np.sqrt(white.variance.ravel())
    # Saturated white is bright: its radiance is a lower bound and its variance infinite.
    lit = (light > LIT_SIGMAS * noise) | white.saturated.ravel()
    finite = np.isfinite(light) & np.isfinite(amplitude)
    flags = np.zeros(light.size, np.uint16)

    def mark(where: NDArray[np.bool_], flag: Flag) -> None:
        flags[where] |= np.uint16(int(flag))

    mark(~finite, Flag.NON_FINITE)
    mark(finite & ~lit, Flag.NO_LIGHT)
    # A bit at the edge of a stripe is close to its inverse, but then both answers are one column apart and
    # the refinement finds the right one; without it, or where it fails, the doubt stands.
    mark(code.undecided.ravel() & ~refined & lit, Flag.CODE_UNSURE)
    if has_patterns:
        # The amplitude is a lower bound of nothing: first orders alone never reach this share of white.
        faint = lit & refined & ~white.saturated.ravel() & (amplitude < ZERO_ORDER_SHARE * light)
        mark(faint, Flag.NO_LIGHT)
        mark(lit & ~refined, Flag.NOT_REFINED)
    low, high = rig.depth_range_mm
    mark(lit & ~((depth >= low) & (depth <= high)), Flag.OUT_OF_RANGE)
    mark(white.saturated.ravel() & ~refined, Flag.SATURATED)
    return flags
