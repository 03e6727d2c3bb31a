"""Whether probed pixels are of several colours decides whether they can tell where the orders are."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.reconstruction.spectral.probing.curve_probe import variety
from dsl_core.reconstruction.spectral.probing.probe import ONE_COLOUR

RISING = np.linspace(0.2, 0.6, 24)


def test_one_colour_at_many_levels_has_no_variety() -> None:
    levels = np.linspace(0.3, 1.0, 40)[:, None]
    assert variety(levels * RISING) == pytest.approx(0.0, abs=1e-12)
    noise = 0.01 * np.random.default_rng(0).standard_normal((40, 24))
    assert variety(levels * RISING + noise) < ONE_COLOUR


def test_a_few_pixels_of_another_colour_are_a_variety() -> None:
    spectra = np.tile(RISING, (40, 1))
    spectra[:4] = RISING[::-1]
    assert variety(spectra) > 2 * ONE_COLOUR
