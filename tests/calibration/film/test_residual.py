"""A smooth correction is chosen where the film is uneven, and only there."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.calibration.film.fit import FLOOR_PX, fit_film
from dsl_core.calibration.film.order_samples import grating_columns
from dsl_core.calibration.film.residual import (
    _around,
    _folds,
    _robust,
    _terms,
    _trimmed_rms,
    choose_residual,
    correction_px,
    fit_residual,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Film, FilmShape
from dsl_core.optics.correspondence import GratingModel, HybridModel, correspondence
from tests.cases.film_samples import (
    NAMES,
    NOISE_PX,
    POSITIONS,
    mounted,
    saddle,
    samples_of,
    small_rig,
)


@pytest.mark.slow
@pytest.mark.parametrize("shape", [None, FilmShape(middle_mm=-6.0, factors=(0.004, 0, 1e-4, 0, 0, 0))])
def test_no_correction_is_chosen_where_the_film_is_enough(shape: FilmShape | None) -> None:
    rig = small_rig()
    rig = rig.model_copy(update={"film": rig.film.model_copy(update={"shape": shape})})
    residual, held_out = choose_residual(rig, samples_of(rig, NOISE_PX), POSITIONS, NAMES)
    assert residual.degrees == ()
    assert [each.kept_out for each in held_out] == [*POSITIONS, *NAMES, "a third of the tiles"]
    assert all(each.hybrid_px < 1.2 * NOISE_PX for each in held_out)


@pytest.mark.slow
def test_an_uneven_film_is_corrected_where_nothing_was_seen() -> None:
    rig = small_rig()
    samples = samples_of(rig, NOISE_PX, saddle)
    film = fit_film(mounted(rig), samples, Film()).film
    fitted = rig.model_copy(update={"film": film})
    residual, held_out = choose_residual(fitted, samples, POSITIONS, NAMES)
    assert residual.degrees
    assert all(each.grating_px > 0.06 for each in held_out)
    assert all(each.hybrid_px < 0.03 for each in held_out)
    assert len(residual.model_dump_json()) < 20_000


def test_hybrid_model_adds_the_correction() -> None:
    rig, samples = small_rig(), samples_of(small_rig(), NOISE_PX, saddle)
    hybrid = rig.model_copy(update={"residual": fit_residual(rig, samples, 2)})
    model = correspondence(hybrid)
    assert isinstance(model, HybridModel)
    part = samples.only((samples.order == 1) & (samples.filter == 1))
    pixels, depth = torch.as_tensor(part.pixel), torch.as_tensor(part.depth_mm)
    wavelengths = np.array([440.0, 540.0, 655.0])
    exact, traced = (
        call(pixels, depth, 1, wavelengths).columns.numpy() for call in (model.exact, model.trace)
    )
    np.testing.assert_allclose(traced, exact, atol=2e-3)
    assert hybrid.residual is not None
    expected = grating_columns(rig, part) + correction_px(rig, hybrid.residual, part)
    np.testing.assert_allclose(exact[1], expected, atol=1e-9)
    assert np.abs(exact[1] - part.column_px).max() < 6 * NOISE_PX
    # The zero order has nothing to correct.
    zero = model.trace(pixels, depth, 0, wavelengths).columns
    np.testing.assert_allclose(zero, GratingModel(rig).trace(pixels, depth, 0, wavelengths).columns)


def test_hybrid_model_needs_a_residual() -> None:
    with pytest.raises(CalibrationError, match="has no residual"):
        correspondence(small_rig(), "hybrid")


def test_the_error_is_that_of_the_99_percent_nearest_to_zero() -> None:
    values = np.concatenate([np.tile([3.0, -4.0], 99), [1e3, -1e3]])
    assert _trimmed_rms(values) == pytest.approx(12.5**0.5)
    assert _trimmed_rms(np.array([-5.0])) == 5.0
    with pytest.raises(CalibrationError, match="Nothing is left"):
        _trimmed_rms(np.zeros(0))


def test_ranges_hold_what_was_seen() -> None:
    assert _around((1.0, 5.0), np.array([2.0, 3.0])) == (1.0, 5.0)
    assert _around((1.0, 5.0), np.array([0.5, 7.0])) == (0.5, 7.0)


def test_robust_coefficients_are_drawn_to_zero_by_a_prior_and_not_by_outliers() -> None:
    basis = np.column_stack([np.ones(50), np.zeros(50)])
    values, std = np.full(50, 0.1), np.full(50, 0.4)
    sigma = np.hypot(0.4, FLOOR_PX)
    pull = 50 / sigma**2
    assert _robust(basis, values, std) == pytest.approx([0.1 * pull / (pull + 1 / 0.3**2), 0.0])
    values[:5] = 100.0
    # Each outlier pulls as one at 2.5 deviations would.
    wanted = (45 * 0.1 / sigma**2 + 5 * 2.5 / sigma) / (45 / sigma**2 + 1 / 0.3**2)
    assert _robust(basis, values, std)[0] == pytest.approx(wanted, rel=1e-4)


def test_terms_have_a_total_degree_and_no_more_in_depth_and_wavelength_than_can_be_told() -> None:
    samples = samples_of(small_rig(), NOISE_PX)
    assert set(_terms(samples, 1)) == {(0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)}
    two = samples.only((samples.position < 2) & (samples.filter < 1))
    found = _terms(two, 3)
    assert max(term[2] for term in found) == 1
    assert max(term[3] for term in found) == 0
    assert max(map(sum, found)) == 3
    assert {(3, 0, 0, 0), (0, 3, 0, 0), (1, 1, 1, 0)} <= set(found)


def test_each_position_filter_and_a_third_of_the_tiles_are_left_out_in_turn() -> None:
    samples = samples_of(small_rig(), NOISE_PX)
    folds = dict(_folds(samples, POSITIONS, NAMES))
    assert list(folds) == [*POSITIONS, *NAMES, "a third of the tiles"]
    assert (folds[POSITIONS[1]] == (samples.position == 1)).all()
    assert (folds[NAMES[2]] == (samples.filter == 2)).all()
    third = folds["a third of the tiles"]
    assert 0.25 < third.mean() < 0.42
    assert not set(samples.tile[third]) & set(samples.tile[~third]), "whole tiles"
    two = samples.only(samples.position < 2)
    assert list(dict(_folds(two, POSITIONS, NAMES))) == [*NAMES, "a third of the tiles"]


def test_a_correction_spans_the_picture_and_the_filters() -> None:
    rig = small_rig()
    blank = fit_residual(rig, samples_of(rig, NOISE_PX), 0)
    assert (blank.column_range_px, blank.row_range_px) == ((0.0, 221.0), (0.0, 144.0))
    assert blank.wavelength_range_nm == (430.0, 660.0)
    assert (blank.orders, blank.coefficients_px, blank.degrees) == ((1, -1), ((), ()), ())
