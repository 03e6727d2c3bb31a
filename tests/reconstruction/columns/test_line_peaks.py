"""Which frames around a decoded column count, and what widths do to them."""

import pytest
import torch

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.reconstruction.columns.line_peaks import LinePeaks


@pytest.mark.parametrize(("blur_px", "lines_beside"), [(0.6, 3), (0.8, 3), (0.9, 4)])
def test_lines_count_to_a_column_beyond_three_widths_of_the_blur(blur_px: float, lines_beside: int) -> None:
    # Half a line of five columns, three blurs and one column, in steps of two: 2.65, 2.95 or 3.1.
    lines = LineSet(5, 2, 2.0, 40, 40)
    frames = torch.arange(40.0, dtype=torch.float64)[:, None] * torch.ones(4, dtype=torch.float64)
    std = torch.full_like(frames, 0.5)
    std[20, 1], frames[21, 2] = torch.inf, torch.nan
    coarse = torch.tensor([42.0, 42.9, 41.1, 3.0], dtype=torch.float64)
    y, variance, centres = LinePeaks(coarse, frames, std, lines, ProjectorResponse(blur_px=blur_px)).window()
    beside = torch.arange(-lines_beside, lines_beside + 1)[:, None]
    line = torch.tensor([20, 20, 20, 0]) + beside
    assert torch.equal(centres, 2.0 + 2.0 * line)
    known = (line >= 0) & ~((line == 20) & (torch.arange(4) == 1)) & ~((line == 21) & (torch.arange(4) == 2))
    assert torch.equal(y, torch.where(known, line, 0).double())
    assert torch.equal(variance, torch.where(known, 0.25, torch.inf).double())


def test_a_spread_that_is_wider_somewhere_looks_at_more_lines_and_keeps_its_shape() -> None:
    lines = LineSet(5, 2, 2.0, 40, 40)
    light = torch.ones((40, 3), dtype=torch.float64)
    coarse = torch.tensor([40.0, 42.0, 44.0], dtype=torch.float64)
    found = LinePeaks(coarse, light, light, lines, ProjectorResponse(blur_px=0.6))
    twice = found.wider(1.6).wider(1.25)
    assert twice.widths is not None
    assert twice.widths.tolist() == pytest.approx([2.0, 2.0, 2.0])
    # Half a line of five columns, three blurs of 1.2 px and one column, in steps of two: 3.55.
    assert (len(found.window()[0]), len(twice.window()[0])) == (7, 9)
    last = twice.some(torch.tensor([2]))
    assert last.coarse_px.tolist() == [44.0]
    assert last.radiance.shape == (40, 1) == last.std.shape
    assert last.widths is not None
    assert last.widths.tolist() == [2.0]


def test_light_that_all_frames_have_alike_is_taken_off_but_not_where_the_peak_is_saturated() -> None:
    response = ProjectorResponse(blur_px=0.6, halo_peak_per_px=1e-3, halo_decay_px=31.0)
    lines = LineSet(5, 5, 2.0, 124, 124)
    column = torch.tensor([301.3, 251.9], dtype=torch.float64)
    distance = column - lines.centre_px(torch.arange(124))[:, None]
    frames = 0.01 + 2.0 * zero_order_profile(distance, -2.5, 2.5, response)
    std = torch.full_like(frames, 1e-3)
    std[50, 1] = torch.inf
    found = LinePeaks(column.round(), frames, std, lines, response).without_offset((80.0, 160.0))
    assert found.offset is not None
    assert found.offset.tolist() == pytest.approx([0.01, 0.0], abs=2e-4)
    y, _, centres = found.window()
    exact = 2.0 * zero_order_profile(column - centres, -2.5, 2.5, response)
    assert y[:, 0].tolist() == pytest.approx(exact[:, 0].tolist(), abs=2e-4)
    one = found.some(torch.tensor([0]))
    assert one.offset is not None
    assert one.offset.tolist() == found.offset[:1].tolist()
