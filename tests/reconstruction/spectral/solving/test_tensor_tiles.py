"""Spectra of tiles by tensors: what an offset that frames share makes of them, and how they are stopped."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import torch

from dsl_core.reconstruction.spectral.solving import tensor_tiles
from dsl_core.reconstruction.spectral.solving.prior import Prior
from dsl_core.reconstruction.spectral.solving.solution import Spectra
from dsl_core.reconstruction.spectral.solving.tensor_tiles import TensorTiles, with_offset

BANDS = 4


def test_an_offset_that_looks_like_a_grey_makes_spectra_as_unsure() -> None:
    prior = Prior()
    matrix = torch.full((1, BANDS, 1), 3.0)
    like_grey = matrix[0] + prior.level_std**-2
    spectra = Spectra.empty(torch.zeros((BANDS, 1)))
    spectra.std[:] = 0.004
    variance = (0.003 * like_grey) ** 2
    assert with_offset(spectra, matrix, variance, prior).std.numpy() == pytest.approx(0.005)


def test_spectra_of_dense_patterns_can_be_stopped_at_every_part_of_a_tile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(tensor_tiles, "DENSE_PIXELS", 2)
    pixels = 5
    frames: Any = SimpleNamespace(flat=torch.arange(pixels), known=lambda name: torch.ones(pixels))
    values = torch.zeros((1, pixels))

    def equations(
        traced: object, colour: object, radiance: torch.Tensor, *more: object
    ) -> tuple[torch.Tensor, ...]:
        many = radiance.shape[-1]
        matrix = torch.eye(BANDS)[..., None].expand(-1, -1, many)
        return matrix, torch.ones((BANDS, many)), torch.ones(many)

    samples = (values[0], values, values + 1, values[0])
    monkeypatch.setattr(tensor_tiles, "dense_samples", lambda *given: samples)
    monkeypatch.setattr(tensor_tiles, "_gather", lambda *tiles: SimpleNamespace(sum=lambda each: each))
    model: Any = SimpleNamespace(equations=equations, single=False)
    asked: list[int] = []
    traced: Any = SimpleNamespace(part=lambda part: part)
    own = TensorTiles(Prior(), 0.0).solve(
        model, frames, frames, traced, None, lambda: asked.append(len(asked))
    )
    assert own[0].nodes.shape == (BANDS, pixels)
    assert len(asked) == 3 + 3, "for the equations of each part, and for its spectra"
