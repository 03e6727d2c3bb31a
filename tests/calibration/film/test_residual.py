"""A smooth correction is chosen where the film is uneven, and only there."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from dsl_core.calibration.film.fit import fit_film, grating_columns
from dsl_core.calibration.film.residual import choose_residual, correction_px, fit_residual
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Film
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


def test_no_correction_is_chosen_where_the_film_is_enough() -> None:
    rig = small_rig()
    residual, held_out = choose_residual(rig, samples_of(rig, NOISE_PX), POSITIONS, NAMES)
    assert residual.degrees == ()
    assert [each.kept_out for each in held_out] == [*POSITIONS, *NAMES, "a third of the tiles"]
    assert all(each.hybrid_px < 1.2 * NOISE_PX for each in held_out)


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
