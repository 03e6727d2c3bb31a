"""Grey values of the code tell where the projector sees the corners of a board, to thousandths of a pixel."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ndtr

from dsl_core.calibration.geometry.code_model import (
    CornerWindow,
    _BitTable,
    _CodeFit,
    code_light,
    refine_maps,
)
from dsl_core.calibration.geometry.projector_corners import PoseObservation, observe_pose
from dsl_core.model.calibration.pose_frames import PoseFrames
from tests.cases.board_twin import BOARD, PROJECTOR_PX, tilted_errors


def test_grey_values_of_the_code_tell_places_to_a_few_thousandths(seen: PoseObservation) -> None:
    _, code = tilted_errors(seen)
    assert np.sqrt((code**2).mean()) < 0.003


def test_pixels_that_are_read_wrongly_do_no_harm(frames: PoseFrames, seen: PoseObservation) -> None:
    """Dust: every tenth pixel of the finest bits is from elsewhere."""
    rng = np.random.default_rng(3)
    pairs = [np.array(picture) for picture in frames.pairs]
    lost = rng.random(pairs[0].shape) < 0.1
    pairs[18][lost], pairs[19][lost] = pairs[19][lost].copy(), pairs[18][lost].copy()
    _, code = tilted_errors(observe_pose(replace(frames, pairs=pairs), BOARD, PROJECTOR_PX))
    assert np.sqrt((code**2).mean()) < 0.006


def test_a_coarse_map_is_refined_from_half_a_pixel_away(frames: PoseFrames, seen: PoseObservation) -> None:
    windows = [CornerWindow.around(point, 9.0, np.shape(frames.white)) for point in seen.camera_px]
    linear = seen.slopes[:, 0] * 9.0
    start = np.concatenate([seen.projector_px[:, :1] + 0.5, linear, np.zeros((77, 3))], 1)
    found = refine_maps(code_light(frames, PROJECTOR_PX)[0], windows, start)
    assert np.abs(found[:, 0] - seen.projector_px[:, 0]).max() < 0.01


def test_blurred_bits_are_linear_between_samples_and_end_with_the_frame() -> None:
    signs = np.array([[-1.0, -1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0]])
    table = _BitTable(signs, 0.02)
    (found,) = table.at(np.array([-0.4, 0.0, 1.0, 2.0, 3.4]), table.values)
    assert found[0] == pytest.approx([-1, -1, -1, 1, 1])
    assert found[1] == pytest.approx([1, 1, -1, 1, -1])
    # Samples are a sixteenth apart, the first a thirty-second inside the frame's edge.
    ramp = np.arange(64.0)[None]
    (place,) = table.at(np.array([-0.5 + 1 / 32, 0.0, 0.1, 3.5 - 1 / 32]), ramp)
    assert place[0] == pytest.approx([0.0, 7.5, 9.1, 63.0], abs=1e-5)
    (outside,) = table.at(np.array([-9.0, 9.0]), ramp)
    assert outside[0] == pytest.approx([0.0, 63.0], abs=1e-5)


def test_slopes_of_bits_are_those_by_place_and_by_blur() -> None:
    signs = np.repeat([[-1.0, 1.0]], 12, 1).reshape(1, -1)[:, :24]
    signs[0] = np.where(np.arange(24) < 12, -1.0, 1.0)
    blur = 0.7
    table, wider = _BitTable(signs, blur), _BitTable(signs, blur + 0.01)
    place = np.linspace(10.0, 13.0, 13)
    value, slope, by_blur = table.at(place, table.values, table.slopes, table.by_blur)
    # An edge of a blur of its own is the integral of a Gaussian.
    away = place - 11.5
    assert value[0] == pytest.approx(2 * ndtr(away / blur) - 1, abs=3e-3)
    wanted = 2 * np.exp(-0.5 * (away / blur) ** 2) / (np.sqrt(2 * np.pi) * blur)
    assert slope[0] == pytest.approx(wanted, abs=0.01)
    (more,) = wider.at(place, wider.values)
    assert by_blur[0] == pytest.approx((more[0] - value[0]) / 0.01, abs=0.02)


def edge_of(blur_px: float, strength: float) -> tuple[Any, list[CornerWindow], Any, NDArray[np.float64]]:
    """Five bits that a window sees with a blur and a contrast, and the map that it has."""
    signs = np.where(np.random.default_rng(2).random((5, 40)) > 0.5, 1.0, -1.0)
    window = CornerWindow.around(np.array([30.0, 30.0]), 9.0, (60, 60))
    maps = np.array([[20.0, 6.0, 0.4, 0.1, 0.0, -0.1]])
    table = _BitTable(signs, blur_px)
    (value,) = table.at(window.terms @ maps[0], table.values)
    return signs, [window], [(strength * value, np.ones(len(window.terms)))], maps


def test_blur_and_contrast_come_nearer_in_steps_of_three_tenths_at_most() -> None:
    signs, windows, seen, maps = edge_of(0.9, 0.8)
    fit = _CodeFit(0.7, 1.0, np.full(5, np.inf))
    for _ in range(6):
        fit = fit.improved(_BitTable(signs, fit.blur_px), windows, seen, maps)
    assert fit.blur_px == pytest.approx(0.9, abs=5e-3)
    assert fit.strength == pytest.approx(0.8, abs=5e-3)
    assert (fit.sigma < 0.02).all()
    far = _CodeFit(2.5, 0.5, np.full(5, np.inf)).improved(_BitTable(signs, 2.5), windows, seen, maps)
    assert abs(far.blur_px - 2.5) <= 0.3 + 1e-9
    narrow = edge_of(0.05, 1.0)
    low = _CodeFit(0.2, 1.0, np.full(5, np.inf)).improved(_BitTable(narrow[0], 0.2), *narrow[1:])
    assert low.blur_px == 0.15


def test_noise_is_that_of_lit_pixels_by_the_root_of_their_weight() -> None:
    signs, windows, seen, maps = edge_of(0.7, 1.0)
    weight = np.full(len(seen[0][1]), 4.0)
    weight[:40] = 0.0
    off = np.where(np.arange(len(weight)) % 2, 0.1, -0.1)
    contrast = seen[0][0] + off
    contrast[:, :40] = 99.0
    fit = _CodeFit(0.7, 1.0, np.full(5, np.inf)).improved(
        _BitTable(signs, 0.7), windows, [(contrast, weight)], maps
    )
    # Twice a tenth, by the median.
    assert fit.sigma == pytest.approx(np.full(5, 0.2 * 1.4826), rel=0.1)
    dark = _CodeFit(0.7, 1.0, np.full(5, np.inf)).improved(
        _BitTable(signs, 0.7), windows, [(contrast, 0 * weight)], maps
    )
    assert dark.sigma.tolist() == [1.0] * 5


def test_a_map_moves_by_half_a_pixel_at_most_and_not_without_thirty_pixels() -> None:
    signs, windows, seen, maps = edge_of(0.7, 1.0)
    fit, table = _CodeFit(0.7, 1.0, np.ones(5)), _BitTable(signs, 0.7)
    near = fit.steps(table, windows, seen, np.add(maps, [0.2, 0, 0, 0, 0, 0]))
    assert np.abs(near - maps).max() < 0.1
    far = fit.steps(table, windows, seen, np.add(maps, [1.5, 0, 0, 0, 0, 0])) - maps
    assert np.abs(far - [1.5, 0, 0, 0, 0, 0]).max() <= 0.5 + 1e-9
    for count, moves in ((30, True), (29, False)):
        weight = (np.arange(len(seen[0][1])) < count).astype(float)
        start = np.add(maps, [0.2, 0, 0, 0, 0, 0])
        found = fit.steps(table, windows, [(seen[0][0], weight)], start)
        assert bool((found != start).any()) == moves
    assert fit.steps(table, [], [], maps[:0]).shape == (0, 6)
    # Pixels of two rows tell nothing of a curve across rows.
    two_rows = np.isin(windows[0].rows, [30, 31]).astype(float)
    found = fit.steps(table, windows, [(seen[0][0], two_rows)], np.add(maps, [0.2, 0, 0, 0, 0, 0]))
    assert 30 <= two_rows.sum() < 40
    assert np.abs(found - maps).max() < 0.15


def test_windows_are_the_pixels_within_a_radius_and_their_terms_those_of_a_quadratic() -> None:
    window = CornerWindow.around(np.array([2.3, 40.0]), 4.0, (42, 60))
    wanted = {(y, x) for y in range(42) for x in range(60) if (x - 2.3) ** 2 + (y - 40.0) ** 2 <= 16.0}
    assert set(zip(window.rows.tolist(), window.columns.tolist(), strict=True)) == wanted
    u, v = (window.columns - 2.3) / 4, (window.rows - 40.0) / 4
    assert window.terms == pytest.approx(np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], 1))
    assert window.radius_px == 4.0
