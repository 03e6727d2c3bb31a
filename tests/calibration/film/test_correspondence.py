"""The data-driven correspondence against the analytic model that its samples come from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from dsl_core.calibration.film.correspondence import (
    GridSamples,
    fit_grid,
    fit_stage_grid,
)
from dsl_core.errors import CalibrationError
from dsl_core.model.rig import Rig
from dsl_core.optics.correspondence import Correspondence, GratingModel, GridModel, correspondence
from dsl_core.simulation.published_rig import published_rig
from tests.cases.film_samples import one_a_tile, samples_of, small_rig
from tests.cases.grid_samples import PUBLISHED_NM, sample_grating

DEPTHS_MM = np.array([500.0, 600.0, 700.0, 850.0, 1000.0])
SPREAD_NM = (430.0, 465.0, 500.0, 540.0, 580.0, 620.0, 660.0)
BANDS_NM = np.arange(430.0, 661.0, 5.0)


@pytest.fixture(scope="module")
def samples() -> GridSamples:
    """Five depths and seven evenly spread wavelengths on the published grid."""
    return sample_grating(published_rig(), DEPTHS_MM, np.array(SPREAD_NM))


def held_out_errors(model: Correspondence, rig: Rig) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Differences (px) to the exact grating at pixels, depths and bands that were not sampled."""
    rng = np.random.default_rng(3)
    pixels = torch.as_tensor(rng.integers(0, 890 * 580, 2000))
    depth = torch.as_tensor(rng.uniform(520.0, 980.0, 2000))
    errors = []
    for order in (1, -1):
        exact = GratingModel(rig).exact(pixels, depth, order, BANDS_NM)
        difference = model.trace(pixels, depth, order, BANDS_NM).columns - exact.columns
        errors.append(difference[exact.inside(640, 360)].numpy())
    return np.concatenate(errors)


def with_grid(samples: GridSamples) -> Rig:
    return published_rig().model_copy(update={"correspondence": fit_grid(samples).grid})


@pytest.mark.slow
def test_spread_wavelengths_predict_held_out_columns(samples: GridSamples) -> None:
    rig = with_grid(samples)
    errors = held_out_errors(correspondence(rig, "grid"), rig)
    assert np.sqrt(np.mean(errors**2)) < 0.06
    assert np.percentile(np.abs(errors), 99) < 0.2


@pytest.mark.slow
def test_published_wavelengths_leave_the_gap_between_430_and_600_nm() -> None:
    rig = with_grid(sample_grating(published_rig(), DEPTHS_MM, np.array(PUBLISHED_NM)))
    errors = held_out_errors(GridModel(rig), rig)
    # A straight line over 170 nm misses the curvature of the grating equation by almost a pixel.
    assert 0.15 < np.sqrt(np.mean(errors**2)) < 0.4


@pytest.mark.slow
def test_noisy_samples_with_outliers_are_fitted_without_them(samples: GridSamples) -> None:
    rng = np.random.default_rng(1)
    noisy = samples.columns_px + 0.1 * rng.standard_normal(samples.columns_px.shape)
    wrong = rng.random(noisy.shape) < 0.01
    rig = with_grid(replace(samples, columns_px=np.where(wrong, noisy + 25.0, noisy)))
    errors = held_out_errors(GridModel(rig), rig)
    assert np.sqrt(np.mean(errors**2)) < 0.15


def test_fit_recovers_an_exact_power_law() -> None:
    z = np.array([0.5, 0.6, 0.75, 0.9, 1.0])
    u = np.linspace(-1, 1, 9)
    alpha, gamma = -80.0 + 5 * u, 400.0 + 60 * u
    exact = (alpha * z[:, None] ** -0.9 + gamma)[:, None, :].repeat(7, 1)
    columns = np.stack([exact, exact + 10])[None]
    fit = fit_grid(
        GridSamples((1,), np.array([450.0, 650.0]), 1000 * z, np.arange(7.0), np.arange(9.0), columns)
    )
    coefficients = fit.grid.array[0, 0]
    assert np.abs(coefficients[..., 1] + 0.9).max() < 1e-4
    assert np.abs(coefficients[..., 0] - alpha).max() < 0.02
    assert fit.rms_px < 1e-6
    assert np.isfinite(fit.residual_px).all()


def test_residuals_say_which_samples_were_used(samples: GridSamples) -> None:
    fit = fit_grid(samples)
    assert fit.residual_px.shape == samples.columns_px.shape
    assert np.isnan(fit.residual_px[~np.isfinite(samples.columns_px)]).all()
    assert fit.rms_px < 0.03


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"depths_mm": np.array([500.0, 500.0, 500.0, 500.0, 501.0])}, "three or more different depths"),
        ({"depths_mm": np.array([500.0, 506.0, 512.0, 518.0, 525.0])}, "three or more different depths"),
        ({"wavelengths_nm": np.array(SPREAD_NM)[::-1]}, "rising order"),
        ({"rows_px": np.array([0.0])}, "2 x 2"),
        ({"columns_px": np.full((2, 7, 5, 48, 85), np.nan)}, r"Order \+1 at 430 nm"),
    ],
)
def test_samples_that_do_not_suffice_are_refused(
    samples: GridSamples, change: dict[str, np.ndarray[tuple[int, ...], np.dtype[np.float64]]], words: str
) -> None:
    with pytest.raises(CalibrationError, match=words):
        fit_grid(replace(samples, **change))  # type: ignore[arg-type]


@pytest.mark.slow
def test_depths_a_twentieth_of_the_distance_apart_are_enough(samples: GridSamples) -> None:
    near = replace(samples, depths_mm=np.array([500.0, 507.0, 514.0, 521.0, 527.0]))
    assert fit_grid(near).grid is not None


@pytest.mark.slow
def test_models_have_one_interface(samples: GridSamples) -> None:
    rig = with_grid(samples)
    assert isinstance(correspondence(rig), GridModel)
    assert isinstance(correspondence(published_rig()), GratingModel)
    pixels, depth = torch.tensor([100, 250_000]), torch.tensor([600.0, 700.0])
    for model in (correspondence(rig, "grid"), correspondence(rig, "grating")):
        footprint = model.trace(pixels, depth, 1, BANDS_NM)
        assert footprint.columns.shape == footprint.rows.shape == (47, 2)
        zero = model.trace(pixels, depth, 0, BANDS_NM)
        assert torch.equal(zero.columns[0], zero.columns[-1])


def test_second_orders_are_where_the_grating_equation_puts_them(samples: GridSamples) -> None:
    rig, pixels, depth = with_grid(samples), torch.tensor([250_000]), torch.tensor([700.0])
    found, expected = (
        model.trace(pixels, depth, 2, BANDS_NM) for model in (GridModel(rig), GratingModel(rig))
    )
    assert torch.equal(found.columns, expected.columns)


def test_missing_grid_order_and_unknown_model_are_told(samples: GridSamples) -> None:
    rig = with_grid(samples)
    assert rig.correspondence is not None
    half = rig.model_copy(update={"correspondence": rig.correspondence.model_copy(update={"orders": (1,)})})
    pixels, depth = torch.tensor([0]), torch.tensor([700.0])
    with pytest.raises(CalibrationError, match="covers orders"):
        GridModel(half).trace(pixels, depth, -1, BANDS_NM)
    with pytest.raises(CalibrationError, match="no data-driven correspondence"):
        correspondence(published_rig(), "grid")
    with pytest.raises(CalibrationError, match="choose auto, grating, hybrid or grid"):
        correspondence(rig, "spline")


def test_grid_of_the_seed_follows_from_the_same_samples() -> None:
    rig = small_rig()
    samples = one_a_tile(samples_of(rig, 0.0))
    fit = fit_stage_grid(rig, samples)
    assert fit.grid.depth_range_mm == (600.0, 900.0)
    model = correspondence(rig.model_copy(update={"correspondence": fit.grid}), "grid")
    part = samples.only((samples.order == -1) & (samples.filter == 1) & (samples.position == 1))
    pixels, depth = torch.as_tensor(part.pixel), torch.as_tensor(part.depth_mm)
    columns = model.trace(pixels, depth, -1, np.array([540.0])).columns[0].numpy()
    assert fit.rms_px < 0.002
    # Half of the nodes are reached by fewer than three depths; what is extrapolated there bends the splines.
    assert np.median(np.abs(columns - part.column_px)) < 0.1
    assert len(fit.grid.model_dump_json()) < 1_000_000
