"""Columns and depths of chosen pixels, in chunks and threads."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import triangulate
from dsl_core.optics.image_formation import one_if_grey
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.spread.field import widths_at
from dsl_core.optics.unlit import unlit_px
from dsl_core.progress import NoProgress, Progress
from dsl_core.reconstruction.columns.column import Column, refine
from dsl_core.reconstruction.columns.dark_offset import dark_offset
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from dsl_core.reconstruction.columns.pattern_column import first_order_share, refine_by_profiles
from dsl_core.reconstruction.hdr import MergedFrame
from dsl_core.reconstruction.merge import LineStack
from dsl_core.solve.many import Check, work_through
from dsl_core.solve.threads import one_kernel_thread

CHUNK = 4096
Floats = NDArray[np.float32]
Indices = NDArray[np.intp]
#: Deviation of a column that only a whole pixel is known of.
WHOLE_PX_STD = 12**-0.5
#: A dark offset that unlit frames measure to this share of the black frames' own noise counts as known.
OFFSET_KNOWN = 1 / 3


@dataclass(frozen=True)
class ColumnMaps:
    """What is found of some pixels, each (P,).

    Column and deviation (px), zero-order amplitude and its deviation, dark offset (DN per ms) and how far all
    frames may still be off it, whether lines refined the column, have another shape there than expected and
    are saturated, depth (mm) and its slope (mm per px).
    """

    column_px: Floats
    column_std_px: Floats
    amplitude: Floats
    amplitude_std: Floats
    offset: Floats
    offset_std: Floats
    refined: NDArray[np.bool_]
    unusual: NDArray[np.bool_]
    saturated: NDArray[np.bool_]
    depth_mm: NDArray[np.float64]
    slope_mm_per_px: NDArray[np.float64]

    @classmethod
    def empty(cls, count: int) -> ColumnMaps:
        """Room for so many pixels."""
        q, dq, a, da, dark, dark_std = (np.empty(count, np.float32) for _ in range(6))
        refined, unusual, saturated = np.zeros((3, count), bool)
        return cls(
            q, dq, a, da, dark, dark_std, refined, unusual, saturated, np.empty(count), np.empty(count)
        )

    def put(self, where: Indices | slice, other: ColumnMaps) -> None:
        """Replace some pixels by those of other maps."""
        for field in fields(self):
            getattr(self, field.name)[where] = getattr(other, field.name)

    def of(self, where: Indices | NDArray[np.bool_]) -> ColumnMaps:
        """Some of the pixels."""
        return ColumnMaps(**{field.name: getattr(self, field.name)[where] for field in fields(self)})


@dataclass(frozen=True)
class ColumnFinder:
    """Refines decoded columns on the frames of the spectral patterns, if there are any, and triangulates."""

    rig: Rig
    white: MergedFrame
    stack: LineStack
    lines: LineSet | None
    profiles: NDArray[np.float64] | None
    device: str = "cpu"
    #: Where the first pixel of ``white`` and ``stack`` is in the whole picture, a flat index.
    first: int = 0
    #: Relative error of the modelled peak of lines, None for the usual one.
    peak_error: float | None = None

    def find(
        self,
        pixels: Indices,
        start_px: Floats,
        start_std_px: Floats | None = None,
        progress: Progress | None = None,
    ) -> ColumnMaps:
        """Columns of pixels (P,), flat indices into the stack, from decoded ones (P,) with deviations."""
        maps = ColumnMaps.empty(len(pixels))

        def work(start: int, _: Check) -> None:
            part = slice(start, min(start + CHUNK, len(pixels)))
            std = None if start_std_px is None else start_std_px[part]
            maps.put(part, self._chunk(pixels[part], start_px[part], std))

        with one_kernel_thread():
            work_through(work, range(0, len(pixels), CHUNK), 2, "columns", progress or NoProgress())
        return maps

    def _chunk(self, pixels: Indices, start_px: Floats, std_px: Floats | None) -> ColumnMaps:
        # A slice is a view; picking single pixels copies.
        whole = len(pixels) > 0 and pixels[-1] - pixels[0] == len(pixels) - 1
        where = slice(int(pixels[0]), int(pixels[-1]) + 1) if whole else pixels
        column, offset, open_offset = self._columns(where, torch.as_tensor(start_px, device=self.device))
        spread = column.std_px.cpu().numpy()
        is_so = (column.refined, column.unusual, column.saturated)
        refined, unusual, saturated = (v.cpu().numpy() for v in is_so)
        if std_px is not None:
            spread = np.where(refined, spread, std_px)
        at = torch.as_tensor(pixels + self.first, device=self.device)
        depth, slope = triangulate(self.rig, at, column.column_px.double())
        a, da = (v.cpu().numpy() for v in (column.amplitude, column.amplitude_std))
        dark, dark_std = (v.cpu().numpy() for v in (offset, open_offset))
        q, z, dz = (v.cpu().numpy() for v in (column.column_px, depth, slope))
        return ColumnMaps(q, spread, a, da, dark, dark_std, refined, unusual, saturated, z, dz)

    def _columns(self, where: Indices | slice, start: Tensor) -> tuple[Column, Tensor, Tensor]:
        """Columns, dark offset, and how far all frames of a pixel may be off it."""
        black_std = torch.as_tensor(self.stack.black_std.ravel()[where], device=self.device)
        if self.profiles is None:
            return self._of_white(where, start), torch.zeros_like(start), black_std
        stack = self.stack
        y = torch.as_tensor(stack.radiance.reshape(len(stack.radiance), -1)[:, where], device=self.device)
        std = torch.as_tensor(stack.std.reshape(len(stack.std), -1)[:, where], device=self.device)
        if self.lines is None:
            return self._of_patterns(where, start, y, std), torch.zeros_like(start), black_std
        widths = widths_at(self.rig, self._places(where, start), start)
        column, offset, offset_std = _on_lines(start, y, std, self.lines, self.rig, widths, self.peak_error)
        known = offset_std < OFFSET_KNOWN * black_std
        if self.rig.sensor.rounds_light:
            # Lines round their faint light as much as dark frames do, and all lines of a pixel alike.
            known, offset_std = torch.zeros_like(known), black_std
        return column, offset, torch.where(known, 0.0, torch.minimum(offset_std, black_std))

    def _of_patterns(self, where: Indices | slice, start: Tensor, y: Tensor, std: Tensor) -> Column:
        """Columns from any pattern set, with what the first orders of a grey surface add to its frames."""
        assert self.profiles is not None
        profiles = one_if_grey(self.profiles)
        light = first_order_share(self.rig, profiles, self._places(where, start), start)
        return refine_by_profiles(start, y, std, profiles, self.rig.projector_response, light)

    def _places(self, where: Indices | slice, like: Tensor) -> Tensor:
        """Flat indices into the whole picture."""
        index = np.arange(where.start, where.stop) if isinstance(where, slice) else where
        return torch.as_tensor(index + self.first, device=like.device)

    def _of_white(self, where: Indices | slice, start: Tensor) -> Column:
        """What is known without any pattern but white."""
        amplitude = torch.as_tensor(self.white.radiance.ravel()[where], device=self.device)
        spread = torch.as_tensor(self.white.variance.ravel()[where], device=self.device).sqrt()
        none = torch.zeros_like(start, dtype=torch.bool)
        return Column(start, torch.full_like(start, WHOLE_PX_STD), amplitude, spread, none, none, none)


def _on_lines(
    start: Tensor,
    y: Tensor,
    std: Tensor,
    lines: LineSet,
    rig: Rig,
    widths: Tensor | None,
    peak_error: float | None,
) -> tuple[Column, Tensor, Tensor]:
    response = rig.projector_response
    unlit = unlit_px(rig, lines.width_px)
    peaks = LinePeaks(start, y, std, lines, response, widths).without_offset(unlit)
    column = refine(peaks, peak_error)
    return column, *dark_offset(column.column_px, column.amplitude, y, std, lines, response, unlit)
