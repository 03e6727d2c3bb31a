"""Columns of first orders are found below a hundredth of a pixel, from a film that is known roughly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dsl_core.calibration.film.order_columns import TileColumns, fit_columns, search_columns
from dsl_core.calibration.film.order_paths import trace_paths
from dsl_core.optics.correspondence import GratingModel
from tests.cases.order_lines import TRUE_FILM, line_frames, passband, plane_at, rig_with

PLANE = plane_at(700.0)
TRUTH = rig_with(TRUE_FILM)


def true_columns(found: TileColumns) -> np.ndarray:
    """Columns of the true film at the pixels and the wavelength of what was found."""
    depth = PLANE.depth_mm(TRUTH).ravel()[found.pixels]
    assert found.depth_mm == pytest.approx(depth)
    paths = trace_paths(TRUTH, PLANE, found.pixels, passband(TRUTH, 540.0, found.order), GratingModel(TRUTH))
    assert len(paths.at) == len(found)
    return paths.column_px


@pytest.mark.parametrize("order", [1, -1])
def test_fits_from_a_few_columns_off_are_within_their_deviations(order: int) -> None:
    rig = rig_with(TRUE_FILM.model_copy(update={"tilt_y_deg": -0.2, "lines_per_mm": 495.5}))
    frames = line_frames(TRUTH, PLANE, 540.0)
    found = fit_columns(rig, PLANE, frames, passband(rig, 540.0, order), GratingModel(rig))
    before = trace_paths(rig, PLANE, found.pixels, passband(rig, 540.0, order), GratingModel(rig)).column_px
    error = found.column_px - true_columns(found)
    assert np.abs(np.median(before - true_columns(found))) > 0.5
    assert len(found) > 80
    assert np.sqrt(np.mean(error**2)) < 0.05
    # Where tiles are small, the model's own course over them adds to the noise.
    assert 0.4 < np.sqrt(np.median((error / found.std_px) ** 2)) < 1.6


def test_what_the_model_does_not_explain_makes_columns_less_sure() -> None:
    frames = line_frames(TRUTH, PLANE, 540.0)
    rng = np.random.default_rng(5)
    noise = 4 * frames.std * rng.standard_normal(frames.std.shape).astype(np.float32)
    rough = replace(frames, radiance=frames.radiance + noise)
    calm, wild = (
        fit_columns(TRUTH, PLANE, each, passband(TRUTH, 540.0, 1), GratingModel(TRUTH))
        for each in (frames, rough)
    )
    # Noise four times as strong as stated, besides the stated one.
    assert np.median(wild.std_px) / np.median(calm.std_px) > 1.5
    error = wild.column_px - true_columns(wild)
    assert 0.4 < np.sqrt(np.median((error / wild.std_px) ** 2)) < 1.6


def test_a_search_comes_near_from_twenty_columns_off() -> None:
    rig = rig_with(TRUE_FILM.model_copy(update={"lines_per_mm": 546.0}))
    frames = line_frames(TRUTH, PLANE, 540.0)
    found = search_columns(rig, PLANE, frames, passband(rig, 540.0, 1), GratingModel(rig))
    before = trace_paths(rig, PLANE, found.pixels, passband(rig, 540.0, 1), GratingModel(rig)).column_px
    assert np.abs(before - true_columns(found)).min() > 15
    assert len(found) > 50
    assert np.median(np.abs(found.column_px - true_columns(found))) < 1.5


def test_tiles_without_light_are_left_out() -> None:
    frames = line_frames(TRUTH, PLANE, 540.0)
    frames.radiance[:, : 112 * 36] = 0.02 + 0.01 * np.random.default_rng(1).standard_normal((128, 112 * 36))
    for find in (fit_columns, search_columns):
        found = find(TRUTH, PLANE, frames, passband(TRUTH, 540.0, 1), GratingModel(TRUTH))
        assert len(found) > 30
        assert (found.pixels >= 112 * 36).mean() > 0.97
