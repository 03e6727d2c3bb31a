"""Uniform pictures of a flat target with a code: the plane it lies in, and linear pictures of each light."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.common.plane import TargetPlane, fit_plane
from dsl_core.campaign.common.exposures import bracket, measure_white
from dsl_core.campaign.common.recipe import Bench
from dsl_core.campaign.common.step_scan import scan_of, scan_step
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Columns, GrayCode
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

#: Drive of red, green and blue in each uniform picture.
LIGHTS = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0))
WHITE = 3
#: A pixel is lit when white stands this many deviations above black.
LIT_SIGMAS = 8.0


@dataclass(frozen=True)
class FlatTarget:
    """Mosaics (lights, rows, columns), DN per ms at full drive, their variance, and where any is saturated.

    ``depth_mm`` (rows, columns) comes from whole projector columns; ``lit`` marks where it means something.
    """

    radiance: NDArray[np.float64]
    variance: NDArray[np.float64]
    saturated: NDArray[np.bool_]
    depth_mm: NDArray[np.float64]
    lit: NDArray[np.bool_]

    def plane(
        self, rig: Rig, start: NDArray[np.bool_], within: NDArray[np.bool_] | None = None
    ) -> TargetPlane:
        """The plane of the target, which ``start`` surely belongs to and which lies ``within`` a region.

        Raises `CalibrationError` when there is none.
        """
        return fit_plane(rig, self.depth_mm, self.lit if within is None else self.lit & within, start)


def capture_flat_target(bench: Bench, folder: Path, name: str, ratio: float, progress: Progress) -> None:
    """Code and uniform pictures into the step's folder; a scan that was begun goes on as it was planned.

    Exposures follow a test shot; ``ratio`` above one adds an exposure that much longer, for dark patches.
    """
    width = bench.devices.projector.info.width_px

    def plan() -> CapturePlan:
        return CapturePlan(
            name=name,
            code=GrayCode(rows=False),
            spectral=Columns(levels=tuple((light,) * width for light in LIGHTS)),
            settings=bracket(bench.rig, measure_white(bench.devices, bench.rig), name, ratio),
            code_settings=(0,),
        )

    scan_step(bench.devices, folder, plan, progress)


def read_flat_target(folder: Path, rig: Rig, progress: Progress) -> FlatTarget:
    """The captures of a step; raises `DecodeError` and `StoreError`."""
    return flat_target(scan_of(folder), rig, progress)


def flat_target(source: FrameSource, rig: Rig, progress: Progress) -> FlatTarget:
    """Merge the uniform pictures of a scan and triangulate its code."""
    import torch

    from dsl_core.reconstruction.depth import triangulate
    from dsl_core.reconstruction.merge import MergedScan, check_source, decode_columns
    from dsl_core.solve.threads import one_kernel_thread

    check_source(source, rig)
    merged = MergedScan(source, rig)
    code, white = decode_columns(merged, progress)
    shape = white.radiance.shape
    with one_kernel_thread():
        columns = torch.as_tensor(code.likely_column.ravel().astype(float))
        depth, _ = triangulate(rig, torch.arange(columns.numel()), columns)
    pictures = [merged.merge("spectral", light) for light in range(len(LIGHTS))]
    lit = white.saturated | (white.radiance > LIT_SIGMAS * np.sqrt(white.variance))
    low, high = rig.depth_range_mm
    depth_mm = depth.numpy().reshape(shape)
    return FlatTarget(
        np.stack([picture.radiance for picture in pictures]).astype(float),
        np.stack([picture.variance for picture in pictures]).astype(float),
        np.any([picture.saturated for picture in pictures], axis=0),
        depth_mm,
        lit & ~code.undecided & (depth_mm > low) & (depth_mm < high),
    )


def middle(shape: tuple[int, ...], share: float = 0.5) -> NDArray[np.bool_]:
    """The middle of an image, ``share`` of its width and height."""
    inside = np.zeros(shape, bool)
    rows, columns = (slice(round(n * (1 - share) / 2), round(n * (1 + share) / 2)) for n in shape)
    inside[rows, columns] = True
    return inside
