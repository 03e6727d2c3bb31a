"""Colours of the patches as the camera saw them, beside those that the refined curves expect."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dsl_core.calibration.colour.color_checker import expected_colours
from dsl_core.calibration.light.spectral_refinement import FINE_NM
from dsl_core.model.calibration.color_checker import ColorCheckerCalibration
from dsl_core.model.rig import Rig
from dsl_core.optics.spectra import chain_response

Floats = NDArray[np.float64]


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
