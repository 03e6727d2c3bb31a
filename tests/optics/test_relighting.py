from __future__ import annotations

import numpy as np
import pytest

from dsl_core.optics.relighting import LIGHTS, adaptation, relight
from tests.cases.colour_science import colour_library

NM = np.arange(430.0, 661.0, 5.0)


@pytest.mark.parametrize("light", LIGHTS)
def test_white_stays_white_to_adapted_eyes(light: str) -> None:
    white = np.ones((NM.size, 1, 1), np.float32)
    np.testing.assert_allclose(relight(white, NM, light), 1.0, atol=0.02)


def test_a_lamp_is_yellow_beside_daylight() -> None:
    rgb = relight(np.full((NM.size, 1, 1), 0.5, np.float32), NM, "A", adapted=False)
    assert rgb[0, 0, 0] > rgb[1, 0, 0] > rgb[2, 0, 0]


def test_adaptation_is_that_of_another_library() -> None:
    lamp, daylight = np.array([1.0985, 1.0, 0.3558]), np.array([0.9505, 1.0, 1.0888])
    expected = colour_library().adaptation.matrix_chromatic_adaptation_VonKries(
        lamp, daylight, transform="Bradford"
    )
    found = adaptation(lamp, daylight)
    np.testing.assert_allclose(found, expected, atol=2e-5)
    np.testing.assert_allclose(found @ lamp, daylight, rtol=1e-12)
