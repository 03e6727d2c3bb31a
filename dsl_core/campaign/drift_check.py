"""One quick shot of a flat target, compared with what a calibration predicts."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dsl_core import pipeline
from dsl_core.campaign.common.recipe import Bench
from dsl_core.campaign.common.white_shot import FILL, LONG_RATIO, WhiteLevel, bracket, shoot_white
from dsl_core.devices.base import DeviceRig
from dsl_core.errors import CalibrationError
from dsl_core.model.figure import Figure
from dsl_core.model.frames import FrameSource
from dsl_core.model.placement import Placement
from dsl_core.model.plan import CapturePlan, GrayCode, ScanLines, Setting
from dsl_core.model.presets import PUBLISHED_PERIOD_MS, on_cycles
from dsl_core.model.rig import Rig
from dsl_core.progress import Progress

if TYPE_CHECKING:
    from dsl_core.calibration.common.plane import TargetPlane
    from dsl_core.calibration.drift.light import PlaneSignals
    from dsl_core.patterns.gray_code import DecodedCode
    from dsl_core.reconstruction.hdr import MergedFrame

Floats = NDArray[np.float64]

PLACEMENT = Placement(target="spectralon", film=True)
#: One line a frame this far apart: together their first orders reach every part of the picture.
LINE_STEP_PX = 40
#: Pixels whose light is compared, chosen at random.
PIXELS = 4000
#: Share of the pixels that white must not saturate: of fewer the plane and its light are not known.
LEAST_SOUND = 0.5
#: The user cannot lower the exposures of the quick shot.
SATURATED_ADVICE = (
    "The check uses its own exposures. Set aperture, gain and the projector's brightness as they were at"
    " the calibration, dim the room, and do not place the target closer than the calibrated depths."
)


def quick_plan(period_ms: float = PUBLISHED_PERIOD_MS) -> CapturePlan:
    """Columns and rows, white and black at a dark setting, a few lines at two settings.

    Exposures are whole colour cycles of a projector with the period: parts of one would change the colour.
    """
    plan = CapturePlan(
        name="drift check",
        code=GrayCode(rows=True),
        spectral=ScanLines(width_px=5, step_px=LINE_STEP_PX, sparse=True),
        settings=(Setting(exposure_ms=500.0 / 3.0, level=0.2), Setting(exposure_ms=1000.0 / 3.0, level=0.8)),
        code_settings=(0,),
    )
    return on_cycles(plan, period_ms)


def drift_settings(rig: Rig, white: WhiteLevel) -> tuple[Setting, ...]:
    """The settings of the quick shot, darker ones where a test shot says that white would saturate in them.

    Raises `CalibrationError` where white saturates in the darkest setting.
    """
    if white.saturated:
        raise CalibrationError(
            f"White is overexposed in one colour cycle at drive level {white.level:g}. {SATURATED_ADVICE}"
        )
    usual, response = quick_plan(rig.frame_period_ms).settings, rig.projector_response
    code = usual[0]
    light = float(response.radiance(code.level) - response.radiance(0.0))
    range_dn = rig.sensor.full_scale_dn - rig.sensor.black_level_dn
    if white.brightest * light * code.exposure_ms <= FILL * range_dn:
        return usual
    return bracket(rig, white, "The target", LONG_RATIO)


def measure_drift(
    devices: DeviceRig, rig: Rig, folder: Path, spectralon: bool, progress: Progress | None = None
) -> tuple[Figure, ...]:
    """Take the quick shot into a session folder and compare it with the calibration.

    The light is judged only when the target is the ``spectralon``: the white that it was calibrated with.
    Raises `CalibrationError` when the target does not fill the picture or is far too bright, and what a scan
    raises.
    """
    from dsl_core.io.scan.as_exposed import as_exposed
    from dsl_core.io.scan.folder import ScanReader

    plan = quick_plan(rig.frame_period_ms)
    # What plays a check back has no other pictures to show.
    if not devices.only_repeats:
        white = shoot_white(Bench(devices, folder, rig))
        plan = plan.model_copy(update={"settings": drift_settings(rig, white)})
    plan = pipeline.fit_plan(plan, devices)
    pipeline.scan(devices, plan, folder, progress)
    return drift_figures(as_exposed(ScanReader(folder)), rig, spectralon, progress)


def drift_figures(
    source: FrameSource,
    rig: Rig,
    spectralon: bool,
    progress: Progress | None = None,
    pixels: int = PIXELS,
) -> tuple[Figure, ...]:
    """The figures of a quick shot, the light compared at that many pixels; see `measure_drift`."""
    from dsl_core.calibration.common.plane import fit_plane
    from dsl_core.calibration.common.white import SPECTRALON, white_target
    from dsl_core.calibration.drift.geometry import geometry_drift
    from dsl_core.calibration.drift.light import film_drift, light_drift
    from dsl_core.patterns.images import spectral_profiles
    from dsl_core.reconstruction.geometry import require_light
    from dsl_core.reconstruction.merge import MergedScan, check_source, decode_columns, stack_lines

    plan = check_source(source, rig)
    merged = MergedScan(source, rig)
    code, white = decode_columns(merged, progress)
    require_light(white.radiance, white.saturated, SATURATED_ADVICE, LEAST_SOUND)
    column, row, depth_mm = _maps(rig, code, white)
    fit = fit_plane(rig, depth_mm, np.isfinite(depth_mm))
    # At random, since any regular step would meet the colours of the mosaic unevenly.
    chosen = np.sort(np.random.default_rng(0).permutation(np.flatnonzero(fit.on_plane))[:pixels])
    figures = geometry_drift(rig, column, row, depth_mm, fit)
    stack, profiles = stack_lines(merged, progress), spectral_profiles(plan)[:, :, 0].astype(float)
    lines = _signals(rig, fit, chosen, profiles, stack.radiance, stack.std)
    reflectance = white_target(rig, None if spectralon else SPECTRALON)
    figures += film_drift(rig, lines, reflectance)
    if spectralon:
        std = np.where(white.saturated, np.inf, np.sqrt(white.variance))
        full = np.ones((1, profiles.shape[1]))
        seen = _signals(rig, fit, chosen, full, white.radiance[None], std[None])
        figures += light_drift(rig, seen, reflectance)
    return tuple(figures)


def _maps(rig: Rig, code: DecodedCode, white: MergedFrame) -> tuple[Floats, Floats, Floats]:
    """Decoded columns and rows, and depth (mm), NaN where unknown, each (rows, columns)."""
    import torch

    from dsl_core.optics.correspondence import triangulate
    from dsl_core.reconstruction.geometry import LIT_SIGMAS

    assert code.row is not None
    lit = (white.radiance > LIT_SIGMAS * np.sqrt(white.variance)) & ~code.undecided
    column, row = (np.where(lit, each, np.nan).astype(float) for each in (code.column, code.row))
    some_column = torch.as_tensor(np.where(lit, code.column, 0).astype(float).ravel())
    depth, _ = triangulate(rig, torch.arange(column.size), some_column)
    return column, row, np.where(lit, depth.numpy().reshape(column.shape), np.nan)


def _signals(
    rig: Rig,
    fit: TargetPlane,
    chosen: NDArray[np.int64],
    profiles: Floats,
    radiance: NDArray[np.floating],
    std: NDArray[np.floating],
) -> PlaneSignals:
    """Frames (frames, rows, columns) at the chosen pixels of the plane."""
    from dsl_core.calibration.drift.light import PlaneSignals
    from dsl_core.optics.sensor import bayer_channels, relative_gain
    from dsl_core.optics.shading import plane_shading

    return PlaneSignals(
        pixels=chosen.astype(np.int64),
        colours=bayer_channels(rig.sensor.bayer, *fit.on_plane.shape).ravel()[chosen],
        depth_mm=fit.plane.depth_mm(rig).ravel()[chosen],
        shading=(plane_shading(rig, fit.plane) * relative_gain(rig)).ravel()[chosen],
        profiles=profiles,
        radiance=radiance.reshape(len(radiance), -1)[:, chosen].astype(float),
        std=std.reshape(len(std), -1)[:, chosen].astype(float),
    )
