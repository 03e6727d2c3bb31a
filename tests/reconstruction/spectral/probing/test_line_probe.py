"""The profile of lines is measured from the zero order at many fractions of a column."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.reconstruction.spectral.probing.line_probe import TAIL_BLUR, LineProbe, probe_lines
from dsl_core.reconstruction.spectral.solving.tile_frames import Pixels

LINES = LineSet(width_px=5, step_px=2, first_px=2.0, lines=60, frames=60)
RESPONSE = ProjectorResponse(blur_px=0.6, halo_peak_per_px=1e-4)
SHAPE = (6, 10)


def probed(blur: float, tail: float, noise: float = 0.0, width: float = 1.0) -> LineProbe:
    rng = np.random.default_rng(3)
    column = rng.uniform(40, 80, SHAPE).astype(np.float32)
    level = rng.uniform(5, 20, SHAPE)
    distance = torch.as_tensor(column[None] - LINES.centre_px(torch.arange(60)).numpy()[:, None, None])

    def light(factor: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        own = RESPONSE.model_copy(update={"blur_px": 0.6 * width * factor})
        return np.asarray(zero_order_profile(distance.double(), -2.5, 2.5, own))

    frames = level * ((1 - tail) * light(blur) + tail * light(TAIL_BLUR))
    frames += noise * rng.standard_normal(frames.shape)
    none, known = np.zeros(SHAPE, np.float32), np.ones(SHAPE, bool)
    pixels = Pixels(column, none, none, none, none, none, none, none, none, known)
    std = np.full(frames.shape, max(noise, 1e-3), np.float32)
    radiance = frames.astype(np.float32)
    widths = torch.full((column.size,), width, dtype=torch.float64)
    return probe_lines(LINES, RESPONSE, pixels, radiance, std, np.arange(column.size), widths)


@pytest.mark.parametrize(("blur", "tail"), [(1.0, 0.0), (1.04, 0.0), (0.96, 0.0), (1.0, 0.02)])
def test_blur_and_tail_are_found_though_columns_and_levels_are_unknown(blur: float, tail: float) -> None:
    found = probed(blur, tail)
    np.testing.assert_allclose(found.values, [blur - 1, tail], atol=0.004)


def test_what_the_field_of_widths_explains_is_not_found_again() -> None:
    np.testing.assert_allclose(probed(1.0, 0.0, width=1.3).values, [0.0, 0.0], atol=0.004)


def test_noise_stays_within_the_stated_deviation() -> None:
    found = probed(1.0, 0.0, noise=0.02)
    assert (np.abs(found.values) < 4 * found.std).all()
    assert (found.std > 0).all()
    assert float(np.median(found.chi_square)) == pytest.approx(1.0, abs=0.4)
