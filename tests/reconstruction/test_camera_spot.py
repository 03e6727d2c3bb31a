"""Columns of pixels that see a spot of the scene: light and place are sums over a finely sampled spot."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core.model.plan import CapturePlan, LineComb
from dsl_core.model.result import Flag
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import triangulate, zero_order
from dsl_core.optics.lines.line_set import LineSet
from dsl_core.reconstruction.camera_spot import (
    CameraSpot,
    column_slopes,
    fit_spot,
    follow_spot,
    spot_finding,
)
from dsl_core.reconstruction.geometry import Geometry
from dsl_core.reconstruction.light_pull import light_slopes
from dsl_core.reconstruction.scan_result import known_pixels
from dsl_core.reconstruction.surface import reconstruct_surface
from tests.cases.small_rig import small_rig

LINES = LineSet.of(CapturePlan())
SHAPE = ROWS, COLUMNS = 60, 90
NOISE_PX = 0.01
#: Samples a pixel.
FINE = 8


def rig() -> Rig:
    """The middle of a camera that sees a projector column a pixel."""
    known = small_rig()
    lens = known.camera.resized(445, 290)
    place = {"cx_px": COLUMNS / 2, "cy_px": ROWS / 2, "width_px": COLUMNS, "height_px": ROWS}
    return known.model_copy(update={"camera": lens.model_copy(update=place)})


def seen(spot_px: float) -> tuple[np.ndarray, np.ndarray]:
    """Light (rows, columns) and place of the light (px, 2, rows, columns) of patches with dark borders.

    The spot is Gaussian, or that of an even pixel where it is NaN, and everything is summed over samples of
    the surface.
    """
    margin = 8
    y, x = (np.arange((n + 2 * margin) * FINE) / FINE - margin for n in SHAPE)
    random = np.random.default_rng(2)
    level = random.uniform(0.2, 0.9, (20, 20))
    tile = level[(y // 15).astype(int)[:, None] % 20, (x // 15).astype(int)[None] % 20]
    border = ((y % 15) < 4)[:, None] | ((x % 15) < 4)[None]
    surface = np.where(border, 0.05, tile)

    def weights(places: np.ndarray, count: int) -> np.ndarray:
        away = places[None] - np.arange(count)[:, None]
        if np.isnan(spot_px):
            return np.asarray(((np.abs(away) < 0.5) + 0.5 * (np.abs(away) == 0.5)) / FINE)
        width = max(spot_px, 0.01)
        found = np.exp(-0.5 * (away / width) ** 2)
        return np.asarray(found / found.sum(1, keepdims=True))

    down, across = weights(y, ROWS), weights(x, COLUMNS)
    light = down @ surface @ across.T
    place = [down @ (surface * x) @ across.T / light, down @ (surface * y[:, None]) @ across.T / light]
    return light, np.stack(place)


def geometry(rig: Rig, spot_px: float) -> tuple[Geometry, np.ndarray]:
    """What is found of a plane, and its depth (mm)."""
    light, place = seen(spot_px)
    flat = torch.arange(ROWS * COLUMNS)
    depth = np.full(SHAPE, 700.0)
    column = zero_order(rig, flat, torch.as_tensor(depth.ravel()))[0].numpy().reshape(SHAPE)
    slope = np.stack([np.gradient(column, axis=1), np.gradient(column, axis=0)])
    away = place - np.stack(np.meshgrid(np.arange(COLUMNS), np.arange(ROWS)))
    measured = column + (slope * away).sum(0) + NOISE_PX * np.random.default_rng(1).standard_normal(SHAPE)
    found, mm_per_px = triangulate(rig, flat, torch.as_tensor(measured.ravel()))
    z, std = found.numpy().reshape(SHAPE), NOISE_PX * mm_per_px.numpy().reshape(SHAPE)
    none = np.zeros(SHAPE, np.float32)
    maps = Geometry(
        measured.astype(np.float32), np.full(SHAPE, NOISE_PX, np.float32), z, std, light.astype(np.float32),
        0.002 * np.ones(SHAPE, np.float32), none, none, np.zeros(SHAPE, np.uint16),
        reconstruct_surface(rig, z, std),
    )  # fmt: skip
    return maps, depth


def error_mm(maps: Geometry, depth: np.ndarray) -> float:
    inside = np.s_[6:-6, 6:-6]
    return float(np.sqrt(np.mean((maps.depth_mm - depth)[inside] ** 2)))


@pytest.mark.parametrize("spot_px", [0.6, 1.0])
def test_a_camera_out_of_focus_is_measured_and_taken_out_of_depth(spot_px: float) -> None:
    before, depth = geometry(rig(), spot_px)
    after, found = follow_spot(rig(), LINES, before)
    assert found is not None
    assert found.present
    assert found.rms_px == pytest.approx(spot_px, rel=0.25)
    assert error_mm(after, depth) < 0.6 * error_mm(before, depth)
    off = np.abs(after.depth_mm - depth)[6:-6, 6:-6]
    assert np.mean(off < 1.96 * after.depth_std_mm[6:-6, 6:-6]) > 0.93
    assert np.mean(np.abs(before.depth_mm - depth) < 1.96 * before.depth_std_mm) < 0.8
    told = spot_finding(found)
    assert told.significant
    assert told.sentence.startswith("The camera is out of focus")


def test_spectra_are_of_the_place_that_a_pixel_sees() -> None:
    before, _ = geometry(rig(), 1.0)
    after, _ = follow_spot(rig(), LINES, before)
    pixels = known_pixels(after)
    assert np.array_equal(pixels.column_px, before.column_px)
    assert np.array_equal(pixels.depth_mm, before.depth_mm.astype(np.float32))
    assert not np.array_equal(after.depth_mm, before.depth_mm)
    some = after.of_rows(slice(3, 9))
    assert some.seen_depth_mm is not None
    assert np.array_equal(some.seen_depth_mm, before.depth_mm[3:9])


def test_edges_of_depth_tell_nothing_of_the_spot() -> None:
    """The outline of a sphere before a wall made a sharp camera seem out of focus."""
    before, _ = geometry(rig(), 0.0)
    x = np.arange(COLUMNS)
    beyond = np.broadcast_to((x > 25).astype(np.float32) + (x > 55), SHAPE)
    near = np.broadcast_to(np.isin(x % 30, (24, 25, 26, 27)), SHAPE)
    plain = replace(
        before,
        amplitude=(0.3 + 0.3 * beyond).astype(np.float32),
        column_px=(before.column_px + 0.5 * np.isin(x % 30, (25, 26))).astype(np.float32),
    )
    told = replace(plain, flags=before.flags | np.where(near, int(Flag.DEPTH_EDGE), 0).astype(np.uint16))
    found = [follow_spot(rig(), LINES, each)[1] for each in (plain, told)]
    assert found[0] is not None
    assert found[0].present
    assert found[1] is None


def test_pixels_that_see_a_point_and_other_patterns_change_nothing() -> None:
    sharp, _ = geometry(rig(), 0.0)
    same, found = follow_spot(rig(), LINES, sharp)
    assert same is sharp
    assert found is not None
    assert not spot_finding(found).significant
    assert follow_spot(rig(), LineSet.of(CapturePlan(spectral=LineComb())), sharp) == (sharp, None)
    dark = replace(sharp, depth_mm=np.full(SHAPE, np.nan))
    assert follow_spot(rig(), LINES, dark)[1] is None


def test_a_displacement_is_doubted_by_the_scatter_of_the_spot_but_never_wholly() -> None:
    random = np.random.default_rng(4)
    before, _ = geometry(rig(), 0.0)
    pull = random.standard_normal(SHAPE)
    flat = np.broadcast_to(np.arange(COLUMNS) * 1.0, SHAPE)
    for scatter_px2, doubt in ((0.02, 0.058), (0.4, 1.0)):
        moved = flat + (0.5 + scatter_px2 * np.sign(random.standard_normal(SHAPE))) * pull
        exact = np.full(SHAPE, 1e-4, np.float32)
        found = fit_spot(
            rig(),
            replace(before, column_px=moved.astype(np.float32), column_std_px=exact),
            pull,
            np.ones((2, *SHAPE)),
        )
        assert found is not None
        assert found.present
        assert found.doubt == pytest.approx(doubt, rel=0.02)


@pytest.mark.parametrize(("slope", "away_px"), [(3.0, 0.75), (6.0, 1.0)])
def test_light_comes_from_no_farther_than_two_widths_of_the_spot(
    monkeypatch: pytest.MonkeyPatch, slope: float, away_px: float
) -> None:
    spot = CameraSpot(0.25, 0.001, 0.0, 0.5)
    monkeypatch.setattr("dsl_core.reconstruction.camera_spot.fit_spot", lambda *_: spot)
    plain = rig().model_copy(update={"sensor": rig().sensor.model_copy(update={"bayer": "MONO"})})
    before, _ = geometry(plain, 0.0)
    # Up and down again, so that the darkest light is well above none.
    rise = np.abs((np.arange(COLUMNS) + 2) % 4 - 2.0)
    light = np.broadcast_to(np.exp(slope * rise).astype(np.float32), SHAPE)
    after, _ = follow_spot(plain, LINES, replace(before, amplitude=light, amplitude_std=0 * light))
    assert after.displaced_px is not None
    steps = column_slopes(before.column_px)[0]
    uphill = np.s_[10:-10, 13:-10:4]
    assert np.abs(after.displaced_px / steps)[uphill] == pytest.approx(away_px, rel=1e-5)


def test_slopes_of_a_ramp_are_exact_with_and_without_a_mosaic() -> None:
    y, x = np.mgrid[:20, :30].astype(float)
    colour = np.where((y + x) % 2 == 0, 1.0, 0.4)
    std = np.zeros((20, 30))
    for light, plain in ((colour * np.exp(0.03 * x - 0.02 * y), False), (np.exp(0.03 * x - 0.02 * y), True)):
        across, down = light_slopes(light, std, plain)[:, 4:-4, 4:-4]
        assert across == pytest.approx(0.03)
        assert down == pytest.approx(-0.02)
    across, down = column_slopes(0.8 * x - 0.1 * y)
    assert across == pytest.approx(0.8)
    assert down == pytest.approx(-0.1)


def test_a_spot_is_present_where_it_matters_and_is_no_chance() -> None:
    assert CameraSpot(0.5, 0.1, 0.2, 0.8).present
    assert not CameraSpot(0.5, 0.2, 0.2, 0.8).present
    assert not CameraSpot(0.01, 0.001, 0.2, 0.8).present
    assert CameraSpot(0.25, 0.05, 0.2, 0.8).rms_std_px == pytest.approx(0.05)


def test_edges_that_a_sharp_lens_leaves_in_a_pixel_displace_its_column_by_what_its_light_says() -> None:
    before, depth = geometry(rig(), np.nan)
    after, found = follow_spot(rig(), LINES, before)
    assert found is not None
    assert found.even
    assert found.variance_px2 == pytest.approx(1 / 12, rel=0.1)
    assert error_mm(after, depth) < 0.3 * error_mm(before, depth)
    assert not spot_finding(found).significant, "this is how any camera is"


def test_edges_are_doubted_where_nobody_could_measure_the_spot() -> None:
    before, depth = geometry(rig(), np.nan)
    few = np.zeros(SHAPE, bool)
    few[8:22, 8:38] = True
    some = replace(before, depth_mm=np.where(few, before.depth_mm, np.nan))
    after, found = follow_spot(rig(), LINES, some)
    assert found is None or not found.present
    assert np.allclose(after.depth_mm, some.depth_mm, atol=0.01, equal_nan=True)
    off, known = np.abs(some.depth_mm - depth), np.isfinite(some.depth_mm)
    far = known & (off > 4 * some.depth_std_mm)
    assert far.sum() > 10
    assert np.mean((off < 1.96 * after.depth_std_mm)[far]) > 0.9
