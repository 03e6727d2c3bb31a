"""Rays through bent films: the grating equation where the bend is usual, and what other shapes add."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.optics.correspondence import GratingModel, projector_points
from dsl_core.simulation.foreign.film_shape import (
    DENT_RADIUS,
    DENT_SLOPE,
    DENT_U,
    S_SLOPE,
    TWIST_SLOPE,
    BentFilm,
)
from dsl_core.simulation.foreign.light_sources import Sources, trace, traced_nm
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
RIG = RIG.model_copy(update={"camera": RIG.camera.resized(48, 30)})
PIXELS = torch.arange(48 * 30)
DEPTH = torch.full((48 * 30,), 700.0, dtype=torch.float64)
LIT = torch.ones(48 * 30, dtype=torch.bool)


def sources(name: str, order: int = 1) -> Sources:
    return trace(RIG, Foreign(frozenset({name})), order, PIXELS, DEPTH, LIT)


@pytest.mark.parametrize("order", [1, -1, 2])
def test_a_film_of_the_usual_shape_follows_the_grating_equation(order: int) -> None:
    seen = sources("plain", order)
    exact = GratingModel(RIG).exact(PIXELS, DEPTH, order, traced_nm())
    # Beside the frame, where second orders go, places are of no use to anybody.
    shown = exact.inside(RIG.projector.width_px, RIG.projector.height_px)[:, seen.active]
    assert shown.any()
    assert (seen.columns - exact.columns[:, seen.active])[shown].abs().max() < 5e-4
    assert (seen.rows - exact.rows[:, seen.active])[shown].abs().max() < 5e-4


def test_columns_between_traced_wavelengths_are_interpolated() -> None:
    seen = sources("bend-s")
    nm = np.array([433.3, 587.1])
    point = projector_points(RIG, PIXELS[seen.active], DEPTH[seen.active])
    columns, _ = seen.at(nm)
    from dsl_core.optics.pinhole import project

    film = BentFilm(RIG, Foreign(frozenset({"bend-s"})))
    exact = project(RIG.projector, *film.incoming(point, 1, torch.as_tensor(nm)[:, None]))[0]
    error = (columns - exact)[(exact > -1) & (exact < RIG.projector.width_px)].abs()
    # Only where rays leave the projector's image circle are columns less smooth.
    assert error.median() < 1e-6
    assert error.max() < 0.02


@pytest.mark.parametrize(("name", "slope"), [("bend-s", S_SLOPE), ("bend-twist", TWIST_SLOPE)])
def test_slopes_are_those_stated_and_no_tilt_remains(name: str, slope: float) -> None:
    """At the side, or at top and bottom, the slope is the stated one; a fit of a tilt finds none."""
    film, usual = (BentFilm(RIG, Foreign(frozenset({kind}))) for kind in (name, "plain"))
    u = torch.linspace(-film.half_u, film.half_u, 201, dtype=torch.float64)
    half_v = RIG.film.distance_mm * RIG.projector.height_px / 2 / RIG.projector.fy_px
    v = film.middle_v + torch.linspace(-half_v, half_v, 101, dtype=torch.float64)[:, None]
    height, along_u, _ = (
        a - b for a, b in zip(film.sag(u + 0 * v, v + 0 * u), usual.sag(u + 0 * v, v + 0 * u), strict=True)
    )
    assert float(along_u.abs().max()) == pytest.approx(slope, rel=0.02)
    step = float(u[1] - u[0])
    assert torch.gradient(height, dim=1)[0][:, 1:-1] / step == pytest.approx(
        along_u[:, 1:-1].numpy(), abs=1e-5
    )
    tilt = float((height * u).sum() / (u * u).expand_as(height).sum())
    assert abs(tilt) < 0.02 * slope


def test_a_dent_has_the_stated_slope_at_its_flank_and_none_in_its_middle() -> None:
    film, usual = (BentFilm(RIG, Foreign(frozenset({kind}))) for kind in ("film-dent", "plain"))
    middle, radius = DENT_U * film.half_u, DENT_RADIUS * film.half_u
    u = torch.linspace(middle - 4 * radius, middle + 4 * radius, 401, dtype=torch.float64)
    v = torch.full_like(u, film.middle_v)
    height, along_u, along_v = (a - b for a, b in zip(film.sag(u, v), usual.sag(u, v), strict=True))
    assert torch.gradient(height, spacing=(u,))[0][1:-1] == pytest.approx(along_u[1:-1].numpy(), abs=1e-4)
    assert float(along_u.abs().max()) == pytest.approx(DENT_SLOPE, rel=1e-3)
    assert float((u[along_u.argmax()] - middle).abs()) == pytest.approx(radius, rel=0.02)
    assert float(along_u[200].abs()) < 1e-9
    assert not along_v.any()
    # Across the lines and along them it is the same.
    turned = film.sag(torch.full_like(u, middle), film.middle_v + u - middle)
    flat = usual.sag(torch.full_like(u, middle), film.middle_v + u - middle)
    assert (turned[2] - flat[2]).numpy() == pytest.approx(along_u.numpy(), abs=1e-9)


@pytest.mark.parametrize("name", ["bend-s", "bend-twist", "film-dent"])
def test_first_orders_move_by_columns_and_the_zero_order_stays(name: str) -> None:
    """Half a column in the root of the mean square over the frame: 1 nm of wavelength."""
    bent, usual = sources(name), sources("plain")
    both = np.intersect1d(bent.active.numpy(), usual.active.numpy(), return_indices=True)
    columns, rows = usual.columns[:, both[2]], usual.rows[:, both[2]]
    inside = (
        (columns > 0) & (columns < RIG.projector.width_px) & (rows > 0) & (rows < RIG.projector.height_px)
    )
    moved = (bent.columns[:, both[1]] - columns)[inside]
    assert 0.3 < float(moved.square().mean().sqrt()) < 1.0
    assert 1.0 < float(moved.abs().max()) < 5.0
    assert torch.equal(sources(name, 0).columns, sources("plain", 0).columns)
