"""Tables of a pattern give its means over any stretch."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.rig import Rig
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendering.pattern_table import PatternTable, between

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
