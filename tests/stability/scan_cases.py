"""Hard cases of light, surface and rig, from raw frames to the result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import torch
from numpy.typing import NDArray

from dsl_core.model.geometry import Pose
from dsl_core.model.plan import CapturePlan, Columns, GrayCode, Setting
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.pinhole import pixel_rays
from dsl_core.optics.spectra import hat_moments
from tests.cases.crop import cropped_rig
from tests.stability.bench import (
    MIDDLE,
    SIZE,
    Floats,
    Patch,
    Staged,
    comb_plan,
    grey,
    lines_plan,
    staged,
    true_shading,
)
from tests.stability.case import Case, Outcome, judge_scan

Mask = NDArray[np.bool_]
SHAPE = SIZE[::-1]
ACROSS, DOWN = np.broadcast_to(np.arange(SIZE[0]), SHAPE), np.arange(SIZE[1])[:, None]
LEFT, RIGHT = SIZE[0] // 2 > ACROSS, SIZE[0] // 2 <= ACROSS
#: At the rim of an image half of a colour's neighbours are missing, and demosaicing mirrors the others.
INNER = (ACROSS > 0) & (SIZE[0] - 1 > ACROSS) & (DOWN > 0) & (SIZE[1] - 1 > DOWN)
#: Pixels whose colours mix both halves.
SEAM = np.abs(ACROSS - SIZE[0] / 2 + 0.5) < 2


def scan_case(
    name: str,
    hard: str,
    patch: Callable[[], Patch],
    ends: str,
    says: str = "",
    *,
    where: Mask = INNER,
    limits: Flag | None = None,
    tamper: Callable[[Staged], Staged] = lambda stage: stage,
) -> Case:
    """A case that scans a patch, tampers with what the stages hand over, and judges the result."""

    def run(dtype: torch.dtype) -> Outcome:
        made, stage = _staged(patch)
        return judge_scan(tamper(stage).finish(dtype), made.truth, made.depth_mm, where, limits)

    return Case(name, hard, run, ends, says)  # type: ignore[arg-type]


@cache
def _staged(patch: Callable[[], Patch]) -> tuple[Patch, Staged]:
    """Scanned once for both precisions, and for all cases of the same patch."""
    made = patch()
    return made, staged(made)


def _rig(corner: tuple[int, int] = MIDDLE, **fields: object) -> Rig:
    return cropped_rig(corner, SIZE).model_copy(update=fields)


def plane(tan: float, depth_mm: float = 700.0, rig: Rig | None = None) -> Floats:
    """Depths of a plane turned about the vertical by an angle of tangent ``tan``."""
    x = pixel_rays((rig or _rig()).camera)[0]
    return np.asarray(depth_mm / (1 - tan * (x - x.mean())))


def _step() -> Patch:
    """Two planes that face the camera, 60 mm apart, each with its own light."""
    sides = [true_shading(Patch(depth_mm=np.full(SHAPE, depth))) for depth in (700.0, 760.0)]
    return Patch(depth_mm=np.where(LEFT, 700.0, 760.0), shading=np.where(LEFT, *sides))


def _metamers() -> Patch:
    """Two spectra of one colour under white, left and right."""
    nm = np.arange(392.5, 701.0, 2.5)
    seen = hat_moments(_rig(), 0, nm, 2.5)[0].sum(1)
    wave = np.sin((nm - 430) / 25)
    wave -= seen.T @ np.linalg.solve(seen @ seen.T, seen @ wave)
    right = (ACROSS.ravel() >= SIZE[0] // 2)[None]

    def spectrum(at: Floats) -> Floats:
        return np.asarray(0.5 + 0.25 * np.interp(at, nm, wave / np.abs(wave).max())[:, None] * right)

    return Patch(spectrum=spectrum)


def _spike(at: Floats) -> Floats:
    """A line of 7 nm, under projected lines 12 nm wide: its mean over each band of 5 nm, or of 2.5 nm."""
    half = float(at[1] - at[0])
    fine = np.linspace(-half, half, 81)
    hat = 1 - np.abs(fine) / half
    line = np.exp(-0.5 * ((at[:, None] + fine - 550.0) / 3.0) ** 2)
    return np.asarray(0.05 + 0.9 * (line @ hat) / hat.sum())[:, None]


def _without_efficiency() -> Patch:
    rig = _rig()
    faint = {m: SpectralCurve.of([400, 700], [1e-7, 1e-7]) if m else c for m, c in rig.efficiency.items()}
    return Patch(rig=rig.model_copy(update={"efficiency": faint}))


def _blind_ends() -> Patch:
    def blind(curve: SpectralCurve) -> SpectralCurve:
        nm = np.array(curve.wavelengths_nm)
        return SpectralCurve.of(nm, np.where((nm < 450) | (nm > 640), 1e-9, 1.0) * curve.values)

    rig = _rig()
    return Patch(rig=rig.model_copy(update={"response": tuple(blind(c) for c in rig.response)}))


def _gap() -> Patch:
    rig = _rig()
    return Patch(rig=rig.model_copy(update={"film": rig.film.model_copy(update={"lines_per_mm": 900.0})}))


def _parallel(baseline_mm: float) -> Patch:
    """Both axes along z, side by side; the projector's picture lies where the camera looks."""
    rig = _rig()
    pose = Pose(rotation=((1, 0, 0), (0, 1, 0), (0, 0, 1)), translation_mm=(-baseline_mm, 0.0, 0.0))
    centred = rig.projector.model_copy(update={"cy_px": 180.0})
    return Patch(rig=rig.model_copy(update={"pose": pose, "projector": centred}))


def _exposed(factor: float) -> Patch:
    """A patch under exposures so many times as long."""
    plan = lines_plan()
    settings = tuple(
        Setting(exposure_ms=setting.exposure_ms * factor, level=setting.level) for setting in plan.settings
    )
    return Patch(plan=plan.model_copy(update={"settings": settings}))


def _scaled(scale: float) -> Patch:
    """The same counts from a scene whose light, per ms, is so many times as strong."""
    rig = _rig()
    bright = rig.model_copy(update={"white_scale": rig.white_scale * scale})
    return replace(_exposed(1 / scale), rig=bright)


def _same_patterns() -> Patch:
    """Twelve frames of one and the same pattern."""
    stripes = tuple((float(x // 7 % 2),) * 3 for x in range(640))
    return Patch(plan=CapturePlan(code=GrayCode(rows=False), spectral=Columns(levels=(stripes,) * 12)))


def _only_frame(stage: Staged) -> Staged:
    """All frames saturated but one."""
    std = np.full_like(stage.stack.std, np.inf)
    best = int(np.argmax(stage.stack.radiance.mean((1, 2))))
    std[best] = stage.stack.std[best]
    return replace(stage, stack=replace(stage.stack, std=std))


def _no_weights(stage: Staged) -> Staged:
    return replace(stage, stack=replace(stage.stack, std=np.full_like(stage.stack.std, np.inf)))


def _planted(value: float) -> Callable[[Staged], Staged]:
    """A value in the right half of the line frames, and in a pixel of white."""

    def tamper(stage: Staged) -> Staged:
        radiance, white = stage.stack.radiance.copy(), stage.white.radiance.copy()
        radiance[:, :, SIZE[0] // 2 :] = value
        white[3, 3] = value
        return replace(
            stage, white=replace(stage.white, radiance=white), stack=replace(stage.stack, radiance=radiance)
        )

    return tamper


def _denormal(stage: Staged) -> Staged:
    radiance = stage.stack.radiance.copy()
    radiance[:, :, SIZE[0] // 2 :] = 1e-40
    return replace(stage, stack=replace(stage.stack, radiance=radiance))


CASES = (
    scan_case("black", "nothing comes back", lambda: Patch(spectrum=grey(0.0)), "flagged", "NO_LIGHT"),
    scan_case("near-black", "0.3 % comes back", lambda: Patch(spectrum=grey(0.003)), "right"),
    scan_case("bright", "the longer exposure saturates", lambda: _exposed(3.0), "right"),
    scan_case("saturated", "all exposures saturate", lambda: _exposed(300.0), "flagged", "SATURATED"),
    scan_case(
        "grazing", "light at 80 degrees", lambda: Patch(depth_mm=plane(-4.0)), "flagged", "BANDS_UNREACHED"
    ),
    scan_case(
        "occluded",
        "no light of the projector on one half",
        lambda: Patch(lit=np.where(LEFT, 1.0, 0.0)),
        "flagged",
        "NO_LIGHT",
        where=RIGHT & ~SEAM,
    ),
    scan_case(
        "beside occlusion",
        "the lit half of it",
        lambda: Patch(lit=np.where(LEFT, 1.0, 0.0)),
        "right",
        where=INNER & LEFT & ~SEAM,
    ),
    scan_case(
        "depth edge",
        "60 mm between neighbours",
        _step,
        "flagged",
        "DEPTH_EDGE|POOR_FIT",
        where=INNER & (np.abs(ACROSS - SIZE[0] / 2 + 0.5) < 1),
    ),
    scan_case(
        "beside a depth edge",
        "four pixels from it",
        _step,
        "right",
        where=INNER & (np.abs(ACROSS - SIZE[0] / 2 + 0.5) > 4),
    ),
    scan_case("order gap", "no first order reaches some bands", _gap, "flagged", "BANDS_UNREACHED"),
    scan_case("both orders", "both first orders reach every band", Patch, "right"),
    scan_case("metamers", "two spectra, one colour under white", _metamers, "right", where=INNER & ~SEAM),
    scan_case(
        "spike",
        "a spectral line of 7 nm, projected ones of 12 nm",
        lambda: Patch(spectrum=_spike),
        "flagged",
        "AT_BOUND",
    ),
    scan_case("reflectance 1.2", "more comes back than went", lambda: Patch(spectrum=grey(1.2)), "right"),
    scan_case(
        "reflectance 2.5",
        "beyond the solver's bound",
        lambda: Patch(spectrum=grey(2.5)),
        "flagged",
        "AT_BOUND",
    ),
    scan_case(
        "efficiency near zero", "first orders of 1e-7", _without_efficiency, "flagged", "BANDS_UNREACHED"
    ),
    scan_case(
        "blind ends", "response of 1e-9 below 450 and above 640 nm", _blind_ends, "flagged", "BANDS_UNREACHED"
    ),
    scan_case(
        "nearest depth",
        "500 mm, where the range begins",
        lambda: Patch(rig=_rig((280, 260)), depth_mm=np.full(SHAPE, 501.0)),
        "right",
    ),
    scan_case(
        "farthest depth", "1000 mm, where it ends", lambda: Patch(depth_mm=np.full(SHAPE, 998.0)), "right"
    ),
    scan_case(
        "too near",
        "470 mm",
        lambda: Patch(rig=_rig((280, 260)), depth_mm=np.full(SHAPE, 470.0)),
        "flagged",
        "OUT_OF_RANGE",
    ),
    scan_case(
        "too far", "1200 mm", lambda: Patch(depth_mm=np.full(SHAPE, 1200.0)), "flagged", "OUT_OF_RANGE"
    ),
    scan_case("parallel axes", "camera and projector look the same way", lambda: _parallel(60.0), "right"),
    scan_case("almost no baseline", "1 mm between the centres", lambda: _parallel(1.0), "flagged"),
    scan_case(
        "collinear patterns", "twelve frames of one pattern", _same_patterns, "flagged", "BANDS_UNREACHED"
    ),
    scan_case(
        "fewer frames than bands",
        "16 frames for 47 bands",
        lambda: Patch(plan=comb_plan(32)),
        "flagged",
        "BANDS_UNREACHED",
    ),
    scan_case("one good frame", "all others saturated", Patch, "flagged", "NOT_REFINED", tamper=_only_frame),
    scan_case(
        "weights all zero", "every line frame saturated", Patch, "flagged", "NOT_REFINED", tamper=_no_weights
    ),
    scan_case("scale 1e-6", "a millionth of the light per ms", lambda: _scaled(1e-6), "right"),
    scan_case("scale 1e6", "a million times the light per ms", lambda: _scaled(1e6), "right"),
    scan_case(
        "denormals",
        "line frames of 1e-40",
        Patch,
        "flagged",
        "NO_LIGHT",
        where=RIGHT & ~SEAM,
        tamper=_denormal,
    ),
    scan_case(
        "not a number",
        "line frames of NaN",
        Patch,
        "flagged",
        "NON_FINITE|NOT_REFINED",
        where=RIGHT & ~SEAM,
        tamper=_planted(np.nan),
    ),
    scan_case(
        "infinity",
        "line frames of infinity",
        Patch,
        "flagged",
        "NON_FINITE|NOT_REFINED",
        where=RIGHT & ~SEAM,
        tamper=_planted(np.inf),
    ),
)
