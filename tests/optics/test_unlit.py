"""Between the zero order and the first orders no order lights a pixel, whatever film and projector."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import correspondence, zero_order
from dsl_core.optics.unlit import first_order_reach_px, unlit_px
from dsl_core.simulation.published_rig import published_rig

WIDTH_PX = 5


def rig_of(lines_per_mm: float, columns: int = 640) -> Rig:
    rig = published_rig()
    film = rig.film.model_copy(update={"lines_per_mm": lines_per_mm})
    return rig.model_copy(
        update={"film": film, "projector": rig.projector.resized(columns, columns * 9 // 16)}
    )


@pytest.mark.parametrize(
    ("lines_per_mm", "columns"), [(500, 640), (480, 640), (300, 640), (250, 640), (480, 320), (600, 320)]
)
def test_no_first_order_lies_between_the_distances(lines_per_mm: float, columns: int) -> None:
    rig = rig_of(lines_per_mm, columns)
    near, far = unlit_px(rig, WIDTH_PX)
    assert far > near + WIDTH_PX
    nearest, farthest = first_order_reach_px(rig)
    rng = np.random.default_rng(0)
    pixels = torch.as_tensor(rng.integers(0, 890 * 580, 500))
    depth = torch.as_tensor(rng.uniform(*rig.depth_range_mm, 500))
    zero = zero_order(rig, pixels, depth)[0]
    model = correspondence(rig)
    for order in (1, -1):
        seen = model.trace(pixels, depth, order, np.array([400.0, 700.0]))
        apart = (seen.columns - zero).abs()[seen.inside(columns, columns * 9 // 16)]
        assert float(apart.min()) > far + WIDTH_PX / 2
        assert nearest < float(apart.min()) < float(apart.max()) < farthest


def test_the_published_film_keeps_the_columns_it_always_had() -> None:
    assert unlit_px(published_rig(), WIDTH_PX) == pytest.approx((80.0, 157.0), abs=3)


def test_the_halo_falls_before_the_first_column() -> None:
    rig = rig_of(300)
    assert unlit_px(rig, WIDTH_PX)[0] == 2 * rig.projector_response.halo_decay_px
    bare = rig.projector_response.model_copy(update={"halo_peak_per_px": 0.0})
    assert unlit_px(rig.model_copy(update={"projector_response": bare}), WIDTH_PX)[0] < 50


def test_a_coarse_film_leaves_none() -> None:
    near, far = unlit_px(rig_of(150), WIDTH_PX)
    assert far <= near
