"""The light of probed pixels line by line: what a band gains when its line moves, widens or has a tail."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.model.projector.line_spread import stretched
from dsl_core.optics.lines.profile import SAMPLES, ProfileTable, band_profile
from dsl_core.reconstruction.spectral.probing import probed_light
from dsl_core.reconstruction.spectral.probing.probed_light import (
    PARAMETERS,
    OrderLight,
    ProbedLight,
    along_bands,
)
from dsl_core.reconstruction.spectral.probing.solved_pixels import SolvedPixels

DRIFT, STRETCH = PARAMETERS.index("drift"), PARAMETERS.index("stretch +1")


def test_a_stretch_rises_from_the_first_reported_band_to_the_last() -> None:
    nm = np.arange(420.0, 481.0, 10.0)
    model: Any = SimpleNamespace(bands=SimpleNamespace(centres_nm=nm, reported=slice(1, 6)))
    assert along_bands(model) == pytest.approx([-1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5])


def test_profiles_gain_as_they_are_shifted_blurred_and_given_a_tail() -> None:
    like = torch.zeros(1, dtype=torch.float64)
    table = probed_light._changed_profiles(5, 0.6, 2.4).numpy()
    tail = ProfileTable(5, stretched(0.6, 4.0), 2.4, like.device, like.dtype)
    assert len(table) == len(tail.values)
    x = (np.arange(len(table)) - len(table) // 2) / SAMPLES
    inner = np.abs(x) < 6.3

    def light(at: np.ndarray, blur: float = 1.0) -> np.ndarray:
        return band_profile(at, 5, 0.6 * blur, 2.4)

    assert table[inner, 0] == pytest.approx(light(x)[inner], abs=1e-9)
    slope = (light(x + 0.05) - light(x - 0.05)) / 0.1
    assert table[inner, 1] == pytest.approx(slope[inner], abs=2e-3)
    assert table[inner, 2] == pytest.approx(((light(x, 1.05) - light(x)) / 0.05)[inner], abs=1e-6)
    assert table[1:-1, 3] == pytest.approx(tail.values.numpy()[1:-1] - table[1:-1, 0])
    assert not table[[0, -1]].any()


def test_each_sample_has_the_profile_of_its_own_widths() -> None:
    halves, widths = torch.tensor([2.4, 3.6, 2.4]).double(), torch.tensor([1.0, 1.0, 1.5]).double()
    distance = torch.linspace(-30, 30, 3 * 2 * 40).double().reshape(3, 2, 40)
    found = probed_light._Profiles(5, 0.6, halves, widths).at(distance)
    for i, (half, width) in enumerate(zip(halves.tolist(), widths.tolist(), strict=True)):
        alone = probed_light._Profiles(5, 0.6, halves[i : i + 1], widths[i : i + 1])
        assert found[i].tolist() == alone.at(distance[i : i + 1])[0].tolist()
        light = band_profile(distance[i].numpy(), 5, 0.6 * width, half)
        assert found[i, ..., 0].numpy() == pytest.approx(light, abs=2e-3)


def order_light(generator: torch.Generator) -> OrderLight:
    """Two samples, three bands and four lines, of which each band is lit by two."""

    def random(*shape: int) -> torch.Tensor:
        return torch.rand(shape, generator=generator, dtype=torch.float64)

    near = torch.tensor([[[0, 1], [1, 2], [2, 3]], [[0, 1], [0, 1], [1, 2]]])
    return OrderLight(
        random(2, 3, 4), random(2, 3), near, random(2, 3, 2, 3), random(2, 4), random(2, 4), random(2, 4),
        near[:, 0],
    )  # fmt: skip


def test_what_the_parameters_change_is_the_sum_over_bands_of_what_each_line_gains() -> None:
    generator = torch.Generator().manual_seed(1)
    orders = [order_light(generator), order_light(generator)]
    nodes = torch.rand((2, 3), generator=generator, dtype=torch.float64)
    nm = np.array([500.0, 510.0, 530.0])
    lines = SimpleNamespace(position=lambda column: column / 10, lines=20)
    owner: Any = SimpleNamespace(
        _scan=SimpleNamespace(model=SimpleNamespace(
            bands=SimpleNamespace(centres_nm=nm, reported=slice(0, 3)), lines=lines)),
        _orders=orders, _known={"column_px": torch.tensor([50.0, 120.0], dtype=torch.float64)},
        rows=torch.cat([orders[0].rows, orders[1].rows, torch.ones((2, 3, 1), dtype=torch.float64)], 2),
    )  # fmt: skip
    found = ProbedLight.changes(owner, nodes).numpy()
    along = np.array([-1.0, -1 / 3, 1.0])
    wanted = np.zeros((2, 9, len(PARAMETERS)))
    for s in range(2):
        for number, light in enumerate(orders):
            own = light.rows[s].numpy().T @ nodes[s].numpy()
            lines_of = wanted[s, 4 * number : 4 * number + 4]
            lines_of[:, 2 + number] = own
            lines_of[:, DRIFT] = own * light.time[s].numpy()
            for band in range(3):
                for k, line in enumerate(light.near[s, band].tolist()):
                    gain = light.changes[s, band, k].numpy() * float(light.white[s, band] * nodes[s, band])
                    lines_of[line, number] += gain[0]
                    lines_of[line, [4, 5]] += gain[1:]
                    lines_of[line, STRETCH + number] += gain[0] * along[band]
        wanted[s, 8, DRIFT] = float(nodes[s].sum()) * ([50, 120][s] / 200 - 0.5)
    assert found == pytest.approx(wanted)


def test_chi_square_is_per_degree_of_freedom_beyond_those_of_a_spectrum() -> None:
    weight = torch.ones((3, 40), dtype=torch.float64)
    weight[2, 35:] = 0.0
    light: Any = SimpleNamespace(weight=weight)
    owner, one = torch.tensor([0, 0, 1]), torch.ones(3, dtype=torch.float64)
    residual = torch.full((3, 40), 2.0, dtype=torch.float64)
    nodes = torch.zeros((2, 5), dtype=torch.float64)
    at = np.arange(len(owner))
    solved = SolvedPixels(light, at, owner, one, one, one, residual, nodes, nodes.T, nodes, nodes == 0)
    assert solved.chi_square.tolist() == pytest.approx([4 * 80 / 55, 4 * 35 / (35 - 35 / 3)])
    few: Any = SimpleNamespace(weight=weight * (torch.arange(40) < 5))
    again = SolvedPixels(few, at, owner, one, one, one, residual, nodes, nodes.T, nodes, nodes == 0)
    assert float(again.chi_square[1]) == pytest.approx(4 * 5 / (5 - 5 / 3))


def test_nodes_at_a_bound_do_not_give_way_to_what_data_ask() -> None:
    rows = torch.rand((2, 7, 4), generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    change = torch.linspace(-1, 1, 14, dtype=torch.float64).reshape(2, 7, 1)
    free = torch.tensor([[True, False, True, True], [True, True, True, True]])
    none: Any = None
    nodes = torch.zeros((2, 4), dtype=torch.float64)
    solved = SolvedPixels(none, none, none, none, none, none, none, nodes, nodes.T, rows.mT @ rows, free)
    found = solved.give_way(rows.mT @ change)[..., 0].numpy()
    for pixel in range(2):
        some = free[pixel].numpy()
        design = rows[pixel].numpy()[:, some]
        wanted = np.linalg.lstsq(design, change[pixel, :, 0].numpy(), rcond=None)[0]
        assert found[pixel, some] == pytest.approx(wanted)
        assert not found[pixel, ~some].any()
    assert solved.give_way((rows.mT @ change)[1:], slice(1, 2))[0, :, 0].numpy() == pytest.approx(found[1])
