"""Numbers in the first row of black, which light of the room with fine detail is not."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.capture.proof.lasting.written_row import WrittenRow, written_row
from dsl_core.capture.proof.noise import Noise
from dsl_core.capture.proof.raster import Raster
from dsl_core.model.rig import Sensor

SIZES = [(64, 48), (890, 580), (2448, 2048)]


def found(size: tuple[int, int], light: np.ndarray) -> WrittenRow | None:
    """Of a dark picture with this light, DN, in its first rows."""
    rng, black = np.random.default_rng(0), np.full(size[::-1], 260.0)
    black[: light.shape[0], : light.shape[1]] += light
    noisy = np.rint(black + rng.normal(0, 1, black.shape)).clip(0, 4095).astype(np.uint16)
    return written_row(Raster(size).take(noisy), Noise(Sensor()), Raster(size))


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("is_red", [False, True])
def test_blinds_and_text_at_the_upper_edge_are_no_numbers(size: tuple[int, int], is_red: bool) -> None:
    light = 500.0 * np.tile(np.arange(size[0]) // 4 % 2, (10, 1))
    if is_red:
        light[1::2] = light[:, 1::2] = 0.0
    assert found(size, light) is None


@pytest.mark.parametrize("size", SIZES)
def test_numbers_are_in_the_first_row_alone(size: tuple[int, int]) -> None:
    numbers = np.random.default_rng(1).integers(0, 3800, (1, 60)).astype(float)
    seen = found(size, numbers)
    assert seen is not None
    assert seen.last_column == pytest.approx(60, abs=6)
