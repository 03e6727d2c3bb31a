"""What the camera sees of a pattern: lines and slices agree, and orders bring the light they should."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.bandpass_filters import true_transmission
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendering import order_tables
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.rendering.spectral_tables import BROAD, NM, Slicing
from dsl_core.simulation.scenes.catalogue import make_scene

SIZE = (64, 42)


def small_rig(**projector: float) -> Rig:
    rig = published_rig()
    response = rig.projector_response.model_copy(update=projector)
    return rig.model_copy(update={"camera": rig.camera.resized(*SIZE), "projector_response": response})


def renderer(rig: Rig, *, film: bool = True, scene: str = "color-checker") -> Renderer:
    truth = make_scene(scene).render(rig.camera, rig.pose.projector_centre_mm)
    return Renderer(rig, truth, film=film)


def bands_of_columns(*bands: tuple[int, int], level: int = 255) -> NDArray[np.uint8]:
    image = np.zeros((360, 640, 3), np.uint8)
    for start, stop in bands:
        image[:, start:stop] = level
    return image


@pytest.fixture(scope="module")
def chart() -> Renderer:
    return renderer(small_rig())


@pytest.mark.parametrize("band", [(300, 340), (100, 116), (0, 640)])
def test_lines_and_slices_render_the_same_light(
    chart: Renderer, band: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    image = bands_of_columns(band)
    lines = chart.expected(image)
    monkeypatch.setattr("dsl_core.simulation.rendering.renderer.MAX_RUNS", 0)
    sliced = chart.expected(image)
    assert not np.array_equal(lines, sliced)
    scale = lines.max()
    assert np.abs(lines - sliced).max() < 0.0015 * scale
    # Beside the zero order only dispersed light is left: a few percent of it, and the same in both.
    dim = lines < 0.05 * scale
    assert np.abs(lines - sliced)[dim].max() < 4e-4 * scale


@pytest.mark.parametrize("film", [True, False])
def test_loops_over_pixels_and_operations_over_arrays_render_the_same(
    film: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    some = renderer(small_rig(black_fraction=0.01), film=film)
    drawn = np.random.default_rng(3).integers(0, 256, (360, 640, 3)).astype(np.uint8)
    images = {
        "line": bands_of_columns((300, 305)),
        "beside the frame": bands_of_columns((0, 3), (600, 640), level=90),
        "comb": bands_of_columns(*((start, start + 5) for start in range(20, 640, 52))),
        "code": bands_of_columns(*((start, start + 2) for start in range(0, 640, 4))),
        "colours": np.repeat(drawn[:1], 360, 0),
        "rows": np.repeat(drawn[:, :1], 640, 1),
    }
    looped = {name: some.expected(image) for name, image in images.items()}
    monkeypatch.setattr("dsl_core.simulation.rendering.renderer.by_pixel", lambda signal: False)
    monkeypatch.setattr("dsl_core.simulation.rendering.first_orders.by_pixel", lambda signal: False)
    some = some.through(None)  # which has kept no line
    for name, image in images.items():
        assert looped[name] == pytest.approx(some.expected(image), abs=3e-5 * float(looped[name].max())), name
        assert looped[name].max() > 0


def test_disjoint_bands_add_up_to_white(chart: Renderer) -> None:
    edges = range(0, 641, 80)
    parts = sum(
        chart.expected(bands_of_columns((a, b))) - chart.expected(bands_of_columns())
        for a, b in pairwise(edges)
    )
    white = chart.expected(bands_of_columns((0, 640))) - chart.expected(bands_of_columns())
    assert np.abs(parts - white).max() < 2e-3 * white.max()


def test_dark_projector_gives_its_black_share_of_white() -> None:
    leaking = renderer(small_rig(black_fraction=0.01))
    dark, white = leaking.expected(bands_of_columns()), leaking.expected(bands_of_columns((0, 640)))
    lit = white > 0.05 * white.max()
    assert np.abs(dark[lit] / white[lit] - 0.01).max() < 3e-4
    assert not renderer(small_rig(black_fraction=0.0)).expected(bands_of_columns()).any()


def test_without_film_only_the_zero_order_is_left() -> None:
    rig = small_rig(black_fraction=0.0)
    line = bands_of_columns((300, 305))
    with_film, without = (renderer(rig, film=film) for film in (True, False))
    assert {tables.order for tables in with_film.orders if len(tables.active)} >= {1, -1}
    far = (with_film.column - 302).abs() > 100
    pixels = with_film.pixels[far]
    assert not without.expected(line).ravel()[pixels].any()
    assert with_film.expected(line).ravel()[pixels].max() > 0


def test_white_plane_without_film_has_the_closed_form() -> None:
    rig = small_rig(black_fraction=0.0)
    plane = renderer(rig, film=False, scene="plane")
    white = plane.expected(bands_of_columns((0, 640)))
    channel = bayer_channels(rig.sensor.bayer, *white.shape)
    full = 0.99 * chain_response(rig, 0, NM).sum((1, 2))[channel]
    y, x = 20, 30
    flat = torch.tensor([y * SIZE[0] + x])
    assert 20 < float(zero_order(rig, flat, torch.tensor([700.0]))[0]) < 620
    truth = make_scene("plane").render(rig.camera, rig.pose.projector_centre_mm)
    ray = np.array([(x - rig.camera.cx_px) / rig.camera.fx_px, (y - rig.camera.cy_px) / rig.camera.fy_px, 1])
    to_light = rig.pose.projector_centre_mm - 700 * ray
    distance = np.linalg.norm(to_light)
    shading = (truth.normals[:, y, x] @ to_light) / distance * (rig.reference_distance_mm / distance) ** 2
    assert white[y, x] == pytest.approx(full[y, x] * shading, rel=2e-3)


@pytest.mark.parametrize(
    ("pattern", "most", "rms"),
    [("random columns", 5e-4, 4e-5), ("stripes", 1e-3, 1e-4), ("rows", 1e-3, 8e-5)],
)
def test_broad_slices_are_close_to_fine_ones(
    pattern: str, most: float, rms: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    levels = np.random.default_rng(4).integers(0, 256, 640)
    if pattern != "random columns":
        levels = (np.arange(640) // 2 % 2) * 255
    image = np.empty((360, 640), np.uint8)
    image[:] = levels[:360, None] if pattern == "rows" else levels
    broad = renderer(small_rig()).expected(image)
    monkeypatch.setattr("dsl_core.simulation.rendering.renderer.BROAD", Slicing(1, 1, 0.0))
    fine = renderer(small_rig()).expected(image)
    error = (broad - fine) / fine.max()
    assert BROAD.nm == 10
    assert 0 < np.abs(error).max() < most
    assert np.sqrt((error**2).mean()) < rms


def test_expected_light_moves_with_the_pattern_of_each_led(chart: Renderer) -> None:
    red = bands_of_columns((0, 640))
    red[..., 1:] = 0
    seen = chart.expected(red)
    channels = bayer_channels(chart.rig.sensor.bayer, *seen.shape)
    assert seen[channels == 0].mean() > 5 * seen[channels == 2].mean()


def test_many_lines_behind_a_filter_are_the_sum_of_each(chart: Renderer) -> None:
    filtered = chart.through(true_transmission(540.0))
    bands = [(start, start + 5) for start in range(20, 640, 52)]
    dark = filtered.expected(bands_of_columns())
    comb = filtered.expected(bands_of_columns(*bands)) - dark
    singly = np.sum([filtered.expected(bands_of_columns(band)) - dark for band in bands], axis=0)
    assert len(bands) > 8
    assert comb == pytest.approx(singly, abs=1e-4 * float(comb.max()))


def test_slices_behind_a_filter_are_as_narrow_as_its_images(chart: Renderer) -> None:
    filtered = chart.through(true_transmission(540.0))
    line = bands_of_columns((300, 308))
    dark = filtered.expected(bands_of_columns())
    white = filtered.expected(line) - dark
    # Each LED alone is no grey image, so that it goes through the slices.
    alone = [line * (np.arange(3) == led).astype(np.uint8) for led in range(3)]
    leds = np.sum([filtered.expected(image) - dark for image in alone], axis=0)
    # Beside the zero order only dispersed light is left.
    far = filtered.pixels[(filtered.column - 302).abs() > 20].numpy()
    lines, sliced = white.ravel()[far], leds.ravel()[far]
    assert (lines > 0.002 * white.max()).sum() > 50
    assert np.sqrt(((sliced - lines) ** 2).mean()) < 0.02 * np.sqrt((lines**2).mean())
    assert sliced.sum() == pytest.approx(lines.sum(), rel=3e-3)


def test_wavelengths_of_columns_are_the_same_whatever_is_worked_on_together(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # The last chunk is one pixel short of a whole one here.
    together = renderer(small_rig()).orders[0].inverse
    monkeypatch.setattr(order_tables, "CHUNK", together.shape[1] // 2 + 1)
    apart = renderer(small_rig()).orders[0].inverse
    assert torch.equal(together, apart)
