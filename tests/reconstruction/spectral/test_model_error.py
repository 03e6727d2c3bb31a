"""What a scan asks of its model becomes an error of reflectance, and noise alone asks for nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.reconstruction.spectral.causes import common_error, fit_causes
from dsl_core.reconstruction.spectral.model_error import MARGIN, model_error, neighbour_contrast
from dsl_core.reconstruction.spectral.probing.line_probe import LineProbe
from dsl_core.reconstruction.spectral.probing.probe import Probe
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
