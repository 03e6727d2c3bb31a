"""A projector that focuses red, green and blue at different distances."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.optics.spread.field import widths_at
from dsl_core.reconstruction.columns.colour_widths import ColourWidths, colour_widths, pixel_colours
from dsl_core.reconstruction.columns.column import refine
from dsl_core.reconstruction.columns.line_peaks import LinePeaks
from tests.cases.small_rig import small_rig

RIG = small_rig()
RESPONSE = ProjectorResponse(blur_px=0.6)
LINES = LineSet(width_px=5, step_px=4, first_px=2.0, lines=160, frames=160)
COUNT, NOISE = 2000, 0.001
COLUMN = 60 + 0.277 * np.arange(COUNT)
#: Along a row, green and red take turns; then, along another, blue and green.
COLOURS = np.where(np.arange(COUNT) < COUNT / 2, np.arange(COUNT) % 2, 2 - np.arange(COUNT) % 2)


def peaks(blurs_px: tuple[float, float, float], lines: LineSet = LINES) -> LinePeaks:
    """Lines of red, green and blue pixels that are blurred so far, taken as if all were like green."""
    away = torch.as_tensor(COLUMN) - lines.centre_px(torch.arange(lines.lines))[:, None]
    each = [zero_order_profile(away, -2.5, 2.5, RESPONSE.of_width(blur)).numpy() for blur in blurs_px]
    light = np.take_along_axis(np.stack(each), COLOURS[None, None], 0)[0]
    light = light + NOISE * np.random.default_rng(4).standard_normal(light.shape)
    coarse = torch.as_tensor(COLUMN.round())
    std = torch.full(light.shape, NOISE, dtype=torch.float64)
    return LinePeaks(coarse, torch.as_tensor(light), std, lines, RESPONSE)


@pytest.mark.parametrize("blurs_px", [(0.54, 0.6, 0.69), (0.45, 0.6, 0.95)])
def test_the_width_of_each_colour_is_found(blurs_px: tuple[float, float, float]) -> None:
    found = colour_widths(peaks(blurs_px), COLOURS)
    assert found is not None
    assert found.differ
    assert np.exp(found.logs) * 0.6 == pytest.approx(blurs_px, rel=0.01)
    assert found.std.max() < 0.05
    told = found.finding()
    assert told.significant
    assert told.value == pytest.approx(100 * (blurs_px[2] / blurs_px[0] - 1), rel=0.05)
    assert "% in blue than in red" in told.sentence


def test_colours_alike_are_left_alone_whatever_their_width() -> None:
    for blur_px in (0.6, 0.7):
        found = colour_widths(peaks((blur_px, blur_px, blur_px)), COLOURS)
        assert found is not None
        assert not found.differ
        assert not found.finding().significant


def test_lines_side_by_side_and_too_few_pixels_of_a_colour_say_nothing() -> None:
    beside = LineSet(width_px=5, step_px=5, first_px=2.0, lines=128, frames=128)
    assert colour_widths(peaks((0.5, 0.6, 0.8), beside), COLOURS) is None
    assert colour_widths(peaks((0.5, 0.6, 0.8)), np.minimum(COLOURS, 1)) is None


def test_columns_are_right_with_the_width_of_their_own_colour() -> None:
    seen = peaks((0.45, 0.6, 0.95))
    found = ColourWidths(np.log([0.75, 1.0, 0.95 / 0.6]), np.zeros(3))
    rig = found.of(RIG.model_copy(update={"projector_response": RESPONSE}))
    lens = rig.camera
    pixels = np.arange(2 * lens.width_px)
    own = widths_at(rig, torch.as_tensor(pixels), torch.zeros(len(pixels), dtype=torch.float64))
    assert own is not None
    assert own.numpy() == pytest.approx(np.exp(found.logs)[pixel_colours(rig, pixels)])
    by_colour = torch.as_tensor(np.exp(found.logs)[COLOURS])
    before, after = (
        [float(np.median(off[colour == COLOURS])) for colour in (0, 2)]
        for off in (
            np.abs(refine(replace(seen, widths=widths)).column_px.numpy() - COLUMN)
            for widths in (None, by_colour)
        )
    )
    assert min(before) > 0.1
    assert max(after) < 0.005
