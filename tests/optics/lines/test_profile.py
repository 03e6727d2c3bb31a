"""Tables of a line's light: how long they are, what they hold between and beyond their samples."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from dsl_core.model.projector.line_spread import LineSpread
from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import (
    SAMPLES,
    LineTable,
    ProfileTable,
    band_profile,
    halo_integral,
    halo_of_line,
    step_edge,
    zero_order_profile,
)
from dsl_core.optics.spread.curves import reach_px

CPU = torch.device("cpu")
SKEWED = LineSpread.of(np.exp(-np.arange(0, 40) / 5.0), 0.125)
HALO = ProjectorResponse(blur_px=0.7, halo_peak_per_px=0.002, halo_decay_px=12.0)


def test_a_band_table_reaches_as_far_as_line_band_and_blur_in_half_columns() -> None:
    # 2.5 + 2.4 + 2.2 * 0.6 is 6.22; 2.5 + 2.4 + 2.2 * 0.75 is 6.55.
    for blur_px, support_px in ((0.6, 6.5), (0.75, 7.0)):
        table = ProfileTable(5.0, blur_px, 2.4, CPU, torch.float64)
        assert table.support_px == support_px
        assert len(table.values) == 2 * support_px * SAMPLES + 1
        grid = np.linspace(-support_px, support_px, len(table.values))
        assert table.values[1:-1].numpy() == pytest.approx(band_profile(grid, 5.0, blur_px, 2.4)[1:-1])
        assert table.values[[0, -1]].tolist() == [0.0, 0.0]
    measured = ProfileTable(5.0, SKEWED, 2.4, CPU, torch.float64)
    assert measured.support_px == math.ceil(2 * (2.5 + 2.4 + reach_px(SKEWED))) / 2


def test_a_band_table_gives_the_nearest_of_256_samples_a_column() -> None:
    assert SAMPLES == 256, "finer than a thousandth of the light, and coarse enough for the cache"
    table = ProfileTable(5.0, 0.6, 2.4, CPU, torch.float64)
    middle = len(table.values) // 2
    at = torch.tensor([[0.4, 0.6, -300.4], [5.0, -5.6, 0.0]], dtype=torch.float64) / SAMPLES
    steps = torch.tensor([[0, 1, -300], [5, -6, 0]])
    assert torch.equal(table.at(at), table.values[middle + steps])
    assert table.at(torch.tensor([6.6, -6.6, 99.0], dtype=torch.float64)).tolist() == [0.0, 0.0, 0.0]


def test_overlaps_are_products_of_shifted_profiles_less_a_slack() -> None:
    table = ProfileTable(5.0, 0.6, 2.4, CPU, torch.float64)
    values = table.values.numpy()
    found = table.overlaps(2.0, 0.5)
    wanted = [values[s:] @ values[:-s] / (values @ values) for s in range(384, len(values), 512)]
    assert found == pytest.approx(wanted)
    # Bands may be nearer than the slack, but not at the same place.
    assert table.overlaps(0.25, 0.5)[0] == pytest.approx(values[1:] @ values[:-1] / (values @ values))


def test_light_of_a_band_of_columns_adds_up_from_its_parts() -> None:
    x = torch.linspace(-60, 60, 25, dtype=torch.float64)
    for response in (HALO, HALO.with_spread(SKEWED)):
        spread = response.line_spread
        wanted = step_edge(x + 3, spread) - step_edge(x - 4, spread)
        wanted = wanted + halo_integral(x + 3, response) - halo_integral(x - 4, response)
        assert torch.equal(zero_order_profile(x, -3.0, 4.0, response), wanted)


def test_the_halo_falls_off_on_both_sides_and_is_as_wide_as_the_line() -> None:
    d = torch.tensor([-24.0, 0.0, 6.0], dtype=torch.float64)
    assert halo_of_line(d, 5, HALO).tolist() == pytest.approx(
        [0.01 * math.exp(-2), 0.01, 0.01 * math.exp(-0.5)]
    )
    total = 2 * 0.002 * 12
    found = halo_integral(torch.tensor([-1e4, -12.0, 0.0, 12.0, 1e4], dtype=torch.float64), HALO).tolist()
    part = 0.024 / math.e
    assert found == pytest.approx([0.0, part, total / 2, total - part, total])


@pytest.mark.parametrize("widths", [None, torch.tensor([0.8, 1.25], dtype=torch.float64)])
def test_a_line_table_reaches_as_far_as_it_was_asked_to(widths: torch.Tensor | None) -> None:
    like = torch.zeros(1, dtype=torch.float64)
    table = LineTable(5, HALO, 4.3, like, widths)
    x = torch.tensor([[-4.3, -4.3], [-2.6, 2.4], [4.3, 4.3]], dtype=torch.float64)
    profile, slope = table.at(x)
    for column in range(2):
        own = HALO if widths is None else HALO.with_gaussian(0.7 * float(widths[column]))
        here = x[:, column]
        assert profile[:, column].tolist() == pytest.approx(
            zero_order_profile(here, -2.5, 2.5, own).tolist(), abs=2e-5
        )
        ends = (zero_order_profile(here + by, -2.5, 2.5, own) for by in (1e-4, -1e-4))
        high, low = ends
        assert slope[:, column].tolist() == pytest.approx(((high - low) / 2e-4).tolist(), abs=5e-4)
