"""The twin's world: what the camera sees of a pattern, and that noise and stage do what they promise."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from dsl_core.devices.base import DeviceRig
from dsl_core.errors import DeviceError
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import zero_order
from dsl_core.optics.sensor import bayer_channels
from dsl_core.optics.spectra import chain_response
from dsl_core.simulation.bandpass_filters import true_transmission
from dsl_core.simulation.published_rig import published_rig
from dsl_core.simulation.rendered_scene import Setup
from dsl_core.simulation.rendering.pattern_table import PatternTable, between
from dsl_core.simulation.rendering.renderer import Renderer
from dsl_core.simulation.rendering.spectral_tables import BROAD, NM, Slicing
from dsl_core.simulation.scenes.catalogue import make_scene
from dsl_core.simulation.sim_devices import SimCamera, SimSpectroradiometer, open_twin
from dsl_core.simulation.world import Kept, World

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


def test_a_kept_value_is_made_again_when_what_it_is_made_from_changes() -> None:
    lower: Kept[list[int]] = Kept()
    upper: Kept[list[int]] = Kept(lower)
    base, other = [1], [1]
    first = upper.of((base,), lambda: [1])
    under = lower.of((first,), lambda: [2])
    assert upper.of((base,), lambda: [3]) is first
    assert lower.of((first,), lambda: [4]) is under
    # An equal object is another one; what rests on the value is released before it is made again.
    again = upper.of((other,), lambda: [] if lower._held else [5])
    assert again == [5]
    assert lower.of((first,), lambda: [6]) == [6]


def test_only_what_changed_is_made_again() -> None:
    here = world()
    here.show(bands_of_columns((0, 640)))
    rate, bare, truth = here.rate(), here.renderer, here.truth
    assert here.rate() is rate
    here.show(bands_of_columns((0, 100)))
    assert here.rate() is not rate
    assert here.renderer is bare
    here.insert(True, true_transmission(540.0))
    assert here.renderer is not bare
    here.insert(True, None)
    assert here.renderer is bare
    here.insert(False, None)
    assert here.renderer is not bare
    assert here.truth is truth
    here.move_to(710.0)
    assert here.truth is not truth


def world(seed: int = 0) -> World:
    rig = small_rig()
    return World(Setup(rig), scene_at=lambda mm: make_scene("plane", depth_mm=mm), seed=seed)


def test_noise_depends_only_on_seed_shot_and_attempt() -> None:
    one, other = world(), world()
    image = bands_of_columns((0, 640))
    one.show(image)
    first = one.expose(100.0, 7, 1)
    other.show(bands_of_columns())
    other.expose(50.0, 3)
    other.show(image)
    assert np.array_equal(other.expose(100.0, 7, 1), first)
    assert not np.array_equal(other.expose(100.0, 7, 2), first)
    assert not np.array_equal(other.expose(100.0, 8, 1), first)
    reseeded = world(seed=1)
    reseeded.show(image)
    assert not np.array_equal(reseeded.expose(100.0, 7, 1), first)


def test_a_pattern_changed_by_its_owner_does_not_change_what_is_shown() -> None:
    here = world()
    image = bands_of_columns((0, 640))
    here.show(image)
    image[:] = 0
    assert here.rate().max() > 1


def open_small(**options: str) -> DeviceRig:
    return open_twin({"size": f"{SIZE[0]}x{SIZE[1]}", "scene": "plane", **options})


def test_stage_moves_the_plane_and_dims_it() -> None:
    rig = open_small(noise="off")
    assert rig.stage is not None
    assert isinstance(rig.camera, SimCamera)
    means = []
    for position in (600.0, 900.0):
        assert rig.stage.move_to(position) == position
        assert rig.camera.world.truth.depth_mm == pytest.approx(position)
        rig.projector.show(bands_of_columns((0, 640), level=60))
        means.append(rig.camera.snap().pixels.mean() - 260)
    assert means[0] / means[1] == pytest.approx((900 / 600) ** 2, rel=0.12)
    with pytest.raises(DeviceError, match="travels from"):
        rig.stage.move_to(1200.0)


@pytest.mark.parametrize("grey", [True, False])
def test_spectroradiometer_sees_the_leds_through_the_target(grey: bool) -> None:
    rig = open_small(noise="off", film="off")
    meter = rig.spectroradiometer
    assert isinstance(meter, SimSpectroradiometer)
    dark = np.array(meter.measure().values)
    image = np.full((360, 640), 255, np.uint8)
    rig.projector.show(image if grey else np.repeat(image[..., None], 3, 2))
    curve = meter.measure()
    emission = sum(led.at(np.array(curve.wavelengths_nm)) for led in published_rig().emission)
    assert np.array(curve.values) == pytest.approx(0.99 * emission, rel=1e-6)
    black = published_rig().projector_response.black_fraction
    assert dark == pytest.approx(black * np.array(curve.values), rel=1e-6)


def test_spectroradiometer_sees_first_orders_through_the_film() -> None:
    curves = {}
    for film in ("on", "off"):
        rig = open_small(noise="off", film=film)
        assert rig.spectroradiometer is not None
        rig.projector.show(np.full((360, 640), 255, np.uint8))
        curves[film] = rig.spectroradiometer.measure()
    nm = np.array([450.0, 550.0])
    gain = curves["on"].at(nm) / curves["off"].at(nm) - 1
    efficiency = published_rig().efficiency
    assert (gain > 0.5 * efficiency[-1].at(nm)).all()
    assert (gain < 1.01 * (efficiency[1].at(nm) + efficiency[-1].at(nm))).all()


def test_spectroradiometer_noise_is_a_share_of_the_peak() -> None:
    meters = {noise: open_small(noise=noise) for noise in ("on", "off")}
    curves = {}
    for noise, rig in meters.items():
        assert rig.spectroradiometer is not None
        rig.projector.show(bands_of_columns((0, 640)))
        curves[noise] = np.array(rig.spectroradiometer.measure().values)
    spread = (curves["on"] - curves["off"]).std() / curves["off"].max()
    assert spread == pytest.approx(SimSpectroradiometer.NOISE, rel=0.15)
