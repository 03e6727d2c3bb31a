"""Depth figures on errors that are known."""

from __future__ import annotations

import numpy as np
import pytest

from dsl_core.errors import DecodeError
from dsl_core.evaluation.depth import depth_score, fit_plane, straightness_mm


def test_figures_of_known_errors() -> None:
    truth = np.full((2, 4), 700.0)
    truth[0, 0] = np.nan
    depth = truth + np.array([[0.0, 3.0, -1.0, np.nan], [0.5, 0.5, 0.0, 9.0]])
    depth[0, 0] = 650.0
    lit = np.ones((2, 4), bool)
    lit[1, 3] = False
    score = depth_score(depth, truth, lit)
    assert score.pixels == 5
    assert score.coverage == pytest.approx(5 / 6)
    assert score.rmse_mm == pytest.approx(np.sqrt((9 + 1 + 0.25 + 0.25) / 5))
    assert score.mae_mm == pytest.approx(1.0)
    assert score.bias_mm == pytest.approx(3.0 / 5)
    assert score.median_abs_mm == pytest.approx(0.5)
    assert score.within_1_mm == pytest.approx(4 / 6)


def test_nothing_to_compare_is_an_error_not_nan() -> None:
    with pytest.raises(DecodeError, match="None of the 4 lit"):
        depth_score(np.full((2, 2), np.nan), np.full((2, 2), 700.0))


def test_another_size_is_refused() -> None:
    with pytest.raises(DecodeError, match=r"\(2, 3\)"):
        depth_score(np.zeros((2, 3)), np.zeros((2, 2)))


def test_plane_fit_finds_the_plane_and_its_noise() -> None:
    random = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(-150, 150, 120), np.linspace(-100, 100, 80))
    normal = np.array([0.1, -0.2, -1.0]) / np.sqrt(1.05)
    z = (-690.0 - normal[0] * x - normal[1] * y) / normal[2]
    points = np.stack([x, y, z]) + normal[:, None, None] * random.normal(0, 0.3, x.shape)
    points[:, 5, 5] = np.nan
    points[2, 0, 0] += 500.0
    mask = np.ones(x.shape, bool)
    mask[0, 0] = False
    fit = fit_plane(points, mask)
    np.testing.assert_allclose(fit.normal, normal, atol=1e-3)
    assert fit.offset_mm == pytest.approx(-690.0, abs=0.05)
    assert fit.rms_mm == pytest.approx(0.3, rel=0.05)
    assert fit.pixels == x.size - 2
    assert fit.max_mm < 2.0


def test_plane_needs_three_points() -> None:
    with pytest.raises(DecodeError, match="three"):
        fit_plane(np.full((3, 4, 4), np.nan))


def test_straightness_ignores_scale_and_offset() -> None:
    positions = np.linspace(600, 900, 15)
    assert straightness_mm(positions.tolist(), (1.02 * positions + 4).tolist()) == pytest.approx(0, abs=1e-9)
    bent = positions + np.where(np.arange(15) % 2 == 0, 1.0, -1.0)
    assert straightness_mm(positions.tolist(), bent.tolist()) == pytest.approx(1.0, rel=0.02)
