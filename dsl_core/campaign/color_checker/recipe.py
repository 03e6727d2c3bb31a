"""Color Checker: camera response and LED emission refined on 24 known patches."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.colour.color_checker import (
    LIGHTS,
    ChartPictures,
    color_checker_figures,
    expected_colours,
    measure_patches,
    patch_colours,
    refine_on_chart,
    require_lit,
)
from dsl_core.calibration.colour.patches import (
    ChartPose,
    chart_picture,
    find_chart,
    orient_chart,
    patch_samples,
    patch_signals,
)
from dsl_core.campaign.common.bounds import Finite, Positive
from dsl_core.campaign.common.depths import seen_whole_mm, target_depth_mm
from dsl_core.campaign.common.flat_target import WHITE, capture_uniform, read_uniform
from dsl_core.campaign.common.recipe import Bench, Recipe, Step, naming
from dsl_core.campaign.common.white_shot import other_light, shoot_white
from dsl_core.errors import CalibrationError
from dsl_core.model.calibration.color_checker import ORIENTATIONS, ColorCheckerCalibration
from dsl_core.model.conditions import mosaic_colours
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.optics.charts import chart_names
from dsl_core.optics.sensor import relative_gain
from dsl_core.optics.shading import plane_shading
from dsl_core.progress import Progress

#: The long exposure against the short one, for dark patches.
RATIO = 6.0
#: Width and height of the 24 patches of a large chart, with which it must be in view.
PATCHES_MM = (312.0, 208.0)
_Corner = tuple[Finite, Finite]
_Corners = tuple[_Corner, _Corner, _Corner, _Corner]


_NO_COLOURS = (
    "The rig's camera is monochrome, and the Color Checker compares red, green and blue. Leave this"
    " calibration out, and state the camera's response curve in the rig."
)


@dataclass(frozen=True)
class ColorCheckerRecipe(Recipe[ColorCheckerCalibration]):
    """The calibration with a classic Color Checker of 24 patches.

    ``chart`` is the name of the chart's reflectances in colour-science; ``corners_px`` are column and row of
    the four outer corners of the patches, in cyclic order from any of them, if the chart is not found
    automatically; ``depth_mm`` is the distance of the chart, by default two fifths into the
    rig's depth range, or farther where a narrow view shows all patches only there.
    """

    name = "color-checker"
    title = "Color Checker"
    #: Geometry for shading, emission and white from the Spectralon.
    needs = ("geometry", "spectralon")
    record_type = ColorCheckerCalibration

    chart: str = "BabelColor Average"
    corners_px: _Corners | None = None
    depth_mm: Positive | None = None

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """One step: code and uniform pictures of the chart."""
        if self.chart not in chart_names():
            raise CalibrationError(
                f"There are no reflectances for a chart {self.chart!r}; choose {', '.join(chart_names())}."
            )
        depth_mm = target_depth_mm(bench.rig, self.depth_mm or seen_whole_mm(bench.rig, PATCHES_MM))
        return (
            Step(
                "chart",
                "Color Checker",
                f"Film off. Place the chart about {depth_mm / 10:g} cm from the camera, facing it, all"
                " 24 patches in view. Keep the room dark and avoid reflections.",
                Placement(target="color-checker", film=False, options={"depth_mm": depth_mm}),
            ),
        )

    def reason_to_omit(self, rig: Rig) -> str:
        """That a monochrome camera has no colours to compare."""
        return _NO_COLOURS if len(mosaic_colours(rig.sensor.bayer)) == 1 else ""

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Whether the chart is found, lit, and how it is turned; raises `CalibrationError`."""
        self._require_colours(bench.rig)
        white = shoot_white(bench)
        pose = self._pose(white.picture.astype(np.float32), bench.rig, f"the test shot of {step.title}")
        samples = patch_samples(pose.corners_px, (white.picture.shape[0], white.picture.shape[1]))
        none = np.zeros(white.picture.shape, bool)
        require_lit(
            patch_signals(white.picture, none, bench.rig.sensor.bayer, samples), bench.rig, self.chart
        )
        bench.found(np.asarray(pose.corners_px, float))
        return (
            Figure(name="patches found", value=24, unit="", low=24),
            Figure(
                name=f"chart {ORIENTATIONS[pose.quarter_turns]}",
                value=90.0 * pose.quarter_turns,
                unit="degrees",
            ),
            other_light(white, "chart"),
        )

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Choose exposures by a test shot and capture; raises `CalibrationError` for monochrome cameras."""
        self._require_colours(bench.rig)
        capture_uniform(bench, step, RATIO, progress)

    def fit(self, bench: Bench, progress: Progress) -> ColorCheckerCalibration:
        """Find the chart, measure its patches and refine the curves."""
        (step,) = self.steps(bench)
        with naming(step):
            return self._fit(bench, step, progress)

    def figures(self, record: ColorCheckerCalibration, done: Collection[str] = ()) -> tuple[Figure, ...]:
        """Residuals of the patches, against their limits."""
        return color_checker_figures(record)

    def apply(self, record: ColorCheckerCalibration, rig: Rig) -> Rig:
        """The rig with refined response, emission, the white scale that goes with them, and its deviation."""
        unsure = rig.reference_rel_std if record.reference_rel_std is None else record.reference_rel_std
        return rig.model_copy(
            update={
                "response": record.response,
                "emission": record.emission,
                "white_scale": record.white_scale,
                "reference_rel_std": unsure,
            }
        )

    def _require_colours(self, rig: Rig) -> None:
        """Raise `CalibrationError` for a camera whose patches have no colours to compare."""
        if reason := self.reason_to_omit(rig):
            raise CalibrationError(reason)

    def _fit(self, bench: Bench, step: Step, progress: Progress) -> ColorCheckerCalibration:
        rig = bench.rig
        target = read_uniform(bench.scan_of(step), rig, progress)
        shape = (target.depth_mm.shape[0], target.depth_mm.shape[1])
        pose = self._pose(target.radiance[WHITE].astype(np.float32), rig, "the white picture")
        samples = patch_samples(pose.corners_px, shape)
        on_chart = np.zeros(shape, bool)
        on_chart.ravel()[np.concatenate(samples.pixels)] = True
        plane = target.plane(rig, on_chart, on_chart).plane
        light = plane_shading(rig, plane) * relative_gain(rig)
        pictures = ChartPictures(target.radiance, target.saturated, light)
        seen = measure_patches(pictures, rig, samples, self.chart)
        assert len(seen) == len(LIGHTS)
        record = refine_on_chart(rig, seen, pose, plane, self.chart, progress)
        return record.model_copy(update={"light_change": target.light_change(on_chart)})

    def _pose(self, white: np.ndarray, rig: Rig, name: str) -> ChartPose:
        expected = expected_colours(rig, self.chart)
        if self.corners_px is None:
            return find_chart(white, rig.sensor.bayer, expected, name)
        return orient_chart(white, rig.sensor.bayer, np.array(self.corners_px), expected, name)


@dataclass(frozen=True)
class ChartView:
    """The white picture, RGB (rows, columns, 3), and colours of the patches over white, (24, 3) each."""

    picture: NDArray[np.uint8]
    measured: NDArray[np.float64]
    expected: NDArray[np.float64]


def chart_view(record: ColorCheckerCalibration, bench: Bench, step: Step) -> ChartView:
    """Read what a fit of the chart is based on; raises `StoreError` when the captures are gone."""
    return ChartView(white_picture(bench, step), *patch_colours(record, bench.rig))


def white_picture(bench: Bench, step: Step) -> NDArray[np.uint8]:
    """The white picture of the chart's step, RGB (rows, columns, 3); raises `StoreError`."""
    from dsl_core.reconstruction.merge import MergedScan

    scan = MergedScan(bench.scan_of(step), bench.rig)
    picture = chart_picture(scan.merge("spectral", WHITE).radiance, bench.rig.sensor.bayer)
    return np.ascontiguousarray(picture[..., ::-1])
