"""The look at a Spectralon tells an even middle from one with an edge or a shadow in it."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.calibration.light.spectralon_figures import LOOK_UNEVEN_PERCENT, unevenness_of_middle
from dsl_core.optics.sensor import bayer_channels
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
#: Colours of a mosaic differ, which is not unevenness.
MOSAIC = np.array([1.0, 2.0, 0.5])[bayer_channels(RIG.sensor.bayer, 80, 120)]


def test_only_the_middle_counts() -> None:
    picture = MOSAIC.copy()
    picture[:18], picture[:, 100:] = 0.0, 9.0
    found = unevenness_of_middle(picture, RIG)
    assert found.value == pytest.approx(0.0, abs=1e-9)
    assert found.passed


def test_a_shadow_over_a_part_of_the_middle_fails() -> None:
    picture = MOSAIC.copy()
    picture[:, 30:40] *= 0.6
    found = unevenness_of_middle(picture, RIG)
    assert found.value == pytest.approx(40.0, abs=1.0)
    assert found.high == LOOK_UNEVEN_PERCENT
    assert not found.passed
