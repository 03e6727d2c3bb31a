"""The chart of a campaign as the camera saw it, for people to judge a fit by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.colour.color_checker import patch_colours
from dsl_core.calibration.colour.patches import chart_picture
from dsl_core.campaign.common.flat_target import WHITE
from dsl_core.campaign.common.recipe import Bench, Step
from dsl_core.campaign.common.step_scan import scan_of
from dsl_core.model.calibration.color_checker import ColorCheckerCalibration


@dataclass(frozen=True)
class ChartView:
    """The white picture, RGB (rows, columns, 3), and colours of the patches over white, (24, 3) each."""

    picture: NDArray[np.uint8]
    measured: NDArray[np.float64]
    expected: NDArray[np.float64]


def chart_view(record: ColorCheckerCalibration, bench: Bench, step: Step) -> ChartView:
    """Read what a fit of the chart rests on; raises `StoreError` when the captures are gone."""
    return ChartView(white_picture(bench, step), *patch_colours(record, bench.rig))


def white_picture(bench: Bench, step: Step) -> NDArray[np.uint8]:
    """The white picture of the chart's step, RGB (rows, columns, 3); raises `StoreError`."""
    from dsl_core.reconstruction.merge import MergedScan

    scan = MergedScan(scan_of(bench.step_folder(step)), bench.rig)
    picture = chart_picture(scan.merge("spectral", WHITE).radiance, bench.rig.sensor.bayer)
    return np.ascontiguousarray(picture[..., ::-1])
