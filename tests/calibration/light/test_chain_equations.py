"""The equations of the line scan of a diffuser: their places, slopes and selections."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from dsl_core.calibration.light.chain_equations import (
    BANDS_NM,
    CHUNK,
    STEP_NM,
    LineScan,
    Unknowns,
    _chunks,
    _halo,
    _light,
    _of_colour,
    _usable,
    colours_of,
    steepness,
    stretched,
    without_outliers,
    zero_order_equations,
    zero_order_ratios,
    zero_order_signals,
)
from dsl_core.model.plan import ScanLines
from dsl_core.model.spectral import SpectralCurve
from dsl_core.optics.lines.profile import ProfileTable
from dsl_core.optics.pixel_model import MODEL_ERROR
from dsl_core.optics.spectra import hat_moments
from dsl_core.simulation.published_rig import published_rig

RIG = published_rig()
WHITE = SpectralCurve.of([550.0], [0.99])
UNKNOWNS = Unknowns(np.arange(400.0, 701.0, 50.0))


def scan(pixels: int = 300) -> LineScan:
    """Zero orders as the rig expects them, with a noise of a thousandth; frames hold their numbers."""
    rng = np.random.default_rng(0)
    lines = LineScan(
        ScanLines(width_px=5, step_px=5),
        rng.choice(RIG.camera.width_px * RIG.camera.height_px, pixels, replace=False),
        np.full(pixels, 700.0),
        rng.uniform(0.5, 1.0, pixels),
        rng.uniform(50.0, 590.0, pixels),
        np.ones(pixels),
        np.zeros(pixels),
        np.arange(128.0)[:, None] * np.ones(pixels),
        np.ones((128, pixels)),
    )
    expected = zero_order_signals(RIG, WHITE).sum(-1)[colours_of(RIG, lines)] * lines.shading
    amplitude = expected * (1 + 1e-3 * rng.standard_normal(pixels))
    return LineScan(**{**vars(lines), "amplitude": amplitude})


def test_frames_between_two_columns_are_those_whose_lines_touch_them() -> None:
    part = scan().between(100.0, 130.0)
    near = np.flatnonzero(np.abs(2 + 5 * np.arange(128) - 115) < 15 + 2.5 + 6)
    assert part.radiance[:, 0].tolist() == near.tolist()
    assert part.first_line == near[0]
    assert part.centres_px.tolist() == (2.0 + 5.0 * near).tolist()
    # Frames are counted from the first that is left, so that parts of parts keep their lines.
    assert part.between(115.0, 116.0).centres_px.min() > 100
    assert len(part.between(400.0, 420.0).radiance) == 0


def test_every_unknown_has_a_place_of_its_own() -> None:
    places = np.zeros(UNKNOWNS.count + 1, int)
    for block in (*(UNKNOWNS.efficiency(m) for m in (1, -1)), *(UNKNOWNS.response(c) for c in range(3))):
        places[block] += 1
    places[UNKNOWNS.white] += 1
    places[UNKNOWNS.scale] += 1
    assert places.tolist() == [1] * len(places)


def test_pixels_with_another_zero_order_than_their_colour_are_left_out() -> None:
    seen = scan()
    assert zero_order_ratios(RIG, seen, WHITE) == pytest.approx(1.0, abs=5e-3)
    amplitude = seen.amplitude.copy()
    amplitude[:20] *= 1.02
    amplitude[20] = np.nan
    kept = without_outliers(RIG, LineScan(**{**vars(seen), "amplitude": amplitude}), WHITE)
    assert set(kept.pixels) == set(seen.pixels[21:])


def test_a_brighter_zero_order_is_explained_by_white_scale_or_by_the_colours_response() -> None:
    ratio = np.array([1.02, 1.02, 1.02])
    equations = zero_order_equations(RIG, ratio, np.full(3, 1e-3), WHITE, UNKNOWNS)
    scale = np.zeros(UNKNOWNS.count + 1)
    scale[UNKNOWNS.white] = 0.02
    response = np.zeros(UNKNOWNS.count + 1)
    for colour in range(3):
        response[UNKNOWNS.response(colour)] = 0.02
    for x in (scale, response):
        misfit = equations.square - 2 * x @ equations.right + x @ equations.normal @ x
        assert misfit == pytest.approx(0.0, abs=1e-6)
    assert equations.count == 3


def test_steepness_is_the_slope_of_light_by_the_wavelength_of_the_emission() -> None:
    slope = steepness(RIG, 1, BANDS_NM, STEP_NM)
    shorter, light, longer = (
        hat_moments(stretched(RIG, factor), 1, BANDS_NM, STEP_NM)[0].sum(1)
        for factor in (1 - 1e-4, 1.0, 1 + 1e-4)
    )
    lit = light > 0.05 * light.max()
    # Light of a longer wavelength than taken for: the emission as it would be at shorter ones.
    assert slope[lit] == pytest.approx(((shorter - longer) / 2e-4)[lit] / light[lit], rel=0.05, abs=0.3)
    assert np.abs(slope[lit]).max() > 5
    assert stretched(RIG, 1.01).emission[0].wavelengths_nm[0] == 1.01 * RIG.emission[0].wavelengths_nm[0]


def test_no_frame_is_between_columns_beyond_the_last_line() -> None:
    part = scan().between(900.0, 950.0)
    assert (len(part.radiance), part.first_line) == (0, 0)


@pytest.mark.parametrize("rises", [True, False])
def test_a_line_lights_the_bands_whose_profile_reaches_it(rises: bool) -> None:
    lines = scan(6)
    columns = torch.linspace(100.0, 160.0, len(BANDS_NM), dtype=torch.float64)[:, None] + torch.arange(6.0)
    columns = columns if rises else columns.flip(0)
    lit, light = _light(RIG, lines, columns)
    band_px = 60.0 / (BANDS_NM[-1] - BANDS_NM[0]) * STEP_NM
    table = ProfileTable(5, RIG.projector_response.line_spread, band_px, columns.device, columns.dtype)
    away = columns.T[:, None] - torch.as_tensor(lines.centres_px)[:, None]
    every = (table.at(away) * (away.abs() < table.support_px)).numpy()
    assert lit.tolist() == (every > 0).any(-1).tolist()
    assert light == pytest.approx(every[lit], abs=1e-12)
    assert 10 < lit[0].sum() < 30


def test_pixels_are_usable_that_light_reaches_through_rows_of_the_frame() -> None:
    width, height = RIG.projector.width_px, RIG.projector.height_px
    inner, beyond = [100.0, 120.0], [-40.0, -20.0]
    columns = np.array([inner, inner, beyond, [-0.6, -0.4], [width - 0.4, width - 0.6], inner, inner, inner])
    rows = np.array([[50.0, 60.0]] * 5 + [[-0.1, 5.0], [5.0, height - 0.9], [0.0, height - 1.0]])
    # What comes from outside does no harm where no light comes from there.
    columns, rows = np.vstack([columns, [10.0, -5.0]]), np.vstack([rows, [5.0, -9.0]])
    seen: Any = SimpleNamespace(columns=torch.as_tensor(columns.T), rows=torch.as_tensor(rows.T))
    assert _usable(seen, RIG).tolist() == [True, True, False, True, True, False, False, True, True]


def test_equations_of_a_colour_are_those_of_all_its_lines_written_out() -> None:
    rng, lines = np.random.default_rng(3), scan(5)
    bands, nodes = 4, len(UNKNOWNS.nodes_nm)
    std, offset = 0.1 + rng.random((128, 5)), rng.random(5)
    std[9, 2] = np.inf
    lines = LineScan(**{**vars(lines), "std": std, "offset": offset, "radiance": rng.random((128, 5)) * 9})
    lit = rng.random((5, 128)) < 0.1
    lit[2, 9] = True
    light, white = rng.random((int(lit.sum()), bands)), rng.random(bands)
    changes, scale = rng.standard_normal((bands, nodes + 1)), 1 + rng.random(5)
    found = _of_colour(RIG, lines, (lit, light), scale, white, changes, UNKNOWNS, -1, 2)
    x = 0.1 * rng.standard_normal(UNKNOWNS.count + 1)
    of_nodes = x[UNKNOWNS.efficiency(-1)] + x[UNKNOWNS.response(2)] + x[UNKNOWNS.white]
    bent = 1 + changes @ np.append(of_nodes, x[UNKNOWNS.scale])
    halo, total, count = _halo(RIG, lines), 0.0, 0
    for row, (pixel, frame) in zip(light, np.argwhere(lit), strict=True):
        if np.isfinite(std[frame, pixel]):
            seen = lines.radiance[frame, pixel] - offset[pixel] - lines.amplitude[pixel] * halo[frame, pixel]
            plain = float(row @ white) * scale[pixel]
            off = seen - scale[pixel] * float((row * white) @ bent)
            total += off**2 / (std[frame, pixel] ** 2 + (MODEL_ERROR * plain) ** 2)
            count += 1
    assert found.count == count == len(light) - 1
    assert found.square - 2 * x @ found.right + x @ found.normal @ x == pytest.approx(total)


def test_pixels_come_in_chunks_of_one_colour_by_their_columns() -> None:
    rng = np.random.default_rng(1)
    colours, column = rng.integers(0, 3, 5 * CHUNK), rng.permutation(5 * CHUNK).astype(float)
    parts = list(_chunks(colours, column))
    assert sorted(np.concatenate([part for _, part in parts]).tolist()) == list(range(5 * CHUNK))
    for colour, part in parts:
        assert len(part) <= CHUNK
        assert (colours[part] == colour).all()
        assert (np.diff(column[part]) > 0).all()
    assert [colour for colour, _ in parts] == sorted(colour for colour, _ in parts)
