"""Lines of a camera that means dark pixels over time are calmer than its noise."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from dsl_core.capture.proof.lines.calm_lines import calm_lines
from dsl_core.capture.proof.noise import Noise
from dsl_core.model.plan import Shot
from dsl_core.model.rig import Sensor

SENSOR = Sensor(black_level_dn=200.0, electrons_per_dn=10.0, read_noise_dn=2.0)
LINES = tuple(Shot(20 + n, "spectral", n, 0, 100.0, 0.4) for n in range(12))


def seen(weight: float, drift_dn: float = 0.0, noise: float = 1.0) -> dict[int, NDArray[np.uint16]]:
    """Pictures of a line that moves, by a camera that gives each this weight and the one before the rest.

    The black level rises by ``drift_dn`` from line to line, and noise is so many times the stated one.
    """
    rng, found, before = np.random.default_rng(1), {}, None
    for shot in LINES:
        light = np.zeros((40, 240))
        light[:, 3 * shot.pattern : 3 * shot.pattern + 3] = 900.0
        light[:, 3 * shot.pattern + 20 : 3 * shot.pattern + 26] = 12.0
        std = noise * np.sqrt(4.0 + (light + 5) / 10)
        now = 205 + drift_dn * shot.pattern + light + std * rng.standard_normal(light.shape)
        if before is not None:
            now = np.where(np.abs(now - before) < 20, weight * now + (1 - weight) * before, now)
        before = now
        found[shot.index] = np.rint(now).astype(np.uint16).ravel()
    return found


@pytest.mark.parametrize(
    ("weight", "drift_dn", "noise", "is_calm"),
    [
        (1.0, 0.0, 1.0, False),
        (1.0, 1.0, 1.0, False),
        (1.0, 0.0, 0.9, False),
        (1.0, 0.0, 2.0, False),
        (0.5, 0.0, 1.0, True),
        (0.7, 0.5, 1.0, True),
    ],
    ids=["clean", "black drifts", "a little less noise", "more noise", "half of it", "most of it"],
)
def test_pictures_with_less_noise_than_a_sensor_has_are_smoothed(
    weight: float, drift_dn: float, noise: float, is_calm: bool
) -> None:
    found = calm_lines(LINES, seen(weight, drift_dn, noise), Noise(SENSOR))
    assert (found is not None) is is_calm
    assert found is None or "noise reduction" in found.sentence


def test_few_lines_tell_nothing() -> None:
    assert calm_lines(LINES[:6], seen(0.5), Noise(SENSOR)) is None
