"""What a scan asks of its model becomes an error of reflectance, and noise alone asks for nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from dsl_core.reconstruction.spectral.causes import common_error, fit_causes
from dsl_core.reconstruction.spectral.model_error import MARGIN, ModelError, model_error, neighbour_contrast
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe
from dsl_core.reconstruction.spectral.probing.probe import LEADING, PRIOR_STD, Probe
from dsl_core.reconstruction.spectral.probing.probed_light import PARAMETERS
from dsl_core.reconstruction.spectral.probing.probed_pixels import CELLS

PER_CELL, BANDS, LEVEL = 8, 5, 0.4
GAIN = PARAMETERS.index("gain +1")


def made(wrong: float, noise: bool) -> Probe:
    """Pixels whose spectra follow the gain of order +1, which is off by ``wrong`` in the left half."""
    rng = np.random.default_rng(5)
    cell = np.repeat(np.arange(CELLS[0] * CELLS[1]), PER_CELL)
    count, p = len(cell), len(PARAMETERS)
    information = 1e4
    normal = np.broadcast_to(information * np.eye(p), (count, p, p)).copy()
    truth = np.zeros((count, p))
    truth[:, GAIN] = np.where(cell % CELLS[1] < CELLS[1] // 2, wrong, 0.0)
    score = information * truth
    if noise:
        score += np.sqrt(information) * rng.standard_normal((count, p))
    bias = np.zeros((count, BANDS, p))
    bias[:, :, GAIN] = LEVEL
    sure = LineProbe(np.broadcast_to(1e6 * np.eye(2), (9, 2, 2)), np.zeros((9, 2)), np.ones(9))
    return Probe(
        normal=normal, score=score, bias=bias, reflectance=np.full((count, BANDS), LEVEL),
        chi_square=np.ones(count), correlation=np.ones(count), place=np.zeros((count, 2)), cell=cell,
        pixel=np.arange(count), lines=sure, nm_per_px=2.0,
    )  # fmt: skip


def test_an_error_of_part_of_the_picture_is_stated_there_and_noise_nowhere() -> None:
    relative = model_error(made(0.05, noise=False)).relative
    assert relative.shape == (BANDS, *CELLS)
    assert relative[:, :, 0] == pytest.approx(MARGIN * 0.05, rel=0.02)
    assert relative[:, :, -1].max() < 0.005
    quiet = model_error(made(0.0, noise=True)).relative
    # Each cell knows a gain to 0.0035.
    assert float(np.sqrt(np.mean(quiet**2))) < 0.0025


def test_what_all_pixels_share_is_stated_everywhere() -> None:
    quiet = made(0.0, noise=False)
    assert model_error(quiet, 0.03).relative == pytest.approx(0.03)
    drift = np.zeros_like(quiet.score)
    drift[:, PARAMETERS.index("drift")] = 1e4 * 0.03
    causes = fit_causes(replace(quiet, score=drift))
    # From the first line to the last, and the level of the start is taken for all.
    assert common_error(quiet, causes) == pytest.approx(0.03 / np.sqrt(3), rel=0.01)
    assert common_error(quiet, fit_causes(replace(quiet, score=drift / 3))) == 0


def test_the_error_is_linear_between_cells() -> None:
    error = model_error(made(0.05, noise=False))
    shape = (60, 80)
    rows, columns = np.array([5, 5, 5]), np.array([5, 40, 75])
    left, middle, right = error.at(rows, columns, shape)[0]
    assert left > middle > right


def test_contrast_compares_samples_of_one_colour() -> None:
    mosaic = np.tile([[1.0, 8.0], [8.0, 3.0]], (6, 6)).astype(np.float32)
    assert neighbour_contrast(mosaic).max() == 0
    mosaic[:, 6:] *= 3
    contrast = neighbour_contrast(mosaic)
    assert contrast[:, 5:7] == pytest.approx(1.0)
    assert contrast[:, :3].max() == contrast[:, 9:].max() == 0


def test_cells_ask_beyond_twice_their_noise_and_neighbours_share_the_answer() -> None:
    probe = made(0.03, noise=True)
    probe.chi_square[::3] = 2.0
    assert probe.lines is not None
    probe.lines.values[:] = 0.01, -0.02
    squares, level = np.zeros((*CELLS, BANDS)), np.zeros((*CELLS, BANDS))
    prior = np.diag(np.array(PRIOR_STD[:LEADING]) ** -2.0)
    for cell in range(CELLS[0] * CELLS[1]):
        here, place = probe.cell == cell, np.unravel_index(cell, CELLS)
        weight = 1 / np.where(probe.chi_square[here] > 1, probe.chi_square[here], 1)
        known = np.einsum("n,npq->pq", weight, probe.normal[here])[:LEADING, :LEADING]
        asked = np.linalg.solve(known + prior, (weight @ probe.score[here])[:LEADING])
        inverse = np.linalg.inv(known + prior)
        for bias, own in zip(probe.bias[here], probe.reflectance[here], strict=True):
            noise = np.diag(bias[:, :LEADING] @ inverse @ known @ inverse @ bias[:, :LEADING].T)
            profile = bias[:, [4, 5]] @ np.array([0.01, -0.02])
            squares[place] += (bias[:, :LEADING] @ asked) ** 2 - 2 * noise + profile**2
            level[place] += own**2
    error, light = (gaussian_filter(each, (0.7, 0.7, 1.0), mode="nearest") for each in (squares, level))
    wanted = np.hypot(1.25 * np.sqrt(error.clip(0) / light), 0.02).transpose(2, 0, 1)
    assert model_error(probe, 0.02).relative == pytest.approx(wanted)


@pytest.mark.parametrize(("few", "found"), [(10, 3.0), (9, 1.0)])
def test_ten_pixels_with_misfit_say_how_residuals_hang_together(few: int, found: float) -> None:
    probe = made(0.0, noise=False)
    probe.chi_square[:few], probe.correlation[:few] = 1.51, 3.0
    probe.chi_square[few : few + 5], probe.correlation[few : few + 5] = 1.49, 9.0
    probe.chi_square[20], probe.correlation[20] = 2.0, np.nan
    assert model_error(probe).correlation == found


def test_the_error_of_a_cell_is_in_its_middle() -> None:
    error = ModelError(np.arange(2.0 * CELLS[0] * CELLS[1]).reshape(2, *CELLS))
    shape = 10 * CELLS[0], 14 * CELLS[1]
    # Half way between the middles of four pixels, and beyond the middles of the outermost cells.
    rows, columns = np.array([24, 25, 0]), np.array([20, 21, 0])
    found = error.at(rows, columns, shape)
    place = (rows + 0.5) / 10 - 0.5, (columns + 0.5) / 14 - 0.5
    plane = place[0].clip(0) * CELLS[1] + place[1].clip(0)
    assert found == pytest.approx(np.stack([plane, plane + CELLS[0] * CELLS[1]]))


def test_contrast_is_half_a_difference_over_the_darkest_and_reaches_one_pixel_further() -> None:
    level = np.full((12, 12), 4.0, np.float32)
    level[6, 6] = 6.0
    contrast = neighbour_contrast(level)
    assert contrast[6, 6] == pytest.approx(2 / 8)
    assert contrast[3:10, 3:10] == pytest.approx(2 / 8)
    assert contrast[2].max() == 0.0
    # What is dark, or nothing, is not divided by.
    level[6, 6], level[0, 0] = 0.0, np.nan
    assert neighbour_contrast(level)[6, 6] == pytest.approx(100.0)
    assert neighbour_contrast(0 * level).max() == 0.0
