"""Color Checker: camera response and LED emission refined on 24 known patches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dsl_core.calibration.colour.color_checker import (
    ChartPictures,
    color_checker_figures,
    expected_colours,
    measure_patches,
    refine_on_chart,
)
from dsl_core.calibration.colour.patches import ChartPose, find_chart, orient_chart, patch_samples
from dsl_core.campaign.common.exposures import measure_white
from dsl_core.campaign.common.flat_target import (
    LIGHTS,
    WHITE,
    capture_flat_target,
    read_flat_target,
)
from dsl_core.campaign.common.light_look import other_light
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.common.step_scan import is_complete
from dsl_core.errors import CalibrationError, DecodeError
from dsl_core.model.base import Record
from dsl_core.model.calibration.color_checker import ColorCheckerCalibration
from dsl_core.model.figure import Figure
from dsl_core.model.placement import Placement
from dsl_core.model.rig import Rig
from dsl_core.optics.charts import chart_names
from dsl_core.optics.flat_field import relative_gain
from dsl_core.optics.shading import plane_shading
from dsl_core.progress import Progress

#: The long exposure against the short one, for dark patches.
RATIO = 6.0
_UPRIGHT = ("upright", "turned clockwise", "upside down", "turned counterclockwise")
_Corners = tuple[tuple[float, float], tuple[float, float], tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class ColorCheckerRecipe:
    """The calibration with a classic Color Checker of 24 patches.

    ``chart`` names the table of reflectances in colour-science; ``corners_px`` are column and row of the four
    outer corners of the patches, in cyclic order from any, where the chart is not found by itself;
    ``depth_mm`` is how far away it stands.
    """

    chart: str = "BabelColor Average"
    corners_px: _Corners | None = None
    depth_mm: float = 700.0

    @property
    def name(self) -> str:
        """Name on the command line."""
        return "color-checker"

    @property
    def title(self) -> str:
        """Title of the wizard."""
        return "Color Checker"

    @property
    def needs(self) -> tuple[str, ...]:
        """Geometry for shading, emission and white from the Spectralon."""
        return ("geometry", "spectralon")

    @property
    def record_type(self) -> type[Record]:
        """The record that `fit` makes."""
        return ColorCheckerCalibration

    def steps(self, bench: Bench) -> tuple[Step, ...]:
        """One step: code and uniform pictures of the chart."""
        if self.chart not in chart_names():
            raise CalibrationError(
                f"There are no reflectances of a chart {self.chart!r}; choose {', '.join(chart_names())}."
            )
        return (
            Step(
                "chart",
                "Color Checker",
                f"Film off. Place the chart about {self.depth_mm / 10:g} cm from the camera, facing it, all"
                " 24 patches in view. Keep the room dark and reflections off.",
                Placement(target="color-checker", film=False, options={"depth_mm": self.depth_mm}),
            ),
        )

    def look(self, bench: Bench, step: Step) -> tuple[Figure, ...]:
        """Whether the chart is found, and how it is turned."""
        white = measure_white(bench.devices, bench.rig)
        pose = self._pose(white.picture.astype(np.float32), bench.rig, f"the test shot of {step.title}")
        patch_samples(pose.corners_px, (white.picture.shape[0], white.picture.shape[1]))
        return (
            Figure(name="patches found", value=24, unit="", low=24, high=24),
            Figure(
                name=f"chart {_UPRIGHT[pose.quarter_turns]}", value=90.0 * pose.quarter_turns, unit="degrees"
            ),
            other_light(white, "chart"),
        )

    def is_captured(self, bench: Bench, step: Step) -> bool:
        """Whether the scan is complete."""
        return is_complete(bench.step_folder(step))

    def capture(self, bench: Bench, step: Step, progress: Progress) -> None:
        """Choose exposures by a test shot and capture."""
        capture_flat_target(bench, bench.step_folder(step), step.title, RATIO, progress)

    def fit(self, bench: Bench, progress: Progress) -> ColorCheckerCalibration:
        """Find the chart, measure its patches and refine the curves."""
        (step,) = self.steps(bench)
        try:
            return self._fit(bench, step, progress)
        except (CalibrationError, DecodeError) as error:
            raise CalibrationError(f"Step {step.title}: {error}") from error

    def figures(self, record: Record) -> tuple[Figure, ...]:
        """Residuals of the patches, against their limits."""
        assert isinstance(record, ColorCheckerCalibration)
        return color_checker_figures(record)

    def apply(self, record: Record, rig: Rig) -> Rig:
        """The rig with refined response, emission and the white scale that goes with them."""
        assert isinstance(record, ColorCheckerCalibration)
        return rig.model_copy(
            update={
                "response": record.response,
                "emission": record.emission,
                "white_scale": record.white_scale,
            }
        )

    def _fit(self, bench: Bench, step: Step, progress: Progress) -> ColorCheckerCalibration:
        rig = bench.rig
        target = read_flat_target(bench.step_folder(step), rig, progress)
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
        return refine_on_chart(rig, seen, pose, plane, self.chart, progress)

    def _pose(self, white: np.ndarray, rig: Rig, name: str) -> ChartPose:
        expected = expected_colours(rig, self.chart)
        if self.corners_px is None:
            return find_chart(white, rig.sensor.bayer, expected, name)
        return orient_chart(white, rig.sensor.bayer, np.array(self.corners_px), expected, name)
