"""What lines say of the shares of a spread, against dense algebra of all unknowns together."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.special import ndtr

from dsl_core.model.rig import ProjectorResponse
from dsl_core.optics.lines.profile import LineTable, halo_integral
from dsl_core.optics.spread.equations import (
    LONGEST_PX,
    MAX_SHIFT_PX,
    MIN_PIXELS,
    MODEL_ERROR,
    Fixed,
    Peaks,
    View,
    _normal,
    _shapes,
    settle,
    unit,
)

RESPONSE = ProjectorResponse(blur_px=0.6, halo_peak_per_px=6e-4, halo_decay_px=31.0)
WIDTH_PX, STEP_PX, RUN = 5, 2, 2
CENTRES = np.linspace(-1.5, 1.5, 25)


def peaks_of(count: int, noise: float = 2e-3) -> tuple[Peaks, torch.Tensor, torch.Tensor]:
    """Noisy lines that pixels see as the response says, with their columns and amplitudes."""
    rng = np.random.default_rng(4)
    column = torch.as_tensor(rng.uniform(50, 500, count))
    amplitude = torch.as_tensor(rng.uniform(0.3, 1.0, count))
    centres = (column / STEP_PX).round() * STEP_PX + STEP_PX * torch.arange(-4, 5)[:, None]
    table = LineTable(WIDTH_PX, RESPONSE, 12.0, column)
    y = amplitude * table.at(column - centres)[0] + noise * torch.as_tensor(rng.standard_normal((9, count)))
    return Peaks(y, torch.full_like(y, noise**2), centres, WIDTH_PX, STEP_PX, RUN), column, amplitude


@pytest.mark.parametrize("wide", [None, 1.3])
def test_shapes_are_those_of_a_line_through_narrow_gaussians(wide: float | None) -> None:
    distance = torch.linspace(-6, 6, 40, dtype=torch.float64).reshape(4, 10)
    width = None if wide is None else torch.full((10,), wide, dtype=torch.float64)
    found = _shapes(WIDTH_PX, distance, CENTRES, width).numpy()
    by = wide or 1.0
    edges = [((distance.numpy() + side) / by)[..., None] - CENTRES for side in (2.5, -2.5)]
    wanted = ndtr(edges[0] / 0.125) - ndtr(edges[1] / 0.125)
    assert found == pytest.approx(wanted, abs=2e-3)


def test_known_light_is_that_of_all_its_gaussians_near_and_far() -> None:
    distance = torch.linspace(-6, 6, 12, dtype=torch.float64).reshape(3, 4)
    centres = np.linspace(-40, 40, 81)
    shares = np.random.default_rng(5).uniform(0.5, 1.5, 81) / 81
    found = Fixed(centres, shares).light(WIDTH_PX, distance, None)
    wanted = _shapes(WIDTH_PX, distance, centres, None).numpy() @ shares
    assert found.numpy() == pytest.approx(wanted, abs=1e-12)
    assert Fixed(centres + 100, shares).light(WIDTH_PX, distance, None).abs().max() == 0


@pytest.mark.parametrize("std_px", [0.003, 1e3])
def test_shares_are_judged_with_amplitude_and_column_of_each_pixel_unknown(std_px: float) -> None:
    peaks, column, amplitude = peaks_of(6)
    peaks.variance[0, 2] = torch.inf
    found = _normal(peaks, column, amplitude, RESPONSE, CENTRES, std_px, None)
    distance = column - peaks.centres
    g, slope = (each.numpy() for each in LineTable(WIDTH_PX, RESPONSE, 12.0, column).at(distance))
    shapes = _shapes(WIDTH_PX, distance, CENTRES, None).numpy()
    halo = (halo_integral(distance + 2.5, RESPONSE) - halo_integral(distance - 2.5, RESPONSE)).numpy()
    matrix, right, square = np.zeros((25, 25)), np.zeros(25), 0.0
    for p, a in enumerate(amplitude.tolist()):
        use = np.isfinite(peaks.variance[:, p].numpy())
        # An amplitude that may be anything, and a column known to its deviation, are noise of a kind.
        noise = np.diag(peaks.variance[use, p].numpy() + (MODEL_ERROR * a) ** 2)
        noise += 1e6 * np.outer(g[use, p], g[use, p])
        noise += (a * std_px) ** 2 * np.outer(slope[use, p], slope[use, p])
        weight = np.linalg.inv(noise)
        rows, left = a * shapes[use, p], peaks.y[use, p].numpy() - a * halo[use, p]
        matrix += rows.T @ weight @ rows
        right += rows.T @ weight @ left
        square += float(left @ weight @ left)
    size = np.abs(matrix).max()
    assert found.matrix == pytest.approx(matrix, abs=1e-4 * size)
    assert found.right == pytest.approx(right, abs=1e-4 * np.abs(right).max())
    assert found.square == pytest.approx(square, rel=1e-3)
    # Nine lines of six pixels, one of them unusable, less two unknowns of each pixel.
    assert (found.count, found.pixels) == (9 * 6 - 1 - 12, 6)
    shares = np.full(25, 0.04)
    assert found.cost(shares) == pytest.approx(
        shares @ matrix @ shares - 2 * right @ shares + square, rel=1e-2
    )
    twice = found + found
    assert twice.cost(shares) == pytest.approx(2 * found.cost(shares))
    assert (twice.count, twice.pixels) == (2 * found.count, 12)


def test_columns_and_amplitudes_settle_from_half_a_pixel_away() -> None:
    peaks, column, amplitude = peaks_of(40, noise=1e-4)
    found, height, chi_square = settle(peaks, column + 0.4, 0.7 * amplitude, RESPONSE, None)
    assert found.numpy() == pytest.approx(column.numpy(), abs=5e-3)
    assert height.numpy() == pytest.approx(amplitude.numpy(), rel=2e-3)
    # Its squares, per degree of freedom, are those of a model with an error of its own.
    assert float(chi_square.max()) < 1.0
    far, _, _ = settle(peaks, column + 3.0, amplitude, RESPONSE, None)
    assert float((far - column - 3.0).abs().max()) <= 3 * LONGEST_PX + 1e-9


def test_chi_square_of_lines_that_are_explained_is_the_share_of_their_noise() -> None:
    noise = 0.02
    peaks, column, amplitude = peaks_of(400, noise)
    _, _, chi_square = settle(peaks, column, amplitude, RESPONSE, None)
    share = noise**2 / (noise**2 + (MODEL_ERROR * amplitude) ** 2)
    assert float((chi_square / share).mean()) == pytest.approx(1.0, abs=0.1)


def test_chi_square_is_per_line_beyond_two() -> None:
    peaks, column, amplitude = peaks_of(3)
    peaks.variance[:, 0] = torch.inf
    peaks.variance[:4, 0] = 4e-6
    _, height, chi_square = settle(peaks, column, amplitude, RESPONSE, None)
    assert float(height[1]) == pytest.approx(float(amplitude[1]), rel=0.02)
    # Four lines have two degrees of freedom, of which at least one is counted.
    peaks.variance[2:, 0] = torch.inf
    _, _, two = settle(peaks, column, amplitude, RESPONSE, None)
    assert torch.isfinite(two).all()
    assert (chi_square[1:] - two[1:]).abs().max() < 1e-9


def view_of(count: int) -> View:
    peaks, column, _ = peaks_of(count)
    return View(peaks, column, column.clone(), peaks.y.amax(0))


def test_halves_are_every_other_run_of_pixels() -> None:
    view = view_of(2 * MIN_PIXELS)
    halves = view.equations(RESPONSE, CENTRES, waves=False)
    assert halves is not None
    assert [half.pixels for half in halves] == [MIN_PIXELS, MIN_PIXELS]
    of_first = torch.arange(2 * MIN_PIXELS) // RUN % 2 == 0
    first = _normal(
        view.peaks.of(of_first), view.column[of_first], view.amplitude[of_first], RESPONSE, CENTRES, 1e3, None
    )
    assert halves[0].right == pytest.approx(first.right)


def test_pixels_that_move_away_or_see_something_else_are_left_out_and_few_say_nothing() -> None:
    view = view_of(MIN_PIXELS + 4)
    view.start_px = view.start_px.clone()
    view.start_px[0] += MAX_SHIFT_PX + 0.2
    view.start_px[1] += MAX_SHIFT_PX - 0.2
    view.peaks.y[8, 2] += 1.0
    view.peaks.y[:, 3] *= -1
    halves = view.equations(RESPONSE, CENTRES, waves=False)
    assert halves is not None
    assert sum(half.pixels for half in halves) == MIN_PIXELS + 1
    view.start_px[4:6] += 9.0
    assert view.equations(RESPONSE, CENTRES, waves=False) is None


def test_columns_of_length_one() -> None:
    found = unit(torch.tensor([[3.0, 0.0], [4.0, 0.0]], dtype=torch.float64))
    assert found.tolist() == [[0.6, 0.0], [0.8, 0.0]]
