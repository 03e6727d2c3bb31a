from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import GratingModel
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.random_rig import random_rig
from dsl_core.simulation.rendering.order_reach import may_reach
from dsl_core.simulation.rendering.spectral_tables import NM

WIDTH, HEIGHT = 150, 97
_PUBLISHED = published_rig()
RIGS = [
    rig.model_copy(update={"camera": rig.camera.resized(WIDTH, HEIGHT)})
    for rig in (_PUBLISHED, *(random_rig(seed, _PUBLISHED) for seed in range(3)))
]


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("order", [1, -1, 2, -2])
def test_no_pixel_within_reach_is_left_out_and_most_others_are(rig: Rig, order: int) -> None:
    rng = np.random.default_rng(order + 2)
    across = np.tile(np.arange(WIDTH), HEIGHT)
    # A slope with a hole in it, and steps that no corner of a part knows of.
    depth = 600.0 + across + 150.0 * (rng.random(WIDTH * HEIGHT) < 0.1)
    depth[: 40 * WIDTH][across[: 40 * WIDTH] < 40] = np.nan
    depth_mm = torch.as_tensor(depth, dtype=torch.float32)
    pixels, lit = torch.arange(len(depth_mm)), torch.as_tensor(np.isfinite(depth))
    columns = GratingModel(rig).exact(pixels, depth_mm, order, NM[[0, -1]]).columns
    inside = (columns.amax(0) > -2) & (columns.amin(0) < rig.projector.width_px + 1) & lit
    found = torch.zeros_like(lit)
    found[may_reach(rig, order, pixels, depth_mm, lit, NM[[0, -1]])] = True
    assert not (inside & ~found).any()
    assert not (found & ~lit).any()
    assert found.sum() < inside.sum() + 0.3 * lit.sum()


def test_where_nothing_is_lit_nothing_is_reached() -> None:
    rig = RIGS[0]
    pixels = torch.arange(WIDTH * HEIGHT)
    nothing = torch.zeros(len(pixels), dtype=torch.bool)
    dark = torch.full((len(pixels),), torch.nan)
    assert not len(may_reach(rig, 1, pixels, dark, nothing, NM[[0, -1]]))
