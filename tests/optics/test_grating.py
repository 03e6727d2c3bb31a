"""The film's ray equations: closed form, sign of the orders, convergence, interpolation over wavelength."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from dsl_core.model.rig import SHAPE_POWERS, Film, FilmShape, Rig
from dsl_core.optics import grating
from dsl_core.optics.correspondence import Footprint, GratingModel, projector_points, zero_order
from dsl_core.optics.grating import FilmFrame, Vectors, incoming_direction
from dsl_core.optics.pinhole import project
from dsl_core.simulation.foreign.film_shape import BentFilm
from dsl_core.simulation.foreign.variants import Foreign
from dsl_core.simulation.published_rig import published_rig

BANDS_NM = np.arange(430.0, 661.0, 5.0)
NM = torch.tensor([430.0, 550.0, 660.0], dtype=torch.float64)


def diffract(a: torch.Tensor, b: torch.Tensor, order: int, over_period: torch.Tensor | float) -> Vectors:
    """Outgoing direction cosines of incoming (a, b); NaN where the order is evanescent."""
    out = a - order * over_period
    return Vectors(out, b, torch.sqrt(1 - out * out - b * b))


def sampled(rig: Rig, count: int = 400) -> tuple[torch.Tensor, torch.Tensor]:
    """Random pixels and depths, float64."""
    rng = np.random.default_rng(5)
    pixels = rng.integers(0, rig.camera.width_px * rig.camera.height_px, count)
    return torch.as_tensor(pixels), torch.as_tensor(rng.uniform(520.0, 980.0, count))


def point(x: float, y: float, z: float) -> Vectors:
    return Vectors(*(torch.tensor([v], dtype=torch.float64) for v in (x, y, z)))


@pytest.mark.parametrize("order", [1, -1, 2])
def test_flat_film_and_far_point_obey_the_grating_equation(order: int) -> None:
    frame = FilmFrame.of(Film(lines_per_mm=500.0))
    direction = incoming_direction(frame, point(0.0, 0.0, 1e9), order, NM)
    # Leaving along the axis (a' = 0) through order m takes light that arrives with m * wavelength / period.
    assert direction.x.numpy() == pytest.approx(order * NM.numpy() / 2000.0, abs=1e-6)
    assert direction.y.abs().max() < 1e-12
    length = direction.x**2 + direction.y**2 + direction.z**2
    assert (length - 1).abs().max() < 1e-9


@pytest.mark.parametrize("order", [1, -1])
def test_orders_that_cannot_leave_the_film_come_at_grazing_incidence(order: int) -> None:
    frame = FilmFrame.of(Film(lines_per_mm=2500.0))  # 1.1 to 1.7 wavelengths a period
    direction = incoming_direction(frame, point(0.0, 0.0, 800.0), order, NM)
    assert direction.x.numpy() == pytest.approx(order * 0.999)
    assert (direction.z > 0).all()


def test_order_plus_one_comes_from_columns_right_of_the_zero_order() -> None:
    rig = published_rig()
    pixels, depth = sampled(rig)
    zero = zero_order(rig, pixels, depth)[0]
    model = GratingModel(rig)
    plus, minus = (model.exact(pixels, depth, order, BANDS_NM).columns for order in (1, -1))
    assert (plus > zero).all()
    assert (minus < zero).all()
    # Red is bent more than blue, by about half a column a nanometre (measured on the prototype).
    slope = (plus[-1] - plus[0]) / (BANDS_NM[-1] - BANDS_NM[0])
    inside = (plus > 0) & (plus < 639)
    assert (slope > 0).all()
    assert float(slope[inside.all(0)].mean()) == pytest.approx(0.49, abs=0.03)


def test_diffraction_changes_only_the_cosine_across_the_lines() -> None:
    a, b = torch.tensor([0.1, -0.2]), torch.tensor([0.3, 0.05])
    out = diffract(a, b, 1, 0.25)
    assert torch.equal(out.y, b)
    assert torch.allclose(out.x, a - 0.25)
    assert torch.allclose(out.x**2 + out.y**2 + out.z**2, torch.ones(2))
    assert torch.isnan(diffract(torch.tensor([-0.9]), torch.tensor([0.3]), 1, 0.3).z).all()


def test_light_traced_forward_through_the_film_meets_the_point() -> None:
    frame = FilmFrame.of(Film(tilt_x_deg=2.0, tilt_y_deg=-1.0, roll_deg=1.5))
    target = point(40.0, -60.0, 700.0)
    out = frame.to_film(incoming_direction(frame, target, 1, NM))
    distance = (frame.axes @ np.array([0.0, 0.0, frame.distance_mm]))[2]
    scale = distance / out.z
    leaving = diffract(out.x, out.y, 1, NM / frame.period_nm)
    goal = frame.to_film(target)
    along = (goal.z - distance) / leaving.z
    assert (out.x * scale + leaving.x * along - goal.x).abs().max() < 1e-3
    assert (out.y * scale + leaving.y * along - goal.y).abs().max() < 1e-3


def test_no_step_takes_time_for_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = published_rig()
    pixels, depth = sampled(rig)
    found = {}
    for steps in (grating.STEPS - 1, grating.STEPS, 60):
        monkeypatch.setattr(grating, "STEPS", steps)
        found[steps] = GratingModel(rig).exact(pixels, depth, 1, BANDS_NM)
    fewer, few, many = found.values()
    inside = many.inside(640, 360)
    assert (few.columns - many.columns)[inside].abs().max() < 3e-5
    assert (few.rows - many.rows)[inside].abs().max() < 3e-5
    assert (fewer.columns - many.columns)[inside].abs().max() > 3e-5


@pytest.mark.parametrize(
    ("film_mm", "scene_mm"), [(29, 700), (29, 300), (60, 300), (80, 300), (29, 100), (150, 300), (5, 20000)]
)
def test_light_arrives_where_it_is_sent_wherever_the_film_is(film_mm: float, scene_mm: float) -> None:
    """A ray in the plane across the lines is traced forwards, by the sine of its angle alone."""
    frame = FilmFrame.of(Film(distance_mm=film_mm, lines_per_mm=500.0))
    sent = torch.atan(torch.linspace(-0.32, 0.32, 33, dtype=torch.float64))
    for order in (1, -1):
        for nm in NM:
            leaving = torch.asin(torch.sin(sent) - order * nm / frame.period_nm)
            across = film_mm * torch.tan(sent) + (scene_mm - film_mm) * torch.tan(leaving)
            there = Vectors(across, torch.zeros_like(across), torch.full_like(across, scene_mm))
            back = incoming_direction(frame, there, order, nm.expand(len(sent)))
            # 1,000 columns a radian, as the published projector has nearly.
            assert 1000 * (back.x / back.z - torch.tan(sent)).abs().max() < 2e-3


def test_interpolation_over_wavelength_is_exact_to_a_hundredth_column() -> None:
    rig = published_rig()
    pixels, depth = sampled(rig, 4000)
    model = GratingModel(rig)
    for order in (1, -1):
        exact = model.exact(pixels, depth, order, BANDS_NM)
        error = (model.trace(pixels, depth, order, BANDS_NM).columns - exact.columns).abs()
        # The lens model is not smooth far outside the frame; pixels whose spectrum ends there err more.
        inside = exact.inside(640, 360)
        assert error[:, inside.all(0)].max() < 0.01
        assert error[inside].quantile(0.99) < 0.01


def test_zero_order_is_the_pinhole() -> None:
    rig = published_rig()
    pixels, depth = sampled(rig)
    column, row = project(rig.projector, *projector_points(rig, pixels, depth))
    footprint = GratingModel(rig).trace(pixels, depth, 0, BANDS_NM)
    assert torch.equal(footprint.columns, column.expand(47, -1))
    assert torch.equal(footprint.rows, row.expand(47, -1))
    camera = rig.camera
    x, y = (100 - camera.cx_px) / camera.fx_px, (200 - camera.cy_px) / camera.fy_px
    assert math.hypot(x, y) < 0.3


def test_film_of_no_lines_bends_nothing() -> None:
    frame = FilmFrame.of(Film(lines_per_mm=1e-6, bend_per_mm=0.002, tilt_x_deg=3.0))
    target = point(50.0, 20.0, 600.0)
    direction = incoming_direction(frame, target, 1, NM)
    assert (direction.x / direction.z - target.x / target.z).abs().max() < 1e-7
    assert (direction.y / direction.z - target.y / target.z).abs().max() < 1e-7


@pytest.mark.parametrize("order", [1, -1])
def test_light_through_a_bent_film_leaves_from_where_it_meets_it(
    order: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grating, "STEPS", 80)
    film = Film(
        lines_per_mm=200, bend_per_mm=0.03, tilt_x_deg=2.0, tilt_y_deg=-4.0, roll_deg=3.0, distance_mm=30.0
    )
    frame = FilmFrame.of(film)
    target = point(80.0, 30.0, 600.0)
    direction = frame.to_film(incoming_direction(frame, target, order, NM))
    origin, goal = frame.axes @ np.array([0.0, 0.0, 30.0]), frame.to_film(target)
    # Where the ray meets the surface z = z0 + bend / 2 (x - x0)^2.
    a = 0.015 * direction.x**2
    b, c = -0.03 * origin[0] * direction.x - direction.z, 0.015 * origin[0] ** 2 + origin[2]
    along = 2 * c / (-b + torch.sqrt(b * b - 4 * a * c))
    x, y, z = (along * part for part in direction)
    tilt = torch.atan(0.03 * (x - origin[0]))
    cos, sin = torch.cos(tilt), torch.sin(tilt)
    into = direction.x * cos + direction.z * sin - order * NM / frame.period_nm
    through = torch.sqrt(1 - into**2 - direction.y**2)
    out = into * cos - through * sin, direction.y, into * sin + through * cos
    assert (direction.x**2 + direction.y**2 + direction.z**2 - 1).abs().max() < 1e-9
    far = (goal.z - z) / out[2]
    assert (x + far * out[0] - goal.x).abs().max() < 1e-6
    assert (y + far * out[1] - goal.y).abs().max() < 1e-6


def test_a_twisted_film_sends_light_where_its_own_twin_does() -> None:
    """The twin renders its foreign films by other formulas, with vectors instead of turns."""
    rig = published_rig()
    pixels, depth = sampled(rig)
    bent = BentFilm(rig, Foreign(frozenset({"bend-twist"})))
    shape = FilmShape(middle_mm=bent.middle_v, factors=(bent.twist_per_mm, 0.0, 0.0, 0.0, 0.0, 0.0))
    twisted = rig.film.model_copy(update={"shape": shape})
    point = projector_points(rig, pixels, depth)
    plain = project(rig.projector, *incoming_direction(FilmFrame.of(rig.film), point, 1, NM[:, None]))
    found = project(rig.projector, *incoming_direction(FilmFrame.of(twisted), point, 1, NM[:, None]))
    wanted = project(rig.projector, *bent.incoming(point, 1, NM[:, None]))
    inside = Footprint(*wanted).inside(rig.projector.width_px, rig.projector.height_px)
    assert float((plain[0] - wanted[0])[inside].abs().max()) > 1.0
    for seen, truth in zip(found, wanted, strict=True):
        assert float((seen - truth)[inside].abs().max()) < 1e-3


def test_the_slopes_of_a_film_are_those_of_its_height() -> None:
    factors = (0.007, -0.005, 2e-4, -3e-4, 4e-4, -5e-4)
    film = Film(bend_per_mm=0.003, shape=FilmShape(middle_mm=-6.0, factors=factors))
    u, v = (torch.tensor(each, dtype=torch.float64) for each in ([-9.0, 1.0, 7.0], [-11.0, -6.0, -1.0]))
    height, *slopes = FilmFrame.of(film).surface(u, v)
    wanted = 0.0015 * u**2
    for factor, (i, j) in zip(factors, SHAPE_POWERS, strict=True):
        wanted = wanted + factor * u**i * (v + 6.0) ** j
    assert torch.allclose(height, wanted)
    for slope, (du, dv) in zip(slopes, ((1e-5, 0.0), (0.0, 1e-5)), strict=True):
        ahead, behind = (FilmFrame.of(film).surface(u + s * du, v + s * dv)[0] for s in (1, -1))
        assert slope is not None
        assert torch.allclose(slope, (ahead - behind) / 2e-5, atol=1e-7)
