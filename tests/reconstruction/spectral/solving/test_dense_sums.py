"""Equations of dense patterns by compiled code against those of the forward model's tensors."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.plan import LineComb
from dsl_core.solve.dense_kernels import channels
from tests.optics.test_pixel_model import COLOURS, COMB, random, some_model
from tests.solve.plain import plain

sums = plain("dsl_core.reconstruction.spectral.solving.dense_sums")


@pytest.mark.parametrize("offset_std", [0.0, 0.2])
@pytest.mark.parametrize("spectral", [COMB, COLOURS], ids=["grey", "colours"])
def test_equations_are_those_of_the_forward_model(spectral: LineComb, offset_std: float) -> None:
    model, pixels, depth = some_model(spectral)
    traced = model.trace(pixels, depth)
    traced.direct[3] = False
    frames, bands = len(model.profiles), model.bands.count
    radiance, weight = random(frames, 5), random(frames, 5)
    weight[2, 1] = 0.0
    variance, colour = torch.full((5,), offset_std**2), torch.tensor([0, 1, 2, 1, 0])
    matrix, right, square = model.equations(traced, colour, radiance, weight, variance.double())
    orders = list(traced.orders)
    half = [0.0] + [model.bands.half_width_px(traced.orders[m].columns) for m in orders]
    tables = torch.stack([model.light(px, depth).table for px in half]).numpy()
    moments = np.stack([model.bands.moments[m] for m in (0, *orders)])
    if tables.shape[2] == 1:
        moments = moments.sum(2, keepdims=True)
    # The third sample comes first; one place has none, and gets nothing.
    index = np.array([[9, 9, 9], [2, -1, 0], [1, 3, 4]])
    found = np.full((2, 3, channels(bands)), np.nan)
    sums.add_dense(
        radiance.T.numpy(), weight.T.numpy(), colour.numpy(), variance.numpy(), index, (1, 3),
        traced.column_px.numpy(), traced.direct.numpy(),
        np.stack([traced.orders[m].columns.numpy() for m in orders]),
        np.stack([model.inside(traced.orders[m]).numpy() for m in orders]), tables, moments, found,
    )  # fmt: skip
    assert not found[0, 1].any()
    largest = float(matrix.abs().max())
    for p, (y, x) in enumerate([(0, 2), (1, 0), (0, 0), (1, 1), (1, 2)]):
        own, triangle = found[y, x], bands * (bands + 1) // 2
        upper = matrix[..., p].numpy()[np.triu_indices(bands)]
        assert own[:triangle] == pytest.approx(upper, rel=1e-6, abs=1e-9 * largest)
        assert own[triangle:-2] == pytest.approx(right[:, p].numpy(), rel=1e-6, abs=1e-9 * largest)
        assert own[-2] == pytest.approx(float(square[p]), rel=1e-6)
        assert own[-1] == frames - (p == 1)
