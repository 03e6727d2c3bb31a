"""Response and emission from the patches of a chart, with patches held out in turn, and their limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.colour.patches import ChartPose, PatchSamples, PatchSignals, patch_signals
from dsl_core.calibration.common.room_light import light_change_figure
from dsl_core.calibration.light.spectral_refinement import (
    FINE_NM,
    PUBLISHED_WEIGHT,
    UNKNOWNS,
    Refinement,
    SpectralModel,
    SurfaceSignals,
    refine,
    refined_curves,
    residuals,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.color_checker import ColorCheckerCalibration, PatchResult
from dsl_core.model.figure import Figure
from dsl_core.model.geometry import Row3
from dsl_core.model.rig import Rig
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.charts import chart_reflectance
from dsl_core.optics.shading import Plane
from dsl_core.optics.spectra import chain_response
from dsl_core.progress import NoProgress, Progress
from dsl_core.solve.robust import rms

Floats = NDArray[np.float64]

#: What each light is made of: red, green, blue and white pictures.
LIGHTS = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]])
#: Every so many patches are held out together.
FOLDS = 4
#: Patches with more saturated pixels, or fewer pixels, are refused.
SATURATED, MIN_PIXELS = 0.02, 8
#: A patch that has less of the expected light than this share of what the others have is not lit.
LEAST_LIT = 0.1
#: The white that the rig already reproduces is known to this, at best.
WHITE_FLOOR = 2e-4
#: Limits in percent of a patch's white.
RESIDUAL_PERCENT, WORST_PERCENT = 1.5, 4.0
#: The chart may be lit so much otherwise (%) than the Spectralon, and tilted so much (degrees).
LEVEL_PERCENT, MAX_TILT_DEG = 3.0, 20.0
#: It may be so much brighter (%) under one LED than under another: two tables of the chart differ by 1.8 %.
COLOUR_PERCENT = 3.0
#: Fine detail of curves that 24 patches leave open (% of the peak): where edges of the camera's filters are
#: not those of its data sheet, most of it, and patches are explained all the same.
UNSURE_PERCENT = 15.0
#: A patch is grey where its reflectance varies by less than this share of its mean over `BANDS_NM`, and
#: light enough to be judged by.
GREY_SHARE, GREY_FROM = 0.15, 0.15
#: Where curves are judged, nm.
BANDS_NM = (430.0, 660.0)


@dataclass(frozen=True)
class ChartPictures:
    """Mosaics of the chart (lights, rows, columns), DN per ms at full drive, and where each is saturated.

    ``shading`` (rows, columns) is that of the chart's plane times the camera's relative gain.
    """

    radiance: Floats
    saturated: NDArray[np.bool_]
    shading: Floats


def expected_colours(rig: Rig, chart: str) -> Floats:
    """Signals of the 24 patches under white as the rig has it, (24, 3); used to recognise orientations."""
    data = _surfaces(chart)
    return SpectralModel(rig).predict(_zero(), data)[0][:, :, 3]


def measure_patches(
    pictures: ChartPictures, rig: Rig, samples: PatchSamples, chart: str
) -> list[PatchSignals]:
    """Signals at unit shading, for each light; raises `CalibrationError` naming an unusable patch."""
    seen = [
        patch_signals(picture / pictures.shading, pictures.saturated, rig.sensor.bayer, samples)
        for picture in pictures.radiance
    ]
    for p, name in enumerate(chart_reflectance(FINE_NM, chart)):
        share = max(float(light.saturated[p].max()) for light in seen)
        if share > SATURATED:
            raise CalibrationError(
                f"The patch {name!r} of the Color Checker is saturated ({share:.0%} of its pixels). Capture"
                " it again with less light or a shorter exposure."
            )
        count = min(int(light.count[p].min()) for light in seen)
        if count < MIN_PIXELS:
            raise CalibrationError(
                f"The patch {name!r} of the Color Checker has only {count} pixels of one colour. Move the"
                " chart closer."
            )
    require_lit(seen[-1], rig, chart)
    return seen


def require_lit(white: PatchSignals, rig: Rig, chart: str) -> None:
    """Raise `CalibrationError` naming the patches that white does not reach."""
    lit = np.nansum(white.mean, 1) / expected_colours(rig, chart).sum(1)
    dark = lit < LEAST_LIT * np.median(lit)
    if dark.any():
        names = np.array(list(chart_reflectance(FINE_NM, chart)))[dark]
        named = ", ".join(repr(str(name)) for name in names)
        raise CalibrationError(
            f"The projector does not light all patches of the Color Checker: {named} had less than"
            f" {LEAST_LIT:.0%} of the light of the others. Move the chart to where the projected picture"
            " covers all 24 patches, farther away if need be, and take away what shades it."
        )


def refine_on_chart(
    rig: Rig,
    seen: Sequence[PatchSignals],
    pose: ChartPose,
    plane: Plane,
    chart: str,
    progress: Progress | None = None,
) -> ColorCheckerCalibration:
    """Refine the rig's response and emission; ``seen`` are signals of the patches for each of `LIGHTS`.

    The white that the rig reproduces already (from a Spectralon) counts as one more surface. Where held-out
    patches are not explained better than before, the curves stay as they were.
    """
    names = list(chart_reflectance(FINE_NM, chart))
    signal = np.stack([light.mean for light in seen], 2)
    std = np.stack([light.std for light in seen], 2)
    data = _with_white(rig, _surfaces(chart, signal, std))
    progress = progress or NoProgress()
    found = refine(rig, data, weight=None, progress=progress)
    held_out = _held_out(rig, data, found.weight, found.reflectance_error, progress)
    before = _patch_rms(residuals(rig, data, _unchanged(found)))
    if rms(held_out) > rms(before):
        found, held_out = _unchanged(found), before
    response, emission, white_scale = refined_curves(rig, found)
    after = _patch_rms(residuals(rig, data, found))
    patches = tuple(
        PatchResult(
            name=name,
            pixels=int(seen[3].count[p].sum()),
            saturated=max(float(light.saturated[p].max()) for light in seen),
            signal=tuple(tuple(row) for row in signal[p].tolist()),
            std=tuple(tuple(row) for row in std[p].tolist()),
            residual=float(after[p]),
            held_out=float(held_out[p]),
            start=float(before[p]),
        )
        for p, name in enumerate(names)
    )
    published = _held_out(rig, data, PUBLISHED_WEIGHT, None, progress)
    levels = led_levels(rig, signal, chart)
    a, b, c, d = ((float(x), float(y)) for x, y in pose.corners_px)
    return ColorCheckerCalibration(
        chart=chart,
        corners_px=(a, b, c, d),
        quarter_turns=pose.quarter_turns,
        patches=patches,
        response=response,
        emission=emission,
        white_scale=white_scale,
        weight=found.weight,
        reflectance_error=found.reflectance_error,
        chart_level=float(np.expm1(found.chart_level)),
        led_levels=levels,
        reference_rel_std=float(np.hypot(rig.reference_rel_std, disagreement(levels))),
        published_held_out=rms(published),
        tilt_deg=plane.tilt_deg,
        distance_mm=plane.distance_mm,
    )


def led_levels(rig: Rig, signal: Floats, chart: str) -> Row3:
    """Signals of grey patches over those that the rig gives them, minus one, under each LED alone.

    ``signal`` (24, channels, lights) is DN per ms at unit shading. The rig gives a white under each LED what
    the Spectralon showed, so that no curve of camera or LEDs comes in where a patch is grey.
    """
    data = _surfaces(chart)
    given, _ = SpectralModel(rig).predict(_zero(), data)
    seen = data.reflectance[:, (BANDS_NM[0] <= FINE_NM) & (BANDS_NM[1] >= FINE_NM)]
    mean = seen.mean(1)
    grey = (np.ptp(seen, axis=1) < GREY_SHARE * mean) & (mean > GREY_FROM)
    red, green, blue, _ = np.median(signal[grey].sum(1) / given[grey].sum(1), axis=0).tolist()
    return red - 1, green - 1, blue - 1


def disagreement(levels: Row3) -> float:
    """What two whites leave open of each, relative deviation, where chart and Spectralon differ by levels.

    Nothing says which of the two is off, so that each has its part of the difference.
    """
    return float(np.abs(levels).max() / np.sqrt(2))


def _zero() -> Floats:
    return np.zeros(6 * UNKNOWNS + 1)


def _surfaces(chart: str, signal: Floats | None = None, std: Floats | None = None) -> SurfaceSignals:
    reflectance = np.stack(list(chart_reflectance(FINE_NM, chart).values()))
    none = np.zeros((len(reflectance), 3, len(LIGHTS)))
    return SurfaceSignals(
        none if signal is None else signal,
        none if std is None else std,
        reflectance,
        LIGHTS,
        np.ones(len(reflectance), bool),
    )


def _with_white(rig: Rig, data: SurfaceSignals) -> SurfaceSignals:
    """The patches and, last, a perfect diffuser with the signals that the rig gives."""
    white = SurfaceSignals(
        np.zeros((1, 3, len(LIGHTS))),
        np.zeros((1, 3, len(LIGHTS))),
        np.ones((1, len(FINE_NM))),
        LIGHTS,
        np.zeros(1, bool),
    )
    signal, _ = SpectralModel(rig).predict(_zero(), white)
    relative = max(rig.white_scale_rel_std, WHITE_FLOOR)
    std = relative * (signal + 0.1 * signal.max(2, keepdims=True))
    return SurfaceSignals(
        np.concatenate([data.signal, signal]),
        np.concatenate([data.std, std]),
        np.concatenate([data.reflectance, white.reflectance]),
        LIGHTS,
        np.concatenate([data.own_level, white.own_level]),
    )


def _held_out(
    rig: Rig, data: SurfaceSignals, weight: float, error: float | None, progress: Progress
) -> Floats:
    """Residual of each patch with curves fitted to the patches of the other folds, (24,)."""
    patch = np.arange(len(data.own_level))
    out = np.empty(int(data.own_level.sum()))
    for fold in range(FOLDS):
        progress.report("hold patches out", fold, FOLDS)
        left_out = data.own_level & (patch % FOLDS == fold)
        found = refine(rig, data.only(~left_out), weight, error)
        out[left_out[data.own_level]] = _patch_rms(residuals(rig, data.only(left_out), found))
    return out


def _unchanged(found: Refinement) -> Refinement:
    """The same refinement with nothing moved but the chart's level."""
    return Refinement(
        np.zeros_like(found.deviation),
        found.covariance,
        found.chart_level,
        found.weight,
        found.reflectance_error,
        found.evidence,
    )


def _patch_rms(residual: Floats) -> Floats:
    return np.asarray(np.sqrt((residual**2).mean((1, 2))))


def patch_colours(record: ColorCheckerCalibration, rig: Rig) -> tuple[Floats, Floats]:
    """Measured and expected signals of the patches under white, (24, 3), over those of a perfect diffuser.

    ``rig`` is what was known before the chart; the record's curves and level of light replace its own.
    """
    refined = rig.model_copy(
        update={"response": record.response, "emission": record.emission, "white_scale": record.white_scale}
    )
    white = chain_response(refined, 0, FINE_NM).sum((1, 2)) * (1 + record.chart_level)
    measured = np.array([[channel[-1] for channel in patch.signal] for patch in record.patches])
    expected = expected_colours(refined, record.chart) * (1 + record.chart_level)
    return measured / white, expected / white


def _deviation(curve: SpectralCurve) -> float:
    """Median deviation of a curve over the bands, as a share of its peak."""
    nm = np.array(curve.wavelengths_nm)
    bands = (nm >= BANDS_NM[0]) & (nm <= BANDS_NM[1])
    return float(np.median(np.array(curve.std or (0.0,) * len(nm))[bands])) / max(curve.values)


def color_checker_figures(record: ColorCheckerCalibration) -> tuple[Figure, ...]:
    """Patches, residuals and the chart's level, each with its limits and what to do."""
    worst = max(record.patches, key=lambda patch: patch.held_out)
    deviation = max(_deviation(curve) for curve in record.response)
    return (
        Figure(name="patches found", value=len(record.patches), unit="", low=24),
        Figure(
            name="residual before the refinement", value=100 * record.start, unit="% of white"
        ),
        Figure(name="residual", value=100 * record.residual, unit="% of white", high=RESIDUAL_PERCENT),
        Figure(
            name="residual of patches held out",
            value=100 * record.held_out,
            unit="% of white",
            high=RESIDUAL_PERCENT,
            advice="Clean the chart, avoid reflections, and check that its reflectances are those of this"
            " edition, that the film is off, and that nothing covers a patch. If dark patches alone"
            " are too bright, light of bright ones veils the picture: clean the camera's lens.",
        ),
        Figure(
            name="residual of patches held out, regularised as published",
            value=100 * record.published_held_out,
            unit="% of white",
        ),
        Figure(
            name=f"worst patch held out ({worst.name})",
            value=100 * worst.held_out,
            unit="% of white",
            high=WORST_PERCENT,
            advice=f"Check the patch {worst.name!r} for dust, scratches, gloss or shadow.",
        ),
        Figure(
            name="deviation of the response, of its peak", value=100 * deviation, unit="%",
            high=UNSURE_PERCENT,
            advice="Give the nominal rig the curves of this camera, expose longer, or place the chart"
            " closer.",
        ),
        Figure(
            name="light on the chart against the Spectralon",
            value=100 * record.chart_level,
            unit="%",
            low=-LEVEL_PERCENT,
            high=LEVEL_PERCENT,
            advice="Avoid ambient light and shadows, and check the Spectralon's certified reflectance.",
        ),
        *_colour(record),
        *light_change_figure(record.light_change),
        Figure(
            name="tilt of the chart", value=record.tilt_deg, unit="degrees", high=MAX_TILT_DEG,
            advice="Turn the chart to face the camera.",
        ),
    )  # fmt: skip


def _colour(record: ColorCheckerCalibration) -> tuple[Figure, ...]:
    """How much brighter the chart is under one LED than under another, and what that leaves of the white."""
    if record.led_levels is None or record.reference_rel_std is None:
        return ()
    return (
        Figure(
            name="colour of the light on the chart against the Spectralon",
            value=100 * float(np.ptp(record.led_levels)),
            unit="%",
            high=COLOUR_PERCENT,
            advice="The Spectralon or the chart has another colour than stated, as when it has yellowed:"
            " clean or replace it, or give the Spectralon's measured reflectance (reflectance_file).",
        ),
        Figure(
            name="deviation of white itself, by certificate and chart",
            value=100 * record.reference_rel_std,
            unit="%",
        ),
    )
