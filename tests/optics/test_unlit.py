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


def test_reach_of_first_orders_is_the_grating_equation_with_a_margin() -> None:
    rig = rig_of(500)
    fx = rig.projector.fx_px
    # Lines 2000 nm apart: 390 and 710 nm leave at these angles.
    near, far = (fx * np.tan(np.arcsin(nm / 2000)) for nm in (390, 710))
    assert first_order_reach_px(rig) == pytest.approx((0.85 * near, 1.15 * far))
    evanescent = first_order_reach_px(rig_of(1600))
    assert evanescent[1] == pytest.approx(1.15 * fx * np.tan(np.arcsin(0.9)))


def test_the_last_column_leaves_room_for_half_a_line_and_three_blurs() -> None:
    rig = rig_of(500)
    edge = WIDTH_PX / 2 + 3 * rig.projector_response.blur_px
    far = unlit_px(rig, WIDTH_PX)[1]
    assert far == pytest.approx(first_order_reach_px(rig)[0] - edge)
    bare = rig.projector_response.model_copy(update={"halo_peak_per_px": 0.0})
    assert unlit_px(rig.model_copy(update={"projector_response": bare}), WIDTH_PX)[0] == pytest.approx(
        far / 2
    )
