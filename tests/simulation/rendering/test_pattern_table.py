"""Tables of a pattern give its means over any stretch."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.model.rig import ProjectorResponse, Rig
from dsl_core.optics.lines.profile import zero_order_profile
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendering.pattern_table import PatternTable, between, without_repeats

SIZE = (64, 42)


def small_rig(**projector: float) -> Rig:
    rig = published_rig()
    response = rig.projector_response.model_copy(update=projector)
    return rig.model_copy(update={"camera": rig.camera.resized(*SIZE), "projector_response": response})


def test_pattern_table_means_are_those_of_the_pattern() -> None:
    levels = np.random.default_rng(0).random((1, 40, 1)).repeat(6, 0)
    sharp = small_rig(halo_peak_per_px=0.0, blur_px=0.01).projector_response
    table = PatternTable.of(levels, sharp, torch.device("cpu"))
    start, stop = torch.tensor([-0.5, 4.5, 9.75]), torch.tensor([39.5, 7.5, 10.25])
    mean, place = (values.numpy() for values in between(table.edge(0, start), table.edge(0, stop)))
    assert mean == pytest.approx([levels[0].mean(), levels[0, 5:8].mean(), levels[0, 10, 0]], rel=1e-3)
    # The mean of pattern times place, by many samples of the second stretch.
    fine = (np.arange(300) + 0.5) / 150 - 1
    sampled = levels[0, np.repeat([5, 6, 7], 100), 0] * fine
    assert place[1] == pytest.approx(sampled.mean(), abs=2e-3)
    for away in ([-9.0, -5.0], [44.0, 49.0]):
        outside = between(*(table.edge(0, torch.tensor([at])) for at in away))
        assert abs(float(outside[0])) + abs(float(outside[1])) < 1e-5
    assert table.leds == 1
    assert not table.has_rows


def test_first_orders_see_the_blurred_pattern() -> None:
    response = small_rig(halo_peak_per_px=0.0).projector_response
    line = np.zeros((1, 40, 1))
    line[:, 18:22] = 1
    table = PatternTable.of(line, response, torch.device("cpu"))
    column = torch.linspace(14.0, 25.0, 23)
    mean, _ = between(table.edge(0, column - 0.1), table.edge(0, column + 0.1))
    assert mean.numpy() == pytest.approx(table.at(0, column, torch.zeros(23)).numpy(), abs=0.01)
    assert 0.45 < float(between(*(table.edge(0, torch.tensor([at])) for at in (17.4, 17.6)))[0]) < 0.55


def test_rows_are_averaged_as_columns_are() -> None:
    response = small_rig(halo_peak_per_px=0.0).projector_response
    levels = np.random.default_rng(0).random((1, 40, 1)).repeat(6, 0)
    flat, upright = (
        PatternTable.of(image, response, torch.device("cpu")) for image in (levels, levels.transpose(1, 0, 2))
    )
    start, stop = torch.tensor([4.5, 9.75, 30.0]), torch.tensor([7.5, 10.25, 30.0])
    mean, _ = between(flat.edge(0, start[:2]), flat.edge(0, stop[:2]))
    rows = upright.mean_of_rows(0, start, stop)
    assert rows[:2].numpy() == pytest.approx(mean.numpy(), rel=1e-4)
    # No stretch at all is the pattern there.
    assert float(rows[2]) == pytest.approx(float(flat.at(0, stop[2:], stop[2:])), abs=0.01)
    inside = upright.inside(torch.tensor([-3.5, 2.0, 7.0]), torch.tensor([2.5, 4.0, 9.0]))
    assert inside.numpy() == pytest.approx([0.5, 1.0, 0.0])


def test_light_of_rows_falls_off_at_the_sides_of_the_frame() -> None:
    response = small_rig(halo_decay_px=8.0, halo_peak_per_px=0.01).projector_response
    levels = np.random.default_rng(0).random((30, 1, 1)).repeat(40, 1)
    table = PatternTable.of(levels, response, torch.device("cpu"))
    columns = (torch.tensor([0, 3, 70, 158]) + 0.5) / table.oversample[0] - 0.5
    rows = (torch.tensor([0, 100, 121, 230]) + 0.5) / table.oversample[1] - 0.5
    without = response.model_copy(update={"halo_peak_per_px": 0.0})
    pixels = torch.arange(40.0)
    across = zero_order_profile(columns[:, None] - pixels, -0.5, 0.5, response).sum(1)
    spread = zero_order_profile(rows[:, None] - pixels[:30], -0.5, 0.5, without)
    expected = across * (spread @ torch.tensor(levels[:, 0, 0], dtype=torch.float32))
    assert table.at(0, columns, rows).numpy() == pytest.approx(expected.numpy(), rel=1e-4)
    assert across[0] < 0.8 * across[2]


def of_levels(colour: NDArray[np.uint8], response: ProjectorResponse, device: torch.device) -> PatternTable:
    return PatternTable.of_strip(without_repeats(colour), colour.shape[:2], response, device)


def test_levels_that_vary_one_way_only_are_tabulated_once() -> None:
    response, device = small_rig().projector_response, torch.device("cpu")
    drawn = np.random.default_rng(0).integers(0, 256, (30, 40, 3)).astype(np.uint8)
    across, down = drawn[:1].repeat(30, 0), drawn[:, :1].repeat(40, 1)
    column, row = torch.tensor([2.25, 17.5, 31.0]), torch.tensor([3.5, 11.25, 22.0])
    for colour in (across, down, across[..., :1].repeat(3, 2), drawn):
        radiance = response.radiance(colour / 255) - response.black_fraction
        kept, own = (
            of_levels(colour, response, device),
            PatternTable.of(radiance, response, device),
        )
        assert kept.oversample == own.oversample
        for led in range(kept.leds):
            found, expected = (table.at(led, column, row).numpy() for table in (kept, own))
            assert found == pytest.approx(expected, rel=1e-5)
    assert of_levels(across.copy(), response, device) is of_levels(across, response, device)
    wider = small_rig(blur_px=1.5).projector_response
    again = of_levels(across, wider, device)
    assert not torch.equal(again.blurred, of_levels(across, response, device).blurred)
