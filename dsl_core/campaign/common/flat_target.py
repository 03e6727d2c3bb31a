"""Scans of a flat target: how they are captured, and what calibrations read from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.colour.color_checker import LIGHTS
from dsl_core.calibration.common.plane import TargetPlane, bulge_mm, fit_plane
from dsl_core.calibration.light.chain import LineScan
from dsl_core.campaign.common.depths import target_range_mm
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.common.same_white import keep_white, require_same_white
from dsl_core.campaign.common.white_shot import bracket, shoot_white
from dsl_core.errors import CalibrationError
from dsl_core.model.frames import FrameSource
from dsl_core.model.plan import CapturePlan, Columns, GrayCode, ScanLines
from dsl_core.model.rig import Rig
from dsl_core.optics.sensor import relative_gain
from dsl_core.optics.shading import plane_shading
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from dsl_core.reconstruction.geometry import Geometry
    from dsl_core.reconstruction.merge import LineStack

#: Which of the lights is white.
WHITE = 3
#: What is shown after all others: it tells whether the light of the room is what it was.
BLACK = (0.0, 0.0, 0.0)
#: Pixels that are used of each scan of lines: with more, noise no longer limits the correction.
PIXELS = 6000
#: A flat target that fills the picture has at least this share of the lit pixels on one plane.
FLAT_SHARE = 0.8


@dataclass(frozen=True)
class TargetPictures:
    """Mosaics (lights, rows, columns), DN per ms at full drive, their variance, and where any is saturated.

    ``depth_mm`` (rows, columns) comes from whole projector columns; ``lit`` marks where it means something,
    ``beyond`` where it is far from all depths of the rig.
    ``dark`` is the mosaic of black after all others, minus that before them, with its variance: None in
    captures without it.
    """

    radiance: NDArray[np.float64]
    variance: NDArray[np.float64]
    saturated: NDArray[np.bool_]
    depth_mm: NDArray[np.float64]
    lit: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    dark: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def light_change(self, pixels: NDArray[np.bool_]) -> tuple[float, float] | None:
        """By how much the light of the room changed meanwhile, as a share of white, and its deviation.

        Means over ``pixels`` (rows, columns); None where black was not captured again.
        """
        if self.dark is None:
            return None
        change, variance = (float(each[pixels].mean()) for each in self.dark)
        white = float(self.radiance[WHITE][pixels].mean())
        return change / white, float(np.sqrt(variance / max(pixels.sum(), 1))) / white

    def plane(
        self, rig: Rig, start: NDArray[np.bool_], within: NDArray[np.bool_] | None = None
    ) -> TargetPlane:
        """The plane of the target, which ``start`` certainly belongs to and which is ``within`` a region.

        Raises `CalibrationError` when there is none.
        """
        far = self.depth_mm[start & self.beyond]
        if far.size > (start & self.lit).sum():
            low, high = rig.depth_range_mm
            raise CalibrationError(
                f"The target seems to be {np.median(far):.0f} mm from the camera; this rig is for {low:g} to"
                f" {high:g} mm (depth_range_mm). Move the target there; if it is there, calibrate the"
                " geometry again."
            )
        return fit_plane(rig, self.depth_mm, self.lit if within is None else self.lit & within, start)


def capture_uniform(bench: Bench, step: Step, ratio: float, progress: Progress) -> None:
    """Code and uniform pictures of a step, black last; a scan that was begun continues as it was planned.

    Exposures follow a test shot; ``ratio`` above one adds an exposure that much longer, for dark patches.
    Raises `CalibrationError` where white is not what that shot saw.
    """
    width = bench.devices.projector.info.width_px

    def plan() -> CapturePlan:
        white = shoot_white(bench)
        keep_white(bench, step, white)
        return CapturePlan(
            name=step.title,
            code=GrayCode(rows=False),
            spectral=Columns(levels=tuple((tuple(light),) * width for light in (*LIGHTS.tolist(), BLACK))),
            settings=bracket(bench.rig, white, step.title, ratio),
            code_settings=(0,),
        )

    bench.scan(step, plan, progress)
    require_same_white(bench, step)


def read_uniform(source: FrameSource, rig: Rig, progress: Progress) -> TargetPictures:
    """Merge the uniform pictures of a scan and triangulate its code; raises `DecodeError`, `StoreError`."""
    import torch

    from dsl_core.optics.correspondence import triangulate
    from dsl_core.reconstruction.geometry import LIT_SIGMAS
    from dsl_core.reconstruction.light.early_ends import EarlyEnds
    from dsl_core.reconstruction.merge import MergedScan, check_source, decode_columns
    from dsl_core.solve.threads import one_kernel_thread

    check_source(source, rig)
    merged = MergedScan(EarlyEnds(source, rig.sensor), rig)
    code, white = decode_columns(merged, progress)
    shape = white.radiance.shape
    with one_kernel_thread():
        columns = torch.as_tensor(code.likely_column.ravel().astype(float))
        depth, _ = triangulate(rig, torch.arange(columns.numel()), columns)
    count = len(LIGHTS)
    pictures = [merged.merge("spectral", light) for light in range(count)]
    # Captures of earlier versions have no black after the others.
    last = merged.merge("spectral", count) if source.plan.spectral_count > count else None
    lit = white.saturated | (white.radiance > LIT_SIGMAS * np.sqrt(white.variance))
    lit &= ~code.undecided
    near_mm, far_mm = target_range_mm(rig)
    depth_mm = depth.numpy().reshape(shape)
    inside = (depth_mm > near_mm) & (depth_mm < far_mm)
    return TargetPictures(
        np.stack([picture.radiance for picture in pictures]).astype(float),
        np.stack([picture.variance for picture in pictures]).astype(float),
        np.any([picture.saturated for picture in pictures], axis=0),
        depth_mm,
        lit & inside,
        lit & ~inside,
        None if last is None else (last.radiance.astype(float), last.variance.astype(float)),
    )


def middle(shape: tuple[int, ...]) -> NDArray[np.bool_]:
    """The middle of an image, half as wide and high."""
    inside = np.zeros(shape, bool)
    rows, columns = (slice(round(n / 4), round(3 * n / 4)) for n in shape)
    inside[rows, columns] = True
    return inside


def scanned_geometry(
    source: FrameSource, rig: Rig, progress: Progress | None = None, *, shared_errors: bool = True
) -> tuple[Rig, LineStack, Geometry]:
    """The rig as a scan with code and lines shows it, its lines, and its geometry.

    Raises what a reconstruction raises. As in one, columns follow the line spread that the scan itself shows.
    Deviations contain what all its columns have in common where ``shared_errors`` are wanted.
    """
    from dsl_core.optics.lines.line_set import LineSet
    from dsl_core.reconstruction.columns.line_spread import own_spread, with_own_spread
    from dsl_core.reconstruction.geometry import reconstruct_geometry, require_light, require_pixels
    from dsl_core.reconstruction.light.early_ends import EarlyEnds
    from dsl_core.reconstruction.merge import MergedScan, check_source, decode_columns, stack_lines

    plan = check_source(source, rig)
    merged = MergedScan(EarlyEnds(source, rig.sensor), rig)
    code, white = decode_columns(merged, progress)
    require_light(white.radiance, white.saturated)
    stack = stack_lines(merged, progress)
    rig = with_own_spread(rig, own_spread(rig, LineSet.of(plan), code, white, stack))
    geometry = reconstruct_geometry(
        rig, plan, code, white, stack, shared_errors=shared_errors, progress=progress
    )
    require_pixels(geometry.flags)
    return rig, stack, geometry


def diffuser_lines(
    source: FrameSource, rig: Rig, progress: Progress | None = None, pixels: int = PIXELS
) -> tuple[Rig, LineScan]:
    """Reconstruct a scan with code and lines of a flat target: the rig as it shows it, and pixels of it.

    Pixels are chosen evenly. Depth and shading are those of the plane through them. Raises `CalibrationError`
    when the scan has no scan lines or the target is not flat, and what a reconstruction raises.
    """
    from dsl_core.reconstruction.scan_result import known_pixels

    lines = scan_lines_of(source)
    rig, stack, geometry = scanned_geometry(source, rig, progress)
    known = known_pixels(geometry)
    # One plane for all pixels: its shading has none of the noise of normals of single pixels.
    flat = fit_plane(rig, geometry.depth_mm, known.valid)
    share = flat.on_plane.sum() / max(known.valid.sum(), 1)
    if share < FLAT_SHARE:
        raise CalibrationError(
            f"Only {share:.0%} of the lit pixels are on one plane. Fill the picture with the flat white"
            " target, and capture the step again."
        )
    depth_mm, shading = flat.plane.depth_mm(rig), plane_shading(rig, flat.plane) * relative_gain(rig)
    valid = np.flatnonzero(flat.on_plane)
    # At random, since any regular step would meet the colours of the mosaic unevenly.
    chosen = np.sort(np.random.default_rng(0).permutation(valid)[:pixels])
    return rig, LineScan(
        lines=lines,
        pixels=chosen.astype(np.int64),
        depth_mm=depth_mm.ravel()[chosen],
        shading=shading.ravel()[chosen],
        column_px=known.column_px.ravel()[chosen].astype(float),
        amplitude=known.amplitude.ravel()[chosen].astype(float),
        offset=known.offset.ravel()[chosen].astype(float),
        radiance=stack.radiance.reshape(len(stack.radiance), -1)[:, chosen],
        std=stack.std.reshape(len(stack.std), -1)[:, chosen].astype(np.float32),
        bulge_mm=bulge_mm(rig, geometry.depth_mm.astype(np.float64), flat),
    )


def line_frames(
    source: FrameSource, rig: Rig, pixels: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The line frames of a scan at some pixels: radiance and its deviation, each (frames, pixels)."""
    from dsl_core.reconstruction.light.early_ends import EarlyEnds
    from dsl_core.reconstruction.merge import MergedScan, check_source

    plan = check_source(source, rig)
    merged = MergedScan(EarlyEnds(source, rig.sensor), rig)
    radiance = np.empty((plan.spectral_count, len(pixels)), np.float32)
    std = np.empty_like(radiance)
    for frame in range(plan.spectral_count):
        picture = merged.merge("spectral", frame)
        radiance[frame] = picture.radiance.ravel()[pixels]
        std[frame] = np.sqrt(picture.variance.ravel()[pixels])
    return radiance, std


def scan_lines_of(source: FrameSource) -> ScanLines:
    """The lines of a scan; raises `CalibrationError` when it was made with other patterns."""
    if not isinstance(source.plan.spectral, ScanLines):
        raise CalibrationError(
            f"The plan {source.plan.name!r} has no scan lines, which this calibration measures. Capture the"
            " step again with a plan of scan lines."
        )
    return source.plan.spectral
