"""The smooth correction of columns is the polynomial that its record names."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.polynomial.chebyshev import chebval

from dsl_core.model.rig import ColumnResidual
from dsl_core.optics.column_residual import chebyshev, residual_columns, scaled

DEGREES = ((0, 0, 0, 0), (1, 0, 0, 1), (4, 1, 2, 0), (0, 3, 1, 1))
RESIDUAL = ColumnResidual(
    orders=(-1, 1),
    column_range_px=(0.0, 100.0),
    row_range_px=(10.0, 50.0),
    depth_range_mm=(500.0, 1000.0),
    wavelength_range_nm=(400.0, 700.0),
    degrees=DEGREES,
    coefficients_px=((0.1, 0.2, -0.3, 0.4), (1.0, -2.0, 0.5, 0.25)),
)


def place(values: np.ndarray, low: float, high: float) -> np.ndarray:
    return np.clip(2 * (values - low) / (high - low) - 1, -1, 1)


@pytest.mark.parametrize("order", [-1, 1])
def test_columns_are_corrected_by_products_of_chebyshev_polynomials(order: int) -> None:
    rng = np.random.default_rng(0)
    x, y, z = rng.uniform(-20, 120, 30), rng.uniform(0, 60, 30), rng.uniform(450, 1100, 30)
    nm = np.array([390.0, 450.0, 555.0, 700.0, 720.0])
    found = residual_columns(
        RESIDUAL, (torch.as_tensor(x), torch.as_tensor(y)), torch.as_tensor(z), order, torch.as_tensor(nm)
    )
    assert found is not None
    parts = [place(x, 0, 100), place(y, 10, 50), place(1 / z, 1 / 1000, 1 / 500)]
    wanted = np.zeros((5, 30))
    for degrees, value in zip(DEGREES, RESIDUAL.coefficients_px[(order + 1) // 2], strict=True):
        units = [
            chebval(part, np.eye(degree + 1)[degree]) for part, degree in zip(parts, degrees[:3], strict=True)
        ]
        along = chebval(place(nm, 400, 700), np.eye(degrees[3] + 1)[degrees[3]])
        wanted += value * along[:, None] * np.prod(units, 0)
    assert found.numpy() == pytest.approx(wanted, abs=1e-12)


def test_orders_without_a_correction_and_corrections_without_terms_add_nothing() -> None:
    one = torch.ones(1, dtype=torch.float64)
    assert residual_columns(RESIDUAL, (one, one), one, 2, one) is None
    none = RESIDUAL.model_copy(update={"degrees": (), "coefficients_px": ((), ())})
    assert residual_columns(none, (one, one), one, 1, one) is None


@pytest.mark.parametrize("degree", range(5))
def test_polynomials_up_to_a_degree(degree: int) -> None:
    x = torch.linspace(-1, 1, 9, dtype=torch.float64)
    found = chebyshev(x, degree)
    assert len(found) == degree + 1
    for k, values in enumerate(found):
        assert values.numpy() == pytest.approx(np.cos(k * np.arccos(x.numpy())))


def test_a_range_is_mapped_to_minus_one_and_one_and_held_beyond() -> None:
    values = torch.tensor([1.0, 2.0, 3.5, 5.0, 9.0])
    assert scaled(values, (2.0, 5.0)).tolist() == [-1, -1, 0, 1, 1]
